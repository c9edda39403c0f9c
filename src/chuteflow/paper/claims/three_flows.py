"""Section 3.5, figure 2: the three flows at mass flux 3."""

from __future__ import annotations

import itertools
import math
from functools import partial

import numpy as np

from chuteflow import Flow
from chuteflow.paper.claims.registry import Finding, claim, close, decide, rounds_to
from chuteflow.paper.claims.shared import MASS_FLUX, flows_at, named_flows
from chuteflow.steady.collocation import LOG_Q
from chuteflow.steady.mapped.solution import refine
from chuteflow.steady.solver import Condition

#: The numbers in the caption of figure 2, and the flows' names there.
_CAPTION = {
    "A": ("high temperature", {"T_inf": "7.34", "h": "8.84", "M": "0.44"}),
    "B": ("mid-temperature", {"T_inf": "2.54", "h": "3.98", "M": "0.59"}),
    "C": ("low temperature", {"T_inf": "0.19", "h": "1.77", "M": "1.26"}),
}


@claim("three-flows", "section 3.5, figure 2", "At tan(theta) = 0.3 and Q = 3 three flows are possible.")
def three_flows() -> Finding:
    """How many flows there are."""
    found = flows_at()
    low, high = found.searched.surface_temperature
    return decide(
        3.0,
        float(len(found)),
        holds=len(found) == 3,
        reason=f"All flows with T_inf from {low:g} to {high:g} and M up to {found.searched.largest_holdup:g}.",
    )


def _numbers(flow: Flow) -> dict[str, float]:
    return {"T_inf": flow.surface_temperature, "h": flow.centre_of_mass, "M": flow.mass_holdup}


def _as_in_caption(name: str) -> Finding:
    """The numbers of a flow, and those of the paper's own discretisation."""
    flow, printed = named_flows()[name], _CAPTION[name][1]
    computed = _numbers(flow)
    again = refine(flow.chute, flow, Condition.fix(LOG_Q, MASS_FLUX))
    other = {"T_inf": again.surface_temperature, "h": again.centre_of_mass, "M": again.mass_holdup}
    off = [key for key in printed if not rounds_to(computed[key], printed[key])]
    agree = again.converged and all(close(other[key], computed[key], 1e-7) for key in printed)
    cut = all(math.floor(computed[key] * 100.0) / 100.0 == float(printed[key]) for key in off)
    return decide(
        {key: float(text) for key, text in printed.items()},
        computed,
        holds=not off and agree,
        corrected=agree and cut,
        reason=f"Estimated relative error {flow.error:.0e}; the paper's own discretisation with N = {again.degree} "
        "gives the same.",
        correction=" ".join(f"{key} = {computed[key]:.4g} is printed rounded down." for key in off),
    )


for _name, (_kind, _printed) in _CAPTION.items():
    claim(
        f"flow-{_name.lower()}",
        "section 3.5, figure 2",
        f"Flow {_name}, {_kind}: " + ", ".join(f"{key} = {text}" for key, text in _printed.items()) + ".",
    )(partial(_as_in_caption, _name))


@claim(
    "only-cold-inverted",
    "section 3.5, figure 2",
    "Flow C has a density inversion; flow B, like A, has a volume fraction that falls monotonically.",
)
def only_cold_inverted() -> Finding:
    """Kinds of density, and how far the density rises in flow C."""
    found = {name: flow.density for name, flow in named_flows().items()}
    c = named_flows()["C"]
    return decide(
        {"A": "monotonic", "B": "monotonic", "C": "inverted"},
        found,
        holds=found == {"A": "monotonic", "B": "monotonic", "C": "inverted"},
        reason=f"In flow C nu rises from {c.base_volume_fraction:.4g} at the base to {c.largest_volume_fraction:.4g}.",
    )


@claim(
    "slip-falls",
    "section 3.5, figure 2(c)",
    "With increasing density the slip velocity falls, and with it the temperature throughout the depth.",
)
def slip_falls() -> Finding:
    """Slip velocities, and temperatures at equal heights."""
    slips = {name: flow.slip_velocity for name, flow in named_flows().items()}
    z = np.linspace(0.0, 20.0, 101)
    temperatures = [flow.profile(z).granular_temperature for flow in flows_at()]
    cooler = all(bool(np.all(b < a)) for a, b in itertools.pairwise(temperatures))
    return decide(
        "falls from A to B to C",
        slips,
        holds=slips["A"] > slips["B"] > slips["C"] and cooler,
        reason="Slip velocities in sqrt(g d cos theta); temperatures were compared up to z = 20.",
    )


@claim(
    "base-gives-energy",
    "section 3.5, figure 2(b)",
    "The base gives more energy than it takes, the temperature is largest there, and the interior is a net sink.",
)
def base_gives_energy() -> Finding:
    """Heat flux at the base, place of the largest temperature, and kind of the interior."""
    z = np.linspace(0.0, 30.0, 301)
    flux = {name: float(flow.profile(0.0).heat_flux) for name, flow in named_flows().items()}
    hottest_below = all(int(np.argmax(flow.profile(z).granular_temperature)) == 0 for flow in flows_at())
    interiors = {flow.interior for flow in flows_at()}
    return decide(
        "positive",
        flux,
        holds=min(flux.values()) > 0.0 and hottest_below and interiors == {"dissipative"},
        reason=f"Heat flux from the base into the flow; interior {' or '.join(sorted(interiors))} at every height.",
    )


@claim(
    "cutoff-depth",
    "section 3.5",
    "Multiple solutions are also found when the depth is where nu falls to 1 % of its maximum.",
)
def cutoff_depth() -> Finding:
    """The depths by cutoff of the flows at one mass flux."""
    depths = {name: flow.depth for name, flow in named_flows().items()}
    return decide(
        "several",
        depths,
        holds=len(depths) == 3 and min(np.abs(np.diff(list(depths.values())))) > 1.0,
        reason="Depths of the flows at Q = 3, each other than the next by more than a grain.",
    )
