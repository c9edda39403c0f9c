"""Columns of a map: the classes along one axis, constant between stops that are located to a tolerance.

Columns are put where the stops between two others do not lie on a line, to the tolerance, and where the row of
classes changes: at tips and crossings of boundaries.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from chuteflow.maps.plane import Code

#: The class at fractions of the outer and of the inner axis.
Classify = Callable[[float, float], Code]


@dataclass(frozen=True)
class PiecewiseConstant:
    """One number of the class along a column: ``values`` has one entry more than ``stops``, the fractions of the
    inner axis, ascending, between them."""

    stops: tuple[float, ...]
    values: tuple[int, ...]

    def at(self, fraction: float) -> int:
        """The number at a fraction of the inner axis."""
        return self.values[bisect_right(self.stops, fraction)]

    def without_bands(self, width: float) -> PiecewiseConstant:
        """The part with no band narrower than ``width`` between two stops: these meet half-way."""
        stops, values = list(self.stops), list(self.values)
        while len(stops) > 1:
            narrow = min(range(len(stops) - 1), key=lambda i: stops[i + 1] - stops[i])
            if stops[narrow + 1] - stops[narrow] >= width:
                break
            stops[narrow : narrow + 2] = [0.5 * (stops[narrow] + stops[narrow + 1])]
            del values[narrow + 1]
            if values[narrow] == values[narrow + 1]:
                del stops[narrow], values[narrow]
        return PiecewiseConstant(tuple(stops), tuple(values))


#: Widths, in tolerances, below which a band may be left out: a point in it is within the tolerance of its edges.
_BANDS = (0.0, 1.0, 2.0)


def alike(
    left: PiecewiseConstant, right: PiecewiseConstant, tolerance: float
) -> tuple[PiecewiseConstant, PiecewiseConstant] | None:
    """Both parts as they are if they have the same values, or without bands that are too narrow to be resolved;
    None where their values differ still."""
    if left.values == right.values:
        return left, right
    if left.values[0] != right.values[0] or left.values[-1] != right.values[-1]:
        return None
    reduced = [[one.without_bands(width * tolerance) for width in _BANDS] for one in (left, right)]
    for one, two in sorted(itertools.product(range(len(_BANDS)), repeat=2), key=sum):
        if reduced[0][one].values == reduced[1][two].values:
            return reduced[0][one], reduced[1][two]
    return None


@dataclass(frozen=True)
class Column:
    """Classes along the inner axis at the fraction ``place`` of the outer one, number by number."""

    place: float
    parts: tuple[PiecewiseConstant, ...]


def classify_column(place: float, classify: Classify, fractions: Iterable[float], tolerance: float) -> Column:
    """The column at ``place``: classified at ``fractions`` and at both ends, and halved where the class changes."""
    stops, codes = halve(place, classify, fractions, tolerance)
    return Column(place, tuple(find_part(stops, values) for values in zip(*codes, strict=True)))


def halve(
    place: float, classify: Classify, fractions: Iterable[float], tolerance: float
) -> tuple[list[float], list[Code]]:
    """The stops of a column at ``place``, ascending, and the classes between them, one more."""
    points = sorted({0.0, 1.0, *(s for s in fractions if 0.0 < s < 1.0)})
    known = [(s, classify(place, s)) for s in points]
    stops: list[float] = []
    codes = [known[0][1]]

    def search(low: float, first: Code, high: float, last: Code) -> None:
        if first == last:
            return
        middle = 0.5 * (low + high)
        if high - low <= tolerance:
            stops.append(middle)
            codes.append(last)
            return
        found = classify(place, middle)
        search(low, first, middle, found)
        search(middle, found, high, last)

    for (low, first), (high, last) in itertools.pairwise(known):
        search(low, first, high, last)
    return stops, codes


def find_part(stops: Sequence[float], values: Sequence[int]) -> PiecewiseConstant:
    """The part of ``values`` between ``stops``, without stops at which nothing changes."""
    changes = [i for i in range(len(stops)) if values[i] != values[i + 1]]
    return PiecewiseConstant(tuple(stops[i] for i in changes), (values[0], *(values[i + 1] for i in changes)))


def choose_fractions(place: float, nearby: Sequence[Column], guards: int, tolerance: float) -> list[float]:
    """Where to classify a new column: evenly at ``guards`` shares, and around the stops that those ``nearby`` (up
    to two to either side, ascending) lead to expect."""
    fractions = [(i + 0.5) / guards for i in range(guards)]
    places = [one.place for one in nearby]
    each = zip(*(one.parts for one in nearby), strict=True)
    last = -1.0
    for stop in sorted(stop for parts in each for stop in _extrapolate_stops(place, places, parts)):
        # Numbers that change together are expected to do so at nearly the same stop.
        if stop - last > 0.5 * tolerance:
            # A little more than the tolerance apart would be halved again.
            fractions += [stop - 0.49 * tolerance, stop + 0.49 * tolerance]
            last = stop
    return fractions


def _extrapolate_stops(place: float, places: Sequence[float], parts: Sequence[PiecewiseConstant]) -> list[float]:
    """Stops at ``place`` by interpolation between those of columns at ``places`` that have the same values."""
    right = bisect_right(places, place)
    beside = parts[right - 1 : right + 1]
    if len(beside) < 2 or beside[0].values != beside[1].values:
        return [stop for beside_it in beside for stop in beside_it.stops]
    like = [(at, one.stops) for at, one in zip(places, parts, strict=True) if one.values == beside[0].values]
    weights = [math.prod((place - other) / (here - other) for other, _ in like if other != here) for here, _ in like]
    return [
        sum(w * stop for w, stop in zip(weights, stops, strict=True))
        for stops in zip(*(stops for _, stops in like), strict=True)
    ]


def interpolate_column(left: Column, right: Column, number: int, place: float, tolerance: float) -> PiecewiseConstant:
    """The part ``number`` at a place between two columns: on lines, or else as in the nearer one."""
    fraction = (place - left.place) / (right.place - left.place)
    pair = alike(left.parts[number], right.parts[number], tolerance)
    if pair is None:
        return (left if fraction < 0.5 else right).parts[number]
    one, two = pair
    return PiecewiseConstant(
        tuple(a + fraction * (b - a) for a, b in zip(one.stops, two.stops, strict=True)), one.values
    )


def find_intervals_to_halve(columns: Sequence[Column], tolerance: float, narrowest: float) -> list[tuple[int, float]]:
    """The intervals (index of the left column, place of the middle) whose inside the columns do not tell.

    Those are where for one of the numbers the row of values changes, or a stop, by the bend that the columns around
    have, lies beside the line by more than ``tolerance``, and which are wider than ``narrowest``.
    """
    wanted = []
    for i, (left, right) in enumerate(itertools.pairwise(columns)):
        width = right.place - left.place
        around = columns[max(i - 1, 0) : i + 3]
        places = [one.place for one in around]
        if width > narrowest and any(
            _unsure([one.parts[number] for one in around], places, min(i, 1), tolerance)
            for number in range(len(left.parts))
        ):
            wanted.append((i, 0.5 * (left.place + right.place)))
    return wanted


def _unsure(parts: Sequence[PiecewiseConstant], places: Sequence[float], left: int, tolerance: float) -> bool:
    """Whether stops between columns ``left`` and the next are not on lines, to the tolerance, as far as is known."""
    pair = alike(parts[left], parts[left + 1], tolerance)
    if pair is None:
        return True
    one, two = pair
    if not one.stops:
        return False
    bends = []
    before = alike(parts[left - 1], one, tolerance) if left > 0 else None
    if before is not None and before[1].values == two.values:
        bends.append(_bend([*before, two], places[left - 1 : left + 2]))
    after = alike(two, parts[left + 2], tolerance) if left + 2 < len(parts) else None
    if after is not None and after[0].values == one.values:
        bends.append(_bend([one, *after], places[left : left + 3]))
    width = places[left + 1] - places[left]
    return not bends or max(bends) * width**2 / 8.0 > tolerance


def _bend(parts: Sequence[PiecewiseConstant], places: Sequence[float]) -> float:
    """Largest second derivative of the stops through three columns."""
    one, two = places[1] - places[0], places[2] - places[1]
    return max(
        (
            abs(2.0 * ((c - b) / two - (b - a) / one) / (one + two))
            for a, b, c in zip(*(one.stops for one in parts), strict=True)
        ),
        default=0.0,
    )
