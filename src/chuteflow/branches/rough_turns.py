"""Where quantities that are known at the points of a rough path alone turn, or pass zero and come back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.compiled import compiled


@dataclass(frozen=True, eq=False)
class Extremum:
    """A step of a path between two values of one sign: the cubic with slopes by differences comes nearest to zero, or
    passes it furthest, at the ``share`` of the step, where it has the ``value``, with ``zeros`` to either side if it
    passes it."""

    step: int
    share: float
    value: float
    zeros: tuple[float, ...]


def find_extrema(values: Array, at: Array, *, passing: bool = False) -> list[Extremum]:
    """The steps between the places ``at`` (k,) of a path in which ``values`` (k,) turn towards zero, and away again;
    ``passing`` zero alone, or all."""
    if len(values) < 3:
        return []
    steps, slopes = _turning_back(values, at, passing)
    out = []
    for i, (d0, d1) in zip(steps.tolist(), slopes.tolist(), strict=True):
        (f0, f1), sign = np.abs(values[i : i + 2]), np.sign(values[i])
        cubic = np.array([2.0 * (f0 - f1) + d0 + d1, 3.0 * (f1 - f0) - 2.0 * d0 - d1, d0, f0])
        turning, zeros = np.roots(np.polyder(cubic)).real, np.roots(cubic)
        share = min(turning[(turning > 0.0) & (turning < 1.0)], key=lambda x: np.polyval(cubic, x), default=0.5)
        lowest = float(np.polyval(cubic, share))
        inside = zeros.real[(zeros.imag == 0.0) & (zeros.real > 0.0) & (zeros.real < 1.0)] if lowest < 0.0 else ()
        out.append(Extremum(i, float(share), float(sign) * lowest, tuple(sorted(map(float, inside)))))
    return out


@compiled
def _turning_back(values: Any, at: Any, passing: bool) -> tuple[Any, Any]:
    """The steps between the places ``at`` in which ``values`` turn towards zero, and the slopes (k, 2) of their size at
    the ends of these per step; those that may be ``passing`` zero alone, or all."""
    n = len(values)
    slope = np.empty(n)
    slope[0] = (values[1] - values[0]) / (at[1] - at[0])
    slope[n - 1] = (values[n - 1] - values[n - 2]) / (at[n - 1] - at[n - 2])
    for i in range(1, n - 1):
        one, two = at[i] - at[i - 1], at[i + 1] - at[i]
        slope[i] = (one * one * values[i + 1] + (two * two - one * one) * values[i] - two * two * values[i - 1]) / (
            one * two * (one + two)
        )
    steps, slopes = np.empty(n, np.int64), np.empty((n, 2))
    found = 0
    for i in range(n - 1):
        sign = np.sign(values[i])
        d0, d1 = slope[i] * (at[i + 1] - at[i]) * sign, slope[i + 1] * (at[i + 1] - at[i]) * sign
        turning = values[i + 1] * values[i] > 0.0 and d0 < 0.0 and d1 > 0.0
        # A cubic lies above its coefficients in Bernstein's form.
        if turning and not (passing and min(abs(values[i]) + d0 / 3.0, abs(values[i + 1]) - d1 / 3.0) >= 0.0):
            steps[found] = i
            slopes[found, 0], slopes[found, 1] = d0, d1
            found += 1
    return steps[:found], slopes[:found]
