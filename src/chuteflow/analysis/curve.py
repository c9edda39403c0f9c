"""Every family of flows of a chute as an ordered branch, with its special points located.

Families are entered from the landscape of trajectories, so that none is missed, and solved side by side where it shows
them whole, or followed through folds in Q, M and T_surface by the general continuation of
:mod:`chuteflow.numerics.continuation`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from chuteflow.analysis.crossings import Chord, turning_point
from chuteflow.analysis.existence import imbalance
from chuteflow.analysis.families import traced_families
from chuteflow.analysis.ranges import LARGEST_HOLDUP, SURFACE_TEMPERATURE, Range
from chuteflow.analysis.results import Branch, Curve, Searched, SpecialPoint
from chuteflow.analysis.tracing import TracedFamily
from chuteflow.checks import whole
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
        _branch(chute, *stretch, tolerance)
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


def _branch(chute: Chute, solutions: list[Solution], ends: tuple[str, str], tolerance: float) -> Branch:
    if solutions[0].macroscopic[LOG_T] < solutions[-1].macroscopic[LOG_T]:
        solutions.reverse()
        ends = (ends[1], ends[0])
    flows = flows_of(chute, solutions)
    special = [*_folds(chute, solutions, tolerance), *_changes(flows, tolerance)]
    return Branch(tuple(flows), tuple(sorted(special, key=lambda point: point.position)), ends)


def _folds(chute: Chute, solutions: Sequence[Solution], tolerance: float) -> list[SpecialPoint]:
    """Flows at which Q, M or T_surface turns."""
    macroscopic = np.array([s.macroscopic for s in solutions])
    found = []
    for kind, which in _FOLDS.items():
        steps = np.diff(macroscopic[:, which])
        for i in np.flatnonzero((steps[:-1] > 0.0) != (steps[1:] > 0.0)).tolist():
            turn = _turn(solutions[i : i + 3], which, tolerance)
            if turn is not None:
                found.append(SpecialPoint(kind, Flow(chute, turn[1]), i + (turn[0] >= 0.5)))
    return found


def _turn(three: Sequence[Solution], which: int, tolerance: float, halvings: int = 6) -> tuple[float, Solution] | None:
    """The flow at which a quantity turns that rises and falls, or falls and rises, along ``three`` flows, and its
    place, 0 to 1 along them. Where a family turns too sharply for its chords, they are halved."""
    for half, pair in enumerate(pairwise(three)):
        turn = turning_point(*pair, which, tolerance)
        if turn is not None:
            return 0.5 * half + 0.25, turn
    if not halvings:
        return None
    first, middle, last = three
    finer = [first, Chord(first, middle, tolerance).at(0.5), middle, Chord(middle, last, tolerance).at(0.5), last]
    steps = np.diff([s.macroscopic[which] for s in finer])
    i = int(np.argmax((steps[:-1] > 0.0) != (steps[1:] > 0.0)))
    turn = _turn(finer[i : i + 3], which, tolerance, halvings - 1)
    return None if turn is None else (0.25 * i + 0.5 * turn[0], turn[1])


def _changes(flows: Sequence[Flow], tolerance: float) -> list[SpecialPoint]:
    """Flows at which the density turns inverted, or the interior another kind."""
    found = []
    for i in range(len(flows) - 1):
        for kind, quantity in (
            ("density-inversion", lambda flow: flow.density_excess),
            ("interior-change", lambda flow: flow.net_loss_range[0]),
            ("interior-change", lambda flow: flow.net_loss_range[1]),
        ):
            ends = quantity(flows[i]), quantity(flows[i + 1])
            if (ends[0] > 0.0) != (ends[1] > 0.0):
                found.append(SpecialPoint(kind, _zero(flows[i], flows[i + 1], quantity, ends, tolerance), i))
    return found


def _zero(
    first: Flow, last: Flow, quantity: Callable[[Flow], float], ends: tuple[float, float], tolerance: float
) -> Flow:
    chute = first.chute
    chord = Chord(first.solution, last.solution, tolerance)
    return Flow(chute, chord.zero(lambda s: quantity(Flow(chute, s)), ends))
