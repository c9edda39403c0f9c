"""One steady flow to a tolerance: Newton's method, resolution chosen by the program, and an honest error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from chuteflow.checks import real
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.newton import newton
from chuteflow.steady import kinks
from chuteflow.steady.collocation import LOG_M, LOG_T, Collocation, State
from chuteflow.steady.elements import MOST_ELEMENTS, Elements, Iterate
from chuteflow.steady.model import Model
from chuteflow.theory.constitutive import Law
from chuteflow.threads import on_one_thread

#: Relative tolerance in Q, h and M by default.
TOLERANCE = 1e-10
#: Least error ever claimed, and factor by which rounding may do more than in the cases that are tried.
_FLOOR, _SAFETY = 1e-12, 4.0
#: Newton's method ends with a step below this, after which the next one would be below rounding; steps at most.
_STEP, _MOST_STEPS = 1e-7, 40
#: After one below this the finer flow is as good as its mesh.
_FINE_STEP = 1e-6
#: Rounds in which the ends of elements come to where the flow passes a break of the law.
_MOST_ROUNDS = 12
#: The hold-up fixes a flow where it is this part of the change along the branch.
_STEEP = 1e-3
#: A grid resolves a flow where its integrals agree to this.
_AGREES = 1e-11
#: Nodes of a grid in pieces up to which Newton's method is used on it: its time rises with their cube.
_MOST_NODES = 800
#: The elements are halved until the unknowns on such a grid change by less than this part of the largest.
_SETTLED, _MOST_HALVINGS = 1e-11, 4


class SolverStatus(Enum):
    """How a solution ended; each value is a sentence that says what to try."""

    CONVERGED = "converged"
    NO_CONVERGENCE = "Newton's method did not converge from this start: start from a nearer flow"
    UNRESOLVED = "the finest grid did not reach the tolerance: ask for a larger tolerance"


@dataclass(frozen=True)
class Condition:
    """Which flow of a branch: ``weights`` . (ln Q, ln h, ln M, ln T_surface) = ``value``."""

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

    ``source`` is the flow on elements, as it was solved, or on a Chebyshev grid with its unknowns; or the law that
    would be needed for either, where a file was written with one that is not registered here. ``rates`` (4,) are
    the derivatives of the macroscopic quantities along the branch, with the value of the condition that was solved.
    """

    macroscopic: Array
    error: float
    status: SolverStatus
    source: Elements | tuple[Collocation, Array] | Law
    rates: Array | None = None

    @property
    def converged(self) -> bool:
        """Whether the tolerance was reached."""
        return self.status is SolverStatus.CONVERGED

    @cached_property
    def elements(self) -> Elements:
        """The flow on elements.

        Raises:
            InputError: where its law is not known.
        """
        return self.source if isinstance(self.source, Elements) else Elements.of_collocation(*self._on_grid)

    @cached_property
    def _on_grid(self) -> tuple[Collocation, Array]:
        if isinstance(self.source, Law):
            self.source.at(np.zeros(1), 1.0, 1.0)  # says what is missing
        return self.source if isinstance(self.source, tuple) else collocate(self)

    @property
    def problem(self) -> Collocation:
        """The problem on a Chebyshev grid that resolves the flow."""
        return self._on_grid[0]

    @property
    def z(self) -> Array:
        """Its unknowns on that grid."""
        return self._on_grid[1]

    @cached_property
    def state(self) -> State:
        """Everything pointwise at the nodes of that grid."""
        return self.problem.state(self.z)


def check_tolerance(tolerance: float) -> float:
    """The relative tolerance, checked to be in the range allowed.

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


# It runs when a flow is first asked for its fields, and a flow that runs away is told by what is not finite.
@on_one_thread
@np.errstate(all="ignore")
def collocate(solution: Solution) -> tuple[Collocation, Array]:
    """The problem on a Chebyshev grid that resolves a solved flow, and its unknowns there.

    Newton's method on the grid, at the same hold-up, or beside a fold in it across the branch: profiles are then as
    accurate as the integrals over the depth. Where the grid would have too many nodes for that, the flow on elements is
    refined. Where not even the last grid resolves it, profiles have the digits of the elements there.
    """
    rates = solution.rates
    weights = np.array([0.0, 0.0, 1.0, 0.0])
    if rates is not None and abs(rates[LOG_M]) < _STEEP * np.linalg.norm(rates):
        weights = rates / np.linalg.norm(rates)
    value = float(weights @ solution.macroscopic)
    found, agrees = _on_grids(solution, weights, value)
    if not agrees and solution.error > TOLERANCE:
        # A flow that was requested roughly: between the ends of its elements it has fewer digits than its integrals.
        finer = solve(solution.elements.halve(), Condition(tuple(weights.tolist()), value), TOLERANCE)
        if finer.converged:
            found, _ = _on_grids(finer, weights, value)
    return found


def _on_grids(solution: Solution, weights: Array, value: float) -> tuple[tuple[Collocation, Array], bool]:
    """The problem on the grid that resolves a flow best and its unknowns, and whether its integrals are the flow's."""
    last: tuple[Collocation, Array] | None = None
    agreed = resolved = False
    elements = solution.elements
    for problem, rough in elements.grids(kinks.crossings(elements)):
        if problem.grid.degree < _MOST_NODES:
            found = newton(
                lambda z, problem=problem: _system(problem.state(z), weights, np.array(value)),
                rough,
                tolerance=_STEP,
                longest_step=2.0,
            )
            z, converged = found.z, found.converged
        else:
            z, converged = _on_finer_elements(elements, problem, weights, value)
        off = np.abs(problem.state(z).macroscopic() - solution.macroscopic)[:LOG_T].max()
        agrees = converged and bool(off < max(_AGREES, solution.error))
        if agrees or last is None:
            last = problem, z if agrees else rough
        agreed |= agrees
        # One grid more than it takes for the integrals: profiles want it.
        if agrees and resolved:
            break
        resolved = agrees
    assert last is not None
    return last, agreed


def _on_finer_elements(elements: Elements, problem: Collocation, weights: Array, value: float) -> tuple[Array, bool]:
    """The unknowns of a flow on the grid of ``problem``, from elements halved until they settle; whether they do."""
    z = elements.unknowns(problem)
    for _ in range(_MOST_HALVINGS):
        finer = _iterate(elements.halve(), weights, value, _FINE_STEP)
        if not np.isfinite(finer.step):
            break
        elements, before = finer.flow, z
        z = elements.unknowns(problem)
        if np.abs(z - before).max() < _SETTLED * np.abs(z).max():
            return z, True
    return z, False


def _system(state: State, weights: Array, value: Array) -> tuple[Array, Array]:
    """Residual and Jacobian of the steady problem with its condition, the last equation."""
    gradient = (weights[..., None] * state.macroscopic_gradient()).sum(axis=-2)
    off = (weights * state.macroscopic()).sum(axis=-1) - value
    return (
        np.concatenate([state.residual(), off[..., None]], axis=-1),
        np.concatenate([state.jacobian(), gradient[..., None, :]], axis=-2),
    )


def solve(start: Elements, condition: Condition, tolerance: float = TOLERANCE) -> Solution:
    """The flow nearest to ``start`` that meets ``condition``.

    Newton's method converges on one mesh, and then on the mesh of twice as many elements, in a step or two: the change
    in ln Q, ln h, ln M and ln T_surface is the error of the coarser solution, and bounds that of the finer, which is
    returned. The mesh is refined until the change is below ``tolerance``, or below what rounding does, which is more
    very close to a fold.
    """
    weights, value = np.array(condition.weights), condition.value
    coarse = _iterate(start, weights, value, _STEP)
    while np.isfinite(coarse.step):
        fine = _iterate(coarse.flow.halve(), weights, value, _FINE_STEP, rounding=True)
        if not np.isfinite(fine.step):
            break
        change = float(np.abs(fine.quantities - coarse.quantities).max())
        noise = max(_FLOOR, _SAFETY * float(np.abs(fine.errors).max()))
        if change < max(tolerance, noise):
            return Solution(fine.quantities, max(change, noise), SolverStatus.CONVERGED, fine.flow, fine.rates)
        if len(fine.flow.slopes) > MOST_ELEMENTS:
            return Solution(fine.quantities, np.inf, SolverStatus.UNRESOLVED, fine.flow)
        coarse = fine
    return Solution(np.full(4, np.nan), np.inf, SolverStatus.NO_CONVERGENCE, start)


def _iterate(start: Elements, weights: Array, value: float, step: float, *, rounding: bool = False) -> Iterate:
    """Newton's method until a step is below ``step``, on elements that end where the flow passes a break of the law."""
    if not start.model.kinks.size:
        return start.iterate(weights, value, step, _MOST_STEPS, rounding=rounding)
    places = kinks.crossings(start)
    distance, found = np.inf, None
    for _ in range(_MOST_ROUNDS):
        found = kinks.with_ends(start, places).iterate(weights, value, step, _MOST_STEPS, rounding=rounding)
        if not np.isfinite(found.step):
            break
        start, places = found.flow, kinks.crossings(found.flow)
        before, distance = distance, kinks.distance(start, places)
        # Rounding leaves more of a distance where the density hardly changes.
        if distance < kinks.meets(start) or (distance < kinks.NEAR and distance > 0.1 * before):
            return found
    assert found is not None
    return replace(found, step=np.inf)


def resolve(
    near: Solution, condition: Condition, tolerance: float = TOLERANCE, problem: Model | None = None
) -> Solution:
    """The flow that meets ``condition``, from a neighbour, which may be of another ``problem``."""
    start = near.elements.adapt(_stretch(near))
    return solve(start if problem is None else replace(start, model=problem), condition, tolerance)


def between(one: Solution, other: Solution, fraction: float) -> Elements:
    """Where to start from for a flow ``fraction`` of the way from ``one`` to ``other``."""
    return one.elements.blend(other.elements, fraction, _stretch(one))


def _stretch(solution: Solution) -> float:
    mass, temperature = np.exp(solution.macroscopic[LOG_M:])
    return default_stretch(solution.elements.model, float(mass), float(temperature))
