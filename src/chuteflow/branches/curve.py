"""Every branch of flows of a chute in order, with its special points located.

Branches come from the grid of trajectories (:mod:`chuteflow.trajectories.refining`), and are solved by as many points
as it takes to know them (:mod:`chuteflow.branches.paths`): folds are found from these, whatever number of flows is
asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from chuteflow.branches.existence import explain_imbalance
from chuteflow.branches.paths import Chord, PathPoint, find_zero
from chuteflow.branches.ranges import BranchEnd, SearchRange
from chuteflow.branches.results import Branch, Curve, SpecialPoint
from chuteflow.branches.rough_turns import find_extrema
from chuteflow.branches.solution_branches import (
    TracedBranch,
    describe_search,
    explain_incompleteness,
    search_range,
    trace_all,
)
from chuteflow.checks import whole
from chuteflow.errors import SolveError
from chuteflow.parameters import LARGEST_HOLDUP, SURFACE_TEMPERATURE
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import LOG_M, LOG_Q, LOG_T
from chuteflow.steady.flow import Flow, flows_of, rough_kinds
from chuteflow.steady.model import model
from chuteflow.steady.solver import TOLERANCE, Solution, check_tolerance
from chuteflow.threads import on_one_thread

#: Quantities whose folds are located, and others at whose zeros a flow changes its kind.
_FOLDS = {"fold-Q": LOG_Q, "fold-M": LOG_M, "fold-T": LOG_T}
_CHANGES: tuple[tuple[str, Callable[[Flow], float]], ...] = (
    ("density-inversion", lambda flow: flow.density_excess),
    ("interior-change", lambda flow: flow.net_loss_range[0]),
    ("interior-change", lambda flow: flow.net_loss_range[1]),
)
#: Rough values nearer to zero are not trusted.
_UNSURE = 1e-5


@on_one_thread
@np.errstate(under="ignore")
def curve(
    chute: Chute,
    *,
    points: int = 200,
    tolerance: float = TOLERANCE,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
) -> Curve:
    """Every branch of steady flows on ``chute`` in a range.

    Args:
        chute: the chute.
        points: flows on the longest branch, evenly in arclength in the space of ln Q, ln h, ln M and ln T_surface;
            shorter branches take fewer in proportion.
        tolerance: relative error allowed in Q, h and M, from 1e-11 to 1e-3.
        surface_temperature: range of T_surface.
        largest_holdup: largest M.

    Raises:
        InputError: for a range or number out of bounds.
        SolveError: where a branch could not be followed. Where flows of one could not be solved to the tolerance,
            its branch ends, and says why.
    """
    points = whole("points", points, 2, 100_000)
    tolerance = check_tolerance(tolerance)
    within = SearchRange.checked(surface_temperature, largest_holdup, chute.surface)
    problem = model(chute)
    found, lost = trace_all(problem, within, tolerance)
    grid = search_range(problem, within)
    longest = max((float(branch.arclength[-1]) for branch in found), default=1.0)
    doubts: list[str] = []
    branches = [
        _branch(chute, branch, _samples(branch, points, float(branch.arclength[-1]) / longest), tolerance, doubts)
        for branch in found
    ]
    branches.sort(key=lambda branch: -float(branch.surface_temperature.max()))
    return Curve(
        chute=chute,
        branches=tuple(branches),
        searched=describe_search(within, grid),
        tolerance=tolerance,
        reason=None if branches else explain_imbalance(problem),
        incomplete=next(iter(doubts), None) or explain_incompleteness(grid, within, lost, ("a branch", "branches")),
    )


def _samples(branch: TracedBranch, points: int, fraction: float) -> int:
    """Flows of a branch whose length is a ``fraction`` of the longest: as even as those of that one, and, up to
    ``points``, no fewer than it takes to draw its turns."""
    return max(8, round(points * fraction), min(points, len(branch.points)))


def _branch(chute: Chute, branch: TracedBranch, count: int, tolerance: float, doubts: list[str]) -> Branch:
    places = np.linspace(0.0, branch.arclength[-1], count)
    solutions = [point.solution for point in branch.at(places, tolerance)]
    located: list[tuple[str, Flow, float]] = []
    for locate in (_folds, _changes):
        try:
            located += locate(chute, branch, tolerance)
        except SolveError:
            # One point that is not found must not cost the curve.
            low, high = np.exp(np.sort(branch.macroscopic[[0, -1], LOG_M]))
            doubts.append(f"not all special points of the branch from M = {low:.4g} to {high:.4g} could be located")
    for end, m in zip(branch.ends, branch.macroscopic[[0, -1]], strict=True):
        if end == BranchEnd.LOST:
            doubts.append(f"a branch could not be followed beyond M = {np.exp(m[LOG_M]):.4g}")
    ends, heading = branch.ends, 1.0
    if solutions[0].macroscopic[LOG_T] < solutions[-1].macroscopic[LOG_T]:
        solutions, ends, heading = solutions[::-1], (ends[1], ends[0]), -1.0
        places = places[::-1]
    flows = flows_of(chute, solutions)
    special = []
    for kind, flow, place in sorted(located, key=lambda one: heading * one[2]):
        before = int(np.searchsorted(heading * places, heading * place, side="right")) - 1
        special.append(SpecialPoint(kind, flow, min(max(before, 0), len(flows) - 2)))
    return Branch(tuple(flows), tuple(special), ends)


def _folds(chute: Chute, branch: TracedBranch, tolerance: float) -> Iterator[tuple[str, Flow, float]]:
    """Flows at which Q, M or T_surface turns, with their arclengths."""
    at = branch.arclength
    for kind, which in _FOLDS.items():
        for turn in branch.turns(which, tolerance):
            yield kind, Flow(chute, turn.point.solution), float(np.interp(turn.place, np.arange(len(at)), at))


def _changes(chute: Chute, branch: TracedBranch, tolerance: float) -> Iterator[tuple[str, Flow, float]]:
    """Flows at which the density turns inverted, or the interior another kind, with their arclengths."""
    points, at = branch.points, branch.arclength
    rough = rough_kinds([point.solution for point in points])
    for column, (kind, quantity) in enumerate(_CHANGES):
        # What is near to zero is told by the flow itself.
        values = rough[:, column].copy()
        for i in np.flatnonzero(np.abs(values) < _UNSURE).tolist():
            values[i] = quantity(Flow(chute, points[i].solution))
        # The slopes are rough: what comes as near to zero as half of its way there is examined.
        ways = {
            d.step: d
            for d in find_extrema(values, at)
            if abs(d.value) < 0.5 * max(np.abs(values[d.step : d.step + 2])) or d.zeros
        }
        for i in range(len(points) - 1):
            chord = Chord(points[i], points[i + 1], tolerance)
            if (values[i] > 0.0) != (values[i + 1] > 0.0):
                found = [find_zero(chord, _of_flow(chute, quantity), (values[i], values[i + 1]))]
            elif i in ways:
                found = _pair(chord, _of_flow(chute, quantity), (values[i], values[i + 1]), ways[i].share)
            else:
                continue
            yield from ((kind, Flow(chute, p.solution), at[i] + sigma * (at[i + 1] - at[i])) for sigma, p in found)


def _of_flow(chute: Chute, quantity: Callable[[Flow], float]) -> Callable[[Solution], float]:
    return lambda solution: quantity(Flow(chute, solution))


def _pair(
    chord: Chord, function: Callable[[Solution], float], ends: tuple[float, float], fraction: float
) -> list[tuple[float, PathPoint]]:
    """The two zeros to either side of a fraction of a chord, if the sign is another one there."""
    middle = chord.at(fraction)
    if middle is None:
        return []
    value = function(middle.solution)
    if (ends[0] > 0.0) == (value > 0.0):
        return []
    one, before = find_zero(Chord(chord.first, middle, chord.tolerance), function, (ends[0], value))
    two, after = find_zero(Chord(middle, chord.last, chord.tolerance), function, (value, ends[1]))
    return [(fraction * one, before), (fraction + (1.0 - fraction) * two, after)]
