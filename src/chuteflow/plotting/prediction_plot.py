"""A prediction: the curve of h against Q, and profiles, with bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chuteflow.io.contract import factor
from chuteflow.plotting import style
from chuteflow.steady.quantities import Scales

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chuteflow.fitting.prediction import Prediction

_SHOWN = ("volume_fraction", "granular_temperature", "velocity")
_SHADE = 0.25


def plot_prediction(found: Prediction, scales: Scales | None = None) -> Figure:
    """First the curve with its band, folds and the requested flows, then profiles of these; in SI units where there are
    scales."""

    def by(name: str) -> float:
        return factor(name, found.calibration.chute, scales)

    figure, axes = style.panels(4, width=10.0, height=2.9)
    ax = axes[0]
    place = np.array([by("mass_flux"), by("centre_of_mass")])
    for band in found.bands:
        low, high = place * band.edge(-found.widths), place * band.edge(found.widths)
        ax.fill(
            np.concatenate([low[:, 0], high[::-1, 0]]), np.concatenate([low[:, 1], high[::-1, 1]]),
            color=style.BLUE, alpha=_SHADE, linewidth=0.0,
        )  # fmt: skip
        middle = place * np.exp(band.points)
        ax.plot(middle[:, 0], middle[:, 1], **style.LineStyle(style.BLUE).line())
    for fold in found.folds:
        if fold.kind == "fold-Q":
            spread = place[0] * fold.value * np.expm1(found.widths * fold.error * np.array([-1.0, 1.0]))
            ax.errorbar(
                *np.split(place * [fold.value, fold.flow.centre_of_mass], 2), xerr=np.abs(spread)[:, None], fmt="s",
                markersize=3.0, color=style.BLACK, elinewidth=0.9, capsize=2.0,
            )  # fmt: skip
    for i, one in enumerate(found.flows):
        at = place * (one.flow.mass_flux, one.flow.centre_of_mass)
        ax.plot(at[:1], at[1:], "o", markersize=4.0, color=style.stroke(i).colour)
    style.logarithmic(ax, "x")
    style.logarithmic(ax, "y")
    style.name_axes(ax, style.label("mass_flux", scales), style.label("centre_of_mass", scales))
    _around(ax, found, place)
    tops = [by("height") * one.flow.depth for one in found.flows]
    for name, panel in zip(_SHOWN, axes[1:], strict=True):
        for i, one in enumerate(found.flows):
            height, (value, error) = by("height") * one.height, (by(name) * values for values in one.profiles[name])
            stroke = style.stroke(i)
            width = found.widths * np.where(np.isfinite(error), error, 0.0)
            largest = found.calibration.chute.law.densest if name == "volume_fraction" else np.inf
            low, high = np.maximum(value - width, 0.0), np.minimum(value + width, largest)
            panel.fill_betweenx(height, low, high, color=stroke.colour, alpha=_SHADE, linewidth=0.0)
            panel.plot(value, height, **stroke.line())
        if tops and max(tops) > 6.0 * min(tops):
            panel.set_yscale("symlog", linthresh=min(tops))
        style.name_axes(panel, style.label(name, scales), style.label("height", scales))
    style.caption(figure, f"bands of {found.confidence:.0%} confidence, to first order in the errors of the parameters")
    return figure


def _around(ax: Axes, found: Prediction, place: np.ndarray) -> None:
    """The part of the curve about the flows and folds, two decades wide."""
    marked = [one.flow for one in found.flows] + [fold.flow for fold in found.folds if fold.kind == "fold-Q"]
    if not marked:
        return
    q, h = (place * [(flow.mass_flux, flow.centre_of_mass) for flow in marked]).T
    ax.set_xlim(q.min() / 5.0, q.max() * 5.0)
    ax.set_ylim(h.min() / 3.0, h.max() * 3.0)
