"""Zeros of many functions at once, each in its bracket."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import Array

_MOST_ITERATIONS = 100


def zeros(
    function: Callable[[NDArray[np.intp], Array], Array],
    low: Array,
    high: Array,
    f_low: Array,
    f_high: Array,
    resolution: float,
    small: float,
) -> Array:
    """The places (n,) where functions vanish, by the method of Chandrupatla (1997).

    ``function(which, x)`` gives the values of the functions ``which`` at x; at ``low`` and ``high`` (n,) they have the
    values ``f_low`` and ``f_high`` of opposite sign. A zero is found when it is known to ``resolution``, or its
    function is below ``small``. Where a function is not finite, its place is NaN.
    """
    a, b, fa, fb = low.copy(), high.copy(), f_low.copy(), f_high.copy()
    t = np.clip(fa / (fa - fb), 0.01, 0.99)
    out = np.where(np.abs(fa) < np.abs(fb), a, b)
    live = np.flatnonzero(np.minimum(np.abs(fa), np.abs(fb)) > small)
    a, b, fa, fb, t = (v[live] for v in (a, b, fa, fb, t))
    for _ in range(_MOST_ITERATIONS):
        if not live.size:
            break
        x = a + t * (b - a)
        f = function(live, x)
        same = (f > 0.0) == (fa > 0.0)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, f
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        out[live] = np.where(np.isfinite(f), best, np.nan)
        width = np.abs(b - a)
        limit = resolution / np.maximum(width, 1e-300)
        going = (limit <= 0.5) & (np.abs(f) > small) & np.isfinite(f)
        with np.errstate(all="ignore"):
            xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
            quadratic = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
            by_three = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        t = np.where(quadratic & np.isfinite(by_three), by_three, 0.5)
        t = np.minimum(np.maximum(t, limit), 1.0 - limit)
        live = live[going]
        a, b, fa, fb, t = (v[going] for v in (a, b, fa, fb, t))
    return out
