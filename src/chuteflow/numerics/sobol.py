"""Sobol' points, scrambled; any piece of the sequence without what comes before it.

# notation: V_j direction numbers, as integers of BITS bits, the first binary digit highest.

Point n is the exclusive or of those V_j whose j is among the digits of the Gray code of n. The polynomials and first
numbers are those of Joe & Kuo (2008); scrambling is a random linear map of the digits and a random shift
(Matousek 1998).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array

BITS = 52
#: Degree, inner coefficients and first numbers of the second and later dimensions (Joe & Kuo 2008).
_POLYNOMIALS = (
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
    (4, 4, (1, 3, 5, 13)),
    (5, 2, (1, 1, 5, 5, 17)),
)
MOST_DIMENSIONS = len(_POLYNOMIALS) + 1

Whole = NDArray[np.uint64]


class Sobol:
    """The sequence in ``dimensions`` on [0, 1), scrambled by ``seed``, or as it is without one.

    Raises:
        InputError: for more than MOST_DIMENSIONS.
    """

    def __init__(self, dimensions: int, seed: int | None = None) -> None:
        if not 1 <= dimensions <= MOST_DIMENSIONS:
            raise InputError(f"{dimensions} dimensions: must be from 1 to {MOST_DIMENSIONS}")
        self._directions = np.array([_directions(d) for d in range(dimensions)], dtype=np.uint64)
        self._shift = np.zeros(dimensions, dtype=np.uint64)
        if seed is not None:
            source = np.random.default_rng(seed)
            self._directions = np.stack([_mix(source, row) for row in self._directions])
            self._shift = source.integers(0, 1 << BITS, dimensions, dtype=np.uint64)

    def points(self, first: int, last: int) -> Array:
        """The points from number ``first``, counted from 0, to the one before ``last``: (last - first, dimensions)."""
        number = np.arange(first, last, dtype=np.uint64)
        gray = number ^ (number >> np.uint64(1))
        out = np.broadcast_to(self._shift, (number.size, self._shift.size)).copy()
        for j in range(max(last - 1, 1).bit_length()):
            digit = (gray >> np.uint64(j)) & np.uint64(1)
            out ^= digit[:, None] * self._directions[:, j]
        return out.astype(float) * 2.0**-BITS


def _directions(dimension: int) -> list[int]:
    """The direction numbers of one dimension, from 0."""
    if dimension == 0:
        return [1 << (BITS - 1 - j) for j in range(BITS)]
    degree, inner, numbers = _POLYNOMIALS[dimension - 1]
    m = list(numbers)
    for j in range(degree, BITS):
        new = m[j - degree] ^ (m[j - degree] << degree)
        for k in range(1, degree):
            if inner >> (degree - 1 - k) & 1:
                new ^= m[j - k] << k
        m.append(new)
    return [one << (BITS - 1 - j) for j, one in enumerate(m)]


def _mix(source: np.random.Generator, directions: Whole) -> Whole:
    """Direction numbers after a random lower triangular map of their digits, with ones on its diagonal."""
    places = np.arange(BITS - 1, -1, -1, dtype=np.uint64)
    digits = (directions >> places[:, None]) & np.uint64(1)
    lower = np.tril(source.integers(0, 2, (BITS, BITS), dtype=np.uint64), -1) + np.eye(BITS, dtype=np.uint64)
    return ((lower @ digits & np.uint64(1)) << places[:, None]).sum(axis=0, dtype=np.uint64)
