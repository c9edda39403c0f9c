"""What a request asks: the chute and the flux of its query, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from chuteflow.errors import InputError
from chuteflow.faces.contract import PARAMETERS
from chuteflow.steady.chute import SURFACES, Chute
from chuteflow.theory.boundary import ROUGHNESS_RANGE
from chuteflow.theory.laws import LAWS

#: Fluxes that the page offers.
FLUX_RANGE = (1e-3, 1e5)


@dataclass(frozen=True)
class Control:
    """A slider: its range and what it means. The number field beside it takes all that a chute allows."""

    label: str
    symbol: str
    low: float
    high: float
    logarithmic: bool
    meaning: str


CONTROLS = {
    "slope": Control("Slope", "tan θ", 0.05, 0.7, False, "How steep the chute is: it drives the flow."),
    "e": Control("Restitution", "e", 0.5, 1.0, False, "Speed kept when two grains collide: 1 loses no energy."),
    "ew": Control("Wall restitution", "e_w", 0.0, 1.0, False, "Speed kept when a grain hits the base."),
    "roughness": Control("Roughness", "r", *ROUGHNESS_RANGE, False, "How deep the bumps of the base are."),
    "Q": Control("Mass flux", "Q", *FLUX_RANGE, True, "Grains that pass per unit width and time."),
}


@dataclass(frozen=True)
class Preset:
    """A case worth looking at."""

    title: str
    state: Mapping[str, float | str]


_BASE = {"slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6, "surface": "free", "closure": "lun", "Q": 3.0}
PRESETS = (
    Preset("Three flows at one flux (figures 2, 3)", _BASE),
    Preset("Gentle slope: no density inversion", _BASE | {"slope": 0.28}),
    Preset("Steep: every flow with its density inverted", _BASE | {"slope": 0.34, "Q": 10.0}),
    Preset("Productive interior, hottest inside", _BASE | {"slope": 0.42, "e": 0.9, "ew": 0.6, "roughness": 0.8}),
    Preset("Beneath an interface (figures 7 to 9)", _BASE | {"surface": "interface"}),
    Preset("Heat flux by Fourier's law (figures 15 to 17)", _BASE | {"closure": "lun-fourier"}),
    Preset("Too steep for hot flows", _BASE | {"slope": 0.45}),
)

_DEFAULTS = {"surface": SURFACES[0], "closure": next(iter(LAWS))}


def read(query: Mapping[str, str], *, other: tuple[str, ...] = ()) -> tuple[Chute, dict[str, str]]:
    """The chute that a query names, and its values of ``other``.

    Raises:
        InputError: for parameters that are missing, unknown or out of range.
    """
    allowed = (*PARAMETERS, *other)
    unknown = [name for name in query if name not in allowed]
    if unknown:
        raise InputError(f"unknown parameter {unknown[0][:40]!r}: choose from {', '.join(allowed)}")
    given = {**_DEFAULTS, **query}
    missing = [name for name in allowed if name not in given]
    if missing:
        raise InputError(f"missing {', '.join(missing)}: for example {missing[0]}={_BASE.get(missing[0], 'slope')}")
    chute: dict[str, Any] = {long: given[short] for short, long in PARAMETERS.items()}
    return Chute(**chute), {name: given[name] for name in other}


def flux(text: str) -> float:
    """The flux of a query.

    Raises:
        InputError: for what is no number, or out of range.
    """
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"Q = {text[:40]!r}: must be a number") from None
    low, high = FLUX_RANGE
    if not (math.isfinite(value) and low <= value <= high):
        raise InputError(f"Q = {value:g}: must be from {low:g} to {high:g}")
    return value
