"""Boundaries drawn over the second parameter, with their turning points and what lies between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.bifurcations.boundary import Boundary, BoundarySet
from chuteflow.bifurcations.regions import count, limits, sides
from chuteflow.bifurcations.seeds import FOLDS
from chuteflow.bifurcations.tracing import TURNS
from chuteflow.branches.results import KINDS
from chuteflow.io.contract import PLACE
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import PARAMETERS
from chuteflow.plotting import style
from chuteflow.plotting.plots import parameters
from chuteflow.steady.quantities import NUMBERS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Markers of turning points.
_MARKERS = {"cusp": "*", "birth": "o", "crossing": "X", "turn": "s"}
#: Kinds of flows are written so many points beside a boundary, at this share of its way.
_BESIDE, _SHARE = 11.0, 0.45
#: Regions are told apart in a picture of so many cells by as many, and counted if a circle of so many fits in.
_CELLS, _ROOM = 300, 7.0
#: Entries of the legend that are longer stand below one another.
_LONG = 45
_LIMIT = style.Stroke(style.GREY, style.DOTTED)


@style.own_settings()
def plot_boundaries(found: BoundarySet, quantity: str = "mass_flux") -> Figure:
    """The ``quantity``, a number of the registry, of the flows on every boundary against the second parameter.

    Where it is the one that folds, a number in each region says how many flows share a value of it, in the range
    searched, whose edges are drawn too. Beside other boundaries stands the kind of the flows on either side.
    """
    if not len(found):
        return style.sentence(f"No boundary: {found.reason}.")
    figure, (ax,) = style.panels(1, width=5.6, height=4.4)
    drawn = [getattr(boundary, quantity) for boundary in found]
    edges = limits(found) if FOLDS.get(found.kind) == PLACE.index(quantity) else []
    for i, boundary in enumerate(found):
        ax.plot(boundary.parameter, getattr(boundary, quantity), **style.stroke(i).line())
        for turn in boundary.special:
            x, y = getattr(turn.flow.chute, found.second), getattr(turn.flow, quantity)
            ax.plot([x], [y], **_marker(turn.kind, style.stroke(i).colour))
    style.spread_scale(ax, "y", drawn)
    # Nothing is known beyond the range, and curves that end there bound regions.
    box = np.clip(ax.get_xlim(), *found.bounds), ax.get_ylim()
    for edge in edges:
        ax.plot(edge.parameter, getattr(edge, quantity), zorder=1, **_LIMIT.line(0.9))
    ax.set(xlim=box[0], ylim=box[1])
    second = PARAMETERS[found.second]
    style.name_axes(ax, f"{second.noun}, ${second.latex}$", style.label(quantity))
    style.caption(figure, f"{KINDS[found.kind]}\n{parameters(found.chute, found.second)}")
    key = list(_key(found, edges, quantity))
    beside = all(len(entry.get_label()) < _LONG for entry in key)
    style.legend(figure, handles=key, loc="outside lower center", ncols=2 if beside else 1)
    figure.draw_without_rendering()  # which settles where points are
    if edges:
        _count(ax, found, [(line.parameter, getattr(line, quantity)) for line in (*found, *edges)])
    for boundary in found:
        _name_sides(ax, boundary, quantity)
    return figure


def _count(ax: Axes, found: BoundarySet, lines: Sequence[tuple[Array, Array]]) -> None:
    """Write the number of flows into every region between ``lines``, at the place farthest from them all, if
    another place of the region confirms it."""
    from scipy.ndimage import distance_transform_edt, label

    free = np.ones((_CELLS, _CELLS), dtype=bool)
    for x, y in lines:
        free[tuple(_cells(ax, x, y))] = False
    named, number = label(free)
    room = distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
    for i in range(1, number + 1):
        depth = np.where(named == i, room, 0.0)
        place = np.unravel_index(int(np.argmax(depth)), depth.shape)
        if depth[place] < _ROOM:
            continue
        away = np.hypot(*(np.indices(depth.shape) - np.reshape(place, (2, 1, 1))))
        other = np.unravel_index(int(np.argmax(away * (depth >= 0.5 * _ROOM))), depth.shape)
        (x, y), (other_x, other_y) = (_place(ax, cell) for cell in (place, other))
        counted = count(found, x, y)
        if counted == count(found, other_x, other_y):
            style.write(ax, x, y, str(counted), ha="center", va="center", fontsize=11.0, zorder=5)


def _cells(ax: Axes, x: Array, y: Array) -> Array:
    """The cells of the picture (2, k), across and up, that a line passes."""
    shares = ax.transAxes.inverted().transform(ax.transData.transform(np.column_stack([x, y])))
    steps = np.maximum(1, np.ceil(2.0 * _CELLS * np.abs(np.diff(shares, axis=0)).max(axis=1))).astype(int)
    way = [
        a + np.linspace(0.0, 1.0, n + 1)[:, None] * (b - a) for (a, b), n in zip(pairwise(shares), steps, strict=True)
    ]
    cells = np.floor(np.concatenate(way) * _CELLS).astype(int)
    return cells[((cells >= 0) & (cells < _CELLS)).all(axis=1)].T


def _place(ax: Axes, cell: tuple[Any, ...]) -> tuple[float, float]:
    """The parameter and the quantity in the middle of a cell."""
    shares = (np.array(cell, dtype=float) + 0.5) / _CELLS
    x, y = ax.transData.inverted().transform(ax.transAxes.transform(shares))
    return float(x), float(y)


def _name_sides(ax: Axes, boundary: Boundary, quantity: str) -> None:
    """Write the kinds of flows to both sides of a boundary, a little before its middle."""
    places = ax.transData.transform(np.column_stack([boundary.parameter, getattr(boundary, quantity)]))
    lengths = np.hypot(*np.diff(places, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    index = int(np.clip(np.searchsorted(way, _SHARE * way[-1]), 1, len(way) - 2))
    kinds = sides(boundary, PLACE.index(quantity), index)
    if kinds is None:
        return
    along = places[index + 1] - places[index - 1]
    across = np.array([along[1], -along[0]]) / np.hypot(*along)
    right = across if across[0] > 0.0 else -across
    for kind, aside in zip(kinds, (-right, right), strict=True):
        style.write(
            ax,
            float(boundary.parameter[index]),
            float(getattr(boundary, quantity)[index]),
            kind,
            xytext=tuple(_BESIDE * aside),
            ha="left" if aside[0] > 0.0 else "right",
            va="center",
            fontstyle="italic",
        )


def _marker(kind: str, colour: str) -> dict[str, Any]:
    return {
        "marker": _MARKERS[kind],
        "markersize": 9.0 if kind == "cusp" else 5.0,
        "markerfacecolor": "white",
        "markeredgecolor": colour,
        "linestyle": "none",
        "zorder": 3,
    }


def _key(found: BoundarySet, edges: Sequence[Boundary], quantity: str) -> Iterator[Any]:
    """Entries of the legend: the boundaries, the kinds of turning points, and what numbers count."""
    from matplotlib.lines import Line2D

    symbol = NUMBERS["surface_temperature"].latex
    for i, boundary in enumerate(found):
        low, high = boundary.surface_temperature.min(), boundary.surface_temperature.max()
        yield Line2D([], [], label=rf"${symbol}$ from {low:.3g} to {high:.3g}", **style.stroke(i).line())
    kinds = {turn.kind for boundary in found for turn in boundary.special}
    for kind in TURNS:
        if kind in kinds:
            yield Line2D([], [], label=f"{kind}: {TURNS[kind]}", **_marker(kind, style.BLACK))
    if edges:
        yield Line2D([], [], label="edge of the range searched", **_LIMIT.line(0.9))
        counted = rf"numbers: flows of one ${NUMBERS[quantity].latex}$"
        yield Line2D([], [], label=counted, linestyle="none")
