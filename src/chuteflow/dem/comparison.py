"""A measured flow compared with the theory: with flows at the same hold-up or flux, and with functions of laws.

# notation: nu, T, u as everywhere; p/M fraction of the hold-up above; g1, g2, g5 of (2.7); F1 = u_b/sqrt(T_b), (3.15).

Profiles are compared at equal fractions of the overburden, so that no height of the base has to be chosen. A measured
function is compared with that of a law at the measured volume fraction and temperature, averaged in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from chuteflow.branches.enumeration import flows
from chuteflow.dem.averages import fields_at_overburden
from chuteflow.dem.measured import Measured
from chuteflow.dem.output import Array
from chuteflow.errors import InputError
from chuteflow.steady.flow import Flow
from chuteflow.theory import boundary
from chuteflow.theory.constitutive import Law, reduce
from chuteflow.theory.laws import law

#: Tenths of the overburden that are compared: p/M from 0.1 to 0.8. Nearer to the base is the layer that lies on it.
COMPARED = slice(0, 7)
_FRACTIONS = (np.arange(1, 10) / 10.0)[COMPARED] + 0.05
_WITHIN = (np.arange(8) + 0.5) / 80.0
#: A difference within so many errors is none; one below this fraction is small.
ERRORS, SMALL = 2.0, 0.05
MAPPINGS = {"area": "roughness_by_area", "spacing": "roughness"}
_FIELDS = ("volume_fraction", "granular_temperature", "velocity")
FUNCTIONS = ("g1", "g2", "g5")
#: The equation of state with the temperature of the upward velocity alone, P_zz/(g1 T_z).
UPWARD = "g1 by T_z"
#: How functions and numbers are called in sentences.
WORDS = {
    "g1": "equation of state",
    "g2": "viscosity",
    "g5": "dissipation",
    "slip": "slip at the base",
    "base heat": "heat from the base",
    "mass_flux": "mass flux",
    "mass_holdup": "hold-up",
    "mean_temperature": "mean temperature",
    "slip_velocity": "slip velocity",
    "volume_fraction": "profile of nu",
    "granular_temperature": "profile of T",
    "velocity": "profile of u",
}


@dataclass(frozen=True)
class Difference:
    """A measured number and that of the theory.

    ``relative`` is (measured - theory)/theory, ``error`` the standard error of it, NaN where it is not known.
    """

    name: str
    measured: float
    theory: float
    relative: float
    error: float

    @property
    def errors(self) -> float:
        """The difference in units of its error."""
        return self.relative / self.error if self.error > 0.0 else math.nan

    @property
    def agreement(self) -> str:
        """ "agrees" within two errors, "close" within 5 %, "differs", or "unknown"."""
        if not math.isfinite(self.relative):
            return "unknown"
        if math.isfinite(self.error) and abs(self.relative) <= ERRORS * self.error:
            return "agrees"
        return "close" if abs(self.relative) <= SMALL else "differs"


@dataclass(frozen=True, eq=False)
class Candidate:
    """A flow of the theory at the same ``condition`` as the measured one, "M" or "Q"."""

    closure: str
    mapping: str
    condition: str
    flow: Flow
    differences: tuple[Difference, ...]


@dataclass(frozen=True, eq=False)
class Functions:
    """The functions of one law at the measured state: ``ratios`` measured over law in each tenth compared (7,), with
    their errors, and the mean ``differences``."""

    closure: str
    ratios: dict[str, Array]
    ratio_errors: dict[str, Array]
    differences: tuple[Difference, ...]


@dataclass(frozen=True, eq=False)
class Comparison:
    """The measured flow, the flows of the theory, reasons where there is none, and the functions of each law."""

    measured: Measured
    candidates: tuple[Candidate, ...]
    reasons: tuple[tuple[str, str, str, str], ...]
    functions: tuple[Functions, ...]


def compare(
    measured: Measured,
    closures: Sequence[str],
    mappings: Sequence[str] = tuple(MAPPINGS),
    conditions: Sequence[str] = ("M", "Q"),
) -> Comparison:
    """Compare ``measured`` with the theory under the laws ``closures`` and the ``mappings`` of the roughness: flows at
    the same ``conditions``, hold-up M or flux Q, and functions.

    Raises:
        InputError: for a closure or mapping that is not known, or a chute that the run does not define.
    """
    laws = [law(name) for name in closures]
    known = [name for name in mappings if math.isfinite(_roughness(measured, name))]
    candidates: list[Candidate] = []
    reasons: list[tuple[str, str, str, str]] = []
    for name in closures:
        for mapping in known:
            for condition in conditions:
                found, reason = _candidates(measured, name, mapping, condition)
                candidates += found
                if reason is not None:
                    reasons.append((name, mapping, condition, reason))
    functions = [_functions(measured, name, chosen, known) for name, chosen in zip(closures, laws, strict=True)]
    return Comparison(measured, tuple(candidates), tuple(reasons), tuple(functions))


def _roughness(measured: Measured, mapping: str) -> float:
    if mapping not in MAPPINGS:
        raise InputError(f"unknown mapping of the roughness {mapping!r}: choose from {', '.join(MAPPINGS)}")
    return getattr(measured, MAPPINGS[mapping])


def _candidates(measured: Measured, closure: str, mapping: str, condition: str) -> tuple[list[Candidate], str | None]:
    value = measured.numbers["mass_holdup" if condition == "M" else "mass_flux"]
    if not (math.isfinite(value) and value > 0.0):
        return [], f"the measured {condition} is {value:g}"
    try:
        chute = measured.chute(_roughness(measured, mapping), closure)
    except InputError as error:
        return [], str(error)
    found = flows(chute, M=value) if condition == "M" else flows(chute, Q=value)
    rows = [
        Candidate(closure, mapping, condition, flow, tuple(_flow_differences(measured, flow, condition)))
        for flow in found
    ]
    return rows, found.reason


def _flow_differences(measured: Measured, flow: Flow, condition: str) -> Iterator[Difference]:
    free = "mass_flux" if condition == "M" else "mass_holdup"
    profile = flow.at_overburden(np.linspace(0.005, 1.0, 200))
    theory = {
        free: getattr(flow, free),
        "mean_temperature": float(np.mean(profile.granular_temperature)),
        "slip_velocity": flow.slip_velocity,
    }
    for name, value in theory.items():
        if name in measured.numbers:
            # The hold-up has no error; the error of its difference would follow from that of the flux.
            error = math.nan if name == "mass_holdup" else measured.number_errors.get(name, math.nan)
            yield difference(name, measured.numbers[name], value, error)
    within = _points().ravel()
    at = flow.at_overburden(within)
    weight = 1.0 / at.volume_fraction.reshape(_points().shape)
    for name in _FIELDS:
        if name in measured.tenths:
            values = (weight * getattr(at, name).reshape(weight.shape)).sum(axis=1) / weight.sum(axis=1)
            yield _profile_difference(measured, name, values)


def _points() -> Array:
    return (_FRACTIONS - 0.05)[:, None] + _WITHIN


def _profile_difference(measured: Measured, name: str, theory: Array) -> Difference:
    """Root mean squares over the tenths compared: of the relative difference, and of its error."""
    own = measured.tenths[name][COMPARED]
    errors = measured.tenth_errors.get(name, np.full(9, np.nan))[COMPARED]
    relative = float(np.sqrt(np.mean((own / theory - 1.0) ** 2)))
    error = float(np.sqrt(np.mean((errors / theory) ** 2)))
    return Difference(name, float(own.mean()), float(theory.mean()), relative, error)


def difference(name: str, own: float, theory: float, error: float) -> Difference:
    """The difference of a measured number with its standard error from that of the theory."""
    if not theory:
        return Difference(name, own, theory, math.nan, math.nan)
    return Difference(name, own, theory, own / theory - 1.0, error / abs(theory))


def _functions(measured: Measured, closure: str, chosen: Law, mappings: Sequence[str]) -> Functions:
    theory = law_values(measured, chosen)
    ratios, errors = {}, {}
    for name in FUNCTIONS:
        if name in measured.tenths and name in theory:
            ratios[name] = measured.tenths[name][COMPARED] / theory[name]
            own = measured.tenth_errors.get(name, np.full(9, np.nan))[COMPARED] / theory[name]
            # Values of the law have the error of the volume fraction.
            spread = measured.tenth_errors.get("volume_fraction", np.full(9, np.nan))[COMPARED]
            errors[name] = np.hypot(own, ratios[name] * theory[f"{name}_slope"] * spread)
    found = [_mean_ratio(name, ratios[name], errors[name]) for name in ratios]
    if UPWARD in theory and {"normal_stress", "temperature_z"} <= measured.tenths.keys():
        own = (measured.tenths["normal_stress"] / measured.tenths["temperature_z"])[COMPARED]
        # As large as those of T, of which T_z is a part.
        found.insert(1, _mean_ratio(UPWARD, own / theory[UPWARD], errors["g1"]))
    found += _base_differences(measured, chosen, mappings)
    return Functions(closure, ratios, errors, tuple(found))


def _mean_ratio(name: str, ratio: Array, error: Array) -> Difference:
    """The mean over the tenths of measured over law, with the mean of their errors: they are not independent."""
    mean = float(ratio.mean())
    return Difference(name, mean, 1.0, mean - 1.0, float(error.mean()))


def law_values(measured: Measured, chosen: Law) -> dict[str, Array]:
    """g1, g2 and g5 of a law in the tenths compared (7,), at the measured profiles and averaged as those were, and the
    change of the logarithm of each with nu; those alone that can be compared."""
    wanted = ("volume_fraction", "granular_temperature", "temperature_z", "shear_stress")
    names = [name for name in wanted if name in measured.fields]
    points = _points()
    found = fields_at_overburden(measured.height, dict(measured.fields), measured.holdup, names, points.ravel())
    inner = dict(zip(names, found.reshape(-1, *points.shape), strict=True))
    nu, T = inner["volume_fraction"], inner["granular_temperature"]
    weight = 1.0 / nu
    weight /= weight.sum(axis=1, keepdims=True)
    g1, g2, g5 = _law_at(chosen, nu, measured)

    def mean(values: Array) -> Array:
        return (weight * values).sum(axis=1)

    out = {"g1": mean(g1 * T) / mean(T), "g5": mean(g5 * T**1.5) / mean(T**1.5)}
    if "temperature_z" in inner:
        out[UPWARD] = mean(g1 * inner["temperature_z"]) / mean(inner["temperature_z"])
    if "shear_stress" in inner:
        drag = inner["shear_stress"] / np.sqrt(T)
        out["g2"] = mean(drag) / mean(drag / g2)
    middle = mean(nu)
    step = 1e-4
    below, above = (_law_at(chosen, middle + sign * step, measured) for sign in (-1.0, 1.0))
    for name, low, high in zip(FUNCTIONS, below, above, strict=True):
        out[f"{name}_slope"] = np.log(high / low) / (2.0 * step)
    return out


def _law_at(chosen: Law, nu: Array, measured: Measured) -> tuple[Array, Array, Array]:
    nu = np.minimum(nu, 0.999 * chosen.densest)
    x = nu / (1.0 - nu / chosen.densest)
    _, _, g = chosen.at(x.ravel(), measured.restitution, measured.slope)
    shaped = (
        np.reshape(np.broadcast_to(values, x.size), nu.shape)
        for values in (g.compressibility, g.viscosity, g.dissipation)
    )
    compressibility, viscosity, dissipation = shaped
    return nu * compressibility, viscosity, nu**2 * dissipation


def _base_differences(measured: Measured, chosen: Law, mappings: Sequence[str]) -> Iterator[Difference]:
    """Slip and heat at the base against (3.15)-(3.18), at the measured state extrapolated to the base."""
    have = measured.numbers
    if not all(math.isfinite(have.get(name, math.nan)) for name in ("base_volume_fraction", "slip_ratio")):
        return
    nu = min(max(have["base_volume_fraction"], 1e-6), 0.999 * chosen.densest)
    reduced = reduce(chosen, np.array([nu / (1.0 - nu / chosen.densest)]), measured.restitution, measured.slope)
    for mapping in mappings:
        r = _roughness(measured, mapping)
        slip = float(boundary.slip_coefficient(reduced.shear, reduced.wall_shear, r, measured.slope)[0])
        own, error = have["slip_ratio"], measured.number_errors.get("slip_ratio", math.nan)
        yield difference(f"slip, r by {mapping}", own, slip, error)
        if "heat_from_base" in have and math.isfinite(measured.wall_restitution):
            scale = measured.holdup * math.sqrt(have["base_temperature"])
            heat = measured.slope * slip - boundary.base_loss(measured.wall_restitution, r)
            own, error = have["heat_from_base"] / scale, measured.number_errors.get("heat_from_base", math.nan) / scale
            yield difference(f"base heat, r by {mapping}", own, heat, error)


def sentences(found: Comparison) -> Iterator[str]:
    """Sentences: which law fits best and how well, which fits at the base, and which flow of the theory is nearest."""
    for symbol in FUNCTIONS:
        rows = [(one.closure, d) for one in found.functions for d in one.differences if d.name == symbol]
        rows = [(closure, d) for closure, d in rows if math.isfinite(d.relative)]
        if rows:
            closure, best = min(rows, key=lambda row: abs(row[1].relative))
            others = [f"{name} {_percent(d)}" for name, d in rows if name != closure]
            beside = f" (others: {', '.join(others)})" if others else ""
            yield f"{WORDS[symbol]} {symbol}: {closure} {best.agreement}, {_percent(best)}{beside}"
    yield from _base_sentences(found)
    at_holdup = [one for one in found.candidates if one.condition == "M"]
    if at_holdup:
        best = min(at_holdup, key=lambda one: abs(_of(one, "mass_flux").relative))
        gap = _of(best, "mass_flux")
        yield (
            f"nearest flow of the theory at this hold-up: {best.closure} with r by {best.mapping}, "
            f"mass flux {_percent(gap)}"
        )
    else:
        yield "no flow of the theory has this hold-up on this chute"


def _base_sentences(found: Comparison) -> Iterator[str]:
    for kind in ("slip", "base heat"):
        rows = [(one.closure, d) for one in found.functions for d in one.differences if d.name.startswith(f"{kind},")]
        if rows:
            closure, best = min(rows, key=lambda row: abs(row[1].relative))
            by = best.name.split(", ")[1]
            yield f"{WORDS[kind]}: nearest is {closure} with {by}, {best.agreement}, {_percent(best)}"


def _percent(one: Difference) -> str:
    text = f"{100.0 * one.relative:+.1f} %"
    return text if math.isnan(one.errors) else f"{text} ({one.errors:+.1f} errors)"


def _of(candidate: Candidate, name: str) -> Difference:
    return next(one for one in candidate.differences if one.name == name)
