"""The grids on which boundaries are followed: pieces of them meet where a flow passes a break of its law.

# notation: z unknowns of a flow, r reference coordinate, d unknowns of the pinned breaks, as in
# chuteflow.steady.collocation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from chuteflow.numerics.chebyshev import Array, interpolation_matrix
from chuteflow.steady.collocation import WHOLE, Collocation, stretch_map, stretch_position

#: A break is at a kink of the law where ln x is as near to it.
_AT_KINK = 1e-6
#: The degree on each piece where a grid in one piece is divided.
_PIECE = 24
#: Pieces are not shorter than this: what a flow is beyond a kink in a shorter one does not show.
_SHORTEST = 1e-5
#: Pieces shorter than this part of one beside them are joined to it, where no break is pinned between them.
_SLIVER = 0.2
#: Pinned breaks are placed again where they have moved by this part of the shorter piece beside them.
_MOVED = 0.1


def pin(problem: Collocation, z: Array) -> tuple[Collocation, Array]:
    """A solved flow with the breaks of its grid pinned that lie where it passes kinks of the law."""
    if problem.pins or problem.breaks == WHOLE or not problem.model.kinks.size:
        return problem, z
    nodes = np.arange(1, len(problem.breaks) - 1) * problem.degree
    off = np.log(problem.state(z).x[nodes])[:, None] - problem.model.kinks
    kink = np.abs(off).argmin(axis=1)
    pins = [(i + 1, int(kink[i])) for i in range(len(nodes)) if abs(off[i, kink[i]]) < _AT_KINK]
    return replace(problem, pins=tuple(pins)), np.concatenate([z[:-2], np.zeros(len(pins)), z[-2:]])


def unpin(problem: Collocation, z: Array) -> tuple[Collocation, Array]:
    """The flow on a grid whose pieces meet where the pinned breaks are, which stay there from now on."""
    if not problem.pins:
        return problem, z
    other = replace(problem, breaks=_places(problem, z), pins=())
    return other, transfer(problem, z, other)


def fit_grid(problem: Collocation, z: Array, stretch: float | None = None) -> Collocation | None:
    """The grid that a flow asks for: with the pieces that meet where it passes kinks of the law now, and of another
    ``stretch``; None where it is on that already."""
    found = _crossings(problem, z)
    same = [kink for _, kink in found] == [kink for _, kink in problem.pins]
    if same and stretch is None and not _has_moved(problem, z):
        return None
    old = _places(problem, z)
    kept = [place for i, place in enumerate(old[1:-1], 1) if i not in {index for index, _ in problem.pins}]
    new = problem.stretch if stretch is None else stretch

    def placed(place: float) -> float:
        return float(stretch_position(stretch_map(np.array(place), problem.stretch)[0], new))

    at = [(placed(place), kink) for place, kink in found]
    breaks = sorted({*(place for place, _ in at), *_apart([placed(place) for place in kept], [p for p, _ in at])})
    whole = (0.0, *breaks, 1.0)
    degree = problem.degree if problem.breaks != WHOLE or whole == WHOLE else _PIECE
    pins = tuple((whole.index(place), kink) for place, kink in at)
    return Collocation(problem.model, degree, new, whole, pins)


def transfer(problem: Collocation, v: Array, other: Collocation, at: Array | None = None) -> Array:
    """Unknowns ``v`` on another grid, or a direction where ``at`` are the unknowns there it is one."""
    nodes, z = len(problem.grid.nodes), v if at is None else at
    target = stretch_position(stretch_map(other.grid.nodes, other.stretch)[0], problem.stretch)
    r = _reference(problem, z, target)
    g = interpolation_matrix(problem.grid, r) @ v[:nodes]
    moves = v[nodes:-2] if at is not None and len(other.pins) == len(problem.pins) else np.zeros(len(other.pins))
    return np.concatenate([g, moves, v[-2:]])


def _places(problem: Collocation, z: Array) -> tuple[float, ...]:
    """Where the breaks of the grid are."""
    r = np.array(problem.breaks)
    if problem.pins:
        r = r + np.real(z[len(problem.grid.nodes) : -2]) @ problem.shapes_at(r)[0]
    return (0.0, *r[1:-1].tolist(), 1.0)


def _has_moved(problem: Collocation, z: Array) -> bool:
    length = np.diff(problem.breaks)
    shorter = np.array([min(length[index - 1], length[index]) for index, _ in problem.pins])
    return bool((np.abs(z[len(problem.grid.nodes) : -2]) > _MOVED * shorter).any())


def _reference(problem: Collocation, z: Array, s: Array) -> Array:
    """The r at places ``s`` (m,), by Newton's method."""
    if not problem.pins:
        return s
    d, r = np.real(z[len(problem.grid.nodes) : -2]), s.copy()
    for _ in range(30):
        value, slope = problem.shapes_at(r)
        step = (s - r - d @ value) / (1.0 + d @ slope)
        r = np.clip(r + step, 0.0, 1.0)
        if np.abs(step).max() < 1e-15:
            break
    return r


def _crossings(problem: Collocation, z: Array) -> list[tuple[float, int]]:
    """Where in s the density passes kinks of the law, ascending, and which."""
    kinks = problem.model.kinks
    if not kinks.size:
        return []
    fine = replace(problem, degree=2 * problem.degree)
    r = np.unique(np.concatenate([fine.grid.nodes, problem.grid.nodes]))
    matrix = interpolation_matrix(problem.grid, r)
    state = problem.state(z)
    # ln x near the surface of a half-line is none.
    level = matrix @ np.log(np.maximum(np.real(state.x), np.exp(kinks[0] - 5.0)))
    pinned_at = {problem.breaks[index]: kink for index, kink in problem.pins}
    found = []
    for k, kink in enumerate(kinks.tolist()):
        off = level - kink
        # At a pinned break the flow passes: its sign there is rounding.
        away = np.array([pinned_at.get(place) != k for place in r.tolist()])
        at, above = r[away], off[away] > 0.0
        for i in np.flatnonzero(above[1:] != above[:-1]).tolist():
            between = [place for place in pinned_at if at[i] <= place <= at[i + 1] and pinned_at[place] == k]
            fraction = off[away][i] / (off[away][i] - off[away][i + 1])
            found.append((between[0] if between else float(at[i] + fraction * (at[i + 1] - at[i])), k))
    if problem.pins:
        places = np.array([place for place, _ in found])
        moved = places + np.real(z[len(problem.grid.nodes) : -2]) @ problem.shapes_at(places)[0] if found else places
        found = [(float(place), kink) for place, (_, kink) in zip(moved, found, strict=True)]
    found = [(place, kink) for place, kink in sorted(found) if _SHORTEST < place < 1.0 - _SHORTEST]
    i = 1
    while i < len(found):
        if found[i][0] - found[i - 1][0] > _SHORTEST:
            i += 1
        elif found[i][1] == found[i - 1][1]:
            # A flow that passes a kink for a moment alone does as if it did not.
            del found[i - 1 : i + 1]
        else:
            del found[i]
    return found


def _apart(places: list[float], pins: list[float]) -> list[float]:
    """Those of the breaks that are not pinned that are far enough from those that are."""
    ends = np.array([0.0, *pins, 1.0])
    kept = []
    for place in places:
        k = int(np.searchsorted(ends, place))
        if min(place - ends[k - 1], ends[k] - place) > _SLIVER * (ends[k] - ends[k - 1]) or len(pins) == 0:
            kept.append(place)
    return kept
