"""Every steady flow of a chute at a given flux, hold-up, centre of mass or surface temperature.

The branches of flows come from the grid of trajectories (:mod:`chuteflow.trajectories.refining`). Along each, the flows
that meet the condition are where the quantity takes its value (:mod:`chuteflow.branches.solution_branches`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, overload

import numpy as np

from chuteflow.branches.existence import explain_none_found
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.results import FlowSet, FlowSets
from chuteflow.branches.solution_branches import (
    SolutionBranch,
    describe_search,
    explain_incompleteness,
    find_branches,
    search_range,
    solve_crossings,
)
from chuteflow.checks import number, real_array
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import DEEPEST, LARGEST_HOLDUP, SURFACE_TEMPERATURE, WIDEST
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T
from chuteflow.steady.flow import Flow, flows_of
from chuteflow.steady.model import Model, model
from chuteflow.steady.solver import TOLERANCE, Solution, check_tolerance
from chuteflow.threads import on_one_thread
from chuteflow.trajectories.refining import TrajectoryGrid

#: Several values of a quantity.
Values: TypeAlias = Sequence[float] | Array

_EXTENSIONS = 4
#: A branch leads out of the range towards a value if the quantity rises at least with this power there.
_LEADS = 0.25
#: The range is not extended to larger hold-ups where there are more branches: their number would grow.
_MOST_DEEPER = 4
#: Flows whose ln Q, ln h, ln M and ln T_surface differ by less are one flow.
_SAME = 1e-9
#: The range reaches this factor beyond a flow that was found just outside.
_ASIDE = 1.2
#: Places of the conditions among ln Q, ln h, ln M and ln T_surface.
QUANTITIES = {"Q": LOG_Q, "h": LOG_H, "M": LOG_M, "T_surface": LOG_T}


@overload
def flows(  # pyright: ignore[reportOverlappingOverload]
    chute: Chute,
    *,
    Q: float | None = None,
    M: float | None = None,
    h: float | None = None,
    T_surface: float | None = None,
    tolerance: float = TOLERANCE,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
) -> FlowSet: ...
@overload
def flows(
    chute: Chute,
    *,
    Q: Values | None = None,
    M: Values | None = None,
    h: Values | None = None,
    T_surface: Values | None = None,
    tolerance: float = TOLERANCE,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
) -> FlowSets: ...
def flows(
    chute: Chute,
    *,
    Q: float | Values | None = None,
    M: float | Values | None = None,
    h: float | Values | None = None,
    T_surface: float | Values | None = None,
    tolerance: float = TOLERANCE,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
) -> FlowSet | FlowSets:
    """Every steady flow on ``chute`` with one given quantity, from hot to cold.

    An array of values of the quantity gives the flows at each of them.

    Args:
        chute: the chute.
        Q: mass flux (3.26). Give exactly one of Q, M, h and T_surface; all are dimensionless.
        M: mass hold-up (3.27).
        h: centre of mass (3.27).
        T_surface: granular temperature far above (half-line) or at the interface.
        tolerance: relative error allowed in Q, h and M, from 1e-11 to 1e-3.
        surface_temperature: range searched. It is extended where a branch of flows leads out of it towards
            the requested value; the range that was searched in the end is part of the result.
        largest_holdup: range searched, extended in the same way.

    Raises:
        InputError: for none or several of Q, M, h and T_surface, or a value out of range.
    """
    given = {"Q": Q, "M": M, "h": h, "T_surface": T_surface}
    named = [(name, value) for name, value in given.items() if isinstance(value, list | tuple | np.ndarray)]
    within = SearchRange.checked(surface_temperature, largest_holdup, chute.surface)
    if not named or np.ndim(named[0][1]) == 0:
        return flows_within(chute, *check_condition(given), tolerance, within)
    name, several = named[0]
    values = real_array(name, several)
    if values.ndim > 1:
        raise InputError(f"{name}: must be a number or a one-dimensional array of some")
    each = [{**given, name: value} for value in values.tolist()]
    sets = tuple(flows_within(chute, *check_condition(one), tolerance, within) for one in each)
    return FlowSets(chute, name, tuple(values.tolist()), sets)


@on_one_thread
@np.errstate(under="ignore")
def flows_within(chute: Chute, which: int, value: float, tolerance: float, within: SearchRange) -> FlowSet:
    """The flows at which the quantity ``which`` has a ``value``, as :func:`flows`, searched for in a range."""
    tolerance = check_tolerance(tolerance)
    problem = model(chute)
    found = _search_and_extend(problem, which, value, tolerance, within)
    return FlowSet(
        chute=chute,
        flows=tuple(flows_of(chute, found.solutions)),
        searched=describe_search(found.within, found.grid),
        tolerance=tolerance,
        reason=None
        if found.solutions
        else explain_none_found(problem, [f.macroscopic for f in found.branches], which, value, found.within),
        incomplete=_explain_left_out(found, which, value),
    )


@on_one_thread
@np.errstate(under="ignore")
def solve_within(chute: Chute, which: int, value: float, tolerance: float, within: SearchRange) -> tuple[Flow, ...]:
    """The flows of :func:`flows_within` alone: for very many chutes, of which nothing else is asked."""
    found = _search_and_extend(model(chute), which, value, check_tolerance(tolerance), within)
    return tuple(flows_of(chute, found.solutions))


@dataclass(frozen=True, eq=False)
class _BranchSearch:
    """The branches in a range, the flows among them that meet a condition, and those found just ``beyond`` it; the
    rough quantities of flows that were seen and not solved, and of places that could not be solved to tell; and the
    ``grid`` of the search."""

    within: SearchRange
    branches: tuple[SolutionBranch, ...]
    solutions: list[Solution]
    beyond: list[Solution]
    lost: list[Array]
    unsure: list[Array]
    grid: TrajectoryGrid


def _search_and_extend(
    problem: Model, which: int, value: float, tolerance: float, within: SearchRange
) -> _BranchSearch:
    """The flows in a range, and beyond it where a branch leads out of it towards the value."""
    if which in (LOG_T, LOG_M):
        # Well inside, so that a turn near the value is seen from both sides.
        within = within.reaching(which, 1.5 * value).reaching(which, value / 1.5)
    found = _search(problem, which, value, tolerance, within)
    for _ in range(_EXTENSIONS):
        wider = _wider(found, which, value)
        if wider == found.within or found.grid.deepest < found.within.deepest * (1.0 - 1e-9):
            break
        # The grid over another range resolves other flows.
        before, found = found, _search(problem, which, value, tolerance, wider)
        found = replace(found, solutions=_distinct([*found.solutions, *before.solutions], which))
    return found


def _search(problem: Model, which: int, value: float, tolerance: float, within: SearchRange) -> _BranchSearch:
    found = find_branches(problem, within)
    solutions: list[Solution] = []
    lost: list[Array] = []
    unsure: list[Array] = []
    for branch in found:
        solved, missed, untold = solve_crossings(branch, which, value, tolerance)
        solutions += solved
        lost += missed
        unsure += untold
    inside = _distinct([s for s in solutions if within.contains(s.macroscopic)], which)
    beyond = [s for s in solutions if not within.contains(s.macroscopic)]
    return _BranchSearch(within, found, inside, beyond, lost, unsure, search_range(problem, within))


def check_condition(given: Mapping[str, Any]) -> tuple[int, float]:
    """The place of the one quantity that is given among the macroscopic ones, and its value.

    Raises:
        InputError: for none or several, or a value out of range.
    """
    named = {name: value for name, value in given.items() if value is not None}
    if len(named) != 1:
        what = ", ".join(named) if named else "none"
        raise InputError(f"give exactly one of Q, M, h and T_surface: got {what}")
    ((name, raw),) = named.items()
    low, high = {"T_surface": WIDEST, "M": (1e-12, DEEPEST)}.get(name, (1e-12, 1e12))
    return QUANTITIES[name], number(name, raw, low, high)


@dataclass(frozen=True)
class _Extrapolation:
    """Where a branch leads out of the range towards a value: past the lower or upper ``edge`` (-1 or 1) of an ``axis``,
    LOG_T or LOG_M, there to reach the value at about ``place``, a logarithm."""

    axis: int
    edge: int
    place: float


def _leads(search: _BranchSearch, which: int, value: float) -> Iterator[_Extrapolation]:
    target = float(np.log(value))
    for branch in search.branches:
        m = branch.macroscopic
        for end, before in ((m[0], m[1]), (m[-1], m[-2])) if len(m) > 1 else ():
            left = target - float(end[which])
            for axis in (LOG_T, LOG_M):
                edge = search.within.edge(end, axis)
                run = float(end[axis] - before[axis])
                slope = float(end[which] - before[which]) / run if run else 0.0
                if edge and run * edge > 0.0 and slope * np.sign(left) * edge > _LEADS:
                    yield _Extrapolation(axis, edge, float(end[axis]) + 1.2 * left / slope + edge)


def _explain_left_out(found: _BranchSearch, which: int, value: float) -> str | None:
    """What the search leaves open, in words: also branches not followed to where they may have the value."""
    left = explain_incompleteness(found.grid, found.within, found.lost, ("a flow", "flows"), which, value, found.unsure)
    if left is not None:
        return left
    for lead in _leads(found, which, value):
        if lead.axis == LOG_M:
            there = f"hold-ups above {found.within.deepest:g}"
        elif lead.edge > 0:
            there = f"surface temperatures above {found.within.hottest:g}"
        else:
            there = f"surface temperatures below {found.within.coldest:g}"
        return f"a branch goes on to {there}, outside the range searched"
    return None


def _wider(found: _BranchSearch, which: int, value: float) -> SearchRange:
    """The range with which branches that lead out of it towards ``value`` reach it."""
    within = wider = found.within
    axes = (LOG_T, LOG_M) if len(found.branches) <= _MOST_DEEPER else (LOG_T,)
    for lead in _leads(found, which, value):
        if lead.axis in axes:
            wider = wider.reaching(lead.axis, float(np.exp(np.clip(lead.place, -600.0, 600.0))))
    # The rough end of a branch may have passed the value inside the range, and the flow itself not.
    for solution in found.beyond:
        for axis in axes:
            there = float(np.exp(solution.macroscopic[axis]))
            if within.reaching(axis, there) != within:
                outward = _ASIDE if axis == LOG_M or there > within.hottest else 1.0 / _ASIDE
                wider = wider.reaching(axis, outward * there)
    return wider


def _distinct(solutions: list[Solution], which: int) -> list[Solution]:
    """Without repetitions, hot to cold, then by hold-up; surface temperatures that were requested are one."""
    kept: list[Solution] = []
    for s in solutions:
        if all(np.abs(s.macroscopic - k.macroscopic).max() > _SAME + s.error + k.error for k in kept):
            kept.append(s)
    return sorted(kept, key=lambda s: (0.0 if which == LOG_T else -s.macroscopic[LOG_T], s.macroscopic[LOG_M]))
