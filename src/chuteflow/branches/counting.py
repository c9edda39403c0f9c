"""How many flows share one mass flux, as far as the branches of a curve tell."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from chuteflow.branches.lines import SteadyBranch
from chuteflow.branches.paths import locate_turning_points
from chuteflow.branches.ranges import BranchEnd
from chuteflow.branches.results import Branch, Curve
from chuteflow.branches.solution_branches import SolutionBranch
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_Q

#: A branch is solved so far beyond rough flows beside turns, along it.
_BEYOND = 0.1


@dataclass(frozen=True)
class FlowCount:
    """So many ``flows`` at every mass flux from ``low`` to ``high``; ``at_least`` so many where a branch leaves the
    range searched, or is lost, on its way to these fluxes. ``low`` may be 0, and ``high`` infinite."""

    low: float
    high: float
    flows: int
    at_least: bool


def flux_counts(curve: Curve) -> list[FlowCount]:
    """The numbers of flows that share one mass flux, from the smallest flux to the largest, without gaps.

    Their edges are the folds and the ends of the branches.
    """
    stretches = [stretch for branch in curve.branches for stretch in _monotonic(branch)]
    rays = [ray for branch in curve.branches for ray in _beyond(branch)]
    edges = sorted({0.0, np.inf, *(edge for stretch in stretches for edge in stretch)})
    counts: list[FlowCount] = []
    for low, high in pairwise(edges):
        flows = sum(first <= low and high <= last for first, last in stretches)
        at_least = any(first <= low and high <= last for first, last in rays)
        if counts and (counts[-1].flows, counts[-1].at_least) == (flows, at_least):
            low = counts.pop().low
        counts.append(FlowCount(low, high, flows, at_least))
    return counts


def flows_at_flux(branches: Iterable[SteadyBranch], mass_flux: float) -> int:
    """How many flows of ``branches`` have this mass flux, by the stretches between folds: there is one on each."""
    return sum(low <= mass_flux < high for branch in branches for low, high in _monotonic(branch))


def most_at_once(stretches: Array, apart: float = 0.0) -> int:
    """The largest number of ``stretches`` (k, 2), each from a lower to a higher value, that share a value, where
    those that overlap by no more than ``apart`` do not count as sharing one."""
    low, high = stretches.T
    edges = np.concatenate([low + apart, high])
    order = np.lexsort((np.repeat([1, 0], len(low)), edges))
    return int(np.cumsum(np.repeat([1, -1], len(low))[order]).max(initial=0))


def solve_turns(branch: SolutionBranch, first: int, last: int, tolerance: float) -> Array | None:
    """ln Q at the turns of the flux between two rough flows of a branch and a little beyond, by solving it there; None
    where it could not be followed."""
    length = branch.arclength
    begin = max(int(np.searchsorted(length, length[first] - _BEYOND)) - 1, 0)
    end = min(int(np.searchsorted(length, length[last] + _BEYOND)), len(length) - 1)
    try:
        turns = locate_turning_points(branch.solved_between(begin, end, tolerance), LOG_Q, tolerance)
    except SolveError:
        return None
    return np.array([turn.point.m[LOG_Q] for turn in turns])


def _monotonic(branch: SteadyBranch) -> list[tuple[float, float]]:
    """Lowest and highest mass flux of the stretches of a branch between its folds."""
    stops = _stops(branch)
    return [(min(pair), max(pair)) for pair in pairwise(stops)]


def _beyond(branch: Branch) -> list[tuple[float, float]]:
    """Lowest and highest mass flux to which a branch may go on beyond its ends."""
    stops = _stops(branch)
    ends = ((stops[1], stops[0], branch.ends[0]), (stops[-2], stops[-1], branch.ends[1]))
    return [
        (end, np.inf) if end > before else (0.0, end) for before, end, words in ends if not BranchEnd.of(words).is_final
    ]


def _stops(branch: SteadyBranch) -> list[float]:
    turns = [point.flow.mass_flux for point in branch.special if point.kind == "fold-Q"]
    return [branch.flows[0].mass_flux, *turns, branch.flows[-1].mass_flux]
