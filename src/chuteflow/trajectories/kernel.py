"""The compiled loops: a curve of states carried down, refined where it stretches, and the zeros of the base condition.

# notation: P overburden, p = P + p_S normal stress, L, y, a, k, net, b as in chuteflow.trajectories.tables;
# A = (1 - k)/(2 a), c = 1 + k/2; B = y - b the residual of the base condition; tau = ln P + P/p_1 the step variable.

With these, dL/dp = (1 + beta)/p - y/a and dy/dp = net - A y^2 - c y/p; beta is 0 for most laws. Close to a free surface
these are (3.20)-(3.22). The arrays of a depth step are in the order of the curve.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from chuteflow.numerics.compiled import compiled, compiled_in_place
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
    HEIGHT,
    INVERSE,
    LOW,
    NET,
    NET_ABOVE,
    NET_HIGH,
    NET_LOW,
    PER_UNIT,
    RELAX_ABOVE,
    RELAX_HIGH,
    SHEARING,
    SPREAD,
)

#: Columns of a state: L, y, ln T_surface, the integrals of P dz and of P du over the overburden; and while it is
#: advanced, what these two are integrals of.
S_L, S_Y, S_T, S_H, S_G, S_DH, S_DG = range(7)
#: Columns that are kept.
_KEPT = 5
#: Columns of the expansion in the layer at a free surface, see :func:`expand_in_layer`.
Y_1, L_2, Y_3, H_1, H_3, G_1, G_3 = range(7)
#: Kinds of invariant regions; in the first B > 0, in the others B < 0.
FREE, HOT, LOW_FLUX, COLD, BEYOND = range(5)
#: Below this L nothing changes with the density, and distances count less.
DILUTE, DILUTE_WEIGHT = -7.0, 0.1
#: States are no longer advanced where y is below this multiple of the scale of fluxes, or L above this.
_COLDEST, _DENSEST = -8.0, 55.0
#: Places between two states at which the residual is examined.
_BETWEEN = 5
#: Largest value of t (1 - t)^2 for t from 0 to 1.
_HUMP = 4.0 / 27.0
#: That times the largest r^2/(1 + r) for a ratio r of neighbouring lengths up to 2.
_BEND = _HUMP * 4.0 / 3.0
#: An overburden this many times smaller than one at which trajectories may meet the base is above all flows.
_FAR = 2.0
#: Trajectories inserted into one interval in one depth step at most.
_MOST_INSERTED = 12
#: Reasons why the curve ends.
DONE, FULL = range(2)


@compiled_in_place
def interpolate_table(values: Any, big_l: float, column: int) -> float:
    """One function of the table, linear between entries."""
    at = min(max((big_l - LOW) * PER_UNIT, 0.0), ENTRIES - 1.000001)
    i = int(at)
    return values[i, column] + (at - i) * (values[i + 1, column] - values[i, column])


@compiled_in_place
def _evaluate_derivative(values: Any, per_p: float, p: float, big_l: float, y: float) -> tuple[float, float]:
    """dL/dp and dy/dp, where ``per_p`` is 1/p."""
    at = min(max((big_l - LOW) * PER_UNIT, 0.0), ENTRIES - 1.000001)
    i = int(at)
    t = at - i
    inverse = values[i, INVERSE] + t * (values[i + 1, INVERSE] - values[i, INVERSE])
    k = values[i, COUPLED] + t * (values[i + 1, COUPLED] - values[i, COUPLED])
    net = values[i, NET] + t * (values[i + 1, NET] - values[i, NET])
    v = p * y * inverse - values[0, BETA]
    still = 1.0 - v
    return still * per_p, net - y * (1.0 + 0.5 * (v + k * still)) * per_p


@compiled_in_place
def _evaluate_integrands(values: Any, over: float, shear: float, big_l: float) -> tuple[float, float]:
    """P/nu and P du/dp, where ``shear`` is slope P sqrt(p)."""
    at = min(max((big_l - LOW) * PER_UNIT, 0.0), ENTRIES - 1.000001)
    i = int(at)
    t = at - i
    root = math.exp(-0.5 * big_l)
    height = values[i, HEIGHT] + t * (values[i + 1, HEIGHT] - values[i, HEIGHT])
    shearing = values[i, SHEARING] + t * (values[i + 1, SHEARING] - values[i, SHEARING])
    return over * root * root * height, shear * root * shearing


@compiled
def space_depths(first: float, deepest: float, p_1: float, step: float) -> Any:
    """Overburdens from ``first`` to ``deepest``, evenly in tau = ln P + P/p_1, by ``step`` at most."""
    low, high = math.log(first) + first / p_1, math.log(deepest) + deepest / p_1
    count = math.ceil((high - low) / step)
    out = np.empty(count + 1)
    log_p = math.log(first)
    for i in range(count + 1):
        tau = low + (high - low) * i / count
        # tau is convex in ln P: from below, Newton's method overshoots once and then comes down.
        for _ in range(60):
            p = math.exp(log_p)
            change = (log_p + p / p_1 - tau) / (1.0 + p / p_1)
            log_p -= change
            if abs(change) < 1e-13:
                break
        out[i] = math.exp(log_p)
    return out


@compiled_in_place
def _prepare_step(slope: float, p_s: float, p_1: float, over: float, after: float, out: Any) -> float:
    """Half of the step in tau from overburden ``over`` to ``after``; P, dP/dtau, slope P sqrt(p), p and 1/p at its ends
    and middle into ``out`` (3, 5)."""
    half_tau = 0.5 * (math.log(after / over) + (after - over) / p_1)
    target = math.log(over) + over / p_1 + half_tau
    # The overburden in the middle of the step, by Newton's method in ln P.
    log_middle = 0.5 * (math.log(over) + math.log(after))
    for _ in range(4):
        middle = math.exp(log_middle)
        log_middle -= (log_middle + middle / p_1 - target) / (1.0 + middle / p_1)
    out[0, 0], out[1, 0], out[2, 0] = over, math.exp(log_middle), after
    for c in range(3):
        p = out[c, 0] + p_s
        out[c, 1] = out[c, 0] / (1.0 + out[c, 0] / p_1)
        out[c, 2] = slope * out[c, 0] * math.sqrt(p)
        out[c, 3], out[c, 4] = p, 1.0 / p
    return half_tau


@compiled_in_place
def _advance(values: Any, half_tau: float, lengths: Any, curve: Any, n: int, stopped: Any, slopes: Any) -> None:
    """One step of the first ``n`` states but the ``stopped`` ones by the classical Runge-Kutta method in tau, for which
    :func:`_prepare_step` gives the lengths; integrals by Simpson.

    Stage by stage: the processor then works on several states at once. ``slopes`` (n, 6) is space for the stages.
    """
    p_0, p_m, p_1 = lengths[0, 3], lengths[1, 3], lengths[2, 3]
    per_0, per_m, per_1 = lengths[0, 4], lengths[1, 4], lengths[2, 4]
    rate_0, rate_m, rate_1 = lengths[0, 1], lengths[1, 1], lengths[2, 1]
    step_0, step_m, third = half_tau * rate_0, half_tau * rate_m, half_tau / 3.0
    for j in range(n):
        slopes[j, 0], slopes[j, 1] = _evaluate_derivative(values, per_0, p_0, curve[j, S_L], curve[j, S_Y])
    for j in range(n):
        big_l, y = curve[j, S_L] + step_0 * slopes[j, 0], curve[j, S_Y] + step_0 * slopes[j, 1]
        slopes[j, 2], slopes[j, 3] = _evaluate_derivative(values, per_m, p_m, big_l, y)
    for j in range(n):
        big_l, y = curve[j, S_L] + step_m * slopes[j, 2], curve[j, S_Y] + step_m * slopes[j, 3]
        slopes[j, 4], slopes[j, 5] = _evaluate_derivative(values, per_m, p_m, big_l, y)
    for j in range(n):
        if stopped[j]:
            continue
        big_l, y, l_3, y_3 = curve[j, S_L], curve[j, S_Y], slopes[j, 4], slopes[j, 5]
        l_m = big_l + step_m * l_3
        l_4, y_4 = _evaluate_derivative(values, per_1, p_1, big_l + 2.0 * step_m * l_3, y + 2.0 * step_m * y_3)
        big_l += third * (rate_0 * slopes[j, 0] + 2.0 * rate_m * (slopes[j, 2] + l_3) + rate_1 * l_4)
        curve[j, S_L] = big_l
        curve[j, S_Y] = y + third * (rate_0 * slopes[j, 1] + 2.0 * rate_m * (slopes[j, 3] + y_3) + rate_1 * y_4)
        h_m, g_m = _evaluate_integrands(values, lengths[1, 0], lengths[1, 2], l_m)
        h_1, g_1 = _evaluate_integrands(values, lengths[2, 0], lengths[2, 2], big_l)
        curve[j, S_H] += third * (curve[j, S_DH] * rate_0 + 4.0 * h_m * rate_m + h_1 * rate_1)
        curve[j, S_G] += third * (curve[j, S_DG] * rate_0 + 4.0 * g_m * rate_m + g_1 * rate_1)
        curve[j, S_DH], curve[j, S_DG] = h_1, g_1


@compiled_in_place
def _follow(before: float, half: float, rate: float, source: float, begins: bool) -> tuple[float, float]:
    """The next value of a function whose derivative is ``source`` less ``rate`` times itself, by the trapezoidal rule
    with half a step of ``half``, or in balance where it begins; and what the value after that needs as ``before``."""
    value = source / rate if begins else (before + half * source) / (1.0 + half * rate)
    return value, value + half * (source - rate * value)


@compiled
def expand_in_layer(values: Any, low: Any, high: Any, log_scale: float, deepest: float) -> tuple[Any, float]:
    """The expansion in small P of the states near a free surface, in the layer of overburdens up to ``deepest`` whose
    coldest trajectory has the heat potential ``log_scale`` at the surface; and an overburden above which none of them
    meets a base with a heat flux between ``low`` and ``high`` (entries,).

    With lambda = (1 + beta) ln P - theta_surface, which is L but for terms in P^2,

        L = lambda + P^2 L_2,    y = P (Y_1 + P^2 Y_3),
        integral of P dz = P^2 exp(-lambda) (H_1 + P^2 H_3),    of P du = slope P^(5/2) exp(-lambda/2) (G_1 + P^2 G_3)

    with functions of lambda alone (entries, 7), whose derivatives follow by comparing powers of P. The terms of lowest
    order are (3.23)-(3.25).
    """
    last = int(((1.0 + values[0, BETA]) * math.log(deepest) - log_scale - LOW) * PER_UNIT) + 2
    last = min(max(last, 1), ENTRIES - 1)
    out = np.empty((last + 1, 7))
    return out, _expand(values, low, high, log_scale, deepest, out, np.zeros(7))


@compiled_in_place
def _expand(values: Any, low: Any, high: Any, log_scale: float, deepest: float, out: Any, before: Any) -> float:
    """Fills ``out``, and gives the overburden above all flows; ``before`` (7,) is space."""
    beta = values[0, BETA]
    half = 0.5 / ((1.0 + beta) * PER_UNIT)
    first = deepest
    for i in range(len(out)):
        after, ahead = max(i - 1, 0), min(i + 1, ENTRIES - 1)
        per = PER_UNIT / (ahead - after)
        net_slope = per * (values[ahead, NET] - values[after, NET])
        k_slope = per * (values[ahead, COUPLED] - values[after, COUPLED])
        height_slope = per * (values[ahead, HEIGHT] - values[after, HEIGHT])
        shearing_slope = per * (values[ahead, SHEARING] - values[after, SHEARING])
        inverse, k = values[i, INVERSE], values[i, COUPLED]
        heating = 0.5 * (k * (1.0 + beta) - beta)
        out[i, Y_1], before[Y_1] = _follow(before[Y_1], half, 2.0 + heating, values[i, NET], i == 0)
        y = out[i, Y_1]
        out[i, L_2], before[L_2] = _follow(before[L_2], half, 2.0, -y * inverse, i == 0)
        moved = out[i, L_2]
        heated = y * inverse * (1.0 - k) + (1.0 + beta) * moved * k_slope
        out[i, Y_3], before[Y_3] = _follow(
            before[Y_3], half, 4.0 + heating, moved * net_slope - 0.5 * y * heated, i == 0
        )
        out[i, H_1], before[H_1] = _follow(before[H_1], half, 1.0 - beta, values[i, HEIGHT], i == 0)
        out[i, H_3], before[H_3] = _follow(
            before[H_3], half, 3.0 - beta, moved * (height_slope - values[i, HEIGHT]), i == 0
        )
        out[i, G_1], before[G_1] = _follow(before[G_1], half, 2.0 - 0.5 * beta, values[i, SHEARING], i == 0)
        out[i, G_3], before[G_3] = _follow(
            before[G_3], half, 4.0 - 0.5 * beta, moved * (shearing_slope - 0.5 * values[i, SHEARING]), i == 0
        )
        least, most = min(low[i], low[ahead]), max(high[i], high[ahead])
        nearest = 0.0 if least <= 0.0 <= most else min(abs(least), abs(most))
        reached = math.exp((LOW + i / PER_UNIT + log_scale) / (1.0 + beta))
        first = min(first, max(nearest / (_FAR * max(abs(out[i, Y_1]), 1e-300)), reached / _FAR))
    return first


@compiled_in_place
def _between(one: float, other: float, t: float) -> float:
    return one + t * (other - one)


@compiled_in_place
def _start_in_layer(values: Any, layer: Any, slope: float, over: float, theta_s: float, out: Any, j: int) -> None:
    """State ``j`` in the layer at a free surface, by its expansion."""
    big_l = (1.0 + values[0, BETA]) * math.log(over) - theta_s
    at = min(max((big_l - LOW) * PER_UNIT, 0.0), len(layer) - 1.000001)
    i = int(at)
    t, square, root = at - i, over * over, math.exp(-0.5 * big_l)
    out[j, S_L] = big_l + square * (_between(layer[i, L_2], layer[i + 1, L_2], t))
    y_1, y_3 = _between(layer[i, Y_1], layer[i + 1, Y_1], t), _between(layer[i, Y_3], layer[i + 1, Y_3], t)
    h_1, h_3 = _between(layer[i, H_1], layer[i + 1, H_1], t), _between(layer[i, H_3], layer[i + 1, H_3], t)
    g_1, g_3 = _between(layer[i, G_1], layer[i + 1, G_1], t), _between(layer[i, G_3], layer[i + 1, G_3], t)
    out[j, S_Y] = over * (y_1 + square * y_3)
    out[j, S_H] = square * root * root * (h_1 + square * h_3)
    out[j, S_G] = slope * square * math.sqrt(over) * root * (g_1 + square * g_3)
    out[j, S_DH], out[j, S_DG] = _evaluate_integrands(values, over, slope * over * math.sqrt(over), out[j, S_L])


@compiled_in_place
def _start_all_in_layer(values: Any, layer: Any, slope: float, over: float, theta: Any, curve: Any, n: int) -> None:
    for j in range(n):
        _start_in_layer(values, layer, slope, over, theta[j], curve, j)


@compiled
def states_in_layer(values: Any, layer: Any, overburden: Any, theta_s: float) -> Any:
    """L and y, (k, 2), at overburdens (k,) in the layer at a free surface, of one trajectory."""
    states = np.empty((len(overburden), 7))
    for j in range(len(overburden)):
        _start_in_layer(values, layer, 0.0, overburden[j], theta_s, states, j)
    return states[:, :2]


@compiled_in_place
def _start_all_at_interface(
    values: Any, slope: float, p_s: float, y_s: float, theta: Any, over: float, curve: Any, n: int
) -> None:
    """The states a little below the interface, to first order."""
    for j in range(n):
        big_l = (1.0 + values[0, BETA]) * math.log(p_s) - theta[j]
        l_p, y_p = _evaluate_derivative(values, 1.0 / p_s, p_s, big_l, y_s)
        curve[j, S_L] = big_l + over * l_p
        curve[j, S_Y] = y_s + over * y_p
        h, g = _evaluate_integrands(values, over, slope * over * math.sqrt(over + p_s), curve[j, S_L])
        curve[j, S_H], curve[j, S_G] = 0.5 * h * over, 0.5 * g * over
        curve[j, S_DH], curve[j, S_DG] = h, g


@compiled_in_place
def find_region(bounds: Any, p: float, big_l: float, y: float) -> int:
    """The invariant region in which a state lies: from there on B keeps its sign (docs/theory/enumeration.md)."""
    at = min(max((big_l - LOW) * PER_UNIT, 0.0), ENTRIES - 1.000001)
    i = int(at)
    if y < 0.0:
        gained = max(bounds[i, NET_ABOVE], 0.0) - bounds[i, RELAX_ABOVE] * y / p
        return COLD if gained < bounds[i, CURVE_ABOVE] * y * y and y < bounds[i, BASE_ABOVE] else FREE
    net = bounds[i + 1, NET_LOW]
    if net <= 0.0 or p * y <= bounds[i + 1, SPREAD]:
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


@compiled_in_place
def _find_region_or_limit(bounds: Any, p: float, curve: Any, j: int, limits: tuple[float, float, float]) -> int:
    """The region of a state; BEYOND where its flux by shear, which grows downwards, is larger than the first of what is
    ``limits``, and ln T_surface between the others."""
    if curve[j, S_G] > limits[0] and limits[1] < curve[j, S_T] < limits[2]:
        return BEYOND
    return find_region(bounds, p, curve[j, S_L], curve[j, S_Y])


@compiled_in_place
def _scale_density(big_l: float) -> float:
    """L as distances count it."""
    return big_l if big_l > DILUTE else DILUTE + DILUTE_WEIGHT * (big_l - DILUTE)


@compiled_in_place
def _measure_distance(curve: Any, j: int, per_flux: float) -> float:
    """Of position j of the curve from the next."""
    apart = _scale_density(curve[j, S_L]) - _scale_density(curve[j + 1, S_L])
    return math.sqrt(apart * apart + ((curve[j, S_Y] - curve[j + 1, S_Y]) * per_flux) ** 2)


@compiled_in_place
def _limit_slope(before: float, after: float, d_before: float, d_after: float) -> float:
    """Slope at a point between two secants that keeps the interpolant monotonic (Fritsch & Butland 1984)."""
    one, two = before / d_before, after / d_after
    if one * two <= 0.0:
        return 0.0
    w_1, w_2 = 2.0 * d_after + d_before, d_after + 2.0 * d_before
    return (w_1 + w_2) / (w_1 / one + w_2 / two)


@compiled_in_place
def _interpolate_state(curve: Any, j: int, n: int, connected: Any, length: Any, t: float, out: Any, k: int) -> None:
    """The state at ``t`` of the way from position j of the curve to the next, into ``out[k]``: a monotonic cubic."""
    d = length[j]
    for q in range(curve.shape[1]):
        rise = curve[j + 1, q] - curve[j, q]
        left = right = rise / d
        if j > 0 and connected[j - 1]:
            left = _limit_slope(curve[j, q] - curve[j - 1, q], rise, length[j - 1], d)
        if j + 2 < n and connected[j + 1]:
            right = _limit_slope(rise, curve[j + 2, q] - curve[j + 1, q], d, length[j + 1])
        # One-sided slopes at the ends of a piece are those of the chord.
        out[k, q] = (
            curve[j, q] + t * rise + t * (1.0 - t) * d * ((1.0 - t) * (left - rise / d) - t * (right - rise / d))
        )


@compiled_in_place
def _is_far_from_zero(steepest: float, curve: Any, least: float, j: int, n: int, connected: Any, length: Any) -> bool:
    """Whether along the cubic between position j of the curve and the next the residual certainly changes by less than
    half of ``least``, its smaller size at the two; told from neighbours that are not much nearer."""
    d = length[j]
    most_y, most_l = abs(curve[j + 1, S_Y] - curve[j, S_Y]), abs(curve[j + 1, S_L] - curve[j, S_L])
    most_y, most_l = (1.0 + 2.0 * _HUMP) * most_y, (1.0 + 2.0 * _HUMP) * most_l
    if j > 0 and connected[j - 1]:
        if length[j - 1] < 0.5 * d:
            return False
        most_y += _BEND * abs(curve[j, S_Y] - curve[j - 1, S_Y])
        most_l += _BEND * abs(curve[j, S_L] - curve[j - 1, S_L])
    if j + 2 < n and connected[j + 1]:
        if length[j + 1] < 0.5 * d:
            return False
        most_y += _BEND * abs(curve[j + 2, S_Y] - curve[j + 1, S_Y])
        most_l += _BEND * abs(curve[j + 2, S_L] - curve[j + 1, S_L])
    return 2.0 * (most_y + steepest * most_l) <= least


@compiled_in_place
def _hides_zeros(
    values: Any, steepest: float, curve: Any, residual: Any, j: int, n: int, connected: Any, length: Any
) -> bool:
    """Whether the residual may have zeros more between position j of the curve and the next than its signs there show:
    where it does along the cubic through the two states, or comes half of the way to it. The slopes of the cubic are
    those of parabolas through three positions; ``steepest`` is the largest slope of the flux of the base."""
    before, last = residual[j], residual[j + 1]
    least = min(abs(before), abs(last))
    alike = (before >= 0.0) == (last >= 0.0)
    if alike and _is_far_from_zero(steepest, curve, least, j, n, connected, length):
        return False
    rise_l, rise_y = curve[j + 1, S_L] - curve[j, S_L], curve[j + 1, S_Y] - curve[j, S_Y]
    # How much more L and y change by their slopes at the one and the other end than between them.
    left_l = left_y = right_l = right_y = 0.0
    if j > 0 and connected[j - 1]:
        ratio = length[j] / length[j - 1]
        weight = ratio / (1.0 + ratio)
        left_l = ((curve[j, S_L] - curve[j - 1, S_L]) * ratio - rise_l) * weight
        left_y = ((curve[j, S_Y] - curve[j - 1, S_Y]) * ratio - rise_y) * weight
    if j + 2 < n and connected[j + 1]:
        ratio = length[j] / length[j + 1]
        weight = ratio / (1.0 + ratio)
        right_l = ((curve[j + 2, S_L] - curve[j + 1, S_L]) * ratio - rise_l) * weight
        right_y = ((curve[j + 2, S_Y] - curve[j + 1, S_Y]) * ratio - rise_y) * weight
    changes = 0
    nearest = least
    for c in range(1, _BETWEEN + 1):
        t = c / (_BETWEEN + 1.0)
        big_l = curve[j, S_L] + t * (rise_l + (1.0 - t) * ((1.0 - t) * left_l - t * right_l))
        y = curve[j, S_Y] + t * (rise_y + (1.0 - t) * ((1.0 - t) * left_y - t * right_y))
        here = y - interpolate_table(values, big_l, BASE)
        changes += int((here >= 0.0) != (before >= 0.0))
        nearest = min(nearest, abs(here))
        before = here
    changes += int((last >= 0.0) != (before >= 0.0))
    if alike:
        return changes > 0 or nearest < 0.5 * least
    return changes > 1


@compiled
def _grow(array: Any, size: int) -> Any:
    """The array, enlarged where needed to a length of at least ``size``."""
    if size <= len(array):
        return array
    shape = (max(size, 2 * len(array)), *array.shape[1:])
    out = np.empty(shape, array.dtype)
    out[: len(array)] = array
    return out


@compiled_in_place
def _pair_zeros(nodes: Any, places: Any, count: int, links: Any) -> None:
    """Join the ``count`` zeros, two or more, on the boundary of a cell, in cyclic order, in pairs: of the two ways to
    join neighbours the one with the shorter lines."""
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


# What follows works on the positions of the curve: of the first n of the arrays, ``theta`` is the heat potential at the
# surface, ``stopped`` whether a state is no longer advanced, ``connected`` whether the curve continues to the next,
# ``came`` the place among the states of the step before, ``region`` the invariant region, ``residual`` B, and
# ``length`` the distance from the next.


@compiled_in_place
def _stop(curve: Any, n: int, stopped: Any, coldest: float) -> None:
    """Stop the states that are too cold or too dense to be advanced."""
    for j in range(n):
        if not stopped[j] and (not (curve[j, S_Y] > coldest) or curve[j, S_L] > _DENSEST):
            curve[j, S_Y] = coldest
            curve[j, S_L] = min(max(curve[j, S_L], LOW), _DENSEST)
            if not math.isfinite(curve[j, S_H]):
                curve[j, S_H] = 1e300
            if not math.isfinite(curve[j, S_G]):
                curve[j, S_G] = 1e300
            stopped[j] = True


@compiled_in_place
def _examine(
    values: Any, bounds: Any, p: float, per_flux: float, limits: tuple[float, float, float],
    curve: Any, n: int, stopped: Any, region: Any, residual: Any, length: Any,
) -> None:  # fmt: skip
    """Regions, residuals and lengths."""
    for j in range(n):
        region[j] = COLD if stopped[j] else _find_region_or_limit(bounds, p, curve, j, limits)
        residual[j] = curve[j, S_Y] - interpolate_table(values, curve[j, S_L], BASE)
    for j in range(n - 1):
        length[j] = max(_measure_distance(curve, j, per_flux), 1e-14)


@compiled_in_place
def _plan_insertions(
    values: Any, steepest: float, delta: float, finest: float,
    curve: Any, n: int, connected: Any, region: Any, residual: Any, length: Any, n_inserted: Any, limited: Any,
) -> tuple[int, int, int]:  # fmt: skip
    """How many states to insert after each position, and whether that is not enough, so that the cell is undecided; in
    all how many to insert, cells examined, and undecided."""
    extra = cells = undecided = 0
    for j in range(n):
        n_inserted[j], limited[j] = 0, False
        if j + 1 == n or not connected[j] or (region[j] != FREE and region[j] == region[j + 1]):
            continue
        cells += 1
        if length[j] > delta:
            n_inserted[j] = min(int(length[j] / delta), _MOST_INSERTED)
            limited[j] = length[j] > 2.0 * delta * (n_inserted[j] + 1)
        elif _hides_zeros(values, steepest, curve, residual, j, n, connected, length):
            n_inserted[j] = 1 if length[j] > finest else 0
            limited[j] = length[j] <= finest
        undecided += int(limited[j])
        extra += n_inserted[j]
    return extra, cells, undecided


@compiled_in_place
def _interpolate_planned(curve: Any, n: int, connected: Any, length: Any, n_inserted: Any, inserted: Any) -> None:
    """The states to insert, in order."""
    k = 0
    for j in range(n):
        for c in range(n_inserted[j]):
            _interpolate_state(curve, j, n, connected, length, (c + 1.0) / (n_inserted[j] + 1.0), inserted, k)
            k += 1


@compiled_in_place
def _insert(
    bounds: Any, p: float, limits: tuple[float, float, float], n_inserted: Any, inserted: Any, extra: int,
    curve: Any, n: int, theta: Any, stopped: Any, connected: Any, region: Any, came: Any,
) -> None:  # fmt: skip
    """Insert the ``extra`` states; from the end of the curve, so that nothing is overwritten before it is moved."""
    at, k = n + extra, extra
    ahead = at  # where the position after the present one is now
    for j in range(n - 1, -1, -1):
        for c in range(n_inserted[j] - 1, -1, -1):
            at -= 1
            k -= 1
            t = (c + 1.0) / (n_inserted[j] + 1.0)
            for q in range(7):
                curve[at, q] = inserted[k, q]
            theta[at] = theta[j] + t * (theta[ahead] - theta[j])
            came[at] = came[j] + t * (came[ahead] - came[j])
            stopped[at] = False
            connected[at] = True
            region[at] = _find_region_or_limit(bounds, p, inserted, k, limits)
        at -= 1
        if at == j:
            break  # nothing is inserted before
        ahead = at
        for q in range(7):
            curve[at, q] = curve[j, q]
        theta[at], came[at], stopped[at], connected[at], region[at] = (
            theta[j],
            came[j],
            stopped[j],
            connected[j],
            region[j],
        )


@compiled_in_place
def _record(
    states: Any, came_from: Any, goes_on: Any, total: int,
    curve: Any, n: int, theta: Any, stopped: Any, connected: Any, region: Any, came: Any,
) -> int:  # fmt: skip
    """Keep the states, after ``total`` others. Then close the curve where both ends of an interval lie in one invariant
    region, and drop what is closed in; how many positions are left."""
    at = 0
    joined = False  # to the position before
    for j in range(n):
        for q in range(_KEPT):
            states[total + j, q] = curve[j, q]
        came_from[total + j], goes_on[total + j] = came[j], connected[j]
        ahead = j + 1 < n and connected[j] and not (region[j] != FREE and region[j] == region[j + 1])
        if joined or ahead:
            if at < j:
                for q in range(7):
                    curve[at, q] = curve[j, q]
                theta[at], stopped[at] = theta[j], stopped[j]
            connected[at] = ahead
            came[at] = total + j
            at += 1
        joined = ahead
    return at


@compiled_in_place
def _note_undecided(limited: Any, n_inserted: Any, n: int, total: int, undecided: Any, n_undecided: int) -> None:
    """The first states of the cells that are undecided, by their place among all states after ``total`` others."""
    at = total
    for j in range(n):
        if limited[j]:
            undecided[n_undecided] = at
            n_undecided += 1
        at += 1 + n_inserted[j]


@compiled
def integrate(
    values: Any,
    bounds: Any,
    slope: float,
    p_s: float,
    y_s: float,
    p_1: float,
    layer: Any,
    layer_depth: float,
    steepest: float,
    overburden: Any,
    log_t: Any,
    theta_s: Any,
    delta: float,
    per_flux: float,
    finest: float,
    most: int,
    largest_flux: float,
) -> tuple[Any, ...]:
    """Integrate the curve of states down the depth steps ``overburden`` (R,) from surface temperatures ``log_t`` (C,)
    ascending, and no further than to where the flux by shear alone is larger than ``largest_flux``. Down to
    ``layer_depth`` the states are those of the expansion ``layer``; ``steepest`` is the largest slope of the heat flux
    of the base over L.

    Returns the states of all depth steps (N, 5), the place in the step before from which each came (N,), between two
    states where it was inserted, whether the curve continues from each to the next (N,), the first position of each
    step (R + 1,), the first states of the cells that could not be decided (U,), how many cells were examined, and how
    the curve ended.
    """
    n = len(log_t)
    states = np.empty((64 * n + 1024, _KEPT))
    came_from = np.empty(len(states))
    goes_on = np.empty(len(states), np.bool_)
    first = np.zeros(len(overburden) + 1, np.int64)
    undecided = np.empty(64, np.int64)
    n_undecided = total = cells = 0
    status = DONE

    curve, inserted, slopes = np.empty((4 * n, 7)), np.empty((4 * n, 7)), np.empty((4 * n, 6))
    theta, came, residual, length = np.empty(4 * n), np.full(4 * n, -1.0), np.empty(4 * n), np.empty(4 * n)
    stopped, connected, limited = np.zeros(4 * n, np.bool_), np.ones(4 * n, np.bool_), np.zeros(4 * n, np.bool_)
    region, n_inserted = np.empty(4 * n, np.int64), np.empty(4 * n, np.int64)
    lengths = np.empty((3, 5))
    theta[:n] = theta_s
    curve[:n, S_T] = log_t
    # The outermost trajectories tell where branches lead out of the range.
    limits = largest_flux, log_t[1], log_t[n - 2]

    for step in range(len(overburden)):
        over = overburden[step]
        p = over + p_s
        if p_s == 0.0 and (step == 0 or over <= layer_depth):
            _start_all_in_layer(values, layer, slope, over, theta, curve, n)
        elif step == 0:
            _start_all_at_interface(values, slope, p_s, y_s, theta, over, curve, n)
        else:
            half_tau = _prepare_step(slope, p_s, p_1, overburden[step - 1], over, lengths)
            _advance(values, half_tau, lengths, curve, n, stopped, slopes)
            _stop(curve, n, stopped, _COLDEST / per_flux)
        _examine(values, bounds, p, per_flux, limits, curve, n, stopped, region, residual, length)
        extra, examined, new = _plan_insertions(
            values, steepest, delta, finest, curve, n, connected, region, residual, length, n_inserted, limited
        )
        cells += examined
        if new > 0:
            undecided = _grow(undecided, n_undecided + new)
            _note_undecided(limited, n_inserted, n, total, undecided, n_undecided)
            n_undecided += new
        m = n + extra
        if total + m > most:
            status = FULL
            first[step + 1 :] = total
            break
        if total + m > len(states):
            states, came_from, goes_on = (
                _grow(states, total + m),
                _grow(came_from, total + m),
                _grow(goes_on, total + m),
            )
        if m > len(curve):
            curve, slopes, theta, came = _grow(curve, m), _grow(slopes, m), _grow(theta, m), _grow(came, m)
            residual, length, region = _grow(residual, m), _grow(length, m), _grow(region, m)
            stopped, connected, limited = _grow(stopped, m), _grow(connected, m), _grow(limited, m)
            n_inserted = _grow(n_inserted, m)
        if extra > 0:
            inserted = _grow(inserted, extra)
            _interpolate_planned(curve, n, connected, length, n_inserted, inserted)
            _insert(
                bounds, p, limits, n_inserted, inserted, extra,
                curve, n, theta, stopped, connected, region, came,
            )  # fmt: skip
        first[step] = total
        n = _record(states, came_from, goes_on, total, curve, m, theta, stopped, connected, region, came)
        total += m
        first[step + 1] = total
        if n == 0:
            first[step + 1 :] = total
            break
    return (
        states[:total],
        came_from[:total],
        goes_on[:total],
        first,
        undecided[:n_undecided],
        cells,
        status,
    )


@compiled
def find_zeros(table: Any, base: int, states: Any, came_from: Any, goes_on: Any, first: Any) -> tuple[Any, Any]:
    """The zeros of B of the base in a column of ``table``: left or upper state, right or lower state, fraction
    between (Z, 3); and their neighbours along the zero set (Z, 2)."""
    residual = np.empty(len(states))
    count = _find_residuals(table, base, states, came_from, goes_on, first, residual)
    zeros, links = np.empty((count, 3)), np.full((count, 2), -1, np.int64)
    # Of each state, the zero between it and the next, and on its trajectory since the step before.
    edge, side = np.full(len(states), -1, np.int64), np.full(len(states), -1, np.int64)
    if count > 0:
        _link_zeros(
            residual, came_from, goes_on, first, edge, side, zeros, links, np.empty(64, np.int64), np.empty((64, 2))
        )
    return zeros, links


@compiled_in_place
def _find_residuals(table: Any, base: int, states: Any, came_from: Any, goes_on: Any, first: Any, residual: Any) -> int:
    """B at all states, and the number of its zeros."""
    count = 0
    for i in range(len(states)):
        residual[i] = states[i, S_Y] - interpolate_table(table, states[i, S_L], base)
    for step in range(len(first) - 1):
        for i in range(first[step], first[step + 1]):
            count += int(i + 1 < first[step + 1] and goes_on[i] and (residual[i] >= 0.0) != (residual[i + 1] >= 0.0))
            previous = int(came_from[i])
            if step > 0 and previous == came_from[i]:
                count += int((residual[previous] >= 0.0) != (residual[i] >= 0.0))
    return count


@compiled_in_place
def _link_zeros(
    residual: Any, came_from: Any, goes_on: Any, first: Any, edge: Any, side: Any, zeros: Any, links: Any,
    nodes: Any, places: Any,
) -> None:  # fmt: skip
    """The zeros and their neighbours; ``nodes`` and ``places`` are space for those around one cell."""
    n_zeros = 0
    for step in range(len(first) - 1):
        begin, end = first[step], first[step + 1]
        for i in range(begin, end - 1):
            if (residual[i] >= 0.0) != (residual[i + 1] >= 0.0) and goes_on[i]:
                zeros[n_zeros, 0], zeros[n_zeros, 1] = i, i + 1
                zeros[n_zeros, 2] = residual[i] / (residual[i] - residual[i + 1])
                edge[i] = n_zeros
                n_zeros += 1
        if step == 0:
            continue
        for i in range(begin, end):
            previous = int(came_from[i])
            was = residual[previous]
            if (was >= 0.0) != (residual[i] >= 0.0) and previous == came_from[i]:
                zeros[n_zeros, 0], zeros[n_zeros, 1] = previous, i
                zeros[n_zeros, 2] = was / (was - residual[i])
                side[i] = n_zeros
                n_zeros += 1
        # Lines through the cells between the steps.
        left = begin
        while left < end - 1:
            right = left + 1
            while right < end and came_from[right] != int(came_from[right]):
                right += 1
            if right < end and goes_on[left]:
                count = 0
                if edge[int(came_from[left])] >= 0:
                    nodes[0] = edge[int(came_from[left])]
                    places[0, 0] = zeros[nodes[0], 2]
                    places[0, 1] = 0.0
                    count = 1
                if side[right] >= 0:
                    nodes[count] = side[right]
                    places[count, 0] = 1.0
                    places[count, 1] = zeros[side[right], 2]
                    count += 1
                width = right - left
                for c in range(width - 1, -1, -1):
                    e = edge[left + c]
                    if e >= 0:
                        nodes[count] = e
                        places[count, 0] = (c + zeros[e, 2]) / width
                        places[count, 1] = 1.0
                        count += 1
                if side[left] >= 0:
                    nodes[count] = side[left]
                    places[count, 0] = 0.0
                    places[count, 1] = zeros[side[left], 2]
                    count += 1
                if count > 1:
                    _pair_zeros(nodes, places, count, links)
            left = right


@compiled
def order_zeros(links: Any) -> tuple[Any, Any]:
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
def trace_back(states: Any, came_from: Any, place: float, step: int) -> Any:
    """L and y, (step + 1, 2), at all depth steps down to ``step`` of the trajectory that passes its curve at ``place``,
    which is mostly between two states."""
    out = np.empty((step + 1, 2))
    for s in range(step, -1, -1):
        one = int(place)
        t = place - one
        other = one + 1 if t > 0.0 else one
        for q in range(2):
            out[s, q] = (1.0 - t) * states[one, q] + t * states[other, q]
        place = (1.0 - t) * came_from[one] + t * came_from[other]
    return out


@compiled_in_place
def _passed_above(values: Any, bounds: Any, p_s: float, big_l: float) -> tuple[float, float]:
    """The least and the largest net loss on a trajectory above where the curve starts with L on it: below a free
    surface L rises to there, and at an interface it starts there."""
    net = interpolate_table(values, big_l, NET)
    if p_s > 0.0:
        return net, net
    i = int(min(max((big_l - LOW) * PER_UNIT, 0.0), ENTRIES - 1.000001))
    return min(net, bounds[i, NET_LOW]), max(net, bounds[i, NET_HIGH])


@compiled
def bound_extremes(
    values: Any, bounds: Any, overburden: Any, p_s: float, states: Any, came_from: Any, first: Any
) -> Any:
    """Bounds of the least and the largest net loss, and of the largest 1 - p dL/dp, of each trajectory down to each
    state: lower ones in the first three columns, upper ones in the others (N, 6). Above where it was inserted a
    trajectory lies between its neighbours, and its extrema between theirs."""
    out = np.empty((len(states), 6))
    for step in range(len(overburden)):
        p = overburden[step] + p_s
        for i in range(first[step], first[step + 1]):
            net = interpolate_table(values, states[i, S_L], NET)
            turn = p * states[i, S_Y] * interpolate_table(values, states[i, S_L], INVERSE) - values[0, BETA]
            out[i, 0] = out[i, 1] = out[i, 3] = out[i, 4] = net
            out[i, 2] = out[i, 5] = turn
            if step == 0:
                low_net, high_net = _passed_above(values, bounds, p_s, states[i, S_L])
                out[i, 0] = out[i, 3] = low_net
                out[i, 1] = out[i, 4] = high_net
            else:
                one = int(came_from[i])
                other = one + 1 if came_from[i] > one else one
                for low in (0, 3):
                    for q in range(low, low + 3):
                        bound = min(out[one, q], out[other, q]) if low == 0 else max(out[one, q], out[other, q])
                        out[i, q] = min(out[i, q], bound) if q == low else max(out[i, q], bound)
    return out


@compiled
def find_extremes(
    values: Any, bounds: Any, overburden: Any, p_s: float, states: Any, came_from: Any, places: Any, steps: Any
) -> Any:
    """The least and the largest net loss, and the largest 1 - p dL/dp, down to ``places`` (k,) in ``steps``, (k, 3)."""
    out = np.empty((len(places), 3))
    for k in range(len(places)):
        back = trace_back(states, came_from, places[k], steps[k])
        out[k, 0], out[k, 1] = _passed_above(values, bounds, p_s, back[0, 0])
        out[k, 2] = -np.inf
        for step in range(steps[k] + 1):
            net = interpolate_table(values, back[step, 0], NET)
            p = overburden[step] + p_s
            turn = p * back[step, 1] * interpolate_table(values, back[step, 0], INVERSE) - values[0, BETA]
            out[k, 0] = min(out[k, 0], net)
            out[k, 1] = max(out[k, 1], net)
            out[k, 2] = max(out[k, 2], turn)
    return out
