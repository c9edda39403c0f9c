"""Figure 2: volume fraction, granular temperature and velocity of the three flows at Q = 3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chuteflow import Profile
from chuteflow.branches.lines import SteadyFlow
from chuteflow.paper.data import FigureTable, chute_note, stacked
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MASS_FLUX = 3.0
SLOPE = 0.3
#: Highest point drawn, in grain diameters.
TOP = 20.0
POINTS = 401
FIELDS = ("volume_fraction", "granular_temperature", "velocity")
#: The flows from hot to cold: how the caption calls and draws them.
WORDS = {"A": "high temperature, dilute", "B": "mid-temperature", "C": "low temperature, dense"}
STROKES = {
    "A": style.LineStyle(style.VERMILION, style.SOLID),
    "B": style.LineStyle(style.GREEN, style.DOTTED),
    "C": style.LineStyle(style.BLUE, style.DASHED),
}
#: Right ends of the panels.
RIGHT = (0.4, 10.0, 10.0)


@dataclass(frozen=True, eq=False)
class Figure2:
    """The flows by name, and their profiles on common heights."""

    flows: dict[str, SteadyFlow]
    profiles: dict[str, Profile]

    def table(self) -> FigureTable:
        """The profiles, one below the other."""
        notes = [
            f"{name}: T_surface = {flow.surface_temperature}, h = {flow.centre_of_mass}, "
            f"M = {flow.mass_holdup}, estimated relative error {flow.error}"
            for name, flow in self.flows.items()
        ]
        columns = stacked(
            "flow",
            {
                name: {field: getattr(profile, field) for field in ("height", *FIELDS)}
                for name, profile in self.profiles.items()
            },
        )
        title = f"Figure 2: profiles of the flows with mass flux {MASS_FLUX}"
        return FigureTable(title, (chute_note(dissipative(SLOPE)), *notes), columns)


def compute(source: Source = OVERBURDEN) -> Figure2:
    """The three flows and their profiles."""
    found = dict(zip(STROKES, source.flows(dissipative(SLOPE), Q=MASS_FLUX), strict=True))
    z = np.linspace(0.0, TOP, POINTS)
    return Figure2(found, {name: flow.profile(z) for name, flow in found.items()})


def draw(data: Figure2) -> Figure:
    """Three panels, height upwards."""
    figure, axes = style.panels(3, shared_y=True)
    for ax, field, right in zip(axes, FIELDS, RIGHT, strict=True):
        for name, profile in data.profiles.items():
            ax.plot(
                getattr(profile, field),
                profile.height,
                label=f"{name}: {WORDS[name]}",
                **STROKES[name].line(),
            )
        style.name_axes(ax, style.label(field), style.label("height") if ax is axes[0] else None)
        ax.set_xlim(0.0, right)
        ax.set_ylim(0.0, TOP)
    axes[0].set_yticks(np.arange(0.0, TOP + 1.0, 5.0))
    style.legend(axes[0], loc="upper right")
    return figure
