"""Outlines of the classes of a map: boundaries as named lines, and regions as polygons.

Between two columns with the same row of values, stops are joined by straight lines. Two columns whose rows differ
stand closer than the tolerance: half-way between them the outline runs along the inner axis wherever they differ, so
that lines close at tips, and boundaries along the inner axis are lines like others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from chuteflow import display
from chuteflow.maps.columns import Column, PiecewiseConstant, alike, find_part
from chuteflow.maps.plane import CODES, HOT_CODES, ParameterPlane
from chuteflow.result import Compared

#: A point: fractions of the outer and of the inner axis.
Point = tuple[float, float]
#: The values to either side of a line, the lesser first.
Label = tuple[int, int]
_Stretch = tuple[Point, Point]


@dataclass(frozen=True, eq=False)
class Outline(Compared):
    """A line between two classes.

    ``kind`` is one of KINDS_OF_BOUNDARIES; ``values`` are those of the number that changes, the lesser first, or
    for kind "temperature" 0 and 1; ``temperature`` is that of the flows, for that kind alone. ``points`` (k, 2) are
    values of the parameters on the axes, x and y.
    """

    kind: str
    values: Label
    points: NDArray[np.float64]
    temperature: float | None = None

    def __repr__(self) -> str:
        between = f"between {self.values[0]} and {self.values[1]}"
        return display.line("Outline", self.kind, between, display.count_of(len(self.points), "point"))


@dataclass(frozen=True, eq=False)
class Region(Compared):
    """A polygon (k, 2) of x and y in which a number has one ``value``."""

    value: int
    polygon: NDArray[np.float64]

    def __repr__(self) -> str:
        return display.line("Region", f"value {self.value}", display.count_of(len(self.polygon), "corner"))


#: Kinds of boundaries, and what changes there.
KINDS_OF_BOUNDARIES = {
    "F21=0": "hot flows end: their base gives no energy (closed form)",
    "delta=0": "hot flows end: their interior neither loses nor gains energy (closed form)",
    "lambda=3": "hot flows end: their base gives more energy than they can lose (closed form)",
    "lambda=0.660": "hot flows turn densest above the base (closed form)",
    "existence": "the first or last flow",
    "families": "another branch of flows",
    "multiplicity": "the largest number of flows that share one mass flux",
    "dissipative": "the first or last flow with a dissipative interior",
    "mixed": "the first or last flow with a mixed interior",
    "productive": "the first or last flow with a productive interior",
    "monotonic": "the first or last flow with a density that falls with height everywhere",
    "inverted": "the first or last flow with its density inverted",
    "temperature": "the first or last flow at a surface temperature",
}
#: The bounds in closed form by their place in HOT_CODES.
_BOUNDS = {"base": "F21=0", "inside": "delta=0", "steep": "lambda=3", "inversion": "lambda=0.660"}


def trace_outlines(
    plane: ParameterPlane, columns: Sequence[Column], hot_columns: Sequence[Column], tolerance: float
) -> tuple[Outline, ...]:
    """Every boundary of the map, kind by kind."""
    found = list(_hot_boundaries(plane, hot_columns, 0.1 * tolerance)) if hot_columns else []
    for number, name in enumerate(CODES):
        kind = {"most": "multiplicity"}.get(name, name)
        for values, points in _lines(_parts(columns, number), tolerance):
            one = "existence" if kind == "families" and values[0] == 0 else kind
            # Where flows begin, all their classes do: the boundary of existence says it once.
            if name == "families" or (kind == "multiplicity" and values[0] > 0):
                found.append(Outline(one, values, _in_plane(plane, points)))
            elif name not in ("most", "families"):
                found += [
                    Outline(kind, values, _in_plane(plane, piece))
                    for piece in _where(points, lambda p: _exists_around(columns, p))
                ]
    for i, temperature in enumerate(plane.temperatures):
        for values, points in _lines(_parts(columns, len(CODES) + i), tolerance):
            found.append(Outline("temperature", values, _in_plane(plane, points), temperature))
    return tuple(found)


def make_regions(
    plane: ParameterPlane, columns: Sequence[Column], bits: dict[int, int], tolerance: float
) -> tuple[Region, ...]:
    """Polygons that fill the plane, one between two stops of neighbouring columns.

    ``bits`` has factors of numbers of the class; the value of a region is the sum of their products.
    """
    parts = [_add([one.parts[number] for number in bits], list(bits.values())) for one in columns]
    found = []
    for (left, first_part), (right, last_part) in pairwise(zip(columns, parts, strict=True)):
        pair = alike(first_part, last_part, tolerance)
        middle = 0.5 * (left.place + right.place)
        spans = (
            [(left.place, middle, first_part, first_part), (middle, right.place, last_part, last_part)]
            if pair is None
            else [(left.place, right.place, *pair)]
        )
        for low, high, first, last in spans:
            edges = [(0.0, *one.stops, 1.0) for one in (first, last)]
            for band, value in enumerate(first.values):
                corners = [(low, edges[0][band]), (high, edges[1][band])]
                corners += [(high, edges[1][band + 1]), (low, edges[0][band + 1])]
                found.append(Region(value, _in_plane(plane, corners)))
    return tuple(found)


def _add(parts: Sequence[PiecewiseConstant], factors: Sequence[int]) -> PiecewiseConstant:
    """The part whose values are sums of those of ``parts``, each times its factor."""
    stops = sorted({stop for one in parts for stop in one.stops})
    inside = [0.5 * (a + b) for a, b in pairwise([-1.0, *stops, 2.0])]
    values = [sum(f * one.at(fraction) for f, one in zip(factors, parts, strict=True)) for fraction in inside]
    return find_part(stops, values)


def _hot_boundaries(plane: ParameterPlane, columns: Sequence[Column], tolerance: float) -> Iterator[Outline]:
    """The bounds in closed form, as far as they are bounds of hot flows, and the onset of inversion among them."""
    places, hot = _parts(columns, HOT_CODES.index("hot"))

    def bounds(point: Point) -> bool:
        return len(_around(places, hot, point)) > 1

    def among(point: Point) -> bool:
        return _around(places, hot, point) == {1}

    for name, kind in _BOUNDS.items():
        wanted = among if name == "inversion" else bounds
        for values, points in _lines(_parts(columns, HOT_CODES.index(name)), tolerance):
            for piece in _where(points, wanted):
                yield Outline(kind, values, _in_plane(plane, piece))


def _parts(columns: Sequence[Column], number: int) -> tuple[list[float], list[PiecewiseConstant]]:
    return [one.place for one in columns], [one.parts[number] for one in columns]


#: How far around a point classes are examined: beyond the tolerance of the columns there.
_ASIDE = 2e-3


def _around(places: Sequence[float], parts: Sequence[PiecewiseConstant], point: Point) -> set[int]:
    """Values close to a point."""
    found = set()
    for outer in (-_ASIDE, 0.0, _ASIDE):
        i = int(np.clip(np.searchsorted(places, point[0] + outer), 0, len(places) - 1))
        found |= {parts[i].at(min(max(point[1] + inner, 0.0), 1.0)) for inner in (-_ASIDE, 0.0, _ASIDE)}
    return found


def _exists_around(columns: Sequence[Column], point: Point) -> bool:
    """Whether there are flows on all sides of a point."""
    places, branches = _parts(columns, CODES.index("families"))
    return 0 not in _around(places, branches, point)


def _where(points: Sequence[Point], wanted: Callable[[Point], bool]) -> Iterator[list[Point]]:
    """The pieces of a line whose points are wanted."""
    piece: list[Point] = []
    for point in points:
        if wanted(point):
            piece.append(point)
        else:
            if len(piece) > 1:
                yield piece
            piece = []
    if len(piece) > 1:
        yield piece


def _in_plane(plane: ParameterPlane, points: Sequence[Point]) -> NDArray[np.float64]:
    outer, inner = np.array(points, dtype=float).T
    values = plane.outer.at(outer), plane.inner.at(inner)
    return np.stack(values[::-1] if plane.transposed else values, axis=-1)


def _lines(
    along: tuple[Sequence[float], Sequence[PiecewiseConstant]], tolerance: float
) -> Iterator[tuple[Label, list[Point]]]:
    """The outlines of a number of the class: the values to either side, and the points of a line."""
    stretches: dict[Label, list[_Stretch]] = {}
    for (place, left), (after, right) in pairwise(zip(*along, strict=True)):
        pair = alike(left, right, tolerance)
        if pair is not None:
            for i, (a, b) in enumerate(zip(pair[0].stops, pair[1].stops, strict=True)):
                stretches.setdefault(_label(pair[0].values[i : i + 2]), []).append(((place, a), (after, b)))
            continue
        middle = 0.5 * (place + after)
        for x, one in ((place, left), (after, right)):
            for i, stop in enumerate(one.stops):
                stretches.setdefault(_label(one.values[i : i + 2]), []).append(((x, stop), (middle, stop)))
        edges = sorted({0.0, 1.0, *left.stops, *right.stops})
        for low, high in pairwise(edges):
            pair = left.at(0.5 * (low + high)), right.at(0.5 * (low + high))
            if pair[0] != pair[1]:
                stretches.setdefault(_label(pair), []).append(((middle, low), (middle, high)))
    for label, pieces in stretches.items():
        for line in _join(pieces):
            yield label, line


def _label(values: Sequence[int]) -> Label:
    return min(values), max(values)


def _join(stretches: Sequence[_Stretch]) -> Iterator[list[Point]]:
    """Lines through stretches that share a point; where more than two meet, any two are joined."""
    at: dict[Point, list[int]] = {}
    for i, ends in enumerate(stretches):
        for end in ends:
            at.setdefault(end, []).append(i)
    left = set(range(len(stretches)))

    def followed(point: Point) -> Iterator[Point]:
        while (i := next((i for i in at[point] if i in left), None)) is not None:
            left.discard(i)
            a, b = stretches[i]
            point = b if point == a else a
            yield point

    for start in (*(point for point, ends in at.items() if len(ends) == 1), *at):
        line = [start, *followed(start)]
        if len(line) > 1:
            yield line
