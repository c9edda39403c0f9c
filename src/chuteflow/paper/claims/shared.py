"""Computations that several claims use, done once in a process."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from chuteflow import Chute, Curve, Flow, FlowSet, curve, flows
from chuteflow.branches.counting import flows_at_flux
from chuteflow.branches.lines import in_order
from chuteflow.paper.materials import dissipative
from chuteflow.theory.constitutive import Coefficients
from chuteflow.theory.laws import law

#: Mass flux of figures 2, 5, 7 and 15, and their slope.
MASS_FLUX, SLOPE = 3.0, 0.3
#: Slopes of figures 4 and 9: gentle in panel (a), steep in panel (b).
GENTLE = (0.22, 0.24, 0.26, 0.28, 0.29, 0.3)
STEEP = (0.3, 0.31, 0.32, 0.33, 0.34, 0.35, 0.36)
#: Slopes of figure 6.
PRODUCTIVE = (0.4, 0.41, 0.42, 0.43, 0.44)
#: Names of the flows of figure 2, from hot to cold.
NAMES = ("A", "B", "C")

Array = NDArray[np.float64]


@cache
def flows_at(surface: str = "free", closure: str = "lun") -> FlowSet:
    """The flows of figure 2, or of figures 7 and 15."""
    return flows(dissipative(SLOPE, surface, closure), Q=MASS_FLUX)


def named_flows(surface: str = "free", closure: str = "lun") -> dict[str, Flow]:
    """The flows of figure 2 by name."""
    return dict(zip(NAMES, flows_at(surface, closure), strict=True))


@cache
def hot_flow(chute: Chute, temperature: float) -> Flow:
    """The hottest flow with this surface temperature and the least hold-up."""
    return flows(chute, T_surface=temperature)[0]


@cache
def curve_of(chute: Chute, coldest: float = 1e-3, points: int = 80) -> Curve:
    """All flows with surface temperatures from ``coldest`` to 1e4 and hold-ups up to 30."""
    return curve(chute, surface_temperature=(coldest, 1e4), points=points)


def all_flows(found: Curve) -> list[Flow]:
    """Every flow of a curve, special points included."""
    return [point.flow for branch in found.branches for point in in_order(branch)]


def folds(found: Curve) -> list[float]:
    """Mass fluxes at which two flows meet, ascending."""
    return sorted(
        point.flow.mass_flux for branch in found.branches for point in branch.special if point.kind == "fold-Q"
    )


def count(found: Curve, mass_flux: float) -> int:
    """How many flows of a curve have this mass flux."""
    return flows_at_flux(found.branches, mass_flux)


def closures(nu: Array, e: float) -> Coefficients:
    """Table 1 at ``nu``."""
    lun = law("lun")
    return lun.coefficients(nu, 1.0 - nu / lun.densest, e, SLOPE)


def slope_of(field: Callable[[Array], Array], first: float, last: float) -> Callable[[Array], Array]:
    """Derivative of a smooth function of height between two heights, by a polynomial through 24 of its values."""
    nodes = 0.5 * (first + last) + 0.5 * (last - first) * np.cos(np.pi * (np.arange(24) + 0.5) / 24.0)
    fit = np.polynomial.Chebyshev.fit(nodes, field(nodes), 23, domain=[first, last])
    return fit.deriv()


def profile_slope(flow: Flow, name: str, first: float, last: float) -> Callable[[Array], Array]:
    """Derivative of a field of the profile of ``flow`` between two heights."""
    return slope_of(lambda z: getattr(flow.profile(z), name), first, last)
