"""Roots of functions of one number, in a bracket: one at a time, or many at once.

scipy.optimize would take longer to import than most of these take to run.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import Array

_MOST_ITERATIONS = 100


def bisect(rising: Callable[[float], float], low: float, high: float, resolution: float = 0.0) -> float:
    """The root of a function that rises from ``low`` to ``high``, by bisection: to the last bit, or to a relative
    ``resolution``."""
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high) or high - low <= resolution * high:
            return middle
        low, high = (low, middle) if rising(middle) > 0.0 else (middle, high)


def secants(
    function: Callable[[float], float],
    bracket: tuple[float, float],
    values: tuple[float, float],
    start: float,
    small: float,
    most: int = 50,
) -> float:
    """The root of ``function`` between the ends of ``bracket``, where it has ``values``, the first below zero and the
    second above: by secants from ``start``, until a value is below ``small`` in size.

    The value at an end of the bracket that stays twice in a row is halved, as in the Illinois method, so that both ends
    move.
    """
    (low, high), (below, above) = bracket, values
    x, side = start, 0
    for _ in range(most):
        value = function(x)
        if value < 0.0:
            low, below, above = x, value, 0.5 * above if side < 0 else above
            side = -1
        else:
            high, above, below = x, value, 0.5 * below if side > 0 else below
            side = 1
        if abs(value) < small or not below < 0.0 < above:
            break
        x = low - below * (high - low) / (above - below)
    return x


def itp_trial(bracket: tuple[float, float], values: tuple[float, float], push: float, radius: float) -> float:
    """Where the ITP method tries next for a root in ``bracket``, where the function has ``values`` of opposite sign.

    That is the place of the secant, pushed towards the middle by ``push`` times the squared width, and no farther than
    ``radius`` from the middle (I. F. D. Oliveira and R. H. C. Takahashi 2020, ACM Trans. Math. Softw. 47, 5).
    """
    width = bracket[1] - bracket[0]
    middle = bracket[0] + 0.5 * width
    secant = bracket[0] - values[0] * width / (values[1] - values[0])
    inward = math.copysign(1.0, middle - secant)
    distance = max(0.0, abs(middle - secant) - push * width * width)
    return middle - inward * min(distance, max(radius, 0.0))


def find_zeros(
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
