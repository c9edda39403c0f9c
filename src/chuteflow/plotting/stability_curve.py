"""A curve marked with its stability."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from chuteflow.io.stability_curve import LABELS
from chuteflow.plotting import style
from chuteflow.plotting.plots import frame, key_of_beyond, key_of_kinds, line, parameters, shade_beyond
from chuteflow.stability.along import STABLE, UNKNOWN, MarkedCurve
from chuteflow.steady.quantities import Scales

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Strokes of the stretches of a curve: solid where stable, dashed where not, by the direction of what grows.
_STROKES = {
    STABLE: style.LineStyle(style.BLACK, style.SOLID),
    "along": style.LineStyle(style.VERMILION, style.DASHED),
    "across": style.LineStyle(style.BLUE, style.DASHED),
    "oblique": style.LineStyle(style.GREEN, style.DASHED),
    "uniform": style.LineStyle(style.PURPLE, style.DASHED),
    UNKNOWN: style.LineStyle(style.GREY, style.DOTTED),
}
_PANELS = (("mass_flux", "centre_of_mass"), ("mass_flux", "mass_holdup"))


@style.own_settings()
def plot_marked(marked: MarkedCurve, *, scales: Scales | None = None) -> Figure:
    """Centre of mass and hold-up against flux: solid where flows are stable, dashed where not."""
    curve = marked.curve
    if not curve.branches:
        return style.sentence(f"No flow: {curve.reason}.")
    figure, axes = style.panels(2, width=7.2, height=3.6)
    for ax, pair in zip(axes, _PANELS, strict=True):
        shade_beyond(ax, curve, pair, scales)
        for branch in marked.branches:
            for run in branch.runs:
                ax.plot(*line(run.flows, pair, curve, scales), **_STROKES[run.label].line())
        frame(ax, curve, pair, scales)
    style.caption(figure, parameters(curve.chute))
    style.legend(
        figure,
        handles=[*_key(marked), *key_of_kinds(curve), *key_of_beyond(curve)],
        loc="outside lower center",
        ncols=3,
    )
    return figure


def _key(marked: MarkedCurve) -> Iterator[Any]:
    from matplotlib.lines import Line2D

    seen = {run.label for branch in marked.branches for run in branch.runs}
    for label, stroke in _STROKES.items():
        if label in seen:
            yield Line2D([], [], label=LABELS[label], **stroke.line())
