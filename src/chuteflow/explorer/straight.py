"""Heights between which straight lines show fields as they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from chuteflow.numerics.chebyshev import Array

#: Fields (fields, heights) of a flow at heights.
Sampler = Callable[[Array], Array]

#: How often intervals are halved at most.
_HALVINGS = 9


def straight_heights(samplers: Sequence[Sampler], heights: Array, off: float) -> tuple[Array, Array]:
    """Heights common to several flows, and their fields (flows, fields, heights) there.

    Intervals between ``heights`` are halved until a straight line across each is wrong by the share ``off`` of a
    field's largest value at most.
    """
    found = np.array([sampler(heights) for sampler in samplers])
    bends = np.ones(len(heights) - 1, dtype=bool)
    for _ in range(_HALVINGS):
        middles = 0.5 * (heights[1:] + heights[:-1])[bends]
        exact = np.array([sampler(middles) for sampler in samplers])
        straight = 0.5 * (found[..., 1:] + found[..., :-1])[..., bends]
        largest = np.abs(found).max(axis=2, keepdims=True)
        still = (np.abs(exact - straight) > off * largest).any(axis=(0, 1))
        places = np.flatnonzero(bends) + 1
        heights, found = np.insert(heights, places, middles), np.insert(found, places, exact, axis=2)
        # Both halves of an interval that bends are looked at again, the others are done.
        halves = np.where(bends, 2, 1)
        bends[bends] = still
        bends = np.repeat(bends, halves)
        if not still.any():
            break
    return heights, found
