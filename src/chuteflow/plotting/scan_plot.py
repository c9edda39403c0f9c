"""Pictures of flows at several values of a quantity, and of small studies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.branches.results import FlowSets
from chuteflow.errors import InputError
from chuteflow.io.contract import factor
from chuteflow.parameters import BY_KEY, CONDITIONS
from chuteflow.plotting import style
from chuteflow.plotting.plots import parameters
from chuteflow.steady.quantities import NUMBERS, Scales
from chuteflow.sweeps.scan import Scan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Flows are drawn as points of this size.
_SIZE = 3.5


@style.own_settings()
def plot_sets(found: FlowSets, quantity: str = "centre_of_mass", *, scales: Scales | None = None) -> Figure:
    """A number of every flow against the values that were requested, the kinds of density apart."""
    _require(quantity)
    figure, (ax,) = style.panels(1, width=4.6, height=3.4)
    asked = CONDITIONS[found.quantity].quantity
    by, across = factor(quantity, found.chute, scales), factor(asked, found.chute, scales)
    flows = [(value, flow) for value, one in zip(found.values, found.sets, strict=True) for flow in one]
    for i, density in enumerate(style.OF_DENSITY):
        shown = [(across * v, by * getattr(f, quantity)) for v, f in flows if f.density == density]
        if shown:
            marks = {"linestyle": "none", "marker": "os"[i], "markersize": _SIZE}
            ax.plot(*zip(*shown, strict=True), label=f"density {density}", color=style.stroke(i).colour, **marks)
    style.spread_scale(ax, "x", [[across * v for v, _ in flows]])
    style.spread_scale(ax, "y", [[by * getattr(f, quantity) for _, f in flows]])
    style.name_axes(ax, style.label(asked, scales), style.label(quantity, scales))
    style.caption(figure, parameters(found.chute))
    if flows:
        style.legend(figure, loc="outside lower center", ncols=2)
    return figure


@style.own_settings()
def plot_scan(found: Scan, quantity: str | None = None, *, scales: Scales | None = None) -> Figure:
    """A number of every flow against the one axis of a study; over two axes the number of flows, or a number of the
    hottest flow.

    Raises:
        InputError: for a study of more axes, or a number that it does not have.
    """
    if quantity is not None and quantity not in found.quantities:
        raise InputError(f"unknown quantity {quantity!r}: the study has {', '.join(found.quantities)}")
    if len(found.axes) == 1:
        return _over_one(found, quantity or _telling(found), scales)
    if len(found.axes) == 2:
        return _over_two(found, quantity, scales)
    raise InputError(f"a study over {len(found.axes)} axes has no picture: fix all but two, or take it as a table")


def _telling(found: Scan) -> str:
    """A number that is not the condition itself."""
    asked = {CONDITIONS[name].quantity for name in (*found.axes, *found.fixed) if name in CONDITIONS}
    return next((name for name in found.quantities if name not in asked), next(iter(found.quantities)))


def _over_one(found: Scan, quantity: str, scales: Scales | None) -> Figure:
    figure, (ax,) = style.panels(1, width=4.6, height=3.4)
    ((name, values),) = found.axes.items()
    drawn = found.quantities[quantity] * _by(found, quantity, scales)
    values, across_label = _axis(found, name, values, scales)
    for i in range(drawn.shape[1]):
        if np.isfinite(drawn[:, i]).any():
            marks = {"linestyle": "none", "marker": "o", "markersize": _SIZE}
            ax.plot(values, drawn[:, i], color=style.stroke(i).colour, label=f"flow {i + 1}", **marks)
    style.spread_scale(ax, "x", [values])
    style.spread_scale(ax, "y", [drawn[np.isfinite(drawn)]])
    style.name_axes(ax, across_label, style.label(quantity, scales))
    style.legend(figure, loc="outside lower center", ncols=4)
    return figure


def _over_two(found: Scan, quantity: str | None, scales: Scales | None) -> Figure:
    from matplotlib.ticker import MaxNLocator

    figure, (ax,) = style.panels(1, width=5.0, height=3.8)
    up, across = (_axis(found, name, values, scales) for name, values in found.axes.items())
    if quantity is None:
        values, label = found.count.astype(float), "number of flows"
    else:
        values = found.quantities[quantity][..., 0] * _by(found, quantity, scales)[..., 0]
        label = f"{style.label(quantity, scales)} of the hottest flow"
    # Where a point failed nothing is known.
    shown = np.ma.masked_invalid(np.where(found.status <= 1, values, np.nan))
    for axis, (one, _) in (("x", across), ("y", up)):
        style.spread_scale(ax, axis, [one])
    edges = (_edges(across[0], ax.get_xscale() == "log"), _edges(up[0], ax.get_yscale() == "log"))
    shades = ax.pcolormesh(*edges, shown, cmap="viridis", **(_counts(shown) if quantity is None else {}))
    bar = figure.colorbar(shades, ax=ax, pad=0.02)
    if quantity is None:
        bar.ax.yaxis.set_major_locator(MaxNLocator(integer=True))
        bar.ax.minorticks_off()
    bar.set_label(label, fontsize=8.5, fontfamily="STIXGeneral", math_fontfamily="stix")
    bar.ax.tick_params(labelsize=7.5, width=0.6, length=3.0, labelfontfamily="STIXGeneral")
    style.name_axes(ax, across[1], up[1])
    return figure


def _counts(shown: np.ma.MaskedArray) -> dict[str, Any]:
    """Settings of the shades of whole numbers: one for each."""
    from matplotlib.colors import BoundaryNorm

    counts = np.asarray(shown.compressed())
    low, high = (int(counts.min()), int(counts.max())) if counts.size else (0, 1)
    return {"norm": BoundaryNorm(np.arange(low, high + 2) - 0.5, 256)}


def _edges(centres: np.ndarray, logarithmic: bool) -> np.ndarray:
    """The edges of cells around ``centres``, halfway between them as the axis shows it."""
    if len(centres) == 1:
        return centres[0] * np.array([0.9, 1.1])
    places = np.log(centres) if logarithmic else centres
    inner = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2.0 * places[0] - inner[0]], inner, [2.0 * places[-1] - inner[-1]]])
    return np.exp(edges) if logarithmic else edges


def _by(found: Scan, quantity: str, scales: Scales | None) -> np.ndarray:
    if scales is None:
        return np.ones((*(1 for _ in found.axes), 1))
    by = found.over_slopes(lambda slope: scales.factor(quantity, slope))
    return by if by.ndim else by.reshape((*(1 for _ in found.axes), 1))


def _axis(found: Scan, name: str, values: np.ndarray, scales: Scales | None) -> tuple[np.ndarray, str]:
    """The values of an axis and its label; in SI units where the chutes have one slope, which the scales need."""
    if name in BY_KEY:
        return values, f"{BY_KEY[name].noun}, ${BY_KEY[name].latex}$"
    quantity = CONDITIONS[name].quantity
    if scales is None:
        return values, style.label(quantity)
    if "slope" in found.axes:
        return values, f"{style.label(quantity)} (dimensionless)"
    return values * scales.factor(quantity, float(found.fixed["slope"])), style.label(quantity, scales)


def _require(quantity: str) -> None:
    if quantity not in NUMBERS:
        raise InputError(f"unknown quantity {quantity!r}: choose from {', '.join(NUMBERS)}")
