"""A steady flow as the state that is disturbed: its fields and d/dz on a grid that reaches far above the grains.

# notation: m = P/M fraction of the overburden, s grid coordinate (0 far above, 1 at the base), L reach.

The grid runs in ln m, which is -z/T_inf far above, from m = exp(-L) to m = 1. A weight beta adds points near
the base, where ln m is a poor measure of height: s is linear in ln m + beta m. The derivative is exact with
d/dz = -(nu/M) d/dm, the hydrostatic balance (3.2). Above the grid the disturbances follow in closed form, see
:mod:`chuteflow.stability.linear`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chuteflow.numerics.chebyshev import Array, Grid, grid
from chuteflow.steady.flow import Flow, Profile


@dataclass(frozen=True)
class Resolution:
    """A grid of ``degree``, with the ``reach`` L and the weight ``beta`` of its map."""

    degree: int
    reach: float
    beta: float


@dataclass(frozen=True, eq=False)
class BaseState:
    """A steady flow at the nodes of a grid, from far above down to the base, and d/dz there."""

    flow: Flow
    resolution: Resolution
    fraction: Array
    profile: Profile
    derivative: Array
    weights: Array

    @property
    def grid(self) -> Grid:
        """The grid in s."""
        return grid(self.resolution.degree)

    @property
    def points(self) -> int:
        """Number of nodes."""
        return len(self.fraction)


def base(flow: Flow, resolution: Resolution) -> BaseState:
    """``flow`` on the grid of ``resolution``; ``weights`` are those of integrals over the height."""
    g = grid(resolution.degree)
    fraction, rate = overburden_fractions(g.nodes, resolution)
    profile = flow.at_overburden(fraction)
    fall = profile.volume_fraction / (flow.mass_holdup * rate)  # -ds/dz
    return BaseState(
        flow=flow,
        resolution=resolution,
        fraction=fraction,
        profile=profile,
        derivative=-fall[:, None] * g.derivative,
        weights=g.weights / fall,
    )


def overburden_fractions(s: Array, resolution: Resolution) -> tuple[Array, Array]:
    """m(s) and dm/ds of the map ln m + beta m = (ln m + beta m at the base) - (1 - s) times its range."""
    reach, beta = resolution.reach, resolution.beta
    span = reach + beta * -np.expm1(-reach)
    target = beta - (1.0 - s) * span
    log_m = np.minimum(target, 0.0)
    # ln m + beta m is convex in ln m: Newton's method from above converges.
    for _ in range(60):
        move = (log_m + beta * np.exp(log_m) - target) / (1.0 + beta * np.exp(log_m))
        log_m = log_m - move
        if np.abs(move).max() < 1e-15 * reach:
            break
    m = np.minimum(np.exp(log_m), 1.0)
    return m, m * span / (1.0 + beta * m)
