"""Maps of domains as pictures to be printed: regions and lines from the refined boundaries, named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.maps import Domain, Outline
from chuteflow.parameters import PARAMETERS
from chuteflow.plotting import style
from chuteflow.plotting.plots import parameters
from chuteflow.steady.quantities import NUMBERS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TEMPERATURE = NUMBERS["surface_temperature"].latex
#: Fills for 0, 1, 2, ... flows that share one flux; the last stands for more too.
_COUNTS = ("#ffffff", "#e3eef8", "#bcd7ee", "#86b5dc", "#5590c4", "#2f6ba5")
#: Fills for monotonic densities alone, inverted ones alone, and both, by the sum of their bits.
_DENSITIES = {0: "#ffffff", 1: "#fbe9c6", 3: "#f1c27b", 2: "#d99a5b"}
_DENSITY_WORDS = {1: "monotonic", 3: "monotonic and inverted", 2: "inverted"}
#: Strokes and words of the kinds of boundaries, panel by panel.
_OF_NUMBER = {
    "F21=0": (style.LineStyle(style.BLACK, style.SOLID), r"$F_{21} = 0$: hot flows end"),
    "lambda=3": (style.LineStyle(style.VERMILION, style.SOLID), r"$\lambda = 3$: hot flows end"),
    "delta=0": (style.LineStyle(style.PURPLE, style.DASH_DOTTED), r"$\delta = 0$: hot flows end"),
    "existence": (style.LineStyle(style.BLACK, style.DASHED), "first or last flow"),
    "multiplicity": (style.LineStyle(style.BLUE, style.SOLID), "another number of flows share one flux"),
}
_OF_KIND = {
    "existence": (style.LineStyle(style.BLACK, style.DASHED), "first or last flow"),
    "inverted": (style.LineStyle(style.GREEN, style.SOLID), "first or last inverted density"),
    "monotonic": (style.LineStyle(style.GREEN, style.DASHED), "first or last monotonic density"),
    "lambda=0.660": (style.LineStyle(style.GREEN, style.DOTTED), r"$\lambda = 0.660$: hot flows turn inverted"),
    "mixed": (style.LineStyle(style.PURPLE, style.SOLID), "first or last mixed interior"),
    "productive": (style.LineStyle(style.PURPLE, style.DASHED), "first or last productive interior"),
    "dissipative": (style.LineStyle(style.PURPLE, style.DASH_DOTTED), "first or last dissipative interior"),
}
#: Strokes of surface temperatures, in turn.
_TEMPERATURES = tuple(
    style.LineStyle(colour, dashes)
    for colour, dashes in (
        (style.BLUE, style.DOTTED),
        (style.BLUE, style.DASHED),
        (style.BLUE, style.SOLID),
        (style.VERMILION, style.DOTTED),
        (style.VERMILION, style.DASHED),
        (style.VERMILION, style.SOLID),
    )
)
#: A region gets a label where a circle of this fraction of the axes fits into it.
_ROOM = 0.035
#: Side of the raster on which that is searched for.
_RASTER = 160
_LINE = 1.1


@style.own_settings()
def plot_domain(found: Domain) -> Figure:
    """Two panels: how many flows share one flux, with the bounds of hot flows and hidden branches hatched; and the
    kinds of density and interior, with the bounds of flows at the requested temperatures."""
    figure, axes = style.panels(2, width=7.6, height=4.7)
    _number_panel(axes[0], found)
    _kind_panel(axes[1], found)
    plane = found.plane
    for ax in axes:
        style.name_axes(ax, _axis_label(plane.x.name), _axis_label(plane.y.name) if ax is axes[0] else None)
        ax.set_xlim(plane.x.low, plane.x.high)
        ax.set_ylim(plane.y.low, plane.y.high)
    style.caption(figure, _others(found))
    style.legend(figure, handles=list(_key(found)), loc="outside lower center", ncols=3)
    return figure


def _axis_label(parameter: str) -> str:
    return f"{PARAMETERS[parameter].noun}, ${PARAMETERS[parameter].latex}$"


def _others(found: Domain) -> str:
    plane = found.plane
    low, high = found.searched.surface_temperature
    searched = rf"${_TEMPERATURE}$ from {low:g} to {high:g}, $M$ to {found.searched.largest_holdup:g}"
    return f"{parameters(plane.chute, plane.x.name, plane.y.name)}; {searched}"


def _number_panel(ax: Axes, found: Domain) -> None:
    _fill(ax, found, ("most",), dict(enumerate(_COUNTS)))
    hidden = [region.polygon for region in found.regions("families") if region.value > 1]
    _hatch(ax, hidden)
    _draw(ax, found.boundaries, _OF_NUMBER)
    words = {0: "no flow", 1: "1"} | {i: str(i) for i in range(2, int(found.most.max()) + 1)}
    _label(ax, found, found.most, words)


def _kind_panel(ax: Axes, found: Domain) -> None:
    _fill(ax, found, ("monotonic", "inverted"), _DENSITIES)
    _draw(ax, found.boundaries, _OF_KIND)
    for temperature, stroke in zip(found.plane.temperatures, _strokes(found), strict=True):
        lines = [one for one in found.boundaries if one.temperature == temperature]
        _draw(ax, lines, {"temperature": (stroke, "")})
    _label(ax, found, found.density, {0: "no flow"} | _DENSITY_WORDS)


def _strokes(found: Domain) -> list[style.LineStyle]:
    return [_TEMPERATURES[i % len(_TEMPERATURES)] for i in range(len(found.plane.temperatures))]


def _fill(ax: Axes, found: Domain, names: tuple[str, ...], colours: dict[int, str]) -> None:
    from matplotlib.collections import PolyCollection

    by_value: dict[int, list[NDArray[np.float64]]] = {}
    for region in found.regions(*names):
        by_value.setdefault(min(region.value, max(colours)), []).append(region.polygon)
    for value, polygons in by_value.items():
        # Edges of the same colour close the seams that renderers leave between polygons.
        ax.add_collection(
            PolyCollection(polygons, facecolors=colours[value], edgecolors=colours[value], linewidths=0.4, zorder=0.5)
        )


def _hatch(ax: Axes, polygons: Sequence[NDArray[np.float64]]) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    if polygons:
        whole = Path.make_compound_path(*(Path(np.vstack([p, p[:1]]), closed=True) for p in polygons))
        ax.add_patch(
            PathPatch(whole, facecolor="none", edgecolor=style.BLACK, hatch="/////", linewidth=0.0, zorder=1.0)
        )


def _draw(ax: Axes, lines: Sequence[Outline], strokes: dict[str, tuple[style.LineStyle, str]]) -> None:
    for one in lines:
        if one.kind in strokes:
            # The bounds in closed form stand above what begins or ends there.
            above = 2.5 if one.kind in ("F21=0", "delta=0", "lambda=3") else 2.0
            ax.plot(*one.points.T, **strokes[one.kind][0].line(_LINE), zorder=above, scalex=False, scaley=False)


def _label(ax: Axes, found: Domain, values: NDArray[Any], words: dict[int, str]) -> None:
    """The name of each region where there is most room in it, if there is room."""
    from scipy import ndimage

    rows, columns = (np.arange(_RASTER) * count // _RASTER for count in values.shape)
    raster = values[np.ix_(rows, columns)]
    step = 1.0 / _RASTER
    for value, text in words.items():
        parts, count = ndimage.label(raster == value)
        for part in range(1, count + 1):
            inside = np.pad(parts == part, 1)
            room = ndimage.distance_transform_edt(inside)[1:-1, 1:-1] * step
            row, column = np.unravel_index(int(room.argmax()), room.shape)
            if room[row, column] < _ROOM * (1.0 + 0.14 * len(text)):
                continue
            style.write(
                ax,
                float(found.plane.x.at((column + 0.5) * step)),
                float(found.plane.y.at((row + 0.5) * step)),
                text,
                ha="center",
                va="center",
                zorder=4.0,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0},
            )


def _key(found: Domain) -> Iterator[Any]:
    """Entries of the legend: the lines that are there, temperatures, and hidden branches."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    kinds = {one.kind for one in found.boundaries}
    for kind, (stroke, words) in (_OF_NUMBER | _OF_KIND).items():
        if kind in kinds:
            yield Line2D([], [], label=words, **stroke.line(_LINE))
    for temperature, stroke in zip(found.plane.temperatures, _strokes(found), strict=True):
        yield Line2D([], [], label=rf"first or last flow at ${_TEMPERATURE} = {temperature:g}$", **stroke.line(_LINE))
    if found.hidden.any():
        yield Patch(facecolor="none", edgecolor=style.BLACK, hatch="/////", linewidth=0.0, label="hidden branches")
