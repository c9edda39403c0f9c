"""Design: which chutes have a flow with given numbers, such as a flux of 3 at a hold-up of 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from chuteflow import display
from chuteflow.errors import InputError
from chuteflow.fitting.measurements import SCALARS, StandardErrors, assemble
from chuteflow.fitting.objective import Objective
from chuteflow.fitting.residuals import TrialChute
from chuteflow.fitting.starts import candidates
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import CONDITIONS
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.free import FreeParameter, choose_parameters
from chuteflow.threads import on_one_thread

#: Relative differences of the numbers that count as one error, and the largest sum of squares of a solution.
_ERROR, _MET = 1e-3, 1e-11
#: Starts that are followed, trial chutes, and evaluations.
_FOLLOWED, _TRIALS, _MOST = 16, 48, 60
#: Solutions whose parameters and logarithms differ by less are one.
_SAME = 1e-5


@dataclass(frozen=True, eq=False)
class DesignSolution:
    """A chute that meets the conditions: ``values`` of its unknown parameters, and its flow."""

    values: Array
    flow: Flow


@dataclass(frozen=True, eq=False)
class Design:
    """The solutions that were found from the starts tried; ``reason`` is one sentence where there is none."""

    unknown: tuple[FreeParameter, ...]
    wanted: Mapping[str, float]
    solutions: tuple[DesignSolution, ...]
    starts: int
    reason: str | None

    def __repr__(self) -> str:
        said = display.count_of(len(self.solutions), "solution") if self.solutions else self.reason
        return display.line("Design", said)


@on_one_thread
def design(
    chute: Chute,
    unknown: Sequence[str],
    *,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    **wanted: float,
) -> Design:
    """The chutes, with other values of their ``unknown`` parameters, that have a flow with all numbers ``wanted``.

    Newton's method with exact derivatives starts from all flows of trial chutes. It finds what it is led to: another
    solution may exist.

    Args:
        chute: what is known.
        unknown: names of parameters, see :mod:`chuteflow.steady.free`.
        ranges: between which values parameters are tried, by name.
        wanted: numbers of the flow by symbol, such as Q, M, h, depth: one more than there are unknown parameters, as
            the place on the branch of flows is unknown too.

    Raises:
        InputError: for unknown names, or another number of conditions.
    """
    parameters = choose_parameters(chute, unknown, ranges or {})
    if len(wanted) != len(parameters) + 1:
        raise InputError(
            f"{display.count_of(len(wanted), 'condition')} for "
            f"{display.count_of(len(parameters), 'unknown parameter')}: "
            f"give {len(parameters) + 1}, as the flow on each chute is unknown too"
        )
    for symbol in wanted:
        if symbol not in SCALARS:
            raise InputError(f"unknown quantity {symbol!r}: choose from {', '.join(SCALARS)}")
    exact = next((symbol for symbol in CONDITIONS if symbol in wanted), None)
    errors = {symbol: StandardErrors(_ERROR, relative=True) for symbol in wanted if symbol != exact}
    experiment = assemble("wanted", None, {}, wanted, errors, {}, {})
    objective = Objective((TrialChute.of(experiment, chute, parameters),), False, "linear")
    here = np.array([parameter.of(chute) for parameter in parameters])
    try:
        starts = candidates(objective, [here], _TRIALS, _FOLLOWED)
    except InputError:
        return Design(parameters, wanted, (), 0, f"no trial chute has a flow with {exact} = {wanted[exact or '']:g}")
    found: list[DesignSolution] = []
    for start in starts:
        one = objective.minimise(objective.start(start.places), start.places, most=_MOST, tolerance=1e-14)
        if one is not None and one.chi2 < _MET:
            found.append(DesignSolution(one.x[: len(parameters)].copy(), one.places[0].flow))
    distinct: list[DesignSolution] = []
    for one in sorted(found, key=lambda s: tuple(s.values)):
        if not any(_same(one, other) for other in distinct):
            distinct.append(one)
    reason = None
    if not distinct:
        reason = f"none of {len(starts)} starts led to a chute with these numbers: give other ranges or numbers"
    return Design(parameters, wanted, tuple(distinct), len(starts), reason)


def _same(one: DesignSolution, other: DesignSolution) -> bool:
    off = np.abs(one.flow.solution.macroscopic - other.flow.solution.macroscopic).max()
    return bool(np.abs(one.values - other.values).max() < _SAME and off < _SAME)
