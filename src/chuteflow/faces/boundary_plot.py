"""Boundaries drawn over the second parameter, with their cusps and other turning points."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from chuteflow.analysis.boundaries.boundary import BoundarySet
from chuteflow.analysis.boundaries.tracing import TURNS
from chuteflow.analysis.results import KINDS
from chuteflow.paper import style
from chuteflow.steady.quantities import NUMBERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Labels of the parameters, and their symbols.
_LABELS = {
    "slope": r"slope, $\tan\theta$",
    "restitution": "restitution, $e$",
    "wall_restitution": "wall restitution, $e_w$",
    "roughness": "roughness, $r$",
}
#: Markers of turning points.
_MARKERS = {"cusp": "*", "birth": "o", "crossing": "X", "turn": "s"}


def plot_boundaries(found: BoundarySet, quantity: str = "mass_flux") -> Figure:
    """The ``quantity``, a number of the registry, of the flows on every boundary against the second parameter."""
    if not len(found):
        return style.sentence(f"No boundary: {found.reason}.")
    figure, (ax,) = style.panels(1, width=5.0, height=3.6)
    for i, boundary in enumerate(found):
        ax.plot(boundary.parameter, getattr(boundary, quantity), **style.stroke(i).line())
        for turn in boundary.special:
            x, y = getattr(turn.flow.chute, found.second), getattr(turn.flow, quantity)
            ax.plot([x], [y], **_marker(turn.kind, style.stroke(i).colour))
    style.spread_scale(ax, "y", [getattr(boundary, quantity) for boundary in found])
    style.name_axes(ax, _LABELS[found.second], style.label(quantity))
    style.caption(figure, f"{KINDS[found.kind]}\n{_others(found)}")
    style.legend(figure, handles=list(_key(found)), loc="outside lower center", ncols=2)
    return figure


def _others(found: BoundarySet) -> str:
    said = [
        rf"{label.split(', ')[1]} $= {getattr(found.chute, name):.4g}$"
        for name, label in _LABELS.items()
        if name != found.second
    ]
    return ", ".join([*said, {"free": "free surface", "interface": "interface"}[found.chute.surface]])


def _marker(kind: str, colour: str) -> dict[str, Any]:
    return {
        "marker": _MARKERS[kind],
        "markersize": 9.0 if kind == "cusp" else 5.0,
        "markerfacecolor": "white",
        "markeredgecolor": colour,
        "linestyle": "none",
        "zorder": 3,
    }


def _key(found: BoundarySet) -> Iterator[Any]:
    """Entries of the legend: the boundaries, and the kinds of turning points."""
    from matplotlib.lines import Line2D

    symbol = NUMBERS["surface_temperature"].latex
    for i, boundary in enumerate(found):
        low, high = boundary.surface_temperature.min(), boundary.surface_temperature.max()
        yield Line2D([], [], label=rf"${symbol}$ from {low:.3g} to {high:.3g}", **style.stroke(i).line())
    kinds = {turn.kind for boundary in found for turn in boundary.special}
    for kind in TURNS:
        if kind in kinds:
            yield Line2D([], [], label=f"{kind}: {TURNS[kind]}", **_marker(kind, style.BLACK))
