"""Figures 4 and 9: Q-h curves over slopes, with either surface condition."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chuteflow.branches.lines import SteadyBranch
from chuteflow.paper.curves import Curves, draw_densities, frame, name_slopes, trace
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Slopes, and where the panels end in Q and h.
PANELS = (
    ((0.22, 0.24, 0.26, 0.28, 0.29, 0.3), 6.0, 15.0),
    ((0.3, 0.31, 0.32, 0.33, 0.34, 0.35, 0.36), 60.0, 40.0),
)


def compute(title: str, surface: str, source: Source) -> Curves:
    """The curves of all slopes."""
    slopes = sorted({slope for slopes, _, _ in PANELS for slope in slopes})
    return trace(title, "slope", [dissipative(slope, surface) for slope in slopes], source)


def draw(data: Curves) -> Figure:
    """Two panels, gentle and steep, each slope named where its curve leaves the panel."""
    figure, axes = style.panels(2, height=3.6)
    for ax, (slopes, right, top) in zip(axes, PANELS, strict=True):
        for slope in slopes:
            draw_densities(ax, data.curves[slope])
            for branch in data.curves[slope].branches[1:]:
                _name_cold_branch(ax, slope, branch, right, top)
        frame(ax, right, top)
        name_slopes(ax, data, slopes, right, top)
    for density, words in (("inverted", "density inversion"), ("monotonic", "monotonic density")):
        axes[0].plot([], [], label=words, **style.LineStyle(style.BLACK, style.OF_DENSITY[density]).line())
    style.legend(axes[0], loc="center right")
    return figure


def _name_cold_branch(ax: Axes, slope: float, branch: SteadyBranch, right: float, top: float) -> None:
    flow = min(branch.flows, key=lambda flow: abs(flow.mass_flux - 0.8 * right))
    words = f"{slope:.2f}, a second branch, surface $T \\leq {branch.surface_temperature.max():.2g}$"
    arrow = {"arrowstyle": "-", "linewidth": 0.6, "shrinkB": 0.0}
    style.write(
        ax,
        flow.mass_flux,
        flow.centre_of_mass,
        words,
        xytext=(0.97 * right, 0.05 * top),
        textcoords="data",
        ha="right",
        arrowprops=arrow,
    )
