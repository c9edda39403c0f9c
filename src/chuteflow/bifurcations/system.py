"""A boundary in one parameter more as a continuation problem.

# notation: z unknowns of a flow (n+3,), lambda the second parameter.

Unknowns (z, lambda), where z may have those of pinned breaks (:mod:`chuteflow.steady.collocation`); equations: the
steady problem and one condition. Turning points in lambda are nothing
special to the continuation of :mod:`chuteflow.numerics.continuation`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from chuteflow.bifurcations.conditions import Linearisation, TestFunction
from chuteflow.bifurcations.grids import fit_grid, transfer
from chuteflow.numerics.chebyshev import Array, tail
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import WHOLE, Collocation
from chuteflow.steady.elements import DEGREES
from chuteflow.steady.model import Model, model_along
from chuteflow.steady.solver import default_stretch
from chuteflow.theory.constitutive import Law

#: Length, in the plane of ln T_surface and ln M, that counts as much as the whole range of the parameter.
_SPAN = 6.0
#: Weight of the gradient of the potential in the inner product.
_OF_GRADIENT = 0.02
#: Weight of the unknowns of pinned breaks, and the part of the range over which kinks are differentiated.
_OF_BREAKS, _STEP = 0.01, 1e-6
#: Decay of the coefficients between which a grid is kept along a boundary.
_RESOLVED, _WASTED = 1e-7, 1e-13
#: The stretch is renewed when it is off by more.
_STRETCH_OFF = 0.3


@dataclass(frozen=True)
class SecondParameter:
    """The second parameter of a chute: its ``name`` in Chute, and the range ``low`` to ``high``."""

    chute: Chute
    name: str
    low: float
    high: float

    @property
    def weight(self) -> float:
        """Of the parameter in the inner product."""
        return (_SPAN / (self.high - self.low)) ** 2

    def models(self, value: float) -> tuple[Model, Model]:
        """The problem at a value of the parameter, and an imaginary step further."""
        return _models(self, self.chute.law, value)

    def chute_at(self, value: float) -> Chute:
        """The chute at a value of the parameter, which may be beyond the range by rounding."""
        return replace(self.chute, **{self.name: min(max(value, self.low), self.high)})

    def allows(self, value: float) -> bool:
        """Whether the equations are requested: within the range, or a little beyond it."""
        margin = min(0.1 * (self.high - self.low), 0.5 * self.low if self.low > 0.0 else np.inf)
        return self.low - margin <= value <= self.high + margin


@lru_cache(maxsize=8)
def _models(sweep: SecondParameter, registered: Law, value: float) -> tuple[Model, Model]:
    del registered  # known here to tell what is remembered of one law from that of another
    return model_along(sweep.chute, sweep.name, value)


@dataclass(frozen=True, eq=False)
class BoundarySystem:
    """The steady problem and one condition, on a grid of ``degree`` and ``stretch`` with ``breaks`` and ``pins`` as
    in :class:`chuteflow.steady.collocation.Collocation`; unknowns (z, lambda).

    The inner product is that of the plane (theta at the surface, ln M), with a little of the integral of g^2 over the
    overburden, so that neither resolution nor stretch changes the path, and with the parameter, whose range counts as
    much as a factor of e^6 in T_surface or M.
    """

    sweep: SecondParameter
    condition: TestFunction
    degree: int
    stretch: float
    breaks: tuple[float, ...] = WHOLE
    pins: tuple[tuple[int, int], ...] = ()

    @property
    def weights(self) -> Array:
        """Of the unknowns, (n+4,)."""
        problem = self.problem(self.sweep.low)
        by_quadrature = problem.grid.weights * problem.fraction[1]
        return np.concatenate(
            [_OF_GRADIENT * by_quadrature, np.full(len(self.pins), _OF_BREAKS), [1.0, 1.0, self.sweep.weight]]
        )

    def problem(self, value: float) -> Collocation:
        """The steady problem at a value of the parameter."""
        return self._of(self.sweep.models(value)[0])

    def _of(self, model: Model) -> Collocation:
        return Collocation(model, self.degree, self.stretch, self.breaks, self.pins)

    def local(self, w: Array) -> Linearisation:
        """Everything at the unknowns ``w`` (n+4,)."""
        value = float(w[-1])
        here, beyond = self.sweep.models(value)
        kinks = self._kinks_by_parameter(value) if self.pins else None
        return Linearisation.at(self._of(here), self._of(beyond), w[:-1], kinks)

    def _kinks_by_parameter(self, value: float) -> Array:
        """Derivatives of the pinned ln x with respect to the parameter: breaks are known at real values alone."""
        step = _STEP * (self.sweep.high - self.sweep.low)
        which = [kink for _, kink in self.pins]
        low, high = (self.sweep.models(value + side)[0].kinks_at(which) for side in (-step, step))
        return (high - low) / (2.0 * step)

    def residual_and_jacobian(self, w: Array) -> tuple[Array, Array]:
        """See chuteflow.numerics.continuation.System."""
        n = len(w) - 1
        residual, jacobian = np.full(n, np.nan), np.full((n, n + 1), np.nan)
        if not self.sweep.allows(float(w[-1])):
            return residual, jacobian
        # A trial that goes too far may overflow; the continuation finds that out.
        with np.errstate(all="ignore"):
            at = self.local(w)
            residual[:-1], jacobian[:-1, :-1], jacobian[:-1, -1] = at.residual, at.by_z, at.by_parameter
            residual[-1], jacobian[-1, :-1], jacobian[-1, -1] = self.condition(at)
        return residual, jacobian

    def adapt(self, w: Array, tangent: Array) -> tuple[BoundarySystem, Array, Array] | None:
        """Another grid or stretch where the flow asks for it, and other borders where the condition does."""
        problem, z = self.problem(float(w[-1])), w[:-1]
        other = _choose_grid(problem, z)
        if other is None:
            at = self.local(w)
            if self.condition.suits(at):
                return None
            return replace(self, condition=self.condition.adapt_to(at)), w, tangent
        moved = np.append(transfer(problem, z, other), w[-1])
        direction = np.append(transfer(problem, tangent[:-1], other, z), tangent[-1])
        return self.moved(other, moved), moved, direction

    def refit(self, w: Array) -> tuple[BoundarySystem, Array] | None:
        """The system on pieces that meet where the flow passes kinks of the law now, and the point there; None where it
        is that already."""
        problem = self.problem(float(w[-1]))
        other = fit_grid(problem, w[:-1])
        if other is None:
            return None
        moved = np.append(transfer(problem, w[:-1], other), w[-1])
        return self.moved(other, moved), moved

    def moved(self, problem: Collocation, w: Array) -> BoundarySystem:
        """The system on the grid of ``problem``, where ``w`` is about the solution."""
        stretch = float(np.reshape(problem.stretch, ()))
        other = replace(self, degree=problem.degree, stretch=stretch, breaks=problem.breaks, pins=problem.pins)
        return replace(other, condition=self.condition.adapt_to(other.local(w)))

    def tangent(self, w: Array) -> Array:
        """The null vector (n+4,) of the Jacobian, of length 1 in the inner product."""
        _, jacobian = self.residual_and_jacobian(w)
        # Columns are scaled so that the null vector is that of the inner product.
        root = np.sqrt(np.maximum(self.weights, 1e-12))
        _, _, v = np.linalg.svd(jacobian / root)
        return v[-1] / root


def _choose_grid(problem: Collocation, z: Array) -> Collocation | None:
    """A finer or coarser grid, or another stretch, or other breaks, where the flow asks for it."""
    state = problem.state(z)
    decay = tail(problem.grid, state.y + 1e-30)
    place = DEGREES.index(problem.degree)
    if decay > _RESOLVED and place + 1 < len(DEGREES):
        place += 1
    elif decay < _WASTED and place > 0:
        place -= 1
    stretch = default_stretch(problem.model, float(state.mass[0]), float(np.exp(state.surface)))
    off = abs(stretch - problem.stretch) >= _STRETCH_OFF
    other = fit_grid(problem, z, stretch if off else None)
    if other is None:
        return None if DEGREES[place] == problem.degree else replace(problem, degree=DEGREES[place])
    return replace(other, degree=DEGREES[place]) if other.breaks == problem.breaks == WHOLE else other
