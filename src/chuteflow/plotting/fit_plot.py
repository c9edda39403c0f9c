"""A fit: measured profiles with the fitted ones, and residuals by height."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.fitting.measurements import PROFILES
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.fitting.calibration import Fit

_HEIGHTS = 200


def plot_fit(found: Fit) -> Figure:
    """Above the profiles, below the residuals in standard errors; without profiles the residuals of all numbers."""
    symbols = [s for s in PROFILES if any(one.profile(s) for one in found.measured.experiments)]
    if not symbols:
        return _numbers(found)
    figure, axes = style.panels(len(symbols), 2, width=2.5 * len(symbols) + 0.5, height=5.0)
    for column, symbol in enumerate(symbols):
        above, below = axes[column], axes[len(symbols) + column]
        _profiles(above, found, symbol)
        _residuals(below, found, symbol)
        height = style.label("height") if column == 0 else None
        style.name_axes(above, style.label(PROFILES[symbol][0]), height)
        style.name_axes(below, f"residual of ${symbol_latex(symbol)}$ in errors", height)
    if len(found.experiments) > 1:
        style.legend(figure, loc="outside upper center", ncols=min(len(found.experiments), 5))
    said = ", ".join(f"${p.latex} = {one.value:.3g}$" for p, one in zip(found.free, found.estimates, strict=True))
    style.caption(figure, f"{found.chute.closure}: {said}")
    return figure


def symbol_latex(symbol: str) -> str:
    """The symbol of a field as it is printed."""
    from chuteflow.steady.quantities import FIELDS

    return FIELDS[PROFILES[symbol][0]].latex


def _profiles(ax: Any, found: Fit, symbol: str) -> None:
    for i, (one, measured) in enumerate(zip(found.experiments, found.measured.experiments, strict=True)):
        series = measured.profile(symbol)
        if series is None:
            continue
        stroke = style.stroke(i)
        z = series.height - (one.base or 0.0)
        scale = series.value if series.relative else 1.0
        error = series.error * scale * (1.0 if found.measured.errors_known else found.error_scale)
        ax.errorbar(
            series.value, z, xerr=error, fmt="o", markersize=2.8, color=stroke.colour, elinewidth=0.7, label=one.name
        )
        top = min(max(float(z.max()) * 1.05, one.flow.depth * 0.5), one.flow.interface_height)
        heights = np.linspace(0.0, top, _HEIGHTS)
        ax.plot(getattr(one.flow.profile(heights), series.field), heights, **stroke.line())


def _residuals(ax: Any, found: Fit, symbol: str) -> None:
    scale = 1.0 if found.measured.errors_known else max(found.error_scale, 1e-300)
    for i, one in enumerate(found.experiments):
        for series, residual in one.profiles:
            if series.symbol == symbol:
                z = series.height - (one.base or 0.0)
                ax.plot(residual / scale, z, "o", markersize=2.8, color=style.stroke(i).colour)
    ax.axvline(0.0, color=style.BLACK, linewidth=0.6)
    for edge in (-2.0, 2.0):
        ax.axvline(edge, color=style.GREY, linewidth=0.6, linestyle=style.DOTTED)


def _numbers(found: Fit) -> Figure:
    figure, (ax,) = style.panels(1, height=3.0)
    names, values = [], []
    for one, measured in zip(found.experiments, found.measured.experiments, strict=True):
        for scalar, residual in zip(measured.scalars, one.residuals, strict=True):
            names.append(f"{one.name}: {scalar.symbol}")
            values.append(float(residual))
    ax.plot(values, range(len(values)), "o", markersize=3.5, color=style.BLUE)
    ax.axvline(0.0, color=style.BLACK, linewidth=0.6)
    ax.set_yticks(range(len(names)), names)
    style.name_axes(ax, "residual in errors", None)
    return figure
