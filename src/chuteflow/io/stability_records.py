"""Stability as JSON and CSV: one object for each flow, numbers that are not known null."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from chuteflow.branches.results import FlowSet
from chuteflow.io.contract import chute_object, factor, finite, flow_object, place_object, searched_object, units_object
from chuteflow.stability.answers import StabilityAnswer
from chuteflow.stability.budget import ModeBudget
from chuteflow.stability.modes import Mode
from chuteflow.stability.result import Stability
from chuteflow.steady.chute import Chute
from chuteflow.steady.quantities import DISTURBANCES, NUMBERS, Scales

#: The disturbed fields, in the order of :attr:`Mode.fields`.
FIELDS = ("nu", "u", "v", "w", "T")
#: Columns of a CSV file.
COLUMNS = ("Q", "h", "M", "T_surface", "stable", "kind", "kx", "ky", "growth", "frequency", "speed", "error")


def answers_object(
    flows: FlowSet, answers: Sequence[StabilityAnswer], *, fields: bool = False, scales: Scales | None = None
) -> dict[str, Any]:
    """What ``chuteflow stability --json`` prints; with ``fields`` the disturbed fields of each mode too, which stay
    relative to one another where ``scales`` are given."""
    return {
        "chute": chute_object(flows.chute),
        "flows": [_answer(answer, fields, scales) for answer in answers],
        "searched": searched_object(flows.chute, flows.searched, scales),
        "reason": flows.reason,
        **units_object(scales, (*NUMBERS, *DISTURBANCES)),
    }


def mode_object(
    mode: Mode, *, fields: bool = False, chute: Chute | None = None, scales: Scales | None = None
) -> dict[str, Any]:
    """One mode; with ``fields`` heights, and real and imaginary parts of the disturbances there. In SI units where the
    ``chute`` and ``scales`` are given."""

    def by(name: str) -> float:
        return 1.0 if chute is None else factor(name, chute, scales)

    numbers: dict[str, Any] = {
        "kx": by("wavenumber") * mode.kx,
        "ky": by("wavenumber") * mode.ky,
        "growth": finite(by("growth") * mode.growth),
        "frequency": finite(by("frequency") * mode.frequency),
        "speed": None if mode.speed is None else finite(by("wave_speed") * mode.speed),
        "kind": mode.kind,
        "error": finite(by("growth") * mode.error),
    }
    if fields:
        numbers["z"] = (by("height") * mode.height).tolist()
        for name, values in zip(FIELDS, mode.fields, strict=True):
            numbers[name] = {"real": np.real(values).tolist(), "imaginary": np.imag(values).tolist()}
    return numbers


def budget_object(budget: ModeBudget, rate: float = 1.0) -> dict[str, Any]:
    """An energy budget: what each term adds to the kinetic, density and thermal energy, and in all, as growth rates,
    which are multiplied by ``rate``."""
    return {
        "growth": finite(rate * budget.mode.growth),
        "closure": finite(budget.closure),
        "shares": dict(zip(("kinetic", "density", "thermal"), map(finite, budget.shares), strict=True)),
        "terms": {
            term.name.replace(" ", "_"): {
                "kinetic": finite(rate * term.kinetic),
                "density": finite(rate * term.density),
                "thermal": finite(rate * term.thermal),
                "total": finite(rate * term.total),
            }
            for term in budget.terms
        },
    }


def csv_rows(answers: Sequence[StabilityAnswer], scales: Scales | None = None) -> Iterator[list[Any]]:
    """A head and one row for each mode, or one for a flow without."""
    yield list(COLUMNS)
    for answer in answers:
        start = place_object(answer.flow, scales).values()
        known = answer.found.stable
        stable = "" if known is None else str(known).lower()
        for mode in answer.modes or (None,):
            numbers = {} if mode is None else mode_object(mode, chute=answer.flow.chute, scales=scales)
            yield [*start, stable, *(numbers.get(name) for name in COLUMNS[5:])]


def _answer(answer: StabilityAnswer, fields: bool, scales: Scales | None) -> dict[str, Any]:
    found, chute = answer.found, answer.flow.chute
    modes = [mode_object(mode, fields=fields, chute=chute, scales=scales) for mode in answer.modes]
    wave, rate = (factor(name, chute, scales) for name in ("wavenumber", "growth"))
    return {
        **flow_object(answer.flow, scales),
        "stable": found.stable,
        "mode": modes[0] if modes else None,
        "modes": modes,
        "budget": None if answer.budget is None else budget_object(answer.budget, rate),
        "grows": None if found.mode is None else found.grows,
        "threshold": rate * found.smallest_rate,
        "wavenumbers": [wave * k for k in found.searched],
        "complete": found.complete,
        "examined": found.examined,
        "unresolved": [{"kx": wave * kx, "ky": wave * ky} for kx, ky in found.unresolved],
        "why": why_unknown(found),
    }


def why_unknown(found: Stability) -> str | None:
    """Why ``stable`` is None, or None where it is not."""
    if found.stable is not None:
        return None
    if not found.complete:
        return "one wave or one direction was examined: without --kx and --ky all are searched"
    return (
        f"nothing is known to grow, but at {len(found.unresolved)} of the wavenumbers examined the finest grids "
        "do not resolve whether something does"
    )
