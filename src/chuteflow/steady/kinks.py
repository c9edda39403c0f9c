"""Elements that end where the density of a flow passes a break of its law.

# notation: s grid coordinate, L = ln x as in chuteflow.steady.model.

A law with a break, such as max(1, .) or a radial distribution function in pieces, is smooth on either side of it. So
is the flow, and polynomials on elements that meet there converge as they do for a smooth law. Where that is depends on
the flow: it is found in a flow that is solved, elements are made to end there, and the flow is solved again. What an
end that is off by d does to the flow is of the order of d^2 where the closures have a kink, so that this settles in a
few rounds.
"""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.elements import Elements

#: Ends this close to a crossing of a break, in s, meet it.
MEETS = 1e-13
#: Where the closures have no jump there, an end that is off by d changes the flow by the order of d^2.
JOINS = 1e-8
#: Ends farther from a crossing do not meet it, even if no round brings them nearer.
NEAR = 1e-6
#: An end that is not at a crossing gives way to one within this part of the element beside it.
_GIVES_WAY = 0.3


def crossings(flow: Elements) -> Array:
    """The places s in (0, 1), ascending, at which the density of ``flow`` passes a break of the law."""
    kinks = flow.model.kinks
    if not kinks.size:
        return kinks
    # The ends of elements that meet a break already are on neither side of it.
    found = flow.crossings(kinks, 0.1 * MEETS)
    return np.unique(found) if found.size > 1 else found


def distance(flow: Elements, places: Array) -> float:
    """How far the farthest of ``places`` is from an end of an element."""
    if not places.size:
        return 0.0
    return float(np.abs(places[:, None] - flow.breaks).min(axis=1).max())


def with_ends(flow: Elements, places: Array) -> Elements:
    """The polynomials of ``flow`` on elements of which some end at ``places``."""
    if not places.size:
        return flow
    breaks: list[float] = flow.breaks.tolist()
    wanted = places.tolist()
    for place in wanted:
        k = min(max(bisect_left(breaks, place), 1), len(breaks) - 1)
        near = _GIVES_WAY * (breaks[k] - breaks[k - 1])
        low, high = k, k
        while low > 1 and place - breaks[low - 1] < near:
            low -= 1
        while high < len(breaks) - 1 and breaks[high] - place < near:
            high += 1
        breaks[low:high] = sorted({place, *(b for b in breaks[low:high] if b in wanted)})
    return flow.on(np.array(breaks))


def meets(flow: Elements) -> float:
    """How close an end of an element has to be to a crossing."""
    return JOINS if flow.model.kinks_join else MEETS
