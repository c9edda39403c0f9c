"""Columns of a map: the classes along one axis, constant between stops that are located to a tolerance.

Columns are put where the stops between two others do not lie on a line, to the tolerance, and where the row of
classes changes: at tips and crossings of boundaries.
"""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from chuteflow.analysis.domains.plane import Code, Plane, code


@dataclass(frozen=True)
class Column:
    """Classes along the inner axis at the share ``place`` of the outer one.

    ``codes`` has one entry more than ``stops``, the shares of the inner axis, ascending, between them.
    """

    place: float
    stops: tuple[float, ...]
    codes: tuple[Code, ...]

    def at(self, share: float) -> Code:
        """The class at a share of the inner axis."""
        return self.codes[bisect_right(self.stops, share)]


def column(plane: Plane, place: float, shares: Iterable[float], tolerance: float) -> Column:
    """The column at ``place``: classified at ``shares`` and at both ends, and halved where the class changes."""
    return halved(place, lambda share: code(plane, place, share), shares, tolerance)


def halved(place: float, classify: Callable[[float], Code], shares: Iterable[float], tolerance: float) -> Column:
    """The column of a function of the inner share."""
    points = sorted({0.0, 1.0, *(s for s in shares if 0.0 < s < 1.0)})
    known = [(s, classify(s)) for s in points]
    stops: list[float] = []
    codes = [known[0][1]]

    def between(low: float, first: Code, high: float, last: Code) -> None:
        if first == last:
            return
        middle = 0.5 * (low + high)
        if high - low <= tolerance:
            stops.append(middle)
            codes.append(last)
            return
        found = classify(middle)
        between(low, first, middle, found)
        between(middle, found, high, last)

    for (low, first), (high, last) in itertools.pairwise(known):
        between(low, first, high, last)
    return Column(place, tuple(stops), tuple(codes))


def shares_for(place: float, nearby: Sequence[Column], guards: int, tolerance: float) -> list[float]:
    """Where to classify a new column: evenly at ``guards`` shares, and around the stops that those ``nearby``
    (the two neighbours) lead to expect."""
    shares = [(i + 0.5) / guards for i in range(guards)]
    for one in nearby:
        shares += [stop + side * tolerance for stop in one.stops for side in (-1.0, 1.0)]
    if len(nearby) == 2 and nearby[0].codes == nearby[1].codes:
        expected = between(*nearby, place)
        shares += [stop + side * 0.5 * tolerance for stop in expected for side in (-1.0, 1.0)]
    return shares


def between(left: Column, right: Column, place: float) -> list[float]:
    """Stops at ``place`` on the lines from one column to another with the same row of classes."""
    share = (place - left.place) / (right.place - left.place)
    return [a + share * (b - a) for a, b in zip(left.stops, right.stops, strict=True)]


def to_halve(columns: Sequence[Column], tolerance: float, narrowest: float) -> list[tuple[int, float]]:
    """The intervals (index of the left column, place of the middle) whose inside the columns do not tell.

    Those are where the row of classes changes, or where a stop, by the bend that the columns around have, lies
    beside the line by more than ``tolerance``, and which are wider than ``narrowest``.
    """
    wanted = []
    for i, (left, right) in enumerate(itertools.pairwise(columns)):
        width = right.place - left.place
        if width <= narrowest:
            continue
        if left.codes == right.codes:
            around = [columns[max(i - 1, 0) : i + 2], columns[i : i + 3]]
            bends = [_bend(*three) for three in around if len(three) == 3 and len({c.codes for c in three}) == 1]
            if not left.stops or (bends and max(bends) * width**2 / 8.0 <= tolerance):
                continue
        wanted.append((i, 0.5 * (left.place + right.place)))
    return wanted


def _bend(left: Column, middle: Column, right: Column) -> float:
    """Largest second derivative of the stops through three columns."""
    one, two = middle.place - left.place, right.place - middle.place
    return max(
        (
            abs(2.0 * ((c - b) / two - (b - a) / one) / (one + two))
            for a, b, c in zip(left.stops, middle.stops, right.stops, strict=True)
        ),
        default=0.0,
    )
