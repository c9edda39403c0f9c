"""The discretised steady problem: Chebyshev collocation in the overburden coordinate, exact Jacobian.

# notation: s grid coordinate, m = P/M fraction of the overburden, theta heat potential, g = dtheta/dm,
# otherwise as in chuteflow.steady.model.

The unknown field is g at the nodes of a grid on 0 <= s <= 1; with it go theta at the surface and ln M.
Taking the gradient for the unknown, and the potential as its integral, keeps all digits of the heat flux in
cold and thin flows, where theta is almost uniform. The overburden is P = M m(s), with
m = expm1(alpha s)/expm1(alpha): alpha = 0 is the plain coordinate, and a larger stretch alpha spreads the
thin dilute layer of a cold flow over the grid.

Where the density passes a break of the law, pieces of the grid meet. Where that is may be an unknown, as it has to be
for exact derivatives: such a break is pinned. The grid coordinate is then a reference coordinate r, and

    s = r + sum over the pinned breaks k of d_k l_k(r)

with the unknowns d_k and shapes l_k, which are 1 at their break and fall to 0 at the breaks beside it, as cubics
without slope at either end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import (
    AnyGrid,
    Array,
    PiecewiseGrid,
    grid,
    interpolation_matrix,
    piecewise_grid,
    refinement,
    singular_weights,
)
from chuteflow.steady.model import CONDUCTION, COUPLING, DENSITY, GAMMA, LOSS, WORK, Model, log_stress

#: The order of the macroscopic quantities: ln Q, ln h, ln M, ln T_surface.
LOG_Q, LOG_H, LOG_M, LOG_T = range(4)
#: The least stretch: plain to rounding, and in need of no other formula.
_PLAIN = 1e-9
#: How far aside of a break, in parts of x, a node is taken to be that belongs to one of its sides.
_ASIDE = 1e-9
#: The least density argument of a logarithm.
_LEAST = 1e-300


def stretch_map(s: Array, stretch: Array | float) -> tuple[Array, Array]:
    """m(s) and dm/ds for a stretch alpha >= 0, or for many in the shape (..., 1)."""
    alpha = np.maximum(stretch, _PLAIN)
    whole = np.expm1(alpha)
    return np.expm1(alpha * s) / whole, alpha * np.exp(alpha * s) / whole


def stretch_position(m: Array, stretch: Array | float) -> Array:
    """s at fractions m: the inverse of :func:`stretch_map`."""
    alpha = np.maximum(stretch, _PLAIN)
    return np.log1p(m * np.expm1(alpha)) / alpha


#: The breaks of a grid in one piece.
WHOLE = (0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Collocation:
    """The problem of ``model`` on the grid of one ``degree`` n, with one ``stretch``.

    A flow too winding for one grid has one of this degree on each piece between ``breaks``; n is the number of nodes
    less one. Unknowns z (n+3,) = (g at the nodes, theta at the surface, ln M); residuals (n+2,): the surface condition,
    the energy balance at the other nodes, and the base condition. Each of the ``pins``, the index of a break and that
    of the kink of the model that the flow passes there, has an unknown before the last two, and a residual at the end.
    Many flows are treated at once with
    unknowns (k, n+3) and, where their stretches differ, a ``stretch`` of the shape (k, 1).
    """

    model: Model
    degree: int
    stretch: Array | float
    breaks: tuple[float, ...] = WHOLE
    pins: tuple[tuple[int, int], ...] = ()

    @property
    def grid(self) -> AnyGrid:
        """The grid in s."""
        return grid(self.degree) if self.breaks == WHOLE else piecewise_grid(self.breaks, self.degree)

    @cached_property
    def fraction(self) -> tuple[Array, Array]:
        """m and dm/ds at the nodes."""
        return stretch_map(self.grid.nodes, self.stretch)

    @cached_property
    def height_weights(self) -> Array:
        """Weights of the integral of P dz: where T has no limit its integrand is a smooth function times s^(-beta)."""
        g = self.grid
        if not self.model.unlimited:
            return g.weights
        piece, end = g.piece if isinstance(g, PiecewiseGrid) else g, self.breaks[1]
        product = singular_weights(piece.degree, self.model.beta)
        weights = g.weights.astype(product.dtype)
        weights[: len(piece.nodes)] += end * (product - piece.weights)
        return weights

    @property
    def accumulate(self) -> Array:
        """Matrix (n+1, n+1) that takes g to theta less its surface value."""
        # Those of many pieces are large: a curve of flows would not fit into memory with one for each.
        return self._accumulate if self.breaks == WHOLE else self._integral_over_mass()

    @cached_property
    def _accumulate(self) -> Array:
        return self._integral_over_mass()

    def _integral_over_mass(self) -> Array:
        return self.grid.integral * self.fraction[1][..., None, :]

    @property
    def pinned_nodes(self) -> NDArray[np.intp]:
        """The nodes at the pinned breaks, (k,)."""
        return np.array([index * self.degree for index, _ in self.pins], dtype=np.intp)

    @cached_property
    def shapes(self) -> tuple[Array, Array]:
        """The shapes of the pinned breaks at the nodes, and their derivatives, (k, n+1) each."""
        return self.shapes_at(self.grid.nodes)

    def shapes_at(self, r: Array) -> tuple[Array, Array]:
        """The shapes of the pinned breaks at places ``r`` (m,), and their derivatives, (k, m) each."""
        values, slopes = np.zeros((len(self.pins), len(r))), np.zeros((len(self.pins), len(r)))
        for k, (index, _) in enumerate(self.pins):
            place = self.breaks[index]
            for other in (self.breaks[index - 1], self.breaks[index + 1]):
                t = (r - other) / (place - other)
                beside = (t > 0.0) & (t <= 1.0)
                t = t[beside]
                values[k, beside] = t**2 * (3.0 - 2.0 * t)
                slopes[k, beside] = 6.0 * t * (1.0 - t) / (place - other)
        return values, slopes

    def state(self, z: Array) -> State:
        """Everything pointwise at unknowns ``z``."""
        return State(self, z)

    def transfer(self, degree: int, stretch: Array | float | None = None) -> tuple[Collocation, Array]:
        """The problem on another grid, and the matrix that takes g to its nodes."""
        same = stretch is None or stretch is self.stretch or np.array_equal(stretch, self.stretch)
        if same and self.breaks == WHOLE:
            return Collocation(self.model, degree, self.stretch), refinement(self.degree, degree)
        other = Collocation(self.model, degree, self.stretch if stretch is None else stretch, self.breaks)
        position = stretch_position(other.fraction[0], self.stretch)
        return other, interpolation_matrix(self.grid, position)


def prolong(problem: Collocation, z: Array, degree: int) -> tuple[Collocation, Array]:
    """The flow of unknowns ``z`` on the grid of another degree on each piece, and its unknowns there."""
    nodes = len(problem.grid.nodes)
    other = replace(problem, degree=degree)
    return other, np.concatenate([problem.grid.interpolate(z[:nodes], other.grid.nodes), z[nodes:]])


class State:
    """Pointwise fields of discretised flows, residuals, integrals and exact derivatives.

    Unknowns and parameters may be complex: a step along the imaginary axis differentiates all of this exactly.
    """

    def __init__(self, problem: Collocation, z: Array) -> None:
        self.problem = problem
        model = problem.model
        nodes = len(problem.grid.nodes)
        self.g = z[..., :nodes]
        self.mass = mass = np.exp(z[..., -1:])
        self.fraction = m, dm = self._move(z[nodes:-2]) if problem.pins else problem.fraction
        self.theta = z[..., -2:-1] + problem.grid.integrate(self.g * dm)
        self.overburden = mass * m
        self.p = p = self.overburden + model.surface_stress
        #: P/p, which is 1 on the half-line
        self.overburden_fraction = self.overburden / p if model.surface_stress else np.ones_like(p)
        self.x = model.density_argument(p, self.theta)
        self.f, self.df = f, _ = model.closures(self.x, self._side() if problem.pins else None)
        self.y = f[CONDUCTION] * self.g / mass
        self.s_p = 1.0 / (mass * dm)  # ds/dp
        self.y_p = problem.grid.differentiate(self.y) * self.s_p
        self.rise = p * self.g / mass - model.beta  # p dtheta/dp, less beta
        self.heating = self.rise + f[COUPLING] * (1.0 - self.rise)  # d ln T / d ln p
        self.net_loss = f[LOSS] - model.slope**2 * f[WORK]
        self.log_t = model.log_temperature(p, self.theta, f[GAMMA])
        self.base_flux = model.base_flux(f[..., -1])
        #: complex where any unknown or parameter is
        self.dtype = np.result_type(self.y, self.base_flux)

    @property
    def accumulate(self) -> Array:
        """Matrix (n+1, n+1) that takes g to theta less its surface value."""
        return self.problem.grid.integral * self.fraction[1] if self.problem.pins else self.problem.accumulate

    def _move(self, d: Array) -> tuple[Array, Array]:
        """m and dm/dr at the nodes where the pinned breaks are moved by ``d`` (k,)."""
        problem = self.problem
        shape, slope = problem.shapes
        m, dm = stretch_map(problem.grid.nodes + d @ shape, problem.stretch)
        return m, dm * (1.0 + d @ slope)

    def _side(self) -> Array:
        """An x that tells which side of a break a node is on: the node at a break belongs to the piece above it."""
        side = np.real(self.x).copy()
        kinks = np.exp(self.problem.model.kinks_at([kink for _, kink in self.problem.pins]))
        for node, at in zip(self.problem.pinned_nodes, kinks.tolist(), strict=True):
            side[node] = at * (1.0 + _ASIDE if side[node - 1] > at else 1.0 - _ASIDE)
        return side

    @cached_property
    def by_pins(self) -> tuple[Array, Array, Array]:
        """Derivatives (n+1, k) with respect to the unknowns of the pinned breaks: of ln P, ln dm/dr, and theta."""
        problem = self.problem
        (shape, slope), (m, dm) = problem.shapes, self.fraction
        alpha = max(float(np.reshape(problem.stretch, ())), _PLAIN)
        whole = np.expm1(alpha)
        m_s = alpha * (m + 1.0 / whole)
        by_dm = alpha * shape + slope * m_s / dm
        # P vanishes with m at the surface, where nothing moves.
        by_m = np.where(m == 0.0, 0.0, shape * m_s / np.where(m == 0.0, 1.0, m))
        return by_m.T, by_dm.T, problem.grid.integral @ (self.g * dm * by_dm).T

    @cached_property
    def log_x_gradient(self) -> Array:
        """Derivative (n+1, n+3) of ln x with respect to z."""
        raised = (1.0 + self.problem.model.beta) * self.overburden_fraction
        columns = [-self.accumulate, -np.ones((len(raised), 1)), raised[:, None]]
        if self.problem.pins:
            by_m, _, by_theta = self.by_pins
            columns.insert(1, raised[:, None] * by_m - by_theta)
        return np.concatenate(columns, axis=1)

    @property
    def rise_gradient(self) -> Array:
        """Derivative (n+1, n+3) of the rise with respect to z."""
        steep = self.rise + self.problem.model.beta
        columns = [
            np.diag(self.p / self.mass),
            np.zeros((len(steep), 1)),
            ((self.overburden_fraction - 1.0) * steep)[:, None],
        ]
        if self.problem.pins:
            columns.insert(1, (self.overburden_fraction * steep)[:, None] * self.by_pins[0])
        return np.concatenate(columns, axis=1)

    def residual(self) -> Array:
        """Surface condition, energy balance (3.9) at the nodes below it, base condition (3.17), (n+2,)."""
        plain = self._residual()
        return np.concatenate([plain, self._off_kinks()]) if self.problem.pins else plain

    def _off_kinks(self) -> Array:
        model, nodes = self.problem.model, self.problem.pinned_nodes
        log_x = (1.0 + model.beta) * log_stress(self.p[nodes]) - self.theta[nodes]
        return log_x - model.kinks_at([kink for _, kink in self.problem.pins])

    def _residual(self) -> Array:
        model = self.problem.model
        r = np.empty((*self.p.shape[:-1], self.p.shape[-1] + 1), dtype=self.dtype)
        r[..., :-1] = self.p * (self.y_p - self.net_loss) + self.y * (1.0 + 0.5 * self.heating)
        r[..., 0] = self.y[..., 0] - model.surface_flux
        r[..., -1] = self.y[..., -1] - self.base_flux
        return r

    def jacobian(self) -> Array:
        """Derivative (n+2, n+3) of the residual with respect to z."""
        plain = self._jacobian()
        if not self.problem.pins:
            return plain
        above = np.concatenate([plain[:, :-2], self._jacobian_of_pins(), plain[:, -2:]], axis=1)
        return np.concatenate([above, self.log_x_gradient[self.problem.pinned_nodes]])

    def _jacobian_of_pins(self) -> Array:
        """Derivative (n+2, k) of the equations of the flow with respect to the unknowns of the pinned breaks."""
        problem, model = self.problem, self.problem.model
        f, df = self.f, self.df[..., None]
        by_m, by_dm, _ = self.by_pins
        raised = ((1.0 + model.beta) * self.overburden_fraction)[:, None]
        log_x, p = raised * by_m - self.by_pins[2], self.p[:, None]
        y = df[CONDUCTION] * (self.g / self.mass)[:, None] * log_x
        y_p = (problem.grid.derivative @ y) * self.s_p[:, None] - self.y_p[:, None] * by_dm
        over, rise = self.overburden[:, None] * by_m, self.rise[:, None]
        warmer = (1.0 - f[COUPLING])[:, None] * over * (self.g / self.mass)[:, None]
        warmer = warmer + df[COUPLING] * log_x * (1.0 - rise)
        net = (df[LOSS] - model.slope**2 * df[WORK]) * log_x
        out = np.empty((len(self.p) + 1, len(problem.pins)), dtype=self.dtype)
        out[:-1] = over * (self.y_p - self.net_loss)[:, None] + p * (y_p - net)
        out[:-1] += y * (1.0 + 0.5 * self.heating)[:, None] + 0.5 * self.y[:, None] * warmer
        out[0] = y[0]
        out[-1] = y[-1] - model.base_flux_slope(self.df[..., -1]) * log_x[-1]
        return out

    def _jacobian(self) -> Array:
        problem, model = self.problem, self.problem.model
        f, df, p, y, overburden_fraction = self.f, self.df, self.p, self.y, self.overburden_fraction
        # d ln x / d ln M
        by_mass = (1.0 + model.beta) * overburden_fraction
        n = p.shape[-1]
        nodes = np.arange(n)
        y_log_x = df[CONDUCTION] * self.g / self.mass
        # Columns: g through the potential, then directly; theta at the surface; ln M.
        # ln x falls by the rise of theta, and rises by P/p with ln M.
        y_z = np.empty((*p.shape, n + 2), dtype=self.dtype)
        np.multiply(-y_log_x[..., None], self.accumulate, out=y_z[..., :n])
        y_z[..., nodes, nodes] += f[CONDUCTION] / self.mass
        y_z[..., n] = -y_log_x
        y_z[..., n + 1] = y_log_x * by_mass - y
        heating_log_x = df[COUPLING] * (1.0 - self.rise)
        by_log_x = 0.5 * y * heating_log_x - p * (df[LOSS] - model.slope**2 * df[WORK])
        by_rise = 0.5 * y * (1.0 - f[COUPLING])
        out = np.empty((*p.shape[:-1], n + 1, n + 2), dtype=self.dtype)
        body = out[..., :-1, :]
        np.matmul((p * self.s_p)[..., None] * problem.grid.derivative, y_z, out=body)
        body += (1.0 + 0.5 * self.heating)[..., None] * y_z
        body[..., :n] -= by_log_x[..., None] * self.accumulate
        body[..., nodes, nodes] += by_rise * p / self.mass
        body[..., n] -= by_log_x
        body[..., n + 1] += (
            (self.overburden - p) * self.y_p
            - self.overburden * self.net_loss
            + by_log_x * by_mass
            + by_rise * (overburden_fraction - 1.0) * (self.rise + model.beta)
        )
        out[..., 0, :] = y_z[..., 0, :]
        base = model.base_flux_slope(df[..., -1])
        out[..., -1, :] = y_z[..., -1, :]
        out[..., -1, :n] += base[..., None] * self.accumulate[..., -1, :]
        out[..., -1, n] += base
        out[..., -1, n + 1] -= base * by_mass[..., -1]
        return out

    def macroscopic(self) -> Array:
        """ln Q, ln h, ln M and ln T_surface, (4,): (3.26) and (3.27) as integrals over the overburden."""
        mass = self.mass[..., 0]
        flux, moment = self._slip + self._shear_flux.sum(axis=-1), self._heights.sum(axis=-1)
        return np.stack([np.log(flux), np.log(moment / mass), np.log(mass), self.surface], axis=-1)

    @property
    def surface(self) -> Array:
        """ln T_surface; theta there where T has no limit far above."""
        return (self.theta if self.problem.model.unlimited else self.log_t)[..., 0]

    @cached_property
    def _heights(self) -> Array:
        """Contributions of the nodes to the integral of P dz = (P/nu) dp."""
        model = self.problem.model
        if model.beta == 0.0:
            integrand = self.overburden_fraction * np.exp(self.theta - self.f[DENSITY])
        else:
            integrand = self.overburden * np.exp(-np.log(np.maximum(self.x, _LEAST)) - self.f[DENSITY])
        return self.problem.height_weights * self.fraction[1] * self.mass * integrand

    @cached_property
    def _shear_flux_per_work(self) -> Array:
        weights = self.problem.grid.weights * self.fraction[1] * self.mass
        return weights * self.overburden * (self.problem.model.slope * np.exp(0.5 * self.log_t))

    @cached_property
    def _shear_flux(self) -> Array:
        """Contributions to the integral of P du, with du = s (g1/g2) sqrt(T) dp/nu (3.10)."""
        return self._shear_flux_per_work * self.f[WORK]

    @cached_property
    def _slip(self) -> Array:
        """Flux carried by the slip velocity (3.15)."""
        slip = self.problem.model.slip(self.f[..., -1])
        return slip * np.exp(0.5 * self.log_t[..., -1]) * self.mass[..., 0]

    def macroscopic_gradient(self) -> Array:
        """Derivative (4, n+3) of :meth:`macroscopic` with respect to z."""
        model, df, overburden_fraction = self.problem.model, self.df, self.overburden_fraction
        n = self.p.shape[-1]
        root_t = 0.5 * (1.0 - df[GAMMA])  # d ln sqrt(T) / dtheta
        heights, shear_flux = self._heights, self._shear_flux
        work_part = self._shear_flux_per_work * df[WORK]
        flux = self._slip + shear_flux.sum(axis=-1)
        moment = heights.sum(axis=-1)
        slip_log_x = model.slip_slope(df[..., -1]) / model.slip(self.f[..., -1])
        end = self._slip / flux
        by_theta = np.empty((*self.p.shape[:-1], 2, n), dtype=self.dtype)
        by_theta[..., 0, :] = (shear_flux * root_t - work_part) / flux[..., None]
        by_theta[..., 0, -1] += end * (root_t[..., -1] - slip_log_x)
        by_theta[..., 1, :] = heights * (1.0 + df[DENSITY]) / moment[..., None]
        out = np.zeros((*self.p.shape[:-1], 4, n + 2), dtype=self.dtype)
        out[..., :2, :n] = by_theta @ self.accumulate
        out[..., :2, n] = by_theta.sum(axis=-1)
        by_mass = (1.0 + model.beta) * overburden_fraction
        warmed = df[GAMMA] * by_mass - model.beta * overburden_fraction  # d ln T / d ln M
        shear_move = (shear_flux * (2.0 + 0.5 * warmed) + work_part * by_mass).sum(axis=-1)
        by_share = slip_log_x * (1.0 + model.beta) + 0.5 * (df[GAMMA][..., -1] * (1.0 + model.beta) - model.beta)
        slip_move = 1.0 + by_share * overburden_fraction[..., -1]
        out[..., LOG_Q, n + 1] = shear_move / flux + end * slip_move
        height_move = (heights * (2.0 - by_mass * (1.0 + df[DENSITY]))).sum(axis=-1)
        out[..., LOG_H, n + 1] = height_move / moment - 1.0
        out[..., LOG_M, n + 1] = 1.0
        out[..., LOG_T, n] = self.log_t_slope
        if not self.problem.pins:
            return out
        by_m, by_dm, by_theta = self.by_pins
        log_x = ((1.0 + model.beta) * overburden_fraction)[:, None] * by_m - by_theta
        log_t = by_theta + df[GAMMA][:, None] * log_x - model.beta * overburden_fraction[:, None] * by_m
        pins = np.zeros((4, len(self.problem.pins)), dtype=self.dtype)
        drag = shear_flux @ (by_m + by_dm + 0.5 * log_t) + work_part @ log_x
        pins[LOG_Q] = (drag + self._slip * (slip_log_x * log_x[-1] + 0.5 * log_t[-1])) / flux
        pins[LOG_H] = heights @ (by_m + by_dm - (1.0 + df[DENSITY])[:, None] * log_x) / moment
        return np.concatenate([out[:, :n], pins, out[:, n:]], axis=1)

    @property
    def log_t_slope(self) -> Array:
        """d ln T_surface / dtheta at the surface."""
        return 1.0 - self.df[GAMMA][..., 0]
