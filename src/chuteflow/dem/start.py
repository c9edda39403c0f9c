"""Initial temperature and velocity of a hot start: those of the hottest flow of the theory at the hold-up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from chuteflow.branches.enumeration import flows
from chuteflow.dem.scene import Scene
from chuteflow.errors import InputError

#: Fractions of the hold-up whose mean a mean over the grains is.
_FRACTIONS = (np.arange(32) + 0.5) / 32
#: Starts hotter than this would only take longer to settle.
_HOTTEST = 20.0


def start_near_theory(scene: Scene) -> Scene:
    """``scene`` with the mean temperature and velocity of the hottest flow of its hold-up, or as it is where there is
    none: by the roughness of the area of a bump, or that of their distance where there is no flow on it."""
    for roughness in (scene.roughness_by_area, scene.roughness_by_spacing):
        try:
            found = flows(replace(scene.chute, roughness=roughness), M=scene.holdup)
        except InputError:
            continue
        if len(found):
            flow = found[0]
            temperature = float(flow.at_overburden(_FRACTIONS).granular_temperature.mean())
            velocity = flow.mass_flux / flow.mass_holdup
            return replace(scene, temperature=min(temperature, _HOTTEST), velocity=velocity)
    return scene
