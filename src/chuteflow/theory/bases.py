"""The registry of bases: conditions at the bottom of a flow, with their parameters.

# notation: r roughness, e_w wall restitution, s slope, y = q/(p sqrt(T)) heat flux; G = g1/nu, g0, ... of table 1.

A base gives the slip velocity F1 sqrt(T) and the heat flux y = s F1 - loss, with F1 and loss affine in two functions of
the density, which are tabulated with the law. So wall restitution, roughness and the parameters of the base change
nothing but a few numbers.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any

from chuteflow.checks import number, shorten
from chuteflow.errors import InputError
from chuteflow.numerics.complex_step import stepped
from chuteflow.parameters import PARAMETERS
from chuteflow.theory import boundary
from chuteflow.theory.constitutive import Field, Reduced
from chuteflow.theory.transport import AtBase, Number, Vector, richman_exchange


@dataclass(frozen=True)
class BaseCondition:
    """A condition at the base."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What it is called."""

    @abstractmethod
    def functions(self, reduced: Reduced) -> tuple[Field, Field]:
        """The two functions of the density in which F1 and the loss are affine."""

    @abstractmethod
    def where_empty(self, radial: float, wall_shear: float) -> tuple[float, float]:
        """These two where the density vanishes, of g0 and A g1/g2 there."""

    @abstractmethod
    def slip(self, first: Field, second: Field, roughness: float, slope: float) -> Field:
        """F1, given the two functions."""

    @abstractmethod
    def loss(self, wall_restitution: float, roughness: float) -> tuple[float, float]:
        """The energy lost in collisions with the base over p sqrt(T): a constant, and the factor of the second
        function."""

    @abstractmethod
    def exchange(self, at: AtBase, roughness: float, wall_restitution: float) -> tuple[Vector, Number]:
        """The momentum M that the base takes from moving grains, and the energy lost in collisions with it."""

    def check_roughness(self, value: Any) -> float:
        """The roughness, checked to be in the range of the condition.

        Raises:
            InputError: for one out of range.
        """
        return PARAMETERS["roughness"].checked(value)

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def stepped(self, name: str) -> BaseCondition:
        """The base with one of its parameters an imaginary step further (:mod:`chuteflow.numerics.complex_step`)."""
        found = copy(self)
        object.__setattr__(found, name, stepped(getattr(self, name)))
        return found

    def __str__(self) -> str:
        said = ",".join(f"{name}={value:g}" for name, value in self.parameters.items())
        return self.name if self == BASES[self.name] else f"{self.name}:{said}"


@dataclass(frozen=True)
class Richman(BaseCondition):
    """Hemispheres on a plane, (2.8)-(2.15): Richman 1988.

    Args:
        diameter: of the hemispheres, in that of the grains.
    """

    diameter: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "diameter", number("diameter", self.diameter, 0.1, 10.0))

    @property
    def name(self) -> str:
        """What it is called."""
        return "richman"

    def functions(self, reduced: Reduced) -> tuple[Field, Field]:
        """g1/g2 and A g1/g2, with A of (2.12) for grains and hemispheres of one size."""
        return reduced.shear, reduced.wall_shear

    def where_empty(self, radial: float, wall_shear: float) -> tuple[float, float]:
        """g1/g2 vanishes."""
        del radial
        return 0.0, wall_shear

    def slip(self, first: Field, second: Field, roughness: float, slope: float) -> Field:
        """F1 of (3.16): with dbar = (1 + diameter)/2 for the diameter d before the shear rate in (2.10), and in A."""
        plain = boundary.slip_coefficient(first, second, roughness, slope)
        if self.diameter == 1.0:
            return plain
        # dbar A g1/g2 = A g1/g2 at dbar = 1, and (dbar - 1) g1/g2.
        more = 0.5 * (self.diameter - 1.0)
        k = boundary.kappa(roughness)
        return plain + slope / k * more * (k - 0.5 * roughness**2) * first

    def loss(self, wall_restitution: float, roughness: float) -> tuple[float, float]:
        """(2.15), the same at every density."""
        return boundary.base_loss(wall_restitution, roughness), 0.0

    def exchange(self, at: AtBase, roughness: float, wall_restitution: float) -> tuple[Vector, Number]:
        """(2.9)-(2.15)."""
        return richman_exchange(at, roughness, wall_restitution, self.diameter)

    def check_roughness(self, value: Any) -> float:
        """From hemispheres that touch, to those between which a grain touches the plane.

        Raises:
            InputError: for one out of range.
        """
        if self.diameter == 1.0:
            return super().check_roughness(value)
        found = number("roughness", value)
        low = self.diameter / (1.0 + self.diameter)
        high = math.sqrt(1.0 - 1.0 / (1.0 + self.diameter) ** 2)
        if not low <= found <= high + 5e-5:
            raise InputError(
                f"roughness r = {found}: must be from {low:.6f} to {high:.6f} where the diameter of the base's "
                f"hemispheres is {self.diameter:g} of that of the grains"
            )
        return min(found, high)


@dataclass(frozen=True)
class JohnsonJackson(BaseCondition):
    """A wall that takes a fraction of the tangential momentum: Johnson & Jackson 1987. The roughness does not enter.

    F1 = s g1 6 nu*/(pi sqrt(3) phi nu g0), and the loss over g1 is (pi sqrt(3)/(4 nu*)) (1 - e_w^2) nu g0.

    Args:
        specularity: phi, from above 0 (smooth) to 1 (rough).
        packing: nu* in these formulas.
    """

    specularity: float = 0.5
    packing: float = 0.62

    def __post_init__(self) -> None:
        object.__setattr__(self, "specularity", number("specularity", self.specularity, 1e-6, 1.0))
        object.__setattr__(self, "packing", number("packing", self.packing, 0.3, 1.0))

    @property
    def name(self) -> str:
        """What it is called."""
        return "johnson-jackson"

    def functions(self, reduced: Reduced) -> tuple[Field, Field]:
        """G/g0 and g0/G."""
        return reduced.compressibility / reduced.radial, reduced.radial / reduced.compressibility

    def where_empty(self, radial: float, wall_shear: float) -> tuple[float, float]:
        """G is 1."""
        del wall_shear
        return 1.0 / radial, radial

    def slip(self, first: Field, second: Field, roughness: float, slope: float) -> Field:
        """F1; the roughness does not enter."""
        del second, roughness
        return slope * 6.0 * self.packing / (math.pi * math.sqrt(3.0) * self.specularity) * first

    def loss(self, wall_restitution: float, roughness: float) -> tuple[float, float]:
        """No constant, and the factor of g0/G."""
        del roughness
        return 0.0, math.pi * math.sqrt(3.0) / (4.0 * self.packing) * (1.0 - wall_restitution**2)

    def exchange(self, at: AtBase, roughness: float, wall_restitution: float) -> tuple[Vector, Number]:
        """The drag is proportional to the velocity along the wall."""
        strength = at.density * at.radial * at.root_temperature
        drag = -(strength * (math.pi * math.sqrt(3.0) / (6.0 * self.packing) * self.specularity))
        _, loss = self.loss(wall_restitution, roughness)
        u, v, _ = at.velocity
        return (drag * u, drag * v, at.normal), strength * at.root_temperature * at.root_temperature * loss


#: The bases by name, with the parameters that they have unless others are given.
BASES: dict[str, BaseCondition] = {base.name: base for base in (Richman(), JohnsonJackson())}


def base(asked: str | BaseCondition) -> BaseCondition:
    """The base that ``asked`` means: itself, or that of a text such as "richman:diameter=1.5".

    Raises:
        InputError: for an unknown name or parameter, or a value out of range.
    """
    if isinstance(asked, BaseCondition):
        return asked
    name, _, said = asked.partition(":") if isinstance(asked, str) else (asked, "", "")
    if not isinstance(name, str) or name not in BASES:
        raise InputError(f"unknown base {shorten(asked)}: choose one of {', '.join(BASES)}")
    settings: dict[str, float] = {}
    for part in said.split(",") if said else ():
        key, _, value = part.partition("=")
        if key not in BASES[name].parameters:
            known = ", ".join(BASES[name].parameters)
            raise InputError(f"base {name!r} has no parameter {key!r}: choose from {known}, as KEY=VALUE")
        try:
            settings[key] = float(value)
        except ValueError:
            raise InputError(f"{key} = {shorten(value)}: must be a number") from None
    return replace(BASES[name], **settings)


def require_richman(asked: str | BaseCondition, what: str) -> None:
    """Check that the base is Richman's with hemispheres as large as the grains, as in the paper.

    Raises:
        InputError: for another; ``what`` is known for that one alone.
    """
    if base(asked) != BASES["richman"]:
        raise InputError(
            f"base {base(asked)}: {what} known for the base richman alone, with hemispheres like the grains"
        )
