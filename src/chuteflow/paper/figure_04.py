"""Figure 4: centre of mass against mass flux for slopes from 0.22 to 0.36.

More is found than the paper says. On slopes from about 0.3365 on, the branch that runs to large mass flux as the
temperature falls is not all: below a surface temperature of 0.02 there is a second branch of dense flows, which come
at mass fluxes below the minimum of the first as well. It is drawn, and named, for tan(theta) = 0.34.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from chuteflow.paper import slopes
from chuteflow.paper.curves import Curves
from chuteflow.paper.sources import OVERBURDEN, Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def compute(source: Source = OVERBURDEN) -> Curves:
    """The curves on the half-line."""
    return slopes.compute("Figure 4: centre of mass against mass flux over slopes", "free", source)


def draw(data: Curves) -> Figure:
    """Two panels, solid lines for density inversions."""
    return slopes.draw(data)
