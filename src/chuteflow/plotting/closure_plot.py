"""Pictures of constitutive laws: their functions of the volume fraction, and the flows that they give."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chuteflow.branches.results import Curve, FlowSet
from chuteflow.io.contract import factor
from chuteflow.numerics.chebyshev import Array
from chuteflow.plotting import plots, style
from chuteflow.steady.quantities import Scales
from chuteflow.theory.constitutive import FUNCTIONS, Law

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Functions drawn, and how they are called there.
_DRAWN = {
    "radial": "$g_0$",
    "compressibility": r"$g_1/\nu$",
    "viscosity": "$g_2$",
    "conductivity": "$g_3$",
    "density_conductivity": "$g_4$",
    "dissipation": r"$g_5/\nu^2$",
    "bulk_viscosity": "$g_6$",
}
_FIELDS = ("volume_fraction", "granular_temperature", "velocity")
_POINTS = 301
#: Profiles are drawn up to so many times the largest centre of mass.
_TOP = 2.5


def functions(law: Law, nu: Array, e: float, slope: float) -> dict[str, Array]:
    """The functions of ``law`` at volume fractions ``nu`` (k,) below the densest, by the fields of Coefficients."""
    _, _, g = law.at(nu / (1.0 - nu / law.densest), e, slope)
    return {name: np.broadcast_to(getattr(g, name), nu.shape) for name in FUNCTIONS}


@style.own_settings()
def plot_laws(laws: Sequence[Law], e: float, slope: float) -> Figure:
    """g0 to g6 of ``laws`` against the volume fraction, at one restitution and slope; breaks are marked."""
    figure, axes = style.panels(4, 2, height=4.6)
    axes[-1].set_visible(False)
    handles = []
    for i, law in enumerate(laws):
        stroke = style.stroke(i)
        nu = np.linspace(0.002, min(0.97 * law.densest, 0.64), _POINTS)
        values = functions(law, nu, e, slope)
        breaks = np.array([b for b in law.breaks_at(e, slope) if b < nu[-1]])
        at_breaks = functions(law, breaks, e, slope) if breaks.size else {}
        for ax, name in zip(axes, _DRAWN, strict=False):
            (line,) = ax.plot(nu, values[name], label=str(law), **stroke.line())
            if ax is axes[0]:
                handles.append(line)
            if breaks.size:
                ax.plot(breaks, at_breaks[name], linestyle="none", marker="|", color=stroke.colour)
    for ax, (name, symbol) in zip(axes, _DRAWN.items(), strict=False):
        style.name_axes(ax, r"$\nu$", symbol)
        if name != "density_conductivity":
            ax.set_yscale("log")
    style.caption(figure, rf"$e = {e:g}$, $\tan\theta = {slope:g}$; ticks on a line: breaks of the law")
    style.legend(figure, handles=handles, loc="outside lower center")
    return figure


@style.own_settings()
def plot_comparison(found: Sequence[FlowSet], curves: Sequence[Curve], *, scales: Scales | None = None) -> Figure:
    """Q-h curves of one chute under several laws, and profiles of the flows at one flux, each law with its colour."""
    figure, axes = style.panels(4, height=3.6)
    top = _TOP * max((flow.centre_of_mass for flows in found for flow in flows), default=1.0)
    handles = []
    by = {name: factor(name, found[0].chute, scales) for name in ("mass_flux", "centre_of_mass", "height", *_FIELDS)}
    for i, (flows, curve) in enumerate(zip(found, curves, strict=True)):
        stroke = style.stroke(i).line()
        for branch in curve.branches:
            place = (by[name] * getattr(branch, name) for name in ("mass_flux", "centre_of_mass"))
            (line,) = axes[0].plot(*place, label=str(curve.chute.closure), **stroke)
            if branch is curve.branches[0]:
                handles.append(line)
        for flow in flows:
            profile = flow.sampled(_POINTS, min(top, flow.interface_height))
            for ax, field in zip(axes[1:], _FIELDS, strict=True):
                ax.plot(by[field] * getattr(profile, field), by["height"] * profile.height, **stroke)
    axes[0].set_xscale("log")
    axes[0].set_yscale("log")
    style.name_axes(axes[0], style.label("mass_flux", scales), style.label("centre_of_mass", scales))
    for ax, field in zip(axes[1:], _FIELDS, strict=True):
        style.name_axes(ax, style.label(field, scales), style.label("height", scales))
        ax.set_xlim(left=0.0)
        ax.set_ylim(0.0, by["height"] * top)
    style.caption(figure, plots.parameters(found[0].chute).rpartition(", closure")[0])
    style.legend(figure, handles=handles, loc="outside lower center", ncols=2)
    return figure
