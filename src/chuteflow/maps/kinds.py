"""What flows a base has on a grid of trajectories: how many, of which kinds, and in how many branches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.branches.counting import most_at_once, solve_turns
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.rough_turns import find_extrema
from chuteflow.branches.solution_branches import SolutionBranch
from chuteflow.maps.zeros import Index, Zeros, evaluate_zeros
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.compiled import compiled
from chuteflow.steady import kinds as flow_kinds
from chuteflow.trajectories.refining import RoughBranch, TrajectoryGrid

#: Bits of the kinds that are present among the flows of a chute.
INTERIORS = {name: 1 << i for i, name in enumerate(flow_kinds.INTERIORS)}
DENSITIES = {name: 1 << i for i, name in enumerate(flow_kinds.DENSITIES)}
#: Turns of ln Q along a branch are distinguished if they differ by more.
_TURN = 1e-6
#: To which branches are solved where the grid leaves the number of flows in doubt.
_TOLERANCE = 1e-8
#: A net loss below this fraction of the largest is none, and more of it for hold-ups that are not small against the
#: second number: deep grains, in balance, come near to it. A rise of the density below the third, for each unit of
#: hold-up, is none either.
_BALANCE, _DEEP, _RISE = 2e-3, 5.0, 1.5e-3


@dataclass(frozen=True)
class FlowClasses:
    """The flows of one chute in the range searched.

    ``at`` is whether there is one at each requested temperature; ``most`` is the largest number at one flux, and
    ``doubtful`` is whether it would be larger with turns of the flux that are smaller than its uncertainty, and could
    not be solved; ``families`` is the number of branches (connected sets of flows); ``interior`` and ``density`` have
    the bits of INTERIORS and DENSITIES that are present.
    """

    at: tuple[bool, ...]
    most: int
    families: int
    interior: int
    density: int
    doubtful: bool


def classify_flows(
    grid: TrajectoryGrid, extremes: Array, temperatures: Sequence[float], within: SearchRange
) -> FlowClasses:
    """The kinds of the flows on ``grid``, and whether there are any at ``temperatures``; ``extremes`` (N, 6) are those
    of :func:`chuteflow.maps.zeros.bound_extremes`. Where the largest number of flows of one flux depends on turns of
    the flux that are smaller than its uncertainty, the branches are solved there."""
    lines = [line for line in grid.lines if len(line[0]) > 1]
    if not lines:
        return FlowClasses((False,) * len(temperatures), 0, 0, 0, 0, doubtful=False)
    zeros = evaluate_zeros(grid, extremes)
    at = np.zeros(len(temperatures), dtype=bool)
    every, sure, interior, density = [], [], 0, 0
    for line, _ in lines:
        if len(temperatures):
            hotter = zeros.log_t[line, None] >= np.log(temperatures)
            at |= hotter.any(axis=0) & ~hotter.all(axis=0)
        kept = zeros.along(line)
        pieces = _monotonic_pieces(zeros.log_t[kept], zeros.log_m[kept], zeros.log_q[kept], zeros.rise[kept])
        every.append(pieces[0])
        sure.append(pieces[1])
        found = _present(zeros, kept)
        interior |= sum(bit for bit, there in zip(INTERIORS.values(), found[:3], strict=True) if there)
        density |= sum(bit for bit, there in zip(DENSITIES.values(), found[3:], strict=True) if there)
    doubtful = _most(every) != _most(sure)
    if doubtful:
        solved = [
            one if len(one) == len(other) else _solve_pieces(zeros, line, closed, within)
            for (line, closed), one, other in zip(lines, sure, every, strict=True)
        ]
        known = [one for one in solved if one is not None]
        if len(known) == len(lines):
            sure, doubtful = known, False
    there = tuple(map(bool, at.tolist()))
    return FlowClasses(there, _most(sure), len(lines), interior, density, doubtful)


def _most(pieces: Sequence[Array]) -> int:
    """The largest number of pieces that share a flux, given those of each branch."""
    return most_at_once(np.concatenate(pieces), _TURN)


def _solve_pieces(zeros: Zeros, line: Index, closed: bool, within: SearchRange) -> Array | None:
    """Lowest and highest ln Q (pieces, 2) of the stretches of a branch between turns of Q, which are solved; None where
    it could not be followed."""
    grid = zeros.grid
    kept = zeros.along(line)
    apart, at = _places(zeros.log_t[kept], zeros.log_m[kept])
    kept = kept[apart]
    before, _ = _changes(zeros.rise[kept], at)
    first, last = (int(np.flatnonzero(line == kept[i])[0]) for i in (before[0], before[-1] + 1))
    branch = SolutionBranch(RoughBranch(grid, line, grid.macroscopic[line], closed), within)
    turns = solve_turns(branch, first, last, _TOLERANCE)
    if turns is None:
        return None
    return _stretches([float(zeros.log_q[kept[0]]), *turns.tolist(), float(zeros.log_q[kept[-1]])])


def _present(zeros: Zeros, line: Index) -> list[bool]:
    """Whether the kinds, in the order of INTERIORS and DENSITIES, are among the flows of a line of zeros.

    Where the bounds of a trajectory that was inserted leave it open, the trajectory is followed back.
    """
    lower, upper = zeros.extremes[line, :3].T, zeros.extremes[line, 3:].T
    doubt, holdup = zeros.doubt[line].T, np.exp(zeros.log_m[line])
    rounding = _BALANCE * float(np.abs(zeros.extremes[line][:, [0, 1, 3, 4]]).max()) * (1.0 + holdup / _DEEP)
    doubt[:2] += rounding
    doubt[2] += _RISE * holdup
    surely, perhaps = _margins(lower, upper, doubt), _margins(upper, lower, doubt)
    found = [_peak(margin) > 0.0 for margin in surely]
    open_ = np.zeros(len(line), dtype=bool)
    for there, margin in zip(found, perhaps, strict=True):
        open_ |= (margin > 0.0) & (not there)
    if open_.any():
        known = zeros.traced(line[open_]).T
        margins = _margins(known, known, doubt[:, open_])
        found = [there or bool((margin > 0.0).any()) for there, margin in zip(found, margins, strict=True)]
    return found


def _margins(lower: Array, upper: Array, doubt: Array) -> list[Array]:
    """By how much flows are of each kind, (k,) each, given bounds (3, k) of the least and the largest net loss and the
    largest 1 - p dL/dp, and the doubt about these (3, k): a sign in doubt makes no flow mixed and no density
    inverted."""
    return [
        lower[0] + doubt[0],
        np.minimum(-upper[0] - doubt[0], lower[1] - doubt[1]),
        doubt[1] - upper[1],
        1.0 + 1e-12 - upper[2],
        lower[2] - doubt[2] - 1.0,
    ]


def _monotonic_pieces(log_t: Array, log_m: Array, log_q: Array, rise: Array) -> tuple[Array, Array]:
    """Lowest and highest ln Q (pieces, 2) of the stretches of a branch between turns of Q, where ``rise`` changes
    sign: of all turns, and of those alone that are larger than ln Q is uncertain."""
    apart, at = _places(log_t, log_m)
    log_q, rise = log_q[apart], rise[apart]
    before, share = _changes(rise, at)
    if not before.size:
        whole = np.sort(log_q[[0, -1]])[None]
        return whole, whole
    turned, noise = _turned(log_q, at, before, share)
    along = np.sign(float(((rise[1:] + rise[:-1]) * np.diff(log_q)).sum()))
    first = along if rise[0] > 0.0 else -along
    stops = [float(log_q[0]), *turned.tolist(), float(log_q[-1])]
    scatter = [0.0, *noise.tolist(), 0.0]
    return _stretches(_confirm(stops, first, [0.0] * len(stops))), _stretches(_confirm(stops, first, scatter))


def _places(log_t: Array, log_m: Array) -> tuple[NDArray[np.bool_], Array]:
    """Which flows of a branch are apart from the one before, and the places of these along it."""
    length = np.hypot(np.diff(log_t), np.diff(log_m))
    apart = np.append(True, length > 1e-9)
    return apart, np.cumsum(np.append(0.0, length))[apart]


def _stretches(stops: list[float]) -> Array:
    return np.sort(np.stack([stops[:-1], stops[1:]], axis=1), axis=1)


@compiled
def _turned(log_q: Any, at: Any, before: Any, share: Any) -> tuple[Any, Any]:
    """ln Q where it turns in the steps ``before`` (k,) of the places ``at``, at the ``share`` of each; and how far its
    values beside these lie beside the cubics through the two before and the two after (k,)."""
    turned, noise = np.empty(len(before)), np.zeros(len(before))
    count = len(at)
    for k in range(len(before)):
        i = before[k]
        here = at[i] + (at[i + 1] - at[i]) * share[k]
        turned[k] = log_q[i] + share[k] * (log_q[i + 1] - log_q[i])
        if count > 3:
            first = min(max(i - 1, 0), count - 4)
            around = np.arange(first, first + 4)
            # Through uneven places a cubic may overshoot: beyond the step by no more than the steps around.
            reach = np.abs(np.diff(log_q[first : first + 4])).max()
            cubic = _through(at, log_q, around, here)
            turned[k] = min(max(cubic, turned[k] - reach), turned[k] + reach)
        for side in (i, i + 1):
            if count > 4:
                # At the two places next to each end as at the nearest other.
                middle = min(max(side, 2), count - 3)
                around = middle + np.array([-2, -1, 1, 2])
                noise[k] = max(noise[k], abs(_through(at, log_q, around, at[middle]) - log_q[middle]))
    return turned, noise


@compiled
def _through(at: Any, values: Any, around: Any, x: float) -> float:
    """At ``x`` the cubic through the values at four places."""
    total = 0.0
    for i in around:
        weight = 1.0
        for j in around:
            if j != i:
                weight *= (x - at[j]) / (at[i] - at[j])
        total += weight * values[i]
    return total


def _changes(rise: Array, at: Array) -> tuple[NDArray[np.intp], Array]:
    """The steps in which ``rise`` changes sign, and the fractions of them at which it does so; a step in which it
    passes zero twice, as just beyond a cusp, is there twice."""
    changes = np.flatnonzero((rise[1:] > 0.0) != (rise[:-1] > 0.0))
    pairs = [
        (dip.step, zero) for dip in find_extrema(rise, at, passing=True) if len(dip.zeros) == 2 for zero in dip.zeros
    ]
    if not pairs:
        return changes, rise[changes] / (rise[changes] - rise[changes + 1])
    steps = np.concatenate([changes, np.array([step for step, _ in pairs], dtype=np.intp)])
    fractions = np.concatenate(
        [rise[changes] / (rise[changes] - rise[changes + 1]), np.array([share for _, share in pairs], dtype=float)]
    )
    order = np.lexsort((fractions, steps))
    return steps[order], fractions[order]


def _confirm(stops: list[float], rises: float, noise: list[float]) -> list[float]:
    """Values at the ends and turns of a branch without those turns between which it does not turn by more than the
    ``noise`` of either.

    It ``rises`` first (1), or falls (-1), and so on in turn.
    """
    known = list(zip(stops, noise, strict=True))
    i = 0
    while len(known) > 2 and i < len(known) - 1:
        (one, doubt), (other, further) = known[i : i + 2]
        if (other - one) * rises * (-1.0) ** i > max(_TURN, doubt, further):
            i += 1
        elif i == 0:
            del known[1]
            rises = -rises
        elif i == len(known) - 2:
            del known[i]
        else:
            del known[i : i + 2]
            i -= 1
    return [value for value, _ in known]


def _peak(values: Array) -> float:
    """The largest of values along a line, between points by parabolas."""
    top = float(values.max())
    i = int(values.argmax())
    if 0 < i < len(values) - 1:
        before, here, after = values[i - 1 : i + 2]
        bend = 2.0 * here - before - after
        if bend > 0.0:
            top += float((after - before) ** 2 / (8.0 * bend))
    return top
