"""Legendre's grids on [0, 1]: nodes, differentiation and quadrature that integrate by parts exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import Array

_NEWTON_STEPS = 50


@dataclass(frozen=True)
class LobattoGrid:
    """The ends of [0, 1] and the extrema of Legendre's polynomial of ``degree`` n between them, ascending.

    ``nodes`` (n+1,); ``derivative`` D (n+1, n+1), the exact derivative of the interpolant; ``weights`` w (n+1,)
    of the quadrature of Gauss and Lobatto, exact up to degree 2 n - 1. So w f . D g + w g . D f is f g at 1 less
    f g at 0, for all nodal values f and g.
    """

    nodes: Array
    derivative: Array
    weights: Array

    @property
    def degree(self) -> int:
        """Degree n of the interpolant."""
        return len(self.nodes) - 1


@lru_cache(maxsize=16)
def lobatto(degree: int) -> LobattoGrid:
    """The grid of ``degree`` (Canuto et al. 2006, Spectral Methods: Fundamentals in Single Domains, 2.3).

    Raises:
        ValueError: for a degree below 2.
    """
    if degree < 2:
        raise ValueError(f"degree {degree}: at least 2 is needed")
    n = degree
    x = -np.cos(np.pi * np.arange(n + 1) / n)
    for _ in range(_NEWTON_STEPS):
        below, top = _last_two(x, n)
        step = (x * top - below) / ((n + 1) * top)
        x = x - step
        if np.abs(step).max() < 1e-16:
            break
    x = 0.5 * (x - x[::-1])
    _, top = _last_two(x, n)
    gap = x[:, None] - x
    np.fill_diagonal(gap, 1.0)
    derivative = 2.0 * top[:, None] / top / gap
    np.fill_diagonal(derivative, 0.0)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    nodes, weights = 0.5 * (1.0 + x), 1.0 / (n * (n + 1) * top**2)
    for array in (nodes, derivative, weights):
        array.setflags(write=False)
    return LobattoGrid(nodes, derivative, weights)


@dataclass(frozen=True)
class LobattoPieces:
    """Lobatto's grids on pieces of [0, 1], which share the nodes where they meet.

    ``nodes`` (n,) are those of all pieces, each once; ``at`` (m,) are the nodes of one piece after the other, those
    that two share twice. ``places`` (m,), ``derivative`` D (m, m) and ``weights`` (m,) are of these: functions may have
    a corner where pieces meet, so that derivatives are other ones on either side.
    """

    nodes: Array
    at: NDArray[np.intp]
    places: Array
    derivative: Array
    weights: Array

    @cached_property
    def joints(self) -> NDArray[np.intp]:
        """The places of the last nodes of all pieces but the last, (N-1,)."""
        return np.flatnonzero(self.at[1:] == self.at[:-1])

    def gathered(self, values: Array) -> Array:
        """Sums (..., n) over the nodes of values (..., m) of the pieces."""
        out = np.zeros((*values.shape[:-1], len(self.nodes)), dtype=values.dtype)
        out[..., self.at] = values
        out[..., self.at[self.joints]] = values[..., self.joints] + values[..., self.joints + 1]
        return out


@lru_cache(maxsize=16)
def lobatto_pieces(breaks: tuple[float, ...], degrees: tuple[int, ...]) -> LobattoPieces:
    """Lobatto's grids of ``degrees`` (N,) on the pieces between ``breaks`` (N+1,), which rise from 0 to 1."""
    pieces = [lobatto(degree) for degree in degrees]
    ends = np.cumsum([0, *(degree + 1 for degree in degrees)])
    places, weights, derivative = np.empty(ends[-1]), np.empty(ends[-1]), np.zeros((ends[-1],) * 2)
    for i, piece in enumerate(pieces):
        here, width = slice(ends[i], ends[i + 1]), breaks[i + 1] - breaks[i]
        places[here] = breaks[i] + width * piece.nodes
        places[here.stop - 1] = breaks[i + 1]
        weights[here] = width * piece.weights
        derivative[here, here] = piece.derivative / width
    at = np.arange(ends[-1]) - np.repeat(np.arange(len(pieces)), np.diff(ends))
    kept = np.ones(len(places), dtype=bool)
    kept[ends[1:-1]] = False
    return LobattoPieces(places[kept], at, places, derivative, weights)


def _last_two(x: Array, n: int) -> tuple[Array, Array]:
    """Legendre's polynomials of degrees n - 1 and n at ``x``."""
    below, top = np.ones_like(x), x
    for k in range(1, n):
        below, top = top, ((2 * k + 1) * x * top - k * below) / (k + 1)
    return below, top
