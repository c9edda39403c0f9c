"""Families of flows as continuation problems, for the general continuation of chuteflow.numerics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from chuteflow.analysis.chords import Chord
from chuteflow.analysis.crossings import Knot
from chuteflow.analysis.ranges import CLOSED, Range
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array, tail
from chuteflow.numerics.continuation import Control, Point, trace
from chuteflow.steady.collocation import LOG_M, LOG_T, Collocation, State
from chuteflow.steady.solver import DEGREES, Condition, Solution, Status, default_stretch, solve, solve_many

#: Decay of the coefficients between which a grid is kept while tracing.
_RESOLVED, _WASTED = 1e-7, 1e-13
#: Decay on the finest grid beyond which a family is followed no further, and what is said then.
_LOST, LOST = 1e-3, "the finest grid does not resolve it further"
#: The stretch is renewed when it is off by more.
_STRETCH_OFF = 0.3
#: Relative error allowed in the flows at the edges of a range while tracing.
_EDGE_TOLERANCE = 1e-8
#: A family whose end is so near to the edge, in the logarithm, ends there.
_ON_EDGE = 1e-6
#: Weight of the gradient in the inner product.
_OF_GRADIENT = 0.02
#: Flows are one and the same when all their logarithms agree to this.
_SAME = 1e-7
#: Rough flows are solved side by side where the family has gone so far since the last one, or has turned by so much;
#: nearer ones than the last number tell no direction.
_APART, _TURNED, _TOO_NEAR = 0.45, 0.25, 0.08
#: What is solved is no family to rely on where its chords turn by more, are longer, or lie further from the rough.
_SHARPEST, _LONGEST, _ASTRAY = 0.6, 1.5, 0.1
#: A flow is looked for on a chord if it lies within this many of its lengths beside it.
_BESIDE = 0.25

#: How families are followed: arclength is measured in the plane (theta_surface, ln M).
CONTROL = Control(initial_step=0.05, min_step=1e-7, max_step=0.5, max_angle=0.3, tolerance=1e-8, max_points=2000)


@dataclass(frozen=True, eq=False)
class FamilySystem:
    """The steady problem without a condition: one unknown more than equations.

    The inner product is that of the plane (theta at the surface, ln M), with a little of the integral of g^2
    over the overburden: enough to tell families that differ near the base alone. Neither resolution nor
    stretch changes the path.
    """

    problem: Collocation
    _last: list[Any] = field(default_factory=list, repr=False)

    @property
    def weights(self) -> Array:
        """Of g, by quadrature, and 1 for theta at the surface and for ln M."""
        by_quadrature = self.problem.grid.weights * self.problem.share[1]
        return np.concatenate([_OF_GRADIENT * by_quadrature, [1.0, 1.0]])

    def state(self, z: Array) -> State:
        """Everything pointwise at a point; the last one is kept, since each is looked at twice."""
        if not (self._last and self._last[0] is z):
            self._last[:] = z, self.problem.state(z)
        return self._last[1]

    def residual_and_jacobian(self, z: Array) -> tuple[Array, Array]:
        """See chuteflow.numerics.continuation.System."""
        state = self.problem.state(z)
        return state.residual(), state.jacobian()

    def adapted(self, z: Array, tangent: Array) -> tuple[FamilySystem, Array, Array] | None:
        """A finer or coarser grid, or another stretch, where the solution asks for it."""
        problem, state = self.problem, self.state(z)
        decay = tail(problem.grid, state.y + 1e-30)
        place = DEGREES.index(problem.degree)
        if decay > _RESOLVED and place + 1 < len(DEGREES):
            place += 1
        elif decay < _WASTED and place > 0:
            place -= 1
        temperature = float(np.exp(state.log_t[0]))
        stretch = default_stretch(problem.model, float(state.mass[0]), temperature)
        if abs(stretch - problem.stretch) < _STRETCH_OFF:
            if DEGREES[place] == problem.degree:
                return None
            stretch = problem.stretch
        other, matrix = problem.transferred(DEGREES[place], stretch)
        carried = [np.concatenate([matrix @ v[:-2], v[-2:]]) for v in (z, tangent)]
        return FamilySystem(other), carried[0], carried[1]


@dataclass(frozen=True, eq=False)
class Stretch:
    """Solved flows in order along a family, the arclengths ``places`` (k,) at which they are, and why the stretch ends
    at either side, in words."""

    solutions: list[Solution]
    places: Array
    ends: tuple[str, str]

    def reversed(self) -> Stretch:
        """The same from the other end."""
        return Stretch(self.solutions[::-1], self.places[::-1], (self.ends[1], self.ends[0]))


@dataclass(frozen=True, eq=False)
class TracedFamily:
    """A family as far as it goes within a range: solved flows in order, the last ones at the edges.

    ``ends`` says in words why it ends at either side; a loop ends with its first flow.
    """

    solutions: tuple[Solution, ...]
    ends: tuple[str, str]

    @cached_property
    def macroscopic(self) -> Array:
        """ln Q, ln h, ln M, ln T_surface of the flows, (k, 4)."""
        return np.array([s.macroscopic for s in self.solutions])

    @cached_property
    def arclength(self) -> Array:
        """In the plane (ln M, ln T_surface) from the first flow, by chords, (k,)."""
        chords = np.hypot(*np.diff(self.macroscopic[:, LOG_M:], axis=0).T)
        return np.concatenate([[0.0], np.cumsum(chords)])

    @property
    def lost(self) -> float:
        """ln M from which on the finest grid does not resolve it; infinite where it is followed to its ends."""
        there = [self.macroscopic[i, LOG_M] for i, words in zip((0, -1), self.ends, strict=True) if words == LOST]
        return float(min(there, default=np.inf))

    def passes(self, knots: Sequence[Knot]) -> bool:
        """Whether the family passes near all of these rough flows, in the plane (ln M, ln T_surface)."""
        plane, rough = _plane(self.solutions), _plane(knots)
        chords = np.diff(plane, axis=0)
        gap = rough[:, None] - plane[:-1]
        sigma = np.clip((gap * chords).sum(axis=-1) / np.maximum((chords**2).sum(axis=1), 1e-300), 0.0, 1.0)
        beside = np.linalg.norm(gap - sigma[..., None] * chords, axis=-1).min(axis=1)
        return bool(beside.max() < _ASTRAY)

    def holds(self, solution: Solution) -> bool:
        """Whether a solved flow is of this family: on one of its chords lies a flow equal to it."""
        plane = self.macroscopic[:, LOG_M:]
        chords = np.diff(plane, axis=0)
        lengths = np.hypot(*chords.T)
        gap = solution.macroscopic[LOG_M:] - plane[:-1]
        sigma = (gap * chords).sum(axis=1) / np.maximum(lengths**2, 1e-300)
        beside = np.hypot(*(gap - sigma[:, None] * chords).T)
        near = (sigma > -_BESIDE) & (sigma < 1.0 + _BESIDE) & (beside < _BESIDE * lengths)
        for i in np.flatnonzero(near).tolist():
            chord = Chord(self.solutions[i], self.solutions[i + 1])
            there = solve(*chord.start_at(float(sigma[i])), chord.condition_at(float(sigma[i])))
            apart = np.abs(there.macroscopic - solution.macroscopic).max()
            # What the finest grid leaves of the error is known, and two traces of one deep family differ by it.
            if there.status is not Status.NO_CONVERGENCE and apart < max(_SAME, there.error + solution.error):
                return True
        return False

    def sampled(self, count: int, tolerance: float) -> list[Stretch]:
        """``count`` flows from end to end, evenly in arclength, each solved to ``tolerance``.

        They come as one stretch, or as several of two flows or more, where flows between them, or at the ends, could
        not be solved: then the ends say why.

        Raises:
            SolveError: where there is no such stretch.
        """
        places = np.linspace(0.0, self.arclength[-1], count)
        index = np.clip(np.searchsorted(self.arclength, places, side="right") - 1, 0, len(self.solutions) - 2)
        lengths = np.diff(self.arclength)
        chords = [Chord(*pair, tolerance) for pair in pairwise(self.solutions)]
        sigmas = (places - self.arclength[index]) / lengths[index]
        starts = [chords[i].start_at(float(sigma)) for i, sigma in zip(index, sigmas, strict=True)]
        planes = [chords[i].condition_at(float(sigma)) for i, sigma in zip(index, sigmas, strict=True)]
        solutions = solve_many(starts, planes, tolerance)
        good = [solution.converged for solution in solutions]
        edges = np.flatnonzero(np.diff([False, *good, False])).tolist()
        stretches = [
            Stretch(
                solutions[first:last],
                places[first:last],
                (
                    solutions[first - 1].status.value if first else self.ends[0],
                    solutions[last].status.value if last < count else self.ends[1],
                ),
            )
            for first, last in zip(edges[::2], edges[1::2], strict=True)
            if last - first > 1
        ]
        if not stretches:
            bad = solutions[good.index(False)]
            raise SolveError(f"a flow of a family could not be solved: {bad.status.value}")
        return stretches

    def path(self, stretch: Stretch) -> tuple[list[Solution], Array]:
        """The flows that the family was followed by, between the ends of a stretch and these, and their arclengths:
        they are the same for any number of flows sampled."""
        first, last = stretch.places[[0, -1]]
        margin = _ON_EDGE * float(self.arclength[-1])
        inside = np.flatnonzero((self.arclength > first + margin) & (self.arclength < last - margin))
        solutions = [stretch.solutions[0], *(self.solutions[i] for i in inside), stretch.solutions[-1]]
        return solutions, np.array([first, *self.arclength[inside], last])


def traced(start: Solution, ahead: Array, within: Range, control: Control = CONTROL) -> TracedFamily:
    """The family through ``start`` to both sides; there it goes along ``ahead`` (d ln M, d ln T_surface)."""
    onward, end, closed = _side(start, ahead, within, control)
    if closed:
        return TracedFamily((*onward, onward[0]), (end, end))
    back, begin, _ = _side(start, -ahead, within, control)
    return TracedFamily((*back[:0:-1], *onward), (begin, end))


def solved_together(knots: Sequence[Knot], within: Range) -> TracedFamily | None:
    """The family of the rough flows ``knots`` from edge to edge of the range, solved side by side in a fraction of the
    time that it takes to follow it; None where it ends elsewhere, or turns too sharply to be sure of it."""
    here = np.flatnonzero([within.contains(knot.macroscopic) for knot in knots])
    if len(here) < 3 or len(here) <= here[-1] - here[0]:
        return None
    inside = knots[here[0] : here[-1] + 1]
    begin, finish = _edge(knots[0], inside[0], within), _edge(knots[-1], inside[-1], within)
    inside = [inside[i] for i in _thinned(_plane(inside))]
    if begin is None or finish is None or len(inside) < 3:
        return None
    ahead = np.gradient(_plane(inside), axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    kept = _kept(_plane(inside), ahead)
    rough, ahead = [inside[i] for i in kept], ahead[kept]
    conditions = [Condition.plane(along, knot.macroscopic) for along, knot in zip(ahead, rough, strict=True)]
    conditions[0], conditions[-1] = begin[0], finish[0]
    solutions = solve_many([knot.start(DEGREES[0]) for knot in rough], conditions, CONTROL.tolerance)
    if not all(solution.converged for solution in solutions) or _strays(_plane(solutions), _plane(rough), ahead):
        return None
    return TracedFamily(tuple(solutions), (begin[1], finish[1]))


def _plane(flows: Sequence[Knot] | Sequence[Solution]) -> Array:
    """ln M and ln T_surface of flows, (k, 2)."""
    return np.array([flow.macroscopic[LOG_M:] for flow in flows])


def _strays(path: Array, rough: Array, ahead: Array) -> bool:
    """Whether a path of flows (k, 2) is not surely the one of the rough flows, which goes ``ahead``."""
    chords = np.diff(path, axis=0)
    lengths = np.hypot(*chords.T)
    if not 0.0 < lengths.min() <= lengths.max() < _LONGEST:
        return True
    beside = np.hypot(*(path - rough)[1:-1].T)
    along = (chords * ahead[:-1]).sum(axis=1) / lengths
    turns = np.abs(np.diff(np.unwrap(np.arctan2(*chords.T))))
    return bool(
        along.min() < np.cos(_SHARPEST) or beside.max(initial=0.0) > _ASTRAY or turns.max(initial=0.0) > _SHARPEST
    )


def _edge(end: Knot, inside: Knot, within: Range) -> tuple[Condition, str] | None:
    """What holds at the edge of the range that a family ends at, and that edge in words."""
    beyond = end.macroscopic
    if end is inside:
        # Columns of the search begin and end at the edges themselves.
        beyond = beyond.copy()
        beyond[LOG_T] += _ON_EDGE * np.sign(beyond[LOG_T] - 0.5 * np.log(within.coldest * within.hottest))
        if within.contains(beyond):
            return None
    axis, value, words = within.passed(beyond)
    return Condition.fix(axis, float(np.exp(value))), words


def _thinned(plane: Array) -> list[int]:
    """The points of a path, its ends among them, without those too near to the one before."""
    kept = [0]
    for i in range(1, len(plane) - 1):
        if min(np.hypot(*(plane[i] - plane[j])) for j in (kept[-1], -1)) > _TOO_NEAR:
            kept.append(i)
    return [*kept, len(plane) - 1]


def _kept(plane: Array, ahead: Array) -> list[int]:
    """Some of the points of a path, its ends among them: closest where it turns."""
    kept = [0]
    for i in range(1, len(plane) - 1):
        far = np.hypot(*(plane[i] - plane[kept[-1]])) > _APART
        if far or float(ahead[i] @ ahead[kept[-1]]) < np.cos(_TURNED):
            kept.append(i)
    # The last one may lie a little aside of where the family ends.
    if len(kept) > 1 and np.hypot(*(plane[-1] - plane[kept[-1]])) < 0.5 * _APART:
        kept.pop()
    return [*kept, len(plane) - 1]


def _side(start: Solution, ahead: Array, within: Range, control: Control) -> tuple[list[Solution], str, bool]:
    """Flows from ``start`` to the edge of the range, why they end there, and whether they come back."""
    direction = np.zeros_like(start.z)
    direction[-1], direction[-2] = ahead
    path = trace(FamilySystem(start.problem), start.z, direction=direction, control=control)
    points: list[Point[FamilySystem]] = []
    solutions: list[Solution] = []
    for point in path:
        if points and point.step == 0.0:
            points.pop()
            solutions.pop()  # the same flow on another grid
        points.append(point)
        solutions.append(_as_solution(point, control))
        here = solutions[-1].macroscopic
        if not within.contains(here):
            axis, edge, words = within.passed(here)
            if len(solutions) > 1:
                solutions[-1] = _at_edge(solutions[-2], solutions[-1], axis, edge)
            return solutions, words, False
        if len(points) > 3 and _returned(points):
            return solutions[:-1], CLOSED, True
        if _decay(solutions[-1]) > _LOST:
            return solutions, LOST, False
    return solutions, LOST if solutions[-1].problem.degree == DEGREES[-1] else path.status.value, False


def _decay(solution: Solution) -> float:
    """Of the coefficients of a solution on the finest grid; on coarser ones none, since there is a finer one."""
    finest = solution.problem.degree == DEGREES[-1]
    return tail(solution.problem.grid, solution.state.y + 1e-30) if finest else 0.0


def _at_edge(inside: Solution, outside: Solution, axis: int, edge: float) -> Solution:
    """The flow between two whose quantity ``axis`` is ``edge``; the one outside, if that is not resolved."""
    ends = float(inside.macroscopic[axis]) - edge, float(outside.macroscopic[axis]) - edge
    try:
        return Chord(inside, outside, _EDGE_TOLERANCE).zero(lambda s: float(s.macroscopic[axis]) - edge, ends)
    except SolveError:
        return outside


def _as_solution(point: Point[FamilySystem], control: Control) -> Solution:
    macroscopic = point.system.state(point.z).macroscopic()
    return Solution(point.system.problem, point.z, macroscopic, control.tolerance, Status.CONVERGED)


def _returned(points: list[Point[FamilySystem]]) -> bool:
    """Whether the last step passed the first point, in the plane of the inner product, in its direction."""
    (first, before, last) = (np.append(p.z[-2:], p.tangent[-2:]) for p in (points[0], points[-2], points[-1]))
    step = last[:2] - before[:2]
    share = float((first[:2] - before[:2]) @ step) / float(step @ step)
    beside = float(np.hypot(*(before[:2] + share * step - first[:2])))
    return 0.0 <= share < 1.0 and beside < 0.05 * float(np.hypot(*step)) and float(first[2:] @ last[2:]) > 0.9
