"""Figure 8: centre of mass against mass flux with either surface condition."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chuteflow.paper.curves import Curves, draw_two, trace
from chuteflow.paper.figure_07 import LINES
from chuteflow.paper.flow_profiles import SLOPE
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Where the panel ends in Q and h.
RIGHT, TOP = 6.0, 15.0


def compute(source: Source = OVERBURDEN) -> Curves:
    """The two curves."""
    title = "Figure 8: centre of mass against mass flux, surface conditions compared"
    return trace(title, "surface", [dissipative(SLOPE, surface=surface) for surface in LINES], source)


def draw(data: Curves) -> Figure:
    """One panel."""
    return draw_two(data, LINES, RIGHT, TOP)
