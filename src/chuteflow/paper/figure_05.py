"""Figure 5: volume fraction, granular temperature and velocity of a productive flow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chuteflow import QUANTITIES, Profile
from chuteflow.branches.lines import SteadyFlow
from chuteflow.paper.data import FigureTable, chute_note
from chuteflow.paper.materials import productive
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MASS_FLUX = 3.0
SLOPE = 0.4
#: Highest point drawn, in grain diameters, and ends of the panels.
TOP = 250.0
POINTS = 1001
FIELDS = ("volume_fraction", "granular_temperature", "velocity")
LIMITS = ((0.0, 0.01), (33.5, 36.0), (0.0, 15.0))


@dataclass(frozen=True, eq=False)
class Figure5:
    """The flow, its profile, and its largest temperature with the height where it is."""

    flow: SteadyFlow
    profile: Profile
    largest_temperature: float
    height_of_largest: float

    def table(self) -> FigureTable:
        """The profile."""
        notes = (
            chute_note(self.flow.chute),
            f"T_surface = {self.flow.surface_temperature}, h = {self.flow.centre_of_mass}, "
            f"M = {self.flow.mass_holdup}, estimated relative error {self.flow.error}",
            f"largest temperature {self.largest_temperature} at the height {self.height_of_largest}",
        )
        columns = {name: getattr(self.profile, name).tolist() for name in ("height", *FIELDS)}
        return FigureTable(f"Figure 5: profiles of the productive flow with mass flux {MASS_FLUX}", notes, columns)


def compute(source: Source = OVERBURDEN) -> Figure5:
    """The one flow and its profile."""
    (flow,) = source.flows(productive(SLOPE), Q=MASS_FLUX)
    profile = flow.profile(np.linspace(0.0, TOP, POINTS))
    hottest = int(np.argmax(profile.granular_temperature))
    below, above = profile.height[max(hottest - 1, 0)], profile.height[min(hottest + 1, POINTS - 1)]
    around = flow.profile(np.linspace(below, above, 2001))
    hottest = int(np.argmax(around.granular_temperature))
    return Figure5(flow, profile, float(around.granular_temperature[hottest]), float(around.height[hottest]))


def draw(data: Figure5) -> Figure:
    """Three panels, height upwards; the maximum of the temperature enlarged."""
    figure, axes = style.panels(3, shared_y=True)
    for ax, field, limits in zip(axes, FIELDS, LIMITS, strict=True):
        ax.plot(getattr(data.profile, field), data.profile.height, **style.LineStyle().line())
        style.name_axes(ax, style.label(field), style.label("height") if ax is axes[0] else None)
        ax.set_xlim(*limits)
        ax.set_ylim(0.0, TOP)
    axes[0].set_xticks([0.0, 0.005, 0.01], ["0", "0.005", "0.01"])
    far = data.flow.surface_temperature
    excess = data.largest_temperature - far
    small = style.inset(axes[1], (0.2, 0.3, 0.42, 0.55))
    small.plot((data.profile.granular_temperature - far) / excess, data.profile.height, **style.LineStyle().line())
    small.axvline(0.0, **style.LineStyle(style.GREY, style.DASHED).line(0.8))
    small.plot([1.0], [data.height_of_largest], marker="o", markersize=3.0, color=style.BLACK)
    small.set(xlim=(-1.5, 1.5), ylim=(0.0, TOP), xticks=[0.0, 1.0], yticks=[0.0, TOP])
    small.set_xticklabels(["0", f"{1e4 * excess:.1f}"])
    style.name_axes(small, rf"$10^4\,(T - {QUANTITIES['surface_temperature'].latex})$", None)
    return figure
