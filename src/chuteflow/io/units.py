"""SI units: results with units attached, and quantities read from text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from chuteflow.amounts import converted, pint_module, plain_number, registry, spelled
from chuteflow.checks import real_array
from chuteflow.errors import InputError
from chuteflow.steady.flow import Flow, Profile
from chuteflow.steady.quantities import FIELDS, NUMBERS, QUANTITIES, SCALED, Scales

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: What is said of a unit where the grains are not known.
WITHOUT_GRAINS = "a unit needs the grains: give their diameter and density too, or --si for those of a file or case"


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
        pint = pint_module()
        if isinstance(z, pint.Quantity):
            try:
                z = z.m_as("m")
            except pint.PintError:
                raise InputError(f"heights in {z.units}: must be lengths") from None
        return self.flow.profile(real_array("z", z) / self._factor("height"))

    def _factor(self, name: str) -> float:
        return self.scales.factor(name, self.flow.chute.slope)

    def _with_unit(self, name: str, value: Any) -> Any:
        return registry().Quantity(value * self._factor(name), spelled(QUANTITIES[name].unit))


def in_si(flow: Flow, scales: Scales) -> FlowInUnits:
    """``flow`` in SI units, for grains of the diameter and density of ``scales``."""
    return FlowInUnits(flow, scales)


def read_amount(what: str, text: str, name: str, scales: Scales | None, slope: float) -> float:
    """The quantity ``name`` of the registry, dimensionless: a plain number as it is, an amount with a unit by
    ``scales`` on a chute of ``slope``.

    A mass flux may be given in m^2/s and a hold-up in m, which is then the volume of the grains alone.

    Raises:
        InputError: naming ``what``, for text that is neither, or a unit without scales.
    """
    plain = plain_number(text)
    if plain is not None:
        return plain
    if scales is None:
        converted(what, text, SCALED[name].unit, "dimensionless")
        raise InputError(f"{what} {text!r}: {WITHOUT_GRAINS}")
    return scales.dimensionless(name, text, slope, what)
