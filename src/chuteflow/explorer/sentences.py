"""Sentences that describe what the page shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chuteflow.branches.results import Curve, FlowSet
from chuteflow.io import words
from chuteflow.io.contract import factor
from chuteflow.io.tables import number
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import NUMBERS, Scales

if TYPE_CHECKING:
    from chuteflow.explorer.growth import FlowStability

_COUNTS = ("No flow carries", "One flow carries", "Two flows share", "Three flows share", "Four flows share")
_INVERTED = ", densest above its base"
_WAVES = {
    "along": "waves along the slope",
    "across": "waves across the slope",
    "oblique": "oblique waves",
    "uniform": "as a whole",
}


def of_flow(flow: Flow, among: FlowSet) -> dict[str, str]:
    """The name of a flow among others, and its kinds."""
    return {"name": words.among(flow, among), "kinds": kinds(flow)}


def kinds(flow: Flow) -> str:
    """The kinds of a flow."""
    return f"density {flow.density}, interior {flow.interior}"


def of_flows(found: FlowSet, flux: float, scales: Scales | None) -> str:
    """How many flows carry a flux and how they differ, or why there is none."""
    count = len(found)
    lead = _COUNTS[count] if count < len(_COUNTS) else f"{count} flows share"
    amount = f"Q = {_amount('mass_flux', flux, found.chute, scales)}"
    if not count:
        return f"{lead} {amount}: {words.in_own_units(str(found.reason), scales)}."
    inverted = [_INVERTED if flow.density == "inverted" else "" for flow in found]
    if count == 1:
        return f"{lead} the flux {amount}{inverted[0]}."
    each = [f"one {words.among(flow, found)}{more}" for flow, more in zip(found, inverted, strict=True)]
    return f"{lead} the flux {amount}: {'; '.join(each)}."


def of_curve(found: Curve, scales: Scales | None) -> str:
    """How many flows share each flux."""
    if not found.branches:
        return f"No flow at any flux: {words.in_own_units(str(found.reason), scales)}."
    says = words.multiplicity(found, scales)
    return f"{says[0].upper()}{says[1:]}."


def of_stability(known: FlowStability, chute: Chute, scales: Scales | None) -> str:
    """The stability of a flow, and its fastest growing wave."""
    if known.state == "unknown":
        return f"not known whether it is stable: {known.reason}"
    wave = known.fastest
    if wave is None:
        return "stable: no wave grows"
    says = f"unstable: {_WAVES[wave.direction]}, growth {_rate(wave.growth, chute, scales)}"
    return says if wave.length is None else f"{says}, wavelength {_length(wave.length, chute, scales)}"


def of_waves(known: FlowStability, chute: Chute, scales: Scales | None) -> str:
    """Which wavelengths were examined."""
    if known.searched is None:
        return ""
    shortest, longest = (_length(length, chute, scales) for length in known.searched)
    return f"waves of {shortest} to {longest} searched"


def _amount(name: str, value: float, chute: Chute, scales: Scales | None) -> str:
    unit = "" if scales is None else f" {NUMBERS[name].unit}"
    return f"{number(value * factor(name, chute, scales))}{unit}"


def _length(value: float, chute: Chute, scales: Scales | None) -> str:
    return f"{_short(value * factor('height', chute, scales))} {'d' if scales is None else 'm'}"


def _rate(value: float, chute: Chute, scales: Scales | None) -> str:
    return f"{_short(value * factor('shear_rate', chute, scales))}{'' if scales is None else ' /s'}"


def _short(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"
