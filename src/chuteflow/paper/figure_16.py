"""Figure 16: the parts of the heat flux in the three flows at Q = 3.

Drawn are the terms of the caption, g3 T^(1/2) dT/dz and g4 T^(3/2) dnu/dz: the upward heat flux is the second less the
first. Far above the two become equal, so that the first dominates where the heat flux is large, and not everywhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chuteflow.paper.flow_profiles import MASS_FLUX, SLOPE, FlowProfiles, flow_profiles
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The flows from hot to cold: upper end of their panels.
FLOWS = {"high temperature": 30.0, "mid-temperature": 15.0, "low temperature": 6.0}
#: Parts of the upward heat flux, with the signs by which they become the terms of the caption.
LINES = {
    "conductive_heat_flux": (
        -1.0,
        style.LineStyle(style.BLUE, style.SOLID),
        r"$g_3\,T^{1/2}\,\mathrm{d}T/\mathrm{d}z$",
    ),
    "density_heat_flux": (
        1.0,
        style.LineStyle(style.VERMILION, style.DASHED),
        r"$g_4\,T^{3/2}\,\mathrm{d}\nu/\mathrm{d}z$",
    ),
}


def compute(source: Source = OVERBURDEN) -> FlowProfiles:
    """The three flows, the upward heat flux and its parts, the conductive one with the other sign than drawn."""
    title = f"Figure 16: upward heat flux and its parts in the flows with mass flux {MASS_FLUX}"
    return flow_profiles(title, FLOWS, dissipative(SLOPE), source, fields=(*LINES, "heat_flux"))


def draw(data: FlowProfiles) -> Figure:
    """One panel for each flow, height upwards."""
    figure, axes = style.panels(3, height=2.9)
    for ax, (name, top) in zip(axes, FLOWS.items(), strict=True):
        profile = data.profiles[name]
        ax.axvline(0.0, color=style.GREY, linewidth=0.6)
        for part, (sign, stroke, words) in LINES.items():
            ax.plot(sign * getattr(profile, part), profile.height, label=words, **stroke.line())
        left = -float(np.abs(profile.conductive_heat_flux).max())
        style.write(ax, 1.05 * left, top, name, va="top")
        style.name_axes(ax, "terms of the heat flux", style.label("height") if ax is axes[0] else None)
        ax.set_xlim(1.08 * left, -0.25 * left)
        ax.set_ylim(0.0, top)
    style.legend(axes[0], loc="center left", bbox_to_anchor=(0.0, 0.75))
    return figure
