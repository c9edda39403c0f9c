"""Damped Newton iteration for square systems with exact Jacobians."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np

from chuteflow.numerics.chebyshev import Array


@dataclass(frozen=True)
class NewtonResult:
    """The last iterate ``z``, whether it ``converged``, and the ``iterations`` taken."""

    z: Array
    converged: bool
    iterations: int


def newton(
    system: Callable[[Array], tuple[Array, Array]],
    z: Array,
    *,
    tolerance: float,
    longest_step: float = np.inf,
    max_iterations: int = 40,
) -> NewtonResult:
    """Solve F(z) = 0 from ``z`` (n,), given ``system(z) -> F (n,), dF/dz (n, n)``.

    A step is cut to ``longest_step`` in the max norm, and halved while it does not reduce the norm of F.
    Converged means that the last full step was below ``tolerance``; the iterate then is better than that.
    Non-finite values and singular matrices end the iteration as not converged.
    """
    # Where the iteration runs away, what overflows is found by the checks below.
    with np.errstate(all="ignore"):
        f, jacobian = system(z)
        size = float(np.abs(f).max())
        for iteration in range(1, max_iterations + 1):
            try:
                step = np.linalg.solve(jacobian, -f)
            except np.linalg.LinAlgError:
                return NewtonResult(z, False, iteration)
            step_size = float(np.abs(step).max())
            if not np.isfinite(step_size):
                return NewtonResult(z, False, iteration)
            if step_size < tolerance:
                return NewtonResult(z + step, True, iteration)
            fraction = min(1.0, longest_step / step_size)
            for _ in range(8):
                trial = z + fraction * step
                f_trial, jacobian_trial = system(trial)
                size_trial = float(np.abs(f_trial).max())
                if size_trial < size * (1.0 - 0.1 * fraction) or step_size < 1e-4:
                    break
                fraction *= 0.5
            else:
                return NewtonResult(z, False, iteration)
            z, f, jacobian, size = trial, f_trial, jacobian_trial, size_trial
        return NewtonResult(z, False, max_iterations)


def solve_each(matrices: Array, sides: Array) -> Array:
    """Solve A X = B for matrices (..., n, n) and sides (..., n, m), or for one matrix and one side (n,).

    A member whose matrix is singular gets NaN: with :func:`numpy.linalg.solve` it would end all.
    """
    try:
        return cast(Array, np.linalg.solve(matrices, sides))
    except np.linalg.LinAlgError:
        if matrices.ndim == 2:
            return np.full(sides.shape, np.nan)
        return np.stack([solve_each(matrix, side) for matrix, side in zip(matrices, sides, strict=True)])
