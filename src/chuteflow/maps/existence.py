"""Which of many chutes have a flow at given surface temperatures: maps of existence.

Trajectories (:mod:`chuteflow.maps.trajectories`) know nothing of the base, so that all chutes of one material,
slope and surface share theirs, and each chute asks only where its base condition holds. This takes some 20 ms a
slope, where :func:`chuteflow.flows` solves every flow to its tolerance, chute by chute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chuteflow.branches.ranges import Range
from chuteflow.checks import real_array
from chuteflow.errors import InputError
from chuteflow.maps.trajectories import Trajectories, integrate
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import LARGEST_HOLDUP
from chuteflow.steady.chute import Chute
from chuteflow.steady.model import CONDUCTION, LOSS, WORK, Model, model


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
    Range.checked((float(temperature.min()), 2.0 * float(temperature.max())), largest_holdup)
    found = np.zeros((len(chutes), len(temperature)), dtype=bool)
    for members in _sharing_trajectories(chutes):
        models = [model(chutes[i]) for i in members]
        t = integrate(_longest(models), temperature, largest_holdup)
        closures, _ = t.model.closures(np.exp(t.big_l))
        for i, problem in zip(members, models, strict=True):
            found[i] = _meets_base(t, problem, problem.base_flux(closures), largest_holdup)
    return found


def _sharing_trajectories(chutes: Sequence[Chute]) -> list[list[int]]:
    """Indices of the chutes that differ by their base alone."""
    groups: dict[Chute, list[int]] = {}
    for i, chute in enumerate(chutes):
        groups.setdefault(replace(chute, wall_restitution=0.0, roughness=0.5), []).append(i)
    return list(groups.values())


def _longest(models: Sequence[Model]) -> Model:
    """The model whose integration ends last.

    In the empty state it ends where the heat flux has passed that which the base gives there, or where it can
    never reach it: to be left to the base with the largest flux within reach.
    """
    empty, _ = models[0].closures(np.zeros(1))
    slope = models[0].slope
    net = float(empty[LOSS, 0] - slope**2 * empty[WORK, 0])
    reach = np.sqrt(max(2.0 * net * float(empty[CONDUCTION, 0]), 0.0))
    flux = [float(problem.base_flux(empty)[0]) for problem in models]
    return models[max(range(len(models)), key=lambda i: (flux[i] <= reach, flux[i]))]


def _meets_base(t: Trajectories, problem: Model, base: Array, largest_holdup: float) -> NDArray[np.bool_]:
    """Whether the heat flux equals ``base`` (K, C) anywhere on a trajectory, (C,)."""
    p, excess = t.p, t.y - base
    if problem.surface_stress == 0.0:
        # Above the first row there is the empty surface, where the heat flux is 0.
        empty, _ = problem.closures(np.zeros(1))
        p = np.concatenate([np.zeros_like(p[:1]), p])
        excess = np.concatenate([np.full_like(p[:1], -problem.base_flux(empty)[0]), excess])
    crossing = (excess[1:] > 0.0) != (excess[:-1] > 0.0)
    crossing &= p[:-1] < problem.surface_stress + largest_holdup
    return crossing.any(axis=0)
