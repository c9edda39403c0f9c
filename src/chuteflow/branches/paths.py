"""Branches of flows, solved: points with exact tangents, as close as it takes to know the branch between them.

# notation: m the macroscopic quantities (ln Q, ln h, ln M, ln T_surface) of a flow, sigma runs from 0 to 1 along the
# chord between two of them, L is its length.

A branch is a curve in the space of the four macroscopic quantities. Deep flows may share M and T_surface to all digits;
they differ in Q and h. A flow is fixed by a plane normal to a chord, which has one near a fold too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.elements import Elements
from chuteflow.steady.flow import Flow
from chuteflow.steady.solver import TOLERANCE, Condition, Solution, between, solve

#: Neighbouring points suffice where their tangents differ by less than this angle, and their mean from the chord by
#: less than the second: two neighbouring branches that are taken for one show there.
_ANGLE, _ASIDE = 0.35, 0.03
#: The branch comes back beside itself between two points whose tangents differ by more.
_OPPOSED = 1.6
#: Points are not brought closer than this, nor more put between two; where they do not suffice then, the branch is
#: lost.
_CLOSEST, _MOST_BETWEEN = 1e-9, 200
#: Steps of a continuation from one point to another: the first, and the longest, as far as the branch bends; how many
#: at most; and how much longer the way may be than the chord, and in all.
_FIRST_STEP, _LONGEST, _MOST_STEPS, _DETOUR, _WAY = 2e-3, 0.1, 120, 4.0, 0.5
#: A slope along the branch is known between two points to this fraction of what it changes, before points between them
#: have shown better, which is trusted down to the second; below the third a change of sign is a single one.
_UNKNOWN, _SUREST, _KNOWN = 0.5, 1e-3, 0.1
#: A slope that is smaller, per length, cannot be distinguished from 0; turning points closer than the second are not
#: distinguished.
_FLAT, _SHORTEST = 1e-7, 1e-4
#: Where a quantity takes a value is known when sigma is to this, or the quantity to the second.
_CLOSE, _ROUNDING = 1e-12, 4e-15


@dataclass(frozen=True, eq=False)
class PathPoint:
    """A solved flow, and the unit ``tangent`` (4,) of its branch."""

    solution: Solution
    tangent: Array

    @property
    def m(self) -> Array:
        """ln Q, ln h, ln M, ln T_surface."""
        return self.solution.macroscopic

    def reversed(self) -> PathPoint:
        """The same with the tangent the other way."""
        return PathPoint(self.solution, -self.tangent)


def solve_point(start: Elements, weights: Array, value: float, tolerance: float) -> PathPoint | None:
    """The point near ``start`` whose quantities, times ``weights`` (4,), sum to ``value``; its tangent goes along them.

    None where Newton's method finds none.
    """
    solution = solve(start, Condition(tuple(weights.tolist()), value), tolerance)
    if not solution.converged or solution.rates is None:
        return None
    length = float(np.linalg.norm(solution.rates))
    return PathPoint(solution, solution.rates / length) if np.isfinite(length) else None


def _point_between(first: Solution, last: Solution, sigma: float, tolerance: float) -> PathPoint | None:
    chord = last.macroscopic - first.macroscopic
    direction = chord / np.linalg.norm(chord)
    value = float(direction @ (first.macroscopic + sigma * chord))
    return solve_point(between(first, last, sigma), direction, value, tolerance)


def solve_between(first: Solution, last: Solution, fraction: float, tolerance: float = TOLERANCE) -> Solution:
    """The flow at a ``fraction`` of the chord between two neighbours of a branch, or a little beyond, in the plane
    normal to it.

    Raises:
        SolveError: where it is not found.
    """
    point = _point_between(first, last, fraction, tolerance)
    if point is None:
        raise SolveError("a flow between two others of a branch could not be solved: ask for a larger tolerance")
    return point.solution


def flow_between(flows: Sequence[Flow], position: float) -> Flow:
    """The flow at a position between two neighbours of a branch, or a little beyond its ends, counted in ``flows``."""
    i = int(np.clip(np.floor(position), 0, len(flows) - 2))
    first, last = flows[i], flows[i + 1]
    share = position - i
    if share in (0.0, 1.0):
        return last if share else first
    return Flow(first.chute, solve_between(first.solution, last.solution, share))


@dataclass(frozen=True, eq=False)
class Chord:
    """The branch between two of its points."""

    first: PathPoint
    last: PathPoint
    tolerance: float = TOLERANCE

    @cached_property
    def _chord(self) -> Array:
        return self.last.m - self.first.m

    @cached_property
    def length(self) -> float:
        """L."""
        return float(np.linalg.norm(self._chord))

    @cached_property
    def direction(self) -> Array:
        """Of the chord, (4,)."""
        return self._chord / self.length

    def place(self, m: Array) -> float:
        """sigma of a flow."""
        return float(self.direction @ (m - self.first.m)) / self.length

    @property
    def suffices(self) -> bool:
        """Whether the branch between the points is known by them."""
        one, two = self.first.tangent, self.last.tangent
        if self.length == 0.0:
            return True
        mean = 0.5 * (one + two)
        aside = float(np.linalg.norm(mean - (mean @ self.direction) * self.direction))
        return bool(one @ two > np.cos(_ANGLE) and mean @ self.direction > np.cos(_ANGLE) and aside < _ASIDE)

    def at(self, sigma: float) -> PathPoint | None:
        """The point in the plane at ``sigma`` normal to the chord; None where none is found."""
        return _point_between(self.first.solution, self.last.solution, sigma, self.tolerance)

    def slope(self, point: PathPoint) -> Array:
        """Derivatives (4,) of the quantities with respect to sigma at a point, to about 1e-6."""
        return point.tangent * (self.length / float(point.tangent @ self.direction))

    def sharp_slope(self, point: PathPoint) -> Array:
        """The same to rounding: at the flow itself, not at the last but one step of Newton's method."""
        found = point.solution.elements.direction(self.direction)
        return self.slope(point) if found is None else found * self.length


def refine_path(points: Sequence[PathPoint], tolerance: float = TOLERANCE) -> list[PathPoint]:
    """The points with as many between them as it takes for each chord to suffice.

    Where two points do not join by points between them, the branch is followed from the first. The tangent of a point
    may come out reversed: near a fold a plane meets the branch on both sides of it.

    Raises:
        SolveError: where the branch could not be followed from one to the next.
    """
    out = [points[0]]
    for last in points[1:]:
        try:
            out += _divided(out[-1], last, tolerance)
        except SolveError:
            out += _followed(out[-1], last, tolerance)
    return out


def _divided(first: PathPoint, last: PathPoint, tolerance: float) -> list[PathPoint]:
    """The points after ``first`` to ``last``, by halving chords that do not suffice."""
    out, waiting = [first], [last]
    for _ in range(_MOST_BETWEEN):
        if not waiting:
            return out[1:]
        chord = Chord(out[-1], waiting[-1], tolerance)
        if chord.suffices:
            out.append(waiting.pop())
            continue
        if chord.length < _CLOSEST:
            break
        waiting.append(_halfway(chord))
    raise SolveError("a branch of flows could not be followed: its points do not join")


def _followed(first: PathPoint, last: PathPoint, tolerance: float) -> list[PathPoint]:
    """The points after ``first`` to ``last``, by continuation along the branch; the tangent of ``last`` is reversed
    where the branch passes it the other way."""
    out = [first]
    step, way = _FIRST_STEP, 0.0
    longest = _DETOUR * float(np.linalg.norm(last.m - first.m)) + _WAY
    for _ in range(_MOST_STEPS):
        here = out[-1]
        for end in (last, last.reversed()):
            if Chord(here, end, tolerance).suffices:
                return [*out[1:], end]
        # On new elements: those of a solution are finer than those that Newton's method started from.
        start = between(here.solution, here.solution, 0.0)
        point = solve_point(start, here.tangent, float(here.tangent @ here.m) + step, tolerance)
        if point is None or not Chord(here, point, tolerance).suffices:
            step *= 0.5
            if step < _CLOSEST:
                break
            continue
        out.append(point)
        way += float(np.linalg.norm(point.m - here.m))
        if way > longest:
            break
        step = min(1.5 * step, _LONGEST)
    raise SolveError("a branch of flows could not be followed: its points do not join")


def _halfway(chord: Chord) -> PathPoint:
    """A point between the ends of a chord."""
    there = chord.first.tangent - chord.last.tangent
    if float(np.linalg.norm(there)) > _OPPOSED:
        # The branch goes somewhere and comes back beside itself: a plane between the two sides meets it at the turn.
        aside = chord.direction - there * (float(chord.direction @ there) / float(there @ there))
        width = float(np.linalg.norm(aside))
        if width > 0.0:
            aside /= width
            start = between(chord.first.solution, chord.last.solution, 0.5)
            value = 0.5 * float(aside @ (chord.first.m + chord.last.m))
            point = solve_point(start, aside, value, chord.tolerance)
            if point is not None:
                return point
    for sigma in (0.5, 0.25, 0.75):
        point = chord.at(sigma)
        if point is not None and 0.0 < chord.place(point.m) < 1.0:
            return point
    raise SolveError("a branch of flows could not be followed: Newton's method did not converge between two flows")


@dataclass(frozen=True, eq=False)
class TurningPoint:
    """A point at which the quantity ``which`` turns; ``place`` counts along the path: 2.5 is between points 2 and 3."""

    which: int
    place: float
    point: PathPoint


def locate_turning_points(points: Sequence[PathPoint], which: int, tolerance: float = TOLERANCE) -> list[TurningPoint]:
    """The points at which a quantity turns along successive ``points`` that suffice, in order.

    Its slope is known exactly at the points. Between two it is a quadratic of them and of the quantity's change, and
    what that may be wrong by shows where a point is put between. A stretch is halved until the slope has one sign, or a
    change of sign at its ends and none of its own derivative. Slopes too small to be distinguished from zero turn
    nothing.
    """
    found = []
    for i in range(len(points) - 1):
        chord = Chord(points[i], points[i + 1], tolerance)
        found += [TurningPoint(which, i + place, point) for place, point in _turns(chord, which, _UNKNOWN)]
        if i > 0:
            before, here, after = (float(point.tangent[which]) for point in points[i - 1 : i + 2])
            if abs(here) <= _FLAT < min(abs(before), abs(after)) and before * after < 0.0:
                found.append(TurningPoint(which, float(i), points[i]))
    return sorted(found, key=lambda turn: turn.place)


def _turns(chord: Chord, which: int, unknown: float) -> Iterator[tuple[float, PathPoint]]:
    if chord.length < _CLOSEST:
        return
    flat = _FLAT * chord.length
    begin, end = (float(chord.slope(point)[which]) for point in (chord.first, chord.last))
    small = min(abs(begin), abs(end)) <= flat
    if max(abs(begin), abs(end)) <= flat or (small and chord.length < _SHORTEST):
        return
    gain = float(chord.last.m[which] - chord.first.m[which])
    # The quadratic with these values at the ends and this mean: begin + a sigma + b sigma^2.
    b = 3.0 * (begin + end) - 6.0 * gain
    a = end - begin - b
    turning = -0.5 * a / b if b else 2.0
    extreme = begin + turning * (0.5 * a) if 0.0 < turning < 1.0 else begin
    if not small and (begin > 0.0) == (end > 0.0):
        uncertain = unknown * (abs(a) + abs(b)) + flat
        if (extreme > 0.0) == (begin > 0.0) and min(abs(begin), abs(end), abs(extreme)) > uncertain:
            return
        if chord.length < _SHORTEST:
            return
    elif not small and (chord.length < _SHORTEST or (unknown < _KNOWN and not 0.0 < turning < 1.0)):
        yield _locate(chord, lambda point: (float(chord.sharp_slope(point)[which]), None), (begin, end))
        return
    middle = _halfway(chord)
    at = chord.place(middle.m)
    missed = abs(float(chord.slope(middle)[which]) - (begin + at * (a + b * at)))
    unknown = min(unknown, max(missed / (abs(a) + abs(b) + flat), _SUREST))
    for place, point in _turns(Chord(chord.first, middle, chord.tolerance), which, unknown):
        yield at * place, point
    for place, point in _turns(Chord(middle, chord.last, chord.tolerance), which, unknown):
        yield at + (1.0 - at) * place, point


def find_value(chord: Chord, which: int, target: float, close: float) -> tuple[float, PathPoint]:
    """Where the quantity ``which``, monotonic along the chord, takes the value ``target`` between its ends, to
    ``close`` of the larger distance of these from it."""

    def off(point: PathPoint) -> tuple[float, float | None]:
        return float(point.m[which]) - target, float(chord.slope(point)[which])

    return _locate(chord, off, (off(chord.first)[0], off(chord.last)[0]), close)


def find_zero(
    chord: Chord, function: Callable[[Solution], float], ends: tuple[float, float]
) -> tuple[float, PathPoint]:
    """Where ``function`` of the flow vanishes along the chord, given its values of opposite sign at the ends."""
    return _locate(chord, lambda point: (function(point.solution), None), ends)


def _locate(
    chord: Chord,
    function: Callable[[PathPoint], tuple[float, float | None]],
    ends: tuple[float, float],
    close: float = _CLOSE,
) -> tuple[float, PathPoint]:
    """The zero of a function (its value, and its derivative to sigma where it has one) along a chord.

    Newton's method where it stays in the bracket, else regula falsi with the Illinois rule.
    """
    (low, f_low), (high, f_high) = (0.0, ends[0]), (1.0, ends[1])
    if f_low == 0.0:
        return 0.0, chord.first
    if f_high == 0.0:
        return 1.0, chord.last
    scale = max(abs(f_low), abs(f_high))
    sigma, point = f_low / (f_low - f_high), chord.first
    side = 0
    for _ in range(80):
        reached = chord.at(sigma)
        if reached is None:
            raise SolveError("a branch of flows could not be followed to a point on it")
        point = reached
        f, slope = function(point)
        if abs(f) <= max(_ROUNDING, close * scale) or high - low < _CLOSE:
            return sigma, point
        if (f > 0.0) == (f_high > 0.0):
            high, f_high, f_low = sigma, f, 0.5 * f_low if side == 1 else f_low
            side = 1
        else:
            low, f_low, f_high = sigma, f, 0.5 * f_high if side == -1 else f_high
            side = -1
        newton = sigma - f / slope if slope else low
        sigma = newton if low < newton < high else (low * f_high - high * f_low) / (f_high - f_low)
    return sigma, point
