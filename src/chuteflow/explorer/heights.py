"""Heights between which linear interpolation of profiles is accurate."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from chuteflow.numerics.chebyshev import Array

#: Fields (fields, heights) of a flow at heights.
Sampler = Callable[[Array], Array]

#: Largest number of times an interval is halved.
_HALVINGS = 9


def refine_heights(samplers: Sequence[Sampler], heights: Array, tolerance: float) -> tuple[Array, Array]:
    """Refine heights common to several flows; returns them and the fields (flows, fields, heights) there.

    Intervals between ``heights`` are halved until linear interpolation across each is accurate to the fraction
    ``tolerance`` of a field's largest value, at most _HALVINGS times.
    """
    found = np.array([sampler(heights) for sampler in samplers])
    refine = np.ones(len(heights) - 1, dtype=bool)
    for _ in range(_HALVINGS):
        middles = 0.5 * (heights[1:] + heights[:-1])[refine]
        exact = np.array([sampler(middles) for sampler in samplers])
        linear = 0.5 * (found[..., 1:] + found[..., :-1])[..., refine]
        largest = np.abs(found).max(axis=2, keepdims=True)
        inaccurate = (np.abs(exact - linear) > tolerance * largest).any(axis=(0, 1))
        places = np.flatnonzero(refine) + 1
        heights, found = np.insert(heights, places, middles), np.insert(found, places, exact, axis=2)
        # Both halves of a refined interval are checked again.
        halves = np.where(refine, 2, 1)
        refine[refine] = inaccurate
        refine = np.repeat(refine, halves)
        if not inaccurate.any():
            break
    return heights, found
