"""Where quantities that are known at the points of a rough path alone turn, or pass zero and come back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chuteflow.numerics.chebyshev import Array


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
    slope = np.gradient(values, at)
    length = np.diff(at)
    d0, d1 = slope[:-1] * length * np.sign(values[:-1]), slope[1:] * length * np.sign(values[:-1])
    out = []
    turning_back = (values[1:] * values[:-1] > 0.0) & (d0 < 0.0) & (d1 > 0.0)
    if passing:
        # A cubic lies above its coefficients in Bernstein's form.
        size = np.abs(values)
        turning_back &= np.minimum(size[:-1] + d0 / 3.0, size[1:] - d1 / 3.0) < 0.0
    for i in np.flatnonzero(turning_back).tolist():
        (f0, f1), sign = np.abs(values[i : i + 2]), np.sign(values[i])
        cubic = np.array([2.0 * (f0 - f1) + d0[i] + d1[i], 3.0 * (f1 - f0) - 2.0 * d0[i] - d1[i], d0[i], f0])
        turning, zeros = np.roots(np.polyder(cubic)).real, np.roots(cubic)
        share = min(turning[(turning > 0.0) & (turning < 1.0)], key=lambda x: np.polyval(cubic, x), default=0.5)
        lowest = float(np.polyval(cubic, share))
        inside = zeros.real[(zeros.imag == 0.0) & (zeros.real > 0.0) & (zeros.real < 1.0)] if lowest < 0.0 else ()
        out.append(Extremum(i, float(share), sign * lowest, tuple(sorted(map(float, inside)))))
    return out
