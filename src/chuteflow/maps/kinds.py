"""What flows a base has on a fan: how many, of which kinds, and in how many families.

# notation: B the heat flux of a trajectory less that which the base gives, whose zeros are the flows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from chuteflow.branches.counting import most_at_once
from chuteflow.branches.rough_turns import dips
from chuteflow.maps.fan import (
    EXCESS,
    GRIPPED,
    HEAT_FLUX,
    LOG_GLIDE,
    LOG_MASS,
    LOG_SLIP,
    NET_HIGH,
    NET_LOW,
    OF_FLUX,
    OF_GLIDE,
    OF_SLIP,
    STEEPEST,
    SURE_HIGH,
    SURE_LOW,
    SURE_STEEP,
    Base,
    Fan,
    lagrange,
)
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady import kinds as flow_kinds

#: Bits of the kinds that are present among the flows of a chute.
INTERIORS = {name: 1 << i for i, name in enumerate(flow_kinds.INTERIORS)}
DENSITIES = {name: 1 << i for i, name in enumerate(flow_kinds.DENSITIES)}
#: Turns of ln Q along a family are told apart if they differ by more.
_TURN = 1e-6
#: A net loss below this share of the largest is none, and more of it for hold-ups that are not small against the
#: second number: deep grains, in balance, come near to it. A rise of the density below the third, for each unit of
#: hold-up, is none either.
_BALANCE, _DEEP, _RISE = 2e-3, 5.0, 1.5e-3
#: Closed lines that span fewer columns and rows are none; those that span more are, wherever they are; those in
#: between only so many columns or rows beside other lines.
_SMALLEST_LOOP, _SMALL_LOOP, _BESIDE = 1.5, 6.0, 8.0
#: Points of a family that lie nearer, in steps of the grid, say nothing more.
_NEAR = 0.3
#: Cubic interpolation is used where neighbouring steps of the grid differ by less than this factor.
_EVEN = 12.0
#: Weights of a cubic whose sizes sum to more extrapolate.
_SOUND = 3.0


@dataclass(frozen=True)
class Kinds:
    """The flows of one chute in the range searched.

    ``at`` tells whether there is one at each temperature asked for; ``most`` is the largest number at one flux;
    ``families`` the number of families (connected sets of flows); ``interior`` and ``density`` the bits of
    INTERIORS and DENSITIES that are present.
    """

    at: tuple[bool, ...]
    most: int
    families: int
    interior: int
    density: int


def kinds(fan: Fan, base: Base) -> Kinds:
    """The kinds of the flows that ``base`` has on ``fan``."""
    excess = fan.of_base(base)
    at = _exists(excess[:, fan.place])
    lines = _families([np.asarray(line) for line in contour_generator(z=excess).lines(0.0)])
    if not lines:
        return Kinds(at, 0, 0, 0, 0)
    chains = [_selected(line) for line in lines]
    zeros = _at_zeros(fan, excess, np.concatenate(chains))
    fields = zeros.fields
    slip = np.maximum(fields[HEAT_FLUX] + base.loss, 1e-300) / fan.slope
    log_flux = np.logaddexp(fields[LOG_SLIP] + np.log(slip), fields[LOG_GLIDE])
    rise = _rise(fan, base, zeros, np.exp(fields[LOG_SLIP] - log_flux) * slip)
    ends = np.cumsum([len(chain) for chain in chains])
    pieces, interior, density = [], 0, 0
    for first, last in zip(ends - [len(chain) for chain in chains], ends, strict=True):
        part = slice(first, last)
        pieces.append(_monotonic_pieces(zeros.log_t[part], fields[LOG_MASS, part], log_flux[part], rise[part]))
        holdup = np.exp(fields[LOG_MASS, part])
        interior |= _interiors(fields[:, part], zeros.doubt[:, part], holdup)
        density |= _densities(fields[:, part], zeros.doubt[2, part], holdup)
    return Kinds(at, most_at_once(np.concatenate(pieces), _TURN), len(chains), interior, density)


def _families(lines: list[Array]) -> list[Array]:
    """The lines (k, 2) that are families of their own.

    Interpolation makes a loop of a dip that stops short of zero, and a string of beads of a tongue of a family that
    is narrower than the grid: small loops beside other lines are no families.
    """
    extent = [float(np.ptp(line, axis=0).max()) if _is_closed(line) else np.inf for line in lines]
    large = [line for line, size in zip(lines, extent, strict=True) if size > _SMALL_LOOP and len(line) > 1]
    small = [line for line, size in zip(lines, extent, strict=True) if _SMALLEST_LOOP < size <= _SMALL_LOOP]
    beads: list[Array] = [line for line, size in zip(lines, extent, strict=True) if size <= _SMALLEST_LOOP]
    while beside := [line for line in small if any(_are_near(line, other) for other in (*large, *beads))]:
        beads += beside
        small = [line for line in small if not any(line is other for other in beside)]
    return large + small


def _is_closed(line: Array) -> bool:
    return bool((line[0] == line[-1]).all())


def _are_near(loop: Array, line: Array) -> bool:
    off = np.abs(line - loop.mean(axis=0))
    return bool(((off[:, 0] < _BESIDE) & (off[:, 1] < _BESIDE)).any())


def _rise(fan: Fan, base: Base, zeros: _Zeros, slipping: Array) -> Array:
    """Derivative of ln Q along the zero set, to a factor of one sign on each line; ``slipping`` is the share of
    the flux at the slip velocity."""
    size = np.abs(zeros.down).sum(axis=0) + np.abs(zeros.across).sum(axis=0)
    slopes = []
    for of in (zeros.down, zeros.across):
        flux = slipping * (of[OF_SLIP] + of[OF_FLUX] / np.maximum(zeros.fields[HEAT_FLUX] + base.loss, 1e-300))
        slopes.append((flux + (1.0 - slipping) * of[OF_GLIDE], of[EXCESS] + base.weight * of[GRIPPED]))
    (flux_down, excess_down), (flux_across, excess_across) = slopes
    return (flux_across * excess_down - flux_down * excess_across) / size


def _exists(excess: Array) -> tuple[bool, ...]:
    """Whether columns (K, T) have a zero, also between rows, where a parabola through three has one."""
    positive = excess > 0.0
    found = positive.any(axis=0) & ~positive.all(axis=0)
    size = np.abs(excess)
    before, here, after = size[:-2], size[1:-1], size[2:]
    bend = before - 2.0 * here + after
    dip = (here <= before) & (here <= after) & (bend > 0.0)
    lowest = here - (after - before) ** 2 / (8.0 * np.where(dip, bend, 1.0))
    found |= (dip & (lowest < 0.0)).any(axis=0)
    return tuple(map(bool, np.atleast_1d(found).tolist()))


def _selected(line: Array) -> Array:
    """Of the vertices (k, 2) of a line in columns and rows, those on the edges that it crosses more squarely."""
    ahead = np.empty_like(line)
    ahead[1:-1] = line[2:] - line[:-2]
    ahead[0], ahead[-1] = line[1] - line[0], line[-1] - line[-2]
    on_column = line[:, 0] == np.rint(line[:, 0])
    keep = on_column == (np.abs(ahead[:, 0]) >= 0.7 * np.abs(ahead[:, 1]))
    keep[[0, -1]] = True
    kept = line[keep]
    while len(kept) > 3:
        near = np.hypot(*np.diff(kept, axis=0).T) < _NEAR
        near[1:] &= ~near[:-1]
        drop = np.flatnonzero(near) + 1
        drop = np.where(drop == len(kept) - 1, drop - 1, drop)
        if not drop.size:
            break
        kept = np.delete(kept, drop, axis=0)
    return kept


@dataclass(frozen=True, eq=False)
class _Zeros:
    """What there is at k points of the zero set: ``fields`` (10, k), ``down`` and ``across`` (5, k) of a fan there,
    ``log_t`` (k,), and how far the net losses and the largest v are in ``doubt`` (3, k)."""

    fields: Array
    down: Array
    across: Array
    log_t: Array
    doubt: Array


def _at_zeros(fan: Fan, excess: Array, line: Array) -> _Zeros:
    """What ``fan`` has at vertices (k, 2) on edges of the grid.

    The zero on an edge is that of the cubic through four values in line with it, where the grid is even enough.
    """
    column, row = np.floor(line).astype(np.intp).T
    on_column = line[:, 0] == column
    share = np.where(on_column, line[:, 1] - row, line[:, 0] - column)
    _rows, columns = excess.shape
    start = np.where(on_column, row, column)
    # Of four values in line, where possible two to each side.
    first = np.clip(start - 1, 0, np.where(on_column, fan.last[column], columns - 1) - 3)
    aside = np.clip(start - first, 0, 2)
    along = first + np.arange(4)[:, None]
    r, c = np.where(on_column, along, row), np.where(on_column, column, along)
    widths = np.where(on_column, np.diff(fan.log_mass[r, c], axis=0), fan.gaps[np.minimum(c[:3], columns - 2)])
    here = np.arange(len(line))
    unit = widths[aside, here]
    even = (widths > unit / _EVEN).all(axis=0) & (widths < unit * _EVEN).all(axis=0) & (start - first == aside)
    values = excess[r, c]
    weights = np.zeros(values.shape)
    weights[aside, here], weights[aside + 1, here] = 1.0 - share, share
    if even.any():
        at = np.concatenate([np.zeros((1, len(line))), np.cumsum(widths, axis=0)])[:, even] / unit[even]
        low = at[aside[even], np.arange(at.shape[1])]
        cubic = lagrange(at, _zero_of_cubic(at, values[:, even], low, low + share[even]))
        # Between the inner two of four values these weights are small; a cubic without a zero there has none.
        sound = np.abs(cubic).sum(axis=0) < _SOUND
        even[even] = sound
        weights[:, even] = cubic[:, sound]
    values = fan.fields[:, r, c]
    fields = (values * weights).sum(axis=1)
    # Where there is no cubic, half of what lies between the ends of an edge; else what the cubic differs by.
    doubtful = slice(NET_LOW, STEEPEST + 1)
    ends = values[doubtful, aside, here], values[doubtful, aside + 1, here]
    chord = ends[0] + share * (ends[1] - ends[0])
    doubt = np.where(even, np.abs(fields[doubtful] - chord), 0.5 * np.abs(ends[1] - ends[0]))
    log_t = fan.spacing * np.append(0.0, np.cumsum(fan.gaps))
    pair = r[aside, here], c[aside, here], r[aside + 1, here], c[aside + 1, here]

    def along_edge(of: Array) -> Array:
        start, stop = of[:, pair[0], pair[1]], of[:, pair[2], pair[3]]
        return start + share * (stop - start)

    return _Zeros(fields, along_edge(fan.down), along_edge(fan.across), (log_t[c] * weights).sum(axis=0), doubt)


def _zero_of_cubic(at: Array, values: Array, low: Array, x: Array) -> Array:
    """Where between ``low`` and ``low`` + 1 the cubic through ``values`` (4, n) at ``at`` vanishes.

    By regula falsi from ``x``; a cubic without change of sign there leaves it at an end.
    """
    high = low + 1.0
    f_low, f_high = ((lagrange(at, end) * values).sum(axis=0) for end in (low, high))
    for _ in range(3):
        f = (lagrange(at, x) * values).sum(axis=0)
        left = (f > 0.0) == (f_low > 0.0)
        low, f_low = np.where(left, x, low), np.where(left, f, f_low)
        high, f_high = np.where(left, high, x), np.where(left, f_high, f)
        span = f_high - f_low
        x = low - f_low * (high - low) / np.where(span != 0.0, span, 1.0)
    return x


def _monotonic_pieces(log_t: Array, log_m: Array, log_q: Array, rise: Array) -> Array:
    """Lowest and highest ln Q (pieces, 2) of the stretches of a family between turns of Q, where ``rise`` changes
    sign."""
    length = np.hypot(np.diff(log_t), np.diff(log_m))
    keep = np.append(True, length > 1e-9)
    log_q, rise, at = log_q[keep], rise[keep], np.cumsum(np.append(0.0, length))[keep]
    before, share = _changes(rise, at)
    stops = log_q[[0, -1]]
    if before.size:
        turns = at[before] + (at[before + 1] - at[before]) * share
        if len(at) > 3:
            around = np.clip(before - 1, 0, len(at) - 4) + np.arange(4)[:, None]
            turned = (lagrange(at[around], turns) * log_q[around]).sum(axis=0)
        else:
            turned = np.interp(turns, at, log_q)
        along = np.sign(float(((rise[1:] + rise[:-1]) * np.diff(log_q)).sum()))
        first = along if rise[0] > 0.0 else -along
        stops = np.array(_confirmed([log_q[0], *turned, log_q[-1]], first))
    ends = np.stack([stops[:-1], stops[1:]], axis=1)
    return np.sort(ends, axis=1)


def _changes(rise: Array, at: Array) -> tuple[NDArray[np.intp], Array]:
    """The steps in which ``rise`` changes sign, and the shares of them at which it does so; a step in which it passes
    zero twice, as just beyond a cusp, is there twice."""
    changes = np.flatnonzero((rise[1:] > 0.0) != (rise[:-1] > 0.0))
    pairs = [(dip.step, zero) for dip in dips(rise, at) if len(dip.zeros) == 2 for zero in dip.zeros]
    steps = np.concatenate([changes, np.array([step for step, _ in pairs], dtype=np.intp)])
    shares = np.concatenate(
        [rise[changes] / (rise[changes] - rise[changes + 1]), np.array([share for _, share in pairs], dtype=float)]
    )
    order = np.lexsort((shares, steps))
    return steps[order], shares[order]


def _confirmed(stops: list[float], rises: float) -> list[float]:
    """Values at the ends and turns of a family without those turns between which it does not turn.

    It ``rises`` first (1), or falls (-1), and so on in turn.
    """
    stops = list(stops)
    i = 0
    while len(stops) > 2 and i < len(stops) - 1:
        if (stops[i + 1] - stops[i]) * rises * (-1.0) ** i > _TURN:
            i += 1
        elif i == 0:
            del stops[1]
            rises = -rises
        elif i == len(stops) - 2:
            del stops[i]
        else:
            del stops[i : i + 2]
            i -= 1
    return stops


def _interiors(fields: Array, doubt: Array, holdup: Array) -> int:
    """Bits of INTERIORS; a net loss whose sign is in ``doubt`` (2 or more, k) does not make a flow mixed."""
    found = 0
    scale = float(np.abs(fields[[NET_LOW, NET_HIGH]]).max())
    rounding = _BALANCE * scale * (1.0 + holdup / _DEEP)
    gain, loss = doubt[0] + rounding, doubt[1] + rounding
    if _peak(fields[NET_LOW] + gain) >= 0.0:
        found |= INTERIORS[flow_kinds.DISSIPATIVE]
    if _peak(loss - fields[NET_HIGH]) >= 0.0:
        found |= INTERIORS[flow_kinds.PRODUCTIVE]
    if _peak(np.minimum(-fields[SURE_LOW] - gain, fields[SURE_HIGH] - loss)) > 0.0:
        found |= INTERIORS[flow_kinds.MIXED]
    return found


def _densities(fields: Array, doubt: Array, holdup: Array) -> int:
    """Bits of DENSITIES; a rise that is in ``doubt`` (k,) does not make a density inverted."""
    found = 0
    if _peak(1.0 - fields[STEEPEST]) >= 0.0:
        found |= DENSITIES[flow_kinds.MONOTONIC]
    if _peak(fields[SURE_STEEP] - doubt - 1.0 - _RISE * holdup) > 0.0:
        found |= DENSITIES[flow_kinds.INVERTED]
    return found


def _peak(values: Array) -> float:
    """The largest of values along a line, between points by parabolas."""
    top = float(values.max())
    i = int(values.argmax())
    if 0 < i < len(values) - 1:
        before, here, after = values[i - 1 : i + 2]
        bend = 2.0 * here - before - after
        if bend > 0.0:
            top += float((after - before) ** 2 / (8.0 * bend))
    return top
