"""Figure 17: centre of mass against mass flux with either heat flux."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chuteflow.paper.curves import Curves, draw_two, trace
from chuteflow.paper.figure_15 import LINES
from chuteflow.paper.flow_profiles import SLOPE
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Where the panel ends in Q and h.
RIGHT, TOP = 6.0, 15.0


def compute(source: Source = OVERBURDEN) -> Curves:
    """The two curves."""
    title = "Figure 17: centre of mass against mass flux, forms of the heat flux compared"
    return trace(title, "closure", [dissipative(SLOPE, closure=closure) for closure in LINES], source)


def draw(data: Curves) -> Figure:
    """One panel."""
    return draw_two(data, LINES, RIGHT, TOP)
