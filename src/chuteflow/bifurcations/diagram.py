"""What a picture of boundaries shows, computed before it is drawn: its frame, edges, numbers and kinds of flows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from chuteflow.bifurcations.boundary import Boundary, BoundarySet
from chuteflow.bifurcations.regions import count_flows, find_kinds_beside, find_range_edges
from chuteflow.bifurcations.starting_points import FOLDS
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.quantities import PLACE

#: Kinds of flows are told beside this fraction of the length of a boundary.
_FRACTION = 0.45
#: Regions are distinguished on so many cells by as many, and counted if a circle of so many cells fits in.
_CELLS, _FITTING = 300, 7.0
#: Margin around the boundaries, as a fraction of their extent.
_MARGIN = 0.03
#: The vertical axis is logarithmic where its values span a larger factor.
_SPAN = 30.0
#: Height over width of the frame, by which lengths along a boundary are measured.
_ASPECT = 0.8


@dataclass(frozen=True)
class DiagramFrame:
    """A rectangle of the second parameter, ``x``, and a quantity, ``y``, which may be on a logarithmic axis."""

    x: tuple[float, float]
    y: tuple[float, float]
    logarithmic: bool

    @classmethod
    def around(cls, x: Array, y: Array, bounds: tuple[float, float]) -> DiagramFrame:
        """The frame of points, within ``bounds`` of the second parameter: nothing is known beyond."""
        logarithmic = bool(y.min() > 0.0 and y.max() > _SPAN * y.min())
        low, high = _widen(np.log(y) if logarithmic else y)
        across = np.clip(_widen(x), *bounds)
        return cls(
            (float(across[0]), float(across[1])),
            (float(np.exp(low)), float(np.exp(high))) if logarithmic else (low, high),
            logarithmic,
        )

    def fractions(self, x: Array, y: Array) -> Array:
        """Places (k, 2) of points across and up the frame, 0 to 1."""
        scaled, (low, high) = (np.log(y), np.log(self.y)) if self.logarithmic else (y, self.y)
        return np.column_stack([(x - self.x[0]) / (self.x[1] - self.x[0]), (scaled - low) / (high - low)])

    def point(self, across: float, up: float) -> tuple[float, float]:
        """The parameter and the quantity at a place."""
        x = self.x[0] + across * (self.x[1] - self.x[0])
        if self.logarithmic:
            return x, self.y[0] * (self.y[1] / self.y[0]) ** up
        return x, self.y[0] + up * (self.y[1] - self.y[0])


@dataclass(frozen=True)
class CountedRegion:
    """A region between boundaries by a point in it: how many flows share the quantity there."""

    parameter: float
    value: float
    flows: int


@dataclass(frozen=True, eq=False)
class KindsBeside:
    """The kinds of flows at smaller and larger parameters beside point ``index`` of a boundary."""

    boundary: Boundary
    index: int
    kinds: tuple[str, str]


@dataclass(frozen=True, eq=False)
class Diagram:
    """Boundaries over the second parameter and a ``quantity``, a number of the registry, with what lies between them.

    ``edges`` are those of the range searched; they and ``regions`` are there where the quantity is the one that folds.
    """

    found: BoundarySet
    quantity: str
    frame: DiagramFrame
    edges: tuple[Boundary, ...]
    regions: tuple[CountedRegion, ...]
    sides: tuple[KindsBeside, ...]


def diagram(found: BoundarySet, quantity: str = "mass_flux") -> Diagram:
    """The diagram of the boundaries ``found``, of which there is one at least.

    Raises:
        SolveError: where the edge of the range searched could not be followed, or a flow not be solved.
    """
    lines = [(boundary.parameter, getattr(boundary, quantity)) for boundary in found]
    frame = DiagramFrame.around(*(np.concatenate(part) for part in zip(*lines, strict=True)), bounds=found.bounds)
    edges = find_range_edges(found) if FOLDS.get(found.kind) == PLACE.index(quantity) else []
    lines += [(edge.parameter, getattr(edge, quantity)) for edge in edges]
    regions = _regions(found, frame, lines) if edges else ()
    return Diagram(found, quantity, frame, tuple(edges), tuple(regions), tuple(_sides(found, frame, quantity)))


def _widen(values: Array) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    # One value alone has some extent on an axis too.
    margin = _MARGIN * (high - low) or _MARGIN * max(abs(low), 1e-9)
    return low - margin, high + margin


def _regions(found: BoundarySet, frame: DiagramFrame, lines: Sequence[tuple[Array, Array]]) -> Iterator[CountedRegion]:
    """Every region between ``lines``, by its place farthest from them all, if another place of it confirms the number
    of flows."""
    from scipy.ndimage import distance_transform_edt, label

    free = np.ones((_CELLS, _CELLS), dtype=bool)
    for x, y in lines:
        free[tuple(_cells(frame.fractions(x, y)))] = False
    named, number = label(free)
    distance = distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
    for i in range(1, number + 1):
        depth = np.where(named == i, distance, 0.0)
        place = np.unravel_index(int(np.argmax(depth)), depth.shape)
        if depth[place] < _FITTING:
            continue
        away = np.hypot(*(np.indices(depth.shape) - np.reshape(place, (2, 1, 1))))
        other = np.unravel_index(int(np.argmax(away * (depth >= 0.5 * _FITTING))), depth.shape)
        here, there = (frame.point(*_middle(cell)) for cell in (place, other))
        counted = count_flows(found, *here)
        if counted == count_flows(found, *there):
            yield CountedRegion(*here, counted)


def _cells(places: Array) -> Array:
    """The cells (2, k), across and up, that a line through ``places`` (n, 2) passes."""
    steps = np.maximum(1, np.ceil(2.0 * _CELLS * np.abs(np.diff(places, axis=0)).max(axis=1))).astype(int)
    between = [
        a + np.linspace(0.0, 1.0, n + 1)[:, None] * (b - a) for (a, b), n in zip(pairwise(places), steps, strict=True)
    ]
    cells = np.floor(np.concatenate(between) * _CELLS).astype(int)
    return cells[((cells >= 0) & (cells < _CELLS)).all(axis=1)].T


def _middle(cell: tuple[Any, ...]) -> tuple[float, float]:
    across, up = (np.array(cell, dtype=float) + 0.5) / _CELLS
    return float(across), float(up)


def _sides(found: BoundarySet, frame: DiagramFrame, quantity: str) -> Iterator[KindsBeside]:
    """The kinds of flows beside each boundary, a little before its middle."""
    for boundary in found:
        places = frame.fractions(boundary.parameter, getattr(boundary, quantity)) * (1.0, _ASPECT)
        length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
        index = int(np.clip(np.searchsorted(length, _FRACTION * length[-1]), 1, len(length) - 2))
        kinds = find_kinds_beside(boundary, PLACE.index(quantity), index)
        if kinds is not None:
            yield KindsBeside(boundary, index, kinds)
