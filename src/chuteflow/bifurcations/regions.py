"""What lies between boundaries: how many flows, of which kind, and where the range searched ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from chuteflow.bifurcations.boundary import Boundary, BoundarySet, as_boundary
from chuteflow.bifurcations.conditions import FixedQuantity, InteriorChange, Inversion
from chuteflow.bifurcations.points import BoundaryPoint, solve_boundary_point
from chuteflow.bifurcations.starting_points import FOLDS, HELD, on_grid_of
from chuteflow.bifurcations.system import SecondParameter
from chuteflow.bifurcations.tracing import BoundaryTracing, TracedBoundary, trace_boundary
from chuteflow.branches.enumeration import flows
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.solution_branches import TracedBranch
from chuteflow.errors import InputError
from chuteflow.numerics.complex_step import derivative
from chuteflow.numerics.newton import solve_each
from chuteflow.steady.collocation import LOG_M, LOG_T
from chuteflow.steady.kinds import DENSITIES, DISSIPATIVE, MIXED, PRODUCTIVE
from chuteflow.steady.solver import Solution

#: The argument of :func:`chuteflow.flows` that holds the quantity which folds.
_ARGUMENTS = {"fold-Q": "Q", "fold-M": "M", "fold-T": "T_surface"}
#: A branch ends at an edge of the range if it comes as near to it in the logarithm.
_AT_EDGE = 1e-6
#: A limit of the range is followed as far beyond it as this factor, for it to be inside.
_BEYOND = 10.0


def count_flows(found: BoundarySet, value: float, quantity: float) -> int:
    """How many flows there are in the range searched at a ``value`` of the second parameter, which share one value
    of the quantity whose folds ``found`` are.

    Raises:
        InputError: where they are no folds, or for numbers out of bounds.
        SolveError: where a flow could not be solved.
    """
    if found.kind not in FOLDS:
        raise InputError(f"boundaries of the kind {found.kind!r} do not bound numbers of flows: {', '.join(FOLDS)} do")
    which: dict[str, Any] = {_ARGUMENTS[found.kind]: quantity}
    searched = found.searched
    chute = replace(found.chute, **{found.second: value})
    ranges: dict[str, Any] = {
        "surface_temperature": searched.surface_temperature,
        "largest_holdup": searched.largest_holdup,
    }
    return len(flows(chute, **which, **ranges))


def find_range_edges(found: BoundarySet) -> list[Boundary]:
    """The edges of the range searched, as far as branches of flows end there: the flows of the largest and smallest
    surface temperature and of the largest hold-up, followed through the second parameter.

    Raises:
        SolveError: where one could not be followed.
    """
    sweep = SecondParameter(found.chute, found.second, *found.bounds)
    within = SearchRange.checked(found.searched.surface_temperature, found.searched.largest_holdup, found.chute.surface)
    edges = (
        (FixedQuantity(LOG_T, float(np.log(within.hottest))), replace(within, hottest=_BEYOND * within.hottest)),
        (FixedQuantity(LOG_T, float(np.log(within.coldest))), replace(within, coldest=within.coldest / _BEYOND)),
        (FixedQuantity(LOG_M, float(np.log(within.deepest))), replace(within, deepest=_BEYOND * within.deepest)),
    )
    out: list[Boundary] = []
    for condition, wider in edges:
        lines: list[TracedBoundary] = []
        for value, branches in zip(found.sampled, found.families, strict=True):
            for solution in _ends(branches, condition):
                system, w = on_grid_of(sweep, condition, value, solution)
                point = solve_boundary_point(system, w, HELD, value, found.tolerance)
                if not any(line.holds(point) for line in lines):
                    lines.append(trace_boundary(point, BoundaryTracing(wider, found.tolerance)))
        out += [as_boundary("limit", found.second, line) for line in lines]
    return out


def _ends(branches: tuple[TracedBranch, ...], condition: FixedQuantity) -> Iterator[Solution]:
    for branch in branches:
        for solution in (branch.solutions[0], branch.solutions[-1]):
            if abs(float(solution.macroscopic[condition.which]) - condition.value) < _AT_EDGE:
                yield solution


def find_kinds_beside(boundary: Boundary, which: int, index: int) -> tuple[str, str] | None:
    """The kinds of the flows at smaller and at larger values of the second parameter, beside point ``index`` of a
    boundary, with the quantity ``which`` held; None for folds, and where that quantity has a fold itself."""
    point: BoundaryPoint = boundary.traced.points[index]
    condition = point.system.condition
    if isinstance(condition, Inversion):
        kinds = DENSITIES
    elif isinstance(condition, InteriorChange):
        kinds = (PRODUCTIVE, MIXED) if condition.largest else (MIXED, DISSIPATIVE)
    else:
        return None
    at = point.system.local(point.w)
    matrix = np.concatenate([at.by_z, at.state.macroscopic_gradient()[which][None]])
    moved = np.append(at.by_parameter, derivative(at.stepped.macroscopic()[which]))
    _, by_z, by_parameter = condition(at)
    rate = by_parameter - float(by_z @ solve_each(matrix, moved))
    if not np.isfinite(rate):
        return None
    return kinds if rate > 0.0 else (kinds[1], kinds[0])
