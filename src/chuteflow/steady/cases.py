"""Chutes and materials by name: the paper's chutes, and common grains with what is known of each number.

A case says some or all of the numbers of a chute, and for materials the grains too, with which results take SI units.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from chuteflow import display
from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY
from chuteflow.steady.chute import Chute, slope_of
from chuteflow.steady.quantities import GRAINS, Scales

#: How a number of a case is known: reported for such grains, but not checked against the source; guessed; or part of
#: what the case is.
TYPICAL, GUESSED, DEFINED = "typical", "guessed", "defined"


@dataclass(frozen=True)
class CaseNumber:
    """A number of a case: its ``value``, ``how`` it is known, its ``uncertainty`` (by how much grains of this kind, or
    guesses, differ; None for what is defined) and its ``source``."""

    value: float
    how: str = DEFINED
    uncertainty: float | None = None
    source: str = ""

    def __str__(self) -> str:
        spread = "" if self.uncertainty is None else f" +- {self.uncertainty:g}"
        return f"{self.value:g}{spread} ({self.how}{f': {self.source}' if self.source else ''})"


@dataclass(frozen=True)
class Case:
    """Some or all numbers of a chute under a name.

    ``numbers`` are by the keys of the parameters (``slope``, ``e``, ``ew``, ``roughness``), ``names`` are its
    ``surface``, ``closure`` and ``base`` as far as it says them, and ``grains`` its diameter (m), density (kg/m^3) and
    gravity (m/s^2).
    """

    name: str
    description: str
    numbers: Mapping[str, CaseNumber]
    names: Mapping[str, str] = field(default_factory=dict)
    grains: Mapping[str, CaseNumber] = field(default_factory=dict)

    def chute(self, **others: Any) -> Chute:
        """The chute of this case, with ``others`` in the place of its own: arguments of :class:`chuteflow.Chute`, the
        short ``e`` and ``ew``, or ``angle`` in degrees for the slope.

        Raises:
            InputError: for a number that neither says, one that is given twice, unknown or out of range.
        """
        values: dict[str, Any] = {BY_KEY[key].name: known.value for key, known in self.numbers.items()}
        values |= dict(self.names) | _arguments(others)
        missing = [one.name for one in BY_KEY.values() if one.name not in values]
        if missing:
            asked = ", ".join(map(_asked, missing))
            raise InputError(f"{self.name} has no {' and no '.join(missing)}: give {asked}")
        return Chute(**values)

    @property
    def scales(self) -> Scales | None:
        """Its grains, with which results take SI units, or None where it does not say diameter and density."""
        values = {name: known.value for name, known in self.grains.items()}
        return Scales(**values) if {"diameter", "density"} <= values.keys() else None

    def __repr__(self) -> str:
        said = ", ".join(f"{key} = {known.value:g}" for key, known in self.numbers.items())
        return f"<Case: {self.name}; {said}>"

    def _repr_html_(self) -> str:
        known = [(key, "", one) for key, one in self.numbers.items()]
        known += [(key, GRAINS[key], one) for key, one in self.grains.items()]
        rows = [
            [
                key,
                f"{one.value:g} {unit}",
                "" if one.uncertainty is None else f"{one.uncertainty:g}",
                one.how,
                one.source,
            ]
            for key, unit, one in known
        ]
        rows += [[key, name, "", "", ""] for key, name in self.names.items()]
        header = ["", "value", "uncertainty", "known", "source"]
        return display.html_table(f"{self.name}: {self.description}", header, rows)


def _arguments(given: Mapping[str, Any]) -> dict[str, Any]:
    """What is given of a chute, by the names of :class:`chuteflow.Chute`."""
    names = [one.name for one in fields(Chute)]
    found: dict[str, Any] = {}
    for key, value in given.items():
        name = "slope" if key == "angle" else BY_KEY[key].name if key in BY_KEY else key
        if name not in names:
            raise InputError(f"unknown argument {key!r}: {nearest_names(key, [*names, 'angle', 'e', 'ew'])}")
        if name in found:
            raise InputError(f"{name} is given twice, also as {key}")
        found[name] = slope_of(value) if key == "angle" else value
    return found


def _asked(name: str) -> str:
    return "slope=... (or angle=... in degrees)" if name == "slope" else f"{name}=..."


def cases() -> dict[str, Case]:
    """All cases by name: chutes of the paper, and common materials."""
    return dict(CASES)


def case(name: str) -> Case:
    """The case of this ``name``.

    Raises:
        InputError: for an unknown name, with those that are near.
    """
    if name not in CASES:
        raise InputError(f"unknown case {name!r}: {nearest_names(name, CASES)}")
    return CASES[name]


def nearest_names(name: str, known: Iterable[str]) -> str:
    """Which of the ``known`` names may be meant by ``name``, in words, and all of them where none is near."""
    known = [*known]
    lowered = {one.lower(): one for one in known}
    near = difflib.get_close_matches(name.lower(), lowered, n=2) or [one for one in lowered if name.lower() in one]
    if near:
        return f"did you mean {' or '.join(lowered[one] for one in near)}?"
    return f"choose one of {', '.join(known)}"


def _paper(slope: float, e: float, ew: float, roughness: float) -> dict[str, CaseNumber]:
    return {key: CaseNumber(value) for key, value in (("slope", slope), ("e", e), ("ew", ew), ("roughness", roughness))}


#: Measurements that such values come from; they were not at hand to check the values.
_FOERSTER = "as of Foerster, Louge, Chang & Allia 1994, Phys. Fluids 6, 1108; not checked against it"
_LORENZ = "as of Lorenz, Tuozzolo & Louge 1997, Exp. Mech. 37, 292; not checked against it"
_GLUED = "grains glued to the base with gaps between none and a grain; see the page on choosing e, e_w and r"

#: All cases by name.
CASES: dict[str, Case] = {
    one.name: one
    for one in (
        Case(
            "paper-dissipative",
            "the chute of the paper's figures 2 and 3, with three flows at Q = 3; its grains are those of most figures",
            _paper(0.3, 0.8, 0.8, 0.6),
        ),
        Case(
            "paper-productive",
            "the chute of the paper's figure 5, whose interior is productive",
            _paper(0.4, 0.9, 0.6, 0.8),
        ),
        Case(
            "glass-beads",
            "soda-lime glass beads, 3 mm, on a rough base of aluminium",
            {
                "e": CaseNumber(0.97, TYPICAL, 0.02, _FOERSTER),
                "ew": CaseNumber(0.83, TYPICAL, 0.04, f"on a plate of aluminium; {_FOERSTER}"),
                "roughness": CaseNumber(0.65, GUESSED, 0.1, _GLUED),
            },
            grains={
                "diameter": CaseNumber(3e-3, DEFINED),
                "density": CaseNumber(2500.0, TYPICAL, 50.0, "soda-lime glass"),
            },
        ),
        Case(
            "steel",
            "stainless steel balls, 3 mm, on a rough base of steel",
            {
                "e": CaseNumber(0.95, TYPICAL, 0.05, _LORENZ),
                "ew": CaseNumber(0.9, GUESSED, 0.07, "a thick plate of steel loses somewhat more than two balls do"),
                "roughness": CaseNumber(0.65, GUESSED, 0.1, _GLUED),
            },
            grains={
                "diameter": CaseNumber(3e-3, DEFINED),
                "density": CaseNumber(7900.0, TYPICAL, 150.0, "stainless steel"),
            },
        ),
        Case(
            "sand",
            "quartz sand, 0.5 mm, on a base to which the same sand is glued",
            {
                "e": CaseNumber(0.7, GUESSED, 0.15, "grains with corners: no measurement holds for all sands"),
                "ew": CaseNumber(0.7, GUESSED, 0.15, "as of two grains"),
                "roughness": CaseNumber(0.7, GUESSED, 0.1, _GLUED),
            },
            grains={
                "diameter": CaseNumber(5e-4, DEFINED),
                "density": CaseNumber(2650.0, TYPICAL, 30.0, "quartz"),
            },
        ),
    )
}
