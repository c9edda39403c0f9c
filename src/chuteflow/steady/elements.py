"""A steady flow as polynomials on elements of the overburden coordinate, and Newton's method for it.

# notation: s grid coordinate, m = P/M fraction of the overburden, theta heat potential, y = q/(p sqrt(T)) heat flux.

Collocation at Gauss points (C. de Boor and B. Swartz 1973, SIAM J. Numer. Anal. 10, 582-606): theta and y are
continuous, of degree :data:`chuteflow.steady.kernel.STAGES` on each element, and satisfy the equations of
:mod:`chuteflow.steady.model` at the Gauss points. Integrals over the depth and values at the ends of the elements
converge with twice that order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from chuteflow.numerics.chebyshev import Array, interpolation_matrix, tail
from chuteflow.steady import kernel
from chuteflow.steady.collocation import Collocation
from chuteflow.steady.kernel import STAGES
from chuteflow.steady.model import CONDUCTION, Model

#: Change of theta, and of y over its scale, on one element at most; and its longest part of the grid.
_CHANGE, _CHANGE_OF_FLUX, _LONGEST = 0.5, 0.25, 0.17
#: Degrees of Chebyshev grids for a flow, and the decay of the coefficients with which one may resolve it.
DEGREES = (16, 24, 36, 54, 80, 120, 180, 270, 400)
_ROUGHLY = 1e-6
#: Where none does: the degree of a grid on each piece, of so many elements.
_PIECE, _PER_PIECE = 24, 6
#: Ends of elements in the first one, in parts of it, where T has no limit at the surface.
_GRADED = 0.4 ** np.arange(8, 0, -1.0)
#: Ends of pieces of a grid there, in parts of the first of the others, which are not smaller than the second number.
_COARSE, _SMOOTH = 0.125 ** np.arange(8, 0, -1.0), 1e-3
#: A piece of a grid is not shorter than this.
_APART = 1e-6
#: Elements at most of the coarser mesh, and pieces of a grid: no more than elements of the finer mesh.
MOST_ELEMENTS = 768
MOST_PIECES = 2 * MOST_ELEMENTS


def _gauss() -> tuple[Array, Array, Array, Array]:
    """Gauss points and weights on [0, 1] (2, STAGES); integrals (STAGES, STAGES) of the cardinal polynomials up to
    the points; the inverse of that; and the coefficients of t, t^2, ... of these integrals."""
    points, weights = np.polynomial.legendre.leggauss(STAGES)
    points, weights = 0.5 * (points + 1.0), 0.5 * weights
    powers = np.arange(1, STAGES + 1)
    coefficients: Array = np.linalg.inv(points[:, None] ** (powers - 1)).astype(float) / powers[:, None]
    integrals: Array = points[:, None] ** powers @ coefficients
    differences = np.linalg.inv(integrals).astype(float)
    return np.stack([points, weights]), integrals, differences, coefficients


_GAUSS, _INTEGRALS, _DIFFERENCES, _CARDINAL = _gauss()


@lru_cache(maxsize=16)
def _rule(beta: float) -> Array:
    """Gauss points, weights, and those for the integral of P dz in the first element (3, STAGES), where its integrand
    is a smooth function times t^(-beta)."""
    moments = 1.0 / (np.arange(1, STAGES + 1) - beta)
    powers = np.arange(STAGES)
    product = np.linalg.solve(_GAUSS[0] ** powers[:, None], moments) * _GAUSS[0] ** beta
    return np.stack([*_GAUSS, _GAUSS[1] if beta == 0.0 else product])


def _grade(breaks: Array) -> Array:
    """``breaks`` and more of them towards the surface, where P dz has an integrable singularity if T has no limit."""
    return np.concatenate([breaks[:1], breaks[1] * _GRADED, breaks[1:]])


@dataclass(frozen=True, eq=False)
class Elements:
    """theta and y on the elements between ``breaks`` (N+1,), in the grid coordinate with one ``stretch``.

    ``ends`` (N+1, 2) are theta and y there, ``slopes`` (N, STAGES, 2) their derivatives at the Gauss points, and
    ``log_mass`` is ln M.
    """

    model: Model
    stretch: float
    breaks: Array
    ends: Array
    slopes: Array
    log_mass: float

    @classmethod
    def sample(
        cls, model: Model, stretch: float, log_mass: float, s: Array, values: Callable[[Array], Array]
    ) -> Elements:
        """The polynomials through ``values`` (k,) -> (k, 2) of theta and y, on elements chosen by those at ``s``."""
        rough = values(s)
        breaks = kernel.distribute(
            s, rough[:, 0] / _CHANGE, rough[:, 1], 1.0 / (_CHANGE_OF_FLUX * model.flux_scale), _LONGEST
        )
        if model.unlimited:
            breaks = _grade(breaks)
        nodal = np.ascontiguousarray(values(kernel.places(breaks, _GAUSS[0])))
        return cls._through(model, stretch, log_mass, breaks, nodal)

    @classmethod
    def _through(cls, model: Model, stretch: float, log_mass: float, breaks: Array, nodal: Array) -> Elements:
        ends, slopes = np.empty((len(breaks), 2)), np.empty((len(breaks) - 1, STAGES, 2))
        kernel.fit(breaks, nodal, _DIFFERENCES, ends, slopes)
        return cls(model, stretch, breaks, ends, slopes, log_mass)

    @classmethod
    def of_collocation(cls, problem: Collocation, z: Array) -> Elements:
        """The same flow, from unknowns on a Chebyshev grid."""
        state = problem.state(z)
        theta_and_y = np.stack([state.theta, state.y], axis=1)
        stretch = max(float(np.reshape(problem.stretch, ())), 1e-9)
        return cls.sample(
            problem.model,
            stretch,
            float(z[-1]),
            problem.grid.nodes,
            lambda s: interpolation_matrix(problem.grid, s) @ theta_and_y,
        )

    def grids(self, pins: Array) -> Iterator[tuple[Collocation, Array]]:
        """The problem on Chebyshev grids that may resolve the flow, from coarse to fine, and its unknowns there to
        about 1e-8: between the ends of the elements the polynomials have no more digits.

        Last comes one with a grid on each of some pieces, and that alone where there are ``pins``: places at which
        pieces have to end, since the flow passes a break of the law there.
        """
        for degree in () if pins.size or self.model.unlimited else DEGREES:
            problem = Collocation(self.model, degree, self.stretch)
            z, y = self._unknowns(problem)
            if tail(problem.grid, np.stack([z[:-2] / np.abs(z[:-2]).max(), y / np.abs(y).max()]) + 1e-30) < _ROUGHLY:
                yield problem, z
        inner = self.breaks[_PER_PIECE:-_PER_PIECE:_PER_PIECE]
        if self.model.unlimited:
            # Where T has no limit theta is smooth but for terms like s^(1 + beta).
            inner = inner[inner > _SMOOTH]
            inner = np.concatenate([inner[:1] * _COARSE, inner]) if inner.size else _COARSE
        if pins.size:
            inner = np.unique(np.concatenate([inner[np.abs(inner[:, None] - pins).min(axis=1) > _APART], pins]))
        problem = Collocation(self.model, _PIECE, self.stretch, (0.0, *inner.tolist(), 1.0))
        yield problem, self.unknowns(problem)

    def unknowns(self, problem: Collocation) -> Array:
        """The unknowns on a Chebyshev grid of the same stretch."""
        return self._unknowns(problem)[0]

    def _unknowns(self, problem: Collocation) -> tuple[Array, Array]:
        """The unknowns on a Chebyshev grid of the same stretch, and y at its nodes."""
        theta, y = self.at(problem.grid.nodes).T
        mass = np.exp(self.log_mass)
        p = mass * problem.fraction[0] + self.model.surface_stress
        f, _ = self.model.closures(self.model.density_argument(p, theta))
        return np.concatenate([mass * y / f[CONDUCTION], [theta[0], self.log_mass]]), y

    def at(self, s: Array) -> Array:
        """theta and y at grid coordinates ``s`` (k,) ascending, (k, 2)."""
        out = np.empty((len(s), 2))
        kernel.evaluate(self.breaks, self.ends, self.slopes, _CARDINAL, s, out)
        return out

    def adapt(self, stretch: float) -> Elements:
        """The same flow on new elements, with another stretch."""
        return self.blend(self, 0.0, stretch)

    def blend(self, other: Elements, fraction: float, stretch: float) -> Elements:
        """``fraction`` of the way to another flow, also beyond it, on elements that suit this one."""
        breaks, ends, slopes = kernel.blend(
            self.breaks, self.ends, self.slopes, self.stretch, other.breaks, other.ends, other.slopes, other.stretch,
            float(fraction), stretch, _GAUSS[0], _CARDINAL, _DIFFERENCES, _CHANGE,
            1.0 / (_CHANGE_OF_FLUX * self.model.flux_scale), _LONGEST,
        )  # fmt: skip
        log_mass = self.log_mass + fraction * (other.log_mass - self.log_mass)
        found = Elements(self.model, stretch, breaks, ends, slopes, log_mass)
        return found.on(_grade(breaks)) if self.model.unlimited else found

    @property
    def _rule(self) -> Array:
        """What integrals are taken with, see :func:`_rule`."""
        return _rule(self.model.beta if self.model.unlimited else 0.0)

    def crossings(self, levels: Array, close: float) -> Array:
        """The places, to ``close``, at which ln x passes one of the ``levels`` (k,)."""
        model = self.model
        found = kernel.crossings(
            self.breaks, self.ends, self.slopes, _CARDINAL, _GAUSS[0], _INTEGRALS, self.stretch,
            float(np.exp(self.log_mass)), model.surface_stress, float(np.real(model.beta)), levels, close,
        )  # fmt: skip
        return np.asarray(found, dtype=float)

    def on(self, breaks: Array) -> Elements:
        """The polynomials through values of the flow on other elements."""
        values = self.at(kernel.places(breaks, _GAUSS[0]))
        return Elements._through(self.model, self.stretch, self.log_mass, breaks, values)

    def halve(self) -> Elements:
        """The same polynomials on elements of half the length."""
        breaks, ends, slopes = kernel.halve(self.breaks, self.ends, self.slopes, _GAUSS[0], _CARDINAL, _DIFFERENCES)
        return Elements(self.model, self.stretch, breaks, ends, slopes, self.log_mass)

    def iterate(self, weights: Array, value: float, tolerance: float, most: int, *, rounding: bool = False) -> Iterate:
        """Newton's method for the flow whose macroscopic quantities, times ``weights`` (4,), sum to ``value``: until a
        step is below ``tolerance``, or ``most`` steps; with what ``rounding`` may do where that is requested."""
        ends, slopes = self.ends.copy(), self.slopes.copy()
        quantities, rates = np.full(4, np.nan), np.full(4, np.nan)
        errors = np.zeros((2 if rounding else 0, 4))
        mu, step = kernel.iterate(
            self.model.table.compiled, self.model.constants, self._rule, _INTEGRALS, self.breaks, self.stretch,
            ends, slopes, self.log_mass, weights, value, tolerance, most, quantities, rates,
            errors,
        )  # fmt: skip
        return Iterate(
            Elements(self.model, self.stretch, self.breaks, ends, slopes, mu), quantities, rates, errors, step
        )

    def direction(self, weights: Array) -> Array | None:
        """The change (4,) of ln Q, ln h, ln M and ln T_surface along the branch, for which they, times ``weights``
        (4,), change by 1; None where the condition turns."""
        change = np.empty(4)
        found = kernel.direction(
            self.model.table.compiled, self.model.constants, self._rule, _INTEGRALS, self.breaks, self.stretch,
            self.ends, self.slopes, self.log_mass, weights, change,
        )  # fmt: skip
        return change if found else None


@dataclass(frozen=True, eq=False)
class Iterate:
    """What Newton's method came to: the flow, its ``quantities`` ln Q, ln h, ln M and ln T_surface (4,), their
    ``rates`` with the value of the condition along the branch (4,), what rounding may do to them, the ``errors`` (k,
    4), and the size of the last ``step``, infinite where the method failed."""

    flow: Elements
    quantities: Array
    rates: Array
    errors: Array
    step: float
