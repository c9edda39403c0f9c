"""Section 3.2 and its use in section 3.4: how the fields end far above the base."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from chuteflow import Flow, Profile, hot
from chuteflow.paper.claims.registry import Finding, claim, close, decide
from chuteflow.paper.claims.shared import SLOPE, Array, named_flows, profile_slope
from chuteflow.paper.materials import dissipative
from chuteflow.theory.hot import Dilute

#: Volume fractions at which far fields are examined, where their terms of next order are small or can be removed.
_THIN = 1e-5


def dilute_limits() -> Dilute:
    """Table 2 for the material of figure 2."""
    return hot(dissipative(SLOPE)).parameters.dilute


def net_production() -> float:
    """tan^2(theta)/g20 - g52, which is -delta."""
    return -hot(dissipative(SLOPE)).parameters.delta


def _at(flow: Flow, nu: float) -> Profile:
    """The fields where the volume fraction is near ``nu`` and where it is near half of it."""
    heights = np.linspace(0.0, 40.0 * flow.surface_temperature + flow.depth, 400)
    density = flow.profile(heights).volume_fraction
    z = float(np.interp(-math.log(nu), -np.log(density), heights))
    return flow.profile([z, z + flow.surface_temperature * math.log(2.0)])


def thin_limit(flow: Flow, ratio: Callable[[Profile], Array], nu: float = _THIN) -> float:
    """The limit of a ratio of fields at vanishing volume fraction: linear in it, so that two values suffice."""
    at = _at(flow, nu)
    (first, last), (thick, thin) = ratio(at), at.volume_fraction
    return float((thick * last - thin * first) / (thick - thin))


def decay_rate(flow: Flow, field: Callable[[Profile], Array], nu: float) -> float:
    """How fast a field decays, in units of 1/T_inf."""
    at = _at(flow, nu)
    first, last = field(at)
    return float(math.log(first / last) * flow.surface_temperature / (at.height[1] - at.height[0]))


@claim("far-density", "section 3.2, (3.23)", "nu = a exp(-z/T_inf) far above the base.")
def far_density() -> Finding:
    """The rate at which the volume fraction decays, times T_inf."""
    rates = {name: decay_rate(flow, lambda at: at.volume_fraction, _THIN) for name, flow in named_flows().items()}
    return decide(
        1.0,
        rates,
        holds=all(close(rate, 1.0, 1e-3) for rate in rates.values()),
        reason=f"The rate of decay times T_inf, where nu is near {_THIN:g}, in the flows of figure 2.",
    )


@claim(
    "far-gradient",
    "section 3.2, (3.21)",
    "dT/dz = (g40/g30) nu - q/(g30 sqrt(T)) at small volume fraction.",
)
def far_gradient() -> Finding:
    """The factor of nu, from profiles alone."""
    limits = dilute_limits()
    printed = limits.g40 / limits.g30

    def factor(at: Profile, flow: Flow) -> Array:
        gradient = profile_slope(flow, "granular_temperature", *at.height)(at.height)
        return (gradient + at.heat_flux / (limits.g30 * np.sqrt(at.granular_temperature))) / at.volume_fraction

    found = {name: thin_limit(flow, lambda at, f=flow: factor(at, f), 1e-4) for name, flow in named_flows().items()}
    falls = all(np.diff(_at(flow, _THIN).granular_temperature)[0] < 0.0 for flow in named_flows().values())
    return decide(
        printed,
        found,
        holds=all(close(value, printed, 1e-3) for value in found.values()),
        corrected=falls and all(close(value, -printed, 1e-3) for value in found.values()),
        reason="The factor of nu in the flows of figure 2.",
        correction="With dnu/dz = -nu/T (3.20) in (3.6) the sign is minus; the temperature falls towards T_inf, as "
        "(3.24) says. A minus may be missing in our copy of the paper alone: nothing else follows from it.",
    )


@claim(
    "far-temperature",
    "section 3.2, (3.24); (A 1)",
    "T = T_inf + (g40/g30) T_inf a exp(-z/T_inf) far above the base.",
)
def far_temperature() -> Finding:
    """The excess of temperature over T_inf nu."""
    limits = dilute_limits()
    printed = limits.g40 / limits.g30
    found = {name: thin_limit(flow, lambda at, f=flow: excess(at, f), 1e-4) for name, flow in named_flows().items()}
    return decide(
        printed,
        found,
        holds=all(close(value, printed, 5e-3) for value in found.values()),
        reason="(T - T_inf)/(T_inf nu) in the flows of figure 2, against g40/g30.",
    )


def excess(at: Profile, flow: Flow) -> Array:
    """(T - T_inf)/(T_inf nu)."""
    return (at.granular_temperature / flow.surface_temperature - 1.0) / at.volume_fraction


@claim(
    "far-heat-flux",
    "section 3.2, (3.25)",
    "q = -(1/2) (tan^2(theta)/g20 - g52) T_inf^(5/2) a^2 exp(-2 z/T_inf) far above the base.",
)
def far_heat_flux() -> Finding:
    """The heat flux over T_inf^(5/2) nu^2."""
    printed = -0.5 * net_production()
    found = {
        name: thin_limit(flow, lambda at, T=flow.surface_temperature: at.heat_flux / (T**2.5 * at.volume_fraction**2))
        for name, flow in named_flows().items()
    }
    return decide(
        printed,
        found,
        holds=all(close(value, printed, 1e-3) for value in found.values()),
        reason="q/(T_inf^(5/2) nu^2) in the flows of figure 2.",
    )


@claim(
    "map-analytic",
    "section 3.4, (3.29)-(3.30)",
    "With zeta = exp(-z/L), sqrt(nu) is analytic at zeta = 0 where L = 2 k T_inf with an integer k, so that its "
    "Chebyshev coefficients decay exponentially.",
)
def map_analytic() -> Finding:
    """The last of 64 coefficients, over the first, for L = 2 T_inf, 3 T_inf and 4 T_inf, in flow B."""
    flow = named_flows()["B"]
    tails = {f"L = {ratio} T_inf": _tail(flow, ratio) for ratio in (2, 3, 4)}
    analytic, rough = (tails["L = 2 T_inf"], tails["L = 4 T_inf"]), tails["L = 3 T_inf"]
    return decide(
        "exponential for L = 2 T_inf and 4 T_inf",
        tails,
        holds=max(analytic) < 1e-8 and rough > 30.0 * max(analytic),
        reason="Size of the last of 64 coefficients over that of the first, in flow B.",
    )


def _tail(flow: Flow, ratio: float) -> float:
    nodes = np.cos(np.pi * (np.arange(64) + 0.5) / 64.0)
    z = -ratio * flow.surface_temperature * np.log(0.5 * (1.0 + nodes))
    values = np.sqrt(flow.profile(z).volume_fraction)
    coefficients = np.abs(np.polynomial.chebyshev.chebfit(nodes, values, 63))
    return float(coefficients[-4:].max() / coefficients[0])
