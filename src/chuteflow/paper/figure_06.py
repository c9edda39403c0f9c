"""Figure 6: centre of mass against mass flux of productive flows, one to one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chuteflow.paper.curves import Curves, draw_densities, frame, name_slopes, trace
from chuteflow.paper.materials import productive
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SLOPES = (0.4, 0.41, 0.42, 0.43, 0.44)
#: Where the panel ends in Q and h.
RIGHT, TOP = 4.0, 40.0


def compute(source: Source = OVERBURDEN) -> Curves:
    """The curves of all slopes."""
    title = "Figure 6: centre of mass against mass flux of productive flows"
    return trace(title, "slope", [productive(slope) for slope in SLOPES], source)


def draw(data: Curves) -> Figure:
    """One panel, dashed since the density is monotonic throughout."""
    figure, (ax,) = style.panels(1, width=3.8, height=3.2)
    for found in data.curves.values():
        draw_densities(ax, found)
    frame(ax, RIGHT, TOP)
    name_slopes(ax, data, SLOPES, RIGHT, TOP)
    ax.plot([], [], label="monotonic density", **style.LineStyle(style.BLACK, style.OF_DENSITY["monotonic"]).line())
    style.legend(ax, loc="lower right")
    return figure
