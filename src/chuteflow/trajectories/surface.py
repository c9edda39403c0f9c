"""What trajectories start from at the surface."""

from __future__ import annotations

import numpy as np

from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.model import GAMMA, Model


def surface_potential(model: Model, temperature: Array) -> Array:
    """theta at the surface for the surface temperatures (C,), by Newton's method at the interface."""
    theta = np.log(temperature)
    if model.surface_stress == 0.0:
        return theta
    target = theta = theta + model.beta * np.log(model.surface_stress)
    for _ in range(50):
        f, df = model.closures(model.density_argument(np.full_like(theta, model.surface_stress), theta))
        step = (target - theta - f[GAMMA]) / (1.0 - df[GAMMA])
        theta = theta + step
        if np.abs(step).max() < 1e-12:
            break
    return theta
