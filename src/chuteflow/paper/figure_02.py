"""Figure 2: volume fraction, granular temperature and velocity of the three flows at Q = 3."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chuteflow.paper.flow_profiles import FIELDS, MASS_FLUX, SLOPE, FlowProfiles, flow_profiles
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Highest point drawn, in grain diameters.
TOP = 20.0
#: The flows from hot to cold: how the caption calls and draws them.
WORDS = {"A": "high temperature, dilute", "B": "mid-temperature", "C": "low temperature, dense"}
STROKES = {
    "A": style.LineStyle(style.VERMILION, style.SOLID),
    "B": style.LineStyle(style.GREEN, style.DOTTED),
    "C": style.LineStyle(style.BLUE, style.DASHED),
}
#: Right ends of the panels.
RIGHT = (0.4, 10.0, 10.0)


def compute(source: Source = OVERBURDEN) -> FlowProfiles:
    """The three flows and their profiles on common heights."""
    return flow_profiles(
        f"Figure 2: profiles of the flows with mass flux {MASS_FLUX}",
        dict.fromkeys(STROKES, TOP),
        dissipative(SLOPE),
        source,
        note=lambda flow: (
            f"T_surface = {flow.surface_temperature}, h = {flow.centre_of_mass}, M = {flow.mass_holdup}, "
            f"estimated relative error {flow.error}"
        ),
    )


def draw(data: FlowProfiles) -> Figure:
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
