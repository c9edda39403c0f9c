"""Figure 12: the expansion of a hot flow to lambda^2 against the full equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chuteflow import hot
from chuteflow.paper.hot_profiles import HotProfiles, draw_profiles, hot_profiles
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, Source
from chuteflow.theory.hot import expansion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SLOPE = 0.3
TEMPERATURE = 50.0
#: Highest point drawn, and ends of the panels.
TOP, POINTS = 250.0, 501
LIMITS = ((0.0, 0.01), (45.0, 65.0), (0.0, 35.0))


def compute(source: Source = OVERBURDEN) -> HotProfiles:
    """(4.21)-(4.23), with the misprint of (4.23) corrected, and the flow."""
    chute, z = dissipative(SLOPE), np.linspace(0.0, TOP, POINTS)
    parameters = hot(chute).parameters
    fields = expansion(parameters.lambda_, np.exp(-z / TEMPERATURE), parameters.mu)
    title = "Figure 12: expansion to lambda^2 against the full equations"
    return hot_profiles(title, chute, TEMPERATURE, z, fields, source)


def draw(data: HotProfiles) -> Figure:
    """Three panels."""
    return draw_profiles(data, r"expansion to $\lambda^2$", LIMITS, TOP)
