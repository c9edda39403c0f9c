"""The linear operator of small disturbances exp(sigma t + i (kx x + ky y)) of a steady flow.

# notation: n = nu'/nu, (u, v, w), tau = T'/T disturbances, k = |(kx, ky)|, eta and K at the top of the grid.

The equations of :mod:`chuteflow.theory.transport` are evaluated with numbers that carry first-order
coefficients, with d/dx = i kx and d/dy = i ky on the coefficients. They are quadratic in (kx, ky), so that six
evaluations give the operator for all of them.

Above the grid the density is negligible, and what is left are the viscous stresses and the heat flux of a gas
of uniform viscosity and conductivity: (grad^2) u + grad(div u)/3 = 0 and (grad^2) tau = 0. Their solutions that
decay like exp(-k z) are, with D = i kx u + i ky v - k w at the top,

    u' = -k u + i kx D/(7 k),   v' = -k v + i ky D/(7 k),   w' = -k w - D/7,   tau' = -k tau

and their stresses and heat flux are the conditions at the top of the grid. To these stresses comes the weight
of the grains above, p (1 + omega) at the top: with omega for an unknown no mass is lost through the top. At
k = 0 all this says that stresses and heat flux vanish far above, (2.16).

A density at all nodes has one degree too many for the velocity: one combination would exert no force, and be a
false mode at rest. It is left without its value at the top, where it follows from the others; omega takes the
place of that value among the unknowns.

Where pieces of the grid meet, at a break of the law, velocity, temperature, stresses and heat flux are continuous: all
coefficients of the law are, and so are the derivatives of the steady velocity, temperature, stresses and heat flux,
so that it does not matter where the disturbed flow passes the break. The density of each piece is left without its
first value as above.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.eigenproblem import Complex
from chuteflow.numerics.first_order import FirstOrder, variables
from chuteflow.stability.base import BaseState
from chuteflow.steady.chute import Chute
from chuteflow.theory import bases
from chuteflow.theory.constitutive import Coefficients, Law
from chuteflow.theory.transport import Fields, Material, Motion, Vector, base_conditions, motion

#: Order of the unknowns n, u, v, w, tau, each at all nodes from the top to the base, with omega for the first n.
DENSITY, ALONG, ACROSS, UP, HEAT = range(5)
FIELDS = 5

#: Wavenumbers at which the quadratic operator is evaluated, and their monomials 1, kx, ky, kx^2, kx ky, ky^2.
_SAMPLES = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1]], dtype=float)
#: Step, in fractions of k, of the derivatives of the gas above the grid: smooth, and small beside the rest.
_DIFFERENCE = 1e-5


def _monomials(kx: Any, ky: Any) -> NDArray[Any]:
    return np.array([1.0 + 0.0 * kx, kx, ky, kx * kx, kx * ky, ky * ky])


@dataclass(frozen=True, eq=False)
class Operator:
    """Matrices of the disturbances of ``base``: A v = sigma diag(weights) v, 5 (degree + 1) unknowns."""

    base: BaseState
    powers: Complex
    weights: Array
    top: tuple[float, float]

    @property
    def points(self) -> int:
        """Number of nodes."""
        return self.base.points

    def matrix(self, kx: float, ky: float) -> Complex:
        """A at wavenumbers along and across the slope."""
        matrix = np.tensordot(_monomials(kx, ky), self.powers, axes=1)
        self._add_half_space(matrix, kx, ky)
        return matrix

    def slopes(self, left: Complex, right: Complex, kx: float, ky: float) -> Complex:
        """d/dkx and d/dky, (2,), of left* A right."""
        parts = (self.powers @ right) @ left.conj()
        step = _DIFFERENCE * float(np.hypot(kx, ky))
        out = np.array([[0.0, 1.0, 0.0, 2.0 * kx, ky, 0.0], [0.0, 0.0, 1.0, 0.0, kx, 2.0 * ky]]) @ parts
        for i, (x, y) in enumerate(((step, 0.0), (0.0, step))):
            change = np.zeros(self.powers.shape[1:], dtype=complex)
            self._add_half_space(change, kx - x, ky - y)
            change *= -1.0
            self._add_half_space(change, kx + x, ky + y)
            out[i] += left.conj() @ (change @ right) / (2.0 * step)
        return out

    def _add_half_space(self, matrix: Complex, kx: float, ky: float) -> None:
        """Stresses and heat flux of the gas above the grid, taken off those of the grid at its top."""
        viscosity, conduction = self.top
        k = float(np.hypot(kx, ky))
        if k == 0.0:
            return
        n = self.points
        u, v, w, heat = (field * n for field in (ALONG, ACROSS, UP, HEAT))
        D = np.array([1j * kx, 1j * ky, -k])
        slopes = -k * np.eye(3) + np.outer(np.array([1j * kx, 1j * ky, -k]) / (7.0 * k), D)
        across = np.array([1j * kx, 1j * ky])
        columns = [u, v, w]
        # P_iz = -eta (u_i' + i k_i w), P_zz = -(4/3) eta w' + (2/3) eta (i kx u + i ky v)
        for i, row in enumerate((u, v)):
            matrix[row, columns] += viscosity * slopes[i]
            matrix[row, w] += viscosity * across[i]
        matrix[w, columns] += viscosity * (4.0 / 3.0) * slopes[2]
        matrix[w, [u, v]] -= viscosity * (2.0 / 3.0) * across
        matrix[heat, heat] -= conduction * k

    @cached_property
    def height(self) -> Array:
        """Heights of the nodes."""
        return self.base.profile.height


def steady_motion(base: BaseState) -> Motion:
    """The full equations on the steady flow itself: forces vanish (tested), with plain fields."""

    def gradient(f: Any) -> Vector:
        return (0.0 * f, 0.0 * f, base.derivative @ f)

    return motion(_steady(base), gradient, grains(base.flow.chute, base.flow.law))


def grains(chute: Chute, law: Law) -> Material:
    """The grains of disturbed flows on ``chute``, with its ``law``.

    Raises:
        InputError: for a law that is known for steady flows alone, and for the interface condition.
    """
    if chute.surface != "free":
        raise InputError(
            f"stability with the surface {chute.surface!r}: its conditions are known for a steady, level interface "
            "alone, and say nothing of one that is tilted, moves or takes up grains: use the free surface"
        )
    return Material(law, chute.restitution, chute.slope)


def operator(base: BaseState) -> Operator:
    """The operator of the disturbances of ``base``.

    Raises:
        InputError: where the problem cannot be posed, see :func:`grains`.
    """
    parts, weights = zip(*(_linearise(base, kx, ky) for kx, ky in _SAMPLES), strict=True)
    fit = np.linalg.inv(_monomials(*_SAMPLES.T).T)
    powers: Complex = np.tensordot(np.round(fit, 12).astype(complex), np.array(parts), axes=1)
    flux = base.profile.granular_temperature[0] * _conductivity(base)
    return Operator(base, powers, weights[0], (_viscosity(base), flux))


def _steady(base: BaseState) -> Fields:
    profile = base.profile
    still = np.zeros(base.points)
    return Fields(
        np.log(profile.volume_fraction), (profile.velocity, still, still), np.log(profile.granular_temperature)
    )


def _linearise(base: BaseState, kx: float, ky: float) -> tuple[Complex, Array]:
    """A without the gas above the grid, and the weights of the time derivatives."""
    steady = _steady(base)
    values = np.array([steady.log_density, *steady.velocity, steady.log_temperature])
    numbers = variables(values)
    numbers[DENSITY] = FirstOrder(values[DENSITY], without_top(base) @ numbers[DENSITY].slope)

    def gradient(f: FirstOrder) -> Vector:
        along, across = (FirstOrder(np.zeros_like(f.value), 1j * k * f.slope) for k in (kx, ky))
        return along, across, FirstOrder(base.derivative @ f.value, base.derivative @ f.slope)

    fields = Fields(numbers[DENSITY], (numbers[ALONG], numbers[ACROSS], numbers[UP]), numbers[HEAT])
    moving = motion(fields, gradient, grains(base.flow.chute, base.flow.law))
    matrix = np.concatenate([force.slope for force in moving.forces]).astype(complex)
    weights = np.concatenate([np.ones(base.points), *(inertia.value for inertia in moving.inertia[1:])])
    chute = base.flow.chute
    floor = base_conditions(moving, bases.base(chute.base), chute.roughness, chute.wall_restitution)
    P, q = moving.pressure, moving.heat_flux
    ceiling = (P[0][2], P[1][2], P[2][2], q[2])
    for field, below, above in zip((ALONG, ACROSS, UP, HEAT), floor, ceiling, strict=True):
        first, last = field * base.points, (field + 1) * base.points - 1
        matrix[first], matrix[last] = above.slope[0], below.slope[-1]
        weights[[first, last]] = 0.0
    _add_load(base, matrix, kx, ky)
    _join_pieces(base, matrix, weights, ceiling)
    return matrix, weights


def without_top(base: BaseState) -> Array:
    """Matrix that puts for the first nodal value of each piece what the polynomial through its others has there."""
    matrix = np.eye(base.points)
    for piece, nodes in zip(base.grid.pieces, base.grid.nodes_of_pieces, strict=True):
        first = nodes.start
        matrix[first, nodes] = -piece.barycentric / piece.barycentric[0]
        matrix[first, first] = 0.0
    return matrix


def _join_pieces(base: BaseState, matrix: Complex, weights: Array, fluxes: tuple[FirstOrder, ...]) -> None:
    """Continuous velocity, temperature, stresses and heat flux where pieces of the grid meet; ``fluxes`` are those of
    ALONG, ACROSS, UP and HEAT."""
    for right in base.grid.firsts[1:].tolist():
        for field, flux in zip((ALONG, ACROSS, UP, HEAT), fluxes, strict=True):
            above, below = field * base.points + right - 1, field * base.points + right
            matrix[above] = flux.slope[right - 1] - flux.slope[right]
            matrix[below] = 0.0
            matrix[below, [above, below]] = -1.0, 1.0
            weights[[above, below]] = 0.0
        # The first value of a density follows from the others, and is none of the unknowns.
        matrix[right] = 0.0
        matrix[right, right] = 1.0
        weights[right] = 0.0


def _add_load(base: BaseState, matrix: Complex, kx: float, ky: float) -> None:
    """The weight of the grains above the grid, and their balance of mass in the first row."""
    profile = base.profile
    u, v, w = (field * base.points for field in (ALONG, ACROSS, UP))
    load = profile.normal_stress[0]
    matrix[w, 0] = -load
    matrix[u, 0] = base.flow.chute.slope * load
    matrix[0] = 0.0
    matrix[0, [0, u, v, w]] = (
        -1j * kx * profile.velocity[0],
        -1j * kx,
        -1j * ky,
        profile.volume_fraction[0] / load,
    )


def _viscosity(base: BaseState) -> float:
    """eta at the top."""
    g, root_t = _at_top(base)
    return float(g.viscosity[0]) * root_t


def _conductivity(base: BaseState) -> float:
    """K at the top."""
    g, root_t = _at_top(base)
    return float(g.conductivity[0]) * root_t


def _at_top(base: BaseState) -> tuple[Coefficients, float]:
    """The coefficients of the law, and sqrt(T), at the top."""
    chute, law = base.flow.chute, base.flow.law
    nu = base.profile.volume_fraction[:1]
    g = law.of_density(nu, chute.restitution, chute.slope)
    return g, float(np.sqrt(base.profile.granular_temperature[0]))
