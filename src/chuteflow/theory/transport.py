"""The equations of motion in full, (2.1)-(2.7), and Richman's base in full, (2.9)-(2.15).

# notation: nu volume fraction, T granular temperature, u = (u, v, w), P pressure tensor, q heat flux,
# n = (0, 0, 1) the normal of the base into the flow, tau = (1, 0, 0), t = (0, 1, 0).

Written once for any kind of number with sums, products and quotients: plain fields, or fields that carry
first-order coefficients. What a derivative is, the caller says. The logarithms of nu and T are the fields, so
that both stay positive and nothing is divided by a density that vanishes far above.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from chuteflow.errors import InputError
from chuteflow.numerics.first_order import Field, apply, apply_two, exp
from chuteflow.theory import boundary
from chuteflow.theory.constitutive import WALL_CONTACT, Coefficients, Law, require_limit

#: A field of the caller's kind of number.
Number = Any
Vector = tuple[Number, Number, Number]
Tensor = tuple[Vector, Vector, Vector]
#: The gradient (d/dx, d/dy, d/dz) of a field.
Gradient = Callable[[Number], Vector]

AXES = range(3)
_UNIT: Tensor = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Fields:
    """ln nu, (u, v, w) and ln T."""

    log_density: Number
    velocity: Vector
    log_temperature: Number


@dataclass(frozen=True)
class Material:
    """What the equations need to know of the grains and the chute: law, restitution and slope."""

    law: Law
    restitution: float
    slope: float

    def __post_init__(self) -> None:
        if self.law.knows_slope and not hasattr(self.law.coefficients, "at_shear"):
            raise InputError(
                f"closure {self.law.name!r} knows the shear rate by the slope alone, which holds in steady flows: "
                "take another closure for disturbed ones"
            )
        require_limit(self.law, self.restitution, self.slope, "the conditions of disturbed flows need")


@dataclass(frozen=True)
class Motion:
    """Stresses, fluxes and forces of ``fields``.

    ``forces`` are the right-hand sides of (2.1)-(2.3), for d ln nu/dt, nu du/dt and (3/2) nu T d ln T/dt, with
    advection on the right; ``inertia`` is what stands before the five time derivatives.
    """

    density: Number
    root_temperature: Number
    velocity: Vector
    shear: Tensor
    pressure: Tensor
    heat_flux: Vector
    radial: Number

    forces: tuple[Number, ...]
    inertia: tuple[Number, ...]


def motion(fields: Fields, gradient: Gradient, grains: Material) -> Motion:
    """Everything in (2.1)-(2.7) for ``fields``."""
    nu, T = exp(fields.log_density), exp(fields.log_temperature)
    root_T = exp(0.5 * fields.log_temperature)
    grad_log_nu, grad_log_T = gradient(fields.log_density), gradient(fields.log_temperature)
    grad_u: Tensor = tuple(gradient(component) for component in fields.velocity)  # pyright: ignore[reportAssignmentType]
    radial, g1, g2, g3, g4, g5, g6 = closures(grains, nu, lambda: shear_rate(grad_u) / (nu * root_T))
    P = pressure_tensor(g1 * T, g2 * root_T, g6 * root_T, grad_u)
    # (2.5), with grad T = T grad ln T
    K, K_star = g3 * root_T * T, g4 * nu * root_T * T
    q = _vector(lambda i: K_star * grad_log_nu[i] - K * grad_log_T[i])
    gravity = (grains.slope, 0.0, -1.0)
    momentum = tuple(
        nu * gravity[i] - nu * _dot(fields.velocity, grad_u[i]) - _sum(gradient(P[i][j])[j] for j in AXES) for i in AXES
    )
    work = _sum(P[i][j] * grad_u[i][j] for i in AXES for j in AXES)
    heat = 1.5 * nu * T
    energy = -(heat * _dot(fields.velocity, grad_log_T)) - work - divergence(q, gradient) - g5 * root_T * T
    mass = -_dot(fields.velocity, grad_log_nu) - _sum(grad_u[i][i] for i in AXES)
    return Motion(
        density=nu,
        root_temperature=root_T,
        velocity=fields.velocity,
        shear=grad_u,
        pressure=P,
        heat_flux=q,
        radial=radial,
        forces=(mass, *momentum, energy),
        inertia=(1.0, nu, nu, nu, heat),
    )


def closures(grains: Material, nu: Number, rate: Callable[[], Number]) -> list[Number]:
    """g0 to g6 of table 1 at ``nu``, in the order radial, g1, g2, g3, g4, g5, g6.

    ``rate`` gives the shear rate over nu sqrt(T); it is requested where the dissipation of the law depends on it.
    """
    law, e = grains.law, grains.restitution
    if law.knows_slope:
        at_shear: Any = law.coefficients.at_shear  # pyright: ignore[reportFunctionMemberAccess]
        return apply_two(lambda nu, rate: _table(nu, at_shear(nu, 1.0 - nu / law.densest, e, rate)), nu, rate())
    return apply(lambda nu: _table(nu, law.coefficients(nu, 1.0 - nu / law.densest, e, grains.slope)), nu)


def _table(nu: Field, g: Coefficients) -> Field:
    return np.stack(
        [
            g.radial,
            nu * g.compressibility,
            g.viscosity,
            g.conductivity,
            g.density_conductivity,
            nu**2 * g.dissipation,
            g.bulk_viscosity,
        ]
    )


def shear_rate(grad_u: Tensor) -> Number:
    """sqrt(2 D : D) with the deviatoric strain rate D, which is |du/dz| in simple shear."""
    third = _sum(grad_u[i][i] for i in AXES) * (1.0 / 3.0)
    diagonal = _sum((grad_u[i][i] - third) * (grad_u[i][i] - third) for i in AXES) * 2.0
    square = diagonal + _sum(
        (grad_u[i][j] + grad_u[j][i]) * (grad_u[i][j] + grad_u[j][i]) for i in AXES for j in AXES if i < j
    )
    (root,) = apply(lambda value: np.sqrt(value)[None], square)
    return root


def pressure_tensor(p: Number, eta: Number, xi: Number, grad_u: Tensor) -> Tensor:
    """P of (2.4) with the strain rate (2.6); ``grad_u[i][j]`` is d u_i/d x_j."""
    spread = _sum(grad_u[i][i] for i in AXES)
    isotropic = p - (xi - eta * (2.0 / 3.0)) * spread

    def entry(i: int, j: int) -> Number:
        shear = -(eta * (grad_u[i][j] + grad_u[j][i]))
        return isotropic + shear if i == j else shear

    return _vector(lambda i: _vector(lambda j: entry(i, j)))


def divergence(vector: Vector, gradient: Gradient) -> Number:
    """d v_i/d x_i."""
    return _sum(gradient(vector[i])[i] for i in AXES)


def base_conditions(at: Motion, roughness: float, wall_restitution: float) -> tuple[Number, Number, Number, Number]:
    """What vanishes at the base: P_xz - M_x, P_yz - M_y, w, and q_z - M . u_s + D, all of ``at``.

    Momentum (2.9) along x and y; no flow through the base; energy (2.14). M_z = P_zz fixes nu chi T, the
    exclusion factor of (2.10), and there is no condition on nu, which does not flow through the base.
    """
    root_T = at.root_temperature
    slip = _vector(lambda i: -at.velocity[i])
    # M_i = nu chi T m_i
    m = traction(slip, root_T, at.shear, _bumps(at), roughness)
    strength = at.pressure[2][2] / m[2]
    M = _vector(lambda i: strength * m[i])
    loss = strength * root_T * boundary.base_loss(wall_restitution, roughness)
    return (
        at.pressure[0][2] - M[0],
        at.pressure[1][2] - M[1],
        at.velocity[2],
        at.heat_flux[2] - _dot(M, slip) + loss,
    )


def traction(slip: Vector, root_T: Number, grad_u: Tensor, A: Number, roughness: float) -> Vector:
    """M_i/(nu chi T) of (2.10), with the tensors (2.13)."""
    k = boundary.kappa(roughness)
    c = math.sqrt(2.0 / math.pi) / root_T
    second, third = richman_tensors(roughness)

    def component(i: int) -> Number:
        bumps = _sum(
            grad_u[k_][j] * (A * third[i][j][k_] + _UNIT[2][j] * second[i][k_])
            for j in AXES
            for k_ in AXES
            if third[i][j][k_] != 0.0 or _UNIT[2][j] * second[i][k_] != 0.0
        )
        return _UNIT[2][i] + c * (k * slip[i] + bumps)

    return _vector(component)


def richman_tensors(roughness: float) -> tuple[Field, Field]:
    """I_ik and J_ijk of (2.13) for n = (0, 0, 1), with tau_j tau_k + t_j t_k where i is misread in the first."""
    k, lid = boundary.kappa(roughness), math.sqrt(1.0 - roughness**2)
    n = np.array(_UNIT[2])
    plane = np.diag([1.0, 1.0, 0.0])
    second = (k + 2.0 * lid) * np.outer(n, n) + k * plane
    turns = np.einsum("i,jk->ijk", n, plane) + np.einsum("j,ki->ijk", n, plane) + np.einsum("k,ij->ijk", n, plane)
    third = (roughness**2 - 2.0) * np.einsum("i,j,k->ijk", n, n, n) - 0.5 * roughness**2 * turns
    return second, third


def _bumps(at: Motion) -> Number:
    """A(nu) of (2.12), d = d_w."""
    return 1.0 + WALL_CONTACT * (1.0 + 0.625 / (at.density * at.radial))


def _vector(entry: Callable[[int], Any]) -> Any:
    return tuple(entry(i) for i in AXES)


def _sum(terms: Any) -> Number:
    first, *others = terms
    for term in others:
        first = first + term
    return first


def _dot(one: Vector, other: Vector) -> Number:
    return _sum(one[i] * other[i] for i in AXES)
