"""The map of chutes, one column at a time: which flows there are along one axis, at one place of the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

from chuteflow.analysis.domains.columns import column
from chuteflow.analysis.domains.plane import CODES, Axis, Plane
from chuteflow.faces.contract import PARAMETERS
from chuteflow.faces.explorer.queries import CONTROLS
from chuteflow.steady.chute import Chute

#: Points of a column that are looked at first, and the share of it to which a boundary is then located: coarser
#: where every point has trajectories of its own.
_FIRST = 9
_TOLERANCE = {True: 0.008, False: 0.016}
_OF_BASE = ("ew", "roughness")


@dataclass(frozen=True)
class Part:
    """One number of the class along a column: ``values`` has one entry more than ``stops``, the values of the
    parameter, ascending, between them."""

    stops: tuple[float, ...]
    values: tuple[int, ...]


@dataclass(frozen=True)
class MapColumn:
    """What chutes are like along the parameter ``inner`` where ``outer`` is ``at``; both are names of a query.

    ``parts`` are by name "most" (flows that share a flux), "families", "interior" and "density" (bits, see
    :mod:`chuteflow.analysis.domains.kinds`), and "hot" (1 where there are flows at every high temperature).
    ``tolerance`` is how far stops may be off.
    """

    outer: str
    inner: str
    at: float
    parts: dict[str, Part]
    tolerance: float


def map_column(chute: Chute, x: str, y: str, place: float) -> MapColumn:
    """The column of the map over ``x`` and ``y`` (names of a query) at a share of its outer axis.

    Raises:
        InputError: where a corner of the map is no chute.
    """
    plane = _plane(chute, x, y)
    inner, outer = (x, y) if plane.transposed else (y, x)
    tolerance = _TOLERANCE[inner in _OF_BASE]
    found = column(plane, place, [(i + 0.5) / _FIRST for i in range(_FIRST)], tolerance)
    stops = [float(plane.inner.at(stop)) for stop in found.stops]
    return MapColumn(
        outer,
        inner,
        float(plane.outer.at(place)),
        {name: _part(stops, [code[i] for code in found.codes]) for i, name in enumerate(CODES)},
        0.5 * tolerance * (plane.inner.high - plane.inner.low),
    )


def _part(stops: Sequence[float], values: Sequence[int]) -> Part:
    """Without the stops at which nothing changes."""
    kept = [i for i, pair in enumerate(pairwise(values)) if pair[0] != pair[1]]
    return Part(tuple(stops[i] for i in kept), (values[0], *(values[i + 1] for i in kept)))


@lru_cache(maxsize=8)
def _plane(chute: Chute, x: str, y: str) -> Plane:
    across, up = (Axis(PARAMETERS[name], CONTROLS[name].low, CONTROLS[name].high) for name in (x, y))
    return Plane(across, up, chute, ())
