"""A curve marked with its stability: JSON objects and sentences."""

from __future__ import annotations

from typing import Any

from chuteflow.io.contract import factor, place_object
from chuteflow.io.stability_records import mode_object
from chuteflow.io.tables import number
from chuteflow.stability.along import STABLE, UNKNOWN, Change, MarkedCurve, StabilityRun
from chuteflow.steady.chute import Chute
from chuteflow.steady.quantities import Scales

#: What the labels of stretches of a curve mean.
LABELS = {
    STABLE: "stable",
    "along": "unstable along the slope",
    "across": "unstable across the slope",
    "oblique": "unstable to oblique waves",
    "uniform": "unstable as a whole",
    UNKNOWN: "not known",
}


def samples_objects(marked: MarkedCurve, scales: Scales | None) -> list[list[dict[str, Any]]]:
    """The examined flows of each branch: their place, whether they are stable, and the mode that grows fastest.

    ``stable`` is null where it is not known.
    """
    return [
        [
            {
                **place_object(sample.flow, scales),
                "stable": None if sample.found is None else sample.found.stable,
                "mode": None
                if sample.found is None or sample.found.mode is None
                else mode_object(sample.found.mode, chute=sample.flow.chute, scales=scales),
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
                **place_object(change.flow, scales),
                "error": change.error * factor("surface_temperature", change.flow.chute, scales),
                "neutral": change.neutral,
            }
            for change in branch.changes
        ]
        for branch in marked.branches
    ]


def change_words(change: Change, chute: Chute, scales: Scales | None) -> str:
    """Where stability changes, and how well that is known."""
    scale = factor("surface_temperature", chute, scales)
    what = "neutral" if change.neutral else "stability changes"
    T, error = change.flow.surface_temperature * scale, change.error * scale
    return f"{what} at T_surface = {T:.6g} +- {error:.1g}"


def stretch(run: StabilityRun, chute: Chute, scales: Scales | None) -> str:
    """A stretch of a curve in words, by its surface temperatures."""
    scale = factor("surface_temperature", chute, scales)
    ends = (number(flow.surface_temperature * scale) for flow in (run.flows[0], run.flows[-1]))
    return f"{LABELS[run.label]} from T_surface = {' to '.join(ends)}"
