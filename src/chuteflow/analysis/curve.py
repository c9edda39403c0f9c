"""Every family of flows of a chute as an ordered branch, with its special points located.

Families are entered from the landscape of trajectories, so that none is missed, and solved side by side where it shows
them whole, or followed through folds in Q, M and T_surface by the general continuation of
:mod:`chuteflow.numerics.continuation`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from chuteflow.analysis.chords import Chord
from chuteflow.analysis.existence import imbalance
from chuteflow.analysis.families import traced_families
from chuteflow.analysis.ranges import LARGEST_HOLDUP, SURFACE_TEMPERATURE, Range
from chuteflow.analysis.results import Branch, Curve, Searched, SpecialPoint
from chuteflow.analysis.tracing import Stretch, TracedFamily
from chuteflow.analysis.turns import Dip, dips, turns
from chuteflow.checks import whole
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import LOG_M, LOG_Q, LOG_T
from chuteflow.steady.flow import Flow, flows_of
from chuteflow.steady.model import model
from chuteflow.steady.solver import TOLERANCE, Solution, checked_tolerance
from chuteflow.threads import on_one_thread

#: Quantities whose folds are located.
_FOLDS = {"fold-Q": LOG_Q, "fold-M": LOG_M, "fold-T": LOG_T}


@on_one_thread
@np.errstate(under="ignore")
def curve(
    chute: Chute,
    *,
    points: int = 200,
    tolerance: float = TOLERANCE,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
) -> Curve:
    """Every family of steady flows on ``chute`` in a range.

    Args:
        chute: the chute.
        points: flows on the longest branch, evenly in arclength in the plane (ln T_surface, ln M); shorter
            branches take fewer in proportion.
        tolerance: relative error allowed in Q, h and M, from 1e-11 to 1e-3.
        surface_temperature: range of T_surface.
        largest_holdup: largest M.

    Raises:
        InputError: for a range or number out of bounds.
        SolveError: where a family could not be followed. Where flows of one could not be solved to the tolerance,
            its branch ends, and says why.
    """
    points = whole("points", points, 2, 100_000)
    tolerance = checked_tolerance(tolerance)
    within = Range.checked(surface_temperature, largest_holdup, chute.surface)
    problem = model(chute)
    found = traced_families(problem, within)
    longest = max((float(family.arclength[-1]) for family in found), default=1.0)
    branches = [
        _branch(chute, family, stretch, tolerance)
        for family in found
        for stretch in family.sampled(_samples(family, points, float(family.arclength[-1]) / longest), tolerance)
    ]
    branches.sort(key=lambda branch: -float(branch.surface_temperature.max()))
    return Curve(
        chute=chute,
        branches=tuple(branches),
        searched=Searched((within.coldest, within.hottest), within.deepest),
        tolerance=tolerance,
        reason=None if branches else imbalance(problem),
    )


def _samples(family: TracedFamily, points: int, share: float) -> int:
    """Flows of a family whose length is ``share`` of the longest: as even as those of that one, and, up to ``points``,
    no fewer than it took to follow it around its turns."""
    return max(8, round(points * share), min(points, len(family.solutions)))


def _branch(chute: Chute, family: TracedFamily, stretch: Stretch, tolerance: float) -> Branch:
    located = [*_folds(chute, family, stretch, tolerance), *_changes(chute, family, stretch, tolerance)]
    if stretch.solutions[0].macroscopic[LOG_T] < stretch.solutions[-1].macroscopic[LOG_T]:
        stretch = stretch.reversed()
    flows = flows_of(chute, stretch.solutions)
    heading = np.sign(stretch.places[-1] - stretch.places[0])
    special = []
    for kind, flow, place in sorted(located, key=lambda one: heading * one[2]):
        before = int(np.searchsorted(heading * stretch.places, heading * place, side="right")) - 1
        special.append(SpecialPoint(kind, flow, min(max(before, 0), len(flows) - 2)))
    return Branch(tuple(flows), tuple(special), stretch.ends)


def _folds(chute: Chute, family: TracedFamily, stretch: Stretch, tolerance: float) -> Iterator[tuple[str, Flow, float]]:
    """Flows at which Q, M or T_surface turns, with their arclengths."""
    path, at = family.path(stretch)
    found = turns(path, tuple(_FOLDS.values()), tolerance)
    for kind, which in _FOLDS.items():
        for turn in (turn for turn in found if turn.which == which):
            yield kind, Flow(chute, turn.solution), _arclength(path, at, int(turn.place), turn.solution)


def _changes(
    chute: Chute, family: TracedFamily, stretch: Stretch, tolerance: float
) -> Iterator[tuple[str, Flow, float]]:
    """Flows at which the density turns inverted, or the interior another kind, with their arclengths."""
    path, at = family.path(stretch)
    flows = flows_of(chute, path)
    for kind, quantity in (
        ("density-inversion", lambda flow: flow.density_excess),
        ("interior-change", lambda flow: flow.net_loss_range[0]),
        ("interior-change", lambda flow: flow.net_loss_range[1]),
    ):
        values = np.array([quantity(flow) for flow in flows])
        ways = {dip.step: dip.share for dip in dips(values, at) if _reaches(dip, values)}
        for i in range(len(flows) - 1):
            if (values[i] > 0.0) != (values[i + 1] > 0.0):
                found = [_zero(flows[i], flows[i + 1], quantity, (values[i], values[i + 1]), tolerance)]
            elif i in ways:
                found = _pair(flows[i], flows[i + 1], quantity, ways[i], tolerance)
            else:
                continue
            yield from ((kind, flow, _arclength(path, at, i, flow.solution)) for flow in found)


def _arclength(path: Sequence[Solution], at: Array, i: int, solution: Solution) -> float:
    """The arclength of a flow between the flows i and i + 1 of a path, which have the arclengths ``at``."""
    share = Chord(path[i], path[i + 1]).place(solution)
    return float(at[i] + np.clip(share, 0.0, 1.0) * (at[i + 1] - at[i]))


def _reaches(dip: Dip, values: Array) -> bool:
    """Whether a dip may reach zero: the slopes are rough, so that one that comes half of the way there may."""
    return bool(dip.zeros) or abs(dip.value) < 0.5 * float(np.abs(values[dip.step : dip.step + 2]).max())


def _pair(first: Flow, last: Flow, quantity: Callable[[Flow], float], share: float, tolerance: float) -> list[Flow]:
    """The two zeros to either side of a share of the chord between two flows, if the sign is another one there."""
    middle = Flow(first.chute, Chord(first.solution, last.solution, tolerance).at(share))
    values = quantity(first), quantity(middle), quantity(last)
    if (values[0] > 0.0) == (values[1] > 0.0):
        return []
    return [
        _zero(first, middle, quantity, values[:2], tolerance),
        _zero(middle, last, quantity, values[1:], tolerance),
    ]


def _zero(
    first: Flow, last: Flow, quantity: Callable[[Flow], float], ends: tuple[float, float], tolerance: float
) -> Flow:
    """The flow between two at which a quantity vanishes."""
    chute = first.chute
    chord = Chord(first.solution, last.solution, tolerance)
    return Flow(chute, chord.zero(lambda s: quantity(Flow(chute, s)), ends))
