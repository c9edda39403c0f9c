"""g1 and g2 as they were measured without a model, beside a law."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.fitting.direct import DirectMeasurement


def plot_direct(found: Sequence[DirectMeasurement]) -> Figure:
    """g1/nu and g2 against nu: points with errors, and the law as a line."""
    figure, axes = style.panels(2, width=6.6)
    for i, one in enumerate(found):
        stroke = style.stroke(i)
        order = np.argsort(one.nu)
        for ax, measured, scale in zip(axes, (one.g1, one.g2), (one.nu, np.ones_like(one.nu)), strict=True):
            if measured is None:
                continue
            kept = np.isfinite(measured.value) & (measured.value > 0.0)
            ax.errorbar(
                one.nu[kept], (measured.value / scale)[kept], yerr=(measured.error / scale)[kept], fmt="o",
                markersize=2.8, color=stroke.colour, elinewidth=0.7, label=one.name,
            )  # fmt: skip
            ax.plot(one.nu[order], (measured.law / scale)[order], **stroke.line())
    for ax, name in zip(axes, (r"$g_1/\nu$", "$g_2$"), strict=True):
        style.logarithmic(ax, "y")
        style.name_axes(ax, style.label("volume_fraction"), name)
    if len(found) > 1:
        style.legend(axes[0])
    style.caption(figure, f"points: measured without a model; lines: {found[0].closure}")
    return figure
