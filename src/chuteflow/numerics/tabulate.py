"""Smooth functions of one variable as piecewise polynomials that are cheap to evaluate with derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Table:
    """m functions on [lower, upper], constant outside.

    ``coefficients`` (degree+1, pieces, 2 m) holds functions and derivatives as powers of t, which runs from
    -1 to 1 on each piece. ``error`` (m,) is the largest deviation seen between the nodes.
    """

    lower: float
    upper: float
    coefficients: Array
    error: Array

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Values and derivatives, each (m,) + x.shape; a complex ``x`` belongs to the piece of its real part."""
        degree, pieces, _ = self.coefficients.shape
        scale = pieces / (self.upper - self.lower)
        # fmax and fmin turn a NaN into an end, so that the index exists; whoever made the NaN still has it.
        position = (np.fmin(np.fmax(x, self.lower), self.upper) - self.lower) * scale
        index = np.minimum(position.real.astype(np.intp), pieces - 1)
        t = (2.0 * (position - index) - 1.0)[..., None]
        picked = self.coefficients.take(index, axis=1)
        value = picked[-1]
        for k in range(degree - 2, -1, -1):
            value = value * t
            value += picked[k]
        value = np.moveaxis(value, -1, 0)
        m = len(value) // 2
        return value[:m], value[m:]


def tabulate(function: Callable[[Array], Any], lower: float, upper: float, pieces: int, degree: int) -> Table:
    """Interpolate ``function`` (x of shape (k,) to (k, m)) on each piece at Chebyshev points."""
    points, fit = _chebyshev_fit(degree)
    checks = np.array([-0.97, 0.31])
    width = (upper - lower) / pieces
    middles = lower + width * (np.arange(pieces) + 0.5)
    local = np.concatenate([points, checks])
    x = middles[:, None] + 0.5 * width * local
    values = np.asarray(function(x.ravel())).reshape(pieces, len(local), -1)
    coefficients = np.einsum("kj,pjm->kpm", fit, values[:, : degree + 1])
    check = np.einsum("ck,kpm->pcm", checks[:, None] ** np.arange(degree + 1), coefficients)
    error = np.abs(check - values[:, degree + 1 :]).max(axis=(0, 1))
    return Table(lower, upper, _with_slopes(coefficients, width), error)


@lru_cache(maxsize=8)
def _chebyshev_fit(degree: int) -> tuple[Array, Array]:
    """Chebyshev points on [-1, 1] (degree+1,), and the powers of the interpolant for values there, a matrix."""
    points = np.sin(np.pi * np.arange(-degree, degree + 1, 2) / (2 * (degree + 1)))
    to_powers = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        powers = chebyshev.cheb2poly(np.eye(degree + 1)[k])
        to_powers[: len(powers), k] = powers
    return points, to_powers @ np.linalg.inv(chebyshev.chebvander(points, degree))


def antiderivative(table: Table) -> Table:
    """The integrals of the functions of ``table`` from its lower end."""
    degree, pieces, twice = table.coefficients.shape
    half = 0.5 * (table.upper - table.lower) / pieces
    powers = table.coefficients[:, :, : twice // 2]
    coefficients = np.zeros((degree + 1, pieces, twice // 2), dtype=powers.dtype)
    coefficients[1:] = powers * (half / np.arange(1, degree + 1))[:, None, None]
    start = (coefficients * (-1.0) ** np.arange(degree + 1)[:, None, None]).sum(axis=0)
    gained = coefficients.sum(axis=0) - start
    coefficients[0] = np.cumsum(gained, axis=0) - gained - start
    return Table(table.lower, table.upper, _with_slopes(coefficients, 2.0 * half), table.error)


def _with_slopes(coefficients: Array, width: float) -> Array:
    slopes = np.zeros_like(coefficients)
    orders = np.arange(1, len(coefficients))
    slopes[:-1] = coefficients[1:] * (orders * 2.0 / width)[:, None, None]
    return np.concatenate([coefficients, slopes], axis=2)
