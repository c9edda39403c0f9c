"""The curve of flows by the paper's method: its discretisation driven by the general continuation.

The system is :class:`chuteflow.steady.mapped.solution.MappedSystem`, whose flux is free and whose inner product is that
of the plane (ln S, ln Q), with S = T_inf on the half-line and S = H below an interface. A fold of Q, where
two flows of one mass flux meet (section 3.5), is where d ln Q along the unit tangent changes its sign.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.continuation import ContinuationSettings, CurvePoint, Monitor, locate, trace
from chuteflow.numerics.following import Side, follow_both_sides, follow_side
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T
from chuteflow.steady.flow import Flow
from chuteflow.steady.line import LineOfFlows
from chuteflow.steady.mapped.solution import DEGREES, LARGEST_DEGREE, MappedSolution, MappedSystem, refine, solve_mapped
from chuteflow.steady.solver import Condition, SolverStatus

#: How a curve is followed; lengths are in the plane (ln S, ln Q). Points are solved again more closely.
CONTROL = ContinuationSettings(
    initial_step=0.05, min_step=1e-6, max_step=0.3, max_angle=0.3, tolerance=1e-7, max_points=600
)
#: Range of T_surface followed by default: few chutes are within reach of N = 400 below it.
SURFACE_TEMPERATURE = (0.05, 100.0)
#: Estimated relative error of Q, h and M up to which a flow is taken for one.
TOLERANCE = 1e-8
#: Relative error allowed in the flow from which a curve starts.
_START_TOLERANCE = 1e-9
#: Flows of a curve are at least so far apart: cold ones take many small steps, each with many coefficients.
_SPACING = 0.04


@dataclass(frozen=True, eq=False)
class MappedPoint:
    """A located point of a curve: ``kind`` is "fold-Q" or "density-inversion", ``position`` the index before it."""

    kind: str
    flow: MappedSolution
    position: int


@dataclass(frozen=True, eq=False)
class MappedCurve(LineOfFlows):
    """A branch of flows in order along its curve, from hot to cold at the start.

    All are converged to TOLERANCE. ``special`` are the flows of turning mass flux and at the onset of a density
    inversion, in the same order; ``ends`` says in words why the curve ends at either side.
    """

    flows: tuple[MappedSolution, ...]
    special: tuple[MappedPoint, ...]
    ends: tuple[str, str]

    @property
    def folds(self) -> tuple[MappedSolution, ...]:
        """The flows of turning mass flux."""
        return tuple(point.flow for point in self.special if point.kind == "fold-Q")


def mapped_curve(
    start: Flow | MappedSolution,
    *,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    control: ContinuationSettings = CONTROL,
) -> MappedCurve:
    """The branch through ``start``, to both sides, as far as it goes in a range of T_surface.

    Args:
        start: a flow of the branch.
        surface_temperature: lowest and highest T_surface; the last flow of a side is the first one outside.
        control: how the curve is followed.

    Raises:
        InputError: for a range that does not hold the start.
    """
    low, high = surface_temperature
    if not 0.0 < low < start.surface_temperature < high:
        raise InputError(
            f"surface temperatures from {low:g} to {high:g}: must be positive, and hold that of the start, "
            f"{start.surface_temperature:g}"
        )
    condition = Condition.fix(LOG_T, start.surface_temperature)
    first = refine(start.chute, start, condition, _START_TOLERANCE)
    if not first.converged:
        return MappedCurve((), (), (first.status.value, first.status.value))
    bounds = (float(np.log(low)), float(np.log(high)))
    # The curve runs from hot to cold.
    found = follow_both_sides(lambda sign: _side(first, -sign, bounds, control))
    special = tuple(MappedPoint(event.kind, event.point, event.position) for event in found.events)
    return MappedCurve(found.points, special, found.ends)


def _side(
    first: MappedSolution, direction: float, bounds: tuple[float, float], control: ContinuationSettings
) -> Side[MappedSolution]:
    """From ``first`` on, towards larger (1) or smaller (-1) S."""
    degree = min(d for d in DEGREES if d >= min(first.degree, LARGEST_DEGREE))
    system, matrix = first.system.transfer(degree, first.system.multiple)
    z = matrix @ first.z
    ahead = np.zeros(len(z))
    ahead[-2] = direction
    reached = 0.0

    def extend(
        side: Side[MappedSolution], previous: CurvePoint[MappedSystem] | None, point: CurvePoint[MappedSystem]
    ) -> None:
        nonlocal reached
        if previous is None or point.step == 0.0:
            return
        special = list(_between(previous, point, control))
        for kind, flow in special:
            side.add(flow, kind)
        if not special and point.arclength <= reached + _SPACING:
            return
        reached = point.arclength
        flow = _as_flow(point)
        end = _unresolved(flow)
        if not end:
            side.add(flow)
            end = _outside(flow, bounds)
        if end:
            side.stop(end)

    return follow_side(trace(system, z, direction=ahead, control=control), Side(first), extend)


def _between(
    previous: CurvePoint[MappedSystem], point: CurvePoint[MappedSystem], control: ContinuationSettings
) -> Iterator[tuple[str, MappedSolution]]:
    """Kinds and flows of the special points of a step, as far as they are resolved."""
    for kind, monitor in _MONITORS.items():
        before, after = (monitor(p.z, p.tangent, p.system) for p in (previous, point))
        if before * after < 0.0:
            found = locate(previous, point, point.system, monitor, control=control)
            flow = _as_flow(found.point)
            if not found.status.failed and not _unresolved(flow):
                yield kind, flow


def _flux_slope(z: Array, tangent: Array, system: MappedSystem) -> float:
    """d ln Q along the unit tangent."""
    del z, system
    return float(tangent[-1])


def _density_excess(z: Array, tangent: Array, system: MappedSystem) -> float:
    """Positive where the density is inverted."""
    del tangent
    return system.density_excess(z)


_MONITORS: dict[str, Monitor[MappedSystem]] = {"fold-Q": _flux_slope, "density-inversion": _density_excess}


def _unresolved(flow: MappedSolution) -> str:
    """Why ``flow`` is not taken for one; empty where it is."""
    if not np.isfinite(flow.error):
        return SolverStatus.NO_CONVERGENCE.value
    return "" if flow.error <= TOLERANCE else f"the series are not resolved with N = {LARGEST_DEGREE}"


def _outside(flow: MappedSolution, bounds: tuple[float, float]) -> str:
    """Why a side ends at ``flow``; empty where it goes on."""
    if flow.macroscopic[LOG_T] >= bounds[1]:
        return f"it goes on to surface temperatures above {np.exp(bounds[1]):g}"
    if flow.macroscopic[LOG_T] <= bounds[0]:
        return f"it goes on to surface temperatures below {np.exp(bounds[0]):g}"
    return ""


def _as_flow(point: CurvePoint[MappedSystem]) -> MappedSolution:
    """A point of a trace as a flow with its estimated error: solved again in a plane across the curve."""
    system = point.system
    _, _, macroscopic, gradient = system.evaluate(point.z)
    along = gradient @ point.tangent
    along[LOG_H] = 0.0
    along /= np.linalg.norm(along)
    plane = Condition((along[LOG_Q], 0.0, along[LOG_M], along[LOG_T]), float(along @ macroscopic))
    near = MappedSolution(system, point.z, macroscopic, np.inf, np.inf, SolverStatus.CONVERGED, point.iterations)
    flow = solve_mapped(system.chute, near, plane, system.degree, multiple=system.multiple)
    if flow.error <= TOLERANCE or system.degree == LARGEST_DEGREE:
        return flow
    return refine(system.chute, near, plane, TOLERANCE, multiple=system.multiple)
