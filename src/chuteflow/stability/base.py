"""A steady flow as the state that is disturbed: its fields and d/dz on a grid that reaches far above the grains.

# notation: m = P/M fraction of the overburden, s grid coordinate (0 far above, 1 at the base), L reach.

The grid runs in ln m, which is -z/T_inf far above, from m = exp(-L) to m = 1. A weight beta adds points near
the base, where ln m is a poor measure of height: s is linear in ln m + beta m. The derivative is exact with
d/dz = -(nu/M) d/dm, the hydrostatic balance (3.2). Above the grid the disturbances follow in closed form, see
:mod:`chuteflow.stability.linear`.

Where the density passes a break of the law, pieces of the grid meet, each with its own node there: the derivatives of
the law are other ones on either side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chuteflow.numerics.chebyshev import Array, SplitGrid, split_grid
from chuteflow.steady import kinks
from chuteflow.steady.collocation import stretch_map
from chuteflow.steady.flow import Flow, Profile

#: Degree of a piece of the grid: at least, and so much more than its part of the whole.
_LEAST, _MORE = 12, 6
#: Pieces are not shorter than this. Their nodes at a break lie so far to either side, where the law is that of the
#: piece.
_SHORTEST, BESIDE = 1e-4, 1e-9


@dataclass(frozen=True)
class Resolution:
    """A grid of ``degree``, with the ``reach`` L and the weight ``beta`` of its map."""

    degree: int
    reach: float
    beta: float


@dataclass(frozen=True, eq=False)
class BaseState:
    """A steady flow at the nodes of a ``grid`` in s, from far above down to the base, and d/dz there."""

    flow: Flow
    resolution: Resolution
    grid: SplitGrid
    fraction: Array
    profile: Profile
    derivative: Array
    weights: Array

    @property
    def points(self) -> int:
        """Number of nodes."""
        return len(self.fraction)


def base(flow: Flow, resolution: Resolution) -> BaseState:
    """``flow`` on the grid of ``resolution``; ``weights`` are those of integrals over the height."""
    g = _grid(flow, resolution)
    fraction, rate = overburden_fractions(_beside(g), resolution)
    profile = flow.at_overburden(fraction)
    fall = profile.volume_fraction / (flow.mass_holdup * rate)  # -ds/dz
    return BaseState(
        flow=flow,
        resolution=resolution,
        grid=g,
        fraction=fraction,
        profile=profile,
        derivative=-fall[:, None] * g.derivative,
        weights=g.weights / fall,
    )


def _grid(flow: Flow, resolution: Resolution) -> SplitGrid:
    """The grid in s, in pieces where the density passes breaks of the law."""
    breaks = [0.0]
    for place in _breaks(flow, resolution).tolist():
        if place - breaks[-1] > _SHORTEST and 1.0 - place > _SHORTEST:
            breaks.append(place)
    breaks.append(1.0)
    if len(breaks) == 2:
        return split_grid(np.array(breaks), (resolution.degree,))
    degrees = [max(_LEAST, round(resolution.degree * width) + _MORE) for width in np.diff(breaks)]
    return split_grid(np.array(breaks), tuple(degrees))


def _breaks(flow: Flow, resolution: Resolution) -> Array:
    """Where in s, ascending, the density passes breaks of the law at which its coefficients are continuous."""
    elements = flow.solution.elements
    if not elements.model.kinks.size or not elements.model.kinks_join:
        return np.empty(0)
    m, _ = stretch_map(kinks.crossings(elements), elements.stretch)
    reach, beta = resolution.reach, resolution.beta
    span = reach + beta * -np.expm1(-reach)
    return 1.0 - (beta * (1.0 - m) - np.log(m)) / span


def _beside(g: SplitGrid) -> Array:
    """The nodes, those at a break a little to either side."""
    s = g.nodes.copy()
    s[g.firsts[1:]] += BESIDE
    s[g.firsts[1:] - 1] -= BESIDE
    return s


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
