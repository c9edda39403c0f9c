"""Which of many chutes have a flow at given surface temperatures: maps of existence.

Trajectories (:mod:`chuteflow.trajectories`) know nothing of the base, so that all chutes of one material,
slope and surface share theirs, and each chute asks only where its base condition holds. This takes milliseconds a
slope, where :func:`chuteflow.flows` solves every flow to its tolerance, chute by chute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chuteflow.branches.ranges import SearchRange
from chuteflow.checks import real_array
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import LARGEST_HOLDUP
from chuteflow.steady.chute import Chute
from chuteflow.steady.model import model
from chuteflow.trajectories.kernel import S_T
from chuteflow.trajectories.refining import REFINEMENT, TrajectoryGrid, integrate_trajectories_from
from chuteflow.trajectories.tables import envelope

#: Trajectories of the surface temperatures alone, without others between.
_ALONE = replace(REFINEMENT, delta=1e9, finest=1e9)


def exists_at(
    chutes: Sequence[Chute], surface_temperature: ArrayLike, largest_holdup: float = LARGEST_HOLDUP
) -> NDArray[np.bool_]:
    """Whether there is a flow, (chutes, temperatures), at each of ``surface_temperature`` (C,) on each chute.

    Hold-ups are searched up to ``largest_holdup``. Two flows that nearly coincide, closer than a step of the
    integration, can be missed together.

    Raises:
        InputError: for a temperature or hold-up out of range.
    """
    temperature = np.atleast_1d(real_array("surface_temperature", surface_temperature))
    if temperature.ndim != 1 or not temperature.size:
        raise InputError("surface temperatures must be one number or a list of them")
    SearchRange.checked((float(temperature.min()), 2.0 * float(temperature.max())), largest_holdup)
    found = np.zeros((len(chutes), len(temperature)), dtype=bool)
    # A single trajectory has no neighbours, and is carried along with another.
    starts = np.unique(temperature) if len(np.unique(temperature)) > 1 else np.array([1.0, 2.0]) * temperature[0]
    for members in _sharing_trajectories(chutes):
        models = [model(chutes[i]) for i in members]
        grid = integrate_trajectories_from(models[0], envelope(models), starts, largest_holdup, _ALONE)
        for i, problem in zip(members, models, strict=True):
            found[i] = _is_met(grid.of_base(problem), temperature)
    return found


def _is_met(grid: TrajectoryGrid, temperature: Array) -> NDArray[np.bool_]:
    """Whether the trajectory of each surface temperature (C,) meets the base anywhere."""
    ends = grid.zeros[:, :2].astype(np.int64)
    along = np.not_equal(*grid.steps_of(ends).T)
    return np.isin(np.log(temperature), grid.states[ends[along, 1], S_T])


def _sharing_trajectories(chutes: Sequence[Chute]) -> list[list[int]]:
    """Indices of the chutes that differ by their base alone."""
    groups: dict[Chute, list[int]] = {}
    for i, chute in enumerate(chutes):
        groups.setdefault(replace(chute, wall_restitution=0.0, roughness=0.5), []).append(i)
    return list(groups.values())
