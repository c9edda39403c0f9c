"""Legendre's grids on [0, 1]: nodes, differentiation and quadrature that integrate by parts exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

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


def _last_two(x: Array, n: int) -> tuple[Array, Array]:
    """Legendre's polynomials of degrees n - 1 and n at ``x``."""
    below, top = np.ones_like(x), x
    for k in range(1, n):
        below, top = top, ((2 * k + 1) * x * top - k * below) / (k + 1)
    return below, top
