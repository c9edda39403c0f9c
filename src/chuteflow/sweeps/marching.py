"""Integration from the surface down of many members at once, and the places on the way where something happens.

# notation: tau the step variable, d ln p/d tau = 1/(1 + p/p_1): logarithmic in the thin layer at the surface,
# uniform below.

The method is DOP853 (Hairer, Norsett & Wanner 1993), each member with its own step. An event is a function of the
state that changes its sign; it is seen at the stages of a step, and located by shorter steps from the same
start, which are as accurate as the integration itself. Steps in which an event may have two zeros, or nearly
has, are looked at more closely. Nothing of a member depends on the members beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.roots import find_zeros
from chuteflow.sweeps.aligned import AlignedArrays
from chuteflow.sweeps.batch import FLUX, HEIGHT, LOG_P, LOG_X, MOMENT, ROWS, SHEAR_FLUX, Batch, Indices, Pointwise

Event = Callable[[Pointwise, Indices], Array]

#: Members treated at once: so many that the interpreter does not count, so few that they fit the cache.
MEMBERS = 16384
_DENSE = 60.0
#: Densities X below which a member may end as an empty one: the first of them at which that can be decided.
_THIN = (1e-2, 1e-3, 1e-6)
#: By how much p is beyond what the empty state asks for, so that X and the coupling of the heat flux do not matter.
_FIRMLY = 1.2
_COLD = 4.0
_MOST_STEPS = 4000
#: Parts of a step that is examined more closely.
_PARTS = 8
#: A zero is known to this fraction of its step, or where its event is this small.
_RESOLUTION, _SMALL = 4e-15, 1e-16
#: A turn of an event this near to zero, in the spread of its values in the step, is examined more closely.
_NEAR = 0.3
#: Nodes of Gauss's rule with three points on [0, 1], and its weights.
_GAUSS = ((0.1127016653792583, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.8872983346207417, 5.0 / 18.0))


@dataclass(frozen=True)
class Accuracy:
    """``tolerance`` of a step, relative, in every row of the state but the height; and the fraction ``start`` of T, or
    of a length of the equations, at which the series at a free surface is left."""

    tolerance: float
    start: float


@dataclass(frozen=True, eq=False)
class Ends(AlignedArrays):
    """Where members end (n,): at the normal stress ``deepest``; cold, with a heat flux below ``floor``; and hot, ever
    emptier, with ln X below ``thin``, p above ``settled`` and the heat flux between ``low`` and ``high``, beyond
    which no base is met. ``turn`` is p_1, and ``rate`` the fastest of y in p."""

    deepest: Array
    floor: Array
    thin: Array
    settled: Array
    low: Array
    high: Array
    turn: Array
    rate: Array

    @classmethod
    def of(cls, batch: Batch, deepest: Array) -> Ends:
        """The ends of the members of ``batch`` at normal stresses ``deepest`` (n,)."""
        rate, balance = batch.fastest_rates()
        floor = -_COLD * (balance + rate + 2.0 + batch.slope**2)
        thin = np.full(len(batch), -np.inf)
        settled, low, high = np.full((3, len(batch)), np.inf)
        for x in _THIN:
            ends = _hot_end(batch, x)
            new = np.isneginf(thin) & np.isfinite(ends[0])
            thin[new] = np.log(x)
            settled[new], low[new], high[new] = ends[:, new]
        return cls(deepest, floor, thin, settled, low, high, 1.0 / np.maximum(rate, 1e-3), rate)

    def above(self, deepest: Array) -> Ends:
        """The same, but no deeper than ``deepest`` (n,)."""
        return replace(self, deepest=np.minimum(self.deepest, deepest))

    def hot(self, p: Array, state: Array, slope: Array) -> NDArray[np.bool_]:
        """Which members have come to their hot end, by their states and derivatives (ROWS, n)."""
        emptier = (slope[LOG_X] < 0.0) & (state[LOG_X] < self.thin) & (p > self.settled)
        return emptier & (state[FLUX] > self.low) & (state[FLUX] < self.high)


def _hot_end(batch: Batch, x: float) -> Array:
    """p, and the least and largest heat flux (3, n), beyond which a member emptier than X meets no base any more;
    infinite where that cannot be decided.

    In the empty state dv/dln p = p^2 net/a - v^2/2, so that v > 1, with which the density falls, lasts where
    p^2 > a/(2 net); and dy/dp = net - y/p - y^2/(2 a), which keeps y above or below the flux of the base for good
    where it points away from it.
    """
    empty, thin = (batch.at_density(np.full(len(batch), one)) for one in (1e-12, x))
    # All are nearly straight in X so close to the empty state, and lie between the ends, within as much again.
    (a_low, a_high), (net_low, net_high), (base_low, base_high) = (_span(empty[i], thin[i]) for i in range(3))
    loses = (net_low > 0.0) & (a_low > 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        lasts = _FIRMLY * np.sqrt(a_high / (2.0 * net_low))
        over = loses & (base_low > np.sqrt(2.0 * net_high * a_high))
        rising = net_low - base_high**2 / (2.0 * a_low)
        under = loses & ((base_high <= 0.0) | (rising > 0.0))
        above = np.where(base_high > 0.0, _FIRMLY * base_high / rising, 0.0)
    out = np.full((3, len(batch)), np.inf)
    out[:, under] = np.maximum(lasts, above)[under], np.maximum(base_high, 0.0)[under], np.full(under.sum(), np.inf)
    out[:, over] = lasts[over], np.full(over.sum(), -np.inf), base_low[over]
    return out


def _span(one: Array, other: Array) -> tuple[Array, Array]:
    """Least and largest of two values, each by their distance further out."""
    apart = np.abs(other - one)
    return np.minimum(one, other) - apart, np.maximum(one, other) + apart


@dataclass(frozen=True, eq=False)
class EventZeros:
    """Zeros of an event in order of members, along each from the surface down: ``member`` (k,) and ``state`` (ROWS, k).

    ``trouble`` (n,) marks the members on which zeros may be missing: where the integration gave up, or a zero lies
    above its start.
    """

    member: Indices
    state: Array
    trouble: NDArray[np.bool_]


@lru_cache(maxsize=1)
def _tableau() -> tuple[Array, Array, Array, Array]:
    """Weights of the stages, of the step and of the two estimates of its error."""
    from scipy.integrate import DOP853

    return np.array(DOP853.A[:12, :12]), np.array(DOP853.B), np.array(DOP853.E3), np.array(DOP853.E5)


#: Stages at which an event is seen, in the order of their places in the step; the last is its end.
_SEEN = (0, 6, 5, 9, 10, 12)


def march(
    batch: Batch,
    temperature: Array,
    ends: Ends,
    accuracy: Accuracy,
    event: Event,
) -> EventZeros:
    """All zeros of ``event`` on the trajectories from the surface temperatures ``temperature`` (n,).

    ``event`` takes the fields at one point of some members and the numbers of the members.
    """
    n = len(batch)
    trouble = np.zeros(n, dtype=bool)
    zeros: list[tuple[Indices, Array]] = []
    for first in range(0, n, MEMBERS):
        members = np.arange(first, min(first + MEMBERS, n))
        member, state = _march(
            batch.take(members),
            temperature[members],
            ends.take(members),
            accuracy,
            lambda at, some, members=members: event(at, members[some]),
            trouble[first : first + MEMBERS],
        )
        zeros.append((members[member], state))
    member = np.concatenate([z[0] for z in zeros]) if zeros else np.empty(0, dtype=np.intp)
    state = np.concatenate([z[1] for z in zeros], axis=1) if zeros else np.empty((ROWS, 0))
    order = np.lexsort((state[LOG_P], member))
    return EventZeros(member[order], state[:, order], trouble)


def _march(
    batch: Batch, temperature: Array, ends: Ends, accuracy: Accuracy, event: Event, trouble: NDArray[np.bool_]
) -> tuple[Indices, Array]:
    _, _, e3, e5 = _tableau()
    # What overflows is in a step that is rejected, or on a member that ends.
    with np.errstate(all="ignore"):
        state, above = start(batch, temperature, ends.rate, accuracy.start)
        member = np.arange(len(batch))
        here = batch.at_state(state)
        slope = np.empty_like(state)
        _in_tau(here, state, ends.turn, slope)
        seen = event(here, member)
        trouble |= (event(above, member) > 0.0) != (seen > 0.0)
        h = np.full(len(batch), 0.5)
        steps: list[tuple[Indices, Array, Array, Array]] = []
        local, edges = batch, ends
        count = 0
        while member.size:
            count += 1
            stages = np.empty((13, ROWS, member.size))
            values = np.empty((13, member.size))
            stages[0], values[0] = slope, seen
            end = _step(local, edges, state, h, stages, values, lambda at, member=member: event(at, member))
            error = _error(stages, state, end, h, e3, e5, accuracy.tolerance)
            good = error < 1.0
            factor = 0.9 * error**-0.125
            factor = np.where(np.isfinite(factor), factor, 0.2)
            # The first stages of a step into a cold end may not be finite: any such step is cut.
            good &= np.isfinite(end).all(axis=0)
            h_next = h * np.minimum(np.maximum(factor, 0.2), 5.0)
            _note(member, state, h, values, good, steps)
            state = np.where(good, end, state)
            slope = np.where(good, stages[12], slope)
            seen = np.where(good, values[12], seen)
            p, y = np.exp(state[LOG_P]), state[FLUX]
            h = h_next
            done = (p >= edges.deepest) | (y < edges.floor) | (state[LOG_X] > _DENSE)
            done |= edges.hot(p, state, slope)
            stuck = ~(h > 1e-9) | (count > _MOST_STEPS)
            trouble[member[stuck & ~done]] = True
            done |= stuck
            if done.any():
                keep = np.flatnonzero(~done)
                member, state, slope, seen, h = member[keep], state[:, keep], slope[:, keep], seen[keep], h[keep]
                local, edges = local.take(keep), edges.take(keep)
        return _located(batch, ends, steps, event)


def _in_tau(at: Pointwise, state: Array, turn: Array, out: Array) -> None:
    at.derivative(state, out)
    out /= 1.0 + at.p / turn


def _step(
    batch: Batch, ends: Ends, state: Array, h: Array, stages: Array, values: Array, event: Callable[[Pointwise], Array]
) -> Array:
    """One step of each member: fills the derivatives (13, ROWS, n) and events (13, n) at the stages after the first,
    and returns the states at the end."""
    a, b, _, _ = _tableau()
    for i in range(1, 12):
        moved = state.copy()
        moved[:HEIGHT] += h * _combined(a[i, :i], stages[:i, :HEIGHT])  # nothing depends on the height
        at = batch.at_state(moved)
        _in_tau(at, moved, ends.turn, stages[i])
        if i in _SEEN:
            values[i] = event(at)
    end = state + h * _combined(b, stages[:12])
    at = batch.at_state(end)
    _in_tau(at, end, ends.turn, stages[12])
    values[12] = event(at)
    return end


def _combined(weights: Array, stages: Array) -> Array:
    """The sum of the stages with their weights, in an order that no thread changes."""
    used = np.flatnonzero(weights)
    out = weights[used[0]] * stages[used[0]]
    for i in used[1:]:
        out += weights[i] * stages[i]
    return out


def _error(stages: Array, state: Array, end: Array, h: Array, e3: Array, e5: Array, tolerance: float) -> Array:
    """Error of ln X and y in the step over what is allowed, as Hairer's DOP853 has it."""
    rows = stages[:, :HEIGHT]
    largest = np.maximum(np.abs(state[:HEIGHT]), np.abs(end[:HEIGHT]))
    scale = tolerance * largest
    scale[:FLUX] = tolerance
    scale[FLUX] += 1e-3 * tolerance
    fifth = ((_combined(e5, rows) / scale) ** 2).sum(axis=0)
    third = ((_combined(e3, rows) / scale) ** 2).sum(axis=0)
    both = fifth + 0.01 * third
    out = np.abs(h) * fifth / np.sqrt(HEIGHT * np.maximum(both, 1e-300))
    return np.where(both > 0.0, out, np.where(both == 0.0, 1e-10, np.inf))


def _note(
    member: Indices,
    state: Array,
    h: Array,
    values: Array,
    good: NDArray[np.bool_],
    steps: list[tuple[Indices, Array, Array, Array]],
) -> None:
    """Keep the steps in which the event has a zero, or may have."""
    seen = values[list(_SEEN)]
    positive = seen > 0.0
    changes = (positive[1:] != positive[:-1]).any(axis=0)
    nearest = np.abs(seen).min(axis=0)
    inner = np.abs(seen[1:-1]).min(axis=0)
    turns = (inner < np.minimum(np.abs(seen[0]), np.abs(seen[-1]))) & (nearest < _NEAR * np.ptp(seen, axis=0))
    some = np.flatnonzero(good & (changes | turns))
    if some.size:
        steps.append((member[some], state[:, some], h[some], seen[:, some]))


def _located(
    batch: Batch, ends: Ends, steps: list[tuple[Indices, Array, Array, Array]], event: Event
) -> tuple[Indices, Array]:
    """The zeros in the steps kept."""
    if not steps:
        return np.empty(0, dtype=np.intp), np.empty((ROWS, 0))
    member = np.concatenate([s[0] for s in steps])
    state = np.concatenate([s[1] for s in steps], axis=1)
    h = np.concatenate([s[2] for s in steps])
    seen = np.concatenate([s[3] for s in steps], axis=1)
    partial = PartialSteps(batch.take(member), ends.take(member), member, state, h, event)
    positive = seen > 0.0
    changes = (positive[1:] != positive[:-1]).sum(axis=0)
    single = np.flatnonzero((changes == 1) & (positive[0] != positive[-1]))
    low, high = np.zeros(single.size), np.ones(single.size)
    brackets = [(single, low, high, seen[0, single], seen[-1, single])]
    other = np.setdiff1d(np.arange(member.size), single)
    brackets += list(_closer(partial, other, seen[0, other], seen[-1, other]))
    which, low, high, f_low, f_high = (np.concatenate(part) for part in zip(*brackets, strict=True))
    which = which.astype(np.intp)
    fraction = find_zeros(lambda some, x: partial.to(which[some], x)[1], low, high, f_low, f_high, _RESOLUTION, _SMALL)
    end, _ = partial.to(which, fraction)
    return member[which], end


@dataclass(frozen=True, eq=False)
class PartialSteps:
    """Steps from which one may go a fraction of the way: starts (ROWS, k) on the ``member`` of each, the length h."""

    batch: Batch
    ends: Ends
    member: Indices
    state: Array
    h: Array
    event: Event

    def to(self, which: Indices, fraction: Array) -> tuple[Array, Array]:
        """States (ROWS, m) and events (m,) at fractions (m,) of the steps ``which``."""
        out, values = np.empty((ROWS, which.size)), np.empty(which.size)
        for first in range(0, which.size, MEMBERS):
            part = slice(first, first + MEMBERS)
            some = which[part]
            local, edges, member = self.batch.take(some), self.ends.take(some), self.member[some]
            state = self.state[:, some]
            stages, seen = np.empty((13, ROWS, some.size)), np.empty((13, some.size))
            _in_tau(local.at_state(state), state, edges.turn, stages[0])
            out[:, part] = _step(
                local,
                edges,
                state,
                fraction[part] * self.h[some],
                stages,
                seen,
                lambda at, member=member: self.event(at, member),
            )
            values[part] = seen[12]
        return out, values


def _closer(
    partial: PartialSteps, which: Indices, first: Array, last: Array
) -> Iterator[tuple[Indices, Array, Array, Array, Array]]:
    """Brackets of zeros in steps that may hold several: between fractions of them, and beside turns near zero."""
    if not which.size:
        return
    fractions = np.linspace(0.0, 1.0, _PARTS + 1)
    values = np.empty((_PARTS + 1, which.size))
    values[0], values[-1] = first, last
    for i in range(1, _PARTS):
        values[i] = partial.to(which, np.full(which.size, fractions[i]))[1]
    at = np.broadcast_to(fractions[:, None], values.shape)
    # A parabola through three neighbours tells where a turn may pass zero; the value there is computed.
    for _ in range(3):
        left, middle, right = values[:-2], values[1:-1], values[2:]
        turn = (np.abs(middle) <= np.abs(left)) & (np.abs(middle) <= np.abs(right))
        turn &= ((left > 0.0) == (middle > 0.0)) & ((right > 0.0) == (middle > 0.0))
        if not turn.any():
            break
        row = np.where(turn, np.abs(middle), np.inf).argmin(axis=0) + 1
        columns = np.arange(which.size)
        s0, s1, s2 = (at[row + k, columns] for k in (-1, 0, 1))
        f0, f1, f2 = (values[row + k, columns] for k in (-1, 0, 1))
        one, two = (s1 - s0) * (f1 - f2), (s1 - s2) * (f1 - f0)
        bottom = one - two
        vertex = s1 - 0.5 * ((s1 - s0) * one - (s1 - s2) * two) / np.where(bottom == 0.0, 1.0, bottom)
        inside = turn.any(axis=0) & (bottom != 0.0) & (vertex > s0) & (vertex < s2) & (vertex != s1)
        vertex = np.where(inside, vertex, 0.5 * (s0 + s1))
        there = partial.to(which, vertex)[1]
        at, values = np.vstack([at, vertex]), np.vstack([values, there])
        order = np.argsort(at, axis=0, kind="stable")
        at, values = np.take_along_axis(at, order, 0), np.take_along_axis(values, order, 0)
    rows, columns = np.nonzero((values[1:] > 0.0) != (values[:-1] > 0.0))
    yield which[columns], at[rows, columns], at[rows + 1, columns], values[rows, columns], values[rows + 1, columns]


def start(batch: Batch, temperature: Array, rate: Array, fraction: float) -> tuple[Array, Pointwise]:
    """States (ROWS, n) a little below the free surface, or at the interface, and the fields at the very surface."""
    if batch.surface_stress:
        state = _at_interface(batch, temperature)
        return state, batch.at_state(state)
    p = fraction * np.minimum(temperature, 1.0 / np.maximum(rate, 1.0))
    empty = Pointwise(batch, np.zeros_like(p), np.full_like(p, -690.0), np.zeros_like(p))
    return _series(batch, temperature, p, empty), empty


def _series(batch: Batch, temperature: Array, p: Array, empty: Pointwise) -> Array:
    """The state at p by the series at the surface of the half-line, (3.23)-(3.25): y and theta to a relative p^2."""
    half = 0.5 * empty.net
    lean = half / empty.conduction
    theta = np.log(temperature) + 0.5 * p**2 * lean
    x = p * np.exp(-theta)
    y = p * half
    densest = batch.law.densest
    for _ in range(6):
        nu = x / (1.0 + x / densest)
        gamma = np.zeros_like(p)
        for node, weight in _GAUSS:
            inner = node * nu
            gamma += weight * nu * _coupling(batch, inner / (1.0 - inner / densest))
        at = Pointwise(batch, p, np.log(x), y)
        y = p * (half + (at.net - empty.net) / 3.0 - half * (at.v + at.coupling * (1.0 - at.v)) / 6.0)
        theta = np.log(temperature) + 0.5 * p**2 * lean + p * (y / at.conduction - p * lean) / 3.0
        nu = p * np.exp(-theta - gamma) / (p / (at.nu * at.temperature))
        x = nu / (1.0 - nu / densest)
    at = Pointwise(batch, p, np.log(x), y)
    state, derivative = np.zeros((ROWS, p.size)), np.empty((ROWS, p.size))
    state[LOG_P], state[LOG_X], state[FLUX] = np.log(p), np.log(x), y
    at.derivative(state, derivative)
    # P dz/dp runs from T at the surface, P du/dp over P from its value in an empty flow; z is counted from here.
    thickness = derivative[HEIGHT]
    thinning = thickness * (1.0 - derivative[LOG_X] / (1.0 + x / densest))
    state[MOMENT] = (temperature + 2.0 * thickness) / 3.0 - thinning / 6.0
    state[SHEAR_FLUX] = batch.slope * empty.work * np.sqrt(temperature) / 6.0 + derivative[SHEAR_FLUX] / 3.0
    return state


def _coupling(batch: Batch, x: Array) -> Array:
    """g4/g3 at X."""
    at = Pointwise(batch, np.ones_like(x), np.log(x), np.zeros_like(x))
    return at.raw_coupling


def _at_interface(batch: Batch, temperature: Array) -> Array:
    """The state at the interface (3.31), (3.32): the density is that of p_S and T."""
    p = np.full(len(batch), batch.surface_stress)
    log_x = np.log(p / temperature)
    for _ in range(100):
        at = Pointwise(batch, p, log_x, np.zeros_like(p))
        # d ln g1/d ln X = stiffness dln nu/dln X
        move = np.clip(np.log(at.temperature / temperature) / at.stiff_x, -2.0, 2.0)
        log_x = log_x + move
        if np.abs(move).max(initial=0.0) < 1e-14:
            break
    state = np.zeros((ROWS, len(batch)))
    state[LOG_P], state[LOG_X] = np.log(p), log_x
    state[FLUX] = -(batch.slope**2)  # (3.32)
    return state
