"""The paper's own discretisation of the steady problem (section 3.4), beside the one in the overburden coordinate.

# notation: zeta computational coordinate, X = sqrt(nu), Y = sqrt(T), N degree, k multiple of (3.30), S scale,
# x = X sqrt(S), y = Y/sqrt(S), ' = d/dzeta, G = g1/nu, s slope, Q mass flux, otherwise as in the paper.

On the half-line zeta = exp(-z/L) with L = 2 k T_inf, so that X ~ zeta^k and Y - Y(0) ~ zeta^(2k) are analytic at
zeta = 0 (3.29); with the interface conditions of section 3.7, zeta = 1 - z/H. Both have the base at zeta = 1 and

    d/dz = -(omega/(kappa S)) d/dzeta,    omega = zeta, kappa = 2k, S = T_inf    on the half-line,
                                          omega = 1,    kappa = 1,  S = H        below an interface.

X and Y are Chebyshev series in 2 zeta - 1 (3.28). The unknowns are those of x and y, ln S and ln Q: S then
enters through nu = x^2/S and, in the quadratures, as a factor, and hot flows are no harder than others. With
the heat flux q = omega sqrt(S) phi, phi = (2/kappa)(g3 y^2 y' - g4 y^3 x x'/S), the equations are

    (2/kappa) omega (dg1/dnu y^2 x' + G x y y') = x                   (3.8), divided by X
    (omega phi)'/kappa = x^4 y^3 (g5 - g1^2 s^2/g2)/(nu^2 omega)      (3.9)

at the N zeros of T_N(2 zeta - 1). The heat flux is interpolated through these nodes and both ends, and the
interpolant differentiated, so that no second derivative of a closure is needed.

What is unknown, and what determines it:

- half-line: N+1 coefficients each of x and y, ln S and ln Q: 2N+4 unknowns. Equations: 2N at the nodes, the base
  condition (3.17), L = 2 k T_inf in the form y(0) = 1, and the integral constraint (3.26): 2N+3. Nothing else is
  asked for in the far field. zeta = 0 is a singular point, where (3.8) itself reads X = 0, and a heat flux that
  does not vanish would make T^(3/2) grow like ln zeta, as no polynomial does: (3.19) is met by being representable.
  (X(0) = 0 in place of y(0) = 1 would do as well. Where T is uniform the residual of (3.8) is a multiple of T_N,
  which vanishes if X does at 0, and then zeta^k is its solution: L = 2 k T_inf.)
- interface: zeta = 0 is a regular point, and (3.9), of second order, needs one condition more, so y has N+2
  coefficients: 2N+5 unknowns. Equations: 2N at the nodes, (3.17), the normal stress (3.31) and the heat flux
  (3.32) at zeta = 0, and (3.26): 2N+4.

One equation is missing on purpose: flows form branches. A condition on Q, h, M or T singles out a flow; without
one the system is ready for continuation, through folds of Q.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import cast

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from chuteflow.checks import real_array
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array, grid
from chuteflow.numerics.complex_step import STEP, derivative, stepped
from chuteflow.numerics.newton import newton
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T
from chuteflow.steady.flow import Flow, Profile
from chuteflow.steady.kinds import density_kind
from chuteflow.steady.solver import TOLERANCE, Condition, SolverStatus, check_tolerance
from chuteflow.theory import boundary
from chuteflow.theory.bases import require_richman
from chuteflow.theory.constitutive import WALL_CONTACT, Field

#: Most coefficients that :func:`refine` takes, less one.
LARGEST_DEGREE = 400
#: Degrees among which a system chooses along a curve.
DEGREES = (16, 24, 36, 54, 80, 120, 180, 270, LARGEST_DEGREE)
#: Decay of the coefficients between which a degree is kept along a curve.
_RESOLVED, _WASTED = 1e-10, 1e-15
#: The multiple k is kept along a curve while h/T_inf is within this factor of it.
_MULTIPLE_OFF = 2.0
#: Least relative error ever claimed.
_FLOOR = 1e-12
#: The degree that checks another is larger by this factor.
_CHECK = 1.25
#: The error is so many times the change on a larger degree and the last coefficients together: in 900 flows that
#: were resolved at all, by few coefficients and many, it was at most 0.7 of that.
_SAFETY = 3.0
#: With a larger residual between the nodes, a solution of the discrete equations is none of the equations.
_SPURIOUS = 0.3
#: Where X is below this fraction of its largest value, it falls with height: there a rise would be an error.
_THIN = 0.05
#: X may dip below zero in the far field by so much of its largest value.
_DIP = 1e-3


@dataclass(frozen=True, eq=False)
class Sampling:
    """Where the equations of degree N are sampled: zeta = 0, the N zeros of T_N(2 zeta - 1), and zeta = 1.

    ``points`` (N+2,); ``basis`` and ``basis_slope`` (N+2, N+2), T_n(2 zeta - 1) and its derivative in column n;
    ``differentiate`` (N, N+2), values at all points to derivatives at the nodes; ``accumulate`` (N, N), values at
    the nodes to integrals from 0 to the nodes; ``weights`` (N,) of the integral from 0 to 1; ``to_coefficients``
    (N, N), values at the nodes to the coefficients of their interpolant.
    """

    points: Array
    basis: Array
    basis_slope: Array
    differentiate: Array
    accumulate: Array
    weights: Array
    to_coefficients: Array


@lru_cache(maxsize=32)
def sampling(degree: int) -> Sampling:
    """The sampling of ``degree`` N."""
    n = degree
    angle = np.concatenate([[0.0], (2.0 * np.arange(n) + 1.0) * np.pi / (2 * n), [np.pi]])
    t = -np.cos(angle)
    basis = chebyshev.chebvander(t, n + 1)
    slope = 2.0 * chebyshev.chebvander(t, n) @ chebyshev.chebder(np.eye(n + 2))
    # zeta_i - zeta_j = sin((a_i + a_j)/2) sin((a_i - a_j)/2), without cancellation.
    gap = np.sin(0.5 * (angle[:, None] + angle)) * np.sin(0.5 * (angle[:, None] - angle))
    np.fill_diagonal(gap, 1.0)
    log_weight = -np.log(np.abs(gap)).sum(axis=1)
    barycentric = np.prod(np.sign(gap), axis=1) * np.exp(log_weight - log_weight.max())
    derivative = barycentric / barycentric[:, None] / gap
    np.fill_diagonal(derivative, 0.0)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    inner = basis[1:-1]
    to_coefficients = 2.0 / n * inner[:, :n].T
    to_coefficients[0] *= 0.5
    integrals = 0.5 * chebyshev.chebint(np.eye(n), lbnd=-1) @ to_coefficients
    arrays = {
        "points": np.sin(0.5 * angle) ** 2,
        "basis": basis,
        "basis_slope": slope,
        "differentiate": derivative[1:-1],
        "accumulate": inner[:, : n + 1] @ integrals,
        "weights": integrals.sum(axis=0),  # T_n(1) = 1
        "to_coefficients": to_coefficients,
    }
    for array in arrays.values():
        array.setflags(write=False)
    return Sampling(**arrays)


@dataclass(frozen=True, eq=False)
class PointValues:
    """Functions of the fields at single points, arrays of one shape, with the scale S taken out.

    ``nu`` volume fraction; ``momentum`` residual of (3.8); ``flux`` phi, and ``conduction`` its part along the
    temperature gradient; ``heating`` right-hand side of (3.9) times omega; ``stress`` p; ``base`` residual of (3.17);
    ``surface`` residuals of the conditions at zeta = 0; ``mass`` x^2; ``scaled_shear_rate`` s (g1/g2) x^2 y/nu, with
    du/dz = scaled_shear_rate/S^(1/2); ``slip`` F1 y; ``dissipation`` g5/nu^2.
    """

    nu: Field
    momentum: Field
    flux: Field
    conduction: Field
    heating: Field
    stress: Field
    base: Field
    surface: tuple[Field, ...]
    mass: Field
    scaled_shear_rate: Field
    slip: Field
    dissipation: Field


@dataclass(frozen=True, eq=False)
class MappedSystem:
    """The steady problem of ``chute`` with Chebyshev series of ``degree`` N on the mapped domain.

    ``multiple`` is k of L = 2 k T_inf (3.30), and 1 below an interface. Unknowns z (n+1,):
    coefficients of x and of y, ln S, ln Q; residuals (n,): see the head of this module. Meets the protocol
    of :class:`chuteflow.numerics.continuation.AdaptiveSystem`: arclength is measured in the plane (ln S, ln Q).

    Raises:
        InputError: for a degree below 4, or a multiple that is not a whole number from 1 on.
    """

    chute: Chute
    degree: int
    multiple: int = 1

    def __post_init__(self) -> None:
        if self.degree < 4:
            raise InputError(f"degree N = {self.degree}: must be at least 4")
        if self.multiple < 1 or self.multiple != int(self.multiple):
            raise InputError(f"multiple k = {self.multiple}: must be a whole number from 1 on")
        if self.interface:
            object.__setattr__(self, "multiple", 1)

    @property
    def interface(self) -> bool:
        """Whether the surface is an interface at a finite height."""
        return self.chute.surface == "interface"

    @property
    def counts(self) -> tuple[int, int]:
        """How many coefficients x and y have."""
        return self.degree + 1, self.degree + (2 if self.interface else 1)

    @property
    def kappa(self) -> float:
        """Length of the map, L or H, over the scale S."""
        return 1.0 if self.interface else 2.0 * self.multiple

    def omega(self, zeta: Field) -> Field:
        """-L dzeta/dz, or -H dzeta/dz."""
        return np.ones_like(zeta) if self.interface else zeta

    @property
    def weights(self) -> Array:
        """0 for the coefficients, 1 for ln S and ln Q."""
        weights = np.zeros(sum(self.counts) + 2)
        weights[-2:] = 1.0
        return weights

    def split(self, z: Array) -> tuple[Array, Array, float, float]:
        """Coefficients of x, coefficients of y, ln S and ln Q."""
        n = self.counts[0]
        return z[:n], z[n:-2], float(z[-2]), float(z[-1])

    def residual_and_jacobian(self, z: Array) -> tuple[Array, Array]:
        """F (n,) and its exact Jacobian (n, n+1); not finite where nu is not below the densest packing."""
        residual, jacobian, _, _ = self.evaluate(z)
        return residual, jacobian

    def evaluate(self, z: Array) -> tuple[Array, Array, Array, Array]:
        """F (n,), its Jacobian (n, n+1), ln (Q, h, M, T_surface) (4,) of the fields, and its gradient (4, n+1)."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return _Evaluation(self, z).everything()

    def macroscopic(self, z: Array) -> Array:
        """ln (Q, h, M, T_surface) (4,) of the fields: (3.26) and (3.27) by quadrature in zeta."""
        return self.evaluate(z)[2]

    def local(self, x: Field, dx: Field, y: Field, dy: Field, log_scale: Field, omega: Field) -> PointValues:
        """Functions of the fields at points; arguments may be complex, for derivatives."""
        chute, chosen = self.chute, self.chute.law
        s, kappa = chute.slope, self.kappa
        per_scale = np.exp(-log_scale)
        mass, y2 = x * x, y * y
        nu = mass * per_scale
        nu = np.where(np.real(nu) < chosen.densest, nu, np.nan)
        g = chosen.of_density(nu, chute.restitution, s)
        big_g, work = g.compressibility, g.compressibility / g.viscosity
        nu_contact = nu * (1.0 + WALL_CONTACT) + WALL_CONTACT * 5.0 / (8.0 * g.radial)  # nu A, (2.12)
        slip = boundary.slip_coefficient(nu * work, nu_contact * work, chute.roughness, s)
        base_flux = s * slip - boundary.base_loss(chute.wall_restitution, chute.roughness)  # F2/g1, (3.18)
        stress = big_g * mass * y2
        conduction = 2.0 / kappa * g.conductivity * y2 * dy
        flux = conduction - 2.0 / kappa * g.density_conductivity * y2 * y * x * dx * per_scale
        g1_slope = big_g + nu * g.compressibility_slope
        if self.interface:
            surface_flux = boundary.surface_flux("interface", s)
            surface = (stress - boundary.INTERFACE_STRESS, flux - surface_flux * stress * y)
        else:
            surface = (y - 1.0,)
        return PointValues(
            nu=nu,
            momentum=2.0 / kappa * omega * (g1_slope * y2 * dx + big_g * x * y * dy) - x,
            flux=flux,
            conduction=conduction,
            heating=mass * mass * y2 * y * (g.dissipation - s * s * big_g * work),
            stress=stress,
            base=flux - base_flux * stress * y,
            surface=surface,
            mass=mass,
            scaled_shear_rate=s * work * mass * y,
            slip=slip * y,
            dissipation=g.dissipation,
        )

    def residual_between_nodes(self, z: Array) -> float:
        """Largest residual of (3.8) and (3.9) midway between the nodes, over the largest value of a term of each.

        The series are put into the differential equations as they stand: the derivative of the heat flux is
        taken along the series, by a complex step, and is not that of an interpolant.
        """
        a, b, log_scale, _ = self.split(z)
        zeta = np.sin(0.5 * np.pi * np.arange(1, self.degree) / self.degree) ** 2
        x, dx, ddx = (_series(a, zeta, order) for order in range(3))
        y, dy, ddy = (_series(b, zeta, order) for order in range(3))
        step = 1j * STEP
        omega = self.omega(zeta + step)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            local = self.local(
                x + step * dx, dx + step * ddx, y + step * dy, dy + step * ddy, np.asarray(log_scale), omega
            )
            divergence = np.real(omega) * derivative(omega * local.flux) / self.kappa
            heating = np.real(local.heating)
            energy = np.abs(divergence - heating).max() / np.abs(heating).max()
            momentum = np.abs(np.real(local.momentum)).max() / np.abs(x).max()
        return float(max(energy, momentum))

    def density_excess(self, z: Array) -> float:
        """Largest -d ln X/d zeta where the flow is not thin: positive where the volume fraction rises with height."""
        a, _, _, _ = self.split(z)
        zeta = np.sin(0.25 * np.pi * np.arange(2 * self.degree + 1) / self.degree) ** 2
        x, dx = _series(a, zeta, 0), _series(a, zeta, 1)
        thick = x > _THIN * x.max()
        return float((-dx[thick] / x[thick]).max())

    def transfer(self, degree: int, multiple: int) -> tuple[MappedSystem, Array]:
        """The system of another degree and multiple, and the matrix that takes z, or a tangent, to it."""
        other = MappedSystem(self.chute, degree, multiple)
        # exp(-z/L) is a fixed power of exp(-z/L'), whatever T_inf is.
        power = 1.0 if self.interface else multiple / self.multiple
        matrix = np.zeros((len(other.weights), len(self.weights)))
        row = column = 0
        for there, here in zip(other.counts, self.counts, strict=True):
            block = np.eye(there, here)
            if power != 1.0:
                g = grid(there - 1)
                block = g.to_coefficients @ chebyshev.chebvander(2.0 * g.nodes**power - 1.0, here - 1)
            matrix[row : row + there, column : column + here] = block
            row, column = row + there, column + here
        matrix[-2:, -2:] = np.eye(2)
        return other, matrix

    def adapt(self, z: Array, tangent: Array) -> tuple[MappedSystem, Array, Array] | None:
        """More or fewer coefficients, or another multiple, where the solution asks for it."""
        a, b, _, _ = self.split(z)
        decay = max(_decay(a), _decay(b))
        degree, multiple = self.degree, self.multiple
        if decay > _RESOLVED:
            degree = min((d for d in DEGREES if d > degree), default=degree)
        elif decay < _WASTED:
            degree = max((d for d in DEGREES if d < degree), default=degree)
        if not self.interface:
            macroscopic = self.macroscopic(z)
            best = best_multiple(float(np.exp(macroscopic[LOG_H] - macroscopic[LOG_T])))
            if not multiple / _MULTIPLE_OFF <= best <= multiple * _MULTIPLE_OFF:
                multiple = best
        if (degree, multiple) == (self.degree, self.multiple):
            return None
        other, matrix = self.transfer(degree, multiple)
        return other, matrix @ z, matrix @ tangent


class _Evaluation:
    """A system at one z: pointwise functions with their partial derivatives, and what is made of them."""

    def __init__(self, system: MappedSystem, z: Array) -> None:
        self.system = system
        self.sampling = m = sampling(system.degree)
        a, b, log_scale, self.log_flux = system.split(z)
        self.scale = np.exp(log_scale)
        self.omega = system.omega(m.points)
        self.n_x, self.n_y = n_x, n_y = system.counts
        # Copy i of the points has an imaginary part in variable i of (x, x', y, y', ln S).
        variables = np.empty((5, 5, len(m.points)), dtype=complex)
        variables[0] = m.basis[:, :n_x] @ a
        variables[1] = m.basis_slope[:, :n_x] @ a
        variables[2] = m.basis[:, :n_y] @ b
        variables[3] = m.basis_slope[:, :n_y] @ b
        variables[4] = log_scale
        self.y_surface = float(variables[2, 0, 0].real)
        for i in range(5):
            variables[i, i] = stepped(variables[i, i])
        x, dx, y, dy, log_scales = variables
        self.at = system.local(x, dx, y, dy, log_scales, self.omega)

    def both(self, function: Field, rows: slice) -> tuple[Array, Array]:
        """Values (rows,) of a pointwise function, and its derivative (rows, n+1) with respect to z."""
        m, n_x, n_y = self.sampling, self.n_x, self.n_y
        by_x, by_dx, by_y, by_dy, by_scale = derivative(function[:, rows])
        out = np.zeros((len(by_x), n_x + n_y + 2))
        basis, slope = m.basis[rows], m.basis_slope[rows]
        out[:, :n_x] = by_x[:, None] * basis[:, :n_x] + by_dx[:, None] * slope[:, :n_x]
        out[:, n_x:-2] = by_y[:, None] * basis[:, :n_y] + by_dy[:, None] * slope[:, :n_y]
        out[:, -2] = by_scale
        return np.real(function[0, rows]), out

    def everything(self) -> tuple[Array, Array, Array, Array]:
        """See :meth:`MappedSystem.evaluate`."""
        nodes, top, base = slice(1, -1), slice(0, 1), slice(-1, None)
        macroscopic, gradient = self.macroscopic()
        constraint = gradient[LOG_Q : LOG_Q + 1].copy()
        constraint[0, -1] = -1.0
        parts = [
            self.both(self.at.momentum, nodes),
            self.energy(),
            self.both(self.at.base, base),
            *(self.both(condition, top) for condition in self.at.surface),
            (macroscopic[LOG_Q : LOG_Q + 1] - self.log_flux, constraint),
        ]
        residual, jacobian = (np.concatenate(part) for part in zip(*parts, strict=True))
        return residual, jacobian, macroscopic, gradient

    def energy(self) -> tuple[Array, Array]:
        """(3.9) at the nodes."""
        flux, flux_z = self.both(self.at.flux, slice(None))
        heating, heating_z = self.both(self.at.heating, slice(1, -1))
        divergence = self.sampling.differentiate * (self.omega / self.system.kappa)
        omega = self.omega[1:-1]
        return divergence @ flux - heating / omega, divergence @ flux_z - heating_z / omega[:, None]

    def macroscopic(self) -> tuple[Array, Array]:
        """ln (Q, h, M, T_surface) (4,) and its gradient (4, n+1)."""
        m, kappa, scale = self.sampling, self.system.kappa, self.scale
        nodes, omega = slice(1, -1), self.omega[1:-1]
        mass, mass_z = self.both(self.at.mass / self.omega, nodes)  # nu dz/dzeta over kappa
        scaled_shear_rate, shear_rate_z = self.both(self.at.scaled_shear_rate / self.omega, nodes)
        slip, slip_z = (part[0] for part in self.both(self.at.slip, slice(-1, None)))
        surface_z = np.zeros(mass_z.shape[1])
        surface_z[self.n_x : -2] = m.basis[0, : self.n_y] * 2.0 / self.y_surface
        surface_z[-2] = 1.0
        # The hold-up above a node: nu z and nu u, integrated by parts, are this times dz and du.
        above = kappa * (m.accumulate @ mass)

        def gradient_of_sum(weights: Array) -> Array:  # of weights . above, without the matrix of above's gradient
            return kappa * ((weights @ m.accumulate) @ mass_z)

        holdup, holdup_z = kappa * (m.weights @ mass), kappa * (m.weights @ mass_z)
        moment, moment_z = m.weights / omega @ above, gradient_of_sum(m.weights / omega)  # over kappa S
        carried = slip * holdup + kappa * (m.weights @ (above * scaled_shear_rate))  # Q over sqrt(S)
        carried_z = slip * holdup_z + holdup * slip_z
        carried_z = carried_z + kappa * (
            gradient_of_sum(m.weights * scaled_shear_rate) + (m.weights * above) @ shear_rate_z
        )
        by_scale = np.zeros_like(surface_z)
        by_scale[-2] = 1.0
        root = np.sqrt(scale)
        values = [root * carried, kappa * scale * moment / holdup, holdup, scale * self.y_surface**2]
        gradient = [
            carried_z / carried + 0.5 * by_scale,
            moment_z / moment - holdup_z / holdup + by_scale,
            holdup_z / holdup,
            surface_z,
        ]
        return np.log(values), np.array(gradient)


@dataclass(frozen=True, eq=False)
class MappedSolution:
    """A flow by the mapped method; its numbers have the names they have in :class:`chuteflow.Flow`.

    ``z`` are the unknowns of ``system``; ``macroscopic`` ln (Q, h, M, T_surface), NaN where Newton's method did not
    converge; ``error`` the estimated relative error of Q, h and M, infinite where the discrete equations have a
    solution that the differential equations do not know; ``residual`` that of (3.8) and (3.9) between the
    nodes, see :meth:`MappedSystem.residual_between_nodes`.
    """

    system: MappedSystem
    z: Array
    macroscopic: Array
    error: float
    residual: float
    status: SolverStatus
    iterations: int

    @property
    def converged(self) -> bool:
        """Whether Newton's method converged, and to the tolerance where one was given."""
        return self.status is SolverStatus.CONVERGED

    @property
    def chute(self) -> Chute:
        """The chute."""
        return self.system.chute

    @property
    def degree(self) -> int:
        """N of (3.28)."""
        return self.system.degree

    @property
    def mass_flux(self) -> float:
        """Q, (3.26)."""
        return float(np.exp(self.macroscopic[LOG_Q]))

    @property
    def centre_of_mass(self) -> float:
        """h, (3.27)."""
        return float(np.exp(self.macroscopic[LOG_H]))

    @property
    def mass_holdup(self) -> float:
        """M, (3.27)."""
        return float(np.exp(self.macroscopic[LOG_M]))

    @property
    def surface_temperature(self) -> float:
        """T far above (half-line) or at the interface."""
        return float(np.exp(self.macroscopic[LOG_T]))

    @cached_property
    def density(self) -> str:
        """ "inverted" where the volume fraction rises with height anywhere, else "monotonic"."""
        return density_kind(self.system.density_excess(self.z))

    @property
    def map_length(self) -> float:
        """L of zeta = exp(-z/L) (half-line), or H of zeta = 1 - z/H."""
        return float(self.system.kappa * np.exp(self.z[-2]))

    @property
    def interface_height(self) -> float:
        """H, the height of the interface; infinite on the half-line (section 3.7)."""
        return self.map_length if self.system.interface else float("inf")

    @cached_property
    def x_coefficients(self) -> Array:
        """The a_n of (3.28), (N+1,): nu = X^2."""
        a, _, log_scale, _ = self.system.split(self.z)
        return a * np.exp(-0.5 * log_scale)

    @cached_property
    def y_coefficients(self) -> Array:
        """The b_n of (3.28), (N+1,), or one more below an interface: T = Y^2."""
        _, b, log_scale, _ = self.system.split(self.z)
        return b * np.exp(0.5 * log_scale)

    def coordinate(self, z: Array) -> Array:
        """zeta at heights z."""
        return 1.0 - z / self.map_length if self.system.interface else np.exp(-z / self.map_length)

    def profile(self, z: ArrayLike) -> Profile:
        """All fields at heights ``z`` >= 0 (array), in any order; above an interface they are not defined.

        nu is exact to about 1e-16 of its largest value: unlike the overburden coordinate, the series does not
        know the far field to a relative accuracy.

        Raises:
            InputError: for a height below the base or above the interface.
        """
        z = real_array("z", z)
        highest = self.interface_height * (1.0 + 1e-12)
        if z.size and not (np.isfinite(z).all() and z.min() >= 0.0 and z.max() <= highest):
            raise InputError(f"heights must be from 0 (base) to {highest}: got {z.min()} to {z.max()}")
        system, s = self.system, self.chute.slope
        zeta = self.coordinate(z)
        omega = system.omega(zeta)
        at = self._local(zeta)
        root = np.exp(0.5 * self.z[-2])
        y = _series(system.split(self.z)[1], zeta, 0)
        scaled_flux = omega * root
        shear_rate = at.scaled_shear_rate / root
        return Profile(
            height=z.copy(),
            volume_fraction=at.nu,
            granular_temperature=(root * y) ** 2,
            velocity=_series(self._velocity, zeta, 0),
            heat_flux=scaled_flux * at.flux,
            conductive_heat_flux=scaled_flux * at.conduction,
            density_heat_flux=scaled_flux * (at.flux - at.conduction),
            normal_stress=at.stress,
            shear_stress=-s * at.stress,
            shear_rate=shear_rate,
            production=s * at.stress * shear_rate,
            dissipation=at.dissipation * at.nu**2 * (root * y) ** 3,
        )

    def _local(self, zeta: Array) -> PointValues:
        a, b, log_scale, _ = self.system.split(self.z)
        x, dx, y, dy = (_series(c, zeta, order) for c in (a, b) for order in (0, 1))
        return self.system.local(x, dx, y, dy, np.asarray(log_scale), self.system.omega(zeta))

    @cached_property
    def _velocity(self) -> Array:
        """Coefficients of u(zeta), from (3.10) upwards from the slip velocity (3.15)."""
        m, root = sampling(self.degree), np.exp(0.5 * self.z[-2])
        nodes = m.points[1:-1]
        rate = self._local(nodes).scaled_shear_rate / self.system.omega(nodes)
        gained = 0.5 * chebyshev.chebint(m.to_coefficients @ rate, lbnd=1)
        velocity = -self.system.kappa * root * gained
        velocity[0] += root * float(self._local(np.ones(1)).slip[0])
        return velocity


def best_multiple(height_over_temperature: float) -> int:
    """The multiple k nearest to h/T_inf, with which L is near 2 h: it takes about the fewest coefficients.

    A larger k brings nodes down into a flow that is deep in units of T_inf, and leaves fewer above it, where
    X ~ zeta^k.
    """
    return max(1, round(height_over_temperature))


def solve_mapped(
    chute: Chute,
    start: Flow | MappedSolution,
    condition: Condition,
    degree: int,
    *,
    multiple: int | None = None,
) -> MappedSolution:
    """The flow on ``chute`` nearest to ``start`` that meets ``condition``, with N = ``degree``.

    Args:
        chute: the chute, which may differ from that of ``start`` in all but the surface.
        start: a flow to start from.
        condition: which flow of the branch.
        degree: N of (3.28), at least 4.
        multiple: k of (3.30), by default that of :func:`best_multiple` for ``start``.

    Raises:
        InputError: for a degree or multiple out of range, or a start with another surface.
    """
    system, z = _place(chute, start, degree, multiple)
    return _solve(system, z, condition)


def refine(
    chute: Chute,
    start: Flow | MappedSolution,
    condition: Condition,
    tolerance: float = TOLERANCE,
    *,
    multiple: int | None = None,
    largest_degree: int = LARGEST_DEGREE,
) -> MappedSolution:
    """The flow on ``chute`` nearest to ``start`` that meets ``condition``, to a relative ``tolerance`` in Q, h and M.

    The first degree is where the coefficients of ``start`` have decayed to the tolerance. The error of each solution is
    estimated by a step of Newton's method at a larger degree, and the degree raised as the error asks for. Other
    arguments as for :func:`solve_mapped`. Where ``largest_degree`` does not suffice the status says so.

    Raises:
        InputError: for a tolerance, degree or multiple out of range, or a start with another surface.
    """
    tolerance = check_tolerance(tolerance)
    system, z = _place(chute, start, largest_degree, multiple)
    a, b, _, _ = system.split(z)
    degree = min(max(8, _length(a, 0.03 * tolerance), _length(b, 0.03 * tolerance)), largest_degree)
    iterations = 0
    while True:
        smaller, matrix = system.transfer(degree, system.multiple)
        found = _solve(smaller, matrix @ z, condition)
        iterations += found.iterations
        if found.converged and found.error <= tolerance:
            return replace(found, iterations=iterations)
        growth = 1.5
        if found.converged:
            found = replace(found, status=SolverStatus.UNRESOLVED)
            z = smaller.transfer(largest_degree, system.multiple)[1] @ found.z
            # The error falls by the same factor with each coefficient more.
            growth = float(np.clip(np.log(0.1 * tolerance) / np.log(min(found.error, 0.1)), 1.1, 2.0))
        if degree == largest_degree:
            return replace(found, iterations=iterations)
        degree = min(int(np.ceil(growth * degree)), largest_degree)


def _place(chute: Chute, start: Flow | MappedSolution, degree: int, multiple: int | None) -> tuple[MappedSystem, Array]:
    """The system of ``degree``, and ``start`` on it."""
    require_richman(chute.base, "the mapped method is")
    if start.chute.surface != chute.surface:
        raise InputError(
            f"the flow to start from has the surface {start.chute.surface!r}: it must be that of the chute, "
            f"{chute.surface!r}"
        )
    if multiple is None:
        multiple = best_multiple(start.centre_of_mass / start.surface_temperature)
    system = MappedSystem(chute, degree, multiple)
    if isinstance(start, Flow):
        return system, _sample(system, start)
    near = MappedSystem(chute, start.degree, start.system.multiple)
    return system, near.transfer(degree, system.multiple)[1] @ start.z


def _sample(system: MappedSystem, flow: Flow) -> Array:
    """The unknowns z of a flow that is known at all heights."""
    scale = flow.interface_height if system.interface else flow.surface_temperature

    def at(count: int) -> tuple[Array, Array, Array]:
        g = grid(count - 1)
        if system.interface:
            profile = flow.profile(scale * (1.0 - g.nodes))
            return g.to_coefficients, profile.volume_fraction, profile.granular_temperature
        profile = flow.profile(-system.kappa * scale * np.log(g.nodes[1:]))
        nu, temperature = np.append(0.0, profile.volume_fraction), np.append(scale, profile.granular_temperature)
        return g.to_coefficients, nu, temperature

    for_x, nu, _ = at(system.counts[0])
    for_y, _, temperature = at(system.counts[1])
    a, b = for_x @ np.sqrt(nu * scale), for_y @ np.sqrt(temperature / scale)
    return np.concatenate([a, b, np.log([scale, flow.mass_flux])])


def _solve(system: MappedSystem, z: Array, condition: Condition) -> MappedSolution:
    """The flow near ``z`` that meets ``condition``, and its error.

    The error is estimated by the change in ln Q, ln h and ln M in one step of Newton's method at a larger degree, and
    by the decay of the coefficients: where these are barely resolved, the larger degree may be little better.
    """

    def step(system: MappedSystem, z: Array) -> tuple[Array, Array, Array, Array]:
        residual, jacobian, macroscopic, gradient = system.evaluate(z)
        weights = np.array(condition.weights)
        residual = np.append(residual, weights @ macroscopic - condition.value)
        return residual, np.vstack([jacobian, weights @ gradient]), macroscopic, gradient

    result = newton(lambda z: step(system, z)[:2], z, tolerance=1e-9, longest_step=1.0)
    z = result.z
    if not (result.converged and _is_physical(system, z)):
        return MappedSolution(
            system, z, np.full(4, np.nan), np.inf, np.inf, SolverStatus.NO_CONVERGENCE, result.iterations
        )
    macroscopic = system.macroscopic(z)
    larger, matrix = system.transfer(int(np.ceil(_CHECK * system.degree)), system.multiple)
    residual, jacobian, near, gradient = step(larger, matrix @ z)
    try:
        check = near - gradient @ np.linalg.solve(jacobian, residual)
    except np.linalg.LinAlgError:
        check = np.full(4, np.inf)
    change = float(np.abs(check - macroscopic)[:LOG_T].max())
    a, b, _, _ = system.split(z)
    error = max(_SAFETY * (change + max(_decay(a), _decay(b))), _FLOOR)
    between = system.residual_between_nodes(z)
    status = SolverStatus.CONVERGED
    if not (np.isfinite(error) and between < _SPURIOUS):
        error, status = np.inf, SolverStatus.UNRESOLVED
    return MappedSolution(system, z, macroscopic, error, between, status, result.iterations + 1)


def _is_physical(system: MappedSystem, z: Array) -> bool:
    """Whether T is positive, and nu has no zero in the flow: X may oscillate about zero only where it is tiny."""
    a, b, _, _ = system.split(z)
    m = sampling(system.degree)
    x, y = m.basis[:, : len(a)] @ a, m.basis[:, : len(b)] @ b
    return bool(y.min() > 0.0 and x.min() > -_DIP * x.max())


def _series(coefficients: Array, zeta: Array, order: int) -> Array:
    """A Chebyshev series in 2 zeta - 1, or its derivative of some order, at points of any shape."""
    return cast(Array, chebyshev.chebval(2.0 * zeta - 1.0, chebyshev.chebder(coefficients, order, scl=2.0)))


def _decay(coefficients: Array) -> float:
    """How far a series has decayed: its last two coefficients (one may happen to be small) over its largest."""
    sizes = np.abs(coefficients)
    return float(sizes[-2:].max() / sizes.max())


def _length(coefficients: Array, tolerance: float) -> int:
    """The degree above which all coefficients are below ``tolerance`` times the largest."""
    sizes = np.abs(coefficients)
    return int(np.flatnonzero(sizes >= tolerance * sizes.max())[-1])
