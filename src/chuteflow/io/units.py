"""SI units: results with units attached, and lengths, densities and accelerations read from text."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from chuteflow.checks import real_array
from chuteflow.errors import InputError
from chuteflow.extras import require
from chuteflow.steady.flow import Flow, Profile
from chuteflow.steady.quantities import FIELDS, NUMBERS, QUANTITIES, SCALED, Scales

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: A number and the unit after it: names with small powers, multiplied or divided. Nothing else reaches pint,
#: whose parser takes more than it can evaluate.
_NAME = r"[^\W\d_]+(?:(?:\^|\*\*)?-?\d|[²³])?"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_UNIT = rf"(?:1\s*/\s*)?{_NAME}(?:\s*[*/·]\s*{_NAME}|\s+{_NAME})*"
_AMOUNT = re.compile(rf"\s*({_NUMBER})\s*({_UNIT})\s*")
#: A power without a sign between, as in "m2/s", which pint does not read.
_POWER = re.compile(r"(?<=[^\W\d_])(-?\d)")
#: Quantities of mass that may be given by volume of the grains: their units times that of a density.
_BY_VOLUME = {"mass_flux": "m^2/s", "mass_holdup": "m"}


@dataclass(frozen=True, eq=False)
class FlowInUnits:
    """A flow in SI units; every value is a pint Quantity of pint's application registry."""

    flow: Flow
    scales: Scales

    @cached_property
    def numbers(self) -> Mapping[str, Any]:
        """Every number of the registry by name, such as ``mass_flux``."""
        return {name: self._with_unit(name, getattr(self.flow, name)) for name in NUMBERS}

    def profile(self, z: ArrayLike | None = None, points: int = 201) -> Mapping[str, Any]:
        """Every field of the registry by name, arrays over heights ``z``.

        Args:
            z: heights as a pint Quantity, or plain numbers in metres; by default from the base to the depth.
            points: how many heights there are by default.

        Raises:
            InputError: for heights that are no lengths, below the base or above the interface.
        """
        profile = self.flow.sampled(points) if z is None else self._at(z)
        return {name: self._with_unit(name, getattr(profile, name)) for name in FIELDS}

    def _at(self, z: Any) -> Profile:
        pint = _pint()

        if isinstance(z, pint.Quantity):
            try:
                z = z.m_as("m")
            except pint.PintError:
                raise InputError(f"heights in {z.units}: must be lengths") from None
        return self.flow.profile(real_array("z", z) / self._factor("height"))

    def _factor(self, name: str) -> float:
        return self.scales.factor(name, self.flow.chute.slope)

    def _with_unit(self, name: str, value: Any) -> Any:
        return _registry().Quantity(value * self._factor(name), _spelled(QUANTITIES[name].unit))


def in_si(flow: Flow, scales: Scales) -> FlowInUnits:
    """``flow`` in SI units, for grains of the diameter and density of ``scales``."""
    return FlowInUnits(flow, scales)


def read_si(what: str, text: str, unit: str) -> float:
    """The amount ``text`` in the SI ``unit``: "1 mm", "2500 kg/m^3", or a plain number, which is SI already.

    Raises:
        InputError: naming ``what``, for text that is neither, or a unit of another kind.
    """
    plain = _plain(text)
    return plain if plain is not None else _converted(what, text, unit, f"in {unit}")


def read_amount(what: str, text: str, name: str, scales: Scales | None, slope: float) -> float:
    """The quantity ``name`` of the registry, dimensionless: a plain number as it is, an amount with a unit by
    ``scales`` on a chute of ``slope``.

    A mass flux may be given in m^2/s and a hold-up in m, which is then the volume of the grains alone.

    Raises:
        InputError: naming ``what``, for text that is neither, or a unit without scales.
    """
    plain = _plain(text)
    if plain is not None:
        return plain
    unit, density = SCALED[name].unit, 1.0
    if name in _BY_VOLUME and scales is not None and _is_like(text, _BY_VOLUME[name]):
        unit, density = _BY_VOLUME[name], scales.density
    value = _converted(what, text, unit, "dimensionless") * density
    if scales is None:
        raise InputError(f"{what} {text!r}: a unit needs the grains, give their diameter and density too")
    return value / scales.factor(name, slope)


def bare(text: str) -> bool:
    """Whether an amount is a number without a unit."""
    return _plain(text) is not None


def _is_like(text: str, unit: str) -> bool:
    """Whether ``text`` has a unit of the kind of ``unit``."""
    match = _AMOUNT.fullmatch(text)
    if match is None:
        return False
    pint = _pint()

    try:
        return bool(_registry().parse_units(_with_powers(match[2])).is_compatible_with(unit))
    except (pint.PintError, ArithmeticError):
        return False


def _with_powers(unit: str) -> str:
    """A unit as pint reads it: "m2/s" is "m^2/s"."""
    return _POWER.sub(r"^\1", unit)


def _plain(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _converted(what: str, text: str, unit: str, plain: str) -> float:
    match = _AMOUNT.fullmatch(text)
    if match is None:
        raise InputError(f"{what} {text!r}: must be a number, {plain} or with a unit like {unit} after it")
    pint = _pint()

    registry = _registry()
    try:
        value = float(
            registry.Quantity(float(match[1]), registry.parse_units(_with_powers(match[2]))).m_as(_spelled(unit))
        )
    except pint.DimensionalityError:
        raise InputError(f"{what} {text!r}: {match[2]!r} is not a unit like {unit}") from None
    except (pint.PintError, ArithmeticError):
        raise InputError(f"{what} {text!r}: {match[2]!r} is not a known unit; write it like {unit}") from None
    if not math.isfinite(value):
        raise InputError(f"{what} {text!r}: must be finite")
    return value


def _registry() -> Any:
    return _pint().get_application_registry()


def _pint() -> Any:
    return require("pint", "units", "a quantity with a unit")


def _spelled(unit: str) -> str:
    return "" if unit == "1" else unit
