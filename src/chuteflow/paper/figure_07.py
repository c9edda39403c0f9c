"""Figure 7: volume fraction of the flows at Q = 3 with either surface condition."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chuteflow.paper.flow_profiles import MASS_FLUX, SLOPE, FlowProfiles, flow_profiles
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The flows from hot to cold, with the right and upper end of their panels.
FLOWS = {"high temperature": (0.06, 30.0), "mid-temperature": (0.2, 15.0), "low temperature": (0.4, 6.0)}
LINES = {
    "free": (style.LineStyle(style.BLUE, style.SOLID), "asymptotic conditions"),
    "interface": (style.LineStyle(style.VERMILION, style.DASHED), "interface conditions"),
}


def compute(source: Source = OVERBURDEN) -> FlowProfiles:
    """The three flows of each surface condition, up to the interface where there is one."""
    return flow_profiles(
        f"Figure 7: volume fraction of the flows with mass flux {MASS_FLUX}, surface conditions compared",
        {name: top for name, (_, top) in FLOWS.items()},
        {surface: dissipative(SLOPE, surface) for surface in LINES},
        source,
        compared="surface",
        fields=("volume_fraction",),
        note=lambda flow: (
            f"Q = {flow.mass_flux}, h = {flow.centre_of_mass}, M = {flow.mass_holdup}, H = {flow.interface_height}, "
            f"surface temperature {flow.surface_temperature}"
        ),
    )


def draw(data: FlowProfiles) -> Figure:
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
