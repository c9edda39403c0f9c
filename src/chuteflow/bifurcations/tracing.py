"""A boundary from one of its points to both sides, with its turning points in the second parameter located."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from chuteflow.bifurcations.conditions import Fold, InteriorChange, Linearisation, along
from chuteflow.bifurcations.edges import find_exit
from chuteflow.bifurcations.grids import transfer
from chuteflow.bifurcations.points import BoundaryPoint, make_point, refine_grid, solve_boundary_point
from chuteflow.bifurcations.starting_points import HELD
from chuteflow.bifurcations.system import BoundarySystem, SecondParameter
from chuteflow.branches.ranges import SearchRange
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.complex_step import derivative
from chuteflow.numerics.continuation import ContinuationSettings, ContinuationStatus, CurvePoint, locate, trace
from chuteflow.numerics.following import Event, Side, follow_both_sides, follow_side
from chuteflow.steady.collocation import LOG_M
from chuteflow.steady.elements import DEGREES

#: How boundaries are followed, in the inner product of BoundarySystem.
CONTROL = ContinuationSettings(
    initial_step=0.05, min_step=1e-6, max_step=0.25, max_angle=0.2, tolerance=1e-9, max_points=2000
)
#: A boundary is closed where it passes its start within this part of the step, in about its direction.
_CLOSE, _ALONG = 0.05, 0.9
#: Below this fraction of the quantity in the null vector, the branch itself is singular.
_SINGULAR = 1e-5
#: A point is searched for on a chord if it lies within this many of its lengths beside it, and is the same if
#: ln Q, ln h, ln M and ln T_surface agree to this.
_BESIDE, _SAME = 0.3, 1e-6
#: To tell whether points are the same they are solved to this; where even that fails, what lies within this part of a
#: chord's length beside it is on the line; and so many points of a line tell whether it is a known one.
_ROUGHLY, _ON_CHORD, _SAMPLED = 1e-7, 1e-3, 5
#: The place of a blunt turn may scatter by so much.
_BLUNT = 1e-6
#: Steps by which a boundary is carried over a place where a flow comes to a break of the law, at most so often, and by
#: how much of the step the point may lie beside the tangent.
_LEAP, _LEAPS, _ASTRAY = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4), 12, 0.5
#: A parameter that changes less, per arclength, does not change.
_NO_RATE = 1e-10


#: Kinds of turning points, and what they are.
TURNS = {
    "cusp": "two folds meet: three flows become one",
    "birth": "a closed branch of flows shrinks to a point",
    "crossing": "two branches of flows meet and exchange their ends",
    "turn": "the boundary turns back in the parameter",
}


@dataclass(frozen=True)
class BoundaryTracing:
    """How a boundary is followed: the range of its flows, the ``tolerance`` of its points, the ``control`` of the
    continuation, and ``notice``, which is called at each point."""

    within: SearchRange
    tolerance: float
    control: ContinuationSettings = CONTROL
    notice: Callable[[], object] = lambda: None


@dataclass(frozen=True, eq=False)
class TracedBoundary:
    """A boundary as far as it goes within its range: points in order, turns, and in words why it ends."""

    sweep: SecondParameter
    points: tuple[BoundaryPoint, ...]
    turns: tuple[Event[BoundaryPoint], ...]
    ends: tuple[str, str]

    def holds(self, point: BoundaryPoint) -> bool:
        """Whether a point is of this boundary: on one of its chords lies a point equal to it."""
        places = np.array([self._place(p) for p in self.points])
        chords = np.diff(places, axis=0)
        lengths = np.maximum(np.sqrt((chords**2).sum(axis=1)), 1e-300)
        gap = self._place(point) - places[:-1]
        sigma = (gap * chords).sum(axis=1) / lengths**2
        beside = np.sqrt(((gap - sigma[:, None] * chords) ** 2).sum(axis=1))
        near = (sigma > -_BESIDE) & (sigma < 1.0 + _BESIDE) & (beside < _BESIDE * lengths)
        close = (sigma >= -_ON_CHORD) & (sigma <= 1.0 + _ON_CHORD) & (beside < _ON_CHORD * lengths)
        return any(self._meets(int(i), float(sigma[i]), point, bool(close[i])) for i in np.flatnonzero(near))

    def repeats(self, other: TracedBoundary) -> bool:
        """Whether this is a part of another boundary, or the whole of it."""
        some = np.linspace(0, len(self.points) - 1, _SAMPLED + 2)[1:-1].round().astype(int)
        return sum(other.holds(self.points[i]) for i in some.tolist()) > _SAMPLED // 2

    def at(self, value: float, tolerance: float) -> list[BoundaryPoint]:
        """The points at which the parameter has a ``value``, in order.

        Raises:
            SolveError: where one was not solved.
        """
        stops = sorted(
            [*((float(i), p) for i, p in enumerate(self.points)), *((t.position + 0.5, t.point) for t in self.turns)],
            key=lambda stop: stop[0],
        )
        off = np.array([point.value for _, point in stops]) - value
        out = []
        for i in np.flatnonzero((off[1:] >= 0.0) != (off[:-1] >= 0.0)).tolist():
            one, other = stops[i][1], stops[i + 1][1]
            fraction = off[i] / (off[i] - off[i + 1])
            w = one.w + fraction * (_transfer(other.w, other.system, one.system) - one.w)
            out.append(solve_boundary_point(one.system, w, HELD, value, tolerance))
        return out

    def _meets(self, i: int, sigma: float, point: BoundaryPoint, close: bool) -> bool:
        """Whether the point is on chord i, at ``sigma``; ``close`` says so where no point there can be solved."""
        one, other = self.points[i], self.points[i + 1]
        system, w = one.system, one.w + sigma * (_transfer(other.w, other.system, one.system) - one.w)
        row = np.array([1.0, 1.0, self.sweep.weight]) * (other.w[-3:] - one.w[-3:])
        try:
            there = solve_boundary_point(system, w, row, float(row @ point.w[-3:]), _ROUGHLY)
        except SolveError:
            return close
        gap = there.flow.solution.macroscopic - point.flow.solution.macroscopic
        return bool(np.abs(gap).max() < _SAME + there.error + point.error)

    def _place(self, point: BoundaryPoint) -> Array:
        return np.append(point.flow.solution.macroscopic[LOG_M:], np.sqrt(self.sweep.weight) * point.value)


def trace_boundary(start: BoundaryPoint, settings: BoundaryTracing) -> TracedBoundary:
    """The boundary through ``start`` to both sides.

    Raises:
        SolveError: where the start could not be carried on.
    """
    tangent = start.system.tangent(start.w)
    found = follow_both_sides(lambda sign: _side(start, sign * tangent, settings))
    return TracedBoundary(start.system.sweep, found.points, found.events, found.ends)


def _side(start: BoundaryPoint, tangent: Array, settings: BoundaryTracing) -> Side[BoundaryPoint]:
    side = Side(start)
    kinked = start.system.problem(start.value).model.kinks.size > 0
    for leaps in range(_LEAPS):
        lost = _follow(side, start, tangent, settings, closes=leaps == 0)
        # Just where the flow comes to a break of the law, or leaves it, neither grid serves.
        leapt = _leap(side, settings) if lost and kinked else None
        if leapt is None:
            break
        start, tangent = leapt
        side.add(start)
    return side


def _follow(
    side: Side[BoundaryPoint], start: BoundaryPoint, tangent: Array, settings: BoundaryTracing, *, closes: bool
) -> bool:
    """Follow a side from ``start`` on; whether it was lost before it came to an end. It ``closes`` where it comes to
    the start again."""
    system = start.system
    side.stop("")
    path = trace(system, start.w, direction=system.weights * tangent, control=settings.control)
    first: list[CurvePoint[BoundarySystem]] = []
    lost: list[bool] = []

    def extend(
        side: Side[BoundaryPoint], before: CurvePoint[BoundarySystem] | None, point: CurvePoint[BoundarySystem]
    ) -> None:
        if before is None:
            first.append(point)
            return
        settings.notice()
        if point.step == 0.0:
            return  # the same point on another grid, or with other borders
        try:
            _extend(side, first[0] if closes else None, before, point, settings)
        except SolveError:
            # Where neighbours on the boundary are as good as equal, rounding hides where it goes.
            side.stop("it is lost in rounding a little further on")
            lost.append(True)

    follow_side(path, side, extend)
    if path.status is ContinuationStatus.SHARP_TURN and isinstance(system.condition, InteriorChange):
        side.stop("the change goes over to another place in the flow, at a corner")
        return False
    return bool(lost) or path.status.failed


def _leap(side: Side[BoundaryPoint], settings: BoundaryTracing) -> tuple[BoundaryPoint, Array] | None:
    """A point a little further on than a side leads, and the tangent there, if there is one in about its direction."""
    if len(side.points) < 2:
        return None
    before, last = side.points[-2:]
    system = last.system
    root = np.sqrt(system.weights[-3:])
    tangent = system.tangent(last.w)
    tangent *= np.sign((root**2 * tangent[-3:]) @ (last.w - _transfer(before.w, before.system, system))[-3:])
    tangent /= float(np.linalg.norm(root * tangent[-3:]))
    for step in _LEAP:
        w = last.w + step * tangent
        row = root**2 * tangent[-3:]
        try:
            found = solve_boundary_point(system, w, row, float(row @ w[-3:]), settings.tolerance)
        except SolveError:
            continue
        astray = float(np.linalg.norm(root * (found.w[-3:] - w[-3:])))
        if astray < _ASTRAY * step and settings.within.contains(found.flow.solution.macroscopic):
            onward = found.system.tangent(found.w)
            return found, onward * np.sign((root**2 * onward[-3:]) @ tangent[-3:])
    return None


def _extend(
    side: Side[BoundaryPoint],
    first: CurvePoint[BoundarySystem] | None,
    before: CurvePoint[BoundarySystem],
    point: CurvePoint[BoundarySystem],
    settings: BoundaryTracing,
) -> None:
    """Add what a step leads to, and stop the side where it leaves the range or closes.

    Raises:
        SolveError: where a point or turning point could not be solved to the tolerance.
    """
    tolerance = settings.tolerance
    edge = find_exit(before, point, settings.within, tolerance)
    if edge is not None:
        reached, end = edge
        if reached is not None:
            _add_turn(side, before, point, tolerance, reached)
            side.add(reached)
        side.stop(end)
        return
    _add_turn(side, before, point, tolerance)
    if first is not None and len(side.points) > 3 and _has_returned(first, before, point):
        side.stop("the boundary closes on itself", closed=True)
        return
    row = (point.system.weights * point.tangent)[-3:]
    found = solve_boundary_point(point.system, point.z, row, float(row @ point.z[-3:]), tolerance)
    if point.system.pins and _turns_back(side, found):
        raise SolveError("a boundary turns back where its flows come to a break of the law")
    side.add(found)


def _turns_back(side: Side[BoundaryPoint], point: BoundaryPoint) -> bool:
    """Whether the way to a point leads back against that to the last one."""
    if len(side.points) < 2:
        return False
    root = np.sqrt(point.system.weights[-3:])
    a, b, c = (root * p.w[-3:] for p in (*side.points[-2:], point))
    return float((b - a) @ (c - b)) < 0.0


def _add_turn(
    side: Side[BoundaryPoint],
    before: CurvePoint[BoundarySystem],
    point: CurvePoint[BoundarySystem],
    tolerance: float,
    last: BoundaryPoint | None = None,
) -> None:
    """Add the turn between two points, if there is one, unless it lies beyond the ``last`` point in the range."""
    rates = before.tangent[-1], point.tangent[-1]
    # Where the boundary is one value of the parameter, its rate is rounding.
    if rates[0] * rates[1] >= 0.0 or min(map(abs, rates)) < _NO_RATE:
        return
    turn = _turn(before, point, tolerance)
    if last is not None:
        row = before.system.weights[-3:] * (point.z - before.z)[-3:]
        if row @ turn.w[-3:] > row @ last.w[-3:]:
            return
    side.add(turn, _kind(turn))


def _turn(a: CurvePoint[BoundarySystem], b: CurvePoint[BoundarySystem], tolerance: float) -> BoundaryPoint:
    """The turning point between two points, on finer grids until it stays where it is."""
    before, settled = np.full(3, np.inf), np.inf
    for degree in DEGREES[DEGREES.index(a.system.degree) :]:
        if degree > a.system.degree:
            system, w = refine_grid(a.system, a.z, degree)
            a, b = _correct(system, w, a), _correct(system, refine_grid(b.system, b.z, degree)[1], b)
        if a.tangent[-1] * b.tangent[-1] >= 0.0:
            raise SolveError("a turning point of a boundary is not there on a finer grid")
        located = locate(a, b, a.system, lambda z, tangent, system: float(tangent[-1]))
        if located.status.failed:
            raise SolveError(f"a turning point of a boundary was not located: {located.status.value}")
        place = located.point.z[-3:] / np.array([1.0, 1.0, max(a.system.sweep.high, 1e-300)])
        change = float(np.abs(place - before).max())
        # Where the turn is blunt, rounding moves its place, and finer grids do no better.
        scattered = settled < _BLUNT and change > 0.5 * settled
        error = max(change, located.error, settled if scattered else 0.0)
        if scattered or change < max(tolerance, located.error):
            return make_point(a.system, located.point.z, error)
        before, settled = place, change
    raise SolveError("the finest grid did not resolve a turning point: ask for a larger tolerance")


def _correct(system: BoundarySystem, w: Array, near: CurvePoint[BoundarySystem]) -> CurvePoint[BoundarySystem]:
    """A point of another grid that lies where ``near`` does."""
    direction = np.zeros_like(w)
    direction[-3:] = (near.system.weights * near.tangent)[-3:]
    point = next(trace(system, w, direction=direction), None)
    if point is None:
        raise SolveError("a point of a boundary could not be carried over to a finer grid")
    return point


def _kind(point: BoundaryPoint) -> str:
    """What a turning point is."""
    system = point.system
    at = system.local(point.w)
    if not isinstance(system.condition, Fold):
        return "turn"
    if system.condition.pivot(at) > _SINGULAR:
        return "cusp"
    return "birth" if _definite(at) else "crossing"


def _definite(at: Linearisation) -> bool:
    """Whether the parameter has an extremum on the surface of flows over (z, lambda), where F_z loses rank.

    Its Hessian on the null space of F_z is that of -psi' F, with psi the left null vector.
    """
    u, _, v = np.linalg.svd(at.by_z)
    plane, psi = v[-2:], u[:, -1]
    bends = [derivative(along(at, n).jacobian()) for n in plane]
    hessian = np.array([[psi @ bend @ n for n in plane] for bend in bends])
    return bool(np.linalg.det(hessian) > 0.0)


def _has_returned(
    first: CurvePoint[BoundarySystem], before: CurvePoint[BoundarySystem], last: CurvePoint[BoundarySystem]
) -> bool:
    """Whether the last step passed the first point, in its direction, as far as the last three unknowns show."""
    root = np.sqrt(last.system.weights[-3:])
    a, b, c = (root * p.z[-3:] for p in (first, before, last))
    step = c - b
    fraction = float((a - b) @ step) / float(step @ step)
    beside = float(np.linalg.norm(b + fraction * step - a)) / float(np.linalg.norm(step))
    headings = [root * p.tangent[-3:] for p in (first, last)]
    cosine = float(headings[0] @ headings[1]) / float(np.prod([np.linalg.norm(h) for h in headings]))
    return 0.0 <= fraction < 1.0 and beside < _CLOSE and cosine > _ALONG


def _transfer(w: Array, system: BoundarySystem, other: BoundarySystem) -> Array:
    """Unknowns on the grid of another system."""
    value = float(w[-1])
    if (system.degree, system.stretch, system.breaks, system.pins) == (
        other.degree, other.stretch, other.breaks, other.pins,
    ):  # fmt: skip
        return w
    return np.append(transfer(system.problem(value), w[:-1], other.problem(value)), value)
