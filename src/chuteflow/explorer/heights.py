"""Heights between which linear interpolation of profiles is accurate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from chuteflow.numerics.chebyshev import Array

#: Fields (fields, heights) of a flow at heights.
Sampler = Callable[[Array], Array]

#: Height and fields (1 + fields, k) of a flow at logarithms (k,) of the fraction of the mass that lies above.
OverburdenSampler = Callable[[Array], Array]

#: Where the logarithm is looked at first, down to a fraction so small that nothing lies above, and the number of
#: intervals to begin with.
_SCOUTS, _AT_FIRST = -600.0 * 2.0 ** np.arange(-9.0, 1.0), 16
#: Heights that differ by less than this fraction of the top are one.
_ALIKE = 1e-6
#: Largest number of times an interval is halved.
_HALVINGS = 9


def sample_heights(sample: OverburdenSampler, own: float, top: float, tolerance: float) -> Array:
    """Heights from the base to ``top`` or somewhat above, and fields there, (1 + fields, k), between which linear
    interpolation is accurate to the fraction ``tolerance`` of a field's largest value.

    The flow proper reaches up to ``own``. Points are chosen by the mass above them: fields are known as functions of
    that, and no height has to be looked for.
    """
    heights = sample(_SCOUTS)[0]
    ends = [
        float(_SCOUTS[np.flatnonzero(np.append(heights[:-1] >= height, True))[0]]) for height in (min(own, top), top)
    ]
    parts = (np.linspace(0.0, ends[0], _AT_FIRST + 1), np.log(np.linspace(1.0, np.exp(ends[0]), _AT_FIRST + 1)))
    places = np.unique(np.concatenate([*parts, np.linspace(ends[0], ends[1], _AT_FIRST // 2)]))[::-1]

    def inaccurate(below: Array, above: Array, exact: Array, allowed: Array) -> Any:
        width = above[0] - below[0]
        weight = np.divide(exact[0] - below[0], width, out=np.zeros_like(width), where=width > 0.0)
        linear = below + weight * (above - below)
        return (np.abs(exact - linear) > allowed)[1:].any(axis=0) & (below[0] < top)

    _, found = _halve_intervals(sample, places, tolerance, inaccurate)
    # Close to an interface heights differ by rounding alone.
    apart = np.concatenate([[True], np.diff(found[0]) > _ALIKE * top])
    kept = found[:, apart]
    if kept[0, -1] < top:
        kept = np.concatenate([kept, [[top], *found[1:, -1:]]], axis=1)
    return kept[:, : int(np.searchsorted(kept[0], top)) + 1]


def refine_heights(samplers: Sequence[Sampler], heights: Array, tolerance: float) -> tuple[Array, Array]:
    """Refine heights common to several flows; returns them and the fields (flows, fields, heights) there.

    Intervals between ``heights`` are halved until linear interpolation across each is accurate to the fraction
    ``tolerance`` of a field's largest value, at most _HALVINGS times.
    """

    def sample(places: Array) -> Array:
        return np.array([sampler(places) for sampler in samplers])

    def inaccurate(below: Array, above: Array, exact: Array, allowed: Array) -> Any:
        off = np.abs(exact - 0.5 * (below + above)) > allowed
        return off.reshape(-1, off.shape[-1]).any(axis=0)

    return _halve_intervals(sample, heights, tolerance, inaccurate)


def _halve_intervals(
    sample: Sampler, places: Array, tolerance: float, inaccurate: Callable[..., Any]
) -> tuple[Array, Array]:
    """Places with as many between them as it takes, and the values (..., k) there.

    ``inaccurate`` tells of intervals, by the values at both ends and in their middles and the fraction ``tolerance`` of
    the largest values, which are halved again.
    """
    found = sample(places)
    refine = np.ones(len(places) - 1, dtype=bool)
    for _ in range(_HALVINGS):
        middles = 0.5 * (places[1:] + places[:-1])[refine]
        exact = sample(middles)
        allowed = tolerance * np.abs(found).max(axis=-1, keepdims=True)
        again = inaccurate(found[..., :-1][..., refine], found[..., 1:][..., refine], exact, allowed)
        between = np.flatnonzero(refine) + 1
        places, found = np.insert(places, between, middles), np.insert(found, between, exact, axis=-1)
        # Both halves of a refined interval are checked again.
        halves = np.where(refine, 2, 1)
        refine[refine] = again
        refine = np.repeat(refine, halves)
        if not again.any():
            break
    return places, found
