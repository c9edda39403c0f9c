"""Flows, chutes and ranges said in words."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import groupby

from chuteflow.branches.counting import FlowCount, flux_counts
from chuteflow.branches.nearest import Nearest
from chuteflow.branches.results import Curve, FlowSet, Searched
from chuteflow.io.contract import factor
from chuteflow.io.tables import number
from chuteflow.parameters import CONDITIONS, PARAMETERS
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import SCALED, Scales
from chuteflow.steady.validity import WORDS

_DENSITIES = {
    "monotonic": "density falls with height everywhere (monotonic)",
    "inverted": "densest above the base (density inverted)",
}
_INTERIORS = {
    "dissipative": "interior dissipative throughout",
    "productive": "interior productive throughout",
    "mixed": "interior productive in some places and dissipative in others (mixed)",
}


def introduction(chute_: Chute, scales_: Scales | None) -> Iterator[str]:
    """The chute of a report, and with scales its grains."""
    yield chute(chute_)
    if scales_ is not None:
        yield scales(scales_)


def search_outcome(found: FlowSet | Curve, scales: Scales | None, near: Sequence[str] = ()) -> Iterator[str]:
    """Why there is no flow, followed by the lines ``near``; whether there may be more; and the range searched."""
    if found.reason:
        yield in_own_units(f"no flow: {found.reason}", scales)
        yield from near
    if found.incomplete:
        yield in_own_units(f"there may be more: {found.incomplete}", scales)
    yield searched(found.searched, found.chute, scales)


def among(flow: Flow, flows: Sequence[Flow]) -> str:
    """The name of ``flow``; where others of them have the same one, its number among these, in their order."""
    alike = [other for other in flows if other.name == flow.name]
    return flow.name if len(alike) < 2 else f"{flow.name} ({alike.index(flow) + 1} of {len(alike)})"


def notes(flows: Sequence[Flow]) -> list[str]:
    """What the columns and words of a table of ``flows`` mean that do not explain themselves."""
    said = {word for flow in flows for word in flow.validity.words}
    depth = "that of the interface, or " if any(flow.chute.surface == "interface" for flow in flows) else ""
    return [
        f"depth: {depth}the height above which nu is below 1 % of nu_max; the centre of mass is h",
        "U: Q/M; Fr: U/sqrt(g cos(theta) depth); nu_mean: over the depth",
        *(f"{word}: {meaning}" for word, meaning in WORDS.items() if word in said),
    ]


def validity(flows: Sequence[Flow], chute: Chute, scales: Scales | None) -> Iterator[str]:
    """How far the flows of a branch keep to the theory, a line for each stretch of their surface temperatures."""
    scale = factor("surface_temperature", chute, scales)
    for summary, stretch in groupby(flows, key=lambda flow: flow.validity.summary):
        ends = [flow.surface_temperature * scale for flow in stretch]
        yield f"from T_surface = {number(ends[0])} to {number(ends[-1])}: {summary}"


def kinds(flow: Flow) -> str:
    """Density and interior of ``flow``."""
    return f"{_DENSITIES[flow.density]}; {_INTERIORS[flow.interior]}"


def chute(chute: Chute) -> str:
    """All parameters of ``chute``."""
    return f"chute: {chute.summary}"


def scales(scales: Scales) -> str:
    """The grains behind results in SI units."""
    grains = f"grains: diameter {scales.diameter:g} m, density {scales.density:g} kg/m^3"
    return f"{grains}; gravity {scales.gravity:g} m/s^2"


def in_own_units(sentence: str, scales: Scales | None) -> str:
    """A sentence of the analyses, whose numbers stay dimensionless beside results in SI units."""
    if scales is None:
        return sentence
    # What was searched is said in SI units on a line of its own.
    sentence = re.sub(r" \(searched: [^)]*\)$", "", sentence)
    return f"{sentence} (dimensionless)" if re.search(r"\d", sentence) else sentence


def searched(range_: Searched, chute: Chute, scales: Scales | None) -> str:
    """The range searched."""
    temperature, mass = factor("surface_temperature", chute, scales), factor("mass_holdup", chute, scales)
    low, high = (value * temperature for value in range_.surface_temperature)
    return (
        f"searched: T_surface from {low:.4g} to {high:.4g}{unit_after('surface_temperature', scales)}, "
        f"M up to {range_.largest_holdup * mass:.4g}{unit_after('mass_holdup', scales)}"
    )


def nearest(found: Nearest, scales: Scales | None) -> Iterator[str]:
    """What is nearest to a chute without a flow, one number changed at a time."""
    known = {name: value for name, value in found.parameters.items() if value is not None}
    said = [
        f"{PARAMETERS[name].symbol} = {number(value)}"
        + (f" ({math.degrees(math.atan(value)):.4g} degrees)" if name == "slope" else "")
        for name, value in known.items()
    ]
    if found.quantity is not None and found.value is not None:
        name = CONDITIONS[found.quantity].quantity
        said.append(f"{found.quantity} = {amount(name, found.value, found.chute, scales)}")
    none = [
        f"{PARAMETERS[name].symbol} from {number(low)} to {number(high)}"
        for name, (low, high) in found.examined.items()
        if name not in known
    ]
    if said:
        yield f"nearest with a flow, one number changed at a time: {' or '.join(said)}"
    if none:
        yield f"no flow either with {' or '.join(none)}, at the values examined"


def multiplicity(curve: Curve, scales: Scales | None) -> str:
    """How many flows share one mass flux, from folds and ends of the branches."""
    flux, unit = factor("mass_flux", curve.chute, scales), unit_after("mass_flux", scales)
    counts = flux_counts(curve)
    known = [f"{'at least ' if c.at_least else ''}{c.flows} for {_fluxes(c, flux)}" for c in counts if c.flows]
    unknown = [_fluxes(c, flux) for c in counts if c.at_least and not c.flows]
    said = f"flows that share one mass flux: {', '.join(known)}{unit}"
    if unknown:
        said += f"; not known for {' and '.join(unknown)}{unit}"
    if any(c.at_least for c in counts):
        said += ", where branches leave the range searched"
    return said


def _fluxes(count: FlowCount, factor: float) -> str:
    """The mass fluxes of a count."""
    low, high = number(count.low * factor), number(count.high * factor)
    if count.low == 0.0:
        return f"Q below {high}"
    return f"Q above {low}" if count.high == math.inf else f"Q from {low} to {high}"


def amount(name: str, value: float, chute: Chute, scales: Scales | None) -> str:
    """A dimensionless value of the quantity ``name``, with its unit where there are ``scales``."""
    return f"{number(value * factor(name, chute, scales))}{unit_after(name, scales)}"


def unit_after(name: str, scales: Scales | None) -> str:
    """The unit of a quantity after a space; nothing without scales or unit."""
    return "" if scales is None or SCALED[name].unit == "1" else f" {SCALED[name].unit}"
