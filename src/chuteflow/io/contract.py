"""The JSON shapes that other programs rely on; the command line and the files print the same objects.

Numbers are dimensionless, or in SI units where scales are given. What is not a finite number is null.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from typing import Any, NoReturn

from chuteflow.branches.counting import FlowCount, flux_counts
from chuteflow.branches.nearest import Nearest
from chuteflow.branches.results import Branch, Curve, FlowSet, Searched
from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY, CONDITIONS, NAMES
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import NUMBERS, PLACE, SCALED, VALIDITY, Scales
from chuteflow.theory.constitutive import Law, digest

#: Names of the parameters of a chute here and in :class:`chuteflow.Chute`.
PARAMETERS = {key: parameter.name for key, parameter in BY_KEY.items()} | {name: name for name in NAMES}
#: The same the other way round.
SHORT = {long: short for short, long in PARAMETERS.items()}


def flow_set_object(flow_set: FlowSet, scales: Scales | None = None) -> dict[str, Any]:
    """What ``chuteflow solve --json`` prints."""
    return {
        "chute": chute_object(flow_set.chute),
        "flows": [flow_object(flow, scales) for flow in flow_set],
        "searched": searched_object(flow_set.chute, flow_set.searched, scales),
        "reason": flow_set.reason,
        "incomplete": flow_set.incomplete,
        "closure": closure_object(flow_set.chute, flow_set[0].law if len(flow_set) else None),
        **units_object(scales, NUMBERS),
    }


def single_flow_object(flow: Flow, scales: Scales | None = None) -> dict[str, Any]:
    """One flow in the shape of a set of one, without the range searched."""
    return {
        "chute": chute_object(flow.chute),
        "flows": [flow_object(flow, scales)],
        "closure": closure_object(flow.chute, flow.law),
        **units_object(scales, NUMBERS),
    }


def curve_object(curve: Curve, scales: Scales | None = None) -> dict[str, Any]:
    """What ``chuteflow curve --json`` prints."""
    return {
        "chute": chute_object(curve.chute),
        "branches": [_branch(branch, scales) for branch in curve.branches],
        "counts": [_count(curve.chute, count, scales) for count in flux_counts(curve)],
        "searched": searched_object(curve.chute, curve.searched, scales),
        "closure": closure_object(curve.chute),
        "reason": curve.reason,
        "incomplete": curve.incomplete,
        **units_object(scales, PLACE),
    }


def nearest_object(found: Nearest, scales: Scales | None = None) -> dict[str, Any]:
    """The nearest values that have a flow, null where none of those examined has one."""
    values: dict[str, Any] = {SHORT[name]: value for name, value in found.parameters.items()}
    if found.quantity is not None:
        scale = factor(CONDITIONS[found.quantity].quantity, found.chute, scales)
        values[found.quantity] = None if found.value is None else found.value * scale
    return values | {"examined": {SHORT[name]: list(ends) for name, ends in found.examined.items()}}


def chute_object(chute: Chute) -> dict[str, float | str]:
    """The parameters of a chute, from which it is made again."""
    values = chute.as_dict()
    named = {short: values[name] for short, name in PARAMETERS.items()}
    return named | ({"base": values["base"]} if "base" in values else {})


def closure_object(chute: Chute, known: Law | None = None) -> dict[str, Any]:
    """The law of a chute whole: its name, parameters and source, and a digest of its values for these grains."""
    law = known or chute.law
    return {
        "name": law.name,
        "asked": str(chute.closure),
        "description": law.description,
        "source": law.source,
        "valid": law.valid,
        "densest": law.densest,
        "parameters": law.parameters,
        "digest": digest(law, chute.restitution, chute.slope),
    }


def flow_object(flow: Flow, scales: Scales | None = None) -> dict[str, Any]:
    """One flow: every number of the registry by its symbol, and its kinds."""
    return {
        **_numbers(flow, NUMBERS, scales),
        "name": flow.name,
        "interior": flow.interior,
        "density": flow.density,
        "error": finite(flow.error),
        "validity": validity_object(flow),
    }


def validity_object(flow: Flow) -> dict[str, Any]:
    """How far a flow keeps to the theory: numbers without scales, and the words where a limit is passed."""
    known = flow.validity
    numbers = {name: finite(getattr(known, name)) for name in VALIDITY}
    return {"nu_max": finite(known.largest_volume_fraction), **numbers, "words": list(known.words)}


def factor(name: str, chute: Chute, scales: Scales | None) -> float:
    """What the dimensionless quantity ``name`` is multiplied with: 1 without scales."""
    return 1.0 if scales is None else scales.factor(name, chute.slope)


def finite(value: float) -> float | None:
    """The number, or None for what JSON cannot hold."""
    return float(value) if math.isfinite(value) else None


def text(obj: Any) -> str:
    """JSON text of an object, on one line.

    Raises:
        ValueError: for a number that is not finite.
    """
    return json.dumps(obj, allow_nan=False)


def parsed(text: str | bytes) -> Any:
    """The value of a JSON text, in UTF-8 with or without a byte-order mark.

    Raises:
        ValueError: for what is no JSON, a number that is not finite, or a name that an object has twice.
        RecursionError: for too many brackets in one another.
    """
    if isinstance(text, bytes):
        text = text.decode("utf-8-sig")
    return json.loads(text, object_pairs_hook=_without_doubles, parse_constant=_not_finite)


def _without_doubles(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        raise InputError(f"{next(name for name in names if names.count(name) > 1)[:40]!r} is in it twice")
    return found


def _not_finite(word: str) -> NoReturn:
    raise InputError(f"{word} is in it: numbers must be finite")


def place_object(flow: Flow, scales: Scales | None = None) -> dict[str, Any]:
    """Where a flow is on its branch: Q, h, M and T_surface."""
    return _numbers(flow, PLACE, scales)


def places_object(flows: Iterable[Flow], scales: Scales | None = None) -> dict[str, list[Any]]:
    """The same of several flows, as lists."""
    places = [place_object(flow, scales) for flow in flows]
    return {NUMBERS[name].symbol: [place[NUMBERS[name].symbol] for place in places] for name in PLACE}


def _numbers(flow: Flow, names: Iterable[str], scales: Scales | None) -> dict[str, float | str | None]:
    return {NUMBERS[name].symbol: finite(getattr(flow, name) * factor(name, flow.chute, scales)) for name in names}


def _branch(branch: Branch, scales: Scales | None) -> dict[str, Any]:
    special = [{"kind": point.kind, **place_object(point.flow, scales)} for point in branch.special]
    known = [flow.validity for flow in branch.flows]
    validity: dict[str, Any] = {name: [finite(getattr(one, name)) for one in known] for name in VALIDITY}
    validity["words"] = [list(one.words) for one in known]
    return {**places_object(branch.flows, scales), "validity": validity, "special": special, "ends": list(branch.ends)}


def _count(chute: Chute, count: FlowCount, scales: Scales | None) -> dict[str, Any]:
    flux = factor("mass_flux", chute, scales)
    return {
        "Q_from": count.low * flux,
        "Q_to": finite(count.high * flux),
        "flows": count.flows,
        "at_least": count.at_least,
    }


def searched_object(chute: Chute, searched: Searched, scales: Scales | None = None) -> dict[str, Any]:
    """The range searched, and the cells of the search where they were counted."""
    scale = factor("surface_temperature", chute, scales)
    cells = searched.cells
    counted = {} if cells is None else {"delta": cells.delta, "cells": cells.number, "undecided": cells.undecided}
    return {
        "T_surface": [finite(value * scale) for value in searched.surface_temperature],
        "M_max": finite(searched.largest_holdup * factor("mass_holdup", chute, scales)),
        **counted,
    }


def units_object(scales: Scales | None, names: Iterable[str]) -> dict[str, Any]:
    """The SI units of the quantities ``names`` by their symbols, and the scales; nothing without scales."""
    if scales is None:
        return {}
    return {
        "units": {SCALED[name].symbol: SCALED[name].unit for name in names},
        "scales": {"diameter": scales.diameter, "density": scales.density, "gravity": scales.gravity},
    }
