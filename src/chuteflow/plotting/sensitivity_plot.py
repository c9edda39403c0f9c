"""Sensitivities, ranked: by how much each quantity changes where a parameter changes by one per cent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chuteflow.plotting import style
from chuteflow.steady.quantities import NUMBERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.steady.sensitivity import Sensitivity

#: Quantities drawn, as far as they are not kept.
_SHOWN = ("mass_flux", "centre_of_mass", "mass_holdup", "surface_temperature", "base_volume_fraction", "slip_velocity")


def plot_sensitivities(found: Sequence[Sensitivity]) -> Figure:
    """A panel for each flow: bars of d ln quantity/d ln parameter, the strongest parameter on top."""
    columns = min(len(found), 3)
    rows = -(-len(found) // columns)
    figure, axes = style.panels(columns, rows, width=2.6 * columns + 0.6, height=2.9 * rows)
    for ax, one in zip(axes, found, strict=False):
        names = [n for n in _SHOWN if NUMBERS[n].symbol != one.at]
        # A parameter that is 0 changes by one hundredth, which is said beside it.
        changes = np.where(one.values == 0.0, 1.0, one.values)
        elasticity = np.array([one.logarithmic[name] * changes for name in names])
        if one.at_fold:
            ax.set_axis_off()
            style.write(ax, 0.5, 0.5, f"fold of {one.at}:\ninfinite", xycoords="axes fraction", ha="center")
            continue
        order = np.argsort(np.abs(elasticity).max(axis=0))
        thickness = 0.8 / len(names)
        for i, name in enumerate(names):
            stroke = style.stroke(i)
            ax.barh(
                np.arange(len(order)) + 0.4 - thickness * (i + 0.5),
                elasticity[i, order],
                height=thickness,
                color=stroke.colour,
                label=f"${NUMBERS[name].latex}$" if ax is axes[0] else None,
            )
        ax.axvline(0.0, color=style.BLACK, linewidth=0.6)
        ticks = [f"${one.parameters[j].latex}$" + (" (by 0.01)" if one.values[j] == 0.0 else "") for j in order]
        ax.set_yticks(np.arange(len(order)), ticks, math_fontfamily="stix")
        flow = one.flow
        at = f"Q = {flow.mass_flux:.3g}, M = {flow.mass_holdup:.3g}"
        style.name_axes(ax, f"change in per cent for 1 %,\nat fixed ${_latex(one.at)}$ ({at})", None)
    for ax in axes[len(found) :]:
        ax.set_axis_off()
    style.legend(figure, loc="outside upper center", ncols=len(_SHOWN))
    return figure


def _latex(symbol: str) -> str:
    return next(quantity.latex for quantity in NUMBERS.values() if quantity.symbol == symbol)
