"""The numbers of a chute that can be varied one by one: its four parameters, and those of its law and its base.

They are called by the keys of :data:`chuteflow.parameters.BY_KEY`, such as ``ew``, and by ``closure.NAME`` and
``base.NAME``, such as ``closure.packing`` and ``base.specularity``. A plain NAME is enough where it is the only one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from chuteflow.checks import shorten
from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY
from chuteflow.steady.chute import Chute
from chuteflow.theory.bases import base
from chuteflow.theory.constitutive import Law
from chuteflow.theory.laws import add_settings, law

#: Where a parameter may lie, and between which values it is searched for, by the last part of its name.
_RANGES = {
    "closure.packing": ((0.5, 0.74048), (0.58, 0.68)),
    "closure.friction": ((0.0, 2.0), (0.0, 0.4)),
    "base.diameter": ((0.1, 10.0), (0.5, 2.0)),
    "base.specularity": ((1e-6, 1.0), (0.02, 0.9)),
    "base.packing": ((0.3, 1.0), (0.5, 0.74)),
}
_LIKELY = {"slope": (0.1, 0.7), "e": (0.6, 0.98), "ew": (0.3, 0.98), "roughness": (0.5, math.sqrt(3.0) / 2.0)}
#: A packing that every law takes that takes another than its own.
_ANY_PACKING = 0.64
#: Above what a packing has to be, by so much.
_ABOVE = 1e-6
_LATEX = {
    "closure.packing": r"\nu^*",
    "closure.friction": r"\mu",
    "base.diameter": r"d_w/d",
    "base.specularity": r"\phi",
    "base.packing": r"\nu^*_w",
}


@dataclass(frozen=True)
class FreeParameter:
    """A number of a chute that can be varied.

    ``key`` is what it is called; it lies from ``low`` to ``high``, and is searched for in ``likely`` unless another
    range is given.
    """

    key: str
    low: float
    high: float
    likely: tuple[float, float]

    @property
    def model_name(self) -> str:
        """What :func:`chuteflow.steady.model.step_model` calls it."""
        return BY_KEY[self.key].name if self.key in BY_KEY else self.key

    @property
    def latex(self) -> str:
        """Its symbol."""
        return BY_KEY[self.key].latex if self.key in BY_KEY else _LATEX.get(self.key, rf"\mathrm{{{self.key}}}")

    @property
    def of_base(self) -> bool:
        """Whether it belongs to the base alone."""
        return BY_KEY[self.key].of_base if self.key in BY_KEY else self.key.startswith("base.")

    def of(self, chute: Chute) -> float:
        """Its value."""
        if self.key in BY_KEY:
            return getattr(chute, BY_KEY[self.key].name)
        where, _, name = self.key.partition(".")
        if where == "base":
            return getattr(base(chute.base), name)
        value = chute.law.parameters[name]
        return chute.law.densest if value is None else value

    def given(self, chute: Chute, value: float) -> dict[str, Any]:
        """Arguments of a Chute with which it has another value.

        Raises:
            InputError: for a value out of range.
        """
        if self.key in BY_KEY:
            return {BY_KEY[self.key].name: value}
        where, _, name = self.key.partition(".")
        if where == "base":
            return {"base": replace(base(chute.base), **{name: value})}
        return {"closure": _configure(chute.law, name, float(value))}


def _configure(chosen: Law, name: str, value: float) -> Law:
    """A law with another value of one parameter, each said once in the text by which it is requested."""
    text = str(chosen)
    try:
        known = law(text) == chosen
    except InputError:
        known = False
    return law(add_settings(text, (f"{name}={value!r}",))) if known else chosen.configured(**{name: value})


def vary(chute: Chute, free: Sequence[FreeParameter], values: Sequence[float]) -> Chute:
    """``chute`` with other ``values`` of some of its parameters.

    Raises:
        InputError: for a value out of range.
    """
    for parameter, value in zip(free, values, strict=True):
        chute = replace(chute, **parameter.given(chute, float(value)))
    return chute


def all_free(chute: Chute) -> tuple[FreeParameter, ...]:
    """All numbers of ``chute`` that can be varied: a base in which the roughness does not enter has none."""
    keys = [key for key in BY_KEY if key != "roughness" or base(chute.base).name == "richman"]
    law, on = chute.law, base(chute.base)
    if law.known:
        keys += [f"closure.{name}" for name in law.parameters if _can_vary(chute, name)]
    keys += [f"base.{name}" for name in on.parameters]
    return tuple(_free(chute, key) for key in keys)


def free_parameter(chute: Chute, asked: str) -> FreeParameter:
    """The parameter of ``chute`` that is called ``asked``.

    Raises:
        InputError: for none or several.
    """
    known = {parameter.key: parameter for parameter in all_free(chute)}
    names = {parameter.name: key for key, parameter in BY_KEY.items()}
    key = names.get(asked, asked)
    if key in known:
        return known[key]
    found = [key for key in known if key.partition(".")[2] == asked]
    if len(found) == 1:
        return known[found[0]]
    if found:
        raise InputError(f"parameter {shorten(asked)}: it is {' or '.join(found)}; say which")
    raise InputError(f"unknown parameter {shorten(asked)}: choose from {', '.join(known)}")


def choose_parameters(
    chute: Chute, free: Sequence[str], ranges: Mapping[str, tuple[float, float]]
) -> tuple[FreeParameter, ...]:
    """The parameters of ``chute`` called ``free``, to be searched for in the ``ranges`` that are given by name.

    Raises:
        InputError: for an unknown name, one that is there twice, or a range that is not allowed.
    """
    found = tuple(free_parameter(chute, name) for name in free)
    keys = [parameter.key for parameter in found]
    if len(set(keys)) < len(keys):
        raise InputError(f"free parameters {', '.join(keys)}: each once")
    asked = {free_parameter(chute, name).key: pair for name, pair in ranges.items()}
    for key, (low, high) in asked.items():
        if key not in keys:
            raise InputError(f"a range of {key} is given, which is not free")
        parameter = found[keys.index(key)]
        if not parameter.low <= low < high <= parameter.high:
            raise InputError(
                f"range {low:g} to {high:g} of {key}: must rise, and be within {parameter.low:g} to {parameter.high:g}"
            )
    return tuple(replace(p, likely=asked[p.key]) if p.key in asked else p for p in found)


def _free(chute: Chute, key: str) -> FreeParameter:
    if key in BY_KEY:
        return FreeParameter(key, BY_KEY[key].low, BY_KEY[key].high, _LIKELY[key])
    if key == "closure.packing":
        (low, high), likely = _RANGES[key]
        # A radial function that begins at a density needs a packing above it.
        low = max((low, *chute.law.breaks_at(chute.restitution, chute.slope))) + _ABOVE
        return FreeParameter(key, low, high, (max(likely[0], low), likely[1]))
    bounds, likely = _RANGES.get(key, ((-math.inf, math.inf), (math.nan, math.nan)))
    if key not in _RANGES:
        now = FreeParameter(key, *bounds, likely).of(chute)
        likely = (0.5 * now, 2.0 * now) if now else (-1.0, 1.0)
    return FreeParameter(key, *bounds, likely)


def _can_vary(chute: Chute, name: str) -> bool:
    """Whether a parameter of the law is a number that may take other values."""
    value = chute.law.parameters[name]
    if isinstance(value, (str, bool)):
        return False
    if name != "packing":
        return isinstance(value, float)
    try:
        chute.law.configured(packing=_ANY_PACKING)
    except InputError:
        return False
    return True
