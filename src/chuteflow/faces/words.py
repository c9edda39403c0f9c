"""Flows, chutes and ranges said in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise

from chuteflow.analysis.results import Curve, Searched
from chuteflow.faces.contract import factor
from chuteflow.faces.tables import number
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import NUMBERS, Scales
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
_SURFACES = {"free": "free surface", "interface": "interface with free grains above"}


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
        *(f"{word}: {meaning}" for word, meaning in WORDS.items() if word in said),
    ]


def validity(flows: Sequence[Flow], chute: Chute, scales: Scales | None) -> Iterator[str]:
    """How far the flows of a family keep to the theory, a line for each stretch of their surface temperatures."""
    warmth = factor("surface_temperature", chute, scales)
    for summary, stretch in groupby(flows, key=lambda flow: flow.validity.summary):
        ends = [flow.surface_temperature * warmth for flow in stretch]
        yield f"from T_surface = {number(ends[0])} to {number(ends[-1])}: {summary}"


def kinds(flow: Flow) -> str:
    """Density and interior of ``flow``."""
    return f"{_DENSITIES[flow.density]}; {_INTERIORS[flow.interior]}"


def chute(chute: Chute) -> str:
    """All parameters of ``chute``."""
    return (
        f"chute: tan(theta) = {chute.slope:g} ({chute.angle:.4g} degrees), e = {chute.restitution:g}, "
        f"e_w = {chute.wall_restitution:g}, r = {chute.roughness:g}, {_SURFACES[chute.surface]}, "
        f"closure {chute.closure}"
    )


def scales(scales: Scales) -> str:
    """The grains behind results in SI units."""
    grains = f"grains: diameter {scales.diameter:g} m, density {scales.density:g} kg/m^3"
    return f"{grains}; gravity {scales.gravity:g} m/s^2"


def in_own_units(sentence: str, scales: Scales | None) -> str:
    """A sentence of the analyses, whose numbers stay dimensionless beside results in SI units."""
    return sentence if scales is None else f"{sentence} (dimensionless)"


def searched(range_: Searched, chute: Chute, scales: Scales | None) -> str:
    """The range searched."""
    warmth, mass = factor("surface_temperature", chute, scales), factor("mass_holdup", chute, scales)
    low, high = (value * warmth for value in range_.surface_temperature)
    return (
        f"searched: T_surface from {low:.4g} to {high:.4g}{_unit('surface_temperature', scales)}, "
        f"M up to {range_.largest_holdup * mass:.4g}{_unit('mass_holdup', scales)}"
    )


def multiplicity(curve: Curve, scales: Scales | None) -> str:
    """How many flows share one mass flux, from folds and ends of the branches."""
    stretches: list[tuple[float, float]] = []
    for branch in curve.branches:
        turns = [point.flow.mass_flux for point in branch.special if point.kind == "fold-Q"]
        stops = [branch.flows[0].mass_flux, *turns, branch.flows[-1].mass_flux]
        stretches += [(min(pair), max(pair)) for pair in pairwise(stops)]
    edges = sorted({edge for stretch in stretches for edge in stretch})
    counted: list[tuple[int, float, float]] = []
    for low, high in pairwise(edges):
        count = sum(first <= low and high <= last for first, last in stretches)
        if counted and counted[-1][0] == count:
            counted[-1] = (count, counted[-1][1], high)
        else:
            counted.append((count, low, high))
    flux = factor("mass_flux", curve.chute, scales)
    said = [
        f"{count} for Q from {number(low * flux)} to {number(high * flux)}" for count, low, high in counted if count
    ]
    return f"flows that share one mass flux: {', '.join(said)}{_unit('mass_flux', scales)}"


def _unit(name: str, scales: Scales | None) -> str:
    return "" if scales is None else f" {NUMBERS[name].unit}"
