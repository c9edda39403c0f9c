"""Figure 8: centre of mass against mass flux with either surface condition."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chuteflow.paper.curves import Curves, draw_two, trace
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SLOPE = 0.3
#: Strokes and words of the two curves.
LINES = {
    "free": (style.LineStyle(style.BLUE, style.SOLID), "asymptotic conditions"),
    "interface": (style.LineStyle(style.VERMILION, style.DASHED), "interface conditions"),
}
#: Where the panel ends in Q and h.
RIGHT, TOP = 6.0, 15.0


def compute(source: Source = OVERBURDEN) -> Curves:
    """The two curves."""
    title = "Figure 8: centre of mass against mass flux, surface conditions compared"
    return trace(title, "surface", [dissipative(SLOPE, surface=surface) for surface in LINES], source)


def draw(data: Curves) -> Figure:
    """One panel."""
    return draw_two(data, LINES, RIGHT, TOP)
