"""Cubic interpolation through four values at any places."""

from __future__ import annotations

import numpy as np

from chuteflow.numerics.chebyshev import Array


def lagrange(at: Array, x: Array) -> Array:
    """Weights (4, n) of cubic interpolation at ``x`` (n,) from values at ``at`` (4, n)."""
    off = x - at
    weights = np.empty_like(off)
    for i in range(4):
        j, k, m = (other for other in range(4) if other != i)
        numerator = off[j] * off[k] * off[m]
        weights[i] = numerator / ((at[i] - at[j]) * (at[i] - at[k]) * (at[i] - at[m]))
    return weights
