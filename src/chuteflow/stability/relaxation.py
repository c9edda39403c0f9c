"""Flows that change in time, the same all along the chute: z and t, with the laws and the base of the steady ones.

# notation: m mass above a grain (it stays the same: a grain takes its m along), tau = m/nu, S = p/m,
# G = g1/nu, primes d/dm; M hold-up, s slope; nu' = 1/tau - m tau'/tau^2.

With the mass above for coordinate, mass is conserved by construction, and (2.1)-(2.3) become

    d ln tau/dt = -m w'/tau                          P_zz = m S + (4/3 eta + xi) nu w',   S = G T/tau
    du/dt = P_xz' + s                                P_xz = eta nu u'
    dw/dt = P_zz' - 1                                q = nu (K T' - K* nu')
    (3/2) dT/dt = q' + P_zz w' + P_xz u' - gamma/nu

Stresses and heat flux vanish at m = 0 by themselves, so that the free surface needs no condition (2.16). At the
base w = 0, and traction and heat flux are Richman's (2.9)-(2.15): the traction is affine in u', which is
eliminated, so that both follow from u, w' and T there. A steady flow has S = 1, w = 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import Radau

from chuteflow.analysis.enumeration import flows
from chuteflow.errors import InputError, SolveError
from chuteflow.numerics.chebyshev import Array, grid
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import stretch_map
from chuteflow.steady.flow import Flow
from chuteflow.theory import boundary
from chuteflow.theory.constitutive import WALL_CONTACT, Coefficients
from chuteflow.theory.laws import law
from chuteflow.theory.transport import Grains, Vector, traction

#: Degree of the grid in m, and relative error of the integration in time.
DEGREE, TOLERANCE = 40, 1e-7
FIELDS = 4
#: Share of the mass above the highest node, where fields are those of the far field to rounding.
_SMALLEST = 1e-250
#: Imaginary step of derivatives, far below rounding.
_STEP = 1e-40


@dataclass(frozen=True, eq=False)
class Layer:
    """The moving grains of one chute and hold-up, discretised: Chebyshev nodes in m, denser at the surface.

    A state is the vector (4 (degree + 1),) of ln tau, u, w and ln T at the nodes, from the surface to the base.
    """

    chute: Chute
    mass_holdup: float
    stretch: float
    degree: int = DEGREE

    @classmethod
    def of(cls, flow: Flow, degree: int = DEGREE) -> Layer:
        """The layer that ``flow`` is a steady state of.

        Raises:
            InputError: for the interface, whose conditions know steady flows alone, and for laws that do.
        """
        if flow.chute.surface != "free":
            raise InputError(
                "the interface is known for steady flows alone: time needs the free surface, give --surface free"
            )
        Grains(law(flow.chute.closure), flow.chute.restitution, flow.chute.slope)
        stretch = float(np.log1p(flow.mass_holdup / flow.surface_temperature))
        return cls(flow.chute, flow.mass_holdup, stretch, degree)

    @cached_property
    def mass(self) -> Array:
        """The mass above each node."""
        return self.mass_holdup * stretch_map(grid(self.degree).nodes, self.stretch)[0]

    @cached_property
    def _derivative(self) -> Array:
        rate = stretch_map(grid(self.degree).nodes, self.stretch)[1]
        return grid(self.degree).derivative / (self.mass_holdup * rate)[:, None]

    @cached_property
    def _weights(self) -> Array:
        return grid(self.degree).weights * self.mass_holdup * stretch_map(grid(self.degree).nodes, self.stretch)[1]

    def steady(self, flow: Flow) -> Array:
        """The state that ``flow``, of the same hold-up, is."""
        profile = flow.at_overburden(np.maximum(self.mass / self.mass_holdup, _SMALLEST))
        nu, T = profile.volume_fraction, profile.granular_temperature
        tau = T * self._coefficients(nu).compressibility
        return np.concatenate([np.log(tau), profile.velocity, np.zeros_like(nu), np.log(T)])

    def rate(self, state: Array) -> Array:
        """d state/dt."""
        log_tau, u, w, log_T = state.reshape(FIELDS, -1)
        m, d, chute = self.mass, self._derivative, self.chute
        tau, T, root_T = np.exp(log_tau), np.exp(log_T), np.exp(0.5 * log_T)
        nu = m / tau
        g = self._coefficients(nu)
        u_m, w_m, T_m = d @ u, d @ w, T * (d @ log_T)
        nu_m = (1.0 - m * (d @ log_tau)) / tau
        normal = m * g.compressibility * T / tau + (4.0 / 3.0 * g.viscosity + g.bulk_viscosity) * root_T * nu * w_m
        shear = g.viscosity * root_T * nu * u_m
        heat = nu * root_T * (g.conductivity * T_m - g.density_conductivity * T * nu_m)
        shear[-1:], heat[-1:] = self._at_base(nu[-1:], u[-1:], -(nu * w_m)[-1:], T[-1:], normal[-1:])
        loss = g.dissipation * nu * root_T * T
        out = np.empty((FIELDS, len(m)), dtype=state.dtype)
        out[0] = -m * w_m / tau
        out[1] = d @ shear + chute.slope
        out[2] = d @ normal - 1.0
        out[2, -1] = 0.0
        out[3] = (d @ heat + normal * w_m + shear * u_m - loss) / (1.5 * T)
        return out.ravel()

    def numbers(self, state: Array) -> tuple[float, float, float, float]:
        """Q, h, and T at the surface and at the base."""
        log_tau, u, _, log_T = state.reshape(FIELDS, -1)
        # Int z dm = Int m dz = Int tau dm
        depth = float(self._weights @ np.exp(log_tau)) / self.mass_holdup
        return float(self._weights @ u), depth, float(np.exp(log_T[0])), float(np.exp(log_T[-1]))

    def jacobian(self, state: Array) -> Array:
        """d rate/d state, exact (complex steps): its eigenvalues are growth rates of small disturbances."""
        steps = _STEP * 1j * np.eye(len(state))
        return np.stack([self.rate(state + step).imag for step in steps], axis=-1) / _STEP

    def _coefficients(self, nu: Array) -> Coefficients:
        chosen = law(self.chute.closure)
        room = 1.0 - nu / chosen.densest
        return chosen.coefficients(nu, room, self.chute.restitution, self.chute.slope)

    def _at_base(self, nu: Array, u: Array, w_z: Array, T: Array, normal: Array) -> tuple[Array, Array]:
        """P_xz and q at the base."""
        chute, root_T = self.chute, np.sqrt(T)
        g = self._coefficients(nu)
        bumps = 1.0 + WALL_CONTACT * (1.0 + 0.625 / (nu * g.radial))

        def touched(u_z: float) -> Vector:
            grad_u = ((0.0, 0.0, u_z), (0.0, 0.0, 0.0), (0.0, 0.0, w_z))
            return traction((-u, 0.0, 0.0), root_T, grad_u, bumps, chute.roughness)

        along, _, up = touched(0.0)
        strength = normal / up
        pull = strength * (touched(1.0)[0] - along)  # dM_x/du_z
        viscosity = g.viscosity * root_T
        u_z = -strength * along / (viscosity + pull)
        shear = -viscosity * u_z
        loss = strength * root_T * boundary.base_loss(chute.wall_restitution, chute.roughness)
        return shear, -shear * u - loss


@dataclass(frozen=True, eq=False)
class Moment:
    """A state on the way, with its time, Q, h, and T at the surface and at the base."""

    time: float
    mass_flux: float
    centre_of_mass: float
    surface_temperature: float
    base_temperature: float
    state: Array


@dataclass(frozen=True, eq=False)
class Outcome:
    """Which steady flow of the same hold-up a moving one has come to.

    ``distance`` is the largest relative difference in Q, h and T at the base from the nearest of ``steady``, and
    ``nearest`` its index; ``rate`` is that at which the logarithm of the distance changed in the last fifth of the
    time: negative where the flow approaches.
    """

    steady: tuple[Flow, ...]
    nearest: int | None
    distance: float
    rate: float


def relax(layer: Layer, state: Array, duration: float, tolerance: float = TOLERANCE) -> Iterator[Moment]:
    """The states from ``state`` on for ``duration``, as the integration comes by them; the first is ``state`` itself.

    The integration is implicit, of order 5 (Radau), with the exact Jacobian.

    Args:
        layer: the moving grains.
        state: where they start.
        duration: time, in sqrt(d/(g cos theta)).
        tolerance: relative error of each step in tau, u, w and T.

    Raises:
        SolveError: where the integration cannot go on.
    """
    stepper = Radau(
        lambda _, y: layer.rate(y),
        0.0,
        state,
        duration,
        jac=lambda _, y: layer.jacobian(y),
        rtol=tolerance,
        atol=1e-2 * tolerance,
    )
    yield Moment(0.0, *layer.numbers(state), state)
    while stepper.status == "running":
        with np.errstate(all="ignore"):
            message = stepper.step()
        if stepper.status == "failed" or not np.isfinite(stepper.y).all():
            why = f" ({message})" if message else ""
            raise SolveError(f"the flow cannot be followed beyond t = {stepper.t:.6g}{why}: disturb it less")
        yield Moment(float(stepper.t), *layer.numbers(stepper.y), stepper.y.copy())


def outcome(layer: Layer, moments: Sequence[Moment]) -> Outcome:
    """Which steady flow the last of ``moments`` is nearest to, and whether it approaches."""
    steady = tuple(flows(layer.chute, M=layer.mass_holdup))
    last = moments[-1]
    if not steady:
        return Outcome(steady, None, float("inf"), 0.0)
    distances = [_distance(last, flow) for flow in steady]
    nearest = int(np.argmin(distances))
    before = next(moment for moment in moments if moment.time >= 0.8 * last.time)
    earlier, passed = _distance(before, steady[nearest]), last.time - before.time
    moved = earlier > 0.0 and distances[nearest] > 0.0 and passed > 0.0
    rate = np.log(distances[nearest] / earlier) / passed if moved else 0.0
    return Outcome(steady, nearest, distances[nearest], float(rate))


def _distance(moment: Moment, flow: Flow) -> float:
    names = ("mass_flux", "centre_of_mass", "base_temperature")
    return max(abs(getattr(moment, name) / getattr(flow, name) - 1.0) for name in names)


def disturbed(layer: Layer, state: Array, temperature: float = 1.0, velocity: float = 1.0) -> Array:
    """``state`` with its granular temperature and its velocity multiplied, and its density as it is.

    Raises:
        InputError: for factors that are not positive, or above 1000.
    """
    for name, factor in (("temperature", temperature), ("velocity", velocity)):
        if not 0.0 < factor <= 1000.0:
            raise InputError(f"{name} times {factor:g}: the factor must be above 0 and at most 1000")
    out = state.reshape(FIELDS, -1).copy()
    out[1] *= velocity
    out[3] += np.log(temperature)
    return out.ravel()
