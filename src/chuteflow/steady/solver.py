"""One steady flow to a tolerance: Newton's method, resolution chosen by the program, and an honest error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

import numpy as np

from chuteflow.checks import real
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.newton import newton, solve_each
from chuteflow.steady.collocation import LOG_M, LOG_T, Collocation, State
from chuteflow.steady.model import Model

#: Degrees tried in turn; each is solved on, and judged by the next.
DEGREES = (16, 24, 36, 54, 80, 120, 180, 270, 400)
#: Relative tolerance in Q, h and M unless another is asked for.
TOLERANCE = 1e-10
#: Least error ever claimed, and error of the residuals by rounding and tabulation of the closures.
_FLOOR, _NOISE = 1e-12, 2e-14
#: Newton's method ends with a step below this, after which the next one would be below rounding.
_STEP = 1e-7
#: Iterations of flows side by side before the rest are solved one by one, and the longest step there.
_MOST_SIDE_BY_SIDE, _FAR = 6, 3.0
#: Flows that are treated side by side at most.
_TOGETHER = 256

Item = TypeVar("Item")


class Status(Enum):
    """How a solution ended; each value is a sentence that says what to try."""

    CONVERGED = "converged"
    NO_CONVERGENCE = "Newton's method did not converge from this start: start from a nearer flow"
    UNRESOLVED = "the finest grid did not reach the tolerance: ask for a larger tolerance"


@dataclass(frozen=True)
class Condition:
    """Which flow of a family: ``weights`` . (ln Q, ln h, ln M, ln T_surface) = ``value``."""

    weights: tuple[float, float, float, float]
    value: float

    @classmethod
    def fix(cls, which: int, value: float) -> Condition:
        """Prescribe one quantity, by its place in the macroscopic ones, at ``value``."""
        weights = [0.0, 0.0, 0.0, 0.0]
        weights[which] = 1.0
        return cls((weights[0], weights[1], weights[2], weights[3]), float(np.log(value)))

    @classmethod
    def plane(cls, ahead: Array, macroscopic: Array) -> Condition:
        """The plane through a flow normal to ``ahead`` (d ln M, d ln T_surface)."""
        return cls((0.0, 0.0, float(ahead[0]), float(ahead[1])), float(ahead @ macroscopic[LOG_M:]))


@dataclass(frozen=True, eq=False)
class Solution:
    """A discretised flow: ``macroscopic`` (ln Q, ln h, ln M, ln T_surface), their error, and how it ended.

    ``response`` (4,) is their derivative along the branch with respect to the value of the condition, to a few digits;
    None where no condition was solved for.
    """

    problem: Collocation
    z: Array
    macroscopic: Array
    error: float
    status: Status
    response: Array | None = None

    @property
    def converged(self) -> bool:
        """Whether the tolerance was reached."""
        return self.status is Status.CONVERGED

    @cached_property
    def state(self) -> State:
        """Everything pointwise at the nodes."""
        return self.problem.state(self.z)


def checked_tolerance(tolerance: float) -> float:
    """A relative tolerance as it was given, once it is sure that it can be asked for.

    Raises:
        InputError: if it is out of range.
    """
    asked = real("tolerance", tolerance)
    if not 1e-11 <= asked <= 1e-3:
        raise InputError(f"tolerance {asked:g}: must be from 1e-11 to 1e-3")
    return asked


def default_stretch(model: Model, mass: float, temperature: float) -> float:
    """A stretch that spreads the surface layer: of width T on the half-line, p_S at the interface."""
    return float(np.log1p(mass / (model.surface_stress or temperature)))


def prolong(problem: Collocation, z: Array, degree: int) -> tuple[Collocation, Array]:
    """The same flows on the grid of another degree."""
    other, matrix = problem.transferred(degree)
    return other, np.concatenate([z[..., :-2] @ matrix.T, z[..., -2:]], axis=-1)


# A flow that runs away is told by what is not finite.
@np.errstate(all="ignore")
def solve(problem: Collocation, z: Array, condition: Condition, tolerance: float = TOLERANCE) -> Solution:
    """The flow nearest to ``z`` that meets ``condition``.

    Newton's method converges on one grid, and takes one more step on the next finer one: the change in
    ln Q, ln h and ln M is the error of the coarser solution, and bounds that of the finer, which is
    returned. The grid is refined until the change is below ``tolerance``, or below what rounding does, which
    is more very close to a fold.
    """
    # A flow that runs away, or has no neighbours to step to, is told by what is not finite.
    with np.errstate(all="ignore"):
        return _solve(problem, z, np.array(condition.weights), np.array(condition.value), tolerance)


def _solve(problem: Collocation, z: Array, weights: Array, value: Array, tolerance: float) -> Solution:
    finer_degrees = [d for d in DEGREES if d > problem.degree]
    while True:
        result = newton(
            lambda z, problem=problem: _system(problem.state(z), weights, value),
            z,
            tolerance=_STEP,
            longest_step=2.0,
        )
        z = result.z
        coarse = problem.state(z).macroscopic()
        if not (result.converged and np.isfinite(coarse).all()):
            return Solution(problem, z, np.full(4, np.nan), np.inf, Status.NO_CONVERGENCE)
        if not finer_degrees:
            return Solution(problem, z, coarse, np.inf, Status.UNRESOLVED)
        problem, z = prolong(problem, z, finer_degrees.pop(0))
        z, fine, change, noise, response = _refined(problem, z, weights, value, coarse)
        error = np.maximum(change, noise)
        if change < max(tolerance, noise):
            return Solution(problem, z, fine, float(error), Status.CONVERGED, response)


def in_parts(members: list[Item]) -> Iterator[list[Item]]:
    """As many members at a time as are treated side by side: more would take memory and no less time."""
    for first in range(0, len(members), _TOGETHER):
        yield members[first : first + _TOGETHER]


def solve_many(
    starts: Sequence[tuple[Collocation, Array]], conditions: Sequence[Condition], tolerance: float = TOLERANCE
) -> list[Solution]:
    """As :func:`solve` for many flows of one model at once, which costs a fraction for each.

    Flows on grids of one degree go through Newton's method side by side, and those that want a finer grid go
    on to the next degree; the few that do not converge so are solved one by one.
    """
    out: dict[int, Solution] = {}
    pending = dict(enumerate(starts))
    for degree, finer in pairwise(DEGREES):
        members = [i for i, (problem, _) in pending.items() if problem.degree == degree]
        for some in in_parts(members):
            pending |= _side_by_side(some, pending, finer, conditions, tolerance, out)
        pending = {i: start for i, start in pending.items() if i not in out}
    for i, (problem, z) in pending.items():
        out[i] = solve(problem, z, conditions[i], tolerance)
    return [out[i] for i in range(len(starts))]


def _side_by_side(
    members: Sequence[int],
    starts: Mapping[int, tuple[Collocation, Array]],
    finer: int,
    conditions: Sequence[Condition],
    tolerance: float,
    out: dict[int, Solution],
) -> dict[int, tuple[Collocation, Array]]:
    """Solve the flows ``members`` on their common degree, put those that reach the tolerance on the finer one
    into ``out``, and return where to go on from with those that were found but want more."""
    model, degree = starts[members[0]][0].model, starts[members[0]][0].degree
    together = Collocation(model, degree, np.array([[starts[i][0].stretch] for i in members]))
    z = np.array([starts[i][1] for i in members])
    weights = np.array([conditions[i].weights for i in members])
    value = np.array([conditions[i].value for i in members])
    step = np.full(len(members), np.inf)
    # A flow that runs away is left where it is, and solved on its own afterwards.
    with np.errstate(all="ignore"):
        for _ in range(_MOST_SIDE_BY_SIDE):
            f, jacobian = _system(together.state(z), weights, value)
            move = solve_each(jacobian, f[..., None])[..., 0]
            step = np.abs(move).max(axis=-1)
            z = np.where((step < _FAR)[:, None], z - move, z)
            if not (step >= _STEP).any():
                break
        coarse = together.state(z).macroscopic()
        together, z = prolong(together, z, finer)
        z, fine, change, noise, response = _refined(together, z, weights, value, coarse)
        error = np.maximum(change, noise)
    onward: dict[int, tuple[Collocation, Array]] = {}
    for row, i in enumerate(members):
        if not step[row] < _STEP:
            continue
        problem = Collocation(model, finer, starts[i][0].stretch)
        if change[row] < max(tolerance, noise[row]):
            out[i] = Solution(problem, z[row], fine[row], float(error[row]), Status.CONVERGED, response[row])
        elif np.isfinite(z[row]).all():
            onward[i] = (problem, z[row])
    return onward


def _refined(
    problem: Collocation, z: Array, weights: Array, value: Array, coarse: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """One Newton step on a finer grid: unknowns, macroscopic quantities, their change, what rounding of the
    residuals and of the tabulated closures can do to them, and what a change of the condition's value does."""
    state = problem.state(z)
    f, jacobian = _system(state, weights, value)
    z = z - solve_each(jacobian, f[..., None])[..., 0]
    fine = problem.state(z).macroscopic()
    change = np.abs(fine - coarse)[..., :LOG_T].max(axis=-1)
    gradient = np.swapaxes(state.macroscopic_gradient(), -1, -2)
    adjoint = solve_each(np.swapaxes(jacobian, -1, -2), gradient)
    sensitivity = np.abs(adjoint[..., :LOG_T]).sum(axis=-2).max(axis=-1)
    return z, fine, change, np.maximum(_FLOOR, _NOISE * sensitivity), adjoint[..., -1, :]


def resolve(near: Solution, condition: Condition, tolerance: float = TOLERANCE) -> Solution:
    """The flow that meets ``condition``, from a neighbour: from one grid coarser, as :func:`solve`."""
    coarser = max(d for d in DEGREES if d < max(near.problem.degree, DEGREES[1]))
    return solve(*prolong(near.problem, near.z, coarser), condition, tolerance)


def alike(one: Solution, other: Solution) -> tuple[Collocation, Array, Array]:
    """Two flows on the grid of the first, one degree coarser: where to start from for flows between them."""
    coarser = max(d for d in DEGREES if d < max(one.problem.degree, DEGREES[1]))
    problem, matrix = one.problem.transferred(coarser)
    _, other_matrix = other.problem.transferred(problem.degree, problem.stretch)
    z = np.concatenate([matrix @ one.z[:-2], one.z[-2:]])
    return problem, z, np.concatenate([other_matrix @ other.z[:-2], other.z[-2:]])


def _system(state: State, weights: Array, value: Array) -> tuple[Array, Array]:
    """Residual and Jacobian of the steady problem with its condition, the last equation."""
    gradient = (weights[..., None] * state.macroscopic_gradient()).sum(axis=-2)
    off = (weights * state.macroscopic()).sum(axis=-1) - value
    return (
        np.concatenate([state.residual(), off[..., None]], axis=-1),
        np.concatenate([state.jacobian(), gradient[..., None, :]], axis=-2),
    )
