"""Single points of a boundary, to a tolerance, with an honest error.

# notation: w = (z, lambda) unknowns, the last three of them theta at the surface, ln M and lambda.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from chuteflow.bifurcations.grids import unpin
from chuteflow.bifurcations.system import BoundarySystem
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.complex_step import derivative
from chuteflow.numerics.newton import newton, solve_each
from chuteflow.steady.collocation import LOG_T, prolong
from chuteflow.steady.elements import DEGREES
from chuteflow.steady.flow import Flow
from chuteflow.steady.solver import Solution, SolverStatus

#: Newton's method on a grid ends with a step below this, after which the next one would be below rounding.
_STEP = 1e-7
#: How often a point is solved again on pieces that meet where the flow passes kinks of the law.
_REFITS = 4
#: Least error ever claimed, and error of the equations by rounding and tabulation of the closures.
_FLOOR, _NOISE = 1e-12, 1e-13


@dataclass(frozen=True, eq=False)
class BoundaryPoint:
    """A flow on a boundary: unknowns ``w`` (n+4,) of ``system``, the ``flow``, and the estimated relative ``error``
    of its Q, h, M and of the parameter, the largest."""

    system: BoundarySystem
    w: Array
    flow: Flow
    error: float

    @property
    def value(self) -> float:
        """The second parameter."""
        return float(self.w[-1])


def solve_boundary_point(system: BoundarySystem, w: Array, row: Array, value: float, tolerance: float) -> BoundaryPoint:
    """The point of the boundary near ``w`` whose last three unknowns have the product ``value`` with ``row`` (3,).

    Newton's method converges on one grid and takes one more step on the next finer one, until the change of
    ln Q, ln h, ln M and of the parameter is below ``tolerance``, or below what rounding does.

    Raises:
        SolveError: where it does not converge, or the finest grid does not suffice.
    """
    finer_degrees = [degree for degree in DEGREES if degree > system.degree]
    refits = _REFITS
    while finer_degrees:
        result = newton(lambda w, system=system: _border(system, w, row, value), w, tolerance=_STEP, longest_step=2.0)
        # Where the start is on a grid for other breaks than the flow there passes, Newton's method does not converge.
        refitted = system.refit(result.z if result.converged else w) if refits else None
        if refitted is not None:
            (system, w), refits = refitted, refits - 1
            finer_degrees = [degree for degree in DEGREES if degree > system.degree]
            continue
        if not result.converged:
            raise SolveError("a point of a boundary could not be solved: narrow the range searched")
        coarse = _quantities(system, result.z)
        system, w = refine_grid(system, result.z, finer_degrees.pop(0))
        residual, jacobian = _border(system, w, row, value)
        w = w - solve_each(jacobian, residual)
        change = float(np.abs(_quantities(system, w) - coarse).max())
        noise = _noise(system, w, jacobian)
        if change < max(tolerance, noise):
            return make_point(system, w, max(change, noise))
    raise SolveError("the finest grid did not reach the tolerance: ask for a larger tolerance")


def estimate_shift(system: BoundarySystem, w: Array, row: Array) -> float:
    """How far the parameter is from the boundary, by the first step of Newton's method in the plane across ``row``
    (3,) through ``w``; infinitely far where the parameter has no say in it."""
    residual, jacobian = _border(system, w, row, float(row @ w[-3:]))
    far = -float(solve_each(jacobian, residual)[-1])
    return far if np.isfinite(far) else np.inf


def solve_across(system: BoundarySystem, w: Array, tolerance: float) -> BoundaryPoint:
    """The point of the boundary next to ``w``: in the plane through it across the boundary; see
    :func:`solve_boundary_point`."""
    row = (system.weights * system.tangent(w))[-3:]
    return solve_boundary_point(system, w, row, float(row @ w[-3:]), tolerance)


def refine_grid(system: BoundarySystem, w: Array, degree: int) -> tuple[BoundarySystem, Array]:
    """The system and a point of it on the grid of another degree."""
    problem, z = prolong(system.problem(float(w[-1])), w[:-1], degree)
    w = np.append(z, w[-1])
    return system.moved(problem, w), w


def make_point(system: BoundarySystem, w: Array, error: float) -> BoundaryPoint:
    """The point of the boundary with solved unknowns ``w``."""
    chute = system.sweep.chute_at(float(w[-1]))
    problem = system.problem(float(w[-1]))
    problem, z = unpin(replace(problem, model=replace(problem.model, chute=chute)), w[:-1])
    solution = Solution(problem.state(z).macroscopic(), error, SolverStatus.CONVERGED, (problem, z))
    return BoundaryPoint(system, w, Flow(chute, solution), error)


def _border(system: BoundarySystem, w: Array, row: Array, value: float) -> tuple[Array, Array]:
    residual, jacobian = system.residual_and_jacobian(w)
    last = np.concatenate([np.zeros(len(w) - 3), row])
    return np.append(residual, row @ w[-3:] - value), np.concatenate([jacobian, last[None]])


def _quantities(system: BoundarySystem, w: Array) -> Array:
    """ln Q, ln h, ln M, and the parameter in units of its size."""
    macroscopic = system.problem(float(w[-1])).state(w[:-1]).macroscopic()[:LOG_T]
    return np.append(macroscopic, w[-1] / _size(system, w))


def _size(system: BoundarySystem, w: Array) -> float:
    return max(abs(float(w[-1])), system.sweep.high - system.sweep.low)


def _noise(system: BoundarySystem, w: Array, jacobian: Array) -> float:
    """What rounding of the equations can do to the quantities."""
    gradient = np.zeros((len(w), 4))
    gradient[:-1, :3] = system.problem(float(w[-1])).state(w[:-1]).macroscopic_gradient()[:LOG_T].T
    by_parameter = derivative(system.local(w).stepped.macroscopic()[:LOG_T])
    gradient[-1] = np.append(by_parameter, 1.0 / _size(system, w))
    sensitivity = np.abs(solve_each(jacobian.T, gradient)).sum(axis=0).max()
    return max(_FLOOR, _NOISE * float(sensitivity))
