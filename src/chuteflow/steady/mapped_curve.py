"""The curve of flows by the paper's method: its discretisation driven by the general continuation.

The system is :class:`chuteflow.steady.mapped.MappedSystem`, whose flux is free and whose inner product is that
of the plane (ln S, ln Q), with S = T_inf on the half-line and S = H below an interface. A fold of Q, where
two flows of one mass flux meet (section 3.5), is where d ln Q along the unit tangent changes its sign.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.continuation import Control, Point, locate, trace
from chuteflow.steady.collocation import LOG_H, LOG_Q, LOG_T
from chuteflow.steady.flow import Flow
from chuteflow.steady.mapped import DEGREES, LARGEST_DEGREE, MappedSolution, MappedSystem, refine, solve_mapped
from chuteflow.steady.solver import Condition, Status

#: How a curve is followed; lengths are in the plane (ln S, ln Q).
CONTROL = Control(initial_step=0.05, min_step=1e-6, max_step=0.3, max_angle=0.3, tolerance=1e-9, max_points=600)
#: Range of T_surface followed unless another is asked for: few chutes are within reach of N = 400 below it.
SURFACE_TEMPERATURE = (0.05, 100.0)
#: A series that has decayed to this at the largest degree is still taken for a flow.
_DECAYED = 1e-6
#: Relative error allowed in the flow from which a curve starts.
_START_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class MappedCurve:
    """A family of flows in order along its curve, from hot to cold at the start.

    ``folds`` are the flows of turning mass flux, in the same order; ``ends`` says in words why the curve ends
    at either side.
    """

    flows: tuple[MappedSolution, ...]
    folds: tuple[MappedSolution, ...]
    ends: tuple[str, str]

    @property
    def mass_flux(self) -> Array:
        """Q along the curve, (3.26)."""
        return np.array([flow.mass_flux for flow in self.flows])

    @property
    def centre_of_mass(self) -> Array:
        """h along the curve, (3.27)."""
        return np.array([flow.centre_of_mass for flow in self.flows])


@dataclass(frozen=True, eq=False)
class _Side:
    """The flows met on one side of the start, the folds among them, and why the side ends."""

    flows: list[MappedSolution]
    folds: list[MappedSolution]
    end: str


def mapped_curve(
    start: Flow | MappedSolution,
    *,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    control: Control = CONTROL,
) -> MappedCurve:
    """The family through ``start``, to both sides, as far as it goes in a range of T_surface.

    Args:
        start: a flow of the family.
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
    hot, cold = (_side(first, direction, bounds, control) for direction in (1.0, -1.0))
    return MappedCurve((*hot.flows[::-1], first, *cold.flows), (*hot.folds[::-1], *cold.folds), (hot.end, cold.end))


def _side(first: MappedSolution, direction: float, bounds: tuple[float, float], control: Control) -> _Side:
    """From ``first`` on, towards larger (1) or smaller (-1) S."""
    degree = min(d for d in DEGREES if d >= min(first.degree, LARGEST_DEGREE))
    system, matrix = first.system.transferred(degree, first.system.multiple)
    z = matrix @ first.z
    ahead = np.zeros(len(z))
    ahead[-2] = direction
    path = trace(system, z, direction=ahead, control=control)
    side = _Side([], [], "")
    previous: Point[MappedSystem] | None = None
    for point in path:
        if previous is not None and point.step > 0.0:
            if point.tangent[-1] * previous.tangent[-1] < 0.0:
                found = locate(previous, point, point.system, _flux_slope, control=control)
                fold = _as_flow(found.point)
                side.folds.append(replace(fold, status=Status.NO_CONVERGENCE) if found.status.failed else fold)
            side.flows.append(_as_flow(point))
            end = _reached(side.flows[-1], bounds)
            if end:
                return _Side(side.flows, side.folds, end)
        previous = point
    return _Side(side.flows, side.folds, path.status.value)


def _flux_slope(z: Array, tangent: Array, system: MappedSystem) -> float:
    """d ln Q along the unit tangent."""
    del z, system
    return float(tangent[-1])


def _reached(flow: MappedSolution, bounds: tuple[float, float]) -> str:
    """Why a side ends at ``flow``; empty where it goes on."""
    if not flow.macroscopic[LOG_T] < bounds[1]:
        return f"it goes on to surface temperatures above {np.exp(bounds[1]):g}"
    if not flow.macroscopic[LOG_T] > bounds[0]:
        return f"it goes on to surface temperatures below {np.exp(bounds[0]):g}"
    if flow.degree == LARGEST_DEGREE and flow.error > _DECAYED:
        return f"the series are not resolved with N = {LARGEST_DEGREE}"
    return ""


def _as_flow(point: Point[MappedSystem]) -> MappedSolution:
    """A point of a trace as a flow with its estimated error: solved again in a plane across the curve."""
    system = point.system
    _, _, macroscopic, gradient = system.evaluate(point.z)
    along = gradient @ point.tangent
    along[LOG_H] = 0.0
    along /= np.linalg.norm(along)
    w = along.tolist()
    plane = Condition((w[LOG_Q], w[1], w[2], w[LOG_T]), float(along @ macroscopic))
    near = MappedSolution(system, point.z, macroscopic, np.inf, np.inf, Status.CONVERGED, point.iterations)
    return solve_mapped(system.chute, near, plane, system.degree, multiple=system.multiple)
