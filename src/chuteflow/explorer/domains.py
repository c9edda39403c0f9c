"""The map of chutes, one column at a time: which flows there are along one axis, at one place of the other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

from chuteflow.explorer.queries import CONTROLS, ColumnAsked
from chuteflow.maps.columns import PiecewiseConstant, classify_column
from chuteflow.maps.plane import HOT_CODES, SUMMARY, ParameterAxis, ParameterPlane, classify_hot, summarise
from chuteflow.parameters import BY_KEY
from chuteflow.steady.chute import Chute

#: Points of a column that are classified first, and the fraction of it to which a boundary is then located: coarser
#: where every point needs its own trajectories, finer for hot flows, which are known in closed form.
_FIRST, _FIRST_HOT = 9, 33
#: The same of a coarse column, which takes hot flows from the search.
_FIRST_COARSE, _TOLERANCE_COARSE = 5, 0.06
_TOLERANCE, _HOT_TOLERANCE = {True: 0.008, False: 0.016}, 1e-3


@dataclass(frozen=True)
class MapColumn:
    """Classes of chutes along the parameter ``inner`` where ``outer`` is ``at``; both are names of a query.

    ``parts`` are by name "most" (flows that share a flux), "families", "interior" and "density" (bits, see
    :mod:`chuteflow.maps.kinds`), and "hot" (1 where there are flows at every high temperature, -1
    where the theory does not say). Their stops are values of ``inner``, which may be off by ``tolerance``.
    """

    outer: str
    inner: str
    at: float
    parts: dict[str, PiecewiseConstant]
    tolerance: float


def map_column(asked: ColumnAsked) -> MapColumn:
    """Classify one column of the map.

    Raises:
        InputError: where a corner of the map is no chute.
    """
    x, y, place = asked.x, asked.y, asked.place
    plane = _plane(asked.chute, x, y)
    inner, outer = (x, y) if plane.transposed else (y, x)
    tolerance = _TOLERANCE_COARSE if asked.coarse else _TOLERANCE[BY_KEY[inner].of_base]
    first = _FIRST_COARSE if asked.coarse else _FIRST
    found = classify_column(
        place, partial(summarise, plane), [*_evenly(first), *_beside(plane, asked, tolerance)], tolerance
    )
    # Narrower bands are found only by chance.
    parts = {name: part.without_bands(tolerance) for name, part in zip(SUMMARY, found.parts, strict=True)}
    if plane.hot_known and not asked.coarse:
        hot = classify_column(place, partial(classify_hot, plane), _evenly(_FIRST_HOT), _HOT_TOLERANCE)
        parts["hot"] = hot.parts[HOT_CODES.index("hot")]
    return MapColumn(
        outer,
        inner,
        float(plane.outer.at(place)),
        {name: PiecewiseConstant(tuple(map(plane.inner.at, part.stops)), part.values) for name, part in parts.items()},
        0.5 * tolerance * (plane.inner.high - plane.inner.low),
    )


def _beside(plane: ParameterPlane, asked: ColumnAsked, tolerance: float) -> list[float]:
    """Fractions of the inner axis just below and above the ``near`` values, closer together than the tolerance."""
    fractions = [(value - plane.inner.low) / (plane.inner.high - plane.inner.low) for value in asked.near]
    return [fraction + side * tolerance for fraction in fractions for side in (-0.49, 0.49)]


@lru_cache(maxsize=8)
def _plane(chute: Chute, x: str, y: str) -> ParameterPlane:
    across, up = (ParameterAxis(BY_KEY[name].name, CONTROLS[name].low, CONTROLS[name].high) for name in (x, y))
    return ParameterPlane(across, up, chute, ())


def _evenly(count: int) -> list[float]:
    return [(i + 0.5) / count for i in range(count)]
