"""A prediction: the curve of h against Q, and profiles, with bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chuteflow.plotting import style
from chuteflow.steady.quantities import FIELDS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chuteflow.fitting.prediction import Prediction

_SHOWN = ("volume_fraction", "granular_temperature", "velocity")
_SHADE = 0.25


def plot_prediction(found: Prediction) -> Figure:
    """First the curve with its band, folds and the requested flows, then profiles of these."""
    figure, axes = style.panels(4, width=10.0, height=2.9)
    ax = axes[0]
    for band in found.bands:
        low, high = band.edge(-found.widths), band.edge(found.widths)
        ax.fill(
            np.concatenate([low[:, 0], high[::-1, 0]]), np.concatenate([low[:, 1], high[::-1, 1]]),
            color=style.BLUE, alpha=_SHADE, linewidth=0.0,
        )  # fmt: skip
        middle = np.exp(band.points)
        ax.plot(middle[:, 0], middle[:, 1], **style.LineStyle(style.BLUE).line())
    for fold in found.folds:
        if fold.kind == "fold-Q":
            spread = fold.value * np.expm1(found.widths * fold.error * np.array([-1.0, 1.0]))
            ax.errorbar(
                [fold.value], [fold.flow.centre_of_mass], xerr=np.abs(spread)[:, None], fmt="s", markersize=3.0,
                color=style.BLACK, elinewidth=0.9, capsize=2.0,
            )  # fmt: skip
    for i, one in enumerate(found.flows):
        ax.plot([one.flow.mass_flux], [one.flow.centre_of_mass], "o", markersize=4.0, color=style.stroke(i).colour)
    style.logarithmic(ax, "x")
    style.logarithmic(ax, "y")
    style.name_axes(ax, style.label("mass_flux"), style.label("centre_of_mass"))
    _around(ax, found)
    tops = [one.flow.depth for one in found.flows]
    for name, panel in zip(_SHOWN, axes[1:], strict=True):
        for i, one in enumerate(found.flows):
            value, error = one.profiles[name]
            stroke = style.stroke(i)
            width = found.widths * np.where(np.isfinite(error), error, 0.0)
            largest = found.calibration.chute.law.densest if name == "volume_fraction" else np.inf
            low, high = np.maximum(value - width, 0.0), np.minimum(value + width, largest)
            panel.fill_betweenx(one.height, low, high, color=stroke.colour, alpha=_SHADE, linewidth=0.0)
            panel.plot(value, one.height, **stroke.line())
        if tops and max(tops) > 6.0 * min(tops):
            panel.set_yscale("symlog", linthresh=min(tops))
        quantity = FIELDS[name]
        style.name_axes(panel, f"{name.replace('_', ' ')}, ${quantity.latex}$", style.label("height"))
    style.caption(figure, f"bands of {found.confidence:.0%} confidence, to first order in the errors of the parameters")
    return figure


def _around(ax: Axes, found: Prediction) -> None:
    """The part of the curve about the flows and folds, two decades wide."""
    marked = [one.flow for one in found.flows] + [fold.flow for fold in found.folds if fold.kind == "fold-Q"]
    if not marked:
        return
    q, h = np.array([(flow.mass_flux, flow.centre_of_mass) for flow in marked]).T
    ax.set_xlim(q.min() / 5.0, q.max() * 5.0)
    ax.set_ylim(h.min() / 3.0, h.max() * 3.0)
