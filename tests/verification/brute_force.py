"""All steady flows of a chute by brute force, with closures, variables, integration and search of its own.

Nothing of the program is used. The coordinate is the normal stress p, in which (3.8) reads g1 T = p. The unknowns are
theta = ln T and the heat flux q of (3.6), from the surface down by the classical Runge-Kutta method with small steps:

    dtheta/dp = a1 y + a2/p,   dq/dp = -a3 p sqrt(T),   y = q/(p sqrt(T)),

where a1, a2 and a3 depend on nu, which the logarithm of p/T gives. A base of a flow is where y = s F1 - loss: (3.17).
At each depth the states of all trajectories form a curve, along which the surface temperature rises; trajectories are
inserted where neighbours are further apart than ``delta``. Each strip between two depths is cut into triangles that
fit together, in which the residual of the base condition is taken as linear. Its zeros form segments, and the flows
with a given Q, h or M are where these take the value.

A count of flows is *decided* if it is the same a little above and below the value: else a fold is closer than the
resolution. At a given surface temperature there is one trajectory, and the count is decided if small changes of the
temperature and half the steps do not change it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np

PACKED = 0.62
#: (3.31), with the misprint mended: sqrt(pi)/48.
INTERFACE = math.sqrt(math.pi) / 48.0
#: The table of functions of kappa = ln(p/T): its first place, its step and number.
FIRST, SPACING, PLACES = -28.0, 0.02, 5400
A1, A2, A3, COMPRESSION, SHEAR, BASE, SLIP = range(7)
#: A state: theta, q, ln T_surface, and the integrals of z and u over the mass above.
THETA, HEAT, LABEL, HEIGHT, GLIDE = range(5)
#: What a zero has: ln Q, ln h, ln M, ln T_surface.
QUANTITIES = ("Q", "h", "M", "T_surface")
#: By how much ln Q, ln h and ln M are changed to see whether a fold is near, and ln T_surface.
NEAR, NEAR_T = 1e-3, 1e-8


class Chute(NamedTuple):
    """What determines the flows, in the words of the paper."""

    slope: float
    e: float
    e_w: float
    r: float
    surface: str = "free"
    closure: str = "lun"

    @property
    def surface_stress(self) -> float:
        return INTERFACE if self.surface == "interface" else 0.0


@dataclass(frozen=True)
class Fineness:
    """How finely the curve is followed: distance of neighbours, steps in ln p and in p, trajectories a decade."""

    delta: float = 0.03
    log_step: float = 0.06
    step: float = 0.03
    per_decade: int = 30
    most: int = 150_000


@dataclass(frozen=True)
class Found:
    """The flows (n, 4) by ln Q, ln h, ln M, ln T_surface, and whether their number is decided."""

    flows: np.ndarray
    decided: bool
    why: str = ""


def closures(nu: np.ndarray, free_fraction: np.ndarray, e: float, closure: str) -> tuple[np.ndarray, ...]:
    """g0, G = g1/nu, g1', g2, g3, g4 and g5/nu^2 of table 1, with ``free_fraction`` = 1 - nu/nu*."""
    g0 = free_fraction ** (-2.5 * PACKED)
    x = nu * g0
    root_pi = math.sqrt(math.pi)
    compression = 1.0 + 2.0 * (1.0 + e) * x
    g1_slope = compression + 2.0 * (1.0 + e) * x * (1.0 + 2.5 * nu / free_fraction)
    dense = nu * x * (1.0 + e)
    g2 = (5.0 + 4.0 * (1.0 + e) * x) * (5.0 + 2.0 * (1.0 + e) * (3.0 * e - 1.0) * x)
    g2 = root_pi * g2 / (120.0 * (3.0 - e) * (1.0 + e) * g0) + 4.0 / (5.0 * root_pi) * dense
    g3 = (5.0 + 6.0 * (1.0 + e) * x) * (5.0 + 3.0 * (1.0 + e) ** 2 * (2.0 * e - 1.0) * x)
    g3 = root_pi * g3 / (4.0 * (1.0 + e) * (49.0 - 33.0 * e) * g0) + 2.0 / root_pi * dense
    g4 = 3.0 * root_pi * (5.0 + 6.0 * (1.0 + e) * x) / (4.0 * (49.0 - 33.0 * e)) * e * (1.0 - e)
    g4 = g4 * (2.0 + 2.5 * nu / free_fraction) if closure == "lun" else np.zeros_like(nu)
    return g0, compression, g1_slope, g2, g3, g4, 12.0 / root_pi * (1.0 - e**2) * g0


def of_logit(logit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """nu and 1 - nu/nu* of ln(nu/(nu* - nu)), both to rounding."""
    return PACKED / (1.0 + np.exp(-logit)), 1.0 / (1.0 + np.exp(logit))


def functions(chute: Chute, kappa: np.ndarray) -> np.ndarray:
    """The seven functions of kappa = ln g1, (len(kappa), 7)."""
    low, high = np.full_like(kappa, -60.0), np.full_like(kappa, 60.0)
    for _ in range(64):
        middle = 0.5 * (low + high)
        nu, free_fraction = of_logit(middle)
        above = np.log(nu * (1.0 + 2.0 * (1.0 + chute.e) * nu * free_fraction ** (-2.5 * PACKED))) > kappa
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    nu, free_fraction = of_logit(0.5 * (low + high))
    s, r = chute.slope, chute.r
    g0, compression, g1_slope, g2, g3, g4, g5 = closures(nu, free_fraction, chute.e, chute.closure)
    g1 = nu * compression
    conduction = g3 + g4 * g1 / g1_slope
    lid = math.sqrt(1.0 - r * r)
    kappa_r = 2.0 / 3.0 * (2.0 / (1.0 + lid) - lid)
    bumps = nu + math.pi / (12.0 * math.sqrt(2.0)) * (nu + 5.0 / (8.0 * g0))
    slip = s / kappa_r * (math.sqrt(0.5 * math.pi) + (kappa_r * nu - 0.5 * bumps * r * r) * compression / g2)
    loss = math.sqrt(2.0 / math.pi) * 2.0 * (1.0 - chute.e_w) / (1.0 + lid)
    out = (
        compression / conduction,
        g4 * g1 / (g1_slope * conduction),
        (compression**2 * s * s / g2 - g5) / compression,
        compression,
        s * compression / g2,
        s * slip - loss,
        slip,
    )
    return np.stack(out, axis=1)


def balances(chute: Chute) -> tuple[float, float]:
    """The least slope at which loss balances the work of shear at some density, and that at the densest."""
    nu = np.linspace(1e-3, PACKED - 1e-7, 4000)
    _, compression, _, g2, _, _, g5 = closures(nu, 1.0 - nu / PACKED, chute.e, chute.closure)
    slopes = np.sqrt(g5 * g2) / compression
    return float(slopes.min()), float(slopes[-1])


def table(chute: Chute) -> np.ndarray:
    """The functions and their slopes by differences of sixth order, for Hermite interpolation, (PLACES, 7, 2)."""
    values = functions(chute, FIRST + SPACING * np.arange(-3, PLACES + 3))
    ahead = [values[3 + k : PLACES + 3 + k] - values[3 - k : PLACES + 3 - k] for k in (1, 2, 3)]
    slopes = (45.0 * ahead[0] - 9.0 * ahead[1] + ahead[2]) / 60.0
    return np.ascontiguousarray(np.stack([values[3:-3], slopes], axis=2))


@numba.njit(cache=True, error_model="numpy")
def place_of(kappa):
    """The entry of the table before kappa, and the fraction of the way to the next."""
    x = min(max((kappa - FIRST) / SPACING, 0.0), PLACES - 1.001)
    i = int(x)
    return i, x - i


@numba.njit(cache=True, error_model="numpy")
def at(entries, i, t, which):
    """One function between two entries."""
    f, f_slope = entries[i, which, 0], entries[i, which, 1]
    g, g_slope = entries[i + 1, which, 0], entries[i + 1, which, 1]
    d = g - f
    return f + t * (f_slope + t * (3.0 * d - 2.0 * f_slope - g_slope + t * (f_slope + g_slope - 2.0 * d)))


@numba.njit(cache=True, error_model="numpy")
def rates(entries, p, stress, theta, q):
    """d/dp of theta, q and the two integrals."""
    root = math.exp(0.5 * theta)
    i, t = place_of(math.log(p) - theta)
    over = p - stress
    d_theta = at(entries, i, t, A1) * q / (p * root) + at(entries, i, t, A2) / p
    d_q = -at(entries, i, t, A3) * p * root
    d_height = over * at(entries, i, t, COMPRESSION) * root * root / p
    d_glide = over * at(entries, i, t, SHEAR) * root
    return d_theta, d_q, d_height, d_glide


@numba.njit(cache=True, error_model="numpy")
def advance(entries, p, dp, stress, state):
    """One step of the classical Runge-Kutta method, in place."""
    th, q = state[THETA], state[HEAT]
    a0, a1, a2, a3 = rates(entries, p, stress, th, q)
    b0, b1, b2, b3 = rates(entries, p + 0.5 * dp, stress, th + 0.5 * dp * a0, q + 0.5 * dp * a1)
    c0, c1, c2, c3 = rates(entries, p + 0.5 * dp, stress, th + 0.5 * dp * b0, q + 0.5 * dp * b1)
    d0, d1, d2, d3 = rates(entries, p + dp, stress, th + dp * c0, q + dp * c1)
    state[THETA] = th + dp / 6.0 * (a0 + 2.0 * b0 + 2.0 * c0 + d0)
    state[HEAT] = q + dp / 6.0 * (a1 + 2.0 * b1 + 2.0 * c1 + d1)
    state[HEIGHT] += dp / 6.0 * (a2 + 2.0 * b2 + 2.0 * c2 + d2)
    state[GLIDE] += dp / 6.0 * (a3 + 2.0 * b3 + 2.0 * c3 + d3)


@numba.njit(cache=True, error_model="numpy")
def begin(entries, p, stress, surface_flux, log_t, state):
    """The state at the first depth ``p``, from the leading terms at the surface."""
    root = math.exp(0.5 * log_t)
    over = p - stress
    state[THETA] = log_t
    state[LABEL] = log_t
    if stress > 0.0:
        state[HEAT] = surface_flux * stress * root
        i, t = place_of(math.log(stress) - log_t)
        state[HEAT] -= at(entries, i, t, A3) * stress * root * over
        state[THETA] += (at(entries, i, t, A1) * surface_flux + at(entries, i, t, A2) / stress) * over
    else:
        i, t = place_of(math.log(p) - log_t)
        state[HEAT] = -0.5 * at(entries, i, t, A3) * p * p * root
        state[THETA] += at(entries, i, t, A2) - 0.5 * at(entries, i, t, A1) * at(entries, i, t, A3) * p
    i, t = place_of(math.log(p) - log_t)
    if stress > 0.0:
        state[HEIGHT] = 0.5 * over * over * at(entries, i, t, COMPRESSION) * root * root / p
    else:
        state[HEIGHT] = over * at(entries, i, t, COMPRESSION) * root * root
    state[GLIDE] = 0.5 * over * over * at(entries, i, t, SHEAR) * root


@numba.njit(cache=True, error_model="numpy")
def look(entries, p, state, scale, seen):
    """kappa, y, the residual of the base condition and the metric of kappa: ``seen`` (4,)."""
    kappa = math.log(p) - state[THETA]
    y = state[HEAT] * math.exp(-0.5 * state[THETA]) / p
    i, t = place_of(kappa)
    seen[0], seen[1], seen[2] = kappa, y, y - at(entries, i, t, BASE)
    # Nothing depends on a density that is small enough.
    thin = kappa + 5.0
    dense = thin + math.log1p(math.exp(-thin)) if thin > 0.0 else math.log1p(math.exp(thin))
    seen[3] = 0.1 * max(kappa, -20.0) + 0.9 * dense


@numba.njit(cache=True, error_model="numpy")
def quantities(entries, p, stress, state, out):
    """ln Q, ln h, ln M and ln T_surface of a flow that has its base here."""
    over = p - stress
    i, t = place_of(math.log(p) - state[THETA])
    flux = at(entries, i, t, SLIP) * math.exp(0.5 * state[THETA]) * over + state[GLIDE]
    out[0] = math.log(max(flux, 1e-300))
    out[1] = math.log(state[HEIGHT] / over)
    out[2] = math.log(over)
    out[3] = state[LABEL]


@numba.njit(cache=True, error_model="numpy")
def between(knots, values, x):
    """Monotone cubic interpolation between the second and the third of four knots (Fritsch and Butland's slopes)."""
    x0, x1, x2, x3 = knots
    f0, f1, f2, f3 = values
    h0, h1, h2 = x1 - x0, x2 - x1, x3 - x2
    d1 = (f2 - f1) / h1
    left = right = d1
    if h0 > 0.0:
        d0 = (f1 - f0) / h0
        left = 0.0 if d0 * d1 <= 0.0 else 3.0 * (h0 + h1) / ((2.0 * h1 + h0) / d0 + (h1 + 2.0 * h0) / d1)
    if h2 > 0.0:
        d2 = (f3 - f2) / h2
        right = 0.0 if d1 * d2 <= 0.0 else 3.0 * (h1 + h2) / ((2.0 * h1 + h2) / d2 + (h1 + 2.0 * h2) / d1)
    t = (x - x1) / h1
    return f1 + h1 * t * (left + t * (3.0 * d1 - 2.0 * left - right + t * (left + right - 2.0 * d1)))


@numba.njit(cache=True, error_model="numpy")
def insert(now, seen, places, knots, x, p, out):
    """A trajectory between two neighbours at one depth: theta, y, ln T_surface and the logarithms of the integrals."""
    a, b, c, d = places
    for q in (THETA, LABEL):
        out[q] = between(knots, (now[a, q], now[b, q], now[c, q], now[d, q]), x)
    y = between(knots, (seen[a, 1], seen[b, 1], seen[c, 1], seen[d, 1]), x)
    out[HEAT] = y * p * math.exp(0.5 * out[THETA])
    for q in (HEIGHT, GLIDE):
        logs = (math.log(now[a, q]), math.log(now[b, q]), math.log(now[c, q]), math.log(now[d, q]))
        out[q] = math.exp(between(knots, logs, x))


@numba.njit(cache=True, error_model="numpy")
def apart(seen, i, j, scale):
    return math.hypot(seen[j, 3] - seen[i, 3], (seen[j, 1] - seen[i, 1]) / scale)


@numba.njit(cache=True, error_model="numpy")
def zero_segment(entries, p0, p1, stress, corners, residuals, at_first, pair, one, other):
    """The ends of the zero line in a triangle, each by ln Q, ln h, ln M, ln T_surface; False if there is none."""
    n = 0
    for k in range(3):
        j = (k + 1) % 3
        if (residuals[k] >= 0.0) != (residuals[j] >= 0.0):
            fraction = residuals[k] / (residuals[k] - residuals[j])
            quantities(entries, p0 if at_first[k] else p1, stress, corners[k], one)
            quantities(entries, p0 if at_first[j] else p1, stress, corners[j], other)
            for c in range(4):
                pair[n, c] = one[c] + fraction * (other[c] - one[c])
            n += 1
    return n == 2


@numba.njit(cache=True, error_model="numpy")
def carry(entries, depths, stress, surface_flux, log_t, delta, scale, hot_limit, most, most_segments):
    """The segments of zeros (S, 2, 4), and the row reached."""
    rows = len(depths)
    now, new = np.empty((most, 5)), np.empty((most, 5))
    before = np.empty((most, 5))
    seen, seen_new = np.empty((most, 4)), np.empty((most, 4))
    linked, linked_new = np.empty(most, np.bool_), np.empty(most, np.bool_)
    parent = np.empty(most, np.int64)
    old_residual = np.empty(most)
    segments = np.empty((most_segments, 2, 4))
    corners, residuals, at_first = np.empty((3, 5)), np.empty(3), np.empty(3, np.bool_)
    pair, one, other = np.empty((2, 4)), np.empty(4), np.empty(4)
    s, n = 0, len(log_t)
    for i in range(n):
        begin(entries, depths[0], stress, surface_flux, log_t[i], now[i])
        look(entries, depths[0], now[i], scale, seen[i])
        linked[i] = i < n - 1
    for row in range(1, rows):
        p0, p1 = depths[row - 1], depths[row]
        for i in range(n):
            before[i] = now[i]
            old_residual[i] = seen[i, 2]
            advance(entries, p0, p1 - p0, stress, now[i])
            look(entries, p1, now[i], scale, seen[i])
            if not (seen[i, 1] > -1e6):
                now[i] = before[i]
                seen[i, 1] = -1e6
                seen[i, 2] = -1e6
                seen[i, 3] = 1e3
        # Insert: each gap of the old curve gets its own number of new trajectories.
        m = 0
        for i in range(n):
            if m + 10 >= most:
                return segments[:s], row
            new[m] = now[i]
            seen_new[m] = seen[i]
            parent[m] = i
            linked_new[m] = linked[i]
            m += 1
            if not linked[i]:
                continue
            gap = apart(seen, i, i + 1, scale)
            if seen[i, 1] < -4.0 * scale and seen[i + 1, 1] < -4.0 * scale:
                continue
            near = min(abs(seen[i, 2]), abs(seen[i + 1, 2])) / (0.3 * scale)
            allowed = delta * min(max(near, 0.3), 1.0)
            if gap <= allowed:
                continue
            if seen[i, 1] < -50.0 * scale or seen[i + 1, 1] < -50.0 * scale:
                # The far end of the curve is beyond all base conditions: a point half way.
                extra = 1
            else:
                extra = min(math.ceil(gap / allowed) - 1, 6)
            left = apart(seen, i - 1, i, scale) if i > 0 and linked[i - 1] else 0.0
            right = apart(seen, i + 1, i + 2, scale) if i + 2 < n and linked[i + 1] else 0.0
            h = i - 1 if left > 0.0 else i
            j = i + 2 if right > 0.0 else i + 1
            for k in range(extra):
                x = gap * (k + 1.0) / (extra + 1.0)
                insert(now, seen, (h, i, i + 1, j), (-left, 0.0, gap, gap + right), x, p1, new[m])
                look(entries, p1, new[m], scale, seen_new[m])
                parent[m] = -1
                linked_new[m] = True
                m += 1
        # Zeros in the strip: triangles from each old trajectory to the new curve, and back to the next old one.
        i = 0
        for k in range(m):
            if parent[k] >= 0:
                i = parent[k]
            if not linked_new[k]:
                continue
            kinds = 2 if parent[k + 1] >= 0 else 1
            for kind in range(kinds):
                residuals[0] = old_residual[i]
                residuals[1] = seen_new[k + kind, 2]
                residuals[2] = seen_new[k + 1, 2] if kind == 0 else old_residual[i + 1]
                side = residuals[0] >= 0.0
                if side == (residuals[1] >= 0.0) and side == (residuals[2] >= 0.0):
                    continue
                corners[0] = before[i]
                corners[1] = new[k + kind]
                corners[2] = new[k + 1] if kind == 0 else before[i + 1]
                at_first[0], at_first[1], at_first[2] = True, False, kind == 1
                if zero_segment(entries, p0, p1, stress, corners, residuals, at_first, pair, one, other):
                    if s >= most_segments:
                        return segments[:s], row
                    segments[s] = pair
                    s += 1
        # Leave out what is far beyond, with both neighbours: so cold that heat flows down for good, or so hot and
        # dilute that only y changes, and away from the base condition.
        n = 0
        dropped = True
        for k in range(m):
            out = True
            for j in (k - 1, k, k + 1):
                if j < 0 or j >= m:
                    continue
                cold = seen_new[j, 1] < -8.0 * scale
                hot = seen_new[j, 0] < -24.0 and seen_new[j, 1] > 0.0
                hot = hot and (seen_new[j, 2] > 0.0) == (hot_limit > 0.0) and p1 > 1.0
                if not (cold or hot):
                    out = False
            if out:
                if not dropped:
                    linked[n - 1] = False
                dropped = True
                continue
            now[n] = new[k]
            seen[n] = seen_new[k]
            linked[n] = linked_new[k]
            dropped = False
            n += 1
        if n == 0:
            break
        linked[n - 1] = False
    return segments[:s], rows


@numba.njit(cache=True, error_model="numpy")
def along(entries, depths, stress, surface_flux, log_t, scale, zeros):
    """Zeros of the residual on one trajectory: their number, with ln Q, ln h, ln M, ln T in ``zeros``."""
    state, last, seen = np.empty(5), np.empty(5), np.empty(4)
    one, other = np.empty(4), np.empty(4)
    begin(entries, depths[0], stress, surface_flux, log_t, state)
    look(entries, depths[0], state, scale, seen)
    n = 0
    for row in range(1, len(depths)):
        residual = seen[2]
        last[:] = state
        advance(entries, depths[row - 1], depths[row] - depths[row - 1], stress, state)
        look(entries, depths[row], state, scale, seen)
        if not (seen[1] > -8.0 * scale):
            break
        if (residual >= 0.0) != (seen[2] >= 0.0) and n < len(zeros):
            fraction = residual / (residual - seen[2])
            quantities(entries, depths[row - 1], stress, last, one)
            quantities(entries, depths[row], stress, state, other)
            zeros[n] = one + fraction * (other - one)
            n += 1
    return n


class BruteForce:
    """All flows of one chute with surface temperatures in a range and hold-ups up to ``deepest``."""

    def __init__(self, chute: Chute, deepest: float = 30.0, coldest: float = 1e-3, hottest: float = 1e5) -> None:
        self.chute, self.deepest, self.coldest, self.hottest = chute, deepest, coldest, hottest
        self.entries = table(chute)
        here = self.entries[(np.arange(PLACES) * SPACING + FIRST) < 15.0, :, 0]
        self.scale = float(max(0.2, np.abs(here[:, BASE]).max()))
        self.surface_flux = -(chute.slope**2)
        # y of a hot dilute flow far down, where dy/dp = -a3 - a1 y^2/2, against the base condition there.
        dilute = here[0]
        self.hot_limit = math.sqrt(max(-2.0 * dilute[A3] / dilute[A1], 0.0)) - float(dilute[BASE])

    def depths(self, deepest: float, fineness: Fineness, coldest: float) -> np.ndarray:
        """Normal stresses, even in the logarithm of the overburden near the surface and even below."""
        first = 1e-9 if self.chute.surface_stress else 1e-6 * min(coldest, 1.0)
        turn = min(fineness.step / fineness.log_step, 0.5 * deepest)
        above = np.geomspace(first, turn, max(2, math.ceil(math.log(turn / first) / fineness.log_step)))
        below = np.linspace(turn, deepest, max(2, math.ceil((deepest - turn) / fineness.step) + 1))
        return np.concatenate([above, below[1:]]) + self.chute.surface_stress

    def segments(self, fineness: Fineness = Fineness(), most_segments: int = 600_000) -> tuple[np.ndarray, str]:
        """The zeros of the residual in the range, and why they may not be all ("" if they are)."""
        beyond = 1.1
        low, high = math.log(self.coldest / beyond), math.log(self.hottest * beyond)
        log_t = np.linspace(low, high, math.ceil((high - low) / math.log(10.0) * fineness.per_decade) + 1)
        depths = self.depths(self.deepest * 1.01, fineness, self.coldest)
        segments, row = carry(
            self.entries, depths, self.chute.surface_stress, self.surface_flux, log_t, fineness.delta, self.scale,
            self.hot_limit, fineness.most, most_segments,
        )  # fmt: skip
        why = "" if row == len(depths) else f"there are too many trajectories below p = {depths[row]:.3g}"
        return segments, why

    def inside(self, places: np.ndarray, given: str, margin: float = 0.0) -> np.ndarray:
        """Those of the flows (n, 4) with one ``given`` quantity that lie in the range, less a margin at its edges."""
        low, high = math.log(self.coldest) + margin, math.log(self.hottest) - margin
        kept = (places[:, 3] > low) & (places[:, 3] < high)
        return places[kept & ((given == "M") | (places[:, 2] < math.log(self.deepest) - margin))]

    def crossings(self, segments: np.ndarray, which: int, target: float) -> np.ndarray:
        """Where the zeros take the value."""
        off = segments[:, :, which] - target
        hit = (off[:, 0] >= 0.0) != (off[:, 1] >= 0.0)
        off, ends = off[hit], segments[hit]
        fraction = (off[:, 0] / (off[:, 0] - off[:, 1]))[:, None]
        return ends[:, 0] + fraction * (ends[:, 1] - ends[:, 0])

    def answer(self, segments: np.ndarray, why: str, name: str, value: float, near: float = NEAR) -> Found:
        """The flows with a given Q, h or M."""
        which, target = QUANTITIES.index(name), math.log(value)
        found = self.crossings(segments, which, target)
        counts = {len(self.inside(self.crossings(segments, which, target + d), name)) for d in (-near, 0.0, near)}
        if len(self.inside(found, name, -near)) != len(self.inside(found, name, near)):
            why = why or "a flow is at the edge of the range"
        elif len(counts) > 1:
            why = why or "a fold is near"
        return Found(self.inside(found, name), not why, why)

    def at_temperature(self, temperature: float, fineness: Fineness = Fineness()) -> Found:
        """The flows with a given surface temperature, along its one trajectory, with a third of the steps."""
        counts, flows = set(), np.empty((0, 4))
        fineness = Fineness(log_step=fineness.log_step / 3.0, step=fineness.step / 3.0)
        finer = Fineness(log_step=fineness.log_step / 2.0, step=fineness.step / 2.0)
        for use, change in ((fineness, 0.0), (finer, -NEAR_T), (finer, NEAR_T), (finer, 0.0)):
            depths = self.depths(self.deepest, use, min(self.coldest, temperature))
            zeros = np.empty((400, 4))
            log_t = math.log(temperature) + change
            n = along(self.entries, depths, self.chute.surface_stress, self.surface_flux, log_t, self.scale, zeros)
            counts.add(n)
            flows = zeros[:n]
        same = len(counts) == 1
        return Found(flows, same, "" if same else "the trajectory is not known closely enough")
