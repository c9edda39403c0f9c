"""Figure 9: centre of mass against mass flux for slopes from 0.22 to 0.36, with interface conditions.

The paper has no density inversions at tan(theta) = 0.29 here. With the interface stress sqrt(pi)/48 there are some, at
interface temperatures from 0.22 to 0.54, and the curve at 0.29 has a solid piece, as in figure 4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from chuteflow.paper import slopes
from chuteflow.paper.curves import Curves
from chuteflow.paper.sources import OVERBURDEN, Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def compute(source: Source = OVERBURDEN) -> Curves:
    """The curves of the collisional layer below the interface."""
    return slopes.compute("Figure 9: as figure 4 with interface conditions", "interface", source)


def draw(data: Curves) -> Figure:
    """Two panels, solid lines for density inversions."""
    return slopes.draw(data)
