"""Figure 7: volume fraction of the flows at Q = 3 with either surface condition."""

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
POINTS = 401
#: The flows from hot to cold, with the right and upper end of their panels.
FLOWS = {"high temperature": (0.06, 30.0), "mid-temperature": (0.2, 15.0), "low temperature": (0.4, 6.0)}
LINES = {
    "free": (style.LineStyle(style.BLUE, style.SOLID), "asymptotic conditions"),
    "interface": (style.LineStyle(style.VERMILION, style.DASHED), "interface conditions"),
}


@dataclass(frozen=True, eq=False)
class Figure7:
    """Flows and profiles by temperature and surface condition."""

    flows: dict[tuple[str, str], SteadyFlow]
    profiles: dict[tuple[str, str], Profile]

    def table(self) -> FigureTable:
        """The profiles, one below the other, up to the interface where there is one."""
        notes = [
            f"{name}, {surface}: Q = {flow.mass_flux}, h = {flow.centre_of_mass}, M = {flow.mass_holdup}, "
            f"H = {flow.interface_height}, surface temperature {flow.surface_temperature}"
            for (name, surface), flow in self.flows.items()
        ]
        columns = stacked(
            "flow",
            {
                key: {field: getattr(profile, field) for field in ("height", "volume_fraction")}
                for key, profile in self.profiles.items()
            },
        )
        keys = columns.pop("flow")
        named = {"flow": [name for name, _ in keys], "surface": [surface for _, surface in keys]}
        title = f"Figure 7: volume fraction of the flows with mass flux {MASS_FLUX}, surface conditions compared"
        chutes = (chute_note(dissipative(SLOPE, surface)) for surface in LINES)
        return FigureTable(title, (*chutes, *notes), named | columns)


def compute(source: Source = OVERBURDEN) -> Figure7:
    """The three flows of each surface condition."""
    found = {
        (name, surface): flow
        for surface in LINES
        for name, flow in zip(FLOWS, source.flows(dissipative(SLOPE, surface), Q=MASS_FLUX), strict=True)
    }
    profiles = {
        (name, surface): flow.profile(np.linspace(0.0, min(flow.interface_height, FLOWS[name][1]), POINTS))
        for (name, surface), flow in found.items()
    }
    return Figure7(found, profiles)


def draw(data: Figure7) -> Figure:
    """One panel for each flow; a dot ends a profile at its interface."""
    figure, axes = style.panels(3, height=2.9)
    for ax, (name, (right, top)) in zip(axes, FLOWS.items(), strict=True):
        for surface, (stroke, words) in LINES.items():
            profile = data.profiles[name, surface]
            ax.plot(profile.volume_fraction, profile.height, label=words, **stroke.line())
            if np.isfinite(data.flows[name, surface].interface_height):
                ax.plot(
                    profile.volume_fraction[-1:], profile.height[-1:], marker="o", markersize=3.5, color=stroke.colour
                )
        style.write(ax, right, top, name, ha="right", va="top")
        style.name_axes(ax, style.label("volume_fraction"), style.label("height") if ax is axes[0] else None)
        ax.set_xlim(0.0, right)
        ax.set_ylim(0.0, top)
    style.legend(axes[0], loc="upper right", bbox_to_anchor=(1.0, 0.92))
    return figure
