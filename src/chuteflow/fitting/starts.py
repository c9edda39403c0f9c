"""Where a fit starts: trial chutes spread over the ranges of the free parameters, all flows of each as candidates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chuteflow.errors import InputError
from chuteflow.fitting.objective import Objective
from chuteflow.fitting.residuals import TrialFlow
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.sobol import MOST_DIMENSIONS, Sobol

#: Trial chutes, where there is one experiment, and at least where there are several; and where these were too few.
_TRIALS, _FEWEST, MANY_TRIALS = 64, 16, 256
#: Candidates that are followed to a minimum at most, and how far apart they are, in ranges of the parameters.
_FOLLOWED, _APART = 4, 0.15
#: Residuals of flows that nothing can be learnt from, such as those with no grains where some were measured.
_SENSELESS = 1e4


@dataclass(frozen=True, eq=False)
class StartingPoint:
    """A flow for each experiment at one set of parameters; ``ranks`` (number among the flows, how many) from hot to
    cold, and the ``cost``, which grows slowly with bad residuals."""

    values: Array
    places: tuple[TrialFlow, ...]
    ranks: tuple[tuple[int, int], ...]
    cost: float


def candidates(
    objective: Objective, first: Sequence[Array], trials: int | None = None, most: int = _FOLLOWED
) -> list[StartingPoint]:
    """Candidates from the parameters ``first`` and from trial chutes, the best first, without near repetitions: about
    ``most`` of them.

    Raises:
        InputError: where no trial chute has flows for all experiments.
    """
    free = objective.cases[0].free
    if len(free) > MOST_DIMENSIONS:
        raise InputError(f"{len(free)} free parameters: must be {MOST_DIMENSIONS} at most")
    many = trials or max(_FEWEST, _TRIALS // len(objective.cases))
    spread = Sobol(len(free), seed=0).points(0, many) if free else np.empty((1, 0))
    low = np.array([parameter.likely[0] for parameter in free])
    width = np.array([parameter.likely[1] for parameter in free]) - low
    found: list[StartingPoint] = []
    for values in (*first, *(low + width * spread)):
        found += at(objective, np.asarray(values, dtype=float))
    if not found:
        raise InputError(
            "no flow like those measured on any of the trial chutes: check units and slope, or free other parameters"
        )
    return _distinct(sorted(found, key=lambda one: one.cost), width, most)


def at(objective: Objective, values: Array) -> list[StartingPoint]:
    """The candidates at these parameters: for one experiment each of its flows, for several the best of each."""
    options = []
    for case in objective.cases:
        flows = case.candidates(values)
        if not flows:
            return []
        costs = [_cost(case.residual(flow)) for flow in flows]
        ranks = [(i + 1, len(flows)) for i in range(len(flows))]
        order = np.argsort(costs, kind="stable")
        options.append([(costs[i], flows[i], ranks[i]) for i in order if np.isfinite(costs[i])])
        if not options[-1]:
            return []
    picked = [[one] for one in options[0]] if len(options) == 1 else [[one[0] for one in options]]
    return [
        StartingPoint(
            values,
            tuple(TrialFlow.of(case, flow, values) for case, (_, flow, _) in zip(objective.cases, choice, strict=True)),
            tuple(rank for _, _, rank in choice),
            float(sum(cost for cost, _, _ in choice)),
        )
        for choice in picked
    ]


def _cost(residual: Array) -> float:
    sensible = np.isfinite(residual).all() and np.abs(residual).max(initial=0.0) < _SENSELESS
    return float(np.log1p(residual**2).sum()) if sensible else np.inf


def _distinct(found: Sequence[StartingPoint], width: Array, most: int) -> list[StartingPoint]:
    """The best, those that are far from them or on another flow, and at least one of each rank."""
    kept: list[StartingPoint] = []
    for one in found:
        near = any(
            one.ranks == other.ranks and np.abs((one.values - other.values) / width).max(initial=0.0) < _APART
            for other in kept
        )
        new = all(one.ranks != other.ranks for other in kept)
        if not near and (len(kept) < most or (new and len(kept) < 2 * most)):
            kept.append(one)
    return kept
