"""Stability along a curve of flows: samples judged one by one, and the places where it changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from chuteflow import display
from chuteflow.analysis.chords import Chord
from chuteflow.analysis.results import Branch, Curve, SpecialPoint
from chuteflow.checks import whole
from chuteflow.errors import SolveError
from chuteflow.stability.verdict import Stability, stability_of
from chuteflow.steady.flow import Flow
from chuteflow.threads import on_one_thread

#: Flows of a branch that are judged, unless told otherwise, and halvings of the gap in which stability changes.
SAMPLES, _HALVINGS = 24, 7
_MOST_SAMPLES = 2000
#: The special point between a stable and an unstable flow.
CHANGE = "stability-change"
#: Labels beside the directions of growing modes.
STABLE, UNKNOWN = "stable", "unknown"


@dataclass(frozen=True, eq=False)
class Sample:
    """A judged flow at a ``position`` along a branch, counted in its flows; ``found`` is None where no grid tells."""

    position: float
    flow: Flow
    found: Stability | None

    def __repr__(self) -> str:
        return display.line("Sample", self.label, repr(self.flow)[1:-1])

    @property
    def label(self) -> str:
        """ "stable", the direction of the mode that grows fastest, or "unknown"."""
        if self.found is None:
            return UNKNOWN
        if self.found.stable or self.found.mode is None:
            return STABLE
        return self.found.mode.direction


@dataclass(frozen=True, eq=False)
class Run:
    """Neighbouring flows of a branch with one label; neighbouring runs share the flow where they meet."""

    label: str
    flows: tuple[Flow, ...]

    def __repr__(self) -> str:
        return display.line("Run", self.label, display.counted(len(self.flows), "flow"))


@dataclass(frozen=True, eq=False)
class MarkedBranch:
    """A branch with its changes of stability among the special points, its ``samples`` and its ``runs``.

    A change is known to ``spacing``/2^7 flows of the branch, with ``spacing`` that of the samples.
    """

    branch: Branch
    samples: tuple[Sample, ...]
    runs: tuple[Run, ...]

    def __repr__(self) -> str:
        labels = ", ".join(run.label for run in self.runs)
        return display.line("MarkedBranch", f"{display.counted(len(self.samples), 'flow')} judged: {labels}")


@dataclass(frozen=True, eq=False)
class MarkedCurve:
    """A curve whose branches are marked, and these branches."""

    curve: Curve
    branches: tuple[MarkedBranch, ...]

    def __repr__(self) -> str:
        judged = display.counted(sum(len(branch.samples) for branch in self.branches), "flow")
        return display.line("MarkedCurve", f"{judged} judged", repr(self.curve)[1:-1])


@on_one_thread
@np.errstate(under="ignore")
def marked(curve: Curve, *, samples: int = SAMPLES, progress: Callable[[float], None] | None = None) -> MarkedCurve:
    """The curve with its stability, about two seconds for each sample.

    Args:
        curve: the families of flows of a chute.
        samples: flows judged on each branch, evenly along it. A stretch that is shorter than their spacing can be
            missed.
        progress: called with the share of the samples that is done.

    Raises:
        InputError: for a number of samples out of range, and where stability cannot be posed.
    """
    samples = whole("samples", samples, 2, _MOST_SAMPLES)
    found = []
    for i, branch in enumerate(curve.branches):

        def told(share: float, done: int = i) -> None:
            if progress is not None:
                progress((done + share) / len(curve.branches))

        found.append(_marked(branch, samples, told))
    return MarkedCurve(replace(curve, branches=tuple(one.branch for one in found)), tuple(found))


def flow_between(flows: Sequence[Flow], position: float) -> Flow:
    """The flow at a position between two neighbours of a family, or a little beyond its ends, counted in ``flows``."""
    i = int(np.clip(np.floor(position), 0, len(flows) - 2))
    first, last = flows[i], flows[i + 1]
    share = position - i
    if share in (0.0, 1.0):
        return last if share else first
    return Flow(first.chute, Chord(first.solution, last.solution).at(share))


def _marked(branch: Branch, samples: int, told: Callable[[float], None]) -> MarkedBranch:
    places = np.unique(np.linspace(0, len(branch.flows) - 1, min(samples, len(branch.flows))).round()).tolist()
    judged: list[Sample] = []
    for place in places:
        judged.append(_judged(branch, place))
        told(len(judged) / len(places))
    breaks, changes = [], []
    for one, two in pairwise(judged):
        if one.label == two.label:
            continue
        if UNKNOWN not in (one.label, two.label) and STABLE in (one.label, two.label):
            place = _change(branch, one, two)
            changes.append(SpecialPoint(CHANGE, flow_between(branch.flows, place), int(place)))
        else:
            place = 0.5 * (one.position + two.position)
        breaks.append((place, two.label))
    special = tuple(sorted([*branch.special, *changes], key=lambda point: point.position))
    runs = tuple(_runs(branch, judged[0].label, breaks))
    return MarkedBranch(replace(branch, special=special), tuple(judged), runs)


def _judged(branch: Branch, place: float) -> Sample:
    flow = flow_between(branch.flows, place)
    try:
        return Sample(place, flow, stability_of(flow))
    except SolveError:
        return Sample(place, flow, None)


def _change(branch: Branch, one: Sample, two: Sample) -> float:
    """The position between two samples where stability changes, by bisection: rates only vanish on one side."""
    low, high = one.position, two.position
    for _ in range(_HALVINGS):
        middle = _judged(branch, 0.5 * (low + high))
        if middle.label == UNKNOWN:
            break
        if (middle.label == STABLE) == (one.label == STABLE):
            low = middle.position
        else:
            high = middle.position
    return 0.5 * (low + high)


def _runs(branch: Branch, label: str, breaks: Sequence[tuple[float, str]]) -> Iterator[Run]:
    """The flows of the branch cut at the positions of ``breaks``, each with the label after it."""
    begin = 0.0
    for end, after in (*breaks, (float(len(branch.flows) - 1), "")):
        inside = branch.flows[int(np.floor(begin)) + 1 : int(np.ceil(end))]
        yield Run(label, (flow_between(branch.flows, begin), *inside, flow_between(branch.flows, end)))
        begin, label = end, after
