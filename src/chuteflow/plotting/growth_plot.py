"""Pictures of growth rates: shades and contours over a plane of wavenumbers or along a branch, with neutral curves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.io.contract import factor
from chuteflow.plotting import style
from chuteflow.plotting.plots import parameters
from chuteflow.steady.quantities import NUMBERS, Scales

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chuteflow.stability.planes import FamilyMap, WaveMap

#: Shades of growth on either side of zero, and the largest decay that is distinguished from the rest, over the largest
#: growth.
_SHADES, _DEEPEST = 8, 2.0
#: First digits of round numbers, the roundest first; others are for axes with fewer ticks than these.
_DIGITS, _ROUNDEST, _FEW = (1, 2, 5, 3, 7, 4, 6, 8, 9), (1, 2, 5), 3
#: Smallest distance of ticks, as a fraction of the axis.
_APART = 0.08
_MAP_OF_COLOURS = "RdBu_r"
_NEUTRAL = style.LineStyle(style.BLACK, style.SOLID)


@style.own_settings()
def plot_wave_map(found: WaveMap, *, scales: Scales | None = None) -> Figure:
    """Growth over wavenumbers along and across the slope; in SI units where ``scales`` are given."""
    figure, (ax,) = style.panels(1, width=5.2, height=4.2)
    chute = found.flow.chute
    wave = factor("wavenumber", chute, scales)
    kx, ky = wave * found.kx, wave * found.ky
    _shade(figure, ax, kx, ky, factor("growth", chute, scales) * found.growth, found.unresolved, scales)
    for curve in found.neutral:
        ax.plot(*(wave * curve.z.T), **_NEUTRAL.line(1.6))
    growth = np.where(found.grows, found.growth, -np.inf)
    i, j = np.unravel_index(int(growth.argmax()), growth.shape)
    if found.grows[i, j]:
        ax.plot(kx[i], ky[j], marker="+", markersize=8.0, color=style.BLACK, clip_on=False, linestyle="none")
    unit = style.unit("wavenumber", scales)
    style.name_axes(ax, f"wavenumber along the slope, $k_x${unit}", f"wavenumber across the slope, $k_y${unit}")
    ax.set_xlim(kx[0], kx[-1])
    ax.set_ylim(ky[0], ky[-1])
    numbers = {name: getattr(found.flow, name) for name in ("mass_flux", "centre_of_mass")}
    place = ", ".join(
        f"${NUMBERS[name].latex} = {value * factor(name, chute, scales):.4g}${style.unit(name, scales)}"
        for name, value in numbers.items()
    )
    style.caption(figure, f"{parameters(chute)}\n{place}; bold: neutral{_describe_hatches(found.growth)}")
    return figure


@style.own_settings()
def plot_family_map(found: FamilyMap, *, scales: Scales | None = None) -> Figure:
    """Growth over k h and the temperature along a branch, and the branch with its unstable stretch of k h."""
    figure, (left, right) = style.panels(2, width=7.6, height=3.7)
    chute = found.flows[0].chute
    rate, heat, flux_scale = (factor(name, chute, scales) for name in ("growth", "surface_temperature", "mass_flux"))
    temperature = heat * np.array([flow.surface_temperature for flow in found.flows])
    place = np.linspace(0.0, 1.0, len(temperature))
    _shade(figure, left, found.depth_wavenumber, place, rate * found.growth, found.unresolved, scales)
    style.logarithmic(left, "x")
    ticks = _round_places(place, temperature)
    left.set_yticks([*ticks], [*ticks.values()])
    left.set_ylim(0.0, 1.0)
    for i, (curve, flows) in enumerate(zip(found.neutral, found.neutral_flows, strict=True)):
        left.plot(*curve.z.T, **_NEUTRAL.line(1.6))
        flux = [flux_scale * flow.mass_flux for flow in flows]
        right.plot(flux, curve.z[:, 0], label=f"neutral curve {i + 1}", **style.stroke(i).line())
    style.name_axes(left, "$k h$", _along(scales))
    style.name_axes(right, style.label("mass_flux", scales), "$k h$")
    style.spread_scale(right, "x", [[flux_scale * flow.mass_flux for flow in flows] for flows in found.neutral_flows])
    style.logarithmic(right, "y")
    if found.neutral:
        style.legend(figure, handles=right.get_lines(), loc="outside lower center", ncols=4)
    waves = {0.0: "waves along the slope", 90.0: "waves across the slope"}.get(
        found.angle, f"waves at {found.angle:g} degrees to the slope"
    )
    style.caption(figure, f"{parameters(chute)}; {waves}; bold: neutral{_describe_hatches(found.growth)}")
    return figure


def _along(scales: Scales | None) -> str:
    return f"${NUMBERS['surface_temperature'].latex}${style.unit('surface_temperature', scales)} along the branch"


def _round_places(place: Any, temperature: Any) -> dict[float, str]:
    """Places along the branch at which its surface temperature is a round number, and these numbers.

    Powers of ten come before others, which stand where there is room, the last ones only while there are few.
    """
    found: dict[float, str] = {}
    decades = range(math.floor(math.log10(temperature.min())), math.ceil(math.log10(temperature.max())) + 1)
    for digit in _DIGITS:
        if digit not in _ROUNDEST and len(found) >= _FEW:
            break
        for power in decades:
            value = digit * 10.0**power
            above = np.log(temperature / value)
            for i in np.flatnonzero((above[:-1] < 0.0) != (above[1:] < 0.0)):
                fraction = above[i] / (above[i] - above[i + 1])
                at = float(place[i] + fraction * (place[i + 1] - place[i]))
                if all(abs(at - other) >= _APART for other in found):
                    found[at] = f"{value:g}"
    return found


def _describe_hatches(growth: Any) -> str:
    return "" if np.isfinite(growth).all() else "; hatched: no mode resolved"


def _shade(figure: Figure, ax: Axes, x: Any, y: Any, growth: Any, unresolved: Any, scales: Scales | None) -> None:
    """Shades that are white at zero growth, hatches where no mode is resolved, and crosses where growth is not
    known."""
    from matplotlib.patches import Rectangle
    from matplotlib.ticker import MaxNLocator

    resolved = np.isfinite(growth)
    if not resolved.all():
        unit = Rectangle((0.0, 0.0), 1.0, 1.0, transform=ax.transAxes, zorder=0.0, facecolor="white")
        unit.set(hatch="////", edgecolor=style.GREY, linewidth=0.0)
        ax.add_patch(unit)
        for i, j in np.argwhere(unresolved):
            ax.plot(x[i], y[j], marker="x", markersize=4.0, color=style.GREY, clip_on=False, linestyle="none")
    if not (resolved[1:, 1:] & resolved[:-1, 1:] & resolved[1:, :-1] & resolved[:-1, :-1]).any():
        return
    largest = float(np.nanmax(growth, initial=0.0)) or float(np.nanmax(np.abs(growth), initial=1e-12))
    shown = np.ma.masked_invalid(np.clip(growth, -_DEEPEST * largest, largest))
    levels = np.linspace(-_DEEPEST * largest, largest, 3 * _SHADES + 1)
    norm = _halves(largest)
    shades = ax.contourf(x, y, shown.T, levels=levels, cmap=_MAP_OF_COLOURS, norm=norm)
    lines = levels[levels > 0.5 * largest / _SHADES][::2]
    ax.contour(x, y, shown.T, levels=lines, colors=style.GREY, linewidths=0.5)
    bar = figure.colorbar(shades, ax=ax, pad=0.02, ticks=MaxNLocator(7))
    bar.formatter.set_powerlimits((-2, 3))  # pyright: ignore[reportAttributeAccessIssue]
    bar.ax.yaxis.get_offset_text().set(fontsize=7.5, fontfamily="STIXGeneral")
    bar.ax.tick_params(labelsize=7.5, width=0.6, length=3.0, labelfontfamily="STIXGeneral")
    bar.outline.set_linewidth(0.6)  # pyright: ignore[reportCallIssue]
    bar.set_label(f"growth rate{style.unit('growth', scales)}", fontsize=8.5, fontfamily="STIXGeneral")


def _halves(largest: float) -> Any:
    from matplotlib.colors import TwoSlopeNorm

    return TwoSlopeNorm(0.0, -_DEEPEST * largest, largest)
