"""Where a boundary leaves the range searched.

# notation: w = (z, lambda) unknowns, the last three of them theta at the surface, ln M and lambda.
"""

from __future__ import annotations

import numpy as np

from chuteflow.bifurcations.points import BoundaryPoint, solve_boundary_point
from chuteflow.bifurcations.system import BoundarySystem
from chuteflow.branches.ranges import SearchRange
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.continuation import CurvePoint
from chuteflow.steady.collocation import LOG_M, LOG_T

#: A flow has vanished where its hold-up is below this part of the surface temperature, and of 1.
_EMPTY = 1e-4
#: An edge nearer than this is reached; the unknown that leads to it is adjusted at most so many times.
_REACHED, _ADJUSTED = 1e-12, 4
#: Edges in the order of :func:`_excesses`: the unknown that leads to each, and the sign in which it does.
_LEADING = ((2, 1.0), (2, -1.0), (0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0))


def find_exit(
    before: CurvePoint[BoundarySystem], point: CurvePoint[BoundarySystem], within: SearchRange, tolerance: float
) -> tuple[BoundaryPoint | None, str] | None:
    """The point at which a step leaves the range, if it is not the one before, and in words how; None inside.

    Raises:
        SolveError: where that point was not solved to ``tolerance``.
    """
    begun, ended = _excesses(point.system, before.z, within), _excesses(point.system, point.z, within)
    passed = np.flatnonzero(ended > 0.0)
    if not len(passed):
        return None
    fractions = np.minimum(begun[passed], 0.0) / (np.minimum(begun[passed], 0.0) - ended[passed])
    fraction, edge = float(fractions.min()), int(passed[np.argmin(fractions)])
    words = _words(point.system, within)[edge]
    if begun[edge] > -_REACHED:
        return None, words
    unknown, sign = _LEADING[edge]
    start = before.z + fraction * (point.z - before.z)
    target = float(start[unknown - 3])
    there = solve_boundary_point(point.system, start, np.eye(3)[unknown], target, tolerance)
    for _ in range(_ADJUSTED):
        off = float(_excesses(there.system, there.w, within)[edge])
        if abs(off) < _REACHED:
            break
        target -= sign * off
        there = solve_boundary_point(point.system, start, np.eye(3)[unknown], target, tolerance)
    return there, words


def _excesses(system: BoundarySystem, w: Array, within: SearchRange) -> Array:
    """How far a flow lies beyond each edge, in the parameter or a logarithm: negative within the range."""
    value, sweep = float(w[-1]), system.sweep
    here = system.problem(value).state(w[:-1]).macroscopic()
    return np.array(
        [
            value - sweep.high,
            sweep.low - value,
            here[LOG_T] - np.log(within.hottest),
            np.log(within.coldest) - here[LOG_T],
            here[LOG_M] - np.log(within.deepest),
            np.log(_EMPTY) + min(here[LOG_T], 0.0) - here[LOG_M],
        ]
    )


def _words(system: BoundarySystem, within: SearchRange) -> tuple[str, ...]:
    sweep = system.sweep
    return (
        f"{sweep.name} = {sweep.high:g} is the end of its range",
        f"{sweep.name} = {sweep.low:g} is the end of its range",
        f"it goes on to surface temperatures above {within.hottest:g}",
        f"it goes on to surface temperatures below {within.coldest:g}",
        f"it goes on to hold-ups above {within.deepest:g}",
        "its flows vanish: their density tends to 0",
    )
