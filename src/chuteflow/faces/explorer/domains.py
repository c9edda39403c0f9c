"""The map of chutes, one column at a time: which flows there are along one axis, at one place of the other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

from chuteflow.analysis.domains.columns import halved
from chuteflow.analysis.domains.plane import SUMMARY, Axis, Plane, summary
from chuteflow.faces.contract import PARAMETERS
from chuteflow.faces.explorer.queries import CONTROLS
from chuteflow.steady.chute import Chute

#: Points of a column that are looked at first, and the share of it to which a boundary is then located: coarser
#: where every point has trajectories of its own.
_FIRST = 9
_TOLERANCE = {True: 0.008, False: 0.016}
_OF_BASE = ("ew", "roughness")


@dataclass(frozen=True)
class MapColumn:
    """Classes along the axis ``inner`` where ``outer`` is ``at``; both are names of a query.

    ``codes`` (integers in the order of ``names``) has one entry more than ``stops``, the values of ``inner``,
    ascending, between them; ``tolerance`` is how far these may be off.
    """

    outer: str
    inner: str
    at: float
    stops: tuple[float, ...]
    codes: tuple[tuple[int, ...], ...]
    tolerance: float
    names: tuple[str, ...] = SUMMARY


def map_column(chute: Chute, x: str, y: str, place: float) -> MapColumn:
    """The column of the map over ``x`` and ``y`` (names of a query) at a share of its outer axis.

    Raises:
        InputError: where a corner of the map is no chute.
    """
    plane = _plane(chute, x, y)
    inner, outer = (x, y) if plane.transposed else (y, x)
    tolerance = _TOLERANCE[inner in _OF_BASE]
    first = [(i + 0.5) / _FIRST for i in range(_FIRST)]
    stops, codes = halved(place, partial(summary, plane), first, tolerance)
    return MapColumn(
        outer,
        inner,
        float(plane.outer.at(place)),
        tuple(float(plane.inner.at(stop)) for stop in stops),
        tuple(codes),
        0.5 * tolerance * (plane.inner.high - plane.inner.low),
    )


@lru_cache(maxsize=8)
def _plane(chute: Chute, x: str, y: str) -> Plane:
    across, up = (Axis(PARAMETERS[name], CONTROLS[name].low, CONTROLS[name].high) for name in (x, y))
    return Plane(across, up, chute, ())
