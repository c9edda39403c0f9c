"""Figure 15: the three flows at Q = 3 with the reduced heat flux, against those with the modified Fourier heat flux."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chuteflow.paper.flow_profiles import FIELDS, MASS_FLUX, SLOPE, FlowProfiles, flow_profiles
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The flows from hot to cold: the upper end of their panels, and the lower and upper ends of the fields.
FLOWS = {
    "high temperature": (30.0, ((0.0, 0.06), (6.0, 10.0), (0.0, 14.0))),
    "mid-temperature": (15.0, ((0.0, 0.15), (2.0, 4.0), (0.0, 10.0))),
    "low temperature": (6.0, ((0.0, 0.4), (0.0, 1.0), (0.0, 5.0))),
}
LINES = {
    "lun": (style.LineStyle(style.BLUE, style.SOLID), "modified Fourier"),
    "lun-fourier": (style.LineStyle(style.VERMILION, style.DOTTED), r"reduced, $g_4 \equiv 0$"),
}


def compute(source: Source = OVERBURDEN) -> FlowProfiles:
    """The three flows of each closure."""
    return flow_profiles(
        f"Figure 15: profiles of the flows with mass flux {MASS_FLUX}, forms of the heat flux compared",
        {name: top for name, (top, _) in FLOWS.items()},
        {closure: dissipative(SLOPE, closure=closure) for closure in LINES},
        source,
        compared="closure",
        note=lambda flow: f"T_inf = {flow.surface_temperature}, h = {flow.centre_of_mass}, M = {flow.mass_holdup}",
    )


def draw(data: FlowProfiles) -> Figure:
    """A row of three panels for each flow, from hot to cold."""
    figure, axes = style.panels(3, 3, height=6.6, shared_y=True)
    for row, (name, (top, ends)) in enumerate(FLOWS.items()):
        for column, field in enumerate(FIELDS):
            ax = axes[3 * row + column]
            for closure, (stroke, words) in LINES.items():
                profile = data.profiles[name, closure]
                ax.plot(getattr(profile, field), profile.height, label=words, **stroke.line())
            style.name_axes(
                ax, style.label(field) if row == 2 else None, style.label("height") if column == 0 else None
            )
            ax.set_xlim(*ends[column])
            ax.set_ylim(0.0, top)
        style.write(axes[3 * row], ends[0][1], top, name, ha="right", va="top")
    style.legend(axes[0], loc="upper right", bbox_to_anchor=(1.0, 0.92))
    return figure
