"""A disturbed flow in time, beside the steady flows of its hold-up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from chuteflow.io.contract import factor
from chuteflow.plotting import style
from chuteflow.plotting.plots import parameters

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.stability.relaxation import Outcome, RelaxationState
    from chuteflow.steady.flow import Flow
    from chuteflow.steady.quantities import Scales

#: The picture begins at this fraction of the whole time, on a logarithmic axis.
_FIRST = 1e-5


@style.own_settings()
def plot_relaxation(
    flow: Flow, moments: Sequence[RelaxationState], end: Outcome, *, scales: Scales | None = None
) -> Figure:
    """Q, h and T at the base against the logarithm of time, and their values in the steady flows; in SI units where
    ``scales`` are given."""
    from matplotlib.lines import Line2D

    figure, axes = style.panels(3, height=3.1)
    rest = style.LineStyle(style.BLACK, style.DOTTED)
    clock = factor("time", flow.chute, scales)
    later = [moment for moment in moments if moment.time > _FIRST * moments[-1].time]
    for ax, name in zip(axes, ("mass_flux", "centre_of_mass", "base_temperature"), strict=True):
        scale = factor(name, flow.chute, scales)
        ax.plot([clock * m.time for m in later], [scale * getattr(m, name) for m in later], **style.stroke(0).line())
        for steady in end.steady:
            ax.axhline(scale * getattr(steady, name), **rest.line(0.8))
        style.logarithmic(ax, "x")
        style.name_axes(ax, style.label("time", scales), style.label(name, scales))
    holdup = flow.mass_holdup * factor("mass_holdup", flow.chute, scales)
    key = [
        Line2D([], [], label="disturbed flow", **style.stroke(0).line()),
        Line2D(
            [],
            [],
            label=f"steady flows of the hold-up $M = {holdup:.4g}${style.unit('mass_holdup', scales)}",
            **rest.line(0.8),
        ),
    ]
    style.caption(figure, parameters(flow.chute))
    style.legend(figure, handles=key, loc="outside lower center", ncols=2)
    return figure
