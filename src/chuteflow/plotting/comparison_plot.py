"""A measured flow and flows of the theory: profiles over profiles, and measured functions over those of each law."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chuteflow.dem.comparison import COMPARED, FUNCTIONS, Comparison
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FIELDS = {
    "volume_fraction": r"volume fraction, $\nu$",
    "granular_temperature": "granular temperature, $T$",
    "velocity": "velocity, $u$",
}
_RATIOS = {
    "g1": r"$P_{zz}/(g_1 T)$",
    "g2": r"$-P_{xz}/(g_2\sqrt{T}\,u')$",
    "g5": r"$\gamma/(g_5 T^{3/2})$",
}
#: Measured layers are shown with this fraction of the mass above them, or more, and with this part of the largest
#: volume fraction, or more, near the base: others hold hardly a grain.
_HIGHEST, _EMPTY = 0.02, 0.02
#: Errors shown by a band, and points of a line of the theory.
_BAND, _POINTS = 2.0, 161
_DASHES = {"area": style.SOLID, "spacing": style.DASHED}


@style.own_settings()
def plot_comparison(found: Comparison) -> Figure:
    """Above, nu, T and u over p/M, measured with bands of two standard errors and of the flows at the same hold-up;
    below, the measured functions over those of each law."""
    figure, axes = style.panels(3, 2, height=5.6)
    measured, fraction = found.measured, found.measured.fraction_above
    nu = measured.fields["volume_fraction"]
    good = np.isfinite(measured.fields["granular_temperature"]) & (fraction >= _HIGHEST)
    # Layers below the lowest grains.
    good &= (fraction < 0.5) | (nu > _EMPTY * np.nanmax(nu))
    for ax, (name, text) in zip(axes[:3], _FIELDS.items(), strict=True):
        values = measured.fields[name]
        if name in measured.errors:
            wide = _BAND * measured.errors[name]
            ax.fill_betweenx(
                fraction[good],
                (values - wide)[good],
                (values + wide)[good],
                color=style.GREY,
                alpha=0.35,
                linewidth=0.0,
            )
        ax.plot(values[good], fraction[good], color=style.BLACK, linewidth=0.0, marker=".", markersize=3.0)
        style.name_axes(ax, text, "fraction above, $p/M$" if ax is axes[0] else None)
    closures = [one.closure for one in found.functions]
    at = np.linspace(_HIGHEST, 1.0, _POINTS)
    handles = {}
    for one in found.candidates:
        if one.condition == "M":
            line = style.LineStyle(style.stroke(closures.index(one.closure)).colour, _DASHES[one.mapping]).line()
            profile = one.flow.at_overburden(at)
            for ax, name in zip(axes[:3], _FIELDS, strict=True):
                (drawn,) = ax.plot(getattr(profile, name), at, **line)
                handles.setdefault(f"{one.closure}, r by {one.mapping}", drawn)
    for ax in axes[:3]:
        ax.set_ylim(1.0, 0.0)
        ax.set_xlim(left=0.0)
    middle = np.arange(1, 10)[COMPARED] / 10.0 + 0.05
    for ax, name in zip(axes[3:], FUNCTIONS, strict=True):
        ax.axhline(1.0, color=style.GREY, linewidth=0.6)
        for i, one in enumerate(found.functions):
            if name in one.ratios:
                colour = style.stroke(i).colour
                bars = one.ratio_errors[name] if np.isfinite(one.ratio_errors[name]).all() else None
                drawn = ax.errorbar(
                    middle, one.ratios[name], yerr=bars, color=colour, marker="o", markersize=2.5, linewidth=0.8
                )
                handles.setdefault(one.closure, drawn)
        style.name_axes(ax, "fraction above, $p/M$", _RATIOS[name])
    style.caption(
        figure,
        rf"$\tan\theta = {measured.slope:g}$, $e = {measured.restitution:g}$, $e_w = {measured.wall_restitution:g}$, "
        rf"$M = {measured.holdup:.4g}$; points and bands: simulation, two standard errors",
    )
    style.legend(figure, handles=list(handles.values()), labels=list(handles), loc="outside lower center", ncols=3)
    return figure
