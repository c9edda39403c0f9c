"""Figure 17: centre of mass against mass flux with either heat flux."""

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
    "lun": (style.LineStyle(style.BLUE, style.SOLID), "modified Fourier"),
    "lun-fourier": (style.LineStyle(style.VERMILION, style.DOTTED), r"reduced, $g_4 \equiv 0$"),
}
#: Where the panel ends in Q and h.
RIGHT, TOP = 6.0, 15.0


def compute(source: Source = OVERBURDEN) -> Curves:
    """The two curves."""
    title = "Figure 17: centre of mass against mass flux, forms of the heat flux compared"
    return trace(title, "closure", [dissipative(SLOPE, closure=closure) for closure in LINES], source)


def draw(data: Curves) -> Figure:
    """One panel."""
    return draw_two(data, LINES, RIGHT, TOP)
