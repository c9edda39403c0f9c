"""A curve marked with its stability: picture, JSON objects and words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from chuteflow.io.contract import PLACE, factor
from chuteflow.io.stability_records import mode_object
from chuteflow.io.tables import number
from chuteflow.plotting import style
from chuteflow.plotting.plots import key_of_beyond, key_of_kinds, line, mark, parameters, shade_beyond
from chuteflow.stability.along import STABLE, UNKNOWN, Change, MarkedCurve, Run
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import NUMBERS, Scales

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Strokes of the stretches of a curve: solid where stable, dashed where not, by the direction of what grows.
_STROKES = {
    STABLE: style.Stroke(style.BLACK, style.SOLID),
    "along": style.Stroke(style.VERMILION, style.DASHED),
    "across": style.Stroke(style.BLUE, style.DASHED),
    "oblique": style.Stroke(style.GREEN, style.DASHED),
    "uniform": style.Stroke(style.PURPLE, style.DASHED),
    UNKNOWN: style.Stroke(style.GREY, style.DOTTED),
}
_WORDS = {
    STABLE: "stable",
    "along": "unstable along the slope",
    "across": "unstable across the slope",
    "oblique": "unstable to oblique waves",
    "uniform": "unstable as a whole",
    UNKNOWN: "not known",
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
        mark(ax, curve, pair, scales)
        for axis, name in zip("xy", pair, strict=True):
            style.spread_scale(ax, axis, [getattr(branch, name) for branch in curve.branches])
        style.name_axes(ax, *(style.label(name, scales) for name in pair))
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
            yield Line2D([], [], label=_WORDS[label], **stroke.line())


def samples_objects(marked: MarkedCurve, scales: Scales | None) -> list[list[dict[str, Any]]]:
    """The judged flows of each branch: their place, whether they are stable, and the mode that grows fastest.

    Rates and wavenumbers are dimensionless; ``stable`` is null where it is not known.
    """
    return [
        [
            {
                **_place(sample.flow, scales),
                "stable": None if sample.found is None else sample.found.stable,
                "mode": None if sample.found is None or sample.found.mode is None else mode_object(sample.found.mode),
            }
            for sample in branch.samples
        ]
        for branch in marked.branches
    ]


def changes_objects(marked: MarkedCurve, scales: Scales | None) -> list[list[dict[str, Any]]]:
    """The changes of stability of each branch, with the error of T_surface, and whether they are neutral points."""
    return [
        [
            {
                **_place(change.flow, scales),
                "error": change.error * factor("surface_temperature", change.flow.chute, scales),
                "neutral": change.neutral,
            }
            for change in branch.changes
        ]
        for branch in marked.branches
    ]


def change_words(change: Change, chute: Chute, scales: Scales | None) -> str:
    """Where stability changes, and how well that is known."""
    warmth = factor("surface_temperature", chute, scales)
    what = "neutral" if change.neutral else "the verdict changes"
    T, error = change.flow.surface_temperature * warmth, change.error * warmth
    return f"{what} at T_surface = {T:.6g} +- {error:.1g}"


def _place(flow: Flow, scales: Scales | None) -> dict[str, float]:
    return {NUMBERS[name].symbol: getattr(flow, name) * factor(name, flow.chute, scales) for name in PLACE}


def stretch(run: Run, chute: Chute, scales: Scales | None) -> str:
    """A stretch of a curve in words, by its surface temperatures."""
    warmth = factor("surface_temperature", chute, scales)
    ends = (number(flow.surface_temperature * warmth) for flow in (run.flows[0], run.flows[-1]))
    return f"{_WORDS[run.label]} from T_surface = {' to '.join(ends)}"
