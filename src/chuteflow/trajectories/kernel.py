"""The compiled loops: a curve of states carried down, refined where it stretches, and the zeros of the base condition.

# notation: P overburden, p = P + p_S normal stress, L, y, a, k, net, b as in chuteflow.trajectories.tables;
# A = (1 - k)/(2 a), c = 1 + k/2; B = y - b the residual of the base condition; tau = ln P + P/p_1 the step variable.

With these, dL/dp = (1 + beta)/p - y/a and dy/dp = net - A y^2 - c y/p; beta is 0 for most laws. All arrays of a row are in the order of the curve.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from chuteflow.numerics.compiled import compiled
from chuteflow.trajectories.tables import (
    BASE,
    BASE_ABOVE,
    BASE_HIGH,
    BASE_LOW,
    BETA,
    COUPLED,
    CURVE_ABOVE,
    CURVE_HIGH,
    CURVE_LOW,
    ENTRIES,
    INVERSE,
    LOG_NU,
    LOW,
    NET,
    NET_ABOVE,
    NET_HIGH,
    NET_LOW,
    PER_UNIT,
    POTENTIAL,
    RELAX_ABOVE,
    RELAX_HIGH,
    SPREAD,
    WORKED,
)

#: Columns of a state: L, y, ln T_surface, the integrals of P dz and of P du over the overburden.
S_L, S_Y, S_T, S_H, S_G = range(5)
#: Kinds of invariant regions; in the first B > 0, in the others B < 0.
FREE, HOT, LOW_FLUX, COLD = range(4)
#: Below this L nothing changes with the density, and distances count less.
_DILUTE, _DILUTE_WEIGHT = -7.0, 0.1
#: States are no longer advanced where y is below this multiple of the scale of fluxes, or L above this.
_COLDEST, _DENSEST = -8.0, 55.0
#: Places between two states at which the residual is looked at.
_BETWEEN = 5
#: Trajectories inserted into one interval in one row at most.
_MOST_INSERTED = 12
#: The series at the surface of the half-line is used up to this share of T.
START = 0.05
#: Reasons why the curve ends.
DONE, FULL = range(2)


@compiled
def look_up(values: Any, big_l: float, column: int) -> float:
    """One function of the table, linear between entries."""
    at = min(max((big_l - LOW) * PER_UNIT, 0.0), ENTRIES - 1.000001)
    i = int(at)
    return values[i, column] + (at - i) * (values[i + 1, column] - values[i, column])


@compiled
def _derivative(values: Any, p: float, big_l: float, y: float) -> tuple[float, float]:
    """dL/dp and dy/dp."""
    at = min(max((big_l - LOW) * PER_UNIT, 0.0), ENTRIES - 1.000001)
    i = int(at)
    t = at - i
    inverse = values[i, INVERSE] + t * (values[i + 1, INVERSE] - values[i, INVERSE])
    k = values[i, COUPLED] + t * (values[i + 1, COUPLED] - values[i, COUPLED])
    net = values[i, NET] + t * (values[i + 1, NET] - values[i, NET])
    v = p * y * inverse - values[0, BETA]
    return (1.0 - v) / p, net - y * (1.0 + 0.5 * (v + k * (1.0 - v))) / p


@compiled
def _integrands(values: Any, slope: float, p_s: float, over: float, big_l: float) -> tuple[float, float]:
    """P/nu and P du/dp."""
    root_t = math.exp(0.5 * (math.log(over + p_s) + look_up(values, big_l, POTENTIAL) - big_l))
    work = look_up(values, big_l, WORKED)
    return over * math.exp(-big_l - look_up(values, big_l, LOG_NU)), over * work * slope * root_t


@compiled
def _advance(values: Any, slope: float, p_s: float, p_1: float, over: float, after: float, state: Any) -> None:
    """One step of the classical Runge-Kutta method in tau from overburden ``over`` to ``after``; integrals by
    Simpson."""
    half_tau = 0.5 * (math.log(after / over) + (after - over) / p_1)
    middle = over
    # The overburden in the middle of the step, by Newton's method in ln P.
    log_middle = 0.5 * (math.log(over) + math.log(after))
    target = math.log(over) + over / p_1 + half_tau
    for _ in range(4):
        middle = math.exp(log_middle)
        log_middle -= (log_middle + middle / p_1 - target) / (1.0 + middle / p_1)
    middle = math.exp(log_middle)
    pace_0 = over / (1.0 + over / p_1)
    pace_m = middle / (1.0 + middle / p_1)
    pace_1 = after / (1.0 + after / p_1)
    big_l, y = state[S_L], state[S_Y]
    l_1, y_1 = _derivative(values, over + p_s, big_l, y)
    l_2, y_2 = _derivative(values, middle + p_s, big_l + half_tau * pace_0 * l_1, y + half_tau * pace_0 * y_1)
    l_3, y_3 = _derivative(values, middle + p_s, big_l + half_tau * pace_m * l_2, y + half_tau * pace_m * y_2)
    l_m = big_l + half_tau * pace_m * l_3
    l_4, y_4 = _derivative(
        values, after + p_s, big_l + 2.0 * half_tau * pace_m * l_3, y + 2.0 * half_tau * pace_m * y_3
    )
    third = half_tau / 3.0
    state[S_L] = big_l + third * (pace_0 * l_1 + 2.0 * pace_m * (l_2 + l_3) + pace_1 * l_4)
    state[S_Y] = y + third * (pace_0 * y_1 + 2.0 * pace_m * (y_2 + y_3) + pace_1 * y_4)
    h_0, g_0 = _integrands(values, slope, p_s, over, big_l)
    h_m, g_m = _integrands(values, slope, p_s, middle, l_m)
    h_1, g_1 = _integrands(values, slope, p_s, after, state[S_L])
    state[S_H] += third * (h_0 * pace_0 + 4.0 * h_m * pace_m + h_1 * pace_1)
    state[S_G] += third * (g_0 * pace_0 + 4.0 * g_m * pace_m + g_1 * pace_1)


@compiled
def _surface(values: Any, slope: float, p_s: float, y_s: float, theta_s: float, over: float, state: Any) -> None:
    """A state close to the surface: on the half-line by the series (3.23)-(3.25), at the interface to first order."""
    if p_s == 0.0:
        beta = values[0, BETA]
        half = values[0, NET] / (2.0 - 0.5 * beta)
        big_l = (1.0 + beta) * math.log(over) - theta_s - 0.5 * over**2 * half * values[0, INVERSE]
        v = over**2 * half * look_up(values, big_l, INVERSE) - beta
        net, k = look_up(values, big_l, NET), look_up(values, big_l, COUPLED)
        share = 3.0 + 0.5 * beta
        heating = v + k * (1.0 - v) + beta
        state[S_Y] = over * (half + (net - values[0, NET]) / share - 0.5 * half * heating / share)
        fraction = 1.0 / (1.0 - beta)
    else:
        big_l = (1.0 + values[0, BETA]) * math.log(p_s) - theta_s
        l_p, y_p = _derivative(values, p_s, big_l, y_s)
        big_l += over * l_p
        state[S_Y] = y_s + over * y_p
        fraction = 0.5
    state[S_L] = big_l
    h, g = _integrands(values, slope, p_s, over, big_l)
    state[S_H] = fraction * h * over
    state[S_G] = 0.5 * g * over


@compiled
def region_of(bounds: Any, p: float, big_l: float, y: float) -> int:
    """The invariant region in which a state lies: from there on B keeps its sign (docs/theory/enumeration.md)."""
    at = min(max((big_l - LOW) * PER_UNIT, 0.0), ENTRIES - 1.000001)
    i = int(at)
    if y < 0.0:
        gained = max(bounds[i, NET_ABOVE], 0.0) - bounds[i, RELAX_ABOVE] * y / p
        return COLD if gained < bounds[i, CURVE_ABOVE] * y * y and y < bounds[i, BASE_ABOVE] else FREE
    net = bounds[i + 1, NET_LOW]
    if net <= 0.0:
        return FREE
    bend, relax = max(bounds[i + 1, CURVE_HIGH], 1e-12), bounds[i + 1, RELAX_HIGH] / p
    least = min(y, 2.0 * net / (relax + math.sqrt(relax * relax + 4.0 * bend * net)))
    if p * least <= bounds[i + 1, SPREAD]:
        return FREE
    if least > bounds[i + 1, BASE_HIGH]:
        return HOT
    if bounds[i + 1, CURVE_LOW] > 0.0:
        most = max(y, math.sqrt(bounds[i + 1, NET_HIGH] / bounds[i + 1, CURVE_LOW]))
        if most < bounds[i + 1, BASE_LOW]:
            return LOW_FLUX
    return FREE


@compiled
def _place(big_l: float) -> float:
    """L as distances count it."""
    return big_l if big_l > _DILUTE else _DILUTE + _DILUTE_WEIGHT * (big_l - _DILUTE)


@compiled
def _distance(one: Any, other: Any, per_flux: float) -> float:
    return math.hypot(_place(one[S_L]) - _place(other[S_L]), (one[S_Y] - other[S_Y]) * per_flux)


@compiled
def _limited_slope(before: float, after: float, d_before: float, d_after: float) -> float:
    """Slope at a point between two secants that keeps the interpolant monotonic (Fritsch & Butland 1984)."""
    one, two = before / d_before, after / d_after
    if one * two <= 0.0:
        return 0.0
    w_1, w_2 = 2.0 * d_after + d_before, d_after + 2.0 * d_before
    return (w_1 + w_2) / (w_1 / one + w_2 / two)


@compiled
def _interpolate(rows: Any, j: int, n: int, open_: Any, length: Any, t: float, out: Any) -> None:
    """The state at ``t`` of the way from position j of the curve to the next: a monotonic cubic."""
    d = length[j]
    for q in range(rows.shape[1]):
        rise = rows[j + 1, q] - rows[j, q]
        left = right = rise / d
        if j > 0 and open_[j - 1]:
            left = _limited_slope(rows[j, q] - rows[j - 1, q], rise, length[j - 1], d)
        if j + 2 < n and open_[j + 1]:
            right = _limited_slope(rise, rows[j + 2, q] - rows[j + 1, q], d, length[j + 1])
        # One-sided slopes at the ends of a piece are those of the chord.
        out[q] = rows[j, q] + t * rise + t * (1.0 - t) * d * ((1.0 - t) * (left - rise / d) - t * (right - rise / d))


@compiled
def _hides_zeros(values: Any, rows: Any, residual: Any, j: int, n: int, open_: Any, length: Any) -> bool:
    """Whether the residual may have zeros more between position j of the curve and the next than its signs there show:
    where it does along the cubic through the two states, or comes half of the way to it."""
    d = length[j]
    slopes = np.empty((2, 2))
    for q in range(2):
        secant = (rows[j + 1, q] - rows[j, q]) / d
        slopes[0, q] = slopes[1, q] = secant
        if j > 0 and open_[j - 1]:
            beside = (rows[j, q] - rows[j - 1, q]) / length[j - 1]
            slopes[0, q] = (beside * d + secant * length[j - 1]) / (d + length[j - 1])
        if j + 2 < n and open_[j + 1]:
            beside = (rows[j + 2, q] - rows[j + 1, q]) / length[j + 1]
            slopes[1, q] = (beside * d + secant * length[j + 1]) / (d + length[j + 1])
    changes = 0
    before, last = residual[j], residual[j + 1]
    least = min(abs(before), abs(last))
    nearest = least
    for c in range(1, _BETWEEN + 1):
        t = c / (_BETWEEN + 1.0)
        big_l = y = 0.0
        for q in range(2):
            rise = rows[j + 1, q] - rows[j, q]
            bend = (1.0 - t) * (slopes[0, q] * d - rise) - t * (slopes[1, q] * d - rise)
            value = rows[j, q] + t * rise + t * (1.0 - t) * bend
            if q == S_L:
                big_l = value
            else:
                y = value
        here = y - look_up(values, big_l, BASE)
        changes += int((here >= 0.0) != (before >= 0.0))
        nearest = min(nearest, abs(here))
        before = here
    changes += int((last >= 0.0) != (before >= 0.0))
    if (residual[j] >= 0.0) == (last >= 0.0):
        return changes > 0 or nearest < 0.5 * least
    return changes > 1


@compiled
def _grown(array: Any, size: int) -> Any:
    """The array with room for ``size`` rows at least."""
    if size <= len(array):
        return array
    shape = (max(size, 2 * len(array)), *array.shape[1:])
    out = np.empty(shape, array.dtype)
    out[: len(array)] = array
    return out


@compiled
def _match(nodes: Any, places: Any, count: int, links: Any) -> None:
    """Join the ``count`` zeros on the boundary of a cell, in cyclic order, in pairs: of the two ways to join
    neighbours the one with the shorter lines."""
    if count < 2:
        return
    even = odd = 0.0
    for c in range(count):
        d = c + 1 if c + 1 < count else 0
        gap = math.hypot(places[c, 0] - places[d, 0], places[c, 1] - places[d, 1])
        if c % 2 == 0:
            even += gap
        else:
            odd += gap
    first = 0 if count == 2 or even <= odd else 1
    for c in range(first, count, 2):
        one, two = nodes[c], nodes[(c + 1) % count]
        links[one, 0 if links[one, 0] < 0 else 1] = two
        links[two, 0 if links[two, 0] < 0 else 1] = one


@compiled
def carry(
    values: Any,
    bounds: Any,
    slope: float,
    p_s: float,
    y_s: float,
    p_1: float,
    start_at_most: float,
    overburden: Any,
    log_t: Any,
    theta_s: Any,
    delta: float,
    per_flux: float,
    finest: float,
    most: int,
) -> tuple[Any, ...]:
    """Carry the curve of states down the rows ``overburden`` (R,) from surface temperatures ``log_t`` (C,) ascending.

    Returns the states of all rows (N, 5), the place in the row before from which each came (N,), between two states
    where it was inserted, the first position of each row (R + 1,), zeros of B: left or upper position, right or lower
    position, fraction between (Z, 3), their neighbours along the zero set (Z, 2), positions of edges that were not
    resolved (U,), and how the curve ended.
    """
    n = len(log_t)
    room = 64 * n + 1024
    states = np.empty((room, 5))
    came_from = np.empty(room)
    first = np.zeros(len(overburden) + 1, np.int64)
    zero_places = np.empty((256, 3))
    links = np.full((256, 2), -1, np.int64)
    unresolved = np.empty(64, np.int64)
    n_zeros = n_unresolved = total = 0
    status = DONE

    current = np.empty((n, 5))
    theta = theta_s.copy()
    in_series = np.zeros(n, np.bool_)
    open_ = np.ones(n, np.bool_)
    region = np.zeros(n, np.int64)
    frozen = np.zeros(n, np.bool_)
    above = np.full(n, -1, np.int64)  # position in the row before
    old_b = np.empty(n)
    old_open = np.ones(n, np.bool_)
    old_edge = np.full(n, -1, np.int64)
    inserted = np.empty(5)
    cell_nodes = np.empty(64, np.int64)
    cell_places = np.empty((64, 2))

    for row in range(len(overburden)):
        over = overburden[row]
        p = over + p_s
        # Advance.
        for j in range(n):
            if row == 0 or in_series[j]:
                warmth = math.exp(theta[j] / (1.0 + values[0, BETA]))
                near = p_s == 0.0 and over <= min(START * warmth, start_at_most)
                if row == 0 or near:
                    current[j, S_T] = log_t[j] if row == 0 else current[j, S_T]
                    _surface(values, slope, p_s, y_s, theta[j], over, current[j])
                    in_series[j] = p_s == 0.0
                    continue
                in_series[j] = False
            if not frozen[j]:
                _advance(values, slope, p_s, p_1, overburden[row - 1], over, current[j])
                if not (current[j, S_Y] > _COLDEST / per_flux) or current[j, S_L] > _DENSEST:
                    current[j, S_Y] = _COLDEST / per_flux
                    current[j, S_L] = min(max(current[j, S_L], LOW), _DENSEST)
                    if not math.isfinite(current[j, S_H]):
                        current[j, S_H] = 1e300
                    if not math.isfinite(current[j, S_G]):
                        current[j, S_G] = 1e300
                    frozen[j] = True
        # Insert.
        length = np.empty(n)
        wanted = np.zeros(n, np.int64)
        residual = np.empty(n)
        extra = 0
        for j in range(n):
            region[j] = COLD if frozen[j] else region_of(bounds, p, current[j, S_L], current[j, S_Y])
            residual[j] = current[j, S_Y] - look_up(values, current[j, S_L], BASE)
        for j in range(n - 1):
            length[j] = max(_distance(current[j], current[j + 1], per_flux), 1e-14)
        for j in range(n - 1):
            if not open_[j] or (region[j] != FREE and region[j] == region[j + 1]):
                continue
            if length[j] > delta:
                wanted[j] = min(int(length[j] / delta), _MOST_INSERTED)
            elif length[j] > finest and _hides_zeros(values, current, residual, j, n, open_, length):
                wanted[j] = 1
            extra += wanted[j]
        if total + n + extra > most:
            status = FULL
            first[row + 1 :] = total
            break
        m = n + extra
        new = np.empty((m, 5))
        new_theta = np.empty(m)
        new_series = np.zeros(m, np.bool_)
        new_open = np.ones(m, np.bool_)
        new_region = np.empty(m, np.int64)
        new_frozen = np.zeros(m, np.bool_)
        new_above = np.empty(m)
        moved = np.empty(n, np.int64)
        at = 0
        for j in range(n):
            moved[j] = at
            new[at] = current[j]
            new_theta[at] = theta[j]
            new_series[at] = in_series[j]
            new_region[at] = region[j]
            new_frozen[at] = frozen[j]
            new_above[at] = above[j]
            new_open[at] = open_[j]
            at += 1
            for c in range(wanted[j]):
                t = (c + 1.0) / (wanted[j] + 1.0)
                _interpolate(current, j, n, open_, length, t, inserted)
                new[at] = inserted
                new_theta[at] = theta[j] + t * (theta[j + 1] - theta[j])
                new_series[at] = in_series[j] and in_series[j + 1]
                new_region[at] = region_of(bounds, p, inserted[S_L], inserted[S_Y])
                new_above[at] = above[j] + t * (above[j + 1] - above[j])
                at += 1
        # Store the row.
        states = _grown(states, total + m)
        came_from = _grown(came_from, total + m)
        states[total : total + m] = new
        came_from[total : total + m] = new_above
        first[row] = total
        # Zeros between trajectories at this depth.
        new_b = np.empty(m)
        edge = np.full(m, -1, np.int64)
        for j in range(m):
            new_b[j] = new[j, S_Y] - look_up(values, new[j, S_L], BASE)
        zero_places = _grown(zero_places, n_zeros + 2 * m)
        before = len(links)
        links = _grown(links, n_zeros + 2 * m)
        links[before:] = -1
        for j in range(m - 1):
            if new_open[j] and (new_b[j] >= 0.0) != (new_b[j + 1] >= 0.0):
                zero_places[n_zeros, 0] = total + j
                zero_places[n_zeros, 1] = total + j + 1
                zero_places[n_zeros, 2] = new_b[j] / (new_b[j] - new_b[j + 1])
                edge[j] = n_zeros
                n_zeros += 1
                if _distance(new[j], new[j + 1], per_flux) > 2.0 * delta:
                    unresolved = _grown(unresolved, n_unresolved + 1)
                    unresolved[n_unresolved] = total + j
                    n_unresolved += 1
        # Zeros along trajectories since the row before, and lines through the cells between the rows.
        if row > 0:
            side = np.full(n, -1, np.int64)
            for j in range(n):
                b_now = new_b[moved[j]]
                if (old_b[j] >= 0.0) != (b_now >= 0.0):
                    zero_places[n_zeros, 0] = above[j]
                    zero_places[n_zeros, 1] = total + moved[j]
                    zero_places[n_zeros, 2] = old_b[j] / (old_b[j] - b_now)
                    side[j] = n_zeros
                    n_zeros += 1
            for j in range(n - 1):
                if not old_open[j]:
                    continue
                count = 0
                if old_edge[j] >= 0:
                    cell_nodes[0] = old_edge[j]
                    cell_places[0, 0] = zero_places[old_edge[j], 2]
                    cell_places[0, 1] = 0.0
                    count = 1
                if side[j + 1] >= 0:
                    cell_nodes[count] = side[j + 1]
                    cell_places[count, 0] = 1.0
                    cell_places[count, 1] = zero_places[side[j + 1], 2]
                    count += 1
                width = moved[j + 1] - moved[j]
                for c in range(width - 1, -1, -1):
                    e = edge[moved[j] + c]
                    if e >= 0:
                        cell_nodes[count] = e
                        cell_places[count, 0] = (c + zero_places[e, 2]) / width
                        cell_places[count, 1] = 1.0
                        count += 1
                if side[j] >= 0:
                    cell_nodes[count] = side[j]
                    cell_places[count, 0] = 0.0
                    cell_places[count, 1] = zero_places[side[j], 2]
                    count += 1
                _match(cell_nodes, cell_places, count, links)
        # Close the curve where both ends of an interval lie in one invariant region, and drop what is closed in.
        for j in range(m - 1):
            if new_region[j] != FREE and new_region[j] == new_region[j + 1]:
                new_open[j] = False
        new_open[m - 1] = False
        keep = 0
        for j in range(m):
            if (j > 0 and new_open[j - 1]) or new_open[j]:
                keep += 1
        current = np.empty((keep, 5))
        theta = np.empty(keep)
        in_series = np.empty(keep, np.bool_)
        open_ = np.empty(keep, np.bool_)
        region = np.empty(keep, np.int64)
        frozen = np.empty(keep, np.bool_)
        above = np.empty(keep, np.int64)
        old_b = np.empty(keep)
        old_edge = np.empty(keep, np.int64)
        at = 0
        for j in range(m):
            if (j > 0 and new_open[j - 1]) or new_open[j]:
                current[at] = new[j]
                theta[at] = new_theta[j]
                in_series[at] = new_series[j]
                open_[at] = new_open[j]
                region[at] = new_region[j]
                frozen[at] = new_frozen[j]
                above[at] = total + j
                old_b[at] = new_b[j]
                old_edge[at] = edge[j]
                at += 1
        old_open = open_.copy()
        n = keep
        total += m
        first[row + 1] = total
        if n == 0:
            first[row + 1 :] = total
            break
    return (
        states[:total],
        came_from[:total],
        first,
        zero_places[:n_zeros],
        links[:n_zeros],
        unresolved[:n_unresolved],
        status,
    )


@compiled
def walk(links: Any) -> tuple[Any, Any]:
    """The zeros in the order of the lines that they form: indices (Z,), and where each line begins (lines + 1,).

    A closed line ends with the zero before its first.
    """
    n = len(links)
    order = np.empty(n, np.int64)
    starts = np.empty(n + 1, np.int64)
    seen = np.zeros(n, np.bool_)
    at = lines = 0
    for closed in range(2):
        for begin in range(n):
            if seen[begin] or (closed == 0 and links[begin, 1] >= 0):
                continue
            starts[lines] = at
            lines += 1
            here = begin
            while here >= 0 and not seen[here]:
                seen[here] = True
                order[at] = here
                at += 1
                one, two = links[here, 0], links[here, 1]
                here = one if one >= 0 and not seen[one] else two
    starts[lines] = at
    return order, starts[: lines + 1]


@compiled
def trace_back(states: Any, came_from: Any, place: float, row: int) -> Any:
    """L and y in all rows down to ``row`` of the trajectory that passes its curve at ``place``, between two states as a
    rule, (row + 1, 2)."""
    out = np.empty((row + 1, 2))
    for r in range(row, -1, -1):
        one = int(place)
        t = place - one
        other = one + 1 if t > 0.0 else one
        for q in range(2):
            out[r, q] = (1.0 - t) * states[one, q] + t * states[other, q]
        place = (1.0 - t) * came_from[one] + t * came_from[other]
    return out
