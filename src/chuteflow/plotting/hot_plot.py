"""The picture of a hot flow: its fields as the temperature far above tends to infinity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chuteflow.plotting import style
from chuteflow.plotting.plots import parameters
from chuteflow.steady.hot import HotModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Points from the base up, and the fraction of the overburden at the uppermost.
_POINTS, _HIGHEST = 201, 1e-4


@style.own_settings()
def plot_hot(found: HotModel) -> Figure:
    """Volume fraction, temperature and velocity over their powers of T_inf against the height over T_inf.

    Raises:
        InputError: where velocities overflow, near lambda = 3.
    """
    solution, a = found.solution, found.parameters
    if solution is None:
        figure = style.sentence(f"No hot flow: {found.reason}.")
        style.caption(figure, parameters(found.chute))
        return figure
    P = solution.P_b * np.geomspace(1.0, _HIGHEST, _POINTS)
    height = -solution.log_s(P)
    fields = {
        r"$\nu\,T_\infty$": a.alpha * solution.psi(P),
        r"$T/T_\infty$": solution.tau(P),
        r"$u/\sqrt{T_\infty}$": a.F10 * solution.velocity(P, a.mu),
    }
    figure, axes = style.panels(3, height=2.8, shared_y=True)
    for ax, (name, values) in zip(axes, fields.items(), strict=True):
        ax.plot(values, height, **style.stroke(0).line())
        style.name_axes(ax, name, r"height over temperature, $z/T_\infty$" if ax is axes[0] else None)
        ax.set_ylim(bottom=0.0)
    style.caption(figure, parameters(found.chute))
    return figure
