"""Fans: every trajectory of a material and slope, dense enough that the flows of any base can be read off.

# notation: tau, p, L, y, k, net as in chuteflow.maps.trajectories; v = p y/a = p dtheta/dp; G grip, kappa and
# r of the base; s slope.

The base enters by two numbers alone. With shear and grip as in :mod:`chuteflow.theory.constitutive`, the heat
flux of a trajectory less that which a base would give is

    B = y - s F1 + loss = (y - s^2 shear) + weight G + level,
    weight = s^2 r^2/(2 kappa),    level = loss - s^2 sqrt(pi/2)/kappa

so that one fan serves every base. Where neighbouring trajectories part (one turns hot, one cold), others are born
between them, at the depth at which they part and from a state between theirs: surface temperatures agree there to
all digits, so that what is deep down cannot be reached by a choice of one. Above its birth a trajectory is the
mean of its neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chuteflow.branches.ranges import Range
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.tabulate import Table
from chuteflow.steady.chute import Chute
from chuteflow.steady.model import CONDUCTION, COUPLING, GAMMA, GRIP, LOSS, SHEAR, WORK, Model, evaluate_closures, model
from chuteflow.theory import boundary
from chuteflow.trajectories.surface import surface_potential

#: Step in tau, and the largest step in p over the shortest length of the equations.
_STEP, _LENGTHS_PER_STEP = 0.25, 0.6
#: Share of T, or of a length of the equations, down to which the series at the surface is used.
_START = 0.05
#: Rows close to the surface, and their step in the logarithm of the overburden.
_THIN_ROWS, _THIN_STEP = 12, 0.7
#: The functions of L are tabulated here.
_LOW, _HIGH, _ENTRIES = -25.0, 60.0, 8192
_SCALE = (_ENTRIES - 1) / (_HIGH - _LOW)
#: Trajectories end hot below this density x, and cold with y below this multiple of its scale.
_LOG_EMPTY, _COLD = math.log(1e-6), 4.0
#: Neighbours part where they differ by more in L, as far as that matters to a base, or in y.
_APART, _APART_IN_FLUX, _DILUTE = 0.65, 0.3, math.log(3e-3)
_FEWEST, _MOST_COLUMNS = 24, 3000
_SAME_COLUMN = 1e-6
#: Derivatives through five columns are taken where gaps differ by less than this factor.
_EVEN = 12.0
#: Columns nearer than this have surface temperatures that rounding makes too much alike.
_SMALLEST_GAP = 1e-8


@dataclass(frozen=True)
class Base:
    """What a base enters by: ``weight`` and ``level`` of B, and the energy ``loss`` in its collisions."""

    weight: float
    level: float
    loss: float

    @classmethod
    def of(cls, chute: Chute) -> Base:
        """The base of ``chute``, on its slope."""
        kappa = boundary.kappa(chute.roughness)
        square = chute.slope**2 / kappa
        loss = boundary.base_loss(chute.wall_restitution, chute.roughness)
        return cls(0.5 * square * chute.roughness**2, loss - square * math.sqrt(0.5 * math.pi), loss)


#: Order of the fields of a fan.
FIELDS = range(10)
HEAT_FLUX, LOG_MASS, LOG_SLIP, LOG_GLIDE, NET_LOW, NET_HIGH, STEEPEST, SURE_LOW, SURE_HIGH, SURE_STEEP = FIELDS
#: Order of what ``down`` and ``across`` of a fan hold the derivatives of.
DERIVED = EXCESS, GRIPPED, OF_FLUX, OF_SLIP, OF_GLIDE = range(5)


@dataclass(frozen=True, eq=False)
class Fan:
    """Trajectories on a grid of rows (depth, K) and columns (surface temperature, C), ascending in both.

    ``gaps`` (C - 1,) are the distances of neighbouring columns, 1 between those of the range searched, halved by
    each birth; ``place`` (T,) are the columns at the temperatures asked for; ``last`` (C,) the rows at which they
    end. The other arrays are (K, C): ``excess`` is y - s^2 shear and ``grip`` G; ``log_mass`` is ln M. ``fields``
    (10, K, C) are by the names of FIELDS y; ln M; the logarithm of M sqrt(T), which times F1 is the flux at the slip
    velocity; that of the flux by shear; the least and the largest net loss, and the largest v so far down; and these
    three again as far as they are sure where a trajectory was born.
    ``down`` and ``across`` (5, K, C) are the derivatives of y - s^2 shear, G and three of the fields, by the names
    of DERIVED, to the logarithm of p and from column to column, to a positive factor at each point.
    ``spacing`` is that of ln T for a gap of 1.
    """

    slope: float
    gaps: Array
    place: NDArray[np.intp]
    last: NDArray[np.intp]
    excess: Array
    grip: Array
    log_mass: Array
    fields: Array
    down: Array
    across: Array
    spacing: float

    def of_base(self, base: Base) -> Array:
        """B on the grid for ``base``."""
        return self.excess + (base.weight * self.grip + base.level)


def fan(chute: Chute, bases: Sequence[Base], within: Range, asked: Array, per_decade: int) -> Fan:
    """The fan of the grains, slope and surface of ``chute`` that serves ``bases`` and all between them.

    ``asked`` (T,) are surface temperatures that get a column of their own.
    """
    problem = model(replace(chute, wall_restitution=0.5, roughness=0.6))
    decades = math.log10(within.hottest / within.coldest)
    columns = np.geomspace(within.coldest, within.hottest, max(_FEWEST, math.ceil(per_decade * decades)) + 1)
    ranks = np.arange(len(columns), dtype=float)
    wanted = np.interp(np.log(asked), np.log(columns), ranks)
    sigma = np.unique(np.concatenate([ranks, wanted[np.abs(wanted - np.rint(wanted)) > _SAME_COLUMN]]))
    temperature = np.exp(np.interp(sigma, ranks, np.log(columns)))
    grown = _grow(problem, bases, temperature, np.diff(sigma), within.deepest)
    if len(grown.order) > len(sigma):
        # What was born is as good as interpolation; as far as surface temperatures can tell, it is grown anew.
        sigma = np.append(0.0, np.cumsum(grown.gaps))
        sigma = np.concatenate([sigma[:1], sigma[1:][grown.gaps > _SMALLEST_GAP]])
        temperature = np.exp(np.interp(sigma, ranks, np.log(columns)))
        grown = _grow(problem, bases, temperature, np.diff(sigma), within.deepest)
    number = np.searchsorted(sigma, wanted - _SAME_COLUMN)
    return _finished(problem, grown, np.flatnonzero(np.isin(grown.order, number)), math.log(columns[1] / columns[0]))


@dataclass(frozen=True, eq=False)
class _Grown:
    """Trajectories as they were integrated: ``states`` (K, 4, C) of p, L, y and tau.

    ``order`` (C,) are the numbers of the columns, in which those that were born come last; ``gaps`` (C - 1,). The
    first ``thin`` rows lie close to the surface; ``p1`` is where the rows turn from logarithmic to even in p.
    ``blurred`` (C,) are the rows from which a trajectory is known no better than neighbours part, since it was born
    there, or one that it was born from.
    """

    states: Array
    order: NDArray[np.intp]
    gaps: Array
    thin: int
    p1: float
    blurred: NDArray[np.intp]


@lru_cache(maxsize=4)
def _tabulated(table: Table) -> Array:
    """The closures (8, entries) on a uniform grid of L."""
    values, _ = evaluate_closures(table, np.exp(np.linspace(_LOW, _HIGH, _ENTRIES)))
    return values


def _with_increments(values: Array) -> Array:
    return np.concatenate([values, np.diff(values, axis=1, append=values[:, -1:])])


def _interpolated(table: Array, big_l: Array) -> Array:
    # Of a state that ran off, which is ended by whoever made it, any entry will do: fmax and fmin leave no NaN.
    position = np.fmin(np.fmax((big_l - _LOW) * _SCALE, 0.0), _ENTRIES - 2.0)
    index = position.astype(np.intp)
    rows = table.take(index, axis=1)
    half = len(table) // 2
    rows[half:] *= position - index
    rows[:half] += rows[half:]
    return rows[:half]


def _grow(problem: Model, bases: Sequence[Base], temperature: Array, gaps: Array, mass: float) -> _Grown:
    """Integrate from the surface down, with more columns where neighbours part."""
    square = problem.slope**2
    closures = _tabulated(problem.table)
    net = closures[LOSS] - square * closures[WORK]
    pace = _with_increments(np.stack([1.0 / closures[CONDUCTION], closures[COUPLING], net]))
    rate = float(np.sqrt(2.0 * np.abs(net) / closures[CONDUCTION]).max())
    balance = float(np.sqrt(2.0 * np.maximum(net, 0.0) * closures[CONDUCTION]).max())
    p1 = _LENGTHS_PER_STEP / (_STEP * max(rate, 1e-3))
    end = problem.surface_stress + mass
    given = np.array([square * closures[SHEAR] - b.weight * closures[GRIP] - b.level for b in bases])
    window = (float(given.min()) - 0.3, float(given.max()) + 0.3)
    floor = min(-_COLD * (balance + rate + 2.0 + square), window[0])
    # In the empty state y rises to this limit, never to fall again: no base is met beyond its own flux.
    limit = math.sqrt(max(2.0 * net[0] * closures[CONDUCTION, 0], 0.0))
    emptiest, fullest = float(given[:, 0].min()), float(given[:, 0].max())
    ceiling = min(fullest, limit) if emptiest <= limit else 0.0

    def derivative(state: Array) -> Array:
        p, big_l, y, _ = state
        inverse, k, net = _interpolated(pace, big_l)
        v = p * y * inverse
        still = 1.0 - v
        out = np.empty_like(state)
        out[0] = p
        out[1] = still
        out[2] = p * net - y * (1.0 + 0.5 * (v + k * still))
        out[:3] *= _advance(p, v, p1)
        out[3] = 1.0
        return out

    state = _start(problem, temperature, rate)
    order = np.arange(len(temperature))
    alive = np.ones(len(temperature), dtype=bool)
    rows = [state]
    births: list[tuple[int, NDArray[np.intp], Array]] = []
    while alive.any():
        moving = np.flatnonzero(alive)
        before = state[:, moving]
        with np.errstate(over="ignore", invalid="ignore"):
            after = _runge_kutta_step(derivative, before, _STEP)
            ended = after[0] >= end
            if ended.any():
                after[:, ended] = _last_step(derivative, before[:, ended], after[:, ended], end)
        _p, big_l, y, _ = after
        cold = ~(y >= floor) | (big_l > _HIGH)
        # A cold trajectory may run off to infinity within a step.
        after[:, cold] = np.stack(
            [before[0, cold], np.minimum(before[1, cold] + 1.0, _HIGH), np.full(cold.sum(), floor), before[3, cold]]
        )
        done = cold | ended
        if net[0] > 0.0:
            done |= (big_l < _LOG_EMPTY) & (y >= 0.0) & (y >= ceiling)
        state = state.copy()
        state[:, moving] = after
        alive[moving[done]] = False
        rows.append(state)
        left = _parting(state, order, alive, window)
        if left.size and len(order) + left.size <= _MOST_COLUMNS:
            sources, weights = _between(state, order, gaps, left)
            births.append((len(rows) - 1, sources, weights))
            born = _mean(state[:, sources], weights)
            fresh = np.arange(len(order), len(order) + left.size)
            gaps[left] *= 0.5
            gaps = np.insert(gaps, left, gaps[left])
            order = np.insert(order, left + 1, fresh)
            alive = np.append(alive, np.ones(left.size, dtype=bool))
            state = np.concatenate([state, born], axis=1)
            rows[-1] = state
    thin = _thin_rows(problem, temperature, rows[0], rows[1][:, : len(temperature)], derivative)
    top = int(problem.surface_stress > 0.0)  # a base at the interface itself has no flow
    rows = [*thin, *rows[top:]]
    states = np.empty((len(rows), 4, len(order)))
    for k, row in enumerate(rows):
        states[k, :, : row.shape[1]] = row
    first = len(temperature)
    blurred = np.full(len(order), len(rows))
    for k, sources, weights in births:
        depth, count = k + len(thin) - top, sources.shape[1]
        history = states[:depth][:, :, sources]  # (depth, 4, 4, births)
        states[:depth, :, first : first + count] = np.moveaxis(_mean(np.moveaxis(history, 1, 0), weights), 0, 1)
        blurred[first : first + count] = np.minimum(depth, blurred[sources].min(axis=0))
        first += count
    return _Grown(states[:, :, order], order, gaps, len(thin), p1, blurred[order])


def _thin_rows(
    problem: Model, temperature: Array, first: Array, second: Array, derivative: Callable[[Array], Array]
) -> Array:
    """Rows (j, 4, C) for bases close to the surface, evenly in the logarithm of the overburden.

    On the half-line they go up from the first row, by the series there; at the interface they lie between the
    first two rows, by the parabola through both that leaves the first with its slope.
    """
    shares = np.exp(-_THIN_STEP * np.arange(_THIN_ROWS, 0, -1))[:, None]
    if problem.surface_stress == 0.0:
        return np.moveaxis(series(problem, temperature, first[0] * shares), 0, 1)
    over = second[0] - first[0]
    slopes = derivative(first)
    by_over = slopes[1:3] / slopes[0]
    bend = second[1:3] - first[1:3] - by_over * over
    thin = np.zeros((_THIN_ROWS, *first.shape))
    thin[:, 0] = first[0] + shares * over
    thin[:, 1:3] = first[1:3] + (by_over * over) * shares[:, None] + bend * shares[:, None] ** 2
    return thin


def _parting(
    state: Array, order: NDArray[np.intp], alive: NDArray[np.bool_], window: tuple[float, float]
) -> NDArray[np.intp]:
    """Places in ``order`` of the left of two neighbours that part."""
    both = alive[order[:-1]] & alive[order[1:]]
    big_l = np.maximum(state[1, order], _DILUTE)
    y = np.clip(state[2, order], *window)
    wide = np.abs(np.diff(big_l)) + np.abs(np.diff(y)) * (_APART / _APART_IN_FLUX) > _APART
    # Where both are beyond what any base gives, on the same side, none is met between them.
    same = (y[1:] == y[:-1]) & ((y[1:] == window[0]) | (y[1:] == window[1]))
    return np.flatnonzero(both & wide & ~same)


def _between(
    state: Array, order: NDArray[np.intp], gaps: Array, left: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Array]:
    """Columns and weights (4, births) that make states half-way between columns ``left`` and their neighbours:
    cubic where the outer two are near, else linear."""
    first = np.clip(left - 1, 0, len(order) - 4)
    sources = order[first + np.arange(4)[:, None]]
    near = np.abs(np.diff(state[1:3][:, sources], axis=1)).max(axis=(0, 1)) < 3.0 * _APART
    # Distances are relative to the gap that is halved: they may be too small to be added to anything.
    ahead = gaps[first + np.arange(3)[:, None]] / gaps[left]
    at = np.concatenate([np.zeros((1, left.size)), np.cumsum(ahead, axis=0)])
    inner = np.take_along_axis(at, (left - first)[None, :], axis=0)[0]
    weights = np.where(np.arange(4)[:, None] - (left - first) == 0, 0.5, 0.0)
    weights += np.where(np.arange(4)[:, None] - (left - first) == 1, 0.5, 0.0)
    weights[:, near] = lagrange(at[:, near], inner[near] + 0.5)
    return sources, weights


def _mean(states: Array, weights: Array) -> Array:
    """Means of ``states`` (4, ..., 4, n) by ``weights`` (4, n), of the logarithm of p, which is positive."""
    return np.concatenate([np.exp((np.log(states[:1]) * weights).sum(axis=-2)), (states[1:] * weights).sum(axis=-2)])


def lagrange(at: Array, x: Array) -> Array:
    """Weights (4, n) of cubic interpolation at ``x`` (n,) from values at ``at`` (4, n)."""
    off = x - at
    weights = np.empty_like(off)
    for i in range(4):
        j, k, m = (other for other in range(4) if other != i)
        numerator = off[j] * off[k] * off[m]
        weights[i] = numerator / ((at[i] - at[j]) * (at[i] - at[k]) * (at[i] - at[m]))
    return weights


def _advance(p: Array, v: Array, p1: float) -> Array:
    """d ln p/dtau: 1 in the thin layer at the surface, p1/p below, less where a trajectory runs cold."""
    return 1.0 / (1.0 + p * (1.0 / p1) + 0.5 * (np.sqrt(v * v + 1.0) - v))


def _last_step(derivative: Callable[[Array], Array], before: Array, after: Array, end: float) -> Array:
    """The states where p is ``end``, between two."""
    whole = np.log(after[0] / before[0])
    left = math.log(end) - np.log(before[0])
    step = _STEP * left / whole
    for _ in range(3):
        after = _runge_kutta_step(derivative, before, step)
        step = step * left / np.log(after[0] / before[0])
    after[0] = end
    return after


def _runge_kutta_step(derivative: Callable[[Array], Array], state: Array, step: Array | float) -> Array:
    half = 0.5 * step
    a = derivative(state)
    b = derivative(state + half * a)
    c = derivative(state + half * b)
    d = derivative(state + step * c)
    return state + (step / 6.0) * (a + 2.0 * (b + c) + d)


def _start(problem: Model, temperature: Array, rate: float) -> Array:
    """p, L, y and tau = 0 where the integration begins: a little below p = 0, or at the interface (3.32)."""
    if problem.surface_stress == 0.0:
        return series(problem, temperature, _START * np.minimum(temperature, 1.0 / max(rate, 1.0)))
    p = np.full_like(temperature, problem.surface_stress)
    big_l = np.log(p) - surface_potential(problem, temperature)
    return np.stack([p, big_l, np.full_like(p, problem.surface_flux), np.zeros_like(p)])


def series(problem: Model, temperature: Array, p: Array) -> Array:
    """p, L, y and tau = 0 by the series at the surface of the half-line (3.23)-(3.25)."""
    square = problem.slope**2
    f0, _ = problem.closures(np.zeros(1))
    half = 0.5 * (f0[LOSS, 0] - square * f0[WORK, 0])
    theta = np.log(temperature) + 0.5 * p**2 * half / f0[CONDUCTION, 0]
    x = p * np.exp(-theta)
    f, _ = problem.closures(x)
    net = f[LOSS] - square * f[WORK]
    v = p**2 * half / f[CONDUCTION]
    y = p * (half + (net - 2.0 * half) / 3.0 - half * (v + f[COUPLING] * (1.0 - v)) / 6.0)
    return np.stack([p, np.log(x), y, np.zeros_like(y)])


def _finished(problem: Model, grown: _Grown, columns: NDArray[np.intp], spacing: float) -> Fan:
    """The fan of trajectories that were integrated."""
    p, big_l, y, tau = np.moveaxis(grown.states, 1, 0)
    slope = problem.slope
    closures = _tabulated(problem.table)
    net = closures[LOSS] - slope**2 * closures[WORK]
    in_balance = float(np.abs(np.gradient(net)[np.abs(net).argmin()])) * _SCALE
    wanted = [*closures[[SHEAR, GRIP]], *np.gradient(closures[[SHEAR, GRIP]], axis=1) * _SCALE]
    wanted += [*closures[[WORK, GAMMA, COUPLING]], net, 1.0 / closures[CONDUCTION]]
    shear, grip, shear_slope, grip_slope, work, gamma, k, net, inverse = _interpolated(
        _with_increments(np.stack(wanted)), big_l
    )
    over = np.maximum(p - problem.surface_stress, np.finfo(float).tiny)
    log_root_t = 0.5 * (np.log(p) + gamma - big_l)
    rate = slope * over * work * np.exp(log_root_t)  # of the flux by shear, in p
    glide = 0.5 * rate * over
    below = grown.thin
    turn = p * y * inverse
    pace = p * _advance(p, turn, grown.p1)
    glide[below:] = glide[below] + _running((rate * pace)[below:], tau[below:])
    glide = np.maximum(glide, np.finfo(float).tiny)
    excess, log_mass = y - slope**2 * shear, np.log(over)
    log_slip, log_glide = log_mass + log_root_t, np.log(glide)
    still = 1.0 - turn
    warming = turn + k * still  # d ln T
    cooling = p * net - y * (1.0 + 0.5 * warming)  # dy
    down = [cooling - slope**2 * shear_slope * still, grip_slope * still, cooling]
    down += [p / over + 0.5 * warming, rate * p / glide]
    # Neighbours may have parted by so much before one is born between them.
    blurred = (np.arange(len(p))[:, None] >= grown.blurred) * math.exp(_LENGTHS_PER_STEP)
    of_net, of_turn = blurred * (_APART * in_balance), blurred * (_APART_IN_FLUX * p * inverse)
    return Fan(
        slope=slope,
        gaps=grown.gaps,
        place=columns,
        last=len(p) - 1 - (np.diff(tau[::-1], axis=0) > 0.0).argmax(axis=0),
        excess=excess,
        grip=grip,
        log_mass=log_mass,
        fields=np.stack(
            [
                y,
                log_mass,
                log_slip,
                log_glide,
                np.minimum.accumulate(net, axis=0),
                np.maximum.accumulate(net, axis=0),
                np.maximum.accumulate(turn, axis=0),
                np.minimum.accumulate(net + of_net, axis=0),
                np.maximum.accumulate(net - of_net, axis=0),
                np.maximum.accumulate(turn - of_turn, axis=0),
            ]
        ),
        down=np.stack(down),
        across=_across(np.stack([excess, grip, y, log_slip, log_glide]), grown.gaps, big_l),
        spacing=spacing,
    )


def _across(values: Array, gaps: Array, big_l: Array) -> Array:
    """Derivatives of ``values`` (..., C) from column to column, to a positive factor for each column.

    Through five columns where they have not parted and their gaps are not too uneven, else through three.
    """
    count = len(gaps) + 1
    out = _through(values, gaps, 3)[0]
    first = np.clip(np.arange(count) - 2, 0, count - 5)
    fine, widths = _through(values, gaps, 5)
    even = (widths > 1.0 / _EVEN).all(axis=0) & (widths < _EVEN).all(axis=0)
    near = np.abs(big_l[:, first + 4] - big_l[:, first]) < 3.0 * _APART
    return np.where(even & near, fine, out)


def _through(values: Array, gaps: Array, points: int) -> tuple[Array, Array]:
    """Derivatives of ``values`` (..., C) at columns by polynomials through ``points`` of them, in units of a gap of
    each, and the gaps in these units (points - 1, C)."""
    count = len(gaps) + 1
    here = np.arange(count)
    first = np.clip(here - points // 2, 0, count - points)
    widths = gaps[first + np.arange(points - 1)[:, None]] / gaps[np.minimum(here, count - 2)]
    at = np.concatenate([np.zeros((1, count)), np.cumsum(widths, axis=0)])
    off = at[here - first, here] - at
    aside = points // 2
    ends = np.append(here[:aside], here[-aside:])
    inner = np.zeros((*values.shape[:-1], count - 2 * aside))
    outer = np.zeros((*values.shape[:-1], 2 * aside))
    for j in range(points):
        others = [k for k in range(points) if k != j]
        own = here - first == j
        # The factor of the column itself is left out of the product; at the column the weight is the sum of 1/off.
        product = np.prod([np.where(here - first == k, 1.0, off[k]) for k in others], axis=0)
        weight = product / np.prod([at[j] - at[k] for k in others], axis=0)
        weight[own] = np.sum([1.0 / off[k][own] for k in others], axis=0)
        inner += weight[aside:-aside] * values[..., j : count - 2 * aside + j]
        outer += weight[ends] * values[..., first[ends] + j]
    out = np.concatenate([outer[..., :aside], inner, outer[..., aside:]], axis=-1)
    return out, widths


def _running(rate: Array, tau: Array) -> Array:
    """Integrals over tau from the first row: of cubics through four rows where they are evenly spaced."""
    steps = np.diff(tau, axis=0)
    areas = 0.5 * steps * (rate[1:] + rate[:-1])
    even = np.abs(steps[2:] - steps[:-2]) < 1e-6
    bend = (rate[1:-2] + rate[2:-1] - rate[:-3] - rate[3:]) * steps[1:-1] / 24.0
    areas[1:-1] += np.where(even, bend, 0.0)
    total = np.zeros_like(rate)
    np.cumsum(areas, axis=0, out=total[1:])
    return total
