"""The energy budget of a mode: what feeds it, and what it loses.

# notation: n = nu'/nu, (u, v, w), tau = T'/T disturbances, U(z), p, T, nu of the steady flow, S' disturbed viscous
# stress, q' heat flux, gamma' collisional loss, eta viscosity; f* complex conjugate, <> integral over the height.

The energy is the quadratic form of Chu (1965), with this law's pressure p(nu, T) = g1 T:

    2 E = < nu (|u|^2 + |v|^2 + |w|^2) + nu dp/dnu |n|^2 + (3/2) nu T |tau|^2 >

Each linearised equation is multiplied by the conjugate of its field, with these weights, and integrated; the real
part of the sum is Re(sigma) 2 E. In this norm the work of the pressure passes energy between its three parts and adds
up to nothing, so that what is left are the sources. Advection by U drops out. Stresses and heat flux are integrated by
parts, which gives the terms of the base. All terms are divided by 2 E: they are rates, and add up to the growth rate.
What is left over, the closure, comes from quadrature and from the grains above the grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.eigenproblem import Complex
from chuteflow.numerics.first_order import FirstOrder, exp
from chuteflow.stability.base import BaseState
from chuteflow.stability.linear import ACROSS, ALONG, DENSITY, HEAT, UP, grains
from chuteflow.stability.modes import Mode, relative_fields
from chuteflow.theory.transport import AXES, Fields, Material, Motion, Vector, closures, motion, shear_rate
from chuteflow.threads import on_one_thread

#: Names of the terms, and what they are.
TERMS = {
    "shear production": "motion across the sheared velocity, -nu w U_z",
    "viscous stress": "work of the disturbed viscous stress on the disturbed shear",
    "shear work": "disturbed heating by shear",
    "collisional loss by density": "more collisions, and more loss, where grains are dense",
    "collisional loss by temperature": "more loss where grains are hot",
    "conduction": "heat conducted from hot to cold",
    "pressure work": "work of the pressure, which only passes energy on",
    "stratification": "motion across the density and temperature of the flow",
    "gravity": "weight of the disturbed density",
    "base": "stress and heat flux at the base",
    "above": "stress and heat flux at the top of the grid",
}


@dataclass(frozen=True)
class Term:
    """A term of a budget: what it adds to the ``kinetic``, ``density`` and ``thermal`` energy, as growth rates."""

    name: str
    kinetic: float = 0.0
    density: float = 0.0
    thermal: float = 0.0

    @property
    def total(self) -> float:
        """What it adds to the growth rate."""
        return self.kinetic + self.density + self.thermal


@dataclass(frozen=True, eq=False)
class ModeBudget:
    """The energy budget of ``mode``: ``terms`` that add up to its growth rate but for ``closure``.

    ``shares`` are those of the kinetic, density and thermal energy. Rates are in sqrt(g cos(theta)/d).
    """

    mode: Mode
    terms: tuple[Term, ...]
    shares: tuple[float, float, float]
    closure: float

    def rate(self, *names: str) -> float:
        """The sum of some of the terms."""
        return sum(term.total for term in self.terms if term.name in names)

    @property
    def largest_source(self) -> Term:
        """The term that feeds the mode most."""
        return max(self.terms, key=lambda term: term.total)


@on_one_thread
def energy_budget(mode: Mode) -> ModeBudget:
    """The energy budget of ``mode``, on the grid on which it was computed."""
    at = _Disturbed.of(mode)
    terms = tuple(_terms(at))
    closure = mode.growth - sum(term.total for term in terms)
    total = sum(at.energies)
    kinetic, density, thermal = (part / total for part in at.energies)
    return ModeBudget(mode, terms, (kinetic, density, thermal), closure)


@dataclass(frozen=True, eq=False)
class _Disturbed:
    """A mode and what it disturbs, at the nodes from far above down to the base."""

    base: BaseState
    kx: float
    ky: float
    n: Complex
    velocity: Complex
    tau: Complex
    moving: Motion
    pressure: FirstOrder
    viscosity: FirstOrder
    loss_by_density: Complex
    loss_by_temperature: Complex
    stiffness: Array

    @classmethod
    def of(cls, mode: Mode) -> _Disturbed:
        base, profile = mode.operator.base, mode.operator.base.profile
        fields = relative_fields(mode.operator, mode.vector)
        still = np.zeros(base.points)
        steady = (np.log(profile.volume_fraction), profile.velocity, still, still, np.log(profile.granular_temperature))
        numbers = [FirstOrder(value, field[:, None]) for value, field in zip(steady, fields, strict=True)]

        def gradient(f: FirstOrder) -> Vector:
            along, across = (FirstOrder(np.zeros_like(f.value), 1j * k * f.slope) for k in (mode.kx, mode.ky))
            return along, across, FirstOrder(base.derivative @ f.value, base.derivative @ f.slope)

        law = grains(base.flow.chute, base.flow.law)
        velocity = (numbers[ALONG], numbers[ACROSS], numbers[UP])
        moving = motion(Fields(numbers[DENSITY], velocity, numbers[HEAT]), gradient, law)
        T, root_T = exp(numbers[HEAT]), exp(0.5 * numbers[HEAT])
        _, g1, g2, _, _, g5, _ = closures(
            law, exp(numbers[DENSITY]), lambda: shear_rate(moving.shear) / (exp(numbers[DENSITY]) * root_T)
        )
        loss = (g5 * root_T * T).value
        by_density = g5.slope[:, 0] * (root_T * T).value
        return cls(
            base=base,
            kx=mode.kx,
            ky=mode.ky,
            n=fields[DENSITY],
            velocity=fields[ALONG : UP + 1],
            tau=fields[HEAT],
            moving=moving,
            pressure=g1 * T,
            viscosity=g2 * root_T,
            loss_by_density=by_density,
            loss_by_temperature=1.5 * loss * fields[HEAT],
            stiffness=_stiffness(base, law),
        )

    @property
    def energies(self) -> tuple[float, float, float]:
        """Twice the kinetic, density and thermal energy."""
        profile = self.base.profile
        parts = (
            profile.volume_fraction * (np.abs(self.velocity) ** 2).sum(axis=0),
            self.stiffness * np.abs(self.n) ** 2,
            1.5 * profile.volume_fraction * profile.granular_temperature * np.abs(self.tau) ** 2,
        )
        kinetic, density, thermal = (float(self.base.weights @ part) for part in parts)
        return kinetic, density, thermal

    def rate(self, integrand: Complex) -> float:
        """Re < integrand > over twice the energy."""
        return float(np.real(self.base.weights @ integrand)) / sum(self.energies)

    def gradient(self, field: Complex) -> Complex:
        """The gradient of a disturbance, (3, n)."""
        return np.array([1j * self.kx * field, 1j * self.ky * field, self.base.derivative @ field])

    @cached_property
    def strain(self) -> Complex:
        """d u_i/d x_j of the disturbed velocity, (3, 3, n)."""
        return np.array([self.gradient(component) for component in self.velocity])

    @cached_property
    def divergence(self) -> Complex:
        """Divergence of the disturbed velocity."""
        return np.einsum("iin->n", self.strain)

    @cached_property
    def viscous_stress(self) -> Complex:
        """S' (3, 3, n)."""
        stress: Complex = np.array([[self.moving.pressure[i][j].slope[:, 0] for j in AXES] for i in AXES])
        for i in AXES:
            stress[i, i] -= self.pressure.slope[:, 0]
        return stress

    @cached_property
    def heat_flux(self) -> Complex:
        """q' (3, n)."""
        return np.array([component.slope[:, 0] for component in self.moving.heat_flux])

    @cached_property
    def shear(self) -> Array:
        """dU/dz."""
        return self.base.derivative @ self.base.profile.velocity


def _stiffness(base: BaseState, law: Material) -> Array:
    """nu dp/dnu at constant T."""
    nu, T = base.profile.volume_fraction, base.profile.granular_temperature
    nothing = FirstOrder(np.zeros(len(nu)), np.zeros((len(nu), 1)))
    g1 = closures(law, FirstOrder(nu, np.ones((len(nu), 1))), lambda: nothing)[1]
    return nu * T * np.real(g1.slope[:, 0])


def _terms(at: _Disturbed) -> list[Term]:
    """All terms, in the order of TERMS."""
    return [*_kinetic(at), *_thermal(at), *_exchange_terms(at), *_at_the_ends(at)]


def _kinetic(at: _Disturbed) -> list[Term]:
    u, _, w = at.velocity
    work = (at.viscous_stress * at.strain.conj()).sum(axis=(0, 1))
    return [
        Term("shear production", kinetic=at.rate(-at.base.profile.volume_fraction * w * at.shear * u.conj())),
        Term("viscous stress", kinetic=at.rate(work)),
    ]


def _thermal(at: _Disturbed) -> list[Term]:
    star, shear = at.tau.conj(), at.shear
    heating = at.viscosity.slope[:, 0] * shear**2
    heating = heating + 2.0 * at.viscosity.value * shear * (at.strain[0, 2] + at.strain[2, 0])
    return [
        Term("shear work", thermal=at.rate(star * heating)),
        Term("collisional loss by density", thermal=at.rate(-star * at.loss_by_density)),
        Term("collisional loss by temperature", thermal=at.rate(-star * at.loss_by_temperature)),
        Term("conduction", thermal=at.rate((at.heat_flux * at.gradient(at.tau).conj()).sum(axis=0))),
    ]


def _exchange_terms(at: _Disturbed) -> list[Term]:
    """What the pressure passes on, and what comes from the fields and the weight of the steady flow."""
    profile, d_dz = at.base.profile, at.base.derivative
    nu, T = profile.volume_fraction, profile.granular_temperature
    u, _, w = at.velocity
    slope, n_star, star = at.base.flow.chute.slope, at.n.conj(), at.tau.conj()
    push = (at.velocity.conj() * at.gradient(at.pressure.slope[:, 0])).sum(axis=0)
    return [
        Term(
            "pressure work",
            kinetic=at.rate(-push),
            density=at.rate(-at.stiffness * n_star * at.divergence),
            thermal=at.rate(-at.pressure.value * star * at.divergence),
        ),
        Term(
            "stratification",
            density=at.rate(-at.stiffness * n_star * w * (d_dz @ np.log(nu))),
            thermal=at.rate(-1.5 * nu * T * star * w * (d_dz @ np.log(T))),
        ),
        Term("gravity", kinetic=at.rate(nu * at.n * (slope * u.conj() - w.conj()))),
    ]


def _at_the_ends(at: _Disturbed) -> list[Term]:
    size = sum(at.energies)

    def passed(name: str, node: int, sign: float) -> Term:
        work = at.velocity[:, node].conj() @ at.viscous_stress[:, 2, node]
        heat = at.tau[node].conj() * at.heat_flux[2, node]
        return Term(name, kinetic=sign * float(work.real) / size, thermal=sign * float(heat.real) / size)

    return [passed("base", -1, 1.0), passed("above", 0, -1.0)]
