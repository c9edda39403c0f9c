"""Section 3.7, figures 7 to 9: the interface conditions of Jenkins & Hanes (1993)."""

from __future__ import annotations

import math

import numpy as np

from chuteflow import flows
from chuteflow.paper.claims.flow_curves import inversion_onset, largest_excess
from chuteflow.paper.claims.registry import Finding, claim, close, decide
from chuteflow.paper.claims.shared import (
    GENTLE,
    MASS_FLUX,
    NAMES,
    SLOPE,
    STEEP,
    all_flows,
    count,
    curve_of,
    flows_at,
    folds,
    named_flows,
)
from chuteflow.paper.materials import dissipative
from chuteflow.steady.collocation import LOG_Q
from chuteflow.steady.mapped.solution import refine, solve_mapped
from chuteflow.steady.solver import Condition
from chuteflow.theory.boundary import INTERFACE_STRESS


@claim(
    "interface-stress",
    "section 3.7, (3.31)",
    "At the interface the mean free time is the time of a ballistic flight, which gives p = sqrt(pi/48).",
)
def interface_stress() -> Finding:
    """The stress by integration over the relative speeds of two Maxwellian grains, at T = 1."""
    printed = math.sqrt(math.pi / 48.0)
    # Both in diameters: a grain sweeps n pi v, with n = 6 nu/pi, and relative speeds have twice the variance.
    speed = np.linspace(0.0, 25.0, 200_001)
    weight = 4.0 * math.pi * speed**2 * np.exp(-(speed**2) / 4.0) / (4.0 * math.pi) ** 1.5
    collisions = 6.0 * float(np.trapezoid(speed * weight, speed))  # a unit of time, over nu
    flight = 2.0  # up and down at the speed sqrt(T)
    stress = 1.0 / (collisions * flight)  # nu T
    above = {p: min(p / named_flows()["A"].mass_holdup, 1.0) for p in (printed, stress)}
    return decide(
        printed,
        stress,
        holds=close(stress, printed, 1e-6),
        corrected=close(stress, math.sqrt(math.pi) / 48.0, 1e-6) and close(stress, INTERFACE_STRESS, 1e-6),
        reason=f"With p = {printed:.3g} {above[printed]:.0%} of flow A would lie above the interface, with p = "
        f"{stress:.3g} {above[stress]:.0%}.",
        correction="It is p = sqrt(pi)/48: the root is of pi alone.",
    )


@claim(
    "interface-heats",
    "section 3.7, (3.32)",
    "The heat flux at the interface is q = -p sqrt(T) tan^2(theta), downwards: saltating grains heat the flow.",
)
def interface_heats() -> Finding:
    """q/(p sqrt(T)) at the interface, and q as the energy gained by the slope's pull in a flight."""
    found = {}
    for name, flow in named_flows("interface").items():
        at = flow.profile(flow.interface_height)
        found[name] = float(at.heat_flux / (at.normal_stress * np.sqrt(at.granular_temperature)))
    # A grain thrown up at sqrt(T) = 1 flies for 2 and gains 2 tan(theta) along the slope; each returns 2 of momentum.
    gained = 0.5 * (2.0 * SLOPE) ** 2 / 2.0
    return decide(
        -(SLOPE**2),
        found,
        holds=close(gained, SLOPE**2, 1e-12) and all(close(value, -gained, 1e-8) for value in found.values()),
        reason="q/(p sqrt(T)) at the interfaces of the three flows at Q = 3; grains that all fly up at sqrt(T) bring "
        f"back {gained:.4g}.",
    )


@claim(
    "interface-profiles",
    "section 3.7, figure 7",
    "The three flows at Q = 3 have the same features with interface conditions, which have only a small influence on "
    "the profiles.",
)
def interface_profiles() -> Finding:
    """The largest change of the volume fraction over its maximum, below the interface."""
    free, below = flows_at(), flows_at("interface")
    alike = [(flow.density, flow.interior) for flow in free] == [(flow.density, flow.interior) for flow in below]
    changes = {}
    for name, a, b in zip(NAMES, free, below, strict=False):
        z = np.linspace(0.0, b.interface_height, 201)
        change = np.abs(b.profile(z).volume_fraction - a.profile(z).volume_fraction).max()
        changes[name] = float(change / a.largest_volume_fraction)
    largest = max(changes.values())
    depth = {name: b.centre_of_mass / a.centre_of_mass - 1.0 for name, a, b in zip(NAMES, free, below, strict=False)}
    return decide(
        "small",
        changes,
        holds=len(below) == 3 and alike and largest < 0.1,
        corrected=len(below) == 3 and alike,
        reason="Largest change of nu over its maximum; the centre-of-mass changes by "
        + ", ".join(f"{value:.1%} in {name}" for name, value in depth.items())
        + ".",
        correction="All three flows keep their kind of density and interior, but only in C is the change small: the "
        "dilute flows A and B have much of their mass near the surface.",
    )


@claim(
    "interface-cold-branch",
    "section 3.7, figure 8",
    "The surface condition has little influence on the Q-h relationship on the low temperature branch.",
)
def interface_cold_branch() -> Finding:
    """Relative changes of h on the low and the mid-temperature branch."""
    cold = {}
    for Q in (1.0, 2.0, 3.0, 4.0):
        a, b = (flows(dissipative(SLOPE, surface), Q=Q)[-1] for surface in ("free", "interface"))
        cold[f"Q = {Q:g}"] = b.centre_of_mass / a.centre_of_mass - 1.0
    middle = named_flows("interface")["B"].centre_of_mass / named_flows()["B"].centre_of_mass - 1.0
    largest = max(map(abs, cold.values()))
    return decide(
        "little",
        cold,
        holds=largest < 0.03 and largest < 0.5 * abs(middle),
        reason="Relative changes of h at given Q on that branch; flow B, on the branch above, changes by "
        f"{middle:.1%}.",
    )


@claim(
    "interface-transition",
    "section 3.7, figure 9",
    "With interface conditions too there are three flows up to tan(theta) = 0.33, and a minimum mass flux from 0.34 "
    "on.",
)
def interface_transition() -> Finding:
    """Folds of Q by slope, with either surface condition."""
    slopes = sorted({*GENTLE, *STEEP})
    numbers = {
        surface: [len(folds(curve_of(dissipative(slope, surface)))) for slope in slopes]
        for surface in ("free", "interface")
    }
    expected = [2 if slope <= 0.33 else 1 for slope in slopes]
    cold = count(curve_of(dissipative(0.34, "interface")), 50.0)
    return decide(
        {"folds up to 0.33": 2.0, "folds from 0.34": 1.0},
        {f"{slope:g}": float(n) for slope, n in zip(slopes, numbers["interface"], strict=True)},
        holds=numbers["interface"] == expected and numbers["free"] == expected,
        reason="Numbers of folds of Q by slope, the same with both conditions. As on the half-line, at 0.34 a branch "
        f"of cold, dense flows is left beside the fold: {cold} flows share Q = 50.",
    )


@claim(
    "interface-inversion",
    "section 3.7, figure 9",
    "At tan(theta) = 0.29 there are inverted flows on the half-line, but none with interface conditions.",
)
def interface_inversion() -> Finding:
    """The slopes of the first inversion, and the most inverted flow by the paper's own discretisation."""
    onset = {surface: inversion_onset(surface) for surface in ("free", "interface")}
    most = max(all_flows(curve_of(dissipative(0.29, "interface"))), key=lambda flow: flow.density_excess)
    again = refine(most.chute, most, Condition.fix(LOG_Q, most.mass_flux))
    z = np.linspace(0.0, most.interface_height * (1.0 - 1e-9), 400)
    rises = again.profile(z).volume_fraction
    gain = float(rises.max() / rises[0] - 1.0)
    return decide(
        {"free": "some", "interface": "none"},
        {f"onset, {surface}": slope for surface, slope in onset.items()},
        holds=onset["free"] < 0.29 and largest_excess(0.29, "interface") <= 0.0,
        corrected=again.converged and gain > 1e-5 and onset["interface"] < 0.29,
        reason="Slopes from which on some flow is inverted.",
        correction=f"The onset is a little earlier with interface conditions, not later: at 0.29 a flow with Q = "
        f"{most.mass_flux:.3g} has its maximum above the base, higher by {gain:.1e}, by both discretisations.",
    )


@claim(
    "interface-coefficients",
    "section 3.7",
    "Many fewer Chebyshev polynomials are needed for a given tolerance with interface conditions.",
)
def interface_coefficients() -> Finding:
    """Degrees at which the paper's own discretisation has a relative error of 1e-8 in Q, h and M."""
    degrees = {}
    for surface in ("free", "interface"):
        for name, flow in named_flows(surface).items():
            found = refine(flow.chute, flow, Condition.fix(LOG_Q, MASS_FLUX), 1e-8)
            degrees[surface, name] = found.degree if found.converged else math.inf
    fewer = [degrees["interface", name] < degrees["free", name] for name in NAMES]
    much = [degrees["interface", name] < 0.6 * degrees["free", name] for name in NAMES]
    return decide(
        "many fewer",
        {f"{name}, {surface}": float(degree) for (surface, name), degree in degrees.items()},
        holds=all(much),
        corrected=much[-1] and not all(fewer),
        reason="Degrees N of (3.28) for a relative error of 1e-8 in Q, h and M at Q = 3.",
        correction="So it is for the cold flow, with its thin dilute layer at the top. For hot flows the exponential "
        "map with L near 2 h does as well.",
    )


@claim(
    "interface-converges",
    "section 3.7",
    "With interface conditions the pseudospectral expansion converges exponentially quickly.",
)
def interface_converges() -> Finding:
    """Decades by which the coefficients of X and Y fall for each ten more, while above rounding."""
    rates, straight = {}, []
    for name, flow in named_flows("interface").items():
        found = solve_mapped(flow.chute, flow, Condition.fix(LOG_Q, MASS_FLUX), 60)
        for symbol, series in (("X", found.x_coefficients), ("Y", found.y_coefficients)):
            logs = np.log10(np.abs(series) / np.abs(series).max())
            # Coefficients may vanish by chance: the largest from each on does not.
            envelope = np.maximum.accumulate(logs[::-1])[::-1]
            n = np.arange(len(logs))[envelope > -13.0]
            line = np.polynomial.Polynomial.fit(n, envelope[n], 1)
            rates[f"{symbol} of {name}"] = -10.0 * float(line.convert().coef[1])
            straight.append(float(np.abs(envelope[n] - line(n)).max()))
    return decide(
        "exponentially",
        rates,
        holds=min(rates.values()) > 2.0 and max(straight) < 2.0,
        reason="Decades by which the coefficients of (3.28) fall for ten more of them, in the three flows at Q = 3. "
        f"A straight line fits ln |a_n| against n to {max(straight):.1f} decades over the 13 above rounding.",
    )
