"""Stability along a curve of flows: examined flow by flow, and the places where it changes.

Near the end of a stable range growth is slower than what counts as growth before it vanishes. There the neutral curve
of the waves that begin to grow is followed to its extreme, and the end is that neutral point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from chuteflow import display
from chuteflow.branches.paths import flow_between
from chuteflow.branches.results import Branch, Curve, SpecialPoint
from chuteflow.checks import whole
from chuteflow.errors import SolveError
from chuteflow.stability.modes import smallest_rate
from chuteflow.stability.neutral import End, neutral_curves
from chuteflow.stability.planes import FamilyPlane, scan_plane
from chuteflow.stability.result import RANGE, Stability, stability_of
from chuteflow.steady.flow import Flow
from chuteflow.threads import on_one_thread

#: Flows of a branch that are examined by default, and halvings of the gap in which stability changes.
SAMPLES, _HALVINGS = 24, 7
_MOST_SAMPLES = 2000
#: Growth, in units of what counts as growth, below which a neutral point is searched for; flows and points of its
#: plane.
_SLOW, _MEMBERS, _PLANE = 30.0, 5, (7, 5)
#: How far the plane reaches into the stable range, in brackets of the stability result.
_REACHES = (3.0, 12.0, 64.0)
#: The special point between a stable and an unstable flow.
CHANGE = "stability-change"
#: Labels beside the directions of growing modes.
STABLE, UNKNOWN = "stable", "unknown"


@dataclass(frozen=True, eq=False)
class Sample:
    """An examined flow at a ``position`` along a branch, counted in its flows; ``found`` is None where it is not
    resolved."""

    position: float
    flow: Flow
    found: Stability | None

    def __repr__(self) -> str:
        return display.line("Sample", self.label, repr(self.flow)[1:-1])

    @property
    def label(self) -> str:
        """ "stable", the direction of the mode that grows fastest, or "unknown"."""
        if self.found is None or self.found.stable is None:
            return UNKNOWN
        if self.found.stable or self.found.mode is None:
            return STABLE
        return self.found.mode.direction


@dataclass(frozen=True, eq=False)
class StabilityRun:
    """Neighbouring flows of a branch with one label; neighbouring runs share the flow where they meet."""

    label: str
    flows: tuple[Flow, ...]

    def __repr__(self) -> str:
        return display.line("StabilityRun", self.label, display.count_of(len(self.flows), "flow"))


@dataclass(frozen=True, eq=False)
class Change:
    """Where stability changes: a ``flow`` at a ``position`` along a branch, with the ``error`` of its T_surface.

    If ``neutral``, it is the neutral point, where growth vanishes for the waves of the range searched. Else it is the
    middle of the two flows between which stability changes, half of their distance the error.
    """

    flow: Flow
    position: float
    error: float
    neutral: bool


@dataclass(frozen=True, eq=False)
class MarkedBranch:
    """A branch with its ``changes`` of stability, also among its special points, its ``samples`` and its ``runs``."""

    branch: Branch
    samples: tuple[Sample, ...]
    runs: tuple[StabilityRun, ...]
    changes: tuple[Change, ...]

    def __repr__(self) -> str:
        labels = ", ".join(run.label for run in self.runs)
        return display.line("MarkedBranch", f"{display.count_of(len(self.samples), 'flow')} examined: {labels}")


@dataclass(frozen=True, eq=False)
class MarkedCurve:
    """A curve whose branches are marked, and these branches."""

    curve: Curve
    branches: tuple[MarkedBranch, ...]

    def __repr__(self) -> str:
        examined = display.count_of(sum(len(branch.samples) for branch in self.branches), "flow")
        return display.line("MarkedCurve", f"{examined} examined", repr(self.curve)[1:-1])


@on_one_thread
@np.errstate(under="ignore")
def mark_stability(
    curve: Curve, *, samples: int = SAMPLES, progress: Callable[[float], None] | None = None
) -> MarkedCurve:
    """The curve with its stability, about two seconds for each sample.

    Args:
        curve: the branches of flows of a chute.
        samples: flows examined on each branch, evenly along it. A stretch that is shorter than their spacing can be
            missed.
        progress: called with the fraction of the samples that is done.

    Raises:
        InputError: for a number of samples out of range, and where stability cannot be posed.
    """
    samples = whole("samples", samples, 2, _MOST_SAMPLES)
    found = []
    for i, branch in enumerate(curve.branches):

        def show_progress(fraction: float, done: int = i) -> None:
            if progress is not None:
                progress((done + fraction) / len(curve.branches))

        found.append(_mark(branch, samples, show_progress))
    return MarkedCurve(replace(curve, branches=tuple(one.branch for one in found)), tuple(found))


def _mark(branch: Branch, samples: int, show_progress: Callable[[float], None]) -> MarkedBranch:
    places = np.unique(np.linspace(0, len(branch.flows) - 1, min(samples, len(branch.flows))).round()).tolist()
    examined: list[Sample] = []
    for place in places:
        examined.append(_examine(branch, place))
        show_progress(len(examined) / len(places))
    breaks: list[tuple[float, str]] = []
    changes: list[Change] = []
    for one, two in pairwise(examined):
        if one.label == two.label:
            continue
        if UNKNOWN not in (one.label, two.label) and STABLE in (one.label, two.label):
            changes.append(_change(branch, one, two))
            place = changes[-1].position
        else:
            place = 0.5 * (one.position + two.position)
        breaks.append((place, two.label))
    points = [SpecialPoint(CHANGE, change.flow, int(change.position)) for change in changes]
    special = tuple(sorted([*branch.special, *points], key=lambda point: point.position))
    runs = tuple(_runs(branch, examined[0].label, breaks))
    return MarkedBranch(replace(branch, special=special), tuple(examined), runs, tuple(changes))


def _examine(branch: Branch, place: float) -> Sample:
    flow = flow_between(branch.flows, place)
    try:
        return Sample(place, flow, stability_of(flow))
    except SolveError:
        return Sample(place, flow, None)


def _change(branch: Branch, one: Sample, two: Sample) -> Change:
    """The place between two samples where stability changes: the neutral point, or the middle of a bracket."""
    stable, unstable = (one, two) if one.label == STABLE else (two, one)
    inner, outer = stable, unstable
    for _ in range(_HALVINGS):
        middle = _examine(branch, 0.5 * (inner.position + outer.position))
        if middle.label == UNKNOWN:
            break
        if middle.label == STABLE:
            inner = middle
        else:
            outer = middle
    # The neutral curve is followed in a plane of its own size: it may be near the bracket or far inside.
    width, farthest = inner.position - outer.position, abs(stable.position - outer.position)
    for reach in _REACHES:
        begin = outer.position + float(np.sign(width)) * min(reach * abs(width), farthest)
        found = _neutral(branch, begin, outer)
        if found is not None:
            return found
    return _between(branch, inner, outer)


def _between(branch: Branch, inner: Sample, outer: Sample) -> Change:
    place = 0.5 * (inner.position + outer.position)
    width = abs(inner.flow.surface_temperature - outer.flow.surface_temperature)
    return Change(flow_between(branch.flows, place), place, 0.5 * width, neutral=False)


def _neutral(branch: Branch, stable: float, outer: Sample) -> Change | None:
    """The neutral point between the place of a stable flow and one that grows slowly; None where none is reached."""
    found = outer.found
    if found is None or found.mode is None or found.mode.growth > _SLOW * smallest_rate(outer.flow):
        return None
    mode = found.mode
    k = float(np.hypot(mode.kx, mode.ky)) * outer.flow.centre_of_mass
    if k == 0.0:
        return None
    places = np.linspace(stable, outer.position, _MEMBERS)
    flows = [flow_between(branch.flows, float(place)) for place in places]
    low = float(np.log(RANGE[0]))
    plane = FamilyPlane(flows, float(np.arctan2(mode.ky, mode.kx)), low, float(np.log(max(3.0 * k, 0.1))) - low)
    extremes = []
    for curve in neutral_curves(plane, scan_plane(plane, _PLANE)):
        i = int(curve.z[:, 1].argmin())
        ended = {0: curve.ends[0], len(curve.z) - 1: curve.ends[1]}.get(i, End.EDGE)
        extremes.append((float(curve.z[i, 1]), float(curve.error[i]), ended is End.EDGE and curve.z[i, 1] > 0.0))
    if not extremes or not min(extremes)[2]:
        return None
    fraction, error, _ = min(extremes)
    per_share = abs(flows[-1].surface_temperature - flows[0].surface_temperature)
    place = stable + fraction * (outer.position - stable)
    return Change(flow_between(branch.flows, place), place, error * per_share, neutral=True)


def _runs(branch: Branch, label: str, breaks: Sequence[tuple[float, str]]) -> Iterator[StabilityRun]:
    """The flows of the branch cut at the positions of ``breaks``, each with the label after it."""
    begin = 0.0
    for end, after in (*breaks, (float(len(branch.flows) - 1), "")):
        inside = branch.flows[int(np.floor(begin)) + 1 : int(np.ceil(end))]
        yield StabilityRun(label, (flow_between(branch.flows, begin), *inside, flow_between(branch.flows, end)))
        begin, label = end, after
