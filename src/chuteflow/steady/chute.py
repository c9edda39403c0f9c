"""A chute: the four parameters, the surface condition and the constitutive law."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

from chuteflow.checks import number
from chuteflow.errors import InputError
from chuteflow.parameters import PARAMETERS
from chuteflow.theory.bases import BASES, BaseCondition, base
from chuteflow.theory.constitutive import Law, require_positive
from chuteflow.theory.laws import law

#: Surface conditions: the half-line (2.16), or the interface of Jenkins & Hanes (3.31)-(3.32).
SURFACES = ("free", "interface")
_SURFACES = {"free": "free surface", "interface": "interface with free grains above"}


@dataclass(frozen=True)
class Chute:
    """A planar chute and the grains on it.

    Args:
        slope: tan(theta) > 0.
        restitution: e, the coefficient of restitution of two grains, 0 < e <= 1.
        wall_restitution: e_w, the coefficient of restitution of a grain and the base, 0 <= e_w <= 1.
        roughness: r of (2.8), 1/2 <= r <= sqrt(3)/2.
        surface: "free" or "interface".
        closure: the constitutive law: its name, a text such as "extended:packing=0.64" or "grains.py:OWN" (see
            :mod:`chuteflow.theory.laws`), or a :class:`chuteflow.theory.constitutive.Law`.
        base: the condition at the base, see :mod:`chuteflow.theory.bases`: its name, with parameters as in
            "richman:diameter=1.5", or a :class:`chuteflow.theory.bases.BaseCondition`.

    Raises:
        InputError: for a value out of range, naming it, what was given and what is allowed.
    """

    slope: float
    restitution: float
    wall_restitution: float
    roughness: float
    surface: str = "free"
    closure: str | Law = "lun"
    base: str | BaseCondition = "richman"

    def __post_init__(self) -> None:
        for name, parameter in PARAMETERS.items():
            check = base(self.base).check_roughness if name == "roughness" else parameter.checked
            object.__setattr__(self, name, check(getattr(self, name)))
        if self.surface not in SURFACES:
            raise InputError(f"unknown surface {self.surface!r}: choose one of {', '.join(SURFACES)}")
        if self.law.known:
            require_positive(self.law, self.restitution, self.slope)

    @classmethod
    def at_angle(cls, degrees: float, *others: Any, **named: Any) -> Chute:
        """A chute inclined by ``degrees``, 0 < degrees < 90; the other arguments as for Chute, in their order or named.

        Raises:
            InputError: for an angle out of range.
        """
        return cls(slope_of(degrees), *others, **named)

    @property
    def e(self) -> float:
        """The restitution."""
        return self.restitution

    @property
    def ew(self) -> float:
        """The wall restitution."""
        return self.wall_restitution

    @property
    def angle(self) -> float:
        """Inclination theta in degrees."""
        return math.degrees(math.atan(self.slope))

    @property
    def law(self) -> Law:
        """The constitutive law that its closure means now."""
        return law(self.closure)

    @property
    def summary(self) -> str:
        """All parameters on one line, in words and symbols."""
        slope, *others = (f"{one.symbol} = {getattr(self, name):g}" for name, one in PARAMETERS.items())
        numbers = ", ".join([f"{slope} ({self.angle:.4g} degrees)", *others])
        return f"{numbers}, {_SURFACES[self.surface]}, {self.laws}"

    @property
    def laws(self) -> str:
        """Closure and base in words; the base of the paper goes without saying."""
        on = base(self.base)
        return f"closure {self.closure}" + ("" if on == BASES["richman"] else f", base {on}")

    def as_dict(self) -> dict[str, float | str]:
        """All parameters by name, the closure as a text."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        values["closure"] = str(self.closure)
        on = base(self.base)
        # The base of the paper goes without saying.
        if on == BASES["richman"]:
            del values["base"]
            return values
        return values | {"base": str(on)}


def slope_of(degrees: Any) -> float:
    """tan(theta) of an inclination in degrees.

    Raises:
        InputError: for an angle that is not above 0 and below 90.
    """
    angle = number("angle", degrees)
    if not 0.0 < angle < 90.0:
        raise InputError(f"angle = {angle} degrees: must be above 0 and below 90")
    return math.tan(math.radians(angle))
