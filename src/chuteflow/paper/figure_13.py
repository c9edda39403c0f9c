"""Figure 13: the reduced system at lambda = 1 against the full equations.

The paper integrates the reduced system by a Runge-Kutta method; drawn here is its exact solution, which agrees with
:func:`chuteflow.steady.hot.shoot` to the errors of that method.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow import hot
from chuteflow.errors import InputError
from chuteflow.paper.hot_profiles import HotProfiles, draw_profiles, hot_profiles
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.theory.hot import slope_at

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.theory.hot import HotSolution

LAMBDA = 1.0
TEMPERATURE = 100.0
#: Highest point drawn, and ends of the panels.
TOP, POINTS = 600.0, 301
LIMITS = ((0.0, 0.006), (0.0, 300.0), (0.0, 80.0))


def compute(source: Source = OVERBURDEN) -> HotProfiles:
    """The exact solution and the flow, on the slope with lambda = 1."""
    chute = dissipative(0.3)
    slope = slope_at(hot(chute).parameters.dilute, chute.wall_restitution, chute.roughness, LAMBDA)
    if slope is None:
        raise InputError(f"no slope has lambda = {LAMBDA}")
    model = hot(dissipative(slope))
    solution, mu = model.solution, model.parameters.mu
    assert solution is not None  # lambda = 1 is below 3
    z, P = _from_base_up(solution)
    title = "Figure 13: reduced system at lambda = 1 against the full equations"
    fields = solution.psi(P), solution.tau(P), solution.velocity(P, mu)
    return hot_profiles(title, model.chute, TEMPERATURE, z, fields, source)


def _from_base_up(solution: HotSolution) -> tuple[Any, Any]:
    """Heights, and the overburden P of the exact solution there: P evenly in its logarithm."""
    highest = solution.P_b * 1e-4
    P = np.geomspace(solution.P_b, highest, POINTS)
    z = np.maximum(-TEMPERATURE * solution.log_s(P), 0.0)
    return z, P


def draw(data: HotProfiles) -> Figure:
    """Three panels."""
    return draw_profiles(data, "exact solution of\nthe reduced system", LIMITS, TOP)
