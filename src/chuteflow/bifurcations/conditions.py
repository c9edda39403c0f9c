"""Which flows of a branch lie on a boundary: scalar conditions with their exact derivatives.

# notation: z unknowns of a flow (n+3,), lambda the second parameter, F(z, lambda) = 0 the steady problem,
# m a macroscopic quantity, eps a step along the imaginary axis.

A condition is a number G(z, lambda) that vanishes on the boundary and is defined off it and off the branch too.

**Folds.** The quantity m turns along a branch where the square matrix A = [F_z; m_z] is singular. With fixed
borders b and c near its null vectors, G and the vectors v and w solve

    [A b; c' 0] [v; G] = [0; 1],      [A' c; b' 0] [w; G] = [0; 1],

and dG = -w' dA v (A. Griewank and G. W. Reddien 1984, SIAM J. Numer. Anal. 21, 176-185; W. Govaerts 2000,
Numerical Methods for Bifurcations of Dynamical Equilibria). Since A holds first derivatives, dA v with
respect to z is the derivative along v of w' A: one evaluation at z + i eps v, exact to rounding. A stays singular
where a branch begins as a point or exchanges its ends with another (F_z loses rank there), and is singular
there for every m: such points are regular points of the curve G = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, Self, cast

import numpy as np

from chuteflow.numerics.chebyshev import (
    AnyGrid,
    Array,
    PiecewiseGrid,
    grid,
    interpolation_matrix,
    piecewise_grid,
    refinement,
)
from chuteflow.numerics.complex_step import derivative, stepped
from chuteflow.numerics.newton import solve_each
from chuteflow.steady.collocation import Collocation, State
from chuteflow.steady.model import LOSS, WORK

#: Degree of the grid on which the largest of a field is searched for, if it is finer than the solution's.
_SAMPLES = 96
#: Borders are renewed where the null vectors, of length 1 along them, are longer.
_TURNED = 1.5
#: Newton steps to the place of a largest value, from the nearest of the samples.
_STEPS = 5


@dataclass(frozen=True, eq=False)
class Linearisation:
    """The steady problem at one point: the ``state`` at (z, lambda), that at (z, lambda + i eps), F and its
    derivatives ``by_z`` (n+2, n+3) and ``by_parameter`` (n+2,)."""

    z: Array
    state: State
    stepped: State
    residual: Array
    by_z: Array
    by_parameter: Array

    @classmethod
    def at(cls, problem: Collocation, stepped: Collocation, z: Array, kinks: Array | None = None) -> Linearisation:
        """Evaluate ``problem``, and ``stepped``, which is the same an imaginary step of the parameter further;
        ``kinks`` (k,) are the derivatives of the pinned kinks with respect to it."""
        state, beyond = problem.state(z), stepped.state(z)
        by_parameter = derivative(beyond.residual())
        if kinks is not None:
            by_parameter[-len(kinks) :] -= kinks
        return cls(z, state, beyond, state.residual(), state.jacobian(), by_parameter)


class TestFunction(Protocol):
    """A condition as it is evaluated along a boundary, and before that along a branch of flows."""

    @property
    def turns(self) -> bool:
        """Whether the boundary is where what :meth:`along_branch` gives turns; else it is where that vanishes."""
        ...

    def along_branch(self, at: Linearisation) -> tuple[float, Array]:
        """A function of the flow, and its gradient in z (n+3,)."""
        ...

    def __call__(self, at: Linearisation) -> tuple[float, Array, float]:
        """G, its gradient in z (n+3,), and its derivative with respect to the parameter."""
        ...

    def suits(self, at: Linearisation) -> bool:
        """Whether it is made for this grid, and well conditioned here."""
        ...

    def adapt_to(self, at: Linearisation) -> TestFunction:
        """The same condition, made for this grid and place."""
        ...


@dataclass(frozen=True, eq=False)
class Fold:
    """Folds of the macroscopic quantity ``which``, with the borders b = ``left`` and c = ``right`` (n+3,).

    Without borders it has to be based somewhere first.
    """

    which: int
    left: Array = field(default_factory=lambda: np.empty(0))
    right: Array = field(default_factory=lambda: np.empty(0))
    turns = True

    def along_branch(self, at: Linearisation) -> tuple[float, Array]:
        """See :class:`TestFunction`."""
        return float(at.state.macroscopic()[self.which]), at.state.macroscopic_gradient()[self.which]

    def __call__(self, at: Linearisation) -> tuple[float, Array, float]:
        """See :class:`TestFunction`."""
        g, v, w = self._solve(at)
        which = self.which
        aside = along(at, v)
        by_z = w @ _border(aside.jacobian(), aside.macroscopic_gradient()[which])
        by_parameter = w @ _border(at.stepped.jacobian(), at.stepped.macroscopic_gradient()[which]) @ v
        return g, -derivative(by_z), -float(derivative(by_parameter))

    def suits(self, at: Linearisation) -> bool:
        """See :class:`TestFunction`."""
        if len(self.left) != len(at.z):
            return False
        _, v, w = self._solve(at)
        return max(float(np.linalg.norm(v)), float(np.linalg.norm(w))) < _TURNED

    def adapt_to(self, at: Linearisation) -> Fold:
        """See :class:`TestFunction`."""
        # The best borders are the singular vectors of the least singular value.
        u, _, v = np.linalg.svd(_border(at.by_z, at.state.macroscopic_gradient()[self.which]))
        return Fold(self.which, u[:, -1], v[-1])

    def pivot(self, at: Linearisation) -> float:
        """Fraction of the gradient of the quantity in the left null vector: 0 where the branch itself is singular."""
        _, _, w = self._solve(at)
        return abs(float(w[-1])) / float(np.linalg.norm(w))

    def _solve(self, at: Linearisation) -> tuple[float, Array, Array]:
        n = len(self.left)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = _border(at.by_z, at.state.macroscopic_gradient()[self.which])
        matrix[:n, n], matrix[n, :n] = self.left, self.right
        side, solved = np.zeros(n + 1), np.empty((2, n + 1))
        side[n] = 1.0
        solved[0], solved[1] = solve_each(matrix, side), solve_each(matrix.T, side)
        right, left = solved
        return float(right[n]), right[:n], left[:n]


class _OfFields:
    """What conditions without borders have in common."""

    turns = False

    def __call__(self, at: Linearisation) -> tuple[float, Array, float]:
        """See :class:`TestFunction`."""
        raise NotImplementedError

    def along_branch(self, at: Linearisation) -> tuple[float, Array]:
        """See :class:`TestFunction`."""
        value, gradient, _ = self(at)
        return value, gradient

    def suits(self, at: Linearisation) -> bool:
        """See :class:`TestFunction`."""
        del at
        return True

    def adapt_to(self, at: Linearisation) -> Self:
        """See :class:`TestFunction`."""
        del at
        return self


@dataclass(frozen=True, eq=False)
class Inversion(_OfFields):
    """Onset of density inversion: the largest p dtheta/dp in the flow, mostly at the base, is 1.

    d ln x/d ln p = 1 - p dtheta/dp, and the density rises with x.
    """

    def __call__(self, at: Linearisation) -> tuple[float, Array, float]:
        """See :class:`TestFunction`."""
        state = at.state
        row = _largest(state.problem.grid, state.rise)
        # Where a largest value lies inside, moving the place changes nothing to first order.
        by_parameter = float(row @ derivative(at.stepped.rise))
        return float(row @ state.rise) - 1.0, row @ state.rise_gradient, by_parameter


@dataclass(frozen=True, eq=False)
class InteriorChange(_OfFields):
    """Change of interior: dissipation minus production, over nu p sqrt(T), is 0 where it is least or ``largest``.

    The flow turns mixed there: from dissipative where the least falls below 0, from productive where the largest
    rises above it. The place is the densest, or one inside, or the surface; where it passes from one of the first
    two to the other the boundary is smooth, where it passes to the surface it has a corner.
    """

    largest: bool

    def __call__(self, at: Linearisation) -> tuple[float, Array, float]:
        """See :class:`TestFunction`."""
        state = at.state
        row = _largest(state.problem.grid, state.net_loss if self.largest else -state.net_loss)
        by_log_x = row * (state.df[LOSS] - state.problem.model.slope**2 * state.df[WORK])
        by_parameter = float(row @ derivative(at.stepped.net_loss))
        return float(row @ state.net_loss), by_log_x @ state.log_x_gradient, by_parameter


@dataclass(frozen=True, eq=False)
class FixedQuantity(_OfFields):
    """The macroscopic quantity ``which``, a logarithm, has a ``value``."""

    which: int
    value: float

    def __call__(self, at: Linearisation) -> tuple[float, Array, float]:
        """See :class:`TestFunction`."""
        which = self.which
        by_parameter = float(derivative(at.stepped.macroscopic()[which]))
        off = float(at.state.macroscopic()[which]) - self.value
        return off, at.state.macroscopic_gradient()[which], by_parameter


def along(at: Linearisation, direction: Array) -> State:
    """The state an imaginary step along a direction (n+3,) of the unknowns: see
    :mod:`chuteflow.numerics.complex_step`."""
    return at.state.problem.state(cast("Array", stepped(at.z, direction)))


def _border(jacobian: Array, gradient: Array) -> Array:
    return np.concatenate([jacobian, gradient[None]])


def _largest(g: AnyGrid, values: Array) -> Array:
    """The row (n+1,) that interpolates nodal values at the place in [0, 1] where ``values`` are largest."""
    if isinstance(g, PiecewiseGrid):
        places = piecewise_grid(tuple(g.breaks.tolist()), 2 * g.piece.degree).nodes
        sampled = interpolation_matrix(g, places) @ values
    else:
        places = grid(max(_SAMPLES, 2 * g.degree)).nodes
        sampled = refinement(g.degree, len(places) - 1) @ values
    k = int(np.argmax(sampled))
    s = float(places[k])
    # At an end of a piece it may be largest without a slope of 0.
    if 0 < k < len(places) - 1 and not (isinstance(g, PiecewiseGrid) and s in g.breaks):
        slope = g.derivative @ values
        bend = g.derivative @ slope
        for _ in range(_STEPS):
            (row,) = interpolation_matrix(g, np.array([s]))
            s = float(np.clip(s - (row @ slope) / (row @ bend), *places[[k - 1, k + 1]]))
    return interpolation_matrix(g, np.array([s]))[0]
