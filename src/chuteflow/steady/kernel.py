"""The compiled loops of Gauss collocation on elements: Newton's method with condensed elements.

# notation: s grid coordinate, m(s) fraction of the overburden, mu = ln M, w = dP/ds, x, y, theta, a, k, net, nu as in
# chuteflow.steady.model; P overburden, p = P + p_S normal stress, q = P/p; K slopes at the Gauss points of an element.

The unknowns are theta and y at the ends of the elements, their slopes at the Gauss points, and mu. In each element the
slopes are eliminated; what is left couples the ends of neighbouring elements, and is solved from the surface down with
row pivoting, the columns of mu and the row of the condition carried along.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from chuteflow.numerics.compiled import compiled, compiled_in_place
from chuteflow.numerics.tabulate import find_piece
from chuteflow.steady.model import CONDUCTION, COUPLING, DENSITY, GAMMA, LOSS, OFFSET, SHEAR, UPPER, WALL_SHEAR, WORK

#: Gauss points of an element.
STAGES = 7
#: Relative error of the terms of the equations by rounding and tabulation of the closures.
_ROUNDING = 2e-14
#: The longest step of Newton's method, and the largest change of ln x trusted.
_LONGEST, _HALVINGS = 2.0, 8
#: Rounds of the method of false position.
_FALSE_POSITIONS = 60


@compiled_in_place
def closures(table: Any, x: float, f: Any) -> None:
    """The closures at x and their derivatives with respect to ln x, into ``f`` (16,).

    ``table`` holds the coefficients and the edges of a :class:`chuteflow.numerics.tabulate.FunctionTable`.
    """
    coefficients, edges = table
    degree, pieces, width = coefficients.shape
    inner = math.log1p(x / OFFSET)
    c = math.log1p(inner)
    i, t = find_piece(edges, pieces, min(max(c, 0.0), UPPER) * (pieces / UPPER))
    for q in range(width):
        f[q] = coefficients[degree - 1, i, q]
    for d in range(degree - 2, -1, -1):
        for q in range(width):
            f[q] = f[q] * t + coefficients[d, i, q]
    by_log = x / ((x + OFFSET) * (1.0 + inner))
    for q in range(width // 2, width):
        f[q] *= by_log


@compiled_in_place
def density_argument(p: float, theta: float, beta: float) -> float:
    """x at the normal stress p > 0 and the potential theta."""
    return p * math.exp(-theta) if beta == 0.0 else math.exp((1.0 + beta) * math.log(p) - theta)


@compiled_in_place
def _solve_dense(matrix: Any, right: Any) -> bool:
    """Solve in place by Gauss elimination with row pivoting; the right sides are the rows' (n, r)."""
    n, r = right.shape
    for c in range(n):
        best = c
        for i in range(c + 1, n):
            if abs(matrix[i, c]) > abs(matrix[best, c]):
                best = i
        if not abs(matrix[best, c]) > 0.0:
            return False
        if best != c:
            for q in range(c, n):
                matrix[c, q], matrix[best, q] = matrix[best, q], matrix[c, q]
            for q in range(r):
                right[c, q], right[best, q] = right[best, q], right[c, q]
        inverse = 1.0 / matrix[c, c]
        for i in range(c + 1, n):
            factor = matrix[i, c] * inverse
            if factor != 0.0:
                for q in range(c + 1, n):
                    matrix[i, q] -= factor * matrix[c, q]
                for q in range(r):
                    right[i, q] -= factor * right[c, q]
    for c in range(n - 1, -1, -1):
        for q in range(r):
            total = right[c, q]
            for i in range(c + 1, n):
                total -= matrix[c, i] * right[i, q]
            right[c, q] = total / matrix[c, c]
    return True


@compiled
def _assemble(
    table: Any, chute: Any, gauss: Any, integrals: Any, breaks: Any, stretch: float, ends: Any, slopes: Any, mu: float,
    local: Any, quantities: Any, by_ends: Any, by_slopes: Any,
) -> float:  # fmt: skip
    """Residuals and derivatives of all elements, condensed; the macroscopic quantities and their derivatives.

    ``chute`` holds slope, p_S, y_S, base loss, the three coefficients of the slip, beta and
    the factor of WALL_SHEAR in the loss; ``ends`` (N+1, 2) theta
    and y; ``slopes`` (N, STAGES, 2). Fills ``local`` (N, 2 STAGES, 4): the change of the slopes for changes of theta,
    y and mu, and by Newton's method; ``quantities`` (4,) ln Q, ln h, ln M, ln T; ``by_ends`` (2, N+1, 3) derivatives of
    ln Q and ln h with respect to theta at the ends and mu (in the first row), ``by_slopes`` (2, N, STAGES) those with
    respect to theta at the Gauss points. Where ``local`` has six columns the last two are changes by what rounding
    does. Returns the largest residual, or infinity.
    """
    slope, p_s, beta = chute[0], chute[1], chute[7]
    rho = 1.0 + beta
    count = len(slopes)
    mass = math.exp(mu)
    whole = math.expm1(stretch)
    f = np.empty(16)
    matrix = np.empty((2 * STAGES, 2 * STAGES))
    worst = 0.0
    moment = shear_flux = moment_mu = shear_flux_mu = 0.0
    jac = np.empty((STAGES, 2, 2))
    for e in range(count):
        h = breaks[e + 1] - breaks[e]
        for j in range(STAGES):
            theta, y = ends[e, 0], ends[e, 1]
            for i in range(STAGES):
                theta += h * integrals[j, i] * slopes[e, i, 0]
                y += h * integrals[j, i] * slopes[e, i, 1]
            grown = math.exp(stretch * (breaks[e] + h * gauss[0, j]))
            over = (
                mass * (grown - 1.0) / whole
                if stretch * breaks[e] > 0.1
                else mass * math.expm1(stretch * (breaks[e] + h * gauss[0, j])) / whole
            )
            w = mass * stretch * grown / whole
            p = over + p_s
            q = over / p
            if not abs(theta) < 600.0:
                return math.inf
            x = density_argument(p, theta, beta)
            closures(table, x, f)
            inverse = 1.0 / f[CONDUCTION]
            inverse_x = -f[8 + CONDUCTION] * inverse * inverse
            k, k_x = f[COUPLING], f[8 + COUPLING]
            net = f[LOSS] - slope * slope * f[WORK]
            net_x = f[8 + LOSS] - slope * slope * f[8 + WORK]
            v = p * y * inverse - beta
            exchange = 1.0 + 0.5 * (v + k * (1.0 - v))
            f_theta = w * y * inverse
            f_y = w * (net - y * exchange / p)
            y_x = w * (net_x - 0.5 * y / p * ((1.0 - k) * p * y * inverse_x + (1.0 - v) * k_x))
            jac[j, 0, 0] = -w * y * inverse_x
            jac[j, 0, 1] = w * inverse
            jac[j, 1, 0] = -y_x
            jac[j, 1, 1] = -w * (exchange / p + 0.5 * y * (1.0 - k) * inverse)
            local[e, 2 * j, 2] = f_theta + w * y * inverse_x * rho * q
            local[e, 2 * j + 1, 2] = f_y + w * y * q / p * (exchange - 0.5 * (1.0 - k) * (v + beta)) + y_x * rho * q
            local[e, 2 * j, 3] = f_theta - slopes[e, j, 0]
            local[e, 2 * j + 1, 3] = f_y - slopes[e, j, 1]
            for c in range(local.shape[2] - 4):
                # What rounding and the tabulated closures leave of the residuals, of one sign or of both.
                sign = 1.0 if c == 0 or (31 * e + 17 * j) % 7 % 2 == 0 else -1.0
                local[e, 2 * j, 4 + c] = _ROUNDING * sign * abs(f_theta)
                local[e, 2 * j + 1, 4 + c] = _ROUNDING * sign * w * (abs(net) + abs(y * exchange / p))
            for c in range(2):
                local[e, 2 * j, c] = jac[j, 0, c]
                local[e, 2 * j + 1, c] = jac[j, 1, c]
                worst = max(worst, abs(local[e, 2 * j + c, 3]) * h)
            # Integrals of P dz and of P du.
            weight = h * gauss[1, j] * w
            heights = h * gauss[2 if e == 0 else 1, j] * w * over * math.exp(-math.log(x) - f[DENSITY])
            log_t = theta + f[GAMMA]
            if beta != 0.0:
                log_t -= beta * math.log(p)
            root_t = math.exp(0.5 * log_t)
            shear = weight * over * slope * f[WORK] * root_t
            moment += heights
            shear_flux += shear
            density_x, work_x, gamma_x = f[8 + DENSITY], f[8 + WORK] / f[WORK], f[8 + GAMMA]
            by_slopes[1, e, j] = heights * (1.0 + density_x)
            by_slopes[0, e, j] = shear * (0.5 * (1.0 - gamma_x) - work_x)
            moment_mu += heights * (2.0 - (1.0 + density_x) * rho * q)
            shear_flux_mu += shear * (2.0 + (0.5 * (gamma_x * rho - beta) + work_x * rho) * q)
        for j in range(STAGES):
            for i in range(STAGES):
                for c in range(2):
                    for d in range(2):
                        matrix[2 * j + c, 2 * i + d] = -h * integrals[j, i] * jac[j, c, d]
            matrix[2 * j, 2 * j] += 1.0
            matrix[2 * j + 1, 2 * j + 1] += 1.0
        if not _solve_dense(matrix, local[e]):
            return math.inf
    # The base.
    p = mass + p_s
    q = mass / p
    closures(table, density_argument(p, ends[count, 0], beta), f)
    slip = chute[4] + chute[5] * f[SHEAR] + chute[6] * f[WALL_SHEAR]
    slip_x = (chute[5] * f[8 + SHEAR] + chute[6] * f[8 + WALL_SHEAR]) / slip
    log_t = ends[count, 0] + f[GAMMA]
    if beta != 0.0:
        log_t -= beta * math.log(p)
    carried = slip * math.exp(0.5 * log_t) * mass
    flux = carried + shear_flux
    if not (flux > 0.0 and moment > 0.0):
        return math.inf
    by_ends[0, count, 2] = (
        slope * slip - chute[3] - chute[8] * f[WALL_SHEAR]
    )  # heat flux that the base gives, and its derivative to ln x
    by_ends[1, count, 2] = slope * slip * slip_x - chute[8] * f[8 + WALL_SHEAR]
    by_ends[0, count, 0] = carried * (0.5 * (1.0 - f[8 + GAMMA]) - slip_x) / flux
    by_ends[1, count, 0] = 0.0
    by_ends[0, 0, 2] = (shear_flux_mu + carried * (1.0 + (slip_x * rho + 0.5 * (f[8 + GAMMA] * rho - beta)) * q)) / flux
    by_ends[1, 0, 2] = moment_mu / moment - 1.0
    for e in range(count):
        for j in range(STAGES):
            by_slopes[0, e, j] /= flux
            by_slopes[1, e, j] /= moment
    closures(table, density_argument(p_s, ends[0, 0], beta) if p_s > 0.0 else 0.0, f)
    by_ends[0, 0, 1] = 1.0 - f[8 + GAMMA]  # d ln T_surface / d theta
    quantities[0] = math.log(flux)
    quantities[1] = math.log(moment / mass)
    quantities[2] = mu
    quantities[3] = ends[0, 0] + f[GAMMA]
    if beta != 0.0 and p_s > 0.0:
        quantities[3] -= beta * math.log(p_s)
    # Jumps between the elements.
    for e in range(count):
        h = breaks[e + 1] - breaks[e]
        for c in range(2):
            jump = ends[e + 1, c] - ends[e, c]
            for j in range(STAGES):
                jump -= h * gauss[1, j] * slopes[e, j, c]
            worst = max(worst, abs(jump))
    worst = max(worst, abs(ends[0, 1] - chute[2]), abs(ends[count, 1] - by_ends[0, count, 2]))
    return worst if math.isfinite(worst) else math.inf


@compiled
def _step(
    gauss: Any, integrals: Any, breaks: Any, chute: Any, ends: Any, slopes: Any, local: Any, quantities: Any,
    by_ends: Any, by_slopes: Any, rows: Any, values: Any, mass_share: float, ends_out: Any, slopes_out: Any,
) -> bool:  # fmt: skip
    """Changes of ``ends``, ``slopes`` and mu for right sides ``values`` (r,) of the condition ``rows`` (4,).

    The first right side is Newton's step, the second the change along the branch for a value of the condition, the
    others, if there are, what rounding does. ``ends_out`` (r, N+2, 2), whose last row holds the change of mu;
    ``slopes_out`` (r, N, STAGES, 2).
    """
    count = len(slopes)
    r = len(values)
    # Pivot rows: coefficients of theta_e, y_e, theta_e+1, y_e+1, mu and the right sides.
    pivots = np.zeros((count, 2, 5 + r))
    work = np.zeros((3, 5 + r))
    border = np.zeros(5 + r)  # of theta_e, y_e, theta_e+1, y_e+1, mu, right sides
    carried = np.zeros(5 + r)
    carried[1] = 1.0
    carried[5] = chute[2] - ends[0, 1]
    border[0] = rows[3] * by_ends[0, 0, 1]
    border[4] = rows[0] * by_ends[0, 0, 2] + rows[1] * by_ends[1, 0, 2] + rows[2]
    for c in range(r):
        border[5 + c] = values[c]
    for c in range(4):
        border[5] -= rows[c] * quantities[c]
    for e in range(count):
        h = breaks[e + 1] - breaks[e]
        # What the condition has of the potential at the Gauss points.
        for j in range(STAGES):
            of = rows[0] * by_slopes[0, e, j] + rows[1] * by_slopes[1, e, j]
            if of == 0.0:
                continue
            border[0] += of
            for i in range(STAGES):
                factor = of * h * integrals[j, i]
                border[0] += factor * local[e, 2 * i, 0]
                border[1] += factor * local[e, 2 * i, 1]
                border[4] += factor * local[e, 2 * i, 2]
                border[5] -= factor * local[e, 2 * i, 3]
                for q in range(2, r):
                    border[5 + q] -= factor * local[e, 2 * i, 2 + q]
        work[0] = carried
        for c in range(2):
            for q in range(5 + r):
                work[1 + c, q] = 0.0
            work[1 + c, 2 + c] = 1.0
            work[1 + c, c] = -1.0
            jump = ends[e + 1, c] - ends[e, c]
            for j in range(STAGES):
                factor = h * gauss[1, j]
                work[1 + c, 0] -= factor * local[e, 2 * j + c, 0]
                work[1 + c, 1] -= factor * local[e, 2 * j + c, 1]
                work[1 + c, 4] -= factor * local[e, 2 * j + c, 2]
                jump -= factor * (slopes[e, j, c] + local[e, 2 * j + c, 3])
            work[1 + c, 5] = -jump
            for q in range(2, r):
                for j in range(STAGES):
                    work[1 + c, 5 + q] += h * gauss[1, j] * local[e, 2 * j + c, 2 + q]
        for c in range(2):
            best = c
            for i in range(c + 1, 3):
                if abs(work[i, c]) > abs(work[best, c]):
                    best = i
            if not abs(work[best, c]) > 0.0:
                return False
            for q in range(5 + r):
                work[c, q], work[best, q] = work[best, q], work[c, q]
            for i in range(c + 1, 3):
                factor = work[i, c] / work[c, c]
                for q in range(c, 5 + r):
                    work[i, q] -= factor * work[c, q]
            factor = border[c] / work[c, c]
            for q in range(c, 5 + r):
                border[q] -= factor * work[c, q]
            pivots[e, c] = work[c]
        carried[0], carried[1], carried[2], carried[3] = work[2, 2], work[2, 3], 0.0, 0.0
        border[0], border[1], border[2], border[3] = border[2], border[3], 0.0, 0.0
        for q in range(4, 5 + r):
            carried[q] = work[2, q]
    # The last three unknowns: theta and y at the base, and mu.
    border[0] += rows[0] * by_ends[0, count, 0]
    last = np.zeros((3, 3))
    right = np.zeros((3, r))
    flux, flux_x = by_ends[0, count, 2], by_ends[1, count, 2]
    last[0, 0], last[0, 1], last[0, 2] = carried[0], carried[1], carried[4]
    last[1, 0], last[1, 1], last[1, 2] = flux_x, 1.0, -flux_x * mass_share
    last[2, 0], last[2, 1], last[2, 2] = border[0], border[1], border[4]
    for c in range(r):
        right[0, c], right[2, c] = carried[5 + c], border[5 + c]
    right[1, 0] = flux - ends[count, 1]
    for c in range(2, r):
        right[1, c] = _ROUNDING * (abs(flux) + 2.0 * abs(chute[3]))
    if not _solve_dense(last, right):
        return False
    for c in range(r):
        change_mu = right[2, c]
        ends_out[c, count + 1, 0] = change_mu
        ends_out[c, count, 0], ends_out[c, count, 1] = right[0, c], right[1, c]
        for e in range(count - 1, -1, -1):
            for d in range(1, -1, -1):
                total = pivots[e, d, 5 + c] - pivots[e, d, 4] * change_mu
                total -= pivots[e, d, 2] * ends_out[c, e + 1, 0] + pivots[e, d, 3] * ends_out[c, e + 1, 1]
                if d == 0:
                    total -= pivots[e, 0, 1] * ends_out[c, e, 1]
                ends_out[c, e, d] = total / pivots[e, d, d]
        for e in range(count):
            for j in range(2 * STAGES):
                change = (
                    local[e, j, 0] * ends_out[c, e, 0] + local[e, j, 1] * ends_out[c, e, 1] + local[e, j, 2] * change_mu
                )
                if c != 1:
                    change += local[e, j, 3 if c == 0 else 2 + c]
                slopes_out[c, e, j // 2, j % 2] = change
    return True


@compiled_in_place
def _change_of_quantities(
    integrals: Any, breaks: Any, by_ends: Any, by_slopes: Any, ends: Any, slopes: Any, out: Any
) -> None:
    """Changes ``out`` (4,) of ln Q, ln h, ln M and ln T_surface for changes ``ends`` (N+2, 2) and ``slopes``."""
    count = len(slopes)
    change_mu = ends[count + 1, 0]
    for c in range(2):
        out[c] = by_ends[c, 0, 2] * change_mu + by_ends[c, count, 0] * ends[count, 0]
        for e in range(count):
            h = breaks[e + 1] - breaks[e]
            for j in range(STAGES):
                theta = ends[e, 0]
                for i in range(STAGES):
                    theta += h * integrals[j, i] * slopes[e, i, 0]
                out[c] += by_slopes[c, e, j] * theta
    out[2] = change_mu
    out[3] = by_ends[0, 0, 1] * ends[0, 0]


@compiled_in_place
def _measure_off(rows: Any, quantities: Any, value: float) -> float:
    """How far the condition is from being met."""
    total = 0.0
    for c in range(4):
        total += rows[c] * quantities[c]
    return abs(total - value)


@compiled_in_place
def _measure_change(change_ends: Any) -> float:
    """The largest change of theta and y at the ends of elements, and of mu; infinite where one is not a number."""
    count = len(change_ends) - 1
    longest = abs(change_ends[count, 0])
    for e in range(count):
        for c in range(2):
            if not abs(change_ends[e, c]) <= longest:
                longest = abs(change_ends[e, c])
                if not math.isfinite(longest):
                    return math.inf
    return longest


@compiled_in_place
def _move(ends: Any, slopes: Any, fraction: float, change_ends: Any, change_slopes: Any) -> None:
    """Add a fraction of the changes."""
    for e in range(len(ends)):
        for c in range(2):
            ends[e, c] += fraction * change_ends[e, c]
    for e in range(len(slopes)):
        for j in range(STAGES):
            for c in range(2):
                slopes[e, j, c] += fraction * change_slopes[e, j, c]


@compiled
def iterate(
    table: Any, chute: Any, gauss: Any, integrals: Any, breaks: Any, stretch: float, ends: Any, slopes: Any, mu: float,
    rows: Any, value: float, tolerance: float, most: int, quantities: Any, rates: Any, errors: Any,
) -> tuple[float, float]:  # fmt: skip
    """Newton's method in place from ``ends``, ``slopes`` and ``mu`` for the flow with ``rows`` . quantities = value.

    Fills ``quantities`` (4,), ln Q, ln h, ln M and ln T_surface of the last iterate, and ``rates`` (4,), their
    derivatives with respect to ``value`` along the branch, at the iterate before; ``errors`` (k, 4), none or two rows,
    what rounding of the equations may do to them. Returns mu and the size of the last step: infinite where it failed.
    A step is cut to a longest one, and halved while the largest residual does not fall.
    """
    count = len(slopes)
    sides = len(errors)
    local = np.empty((count, 2 * STAGES, 4 + sides))
    by_ends = np.zeros((2, count + 1, 3))
    by_slopes = np.empty((2, count, STAGES))
    change_ends = np.empty((2 + sides, count + 2, 2))
    change_slopes = np.empty((2 + sides, count, STAGES, 2))
    values = np.zeros(2 + sides)
    values[0], values[1] = value, 1.0
    size = _assemble(
        table, chute, gauss, integrals, breaks, stretch, ends, slopes, mu, local, quantities, by_ends, by_slopes
    )
    if not math.isfinite(size):
        return mu, math.inf
    size = max(size, _measure_off(rows, quantities, value))
    longest = math.inf
    for _ in range(most):
        mass = math.exp(mu)
        if not _step(
            gauss, integrals, breaks, chute, ends, slopes, local, quantities, by_ends, by_slopes, rows, values,
            (1.0 + chute[7]) * mass / (mass + chute[1]), change_ends, change_slopes,
        ):  # fmt: skip
            return mu, math.inf
        _change_of_quantities(integrals, breaks, by_ends, by_slopes, change_ends[1], change_slopes[1], rates)
        for c in range(sides):
            change_e, change_s = change_ends[2 + c], change_slopes[2 + c]
            _change_of_quantities(integrals, breaks, by_ends, by_slopes, change_e, change_s, errors[c])
        longest = _measure_change(change_ends[0])
        if not math.isfinite(longest):
            return mu, math.inf
        if longest < tolerance:
            # What the quantities change by is linear in so small a step.
            _move(ends, slopes, 1.0, change_ends[0], change_slopes[0])
            last = np.empty(4)
            _change_of_quantities(integrals, breaks, by_ends, by_slopes, change_ends[0], change_slopes[0], last)
            for c in range(4):
                quantities[c] += last[c]
            return mu + change_ends[0, count + 1, 0], longest
        fraction = min(1.0, _LONGEST / longest)
        for _ in range(_HALVINGS):
            _move(ends, slopes, fraction, change_ends[0], change_slopes[0])
            mu += fraction * change_ends[0, count + 1, 0]
            trial = _assemble(
                table, chute, gauss, integrals, breaks, stretch, ends, slopes, mu, local, quantities, by_ends, by_slopes
            )
            trial = max(trial, _measure_off(rows, quantities, value)) if math.isfinite(trial) else trial
            if trial < size * (1.0 - 0.1 * fraction) or (longest < 1e-4 and math.isfinite(trial)):
                break
            _move(ends, slopes, -fraction, change_ends[0], change_slopes[0])
            mu -= fraction * change_ends[0, count + 1, 0]
            fraction *= 0.5
        else:
            return mu, math.inf
        size = trial
    return mu, math.inf


@compiled
def direction(
    table: Any, chute: Any, gauss: Any, integrals: Any, breaks: Any, stretch: float, ends: Any, slopes: Any, mu: float,
    rows: Any, out: Any,
) -> bool:  # fmt: skip
    """The changes ``out`` (4,) of ln Q, ln h, ln M and ln T_surface along the branch for which the condition ``rows``
    (4,) of them changes by 1; whether there are any."""
    count = len(slopes)
    local = np.empty((count, 2 * STAGES, 4))
    by_ends = np.zeros((2, count + 1, 3))
    by_slopes = np.empty((2, count, STAGES))
    quantities = np.empty(4)
    change_ends = np.empty((2, count + 2, 2))
    change_slopes = np.empty((2, count, STAGES, 2))
    size = _assemble(
        table, chute, gauss, integrals, breaks, stretch, ends, slopes, mu, local, quantities, by_ends, by_slopes
    )
    mass = math.exp(mu)
    if not math.isfinite(size) or not _step(
        gauss, integrals, breaks, chute, ends, slopes, local, quantities, by_ends, by_slopes, rows,
        np.array([0.0, 1.0]), (1.0 + chute[7]) * mass / (mass + chute[1]), change_ends, change_slopes,
    ):  # fmt: skip
        return False
    _change_of_quantities(integrals, breaks, by_ends, by_slopes, change_ends[1], change_slopes[1], out)
    return math.isfinite(out.sum())


@compiled
def _evaluate_elsewhere(
    breaks: Any, ends: Any, slopes: Any, cardinal: Any, stretch: float, s: Any, other: float, out: Any
) -> None:
    """theta and y of a flow with a ``stretch`` at the grid coordinates ``s`` (k,) of the stretch ``other``."""
    ratio = math.expm1(stretch) / math.expm1(other)
    at = np.empty(len(s))
    for i in range(len(s)):
        at[i] = min(max(math.log1p(math.expm1(other * s[i]) * ratio) / stretch, 0.0), 1.0)
    evaluate(breaks, ends, slopes, cardinal, at, out)


@compiled
def blend(
    breaks: Any, ends: Any, slopes: Any, stretch: float, other_breaks: Any, other_ends: Any, other_slopes: Any,
    other_stretch: float, fraction: float, after: float, points: Any, cardinal: Any, differences: Any, change: float,
    per_flux: float, longest: float,
) -> tuple[Any, Any, Any]:  # fmt: skip
    """The flow ``fraction`` of the way from one to another, with the stretch ``after``: breaks, ends and slopes on
    elements that suit the first."""
    own = places(breaks, points)
    rough = np.empty((len(own), 2))
    evaluate(breaks, ends, slopes, cardinal, own, rough)
    ratio = math.expm1(after) / math.expm1(stretch)
    for i in range(len(own)):
        own[i] = min(math.log1p(math.expm1(stretch * own[i]) * ratio) / after, 1.0)
    new = distribute(own, rough[:, 0] / change, rough[:, 1], per_flux, longest)
    s = places(new, points)
    values = np.empty((len(s), 2))
    _evaluate_elsewhere(breaks, ends, slopes, cardinal, stretch, s, after, values)
    if fraction != 0.0:
        there = np.empty((len(s), 2))
        _evaluate_elsewhere(other_breaks, other_ends, other_slopes, cardinal, other_stretch, s, after, there)
        for i in range(len(s)):
            for c in range(2):
                values[i, c] += fraction * (there[i, c] - values[i, c])
    new_ends, new_slopes = np.empty((len(new), 2)), np.empty((len(new) - 1, STAGES, 2))
    fit(new, values, differences, new_ends, new_slopes)
    return new, new_ends, new_slopes


@compiled
def halve(breaks: Any, ends: Any, slopes: Any, points: Any, cardinal: Any, differences: Any) -> tuple[Any, Any, Any]:
    """The same polynomials on elements of half the length: breaks, ends and slopes."""
    new = np.empty(2 * len(breaks) - 1)
    for e in range(len(breaks)):
        new[2 * e] = breaks[e]
        if e > 0:
            new[2 * e - 1] = 0.5 * (breaks[e] + breaks[e - 1])
    s = places(new, points)
    values = np.empty((len(s), 2))
    evaluate(breaks, ends, slopes, cardinal, s, values)
    new_ends, new_slopes = np.empty((len(new), 2)), np.empty((len(new) - 1, STAGES, 2))
    fit(new, values, differences, new_ends, new_slopes)
    return new, new_ends, new_slopes


@compiled
def distribute(s: Any, theta: Any, y: Any, per_flux: float, longest: float) -> Any:
    """Element boundaries on [0, 1] between which samples of theta and y (ascending in ``s``) change about equally:
    as many that the change in each, with a part for its length, is 1 at most."""
    n = len(s)
    total = np.zeros(n)
    for i in range(1, n):
        change = abs(theta[i] - theta[i - 1]) + abs(y[i] - y[i - 1]) * per_flux
        total[i] = total[i - 1] + change + (s[i] - s[i - 1]) / longest
    count = max(math.ceil(total[n - 1]), 2)
    breaks = np.empty(count + 1)
    breaks[0], breaks[count] = 0.0, 1.0
    at = 0
    for e in range(1, count):
        target = total[n - 1] * e / count
        while total[at + 1] < target:
            at += 1
        part = (target - total[at]) / (total[at + 1] - total[at])
        breaks[e] = s[at] + part * (s[at + 1] - s[at])
    return breaks


@compiled_in_place
def evaluate(breaks: Any, ends: Any, slopes: Any, cardinal: Any, s: Any, out: Any) -> None:
    """theta and y at places ``s`` (k,) ascending, into ``out`` (k, 2); ``cardinal`` (STAGES, STAGES) holds the
    integrals of the cardinal polynomials as coefficients of t, t^2, ..."""
    e = 0
    for i in range(len(s)):
        while e + 1 < len(slopes) and s[i] > breaks[e + 1]:
            e += 1
        h = breaks[e + 1] - breaks[e]
        t = (s[i] - breaks[e]) / h
        for c in range(2):
            out[i, c] = ends[e, c]
        for j in range(STAGES):
            value = cardinal[STAGES - 1, j]
            for d in range(STAGES - 2, -1, -1):
                value = value * t + cardinal[d, j]
            value *= t * h
            for c in range(2):
                out[i, c] += value * slopes[e, j, c]


@compiled
def log_argument(
    breaks: Any, ends: Any, slopes: Any, cardinal: Any, stretch: float, mass: float, p_s: float, beta: float, s: float
) -> float:
    """ln x at one place ``s``."""
    at, value = np.array([s]), np.empty((1, 2))
    evaluate(breaks, ends, slopes, cardinal, at, value)
    p = mass * math.expm1(stretch * s) / math.expm1(stretch) + p_s
    return (1.0 + beta) * math.log(max(p, 1e-300)) - value[0, 0]


@compiled
def crossings(
    breaks: Any, ends: Any, slopes: Any, cardinal: Any, points: Any, integrals: Any, stretch: float, mass: float,
    p_s: float, beta: float, kinks: Any, close: float,
) -> Any:  # fmt: skip
    """The places at which ln x passes one of the ``kinks``, to ``close``, by false position with the Illinois rule
    between neighbours of which one is above: the ends of the grid, and the Gauss ``points`` (STAGES,) of all elements
    between them."""
    count = len(slopes) * STAGES + 2
    samples, level = np.empty(count), np.empty(count)
    samples[0], samples[count - 1] = breaks[0], breaks[-1]
    level[0], level[count - 1] = ends[0, 0], ends[-1, 0]
    i = 1
    for e in range(len(slopes)):
        h = breaks[e + 1] - breaks[e]
        for j in range(STAGES):
            samples[i] = breaks[e] + h * points[j]
            level[i] = ends[e, 0]
            for k in range(STAGES):
                level[i] += h * integrals[j, k] * slopes[e, k, 0]
            i += 1
    whole = math.expm1(stretch)
    for i in range(count):
        p = mass * math.expm1(stretch * samples[i]) / whole + p_s
        level[i] = (1.0 + beta) * math.log(max(p, 1e-300)) - level[i]
    found = []
    for kink in kinks:
        for i in range(count - 1):
            a, b = samples[i], samples[i + 1]
            f_a, f_b = level[i] - kink, level[i + 1] - kink
            if (f_a >= 0.0) == (f_b >= 0.0):
                continue
            side, place = 0, a
            for _ in range(_FALSE_POSITIONS):
                before, place = place, (a * f_b - b * f_a) / (f_b - f_a)
                value = log_argument(breaks, ends, slopes, cardinal, stretch, mass, p_s, beta, place) - kink
                if value == 0.0 or abs(place - before) < close or b - a < close:
                    break
                if (value >= 0.0) == (f_b >= 0.0):
                    b, f_b, f_a = place, value, 0.5 * f_a if side == 1 else f_a
                    side = 1
                else:
                    a, f_a, f_b = place, value, 0.5 * f_b if side == -1 else f_b
                    side = -1
            found.append(place)
    return np.array(found)


@compiled
def places(breaks: Any, points: Any) -> Any:
    """The ends of the elements and the Gauss points in each, ascending (N (STAGES + 1) + 1,)."""
    count = len(breaks) - 1
    out = np.empty(count * (STAGES + 1) + 1)
    for e in range(count):
        out[e * (STAGES + 1)] = breaks[e]
        for j in range(STAGES):
            out[e * (STAGES + 1) + 1 + j] = breaks[e] + (breaks[e + 1] - breaks[e]) * points[j]
    out[-1] = breaks[count]
    return out


@compiled_in_place
def fit(breaks: Any, values: Any, differences: Any, ends: Any, slopes: Any) -> None:
    """The polynomials through ``values`` (N (STAGES + 1) + 1, 2) at :func:`places`; ``differences`` is the inverse of
    the integrals."""
    for e in range(len(slopes)):
        h = breaks[e + 1] - breaks[e]
        first = e * (STAGES + 1)
        for c in range(2):
            ends[e, c] = values[first, c]
            for j in range(STAGES):
                total = 0.0
                for i in range(STAGES):
                    total += differences[j, i] * (values[first + 1 + i, c] - values[first, c])
                slopes[e, j, c] = total / h
    for c in range(2):
        ends[len(slopes), c] = values[-1, c]
