"""Boundaries drawn over the second parameter, with their turning points and what lies between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.bifurcations.boundary import Boundary, BoundarySet
from chuteflow.bifurcations.diagram import CountedRegion, Diagram, KindsBeside
from chuteflow.bifurcations.tracing import TURNS
from chuteflow.branches.results import KINDS
from chuteflow.io.contract import factor
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import PARAMETERS
from chuteflow.plotting import style
from chuteflow.plotting.plots import parameters
from chuteflow.steady.quantities import NUMBERS, Scales

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Markers of turning points.
_MARKERS = {"cusp": "*", "birth": "o", "crossing": "X", "turn": "s"}
#: Kinds of flows are written so many points beside a boundary.
_BESIDE = 11.0
#: Entries of the legend that are longer stand below one another.
_LONG = 45
_LIMIT = style.LineStyle(style.GREY, style.DOTTED)


@style.own_settings()
def plot_boundaries(shown: Diagram, *, scales: Scales | None = None) -> Figure:
    """The boundaries of a diagram against the second parameter; numbers in SI units where ``scales`` are given.

    Where the quantity is the one that folds, a number in each region says how many flows share a value of it, in the
    range searched, whose edges are drawn too. Beside other boundaries stands the kind of the flows on either side.
    """
    found, quantity = shown.found, shown.quantity
    figure, (ax,) = style.panels(1, width=5.6, height=4.4)
    for i, boundary in enumerate(found):
        ax.plot(boundary.parameter, _along(boundary, quantity, scales), **style.stroke(i).line())
        for turn in boundary.special:
            x, y = getattr(turn.flow.chute, found.second), getattr(turn.flow, quantity)
            y *= factor(quantity, turn.flow.chute, scales)
            ax.plot([x], [y], **_marker(turn.kind, style.stroke(i).colour))
    if shown.frame.logarithmic:
        style.logarithmic(ax, "y")
    for edge in shown.edges:
        ax.plot(edge.parameter, _along(edge, quantity, scales), zorder=1, **_LIMIT.line(0.9))
    ends = [factor(quantity, replace(found.chute, **{found.second: x}), scales) for x in shown.frame.x]
    low, high = shown.frame.y
    ax.set(xlim=shown.frame.x, ylim=(low * min(ends), high * max(ends)))
    second = PARAMETERS[found.second]
    style.name_axes(ax, f"{second.noun}, ${second.latex}$", style.label(quantity, scales))
    style.caption(figure, f"{KINDS[found.kind]}\n{parameters(found.chute, found.second)}")
    key = list(_key(shown, scales))
    beside = all(len(entry.get_label()) < _LONG for entry in key)
    style.legend(figure, handles=key, loc="outside lower center", ncols=2 if beside else 1)
    figure.draw_without_rendering()  # which settles where points are
    for region in shown.regions:
        style.write(
            ax,
            region.parameter,
            _at(found, region, quantity, scales),
            str(region.flows),
            ha="center",
            va="center",
            fontsize=11.0,
            zorder=5,
        )
    for one in shown.sides:
        _name_sides(ax, one, quantity, scales)
    return figure


def _along(boundary: Boundary, quantity: str, scales: Scales | None) -> Array:
    """The quantity along a boundary, each flow by the scale of its own slope."""
    return np.array([getattr(flow, quantity) * factor(quantity, flow.chute, scales) for flow in boundary.flows])


def _at(found: BoundarySet, region: CountedRegion, quantity: str, scales: Scales | None) -> float:
    return region.value * factor(quantity, replace(found.chute, **{found.second: region.parameter}), scales)


@style.own_settings()
def plot_boundary(boundary: Boundary, quantity: str = "mass_flux", *, scales: Scales | None = None) -> Figure:
    """One boundary against the second parameter, with its turning points."""
    figure, (ax,) = style.panels(1, width=5.6, height=3.8)
    values = _along(boundary, quantity, scales)
    ax.plot(boundary.parameter, values, **style.stroke(0).line())
    for turn in boundary.special:
        y = getattr(turn.flow, quantity) * factor(quantity, turn.flow.chute, scales)
        x = getattr(turn.flow.chute, boundary.second)
        ax.plot([x], [y], label=f"{turn.kind}: {TURNS[turn.kind]}", **_marker(turn.kind, style.stroke(0).colour))
    style.spread_scale(ax, "y", [values])
    second = PARAMETERS[boundary.second]
    style.name_axes(ax, f"{second.noun}, ${second.latex}$", style.label(quantity, scales))
    style.caption(figure, f"{KINDS[boundary.kind]}\n{parameters(boundary.flows[0].chute, boundary.second)}")
    if boundary.special:
        style.legend(figure, handles=ax.get_lines()[1:], loc="outside lower center")
    return figure


def plot_none(found: BoundarySet) -> Figure:
    """Why there is no boundary."""
    return style.sentence(f"No boundary: {found.reason}.")


def _name_sides(ax: Axes, beside: KindsBeside, quantity: str, scales: Scales | None) -> None:
    """Write the kinds of flows to both sides of a boundary."""
    boundary, index = beside.boundary, beside.index
    values = _along(boundary, quantity, scales)
    places = ax.transData.transform(np.column_stack([boundary.parameter, values]))
    along = places[index + 1] - places[index - 1]
    across = np.array([along[1], -along[0]]) / np.hypot(*along)
    right = across if across[0] > 0.0 else -across
    for kind, aside in zip(beside.kinds, (-right, right), strict=True):
        style.write(
            ax,
            float(boundary.parameter[index]),
            float(values[index]),
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


def _key(shown: Diagram, scales: Scales | None) -> Iterator[Any]:
    """Entries of the legend: the boundaries, the kinds of turning points, and what numbers count."""
    from matplotlib.lines import Line2D

    found = shown.found
    symbol = NUMBERS["surface_temperature"].latex
    for i, boundary in enumerate(found):
        temperature = _along(boundary, "surface_temperature", scales)
        low, high = (f"${style.in_formula(f'{end:.3g}')}$" for end in (temperature.min(), temperature.max()))
        unit = style.unit("surface_temperature", scales)
        yield Line2D([], [], label=rf"${symbol}$ from {low} to {high}{unit}", **style.stroke(i).line())
    kinds = {turn.kind for boundary in found for turn in boundary.special}
    for kind in TURNS:
        if kind in kinds:
            yield Line2D([], [], label=f"{kind}: {TURNS[kind]}", **_marker(kind, style.BLACK))
    if shown.edges:
        yield Line2D([], [], label="edge of the range searched", **_LIMIT.line(0.9))
        counted = rf"numbers: flows of one ${NUMBERS[shown.quantity].latex}$"
        yield Line2D([], [], label=counted, linestyle="none")
