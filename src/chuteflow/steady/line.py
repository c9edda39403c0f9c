"""Numbers of flows along a line of them, such as a branch."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from chuteflow.numerics.chebyshev import Array


class LineOfFlows:
    """What the ``flows`` of a line, in order, have along it: arrays (k,)."""

    flows: tuple[Any, ...]

    @cached_property
    def mass_flux(self) -> Array:
        """Q along the line."""
        return np.array([flow.mass_flux for flow in self.flows])

    @cached_property
    def centre_of_mass(self) -> Array:
        """h along the line."""
        return np.array([flow.centre_of_mass for flow in self.flows])

    @cached_property
    def mass_holdup(self) -> Array:
        """M along the line."""
        return np.array([flow.mass_holdup for flow in self.flows])

    @cached_property
    def surface_temperature(self) -> Array:
        """T_surface along the line."""
        return np.array([flow.surface_temperature for flow in self.flows])
