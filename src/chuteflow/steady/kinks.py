"""Elements that end where the density of a flow passes a break of its law.

# notation: s grid coordinate, L = ln x as in chuteflow.steady.model.

A law with a break, such as max(1, .) or a radial distribution function in pieces, is smooth on either side of it. So
is the flow, and polynomials on elements that meet there converge as they do for a smooth law. Where that is depends on
the flow: it is found in a flow that is solved, elements are made to end there, and the flow is solved again. What an
end that is off by d does to the flow is of the order of d^2 where the closures have a kink, so that this settles in a
few rounds.
"""

from __future__ import annotations

import numpy as np

from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import stretch_map
from chuteflow.steady.elements import Elements

#: Ends this close to a crossing of a break, in s, meet it.
MEETS = 1e-13
#: Ends farther from a crossing do not meet it, even if no round brings them nearer.
NEAR = 1e-6
#: An end that is not at a crossing gives way to one within this part of the element beside it.
_GIVES_WAY = 0.3
#: Rounds of the method of false position.
_ROUNDS = 60


def crossings(flow: Elements) -> Array:
    """The places s in (0, 1), ascending, at which the density of ``flow`` passes a break of the law."""
    kinks = flow.model.kinks
    if not kinks.size:
        return kinks
    # The ends of elements that meet a break already are on neither side of it.
    s = flow.inner_places
    level = _log_x(flow, s)
    found = []
    for kink in kinks.tolist():
        off = level - kink
        for i in np.flatnonzero((off[1:] >= 0.0) != (off[:-1] >= 0.0)).tolist():
            found.append(_crossing(flow, kink, (float(s[i]), float(off[i])), (float(s[i + 1]), float(off[i + 1]))))
    return np.unique(found)


def distance(flow: Elements, places: Array) -> float:
    """How far the farthest of ``places`` is from an end of an element."""
    if not places.size:
        return 0.0
    return float(np.abs(places[:, None] - flow.breaks).min(axis=1).max())


def with_ends(flow: Elements, places: Array) -> Elements:
    """The polynomials of ``flow`` on elements of which some end at ``places``."""
    breaks = flow.breaks
    length = np.diff(breaks)
    for place in places.tolist():
        beside = length[min(max(int(np.searchsorted(breaks, place)) - 1, 0), len(length) - 1)]
        near = np.abs(breaks - place) < _GIVES_WAY * beside
        near[[0, -1]] = False
        breaks = np.sort(np.append(breaks[~near | np.isin(breaks, places)], place))
        breaks = np.unique(breaks)
        length = np.diff(breaks)
    return flow.on(breaks)


def _log_x(flow: Elements, s: Array) -> Array:
    fraction, _ = stretch_map(s, flow.stretch)
    p = np.exp(flow.log_mass) * fraction + flow.model.surface_stress
    return (1.0 + flow.model.beta) * np.log(np.maximum(p, 1e-300)) - flow.at(s)[:, 0]


def _crossing(flow: Elements, kink: float, low: tuple[float, float], high: tuple[float, float]) -> float:
    """The zero of L - kink between two places with their values, by false position with the Illinois rule."""
    (a, f_a), (b, f_b) = low, high
    side, place = 0, a
    for _ in range(_ROUNDS):
        before, place = place, (a * f_b - b * f_a) / (f_b - f_a)
        value = float(_log_x(flow, np.array([place]))[0]) - kink
        if value == 0.0 or abs(place - before) < 0.1 * MEETS or b - a < 0.1 * MEETS:
            break
        if (value >= 0.0) == (f_b >= 0.0):
            b, f_b, f_a = place, value, 0.5 * f_a if side == 1 else f_a
            side = 1
        else:
            a, f_a, f_b = place, value, 0.5 * f_b if side == -1 else f_b
            side = -1
    return place
