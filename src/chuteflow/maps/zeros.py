"""The flows that a grid of trajectories shows, as accurately as the grid allows without solving any.

# notation: P overburden, p normal stress, L, y, k, a, net as in chuteflow.trajectories.tables; B = y - b(L) the
# residual of the base condition; ln Q = ln(S + G), S = F1 sqrt(T) P the flux at the slip velocity, G that by shear.

Along a trajectory all derivatives are known; across, they are taken through the neighbours at the same depth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.compiled import compiled
from chuteflow.steady.kernel import closures
from chuteflow.steady.model import CONDUCTION, COUPLING, GAMMA, LOSS, SHEAR, WALL_SHEAR, WORK
from chuteflow.trajectories import kernel
from chuteflow.trajectories.kernel import DILUTE, DILUTE_WEIGHT, S_G, S_L, S_T, S_Y
from chuteflow.trajectories.refining import TrajectoryGrid

Index = NDArray[np.int64]

#: Neighbours are in one piece of the curve where they are nearer, in distances that are refined.
_APART = 2.5
#: Polynomials go through neighbours whose gaps differ by less than this factor.
_EVEN = 12.0
#: Weights of a cubic whose sizes sum to more extrapolate.
_SOUND = 3.0
#: Zeros are near to each other within this fraction of the distances around.
_NEAR = 0.3
#: Surface temperatures of neighbours tell them apart if their logarithms differ by more.
_DISTINCT = 1e-7
#: Rounds of false position.
_FALSE_POSITIONS = 3
#: What is known of a flow with its base at a state: ln M, ln Q, Q, B; derivatives to ln P, and from neighbour to
#: neighbour; those of the flux that the base gives and, at the slip velocity, of ln Q to L.
(
    LOG_M, LOG_Q, FLUX, RESIDUAL, L_DOWN, Y_DOWN, RESIDUAL_DOWN, FLUX_DOWN, RESIDUAL_ACROSS, FLUX_ACROSS, BASE_SLOPE,
    FLUX_SLOPE,
) = range(12)  # fmt: skip
_KNOWN = 12


@dataclass(frozen=True, eq=False)
class Zeros:
    """The zeros of B on a grid, (Z,) each: ln Q, ln M, ln T_surface; ``rise``, the derivative of ln Q along the zeros
    to a factor of one sign on each branch; ``extremes`` (Z, 6) lower and upper bounds of the least and the largest net
    loss and the largest 1 - p dL/dp, and how far these are in ``doubt`` (Z, 3) for their place between states. Those
    that are ``scattered`` (Z,) lie between two trajectories whose surface temperatures are too near to tell them apart:
    their ln Q is known to 1e-2 alone."""

    grid: TrajectoryGrid
    log_q: Array
    log_m: Array
    log_t: Array
    rise: Array
    extremes: Array
    doubt: Array
    scattered: NDArray[np.bool_]

    def along(self, line: Index) -> Index:
        """The zeros of a line that tell how quantities go along it: without the scattered ones that are between two
        others, and without those that lie much nearer to each other than others around."""
        out = self.scattered[line]
        out[[0, -1]] = False
        out[1:-1] &= ~out[:-2] & ~out[2:]
        line = line[~out]
        return line[_thin(np.stack([self.log_q[line], self.log_m[line], self.log_t[line]], axis=1))]

    def traced(self, which: Index) -> Array:
        """The extrema (k, 3) at some of the zeros, along their trajectories as they are known between others."""
        grid = self.grid
        zeros = grid.zeros[which]
        rows = grid.steps_of(zeros[:, :2].astype(np.int64))
        places = np.where(rows[:, 0] == rows[:, 1], zeros[:, 0] + zeros[:, 2], zeros[:, 1])
        return kernel.find_extremes(
            grid.values, grid.bounds, grid.overburden, grid.model.surface_stress, grid.states, grid.came_from, places,
            rows[:, 1],
        )  # fmt: skip


def bound_extremes(grid: TrajectoryGrid) -> Array:
    """Bounds of what trajectories have had down to each state, whatever their base, (N, 6), as in :class:`Zeros`."""
    return kernel.bound_extremes(
        grid.values, grid.bounds, grid.overburden, grid.model.surface_stress, grid.states, grid.came_from, grid.first
    )


def evaluate_zeros(grid: TrajectoryGrid, extremes: Array) -> Zeros:
    """The zeros of B on ``grid``, given its ``extremes`` (N, 6)."""
    model = grid.model
    found, bounds, doubt, scattered = _evaluate(
        model.table.compiled, model.constants, grid.overburden, grid.states, grid.first, grid.zeros, extremes,
        1.0 / grid.scale, _APART * grid.refinement.delta,
    )  # fmt: skip
    log_q, log_m, log_t, rise = found
    return Zeros(grid, log_q, log_m, log_t, rise, bounds, doubt, scattered)


@compiled
def _evaluate(
    table: Any, constants: Any, overburden: Any, states: Any, first: Any, zeros: Any, extremes: Any, per_flux: float,
    apart: float,
) -> tuple[Any, Any, Any, Any]:  # fmt: skip
    """ln Q, ln M, ln T_surface and the rise of ln Q at the zeros (4, Z), bounds (Z, 6) of their extrema, how far these
    are in doubt (Z, 3), and whether they are scattered (Z,), as in :class:`Zeros`.

    ``apart`` is the distance of neighbours on one piece of the curve at most, with heat fluxes times ``per_flux``.
    """
    count = len(zeros)
    found, bounds, doubt = np.empty((4, count)), np.empty((count, 6)), np.empty((count, 3))
    scattered = np.zeros(count, np.bool_)
    known = np.empty((2 * count + 1, _KNOWN))
    where = np.full(len(states), -1, np.int64)
    used = row = 0
    f, four = np.empty(16), np.empty(5)
    for z in range(count):
        one, two, share = int(zeros[z, 0]), int(zeros[z, 1]), zeros[z, 2]
        while first[row + 1] <= two:
            row += 1
        across = one >= first[row]
        for i, at in ((one, row if across else row - 1), (two, row)):
            if where[i] < 0:
                where[i] = used
                _evaluate_state(table, constants, overburden[at], states[i], f, known[used])
                _take_across(states, i, first[at], first[at + 1] - 1, per_flux, apart, known[used])
                used += 1
        start, end = known[where[one]], known[where[two]]
        step = end[LOG_M] - start[LOG_M]
        place = share
        log_t = states[one, S_T]
        if across:
            _through_four(
                table, constants, overburden[row], states, one, first[row], first[row + 1] - 1, per_flux, apart,
                share, f, four,
            )  # fmt: skip
            place, log_q, log_t, big_l, y = four[0], four[1], four[2], four[3], four[4]
            scattered[z] = abs(states[two, S_T] - states[one, S_T]) < _DISTINCT
        else:
            # Along a trajectory: Hermite's cubic in ln P.
            place = _hermite_zero(
                start[RESIDUAL], end[RESIDUAL], start[RESIDUAL_DOWN] * step, end[RESIDUAL_DOWN] * step, share
            )
            log_q = _hermite(start[LOG_Q], end[LOG_Q], start[FLUX_DOWN] * step, end[FLUX_DOWN] * step, place)
            big_l = _hermite(states[one, S_L], states[two, S_L], start[L_DOWN] * step, end[L_DOWN] * step, place)
            y = _hermite(states[one, S_Y], states[two, S_Y], start[Y_DOWN] * step, end[Y_DOWN] * step, place)
        log_m = start[LOG_M] + place * step
        residual_down = start[RESIDUAL_DOWN] + share * (end[RESIDUAL_DOWN] - start[RESIDUAL_DOWN])
        residual_across = start[RESIDUAL_ACROSS] + share * (end[RESIDUAL_ACROSS] - start[RESIDUAL_ACROSS])
        flux_down = start[FLUX_DOWN] + share * (end[FLUX_DOWN] - start[FLUX_DOWN])
        flux_across = start[FLUX_ACROSS] + share * (end[FLUX_ACROSS] - start[FLUX_ACROSS])
        size = abs(residual_down) + abs(residual_across) + abs(flux_down) + abs(flux_across) + 1e-300
        found[0, z], found[1, z], found[2, z] = log_q, log_m, log_t
        found[3, z] = (flux_across * residual_down - flux_down * residual_across) / size
        # The extrema are those above, or those at the base.
        last = two if across else one
        for q in range(6):
            difference = extremes[last, q] - extremes[one, q]
            bounds[z, q] = extremes[one, q] + place * difference
        for q in range(3):
            doubt[z, q] = 0.5 * abs(extremes[last, q] - extremes[one, q])
        closures(table, math.exp(big_l), f)
        over = math.exp(log_m)
        net = f[LOSS] - constants[0] ** 2 * f[WORK]
        curving = (over + constants[1]) * y / f[CONDUCTION] - constants[7]
        for q in (0, 3):
            bounds[z, q] = min(bounds[z, q], net)
            bounds[z, q + 1] = max(bounds[z, q + 1], net)
            bounds[z, q + 2] = max(bounds[z, q + 2], curving)
    return found, bounds, doubt, scattered


@compiled
def _evaluate_flow(table: Any, constants: Any, over: float, state: Any, f: Any) -> tuple[float, float, float]:
    """B, ln Q, and the fraction of Q at the slip velocity, of a flow with its base at a state under the overburden
    ``over``; the closures there into ``f`` (16,)."""
    closures(table, math.exp(state[S_L]), f)
    slip = constants[4] + constants[5] * f[SHEAR] + constants[6] * f[WALL_SHEAR]
    residual = state[S_Y] - (constants[0] * slip - constants[3] - constants[8] * f[WALL_SHEAR])
    slip_flux = slip * math.exp(0.5 * (math.log(over + constants[1]) + f[GAMMA] - state[S_L])) * over
    flux = slip_flux + state[S_G]
    return residual, math.log(flux), slip_flux / flux


@compiled
def _evaluate_state(table: Any, constants: Any, over: float, state: Any, f: Any, out: Any) -> None:
    """What is known of a flow with its base at a state: its entries but those across, into ``out`` (_KNOWN,)."""
    slope, beta = constants[0], constants[7]
    residual, log_q, share = _evaluate_flow(table, constants, over, state, f)
    p = over + constants[1]
    y = state[S_Y]
    df = f[8:]
    slip = constants[4] + constants[5] * f[SHEAR] + constants[6] * f[WALL_SHEAR]
    slip_slope = constants[5] * df[SHEAR] + constants[6] * df[WALL_SHEAR]
    turn = p * y / f[CONDUCTION] - beta
    still = 1.0 - turn
    warming = turn + f[COUPLING] * still
    dilation = over / p
    l_down = dilation * still
    y_down = over * (f[LOSS] - slope**2 * f[WORK]) - dilation * y * (1.0 + 0.5 * warming)
    by_l = slip_slope / slip + 0.5 * (df[GAMMA] - 1.0)
    root_t = math.exp(0.5 * (math.log(p) + f[GAMMA] - state[S_L]))
    out[LOG_M] = math.log(over)
    out[LOG_Q] = log_q
    out[RESIDUAL] = residual
    out[L_DOWN], out[Y_DOWN] = l_down, y_down
    out[BASE_SLOPE] = slope * slip_slope - constants[8] * df[WALL_SHEAR]
    out[RESIDUAL_DOWN] = y_down - out[BASE_SLOPE] * l_down
    out[FLUX_SLOPE] = share * by_l
    out[FLUX] = math.exp(log_q)
    out[FLUX_DOWN] = share * (1.0 + 0.5 * dilation + by_l * l_down) + slope * over**2 * f[WORK] * root_t / out[FLUX]


@compiled
def _label(states: Any, around: Any, per_flux: float, labels: Any, distance: Any) -> None:
    """Labels (n,) of neighbours on the curve, to a factor, and their distances (n - 1,) from each other."""
    resolved = True
    for k in range(len(around) - 1):
        one, two = states[around[k]], states[around[k + 1]]
        place_one = one[S_L] if one[S_L] > DILUTE else DILUTE + DILUTE_WEIGHT * (one[S_L] - DILUTE)
        place_two = two[S_L] if two[S_L] > DILUTE else DILUTE + DILUTE_WEIGHT * (two[S_L] - DILUTE)
        distance[k] = math.hypot(place_two - place_one, (two[S_Y] - one[S_Y]) * per_flux)
        resolved &= two[S_T] - one[S_T] > _DISTINCT
    labels[0] = 0.0
    for k in range(len(around) - 1):
        gap = states[around[k + 1], S_T] - states[around[k], S_T] if resolved else max(distance[k], 1e-14)
        labels[k + 1] = labels[k] + gap


@compiled
def _take_across(
    states: Any, place: int, low: int, high: int, per_flux: float, apart: float, out: Any
) -> None:  # fmt: skip
    """Derivatives of B and ln Q along the curve at a state, per gap to an inner neighbour, into its ``out``; its depth
    has the states from ``low`` to ``high``."""
    around = np.empty(5, np.int64)
    for k in range(5):
        around[k] = min(max(place + k - 2, low), high)
    labels, distance = np.empty(5), np.empty(4)
    _label(states, around, per_flux, labels, distance)
    joined = np.empty(4, np.bool_)
    widest, narrowest = 0.0, np.inf
    for k in range(4):
        joined[k] = distance[k] < apart and around[k + 1] > around[k]
        gap = labels[k + 1] - labels[k]
        widest, narrowest = max(widest, gap), min(narrowest, gap)
    begin, end = 2, 3
    if joined.all() and widest < _EVEN * narrowest:
        begin, end = 0, 5
    elif joined[1] and joined[2]:
        begin, end = 1, 4
    l_across = y_across = shear_across = 0.0
    if end - begin > 1:
        # Each state has its own unit: derivatives are compared with others at the same state alone.
        unit = labels[2] - labels[1]
        middle = 0.0
        for k in range(begin, end):
            if k == 2:
                continue
            at = (labels[k] - labels[2]) / unit
            weight = 1.0 / at
            for j in range(begin, end):
                if j not in (k, 2):
                    other = (labels[j] - labels[2]) / unit
                    weight *= -other / (at - other)
            middle -= weight
            l_across += weight * states[around[k], S_L]
            y_across += weight * states[around[k], S_Y]
            shear_across += weight * states[around[k], S_G]
        l_across += middle * states[place, S_L]
        y_across += middle * states[place, S_Y]
        shear_across += middle * states[place, S_G]
    elif joined[1] or joined[2]:
        one, two = (around[1], around[2]) if joined[1] else (around[2], around[3])
        l_across = states[two, S_L] - states[one, S_L]
        y_across = states[two, S_Y] - states[one, S_Y]
        shear_across = states[two, S_G] - states[one, S_G]
    out[RESIDUAL_ACROSS] = y_across - out[BASE_SLOPE] * l_across
    out[FLUX_ACROSS] = out[FLUX_SLOPE] * l_across + shear_across / out[FLUX]


@compiled
def _through_four(
    table: Any, constants: Any, over: float, states: Any, left: int, low: int, high: int, per_flux: float,
    apart: float, share: float, f: Any, out: Any,
) -> None:  # fmt: skip
    """The fraction of the way at a zero between the state ``left`` and the next, and there ln Q, ln T_surface, L and y,
    into ``out`` (5,): of the cubic through four neighbours where they are in one piece and even enough, else on the
    line."""
    around = np.arange(left - 1, left + 3)
    values = np.zeros((4, 5))
    even = around[0] >= low and around[3] <= high
    labels, distance = np.empty(4), np.empty(3)
    inner = 0.0
    if even:
        _label(states, around, per_flux, labels, distance)
        inner = labels[2] - labels[1]
        for k in range(3):
            even &= distance[k] < apart
            gap = labels[k + 1] - labels[k]
            even &= k == 1 or inner < _EVEN * gap < _EVEN**2 * inner
    for k in range(4) if even else range(1, 3):
        residual, log_q, _ = _evaluate_flow(table, constants, over, states[around[k]], f)
        values[k, 0], values[k, 1], values[k, 2] = residual, log_q, states[around[k], S_T]
        values[k, 3], values[k, 4] = states[around[k], S_L], states[around[k], S_Y]
    weights = np.array([0.0, 1.0 - share, share, 0.0])
    out[0] = share
    if even:
        at = (labels - labels[1]) / inner
        cubic = np.empty(4)
        place = _cubic_zero(at, values[:, 0], share, cubic)
        _weigh(at, place, cubic)
        if np.abs(cubic).sum() < _SOUND:
            weights, out[0] = cubic, place
    for q in range(1, 5):
        out[q] = (weights * values[:, q]).sum()


@compiled
def _weigh(at: Any, x: float, out: Any) -> None:
    """Weights (4,) of cubic interpolation at ``x`` from values at ``at`` (4,), into ``out``."""
    for i in range(4):
        out[i] = 1.0
        for j in range(4):
            if j != i:
                out[i] *= (x - at[j]) / (at[i] - at[j])


@compiled
def _cubic_zero(at: Any, values: Any, start: float, weights: Any) -> float:
    """The zero between 0 and 1 of the cubic through ``values`` (4,) at ``at`` (4,), by false position from ``start``;
    ``weights`` (4,) is overwritten."""
    low, high = 0.0, 1.0
    _weigh(at, low, weights)
    f_low = (weights * values).sum()
    _weigh(at, high, weights)
    f_high = (weights * values).sum()
    x = start
    for _ in range(_FALSE_POSITIONS):
        _weigh(at, x, weights)
        low, f_low, high, f_high, x = _close_in(low, f_low, high, f_high, x, (weights * values).sum())
    return x


@compiled
def _hermite_zero(one: float, two: float, slope_one: float, slope_two: float, start: float) -> float:
    """The zero between 0 and 1 of Hermite's cubic, by false position from ``start``."""
    low, f_low, high, f_high, x = 0.0, one, 1.0, two, start
    for _ in range(_FALSE_POSITIONS):
        low, f_low, high, f_high, x = _close_in(
            low, f_low, high, f_high, x, _hermite(one, two, slope_one, slope_two, x)
        )
    return x


@compiled
def _close_in(
    low: float, f_low: float, high: float, f_high: float, x: float, f: float
) -> tuple[float, float, float, float, float]:
    """A bracket of a zero, with the values at its ends, closer by the value at ``x``; and the next place to try."""
    if (f > 0.0) == (f_low > 0.0):
        low, f_low = x, f
    else:
        high, f_high = x, f
    span = f_high - f_low
    return low, f_low, high, f_high, min(max(low - f_low * (high - low) / (span if span != 0.0 else 1.0), 0.0), 1.0)


@compiled
def _hermite(one: float, two: float, slope_one: float, slope_two: float, t: float) -> float:
    rise = two - one
    return one + t * rise + t * (1.0 - t) * ((1.0 - t) * (slope_one - rise) - t * (slope_two - rise))


@compiled
def _thin(places: Array) -> Any:
    """Which of successive ``places`` (k, 3) to keep, of those that lie much nearer to each other than others around:
    the first and the last, and so many between that none is near the one before."""
    count = len(places)
    apart = np.empty(max(count - 1, 1))
    for i in range(count - 1):
        apart[i] = np.sqrt(np.sum((places[i + 1] - places[i]) ** 2))
    kept = np.zeros(count, np.bool_)
    kept[0] = True
    last = 0
    for i in range(1, count):
        around = apart[max(i - 2, 0) : i + 2].mean()
        near = np.sqrt(np.sum((places[i] - places[last]) ** 2)) < max(_NEAR * around, 1e-9)
        if near and i < count - 1:
            continue
        if near and last > 0:
            kept[last] = False
        kept[i] = True
        last = i
    return kept
