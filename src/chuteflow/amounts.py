"""Amounts with a unit read from text, such as "1 mm"; plain numbers too."""

from __future__ import annotations

import math
import re
from typing import Any

from chuteflow.checks import number, shorten
from chuteflow.errors import InputError
from chuteflow.extras import require

#: A number and the unit after it: names with small powers, multiplied or divided. Nothing else reaches pint,
#: whose parser takes more than it can evaluate.
_NAME = r"[^\W\d_]+(?:(?:\^|\*\*)?-?\d|[²³])?"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_UNIT = rf"(?:1\s*/\s*)?{_NAME}(?:\s*[*/·]\s*{_NAME}|\s+{_NAME})*"
_AMOUNT = re.compile(rf"\s*({_NUMBER})\s*({_UNIT})\s*")
#: A power without a sign between, as in "m2/s", which pint does not read.
_POWER = re.compile(r"(?<=[^\W\d_])(-?\d)")


def read_si(what: str, text: str, unit: str) -> float:
    """The amount ``text`` in the SI ``unit``: "1 mm", "2500 kg/m^3", or a plain number, which is SI already.

    Raises:
        InputError: naming ``what``, for text that is neither, or a unit of another kind.
    """
    plain = plain_number(text)
    return plain if plain is not None else converted(what, text, unit, f"in {unit}")


def positive_amount(what: str, value: Any, unit: str) -> float:
    """A number that is in ``unit`` already, or a text as :func:`read_si` takes it: finite and above 0.

    Raises:
        InputError: naming ``what``, for anything else.
    """
    found = read_si(what, value, unit) if isinstance(value, str) else number(what, value)
    if not (math.isfinite(found) and found > 0.0):
        raise InputError(f"{what} = {shorten(value)}: must be a positive number")
    return found


def bare(text: str) -> bool:
    """Whether an amount is a number without a unit."""
    return plain_number(text) is not None


def is_like(text: str, unit: str) -> bool:
    """Whether ``text`` has a unit of the kind of ``unit``."""
    match = _AMOUNT.fullmatch(text)
    if match is None:
        return False
    pint = pint_module()
    try:
        return bool(registry().parse_units(_with_powers(match[2])).is_compatible_with(unit))
    except (pint.PintError, ArithmeticError):
        return False


def plain_number(text: str) -> float | None:
    """The number that ``text`` is, without a unit, or None."""
    try:
        return float(text)
    except ValueError:
        return None


def converted(what: str, text: str, unit: str, plain: str) -> float:
    """The amount ``text``, which has a unit, in ``unit``; ``plain`` says what a plain number would be.

    Raises:
        InputError: naming ``what``, for other text, or a unit of another kind.
    """
    match = _AMOUNT.fullmatch(text)
    if match is None:
        raise InputError(f"{what} {text!r}: must be a number, {plain} or with a unit like {unit} after it")
    pint, known = pint_module(), registry()
    try:
        value = float(known.Quantity(float(match[1]), known.parse_units(_with_powers(match[2]))).m_as(spelled(unit)))
    except pint.DimensionalityError:
        raise InputError(f"{what} {text!r}: {match[2]!r} is not a unit like {unit}") from None
    except (pint.PintError, ArithmeticError):
        raise InputError(f"{what} {text!r}: {match[2]!r} is not a known unit; write it like {unit}") from None
    if not math.isfinite(value):
        raise InputError(f"{what} {text!r}: must be finite")
    return value


def registry() -> Any:
    """The units that pint knows, those of the application that uses it."""
    return pint_module().get_application_registry()


def spelled(unit: str) -> str:
    """A unit of the registry of quantities as pint reads it."""
    return "" if unit == "1" else unit


def pint_module() -> Any:
    """pint, imported when the first unit is read."""
    return require("pint", "units", "a quantity with a unit")


def _with_powers(unit: str) -> str:
    """A unit as pint reads it: "m2/s" is "m^2/s"."""
    return _POWER.sub(r"^\1", unit)
