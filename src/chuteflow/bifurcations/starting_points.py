"""Where boundaries are entered: their points on the branches of flows at one value of the second parameter.

# notation: sigma runs from 0 to 1 along the chord between two successive flows of a branch in the plane
# (ln M, ln T_surface).

A boundary that begins and ends between two values, as the two folds that begin at a cusp, has no point at
either. It announces itself: near the cusp the quantity that folds has a place where it almost turns. From there, and
from the ends of branches, the parameter is moved until the condition holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from chuteflow.bifurcations.conditions import Fold, InteriorChange, Inversion, TestFunction
from chuteflow.bifurcations.grids import pin, transfer
from chuteflow.bifurcations.points import BoundaryPoint, estimate_shift, solve_across, solve_boundary_point
from chuteflow.bifurcations.system import BoundarySystem, SecondParameter
from chuteflow.branches.paths import solve_between
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.solution_branches import TracedBranch, trace_branches
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.newton import solve_each
from chuteflow.numerics.roots import bisect
from chuteflow.steady.collocation import LOG_M, LOG_Q, LOG_T
from chuteflow.steady.model import LOSS, WORK, model
from chuteflow.steady.solver import Condition, Solution, resolve

#: The kinds of boundaries, and the quantities whose folds they are.
FOLDS = {"fold-Q": LOG_Q, "fold-M": LOG_M, "fold-T": LOG_T}
KINDS = (*FOLDS, "density-inversion", "interior-change")
#: The row that holds the parameter.
HELD = np.array([0.0, 0.0, 1.0])
#: A point is searched for this far beyond a chord, and found within so many of its lengths beside it.
_BEYOND, _BESIDE = 0.02, 1.0
#: How often a stretch is halved where the point that it must hold is not found.
_HALVINGS = 6
#: A boundary beside the branches is searched for as far as so many times the distance to go to it.
_FARTHER = 1.5
#: A walk there goes by at most this fraction of the distance at once, so many times, with flows solved to this
#: tolerance, and ends where so small a fraction is left.
_STRIDE, _MOST_STEPS, _ROUGH, _ARRIVED = 0.12, 20, 1e-6, 0.02
#: Nodes of the grid of a flow at most.
MOST_NODES = 640
#: A condition that no flow enters is met at values of the parameter known to this.
_CLOSE = 1e-14
#: Net loss below this is none.
_NONE = 1e-10
#: Range of ln x over which the least is searched for, samples of it, and how often it is zoomed in.
_LOG_X, _SAMPLES, _ZOOMS = (-20.0, 30.0), 200, 6


@dataclass(frozen=True, eq=False)
class _SampledFlow:
    """A flow of a branch, with the condition's function of it: ``value``, and ``gradient`` (n+3,) and that of the
    plane (ln M, ln T_surface), (2, n+3), and the Jacobian of the steady problem."""

    solution: Solution
    value: float
    gradient: Array
    plane: Array
    jacobian: Array

    def slope(self, chord: Array) -> float:
        """Derivative of the function with respect to sigma, along a chord (2,)."""
        matrix = np.concatenate([self.jacobian, (chord @ self.plane / (chord @ chord))[None]])
        side = np.zeros(len(matrix))
        side[-1] = 1.0
        return float(self.gradient @ solve_each(matrix, side))


def make_test_functions(kind: str) -> Sequence[TestFunction]:
    """The conditions of a kind of boundary."""
    if kind in FOLDS:
        return [Fold(FOLDS[kind])]
    return [Inversion()] if kind == "density-inversion" else [InteriorChange(False), InteriorChange(True)]


def find_on_branches(
    sweep: SecondParameter,
    condition: TestFunction,
    value: float,
    branches: Sequence[TracedBranch],
    reach: float,
    tolerance: float,
) -> Iterator[BoundaryPoint]:
    """Every point of the boundary on branches of flows at one value of the parameter, and points beside them, as
    far as ``reach`` in the parameter, where a branch comes near to the condition and does not meet it."""
    for branch in branches:
        samples = [_sample(sweep, condition, value, solution) for solution in _among(branch)]
        if isinstance(condition, Fold):
            for turn in branch.turns(condition.which, tolerance):
                if may_follow(turn.point.solution):
                    yield _from_flow(sweep, condition, value, turn.point.solution, tolerance)
        else:
            yield from _zeros(sweep, condition, value, samples, tolerance)
        for i, chord in _nearest(samples, condition):
            point = _beside(sweep, condition, value, samples[i].solution, chord, reach, tolerance)
            if point is not None:
                yield point


def _among(branch: TracedBranch) -> list[Solution]:
    """The flows of a branch that a grid of a few pieces resolves: boundaries are followed on such."""
    return [solution for solution in branch.solutions if may_follow(solution)]


def may_follow(solution: Solution) -> bool:
    """Whether boundaries are followed among flows like this one."""
    return len(solution.problem.grid.nodes) <= MOST_NODES


def trace_branches_at(sweep: SecondParameter, value: float, within: SearchRange) -> list[TracedBranch]:
    """Every branch of flows in a range at one value of the parameter."""
    return trace_branches(model(sweep.chute_at(value)), within)


def _from_flow(
    sweep: SecondParameter, condition: TestFunction, value: float, solution: Solution, tolerance: float
) -> BoundaryPoint:
    """The point of the boundary at a value of the parameter, from its flow."""
    system, w = on_grid_of(sweep, condition, value, solution)
    return solve_boundary_point(system, w, HELD, value, tolerance)


def on_grid_of(
    sweep: SecondParameter, condition: TestFunction, value: float, solution: Solution
) -> tuple[BoundarySystem, Array]:
    """The system on the grid of a flow, and the flow on it."""
    problem, z = pin(solution.problem, solution.z)
    w = np.append(z, value)
    return BoundarySystem(sweep, condition, 0, 0.0).moved(problem, w), w


def _zeros(
    sweep: SecondParameter, condition: TestFunction, value: float, samples: Sequence[_SampledFlow], tolerance: float
) -> list[BoundaryPoint]:
    """The points along a branch where the condition's function vanishes."""
    found: list[BoundaryPoint] = []
    for first, last in pairwise(samples):
        for point in _between(sweep, condition, value, first, last, tolerance, _HALVINGS):
            if not any(_same(point, other) for other in found):
                found.append(point)
    return found


def _between(
    sweep: SecondParameter,
    condition: TestFunction,
    value: float,
    first: _SampledFlow,
    last: _SampledFlow,
    tolerance: float,
    halvings: int,
) -> Iterator[BoundaryPoint]:
    """The points between two flows: as the cubic through both says, or those in both halves."""
    chord = (last.solution.macroscopic - first.solution.macroscopic)[LOG_M:]
    if not chord.any():
        return
    needed = (first.value > 0.0) != (last.value > 0.0)
    places = _places(first.value, last.value, first.slope(chord), last.slope(chord))
    if not needed and not places:
        return
    found = [p for p in (_near(sweep, condition, value, first, last, s, tolerance) for s in places) if p is not None]
    found = [p for i, p in enumerate(found) if not any(_same(p, q) for q in found[:i])]
    if (len(found) % 2 == 1) == needed and len(found) == len(places):
        yield from found
    elif halvings:
        middle = _sample(sweep, condition, value, solve_between(first.solution, last.solution, 0.5))
        yield from _between(sweep, condition, value, first, middle, tolerance, halvings - 1)
        yield from _between(sweep, condition, value, middle, last, tolerance, halvings - 1)
    elif needed:
        raise SolveError("a point of a boundary was seen but not solved: narrow the range searched")


def _places(f0: float, f1: float, d0: float, d1: float) -> list[float]:
    """Where the cubic with these end values and slopes on [0, 1] vanishes, about in between."""
    cubic = np.array([2.0 * (f0 - f1) + d0 + d1, 3.0 * (f1 - f0) - 2.0 * d0 - d1, d0, f0])
    if not np.isfinite(cubic).all():
        return []
    roots = np.roots(cubic)
    real = roots[np.abs(roots.imag) <= 1e-12].real
    return sorted(np.clip(real[(real > -_BEYOND) & (real < 1.0 + _BEYOND)], 0.0, 1.0).tolist())


def _near(
    sweep: SecondParameter,
    condition: TestFunction,
    value: float,
    first: _SampledFlow,
    last: _SampledFlow,
    sigma: float,
    tolerance: float,
) -> BoundaryPoint | None:
    """The point near ``sigma`` of a chord, if there is one."""
    one, other = sorted((first.solution, last.solution), key=lambda s: -len(s.problem.grid.nodes))
    fraction = 1.0 - sigma if one is last.solution else sigma
    problem, z = pin(one.problem, one.z)
    moved = transfer(other.problem, other.z, problem)
    w = np.append(z + fraction * (moved - z), value)
    system = BoundarySystem(sweep, condition, 0, 0.0).moved(problem, w)
    try:
        point = solve_boundary_point(system, w, HELD, value, tolerance)
    except SolveError:
        return None
    ends = np.array([s.solution.macroscopic[LOG_M:] for s in (first, last)])
    here = point.flow.solution.macroscopic[LOG_M:]
    chord = ends[1] - ends[0]
    length = float(np.hypot(*chord))
    along = float((here - ends[0]) @ chord) / length
    beside = float(np.hypot(*(here - ends[0] - along / length * chord)))
    inside = -_BEYOND * length <= along <= (1.0 + _BEYOND) * length
    return point if inside and beside <= _BESIDE * length else None


def _nearest(samples: Sequence[_SampledFlow], condition: TestFunction) -> Iterator[tuple[int, Array]]:
    """Indices of the flows that come nearest to the condition, or end the branch on the way to it, with a chord."""
    plane = np.array([sample.solution.macroscopic[LOG_M:] for sample in samples])
    chords = np.diff(plane, axis=0)
    if len(samples) < 3 or not chords.any(axis=1).all():
        return
    chords = np.concatenate([chords, chords[-1:]])
    if condition.turns:
        f = np.array([s.slope(c) / np.hypot(*c) for s, c in zip(samples, chords, strict=True)])
    else:
        f = np.array([sample.value for sample in samples])
    size = np.abs(f)
    for i in range(len(f)):
        beside = [j for j in (i - 1, i + 1) if 0 <= j < len(f)]
        if all(size[i] <= size[j] and f[i] * f[j] > 0.0 for j in beside):
            yield i, chords[i]


def _beside(
    sweep: SecondParameter,
    condition: TestFunction,
    value: float,
    solution: Solution,
    chord: Array,
    reach: float,
    tolerance: float,
) -> BoundaryPoint | None:
    """The point of the boundary that a flow comes to as the parameter moves, held in the plane across its branch."""
    row = np.array([chord[1], chord[0], 0.0])
    plane = Condition.plane(chord, solution.macroscopic)
    at = value
    for _ in range(_MOST_STEPS):
        system, w = on_grid_of(sweep, condition, at, solution)
        ahead = at + estimate_shift(system, w, row)
        if not (abs(ahead - value) <= reach and sweep.allows(ahead)):
            return None
        if abs(ahead - at) <= _ARRIVED * reach:
            break
        at += float(np.clip(ahead - at, -_STRIDE * reach, _STRIDE * reach))
        moved = replace(solution.problem, model=sweep.models(at)[0])
        solution = resolve(replace(solution, source=(moved, solution.z)), plane, _ROUGH)
        if not solution.converged:
            return None
    else:
        return None
    try:
        point = solve_boundary_point(system, w, row, float(row @ w[-3:]), tolerance)
    except SolveError:
        return None
    near = abs(point.value - value) <= _FARTHER * reach and sweep.low <= point.value <= sweep.high
    return point if near else None


def _same(p: BoundaryPoint, q: BoundaryPoint) -> bool:
    gap = p.flow.solution.macroscopic - q.flow.solution.macroscopic
    return bool(np.abs(gap).max() < 1e-7)


def _sample(sweep: SecondParameter, condition: TestFunction, value: float, solution: Solution) -> _SampledFlow:
    problem, z = pin(solution.problem, solution.z)
    stretch = float(np.reshape(problem.stretch, ()))
    system = BoundarySystem(sweep, condition, problem.degree, stretch, problem.breaks, problem.pins)
    at = system.local(np.append(z, value))
    f, gradient = condition.along_branch(at)
    return _SampledFlow(solution, f, gradient, at.state.macroscopic_gradient()[LOG_M:], at.by_z)


def find_values_for_all_flows(sweep: SecondParameter, condition: TestFunction, low: float, high: float) -> list[float]:
    """Values of the parameter between ``low`` and ``high`` at which the condition may hold along whole branches.

    On the half-line dissipation and production balance at the surface, or at the density where they come nearest
    to it, in all flows of a chute that have that density or in none.
    """
    if not isinstance(condition, InteriorChange) or sweep.chute.surface != "free":
        return []
    out = []
    for balance in (_at_surface, _least):
        ends = balance(sweep, low), balance(sweep, high)
        if (ends[0] > 0.0) != (ends[1] > 0.0):
            sign = 1.0 if ends[1] > 0.0 else -1.0
            out.append(bisect(lambda value, sign=sign, of=balance: sign * of(sweep, value), low, high, _CLOSE))
    return out


def find_along_branches(
    sweep: SecondParameter, condition: TestFunction, value: float, branches: Sequence[TracedBranch], tolerance: float
) -> Iterator[BoundaryPoint]:
    """One point of each stretch of the branches of flows at a value of the parameter that is boundary throughout."""
    for branch in branches:
        samples = [_sample(sweep, condition, value, solution) for solution in _among(branch)]
        met = np.array([abs(sample.value) < _NONE for sample in samples])
        edges = np.flatnonzero(np.diff(np.concatenate([[False], met, [False]]).astype(int)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            solution = samples[(begin + end) // 2].solution
            system, w = on_grid_of(sweep, condition, value, solution)
            yield solve_across(system, w, tolerance)


def _at_surface(sweep: SecondParameter, value: float) -> float:
    """Net loss at the surface of the half-line."""
    here, _ = sweep.models(value)
    f, _ = here.closures(np.zeros(1))
    return float(f[LOSS, 0] - here.slope**2 * f[WORK, 0])


def _least(sweep: SecondParameter, value: float) -> float:
    """The least net loss at any density."""
    here, _ = sweep.models(value)
    (low, high), least = _LOG_X, np.inf
    for _ in range(_ZOOMS):
        log_x = np.linspace(low, high, _SAMPLES)
        f, _ = here.closures(np.exp(log_x))
        net = f[LOSS] - here.slope**2 * f[WORK]
        k = int(np.argmin(net))
        least = float(net[k])
        low, high = log_x[max(k - 1, 0)], log_x[min(k + 1, _SAMPLES - 1)]
    return least
