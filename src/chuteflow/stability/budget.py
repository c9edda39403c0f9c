"""The energy budget of a mode: what feeds it, and what it loses.

# notation: n = nu'/nu, (u, v, w), tau = T'/T disturbances, U(z), p, T, nu of the steady flow, S' disturbed viscous
# stress, q' heat flux, gamma' collisional loss, eta viscosity; f* complex conjugate, <> integral over the height.

The energy is the quadratic form of Chu (1965), with this law's pressure p(nu, T) = g1 T:

    2 E = < nu (|u|^2 + |v|^2 + |w|^2) + nu dp/dnu |n|^2 + (3/2) nu T |tau|^2 >

Each linearised equation is multiplied by the conjugate of its field, with these weights, and integrated; the real part of
the sum is Re(sigma) 2 E. In this norm the work of the pressure passes energy between its three parts and adds up
to nothing, so that what is left are the sources. Advection by U drops out. Stresses and heat flux are integrated by
parts, which gives the terms of the base. All terms are divided by 2 E: they are rates, and add up to the growth rate.
What is left over, the closure, comes from quadrature and from the grains above the grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.eigenproblem import Complex
from chuteflow.numerics.first_order import FirstOrder, exp
from chuteflow.stability.base import Base
from chuteflow.stability.linear import ACROSS, ALONG, DENSITY, HEAT, UP, grains
from chuteflow.stability.modes import Mode, relative_fields
from chuteflow.theory.transport import AXES, Fields, Motion, Vector, closures, motion

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
class Budget:
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


def energy_budget(mode: Mode) -> Budget:
    """The energy budget of ``mode``, on the grid on which it was computed."""
    at = _Disturbed.of(mode)
    terms = tuple(_terms(at))
    closure = mode.growth - sum(term.total for term in terms)
    total = sum(at.energies)
    kinetic, density, thermal = (part / total for part in at.energies)
    return Budget(mode, terms, (kinetic, density, thermal), closure)


@dataclass(frozen=True, eq=False)
class _Disturbed:
    """A mode and what it disturbs, at the nodes from far above down to the base."""

    base: Base
    kx: float
    ky: float
    n: Complex
    velocity: Sequence[Complex]
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

        law = grains(base)
        velocity = (numbers[ALONG], numbers[ACROSS], numbers[UP])
        moving = motion(Fields(numbers[DENSITY], velocity, numbers[HEAT]), gradient, law)
        T, root_T = exp(numbers[HEAT]), exp(0.5 * numbers[HEAT])
        _, g1, g2, _, _, g5, _ = closures(law, exp(numbers[DENSITY]))
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

    def integral(self, integrand: Complex) -> float:
        """Re < integrand > over twice the energy."""
        return float(np.real(self.base.weights @ integrand)) / sum(self.energies)

    @property
    def energies(self) -> tuple[float, float, float]:
        """Twice the kinetic, density and thermal energy."""
        profile = self.base.profile
        nu, T = profile.volume_fraction, profile.granular_temperature
        parts = (
            nu * sum(np.abs(component) ** 2 for component in self.velocity),
            self.stiffness * np.abs(self.n) ** 2,
            1.5 * nu * T * np.abs(self.tau) ** 2,
        )
        kinetic, density, thermal = (float(self.base.weights @ part) for part in parts)
        return kinetic, density, thermal

    def gradient(self, field: Complex) -> tuple[Complex, Complex, Complex]:
        """The gradient of a disturbance."""
        return 1j * self.kx * field, 1j * self.ky * field, self.base.derivative @ field

    @property
    def divergence(self) -> Complex:
        """Divergence of the disturbed velocity."""
        return sum((self.gradient(self.velocity[i])[i] for i in AXES), np.zeros(self.base.points, dtype=complex))


def _stiffness(base: Base, law: object) -> Array:
    """nu dp/dnu at constant T."""
    nu, T = base.profile.volume_fraction, base.profile.granular_temperature
    number = FirstOrder(nu, np.ones((len(nu), 1)))
    g1 = closures(law, number)[1]  # pyright: ignore[reportArgumentType]
    return nu * T * np.real(g1.slope[:, 0])


def _terms(at: _Disturbed) -> list[Term]:
    """All terms, in the order of TERMS."""
    base, profile = at.base, at.base.profile
    nu, T, p = profile.volume_fraction, profile.granular_temperature, at.pressure.value
    u, _, w = at.velocity
    across = at.velocity[ACROSS - ALONG]
    shear = base.derivative @ profile.velocity
    p_ = at.pressure.slope[:, 0]
    S = [[at.moving.pressure[i][j].slope[:, 0] - (p_ if i == j else 0.0) for j in AXES] for i in AXES]
    grads = [at.gradient(component) for component in at.velocity]
    q = [at.moving.heat_flux[i].slope[:, 0] for i in AXES]
    eta, eta_ = at.viscosity.value, at.viscosity.slope[:, 0]
    heating = eta_ * shear**2 + 2.0 * eta * shear * (grads[0][2] + grads[2][0])
    slope = base.flow.chute.slope
    grad_p = at.gradient(p_)
    grad_tau = at.gradient(at.tau)

    def rate(integrand: Complex) -> float:
        return at.integral(integrand)

    def end(node: int, sign: float) -> tuple[float, float]:
        """The fluxes of kinetic and thermal energy through an end."""
        work = sum(np.conj(at.velocity[i][node]) * S[i][2][node] for i in AXES)
        heat = np.conj(at.tau[node]) * q[2][node]
        size = sum(at.energies)
        return sign * float(np.real(work)) / size, sign * float(np.real(heat)) / size

    (base_work, base_heat), (top_work, top_heat) = end(-1, 1.0), end(0, -1.0)
    star = np.conj(at.tau)
    return [
        Term("shear production", kinetic=rate(-nu * w * shear * u.conj())),
        Term("viscous stress", kinetic=rate(sum(S[i][j] * grads[i][j].conj() for i in AXES for j in AXES))),
        Term("shear work", thermal=rate(star * heating)),
        Term("collisional loss by density", thermal=rate(-star * at.loss_by_density)),
        Term("collisional loss by temperature", thermal=rate(-star * at.loss_by_temperature)),
        Term("conduction", thermal=rate(sum(q[i] * grad_tau[i].conj() for i in AXES))),
        Term(
            "pressure work",
            kinetic=rate(-(u.conj() * grad_p[0] + across.conj() * grad_p[1] + w.conj() * grad_p[2])),
            density=rate(-at.stiffness * at.n.conj() * at.divergence),
            thermal=rate(-p * star * at.divergence),
        ),
        Term(
            "stratification",
            density=rate(-at.stiffness * at.n.conj() * w * (base.derivative @ np.log(nu))),
            thermal=rate(-1.5 * nu * T * star * w * (base.derivative @ np.log(T))),
        ),
        Term("gravity", kinetic=rate(nu * at.n * (slope * u.conj() - w.conj()))),
        Term("base", kinetic=base_work, thermal=base_heat),
        Term("above", kinetic=top_work, thermal=top_heat),
    ]
