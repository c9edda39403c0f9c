"""The interface of a constitutive law, and the combinations of it that the steady problem needs.

# notation: nu volume fraction, e restitution, s slope tan(theta), p = g1 T normal stress,
# y = q/(p sqrt(T)) heat flux over normal stress and thermal speed.

A law gives p = g1(nu) T, eta = g2(nu) sqrt(T), K = g3(nu) sqrt(T), K* = g4(nu) T^(3/2) and
gamma = g5(nu) T^(3/2) (2.7). The steady problem in the overburden coordinate p needs of them only
the functions of nu in :class:`Reduced`.

The heat flux (3.6) is q = nu (g3 sqrt(T) dT/dp - g4 T^(3/2) dnu/dp). With Gamma(nu), dGamma/dnu = g4/g3, it
is the gradient of one potential, theta = ln T - Gamma(nu):

    y = (g3 nu/g1) dtheta/dp

theta is uniform wherever there is no heat flux, however the density varies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from chuteflow.errors import InputError

#: An array of values at given states.
Field = NDArray[Any]

#: Contact value in Richman's A(nu): d = d_w in (2.12).
WALL_CONTACT = np.pi / (12.0 * np.sqrt(2.0))


@dataclass(frozen=True)
class Coefficients:
    """Values of a law at given nu, in forms that are finite at nu = 0; arrays of one shape.

    ``radial`` is g0; ``compressibility`` is G = g1/nu and ``compressibility_slope`` dG/dnu;
    ``viscosity`` g2; ``conductivity`` g3; ``density_conductivity`` g4;
    ``dissipation`` g5/nu^2; ``bulk_viscosity`` g6.
    """

    radial: Field
    compressibility: Field
    compressibility_slope: Field
    viscosity: Field
    conductivity: Field
    density_conductivity: Field
    dissipation: Field
    bulk_viscosity: Field


@dataclass(frozen=True)
class Law:
    """A constitutive law.

    ``coefficients(nu, room, e, slope)`` takes nu and ``room`` = 1 - nu/nu* apart, so that no digit is lost
    near the densest packing nu* = ``densest``, where the radial distribution function diverges. It is a plain
    function, or a frozen dataclass whose fields are the parameters of the law, see
    :class:`chuteflow.theory.formula.Formula`: laws with equal values of them are equal.
    ``knows_slope`` is for laws whose dissipation depends on the shear rate, which in a fully developed flow
    is a function of nu and the slope. ``breaks`` are the volume fractions at which a coefficient is not smooth, or
    a function of e and the slope that gives them; ``valid`` is where the law was meant to hold, in words.
    """

    name: str
    description: str
    source: str
    densest: float
    coefficients: Callable[[Field, Field, float, float], Coefficients]
    knows_slope: bool = False
    breaks: tuple[float, ...] | Callable[[float, float], tuple[float, ...]] = ()
    valid: str = ""

    @classmethod
    def of(cls, name: str, description: str, source: str, formula: Any, valid: str = "") -> Law:
        """The law of a ``formula``, a dataclass of parameters that also has ``densest`` and ``breaks``."""
        knows_slope = hasattr(formula, "at_shear")
        return cls(name, description, source, formula.densest, formula, knows_slope, formula.breaks, valid)

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters by name; none where the law is a plain function."""
        formula: Any = self.coefficients
        return {field.name: getattr(formula, field.name) for field in fields(formula)} if is_dataclass(formula) else {}

    def configured(self, **settings: Any) -> Law:
        """The law with other values of some of its parameters.

        Raises:
            InputError: for a parameter that it does not have, or a value out of range.
        """
        for name in settings:
            if name not in self.parameters:
                known = ", ".join(self.parameters) or "it has none"
                raise InputError(f"closure {self.name!r} has no parameter {name!r}: choose from {known}")
        if not settings:
            return self
        formula: Any = replace(cast(Any, self.coefficients), **settings)
        return Law.of(self.name, self.description, self.source, formula, self.valid)

    def breaks_at(self, e: float, slope: float) -> tuple[float, ...]:
        """The volume fractions, ascending, at which a coefficient is not smooth at this restitution and slope.

        Raises:
            InputError: for one that is not between 0 and the densest packing.
        """
        places = self.breaks(e, slope) if callable(self.breaks) else self.breaks
        for nu in places:
            if not 0.0 < nu < self.densest:
                raise InputError(
                    f"closure {self.name!r} has a break at nu = {nu:g}: must be above 0 and below {self.densest:g}"
                )
        return tuple(sorted(places))

    def at(self, x: Field, e: float, slope: float) -> tuple[Field, Field, Coefficients]:
        """nu, 1 - nu/nu* and the coefficients at x = nu/(1 - nu/nu*).

        Raises:
            InputError: where the law's function fails, naming it and the densities.
        """
        room = 1.0 / (1.0 + x / self.densest)
        nu = x * room
        return nu, room, self.coefficients(nu, room, e, slope)


@dataclass(frozen=True)
class Reduced:
    """What the steady problem needs of a law: functions of nu that are finite at nu = 0, arrays of one shape.

    - ``conduction`` = g3 nu/g1, with which y = conduction dtheta/dp;
    - ``coupling`` = g4/g3, with theta = ln T - Gamma and dGamma/dnu = coupling;
    - ``loss`` = g5/(nu g1) and ``work`` = g1/(nu g2): dissipation less production is loss - s^2 work;
    - ``shear`` = g1/g2, with du/dz = s shear sqrt(T) (3.10);
    - ``grip`` = A g1/g2, of the slip condition (3.16);
    - ``compressibility`` = G = g1/nu and ``stiffness`` = d ln g1 / d ln nu.
    """

    conduction: Field
    coupling: Field
    loss: Field
    work: Field
    shear: Field
    grip: Field
    compressibility: Field
    stiffness: Field


def reduce(law: Law, x: Field, e: float, slope: float) -> Reduced:
    """Combine the coefficients of ``law`` at x = nu/(1 - nu/nu*) >= 0 into :class:`Reduced`."""
    nu, _, g = law.at(x, e, slope)
    big_g = g.compressibility
    # A g1 with (2.12): nu A is finite at nu = 0, where A alone is not.
    nu_contact = nu * (1.0 + WALL_CONTACT) + WALL_CONTACT * 5.0 / (8.0 * g.radial)
    return Reduced(
        conduction=g.conductivity / big_g,
        coupling=g.density_conductivity / g.conductivity,
        loss=g.dissipation / big_g,
        work=big_g / g.viscosity,
        shear=nu * big_g / g.viscosity,
        grip=big_g * nu_contact / g.viscosity,
        compressibility=big_g,
        stiffness=1.0 + nu * g.compressibility_slope / big_g,
    )


def fingerprint(law: Law, e: float, slope: float) -> list[float]:
    """Values of ``law`` at a few densities, by which it is known again, whatever its name."""
    x = np.array([0.0, 0.3, 3.0])
    room = 1.0 / (1.0 + x / law.densest)
    g = law.coefficients(x * room, room, e, slope)
    values = [getattr(g, field.name) for field in fields(g)]
    return [law.densest, *np.concatenate([np.broadcast_to(value, x.shape) for value in values]).tolist()]


def require_positive(law: Law, e: float, slope: float) -> None:
    """Check that pressure, viscosity and conductivity stay positive at every density.

    Raises:
        InputError: where ``law`` loses its meaning at restitution ``e``.
    """
    x = np.append(0.0, np.logspace(-4.0, 9.0, 261))
    room = 1.0 / (1.0 + x / law.densest)
    g = law.coefficients(x * room, room, e, slope)
    checks = {
        "g1": g.compressibility,
        "g2": g.viscosity,
        "g3": g.conductivity,
    }
    for what, values in checks.items():
        if not np.all(np.isfinite(values)) or np.min(values) <= 0.0:
            raise InputError(
                f"closure {law.name!r} has no positive {what} at restitution e = {e}: "
                "take a larger e or another closure"
            )
