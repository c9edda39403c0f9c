"""The flows that a grid of trajectories shows, as accurately as the grid allows without solving any.

# notation: P overburden, p normal stress, L, y, k, a, net as in chuteflow.trajectories.tables; B = y - b(L) the
# residual of the base condition; ln Q = ln(S + G), S = F1 sqrt(T) P the flux at the slip velocity, G that by shear.

Along a trajectory all derivatives are known; across, they are taken through the neighbours at the same depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.compiled import compiled
from chuteflow.numerics.interpolation import lagrange
from chuteflow.numerics.roots import false_position
from chuteflow.steady.model import CONDUCTION, COUPLING, GAMMA, LOSS, WORK
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
        return line[_thinned(np.stack([self.log_q[line], self.log_m[line], self.log_t[line]], axis=1))]

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
    ends = grid.zeros[:, :2].astype(np.int64)
    share = grid.zeros[:, 2]
    rows = grid.steps_of(ends)
    across = rows[:, 0] == rows[:, 1]
    used, back = np.unique(ends, return_inverse=True)
    known = _StateValues.at(grid, used, np.searchsorted(grid.first, used, side="right") - 1)
    one, two = back.reshape(ends.shape).T

    # Along a trajectory: Hermite's cubic in ln P.
    step = known.log_m[two] - known.log_m[one]
    place = share.copy()
    down = ~across
    one_down, two_down, apart = one[down], two[down], step[down]
    ends_down = known.residual[one_down], known.residual[two_down]
    slopes = known.residual_down[one_down] * apart, known.residual_down[two_down] * apart
    place[down] = false_position(lambda t: _hermite(*ends_down, *slopes, t), share[down])

    def between(of: Array, down: Array) -> Array:
        return _hermite(of[one], of[two], down[one] * step, down[two] * step, place)

    log_q = between(known.log_q, known.flux_down)
    big_l, y = between(known.big_l, known.l_down), between(known.y, known.y_down)
    log_m = known.log_m[one] + place * step
    log_t = grid.states[ends[:, 0], S_T].copy()
    # Through four neighbours at one depth.
    place[across], found = _through_four(grid, ends[across, 0], rows[across, 0], share[across])
    log_q[across], log_t[across], big_l[across], y[across] = found

    residual_down, residual_across, flux_down, flux_across = (
        of[one] + share * (of[two] - of[one])
        for of in (known.residual_down, known.residual_across, known.flux_down, known.flux_across)
    )
    size = np.abs(residual_down) + np.abs(residual_across) + np.abs(flux_down) + np.abs(flux_across) + 1e-300
    rise = (flux_across * residual_down - flux_down * residual_across) / size
    # The extrema are those above, or those at the base.
    low, high = extremes[ends[:, 0]], np.where(down[:, None], extremes[ends[:, 0]], extremes[ends[:, 1]])
    bounds, doubt = low + place[:, None] * (high - low), 0.5 * np.abs(high - low)[:, :3]
    net, curving = _at_base(grid, big_l, y, np.exp(log_m))
    bounds[:, ::3] = np.minimum(bounds[:, ::3], net[:, None])
    bounds[:, 1::3] = np.maximum(bounds[:, 1::3], net[:, None])
    bounds[:, 2::3] = np.maximum(bounds[:, 2::3], curving[:, None])
    scattered = across & (np.abs(grid.states[ends[:, 1], S_T] - grid.states[ends[:, 0], S_T]) < _DISTINCT)
    return Zeros(grid, log_q, log_m, log_t, rise, bounds, doubt, scattered)


def _at_base(grid: TrajectoryGrid, big_l: Array, y: Array, over: Array) -> tuple[Array, Array]:
    """The net loss and 1 - p dL/dp at the base, (k,) each."""
    model = grid.model
    f, _ = model.closures(np.exp(big_l))
    net = f[LOSS] - model.slope**2 * f[WORK]
    return net, (over + model.surface_stress) * y / f[CONDUCTION] - model.beta


@dataclass(frozen=True, eq=False)
class _StateValues:
    """What is known at states (k,): ln M, L, y, B, ln Q, and their derivatives to ln P and from neighbour to
    neighbour."""

    log_m: Array
    big_l: Array
    y: Array
    residual: Array
    log_q: Array
    l_down: Array
    y_down: Array
    residual_down: Array
    flux_down: Array
    residual_across: Array
    flux_across: Array

    @classmethod
    def at(cls, grid: TrajectoryGrid, places: Index, rows: Index) -> _StateValues:
        model = grid.model
        over = grid.overburden[rows]
        p = over + model.surface_stress
        big_l, y, _t, _h, shear_flux = grid.states[places].T
        f, df = model.closures(np.exp(big_l))
        base, base_slope = model.base_flux(f), model.base_flux_slope(df)
        slip = model.slip(f)
        root_t = np.exp(0.5 * (np.log(p) + f[GAMMA] - big_l))
        slip_flux = slip * root_t * over
        flux = slip_flux + shear_flux
        turn = p * y / f[CONDUCTION] - model.beta
        still = 1.0 - turn
        warming = turn + f[COUPLING] * still
        dilation, share = over / p, slip_flux / flux
        l_down = dilation * still
        y_down = over * (f[LOSS] - model.slope**2 * f[WORK]) - dilation * y * (1.0 + 0.5 * warming)
        by_l = model.slip_slope(df) / slip + 0.5 * (df[GAMMA] - 1.0)
        shear_down = model.slope * over**2 * f[WORK] * root_t
        l_across, y_across, shear_across = _across(grid, places, rows)
        return cls(
            np.log(over),
            big_l,
            y,
            y - base,
            np.log(flux),
            l_down,
            y_down,
            y_down - base_slope * l_down,
            share * (1.0 + 0.5 * dilation + by_l * l_down) + shear_down / flux,
            y_across - base_slope * l_across,
            share * by_l * l_across + shear_across / flux,
        )


def _labels(grid: TrajectoryGrid, around: Index) -> tuple[Array, NDArray[np.bool_]]:
    """Labels (k, n) of neighbours on the curve, to a factor for each row, and whether they are in one piece (n - 1)."""
    state = grid.states[around]
    big_l = state[..., S_L]
    place = np.where(big_l > DILUTE, big_l, DILUTE + DILUTE_WEIGHT * (big_l - DILUTE))
    apart = np.hypot(np.diff(place, axis=1), np.diff(state[..., S_Y], axis=1) / grid.scale)
    gaps = np.diff(state[..., S_T], axis=1)
    resolved = (gaps > _DISTINCT).all(axis=1, keepdims=True)
    gaps = np.where(resolved, gaps, np.maximum(apart, 1e-14))
    joined = apart < _APART * grid.refinement.delta
    labels = np.concatenate([np.zeros((len(around), 1)), np.cumsum(gaps, axis=1)], axis=1)
    return labels, joined


def _across(grid: TrajectoryGrid, places: Index, rows: Index) -> Array:
    """Derivatives (3, k) of L, y and G along the curve at states, per gap between the inner neighbours."""
    low, high = grid.first[rows], grid.first[rows + 1] - 1
    around = np.clip(places[:, None] + np.arange(-2, 3), low[:, None], high[:, None])
    labels, joined = _labels(grid, around)
    joined &= np.diff(around, axis=1) > 0
    values = grid.states[around][..., [S_L, S_Y, S_G]]
    gaps = np.diff(labels, axis=1)
    out = np.zeros((len(places), 3))
    unit = np.where(joined[:, 1], gaps[:, 1], gaps[:, 2])
    five = joined.all(axis=1) & (gaps.max(axis=1) < _EVEN * gaps.min(axis=1))
    three = joined[:, 1:3].all(axis=1) & ~five
    for which, columns in ((five, slice(0, 5)), (three, slice(1, 4))):
        if which.any():
            at = (labels[which] - labels[which, 2:3])[:, columns] / unit[which, None]
            out[which] = np.einsum("kn,knq->kq", _slope_weights(at), values[which][:, columns])
    left, right = joined[:, 1] & ~three & ~five, joined[:, 2] & ~joined[:, 1]
    out[left] = values[left, 2] - values[left, 1]
    out[right] = values[right, 3] - values[right, 2]
    # Each state has its own unit: derivatives are compared with others at the same state alone.
    return out.T


def _slope_weights(at: Array) -> Array:
    """Weights (k, n) of the derivative at 0, the middle one of the places ``at`` (k, n), of the polynomial through
    values there."""
    count = at.shape[1]
    middle = count // 2
    out = np.zeros_like(at)
    others = [i for i in range(count) if i != middle]
    for i in others:
        rest = [j for j in others if j != i]
        out[:, i] = np.prod(-at[:, rest] / (at[:, [i]] - at[:, rest]), axis=1) / at[:, i]
    out[:, middle] = -out[:, others].sum(axis=1)
    return out


def _through_four(grid: TrajectoryGrid, left: Index, rows: Index, share: Array) -> tuple[Array, Array]:
    """The fraction of the way at zeros between states ``left`` and the next, and there ln Q, ln T_surface, L and y (4,
    k): of the cubic through four neighbours where they are in one piece and even enough, else on the line."""
    around = left[:, None] + np.arange(-1, 3)
    low, high = grid.first[rows], grid.first[rows + 1] - 1
    inside = (around[:, 0] >= low) & (around[:, 3] <= high)
    around = np.clip(around, low[:, None], high[:, None])
    labels, joined = _labels(grid, around)
    state = grid.states[around]
    quantities = grid.quantities(around)
    f, _ = grid.model.closures(np.exp(state[..., S_L]))
    residual = state[..., S_Y] - grid.model.base_flux(f)
    weights = np.zeros(around.shape)
    weights[:, 1], weights[:, 2] = 1.0 - share, share
    gaps = np.diff(labels, axis=1)
    even = inside & joined.all(axis=1)
    even &= (gaps[:, [0, 2]] < _EVEN * gaps[:, 1:2]).all(axis=1) & (gaps[:, [0, 2]] * _EVEN > gaps[:, 1:2]).all(axis=1)
    if even.any():
        at = ((labels[even] - labels[even, 1:2]) / gaps[even, 1:2]).T
        values = residual[even].T
        place = false_position(lambda x: (lagrange(at, x) * values).sum(axis=0), share[even])
        cubic = lagrange(at, place)
        sound = np.abs(cubic).sum(axis=0) < _SOUND
        even[even] = sound
        weights[even] = cubic[:, sound].T
        share = share.copy()
        share[even] = place[sound]
    of = np.stack([quantities[..., 0], quantities[..., 3], state[..., S_L], state[..., S_Y]])
    return share, (of * weights).sum(axis=-1)


def _hermite(one: Array, two: Array, slope_one: Array, slope_two: Array, t: Array) -> Array:
    rise = two - one
    return one + t * rise + t * (1.0 - t) * ((1.0 - t) * (slope_one - rise) - t * (slope_two - rise))


@compiled
def _thinned(places: Array) -> Any:
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
