"""Flows that change in time, the same all along the chute: z and t, with the laws and the base of the steady ones.

# notation: m mass above a grain (it stays the same: a grain takes its m along), tau = m/nu, S = p/m,
# G = g1/nu, primes d/dm; M hold-up, s slope; nu' = 1/tau - m tau'/tau^2.

With the mass above for coordinate, d/dz = -nu d/dm, and no grain crosses a node: mass is conserved by
construction. (2.1)-(2.3) become

    d ln tau/dt = -m w'/tau                          P_zz = m S + (4/3 eta + xi) nu w',   S = G T/tau
    du/dt = P_xz' + s                                P_xz = eta nu u'
    dw/dt = P_zz' - 1                                q = nu (K T' - K* nu')
    (3/2) dT/dt = q' + P_zz w' + P_xz u' - gamma/nu

Stresses and heat flux vanish at m = 0 by themselves, so that the free surface needs no condition (2.16). At the
base w = 0, and traction and heat flux are those of the base, (2.9)-(2.15): the traction is affine in u', which is
eliminated, so that both follow from u, w' and T there. They enter as the boundary terms of the weak form: on
Lobatto's nodes, where sums integrate by parts exactly, the energy balance holds then for the discrete equations.
A steady flow has S = 1, w = 0.

Where the steady flow passes breaks of its law, pieces of the grid meet: the weak form sums over both. A flow that moves
passes them elsewhere, but comes back to there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.complex_step import derivative, stepped
from chuteflow.numerics.legendre import LobattoPieces, lobatto_pieces
from chuteflow.steady import kinks
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import stretch_map, stretch_position
from chuteflow.steady.flow import Flow
from chuteflow.theory import bases
from chuteflow.theory.constitutive import Coefficients, Law
from chuteflow.theory.transport import AtBase, Material

#: Degree of the grid in m.
DEGREE = 40
FIELDS = 4
#: Degree of a piece of the grid: at least, and so much more than its part of the whole. It is not shorter than the
#: third number.
_LEAST, _MORE, _SHORTEST = 12, 4, 1e-4
#: The law at a node where pieces meet is that at densities smaller and larger by this part.
_BESIDE = 1e-9
#: Fraction of the mass above the highest node, where fields are those of the far field to rounding.
_SMALLEST = 1e-250
#: Densities far above the base fall off to zero.
_vanishing = np.errstate(under="ignore")


@dataclass(frozen=True)
class Energy:
    """Energies of a state per unit area of the base, in rho_p g d^2 cos theta."""

    kinetic: float
    thermal: float
    potential: float

    @property
    def total(self) -> float:
        """All of it."""
        return self.kinetic + self.thermal + self.potential


@dataclass(frozen=True)
class Power:
    """Rates of energy per unit area of the base, in rho_p (g d cos theta)^(3/2).

    ``gravity`` is s Q, its work along the slope; ``collisions`` of the grains with each other and with the
    ``base`` lose energy. Without heat through the surface the total energy changes with what is left.
    """

    gravity: float
    collisions: float
    base: float

    @property
    def net(self) -> float:
        """What is left for the energy of the flow."""
        return self.gravity - self.collisions - self.base


@dataclass(frozen=True, eq=False)
class _Forces:
    """tau, stresses, heat flux, loss and derivatives at the nodes of the pieces; those of the base apart."""

    tau: Array

    normal: Array
    shear: Array
    heat: Array
    loss: Array
    u_m: Array
    w_m: Array
    base_shear: Array
    base_heat: Array
    base_loss: Array


@dataclass(frozen=True, eq=False)
class Layer:
    """The moving grains of one chute and hold-up, discretised: Lobatto's nodes in m, denser at the surface.

    A state is the vector (4 points,) of ln tau, u, w and ln T at the nodes, from the surface to the base. The grid has
    one more of these than its ``degree``, or somewhat more where it is in pieces, which meet at ``breaks`` (places
    between 0 and 1), the density rising through them or not (1 or -1 each, ``sides``).
    Two of its values do not move: tau at m = 0, where there is no mass whose motion could change it, and w at
    the base.
    """

    chute: Chute
    law: Law
    mass_holdup: float
    stretch: float
    degree: int = DEGREE
    breaks: tuple[float, ...] = ()
    sides: tuple[int, ...] = ()

    @classmethod
    def of(cls, flow: Flow, degree: int = DEGREE) -> Layer:
        """The layer that ``flow`` is a steady state of.

        Raises:
            InputError: for the interface, whose conditions know steady flows alone, and for laws that do.
        """
        if flow.chute.surface != "free":
            raise InputError(
                "the interface is known only for steady flows: time dependence needs the free surface, give "
                "--surface free"
            )
        Material(flow.law, flow.chute.restitution, flow.chute.slope)
        stretch = float(np.log1p(flow.mass_holdup / flow.surface_temperature))
        return cls(flow.chute, flow.law, flow.mass_holdup, stretch, degree, *_breaks(flow, stretch))

    @cached_property
    def _grid(self) -> LobattoPieces:
        ends = (0.0, *self.breaks, 1.0)
        if not self.breaks:
            return lobatto_pieces(ends, (self.degree,))
        return lobatto_pieces(ends, tuple(max(_LEAST, round(self.degree * w) + _MORE) for w in np.diff(ends).tolist()))

    @property
    def points(self) -> int:
        """Number of nodes."""
        return len(self._grid.nodes)

    @cached_property
    def _beside(self) -> Array:
        """Factors of the density at the nodes of the pieces, for the law that holds there."""
        factors = np.ones(len(self._grid.at))
        joints, sides = self._grid.joints, np.array(self.sides, dtype=float)
        factors[joints] -= _BESIDE * sides
        factors[joints + 1] += _BESIDE * sides
        return factors

    @cached_property
    def mass(self) -> Array:
        """The mass above each node."""
        return self.mass_holdup * stretch_map(self._grid.nodes, self.stretch)[0]

    @cached_property
    def weights(self) -> Array:
        """The mass that each node stands for."""
        return self._grid.gathered(self._weights)

    @cached_property
    def _weights(self) -> Array:
        """The mass that each node of the pieces stands for."""
        return self._grid.weights * self.mass_holdup * stretch_map(self._grid.places, self.stretch)[1]

    @cached_property
    def _derivative(self) -> Array:
        rate = stretch_map(self._grid.places, self.stretch)[1]
        return self._grid.derivative / (self.mass_holdup * rate)[:, None]

    @_vanishing
    def steady(self, flow: Flow) -> Array:
        """The state that ``flow``, of the same hold-up, is."""
        profile = flow.at_overburden(np.maximum(self.mass / self.mass_holdup, _SMALLEST))
        nu, T = profile.volume_fraction, profile.granular_temperature
        tau = T * self._coefficients(nu).compressibility
        return np.concatenate([np.log(tau), profile.velocity, np.zeros_like(nu), np.log(T)])

    @_vanishing
    def rate(self, state: Array) -> Array:
        """d state/dt; ``state`` may be many (..., 4 points)."""
        log_T = self._fields(state)[3]
        f, end = self._forces(state), 1.0 / self.weights[-1]
        fields = np.empty((*state.shape[:-1], FIELDS, self.points), dtype=state.dtype)
        fields[..., 0, :] = self._mean(-self.mass[self._grid.at] * f.w_m / f.tau)
        fields[..., 1, :] = self._divergence(f.shear) + self.chute.slope
        fields[..., 1, -1] += end * (f.base_shear - f.shear[..., -1])
        fields[..., 2, :] = self._divergence(f.normal) - 1.0
        fields[..., 2, -1] = 0.0
        heating = self._divergence(f.heat) + self._mean(f.normal * f.w_m + f.shear * f.u_m - f.loss)
        heating[..., -1] += end * (f.base_heat - f.heat[..., -1])
        fields[..., 3, :] = heating / (1.5 * np.exp(log_T))
        return fields.reshape(state.shape)

    @_vanishing
    def jacobian(self, state: Array) -> Array:
        """d rate/d state, exact (complex steps)."""
        return derivative(self.rate(stepped(state, np.eye(len(state))))).T

    def growth_rates(self, state: Array) -> NDArray[np.complex128]:
        """Growth rates of small disturbances of a steady ``state``, fastest growing first; the mass is given.

        Those of the continuous spectrum, on the negative real axis and at its end 0, move with the degree.
        """
        moving = np.ones(len(state), dtype=bool)
        moving[[0, 3 * self.points - 1]] = False
        values = np.linalg.eigvals(self.jacobian(state)[np.ix_(moving, moving)]).astype(complex)
        return values[np.argsort(-np.real(values))]

    @_vanishing
    def base_density(self, state: Array) -> float:
        """nu at the base over that of the densest packing."""
        return float(self.mass_holdup * np.exp(-self._fields(state)[0][-1]) / self.law.densest)

    @_vanishing
    def numbers(self, state: Array) -> tuple[float, float, float, float]:
        """Q, h, and T at the surface and at the base."""
        log_tau, u, _, log_T = self._fields(state)
        # Int z dm = Int m dz = Int tau dm
        depth = float(self.weights @ np.exp(log_tau)) / self.mass_holdup
        return float(self.weights @ u), depth, float(np.exp(log_T[0])), float(np.exp(log_T[-1]))

    def energy(self, state: Array) -> Energy:
        """Where the energy of a state is."""
        log_tau, u, w, log_T = self._fields(state)
        kinetic, thermal, potential = (
            self.weights @ density for density in (0.5 * (u**2 + w**2), 1.5 * np.exp(log_T), np.exp(log_tau))
        )
        return Energy(float(kinetic), float(thermal), float(potential))

    def power(self, state: Array) -> Power:
        """What changes the energy of a state."""
        f = self._forces(state)
        return Power(
            gravity=self.chute.slope * self.numbers(state)[0],
            collisions=float(self._weights @ f.loss),
            base=float(f.base_loss),
        )

    def _fields(self, state: Array) -> tuple[Array, ...]:
        """ln tau, u, w and ln T at the nodes."""
        return tuple(np.moveaxis(state.reshape(*state.shape[:-1], FIELDS, -1), -2, 0))

    def _slope(self, values: Array) -> Array:
        """d values/dm at the nodes of the pieces, of values there."""
        return values @ self._derivative.T

    def _mean(self, values: Array) -> Array:
        """The mean at the nodes, by mass, of values at those of the pieces."""
        return self._grid.gathered(values * self._weights) / self.weights if self.breaks else values

    def _divergence(self, flux: Array) -> Array:
        """d flux/dm at the nodes, of a flux at those of the pieces: with what it jumps by where they meet."""
        out = self._mean(self._slope(flux))
        joints = self._grid.joints
        at = self._grid.at[joints]
        out[..., at] += (flux[..., joints + 1] - flux[..., joints]) / self.weights[at]
        return out

    def _forces(self, state: Array) -> _Forces:
        log_tau, u, w, log_T = (field[..., self._grid.at] for field in self._fields(state))
        m = self.mass[self._grid.at]
        tau, T, root_T = np.exp(log_tau), np.exp(log_T), np.exp(0.5 * log_T)
        nu = m / tau * self._beside
        u_m, w_m, T_m = self._slope(u), self._slope(w), T * self._slope(log_T)
        # sqrt(2 D : D)/(nu sqrt(T)), with d/dz = -nu d/dm
        rate = np.sqrt(u_m**2 + 4.0 / 3.0 * w_m**2) / root_T
        g = self._coefficients(nu, rate)
        nu_m = (1.0 - m * self._slope(log_tau)) / tau
        normal = m * g.compressibility * T / tau + (4.0 / 3.0 * g.viscosity + g.bulk_viscosity) * root_T * nu * w_m
        base = self._at_base(nu[..., -1], u[..., -1], -(nu * w_m)[..., -1], T[..., -1], normal[..., -1])
        return _Forces(
            tau=tau,
            normal=normal,
            shear=g.viscosity * root_T * nu * u_m,
            heat=nu * root_T * (g.conductivity * T_m - g.density_conductivity * T * nu_m),
            loss=g.dissipation * nu * root_T * T,
            u_m=u_m,
            w_m=w_m,
            base_shear=base[0],
            base_heat=base[1],
            base_loss=base[2],
        )

    def _coefficients(self, nu: Array, rate: Array | None = None) -> Coefficients:
        """The coefficients of the law where the shear rate over nu sqrt(T) is ``rate``; without one, those that do
        not depend on it."""
        return self.law.of_density(nu, self.chute.restitution, self.chute.slope, rate)

    def _at_base(self, nu: Array, u: Array, w_z: Array, T: Array, normal: Array) -> tuple[Array, Array, Array]:
        """P_xz and q at the base, and the energy lost to it, (2.9)-(2.15)."""
        chute, root_T = self.chute, np.sqrt(T)
        g, on = self._coefficients(nu), bases.base(chute.base)

        def exchange(u_z: float) -> tuple[Array, Array]:
            """M_x and the loss."""
            grad_u = ((0.0, 0.0, u_z), (0.0, 0.0, 0.0), (0.0, 0.0, w_z))
            at = AtBase(nu, g.radial, (u, 0.0, 0.0), root_T, grad_u, normal)
            (along, _, _), loss = on.exchange(at, chute.roughness, chute.wall_restitution)
            return along, loss

        along, loss = exchange(0.0)
        pull = exchange(1.0)[0] - along  # dM_x/du_z
        viscosity = g.viscosity * root_T
        shear = viscosity * along / (viscosity + pull)
        return shear, -shear * u - loss, loss


def _breaks(flow: Flow, stretch: float) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Where a flow passes breaks of its law at which the coefficients are continuous, on a grid of ``stretch``, and
    whether its density rises downwards there (1) or falls (-1)."""
    elements = flow.solution.elements
    if not elements.model.kinks.size or not elements.model.kinks_join:
        return (), ()
    share, _ = stretch_map(kinks.crossings(elements), elements.stretch)
    places = stretch_position(share, stretch)
    apart = (np.diff(places, prepend=0.0) > _SHORTEST) & (1.0 - places > _SHORTEST)
    if not apart.any():
        return (), ()
    above, below = (flow.at_overburden(share[apart] * side).volume_fraction for side in (1.0 - 1e-4, 1.0 + 1e-4))
    return tuple(places[apart].tolist()), tuple(np.where(below > above, 1, -1).tolist())
