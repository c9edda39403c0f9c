"""Functions of one variable, smooth but for known breaks, as piecewise polynomials that are cheap to evaluate with
derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FunctionTable:
    """m functions on [lower, upper], constant outside.

    ``coefficients`` (degree+1, pieces, 2 m) holds functions and derivatives as powers of t, which runs from
    -1 to 1 on each piece. ``error`` (m,) is the largest deviation seen between the nodes. The pieces are equal
    but for those that meet at ``breaks``, where the functions need not be smooth.
    """

    lower: float
    upper: float
    coefficients: Array
    error: Array
    breaks: tuple[float, ...] = ()

    @cached_property
    def edges(self) -> Array:
        """Ends of the pieces (pieces+1,) in units of equal ones; empty where all are equal."""
        return edges_at(self.breaks, self.lower, self.upper, self.coefficients.shape[1])

    @property
    def compiled(self) -> tuple[Array, Array]:
        """What compiled loops evaluate it from: ``coefficients`` and ``edges``."""
        return self.coefficients, self.edges

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Values and derivatives, each (m,) + x.shape; a complex ``x`` belongs to the piece of its real part."""
        degree, pieces, _ = self.coefficients.shape
        scale = pieces / (self.upper - self.lower)
        # fmax and fmin turn a NaN into an end, so that the index exists; whoever made the NaN still has it.
        position = (np.fmin(np.fmax(x, self.lower), self.upper) - self.lower) * scale
        index = np.minimum(position.real.astype(np.intp), pieces - 1)
        if self.edges.size:
            index = np.minimum(np.searchsorted(self.edges[1:], position.real, side="right"), pieces - 1)
            low, high = self.edges[index], self.edges[index + 1]
            t = (2.0 * (position - low) / (high - low) - 1.0)[..., None]
        else:
            t = (2.0 * (position - index) - 1.0)[..., None]
        picked = self.coefficients.take(index, axis=1)
        value = picked[-1]
        for k in range(degree - 2, -1, -1):
            value = value * t
            value += picked[k]
        value = np.moveaxis(value, -1, 0)
        m = len(value) // 2
        return value[:m], value[m:]


def edges_at(breaks: Sequence[float], lower: float, upper: float, pieces: int) -> Array:
    """Ends of ``pieces`` on [lower, upper] in units of equal ones, the nearest moved to each of the ascending
    ``breaks``; empty where there are none."""
    if not len(breaks):
        return np.empty(0)
    edges = np.arange(pieces + 1.0)
    last = 0
    for place in breaks:
        position = (place - lower) * pieces / (upper - lower)
        last = max(round(position), last + 1)
        edges[last] = position
    return edges


def tabulate(
    function: Callable[[Array], Any],
    lower: float,
    upper: float,
    pieces: int,
    degree: int,
    breaks: Sequence[float] = (),
) -> FunctionTable:
    """Interpolate ``function`` (x of shape (k,) to (k, m)) on each piece at Chebyshev points; it may have kinks or
    jumps at the ascending ``breaks``, where pieces meet."""
    points, fit = _chebyshev_fit(degree)
    checks = np.array([-0.97, 0.31])
    edges = edges_at(breaks, lower, upper, pieces)
    width: Any = (upper - lower) / pieces
    middles = lower + width * (np.arange(pieces) + 0.5)
    if edges.size:
        middles = lower + width * 0.5 * (edges[1:] + edges[:-1])
        width = width * np.diff(edges)
    local = np.concatenate([points, checks])
    x = middles[:, None] + 0.5 * np.reshape(width, (-1, 1)) * local
    values = np.asarray(function(x.ravel())).reshape(pieces, len(local), -1)
    coefficients = np.einsum("kj,pjm->kpm", fit, values[:, : degree + 1])
    check = np.einsum("ck,kpm->pcm", checks[:, None] ** np.arange(degree + 1), coefficients)
    error = np.abs(check - values[:, degree + 1 :]).max(axis=(0, 1))
    return FunctionTable(lower, upper, _with_slopes(coefficients, width), error, tuple(breaks))


@lru_cache(maxsize=8)
def _chebyshev_fit(degree: int) -> tuple[Array, Array]:
    """Chebyshev points on [-1, 1] (degree+1,), and the powers of the interpolant for values there, a matrix."""
    points = np.sin(np.pi * np.arange(-degree, degree + 1, 2) / (2 * (degree + 1)))
    to_powers = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        powers = chebyshev.cheb2poly(np.eye(degree + 1)[k])
        to_powers[: len(powers), k] = powers
    return points, to_powers @ np.linalg.inv(chebyshev.chebvander(points, degree))


def antiderivative(table: FunctionTable) -> FunctionTable:
    """The integrals of the functions of ``table`` from its lower end."""
    degree, pieces, twice = table.coefficients.shape
    half: Any = 0.5 * (table.upper - table.lower) / pieces
    if table.edges.size:
        half = half * np.diff(table.edges)
    powers = table.coefficients[:, :, : twice // 2]
    coefficients = np.zeros((degree + 1, pieces, twice // 2), dtype=powers.dtype)
    coefficients[1:] = powers * (np.reshape(half, (-1,)) / np.arange(1, degree + 1)[:, None])[:, :, None]
    start = (coefficients * (-1.0) ** np.arange(degree + 1)[:, None, None]).sum(axis=0)
    gained = coefficients.sum(axis=0) - start
    coefficients[0] = np.cumsum(gained, axis=0) - gained - start
    return FunctionTable(table.lower, table.upper, _with_slopes(coefficients, 2.0 * half), table.error, table.breaks)


def _with_slopes(coefficients: Array, width: Any) -> Array:
    """Coefficients of functions and of their derivatives, for pieces of one ``width`` or of each its own (pieces,)."""
    slopes = np.zeros_like(coefficients)
    orders = np.arange(1, len(coefficients))
    slopes[:-1] = coefficients[1:] * (orders[:, None] * 2.0 / np.reshape(width, (1, -1)))[:, :, None]
    return np.concatenate([coefficients, slopes], axis=2)
