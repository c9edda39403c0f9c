"""Figure 10: h ~ Q^2 on the high temperature branch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chuteflow.paper.curves import Curves, draw_plain, hot_end, trace
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SLOPES = (0.22, 0.24, 0.26, 0.28, 0.3)
#: The panel in Q and h, and the end of the line of slope 2.
WINDOW_Q, WINDOW_H = (1e-2, 1e2), (1e-1, 1e4)
LINE_Q, LINE_END = np.array([0.25, 1.0]), 7e3


def compute(source: Source = OVERBURDEN) -> Curves:
    """The curves of all slopes."""
    title = "Figure 10: centre of mass against mass flux, logarithmic"
    return trace(title, "slope", [dissipative(slope) for slope in SLOPES], source)


def draw(data: Curves) -> Figure:
    """One panel with logarithmic axes, and a dashed line of slope 2."""
    figure, (ax,) = style.panels(1, width=4.4, height=3.8)
    places = []
    for slope, found in data.curves.items():
        draw_plain(ax, found, style.LineStyle())
        places.append(hot_end(found.branches[0], 0.999 * WINDOW_H[1]))
        style.write(ax, places[-1], WINDOW_H[1], f"{slope:.2f}", xytext=(2.0, 3.0), rotation=60, rotation_mode="anchor")
    ax.plot(LINE_Q, LINE_END * LINE_Q**2, **style.LineStyle(style.VERMILION, style.DASHED).line())
    style.write(ax, LINE_Q[0], LINE_END * LINE_Q[0] ** 2, r"$h \sim Q^2$", xytext=(-4.0, 0.0), ha="right")
    style.write(ax, min(places), WINDOW_H[1], r"slope $\tan\theta$", xytext=(-8.0, 8.0), ha="right")
    style.name_axes(ax, style.label("mass_flux"), style.label("centre_of_mass"))
    style.logarithmic(ax, "x")
    style.logarithmic(ax, "y")
    ax.set(xlim=WINDOW_Q, ylim=WINDOW_H)
    return figure
