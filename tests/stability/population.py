"""Random flows, and their growing modes looked for again with another family of maps."""

from collections.abc import Iterator

import numpy as np

import chuteflow
from chuteflow.numerics.chebyshev import split_grid
from chuteflow.numerics.eigenproblem import refine_eigenvalue
from chuteflow.stability.base import BaseState, Resolution
from chuteflow.stability.linear import operator
from chuteflow.stability.modes import Mode


def random_flows(seed: int, count: int) -> Iterator[chuteflow.Flow]:
    """Flows of random chutes at random fluxes from 0.1 to 300, one of each set."""
    rng = np.random.default_rng(seed)
    found = 0
    while found < count:
        chute = chuteflow.Chute(
            slope=rng.uniform(0.15, 0.6),
            restitution=rng.uniform(0.6, 0.98),
            wall_restitution=rng.uniform(0.4, 1.0),
            roughness=rng.uniform(0.5, 0.866),
        )
        flows = chuteflow.flows(chute, Q=10.0 ** rng.uniform(-1.0, 2.5), tolerance=1e-9)
        if len(flows):
            found += 1
            yield flows[int(rng.integers(len(flows)))]


def rational_base(flow: chuteflow.Flow, degree: int, reach: float, crowding: float) -> BaseState:
    """The flow with ln m = -L (1 - s)/(1 + c s), a map of another kind than those of the modes."""
    g = split_grid(np.array([0.0, 1.0]), (degree,))
    below = 1.0 + crowding * g.nodes
    share = np.exp(-reach * (1.0 - g.nodes) / below)
    profile = flow.at_overburden(share)
    rate = share * reach * (1.0 + crowding) / below**2  # dm/ds
    fall = profile.volume_fraction / (flow.mass_holdup * rate)
    return BaseState(
        flow, Resolution(degree, reach, 0.0), g, share, profile, -fall[:, None] * g.derivative, g.weights / fall
    )


def seen_again(mode: Mode, degree: int = 90, crowding: float = 2.0) -> float:
    """Change of the rate of ``mode`` on the other map."""
    other = operator(rational_base(mode.flow, degree, mode.operator.base.resolution.reach + 1.0, crowding))
    return abs(refine_eigenvalue(other.matrix(mode.kx, mode.ky), other.weights, mode.sigma)[0] - mode.sigma)
