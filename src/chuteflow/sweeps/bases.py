"""Every flow of many chutes at given surface temperatures, each with its error.

At a given surface temperature nothing has to be searched for: one trajectory of each chute is enough. Many of these
together take some 0.07 ms a chute. The search of :mod:`chuteflow.branches`, which solves the other conditions, takes
over 1 ms, most of it for tables of the closures and for trajectories at all surface temperatures.

A trajectory from the surface knows nothing of the base, and every flow of its surface temperature is a point of
it (:mod:`chuteflow.sweeps.marching`). All members are integrated once, and those with flows again with smaller
tolerances, until what changes is small enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T
from chuteflow.sweeps.aligned import AlignedArrays
from chuteflow.sweeps.batch import LOG_P, MOMENT, ROWS, SHEAR_FLUX, Batch, Indices, Pointwise
from chuteflow.sweeps.marching import Accuracy, Ends, EventZeros, march

#: Accuracies, one after the other: a member goes on to the next until its flows are settled.
LADDER = (Accuracy(3e-8, 4e-3), Accuracy(1e-9, 5e-4), Accuracy(3e-11, 1e-5), Accuracy(1e-12, 1e-8))
#: The error claimed is this many times the change from one accuracy to the next.
SAFETY = 3.0
#: The least error ever claimed, and in the tolerance of a step: two integrations may agree by chance.
_FLOOR, _CHANCE = 1e-12, 0.5
#: The finer integrations end a little below the last flow.
_BELOW = 1.02


@dataclass(frozen=True, eq=False)
class Flows(AlignedArrays):
    """Flows of a batch: the ``member`` (k,) of each, its ``temperature`` at the surface and ``state`` (ROWS, k) at the
    base, the logarithms ``macroscopic`` (4, k) of Q, h, M and T_surface, and its relative ``error``."""

    BY_COLUMN = ("state", "macroscopic")

    member: Indices
    temperature: Array
    state: Array
    macroscopic: Array
    error: Array

    @classmethod
    def joined(cls, parts: list[Flows]) -> Flows:
        """All flows, in order of members, from hot to cold, then by hold-up."""
        none = np.empty(0)
        whole = cls(np.empty(0, dtype=np.intp), none, np.empty((ROWS, 0)), np.empty((4, 0)), none).and_all(parts)
        order = np.lexsort((whole.macroscopic[LOG_M], -whole.temperature, whole.member))
        return whole.take(order)


def meets_base(at: Pointwise, _: Indices) -> Array:
    """Heat flux less that which a base would give: zero at the base of a flow."""
    return at.y - at.base_flux


def evaluate_flows(batch: Batch, temperature: Array, found: EventZeros) -> Flows:
    """The zeros of :func:`meets_base` as flows, without an error yet."""
    member, state = found.member, found.state
    at = batch.take(member).at_state(state)
    mass = at.p - batch.surface_stress
    flux = at.slip * np.sqrt(at.temperature) * mass + at.p**2 * state[SHEAR_FLUX]
    macroscopic = np.empty((4, member.size))
    macroscopic[LOG_Q] = np.log(np.maximum(flux, np.finfo(float).tiny))
    macroscopic[LOG_H] = np.log(at.p * state[MOMENT] / mass)
    macroscopic[LOG_M] = np.log(mass)
    macroscopic[LOG_T] = np.log(temperature[member])
    return Flows(member, temperature[member], state, macroscopic, np.full(member.size, np.inf))


def solve_at_temperature(
    batch: Batch, temperature: Array, largest_holdup: float, tolerance: float
) -> tuple[Flows, NDArray[np.bool_]]:
    """Every flow at the surface temperatures (n,) with hold-ups up to ``largest_holdup``, and the members (n,) on
    which that could not be settled to ``tolerance``, which have no flow among those returned."""
    deepest = np.full(len(batch), largest_holdup + batch.surface_stress)
    ends = Ends.of(batch, deepest)
    coarse = march(batch, temperature, ends, LADDER[0], meets_base)
    unsettled = coarse.trouble.copy()
    unsettled[coarse.member] = True
    previous = evaluate_flows(batch, temperature, coarse)
    settled: list[Flows] = []
    for finer in LADDER[1:]:
        pending = np.flatnonzero(unsettled)
        if not pending.size:
            break
        previous = previous.take(unsettled[previous.member])
        last = np.full(len(batch), 0.0)
        np.maximum.at(last, previous.member, _BELOW * np.exp(previous.state[LOG_P]))
        last[coarse.trouble] = np.inf
        there = ends.take(pending).above(last[pending])
        found = march(batch.take(pending), temperature[pending], there, finer, meets_base)
        fine = evaluate_flows(batch, temperature, EventZeros(pending[found.member], found.state, unsettled))
        trouble = np.zeros(len(batch), dtype=bool)
        trouble[pending] = found.trouble
        fine, agreed = estimate_errors(len(batch), previous, fine, least_error(finer))
        worst = np.zeros(len(batch))
        np.maximum.at(worst, fine.member, fine.error)
        done = unsettled & agreed & ~trouble & (worst <= tolerance)
        settled.append(fine.take(done[fine.member]))
        unsettled &= ~done
        previous = fine
    out = Flows.joined(settled)
    return out.take(out.macroscopic[LOG_M] <= np.log(largest_holdup)), unsettled


def least_error(accuracy: Accuracy) -> float:
    """The least error that is claimed of ln Q, ln h and ln M at a surface temperature."""
    return max(_FLOOR, _CHANCE * accuracy.tolerance)


def estimate_errors(members: int, coarse: Flows, fine: Flows, least: float) -> tuple[Flows, NDArray[np.bool_]]:
    """The finer flows with the error that their distance from the coarser ones tells, at ``least`` so much, and the
    members on which both are equally many."""
    many = np.bincount(coarse.member, minlength=members)
    agreed = many == np.bincount(fine.member, minlength=members)
    error = np.full(fine.member.size, np.inf)
    # Both are in order of members, and along each from the surface down.
    change = np.abs(fine.macroscopic[:, agreed[fine.member]] - coarse.macroscopic[:, agreed[coarse.member]])
    error[agreed[fine.member]] = np.maximum(SAFETY * change[:LOG_T].max(axis=0, initial=0.0), least)
    return Flows(fine.member, fine.temperature, fine.state, fine.macroscopic, error), agreed
