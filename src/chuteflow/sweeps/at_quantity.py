"""Every flow of many chutes at a given flux, hold-up or centre of mass.

# notation: a trajectory is that of one chute from one surface temperature; its flows are counted from the
# surface down.

The flows of one surface temperature alternate in the sign with which the heat flux passes that of the base, so that
the k-th of one trajectory goes over into the k-th of the next, unless two have met between them or one has left to
large hold-ups. Trajectories are added where that is so, or where the quantity turns, near the requested value, until
every flow lies between two trajectories whose flows are known to go over into each other; there it is found as the
zero of one function of the surface temperature.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chuteflow.branches.rough_turns import may_turn
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.roots import find_zeros
from chuteflow.parameters import DEEPEST, WIDEST
from chuteflow.steady.collocation import LOG_M, LOG_T
from chuteflow.sweeps.aligned import AlignedArrays
from chuteflow.sweeps.bases import LADDER, SAFETY, Flows, evaluate_flows, least_error, meets_base
from chuteflow.sweeps.batch import Batch, Indices
from chuteflow.sweeps.marching import Accuracy, Ends, EventZeros, march

#: Trajectories per decade of surface temperature to begin with.
_PER_DECADE = 4
#: Accuracy of the trajectories, and for those whose first flow lies above the start.
_ROUGH, _THIN = Accuracy(1e-5, 1e-2), Accuracy(1e-5, 1e-8)
#: Flows kept of a trajectory; a chute with more is left to the search by branches.
_MOST = 12
#: Flows of two trajectories go over into each other if no logarithm differs by more than this, and this times ln T's.
_APART, _BY_TEMPERATURE = 0.3, 2.0
#: Rounds of new trajectories. The few members that want more are searched one by one, which is cheaper by then.
_ROUNDS = 14
#: The range is widened at most so often, where ln of the quantity rises at least with this power of T.
_WIDENINGS, _LEADS = 4, 0.25
#: Flows this near to the largest hold-up, in the logarithm, may lead beyond it, with at most this power of M.
_AT_EDGE, _STEEPEST = 0.3, 4.0
#: Trajectories reach to hold-ups a little beyond the requested ones, so that no flow lies beside the last one.
_BEYOND = 1.1
#: Where two flows meet, the value there lies within this many of their distances, this many steps in ln T beside, and
#: a little.
_ASIDE, _AWAY, _LITTLE = 1.0, 1.0, 1e-3
#: Between trajectories a quantity departs from its values there by at most this part of what its slope changes over the
#: step; and what rough trajectories may be off.
_SAG, _NOISE = 0.5, 2e-5
#: In steps of ln T narrower than this rough trajectories do not tell turns from noise: such members are searched one by
#: one.
_NARROWEST = 1e-3
#: A zero in ln T is known to this by rough trajectories, and the steps that finer ones then take at most.
_NEAR, _MOST_STEPS = 1e-7, 6
#: A flow meets the requested value to this.
_MEETS = 1e-11


@dataclass(frozen=True, eq=False)
class ScannedFlows(AlignedArrays):
    """Trajectories in order of members and temperature: ``member`` and ``log_t`` (c,), how many flows each has (c,), -1
    where that is not known, and ``flows`` (c, _MOST, 3), their ln Q, ln h and ln M, NaN where there is none."""

    member: Indices
    log_t: Array
    count: Indices
    flows: Array

    def joined(self, other: ScannedFlows) -> ScannedFlows:
        """Both in order."""
        both = self.and_all([other])
        return both.take(np.lexsort((both.log_t, both.member)))

    def of(self, members: NDArray[np.bool_]) -> ScannedFlows:
        """The trajectories of some members."""
        return self.take(members[self.member])


@dataclass(frozen=True, eq=False)
class Brackets(AlignedArrays):
    """Flows that lie between two trajectories: ``member``, ``place`` among the flows from the surface, ends in ln T and
    the ln of the quantity over its value there, and the largest ``hold_up`` at the ends; (b,) each."""

    member: Indices
    place: Indices
    low: Array
    high: Array
    f_low: Array
    f_high: Array
    log_m: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """The chutes, the requested quantity by its place in the macroscopic ones, ln of its values (n,), and the ends of
    the members."""

    batch: Batch
    which: int
    target: Array
    ends: Ends
    deepest: Array

    def trajectories(self, member: Indices, log_t: Array) -> ScannedFlows:
        """Rough trajectories of ``member`` (c,) at ``log_t`` (c,)."""
        found, trouble = self._marched(member, log_t, _ROUGH)
        again = np.flatnonzero(trouble)
        if again.size:
            thin, still = self._marched(member[again], log_t[again], _THIN)
            found = Flows.joined([found.take(~trouble[found.member]), replace(thin, member=again[thin.member])])
            trouble[again] = still
        found = found.take(np.lexsort((found.macroscopic[LOG_M], found.member)))
        count = np.bincount(found.member, minlength=member.size)
        place = np.arange(found.member.size) - (np.cumsum(count) - count)[found.member]
        kept = place < _MOST
        flows = np.full((member.size, _MOST, 3), np.nan)
        flows[found.member[kept], place[kept]] = found.macroscopic[:LOG_T, kept].T
        count[trouble | (count > _MOST)] = -1
        return ScannedFlows(member, log_t, count, flows)

    def _marched(self, member: Indices, log_t: Array, accuracy: Accuracy) -> tuple[Flows, NDArray[np.bool_]]:
        some, temperature = self.batch.take(member), np.exp(log_t)
        found = march(some, temperature, self.ends.take(member), accuracy, meets_base)
        return evaluate_flows(some, temperature, found), found.trouble


def solve_at_quantity(
    batch: Batch,
    which: int,
    value: Array,
    surface_temperature: tuple[float, float],
    largest_holdup: float,
    tolerance: float,
) -> tuple[Flows, NDArray[np.bool_]]:
    """Every flow with surface temperature and hold-up in the range at which the quantity ``which`` has the values
    (n,), and the members (n,) that could not be settled to ``tolerance``, which have none of those returned."""
    target = np.log(value)
    holdups = np.full(len(batch), largest_holdup)
    if which == LOG_M:
        holdups = np.maximum(holdups, value)
    deepest = _BEYOND * holdups + batch.surface_stress
    problem = Problem(batch, which, target, Ends.of(batch, deepest), np.log(holdups))
    low, high = np.log(surface_temperature)
    many = max(int(np.ceil((high - low) / np.log(10.0) * _PER_DECADE)), 2) + 1
    members = np.arange(len(batch))
    trajectories = problem.trajectories(np.repeat(members, many), np.tile(np.linspace(low, high, many), len(batch)))
    for edge in (1, -1):
        trajectories = _widened(problem, trajectories, edge)
    unsettled = np.zeros(len(batch), dtype=bool)
    brackets: list[Brackets] = []
    for _ in range(_ROUNDS):
        unsettled[trajectories.member[trajectories.count < 0]] = True
        unsettled[trajectories.member[_deeper(problem, trajectories)]] = True
        trajectories = trajectories.of(~unsettled)
        found, split, lost = _links(problem, trajectories)
        unsettled[trajectories.member[lost]] = True
        # A member is done when none of its gaps is split.
        ready = np.ones(len(batch), dtype=bool)
        ready[trajectories.member[split]] = False
        ready &= ~unsettled
        brackets.append(found.take(ready[found.member]))
        going = ~ready & ~unsettled
        if not going[trajectories.member].any():
            trajectories = trajectories.of(going)
            break
        split = split[going[trajectories.member[split]]]
        middle = 0.5 * (trajectories.log_t[split] + trajectories.log_t[split + 1])
        trajectories = trajectories.joined(problem.trajectories(trajectories.member[split], middle)).of(going)
    unsettled[trajectories.member] = True
    flows, failed = _found(problem, brackets[0].and_all(brackets[1:]), tolerance)
    unsettled |= failed
    inside = (flows.macroscopic[LOG_M] <= problem.deepest[flows.member]) & ~unsettled[flows.member]
    return Flows.joined([flows.take(inside)]), unsettled


def _widened(problem: Problem, trajectories: ScannedFlows, edge: int) -> ScannedFlows:
    """With trajectories beyond the hottest (``edge`` 1) or coldest (-1) of each member, where flows lead out of the
    range towards the requested value, as :func:`chuteflow.flows` has it."""
    for _ in range(_WIDENINGS):
        ends = np.flatnonzero(
            np.diff(trajectories.member, append=-1) if edge > 0 else np.diff(trajectories.member, prepend=-1)
        )
        before = ends - edge
        a, b = trajectories.flows[before], trajectories.flows[ends]
        run = (trajectories.log_t[ends] - trajectories.log_t[before])[:, None]
        left = problem.target[trajectories.member[ends], None] - b[..., problem.which]
        alike = (np.abs(a - b) <= _APART + _BY_TEMPERATURE * np.abs(run)[..., None]).all(axis=-1)
        slope = (b - a)[..., problem.which] / run
        with np.errstate(invalid="ignore"):
            leads = alike & (slope * np.sign(left) * edge > _LEADS)
            reach = np.where(leads, 1.2 * np.abs(left / slope) + 1.0, 0.0).max(axis=1)
        limit = np.log(WIDEST[edge > 0])
        reach = np.minimum(reach, np.maximum(edge * (limit - trajectories.log_t[ends]), 0.0))
        many = np.ceil(reach / np.log(10.0) * _PER_DECADE).astype(np.intp)
        if not many.any():
            break
        which = np.repeat(np.arange(ends.size), many)
        fraction = (np.arange(which.size) - (np.cumsum(many) - many)[which] + 1) / many[which]
        new = trajectories.log_t[ends[which]] + edge * reach[which] * fraction
        trajectories = trajectories.joined(problem.trajectories(trajectories.member[ends[which]], new))
    return trajectories


def _deeper(problem: Problem, trajectories: ScannedFlows) -> NDArray[np.bool_]:
    """The trajectories with flows near the largest hold-up that may lead beyond it, to the requested value."""
    log_m, target = trajectories.flows[..., LOG_M], problem.target[trajectories.member, None]
    left = target - trajectories.flows[..., problem.which]
    with np.errstate(invalid="ignore"):
        at_edge = log_m > problem.deepest[trajectories.member, None] - _AT_EDGE
        within_reach = (left > 0.0) & (left < _STEEPEST * (np.log(DEEPEST) - log_m))
    return (at_edge & within_reach).any(axis=1) & (problem.which != LOG_M)


def _links(problem: Problem, trajectories: ScannedFlows) -> tuple[Brackets, Indices, Indices]:
    """The flows that lie between trajectories that go over into each other, the trajectories after which there is a gap
    that may hide more, and wants a trajectory, and those after which trajectories do not tell."""
    left = np.flatnonzero(trajectories.member[1:] == trajectories.member[:-1])
    right = left + 1
    member = trajectories.member[left]
    a, b = trajectories.flows[left], trajectories.flows[right]
    n_a, n_b = trajectories.count[left], trajectories.count[right]
    step = trajectories.log_t[right] - trajectories.log_t[left]
    apart = _APART + _BY_TEMPERATURE * step
    deepest = problem.deepest[member]
    # From the surface down the flows go over into each other, up to the first that does not.
    alike = (np.abs(a - b) <= apart[:, None, None]).all(axis=-1)
    first = np.cumprod(alike, axis=1).sum(axis=1)
    off_a = a[..., problem.which] - problem.target[member, None]
    off_b = b[..., problem.which] - problem.target[member, None]
    place = np.arange(_MOST)
    linked = place < first[:, None]
    crossing = linked & ((off_a > 0.0) != (off_b > 0.0))
    split = _unlinked(a, b, off_a, off_b, n_a, n_b, first, step, deepest)
    turning = _turning(trajectories, left, linked, off_a, off_b)
    split |= turning
    rows, places = np.nonzero(crossing)
    log_m = np.maximum(a[rows, places, LOG_M], b[rows, places, LOG_M])
    found = Brackets(
        member[rows],
        places,
        trajectories.log_t[left[rows]],
        trajectories.log_t[right[rows]],
        off_a[rows, places],
        off_b[rows, places],
        log_m,
    )
    return found, left[split], left[turning & (step < _NARROWEST)]


def _unlinked(
    a: Array,
    b: Array,
    off_a: Array,
    off_b: Array,
    n_a: Indices,
    n_b: Indices,
    first: Indices,
    step: Array,
    deepest: Array,
) -> NDArray[np.bool_]:
    """Where flows of neighbouring trajectories that do not go over into each other may hide the requested value."""
    apart = _APART + _BY_TEMPERATURE * step
    place = np.arange(_MOST)
    # From below, flows may go over into each other with other places.
    last = np.zeros_like(first)
    rows = np.arange(len(first))
    alive = (n_a - n_b) % 2 == 0
    alive &= (n_a != n_b) | (first < n_a)
    hidden = np.zeros(len(first), dtype=bool)
    for j in range(1, _MOST + 1):
        alive = alive & (n_a - j >= first) & (n_b - j >= first)
        i_a, i_b = np.maximum(n_a - j, 0), np.maximum(n_b - j, 0)
        alive &= (np.abs(a[rows, i_a] - b[rows, i_b]) <= apart[:, None]).all(axis=-1)
        if not alive.any():
            break
        last += alive
        hidden |= alive & ((off_a[rows, i_a] > 0.0) != (off_b[rows, i_b] > 0.0))
    for flows, off, count in ((a, off_a, n_a), (b, off_b, n_b)):
        loose = (place >= first[:, None]) & (place < (count - last)[:, None])
        loose &= flows[..., LOG_M] <= deepest[:, None]
        any_loose = loose.any(axis=1)
        low = np.where(loose, off, np.inf).min(axis=1)
        high = np.where(loose, off, -np.inf).max(axis=1)
        # An even number of them have met in pairs; of an odd number the last has left to larger hold-ups.
        paired = (loose.sum(axis=1) % 2 == 0) & (n_a != n_b)
        with np.errstate(invalid="ignore"):
            aside = np.where(paired, _ASIDE * (high - low) + _AWAY * step + _LITTLE, np.inf)
            hidden |= any_loose & (low - np.minimum(aside, apart) <= 0.0) & (high + aside >= 0.0)
    return hidden


def _turning(
    trajectories: ScannedFlows, left: Indices, linked: NDArray[np.bool_], off_a: Array, off_b: Array
) -> NDArray[np.bool_]:
    """The gaps, after the trajectories ``left``, in which the quantity may turn along a branch so near to its value
    that it passes it between trajectories without a change of sign, or more than once with one."""
    step = (trajectories.log_t[left + 1] - trajectories.log_t[left])[:, None]
    # Of all gaps in order, those between members missing.
    slope = np.full((trajectories.member.size - 1, _MOST), np.nan)
    slope[left] = np.where(linked, (off_b - off_a) / step, np.nan)
    change = np.abs(np.diff(slope, axis=0, prepend=np.nan, append=np.nan))
    noise = np.ones((len(slope), 1))
    noise[left] = _NOISE / step
    turns = may_turn(slope, noise)[left]
    reach = _SAG * step * np.nan_to_num(np.fmax(change[1:], change[:-1])[left]) + _NOISE
    with np.errstate(invalid="ignore"):
        near = (np.minimum(off_a, off_b) <= reach) & (np.maximum(off_a, off_b) >= -reach)
    out = np.zeros(len(left), dtype=bool)
    out[np.nonzero(turns & near)[0]] = True
    return out


def _found(problem: Problem, brackets: Brackets, tolerance: float) -> tuple[Flows, NDArray[np.bool_]]:
    """The flows in the brackets, and the members on which one could not be found to ``tolerance``."""
    failed = np.zeros(len(problem.batch), dtype=bool)
    near = FlowsInBrackets(problem, brackets)
    log_t, slope = near.rough()
    pending = np.arange(brackets.member.size)
    flows: list[Flows] = []
    for coarser, finer in itertools.pairwise(LADDER):
        good = np.isfinite(log_t[pending])
        failed[brackets.member[pending[~good]]] = True
        pending = pending[good]
        if not pending.size:
            break
        log_t[pending], slope[pending], here = near.polished(pending, log_t[pending], slope[pending], coarser)
        there = near.at(pending, log_t[pending], finer)
        # What changes at a given surface temperature is carried over to the given quantity.
        change = there.macroscopic[:LOG_T] - here[:LOG_T]
        off = there.macroscopic[problem.which] - problem.target[brackets.member[pending]]
        along = near.gradient(pending) / slope[pending]
        carried = np.abs(change - along * change[problem.which])
        rest = np.abs(along * (off - change[problem.which]))
        least = least_error(finer) * (1.0 + np.abs(along).max(axis=0))
        error = np.maximum(SAFETY * (carried + rest).max(axis=0), least)
        moved = there.macroscopic.copy()
        moved[:LOG_T] -= near.gradient(pending) * (off / slope[pending])
        moved[LOG_T] -= off / slope[pending]
        member = brackets.member[pending]
        done = error <= tolerance
        flows.append(Flows(member, np.exp(moved[LOG_T]), there.state, moved, error).take(done))
        pending = pending[~done]
    failed[brackets.member[pending]] = True
    return Flows.joined(flows), failed


class FlowsInBrackets:
    """Flows near surface temperatures inside their brackets."""

    def __init__(self, problem: Problem, brackets: Brackets) -> None:
        self._problem, self._brackets = problem, brackets
        self._batch = problem.batch.take(brackets.member)
        # A little below the flow is deep enough.
        deep = problem.batch.surface_stress + 1.5 * np.exp(brackets.log_m)
        self._ends = problem.ends.take(brackets.member).above(deep)
        self._target = problem.target[brackets.member]
        self._gradient = np.zeros((3, brackets.member.size))

    def gradient(self, which: Indices) -> Array:
        """d (ln Q, ln h, ln M)/d ln T_surface along the branch, (3, m)."""
        return self._gradient[:, which]

    def at(self, which: Indices, log_t: Array, accuracy: Accuracy) -> Flows:
        """The flows ``which`` (m,) at ``log_t`` (m,), one each; NaN where it is not there."""
        some, temperature = self._batch.take(which), np.exp(log_t)
        found = march(some, temperature, self._ends.take(which), accuracy, meets_base)
        count = np.bincount(found.member, minlength=which.size)
        index = (np.cumsum(count) - count) + self._brackets.place[which]
        there = (self._brackets.place[which] < count) & ~found.trouble
        safe = np.minimum(index, max(found.member.size - 1, 0))
        state = np.full((found.state.shape[0], which.size), np.nan)
        state[:, there] = found.state[:, safe[there]]
        with np.errstate(invalid="ignore"):
            return evaluate_flows(some, temperature, EventZeros(np.arange(which.size), state, found.trouble))

    def rough(self) -> tuple[Array, Array]:
        """ln T of the flows by rough trajectories, and the slope of the quantity's logarithm over it in the bracket."""
        b = self._brackets

        def off(which: Indices, log_t: Array) -> Array:
            return self.at(which, log_t, _POLISH).macroscopic[self._problem.which] - self._target[which]

        slope = (b.f_high - b.f_low) / (b.high - b.low)
        return find_zeros(off, b.low, b.high, b.f_low, b.f_high, _NEAR, _NEAR), slope

    def polished(self, which: Indices, log_t: Array, slope: Array, accuracy: Accuracy) -> tuple[Array, Array, Array]:
        """ln T where the quantity has its value, the slope there, and (ln Q, ln h, ln M, ln T) (4, m): by secants."""
        quantity = self._problem.which
        here = self.at(which, log_t, accuracy).macroscopic
        off = here[quantity] - self._target[which]
        # The first step tells the slope; it must not be lost in rounding.
        step = np.where(np.abs(off) > 1e-9, -off / slope, 1e-6)
        for _ in range(_MOST_STEPS):
            step = np.clip(step, -0.05, 0.05)
            there = self.at(which, log_t + step, accuracy).macroscopic
            gained = there[:LOG_T] - here[:LOG_T]
            with np.errstate(invalid="ignore", divide="ignore"):
                self._gradient[:, which] = np.where(step != 0.0, gained / step, self._gradient[:, which])
                slope = np.where(step != 0.0, gained[quantity] / step, slope)
            log_t, here = log_t + step, there
            off = here[quantity] - self._target[which]
            if not (np.abs(off) > _MEETS).any():
                break
            with np.errstate(invalid="ignore", divide="ignore"):
                step = np.where(np.abs(off) > _MEETS, -off / slope, 0.0)
        return log_t, slope, here


#: Accuracy of the trajectories between which a zero is sought.
_POLISH = Accuracy(1e-7, 2e-3)
