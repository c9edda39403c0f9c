"""An independent reference for the steady flows of a chute: no code and no reduced formula of chuteflow in it.

What is taken from the paper is used as printed there (with its errata mended): table 1, (2.11), (2.12), (3.16),
(3.18), (3.23)-(3.25), (3.31), (3.32). The three first-order equations (3.8), (3.9) and (3.6) are integrated from the
surface down in ln p, with nu (through its logit, which keeps the digits of both ends), ln T and q as unknowns, and
with the depth below the start, the velocity gained and the moments of both as further components. Nothing is
tabulated, no potential is used and no integral is taken by parts.

- :func:`fall` is the plain initial value problem: one trajectory from one surface temperature.
- :func:`refine` is a flow to about twelve digits: the same integration in many short pieces at once (multiple
  shooting), so that trajectories that part exponentially lose no digits. It carries its own error, the distance to
  a second solution with other pieces and a looser tolerance.
- :class:`Scan` is brute force: fixed steps from a dense set of surface temperatures, every cell of the plane
  (T_surface, p) that holds a zero of the base condition looked at.

# notation: nu volume fraction, logit = ln(nu/(nu* - nu)), p normal stress, b = ln T, q heat flux,
# Y = q/(p sqrt(T)), depth = distance below the start, W = velocity lost since the start, u = u_b + W_b - W.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[Any]

NU_STAR = 0.62
P_H = math.sqrt(math.pi) / 48.0  # (3.31), mended
QUANTITIES = ("Q", "h", "M", "T_surface")


@dataclass(frozen=True)
class Case:
    """A chute, by the paper's symbols."""

    slope: float
    e: float
    e_w: float
    r: float
    surface: str = "free"
    closure: str = "lun"

    @property
    def p_s(self) -> float:
        return P_H if self.surface == "interface" else 0.0


# The printed formulas


@dataclass
class Table1:
    """g_0 to g_5 of table 1 at nu, and dg_1/dnu; ``free_fraction`` = 1 - nu/nu*, given apart for its digits."""

    case: Case
    nu: Any
    free_fraction: Any

    def __post_init__(self) -> None:
        e, nu = self.case.e, self.nu
        pi = math.pi
        self.g0 = g0 = self.free_fraction ** (-5.0 * NU_STAR / 2.0)
        self.dg0 = dg0 = 2.5 * g0 / self.free_fraction
        x = nu * g0
        self.g1 = nu * (1.0 + 2.0 * (1.0 + e) * x)
        self.dg1 = 1.0 + 2.0 * (1.0 + e) * (2.0 * x + nu**2 * dg0)
        # table 1 has nu in the numerator and in the denominator of g_2: cancelled here, as in table 2
        self.g2 = (math.sqrt(pi) * (5.0 + 4.0 * (1.0 + e) * x) / (120.0 * (3.0 - e) * (1.0 + e) * g0)) * (
            5.0 + 2.0 * (1.0 + e) * (3.0 * e - 1.0) * x
        ) + 4.0 / (5.0 * math.sqrt(pi)) * (1.0 + e) * nu * x
        self.g3 = (math.sqrt(pi) * (5.0 + 6.0 * (1.0 + e) * x) / (4.0 * (1.0 + e) * (49.0 - 33.0 * e) * g0)) * (
            5.0 + 3.0 * (1.0 + e) ** 2 * (2.0 * e - 1.0) * x
        ) + 2.0 / math.sqrt(pi) * (1.0 + e) * nu * x
        if self.case.closure == "lun":
            derivative = 2.0 * g0 + nu * dg0  # d(nu^2 g_0)/dnu, over nu
            self.g4 = (3.0 * math.sqrt(pi) * (5.0 + 6.0 * (1.0 + e) * x) / (4.0 * (49.0 - 33.0 * e) * g0)) * (
                e * (1.0 - e) * derivative
            )
        else:
            self.g4 = 0.0 * x
        self.g5 = 12.0 / math.sqrt(pi) * (1.0 - e**2) * nu * x

    def bases(self) -> tuple[Any, Any]:
        """F_1 of (3.16) and F_2 of (3.18), as printed."""
        c = self.case
        lid = math.sqrt(1.0 - c.r**2)
        kappa = 2.0 / 3.0 * (2.0 / (1.0 + lid) - lid)  # (2.11)
        a = 1.0 + math.pi / (12.0 * math.sqrt(2.0)) * (1.0 + 5.0 / (8.0 * self.nu * self.g0))  # (2.12)
        wall_shear = kappa - 0.5 * a * c.r**2
        f1 = c.slope / kappa * (math.sqrt(math.pi / 2.0) + wall_shear * self.g1 / self.g2)
        f2 = (
            self.g1
            * math.sqrt(2.0 / math.pi)
            * (kappa * f1**2 - self.g1 * c.slope / self.g2 * wall_shear * f1 - 2.0 * (1.0 - c.e_w) / (1.0 + lid))
        )
        return f1, f2


def densities(logit: Any) -> tuple[Any, Any]:
    """nu and 1 - nu/nu*."""
    free_fraction = 1.0 / (1.0 + np.exp(logit))
    return NU_STAR / (1.0 + np.exp(-logit)), free_fraction


def logit_at(case: Case, p: Any, b: Any) -> Array:
    """The density where g_1(nu) T = p, by Newton's method for ln g_1 from both ends of the range."""
    target = np.log(p) - b
    # dilute: nu = p/T; dense: g_1 ~ 2 (1 + e) nu*^2 free_fraction^(-1.55)
    dense = (target - math.log(2.0 * (1.0 + case.e) * NU_STAR**2)) / (2.5 * NU_STAR)
    logit = np.where(target < 0.0, target - math.log(NU_STAR), np.maximum(dense, -1.0))
    for _ in range(60):
        g = Table1(case, *densities(logit))
        step = (target - np.log(g.g1)) / (g.nu * g.dg1 / g.g1 * g.free_fraction)
        logit = logit + np.clip(step, -2.0, 2.0)
        if np.max(np.abs(step)) < 1e-14 * np.max(np.abs(logit)) + 1e-15:
            break
    return np.asarray(logit)


def base_flux(case: Case, logit: Any) -> Any:
    """F_2/g_1: what Y is at a base."""
    g = Table1(case, *densities(logit))
    return g.bases()[1] / g.g1


# Trajectories: components of the state

LOGIT, B, HEAT, DEPTH, LOST, DEPTH_MOMENT, LOST_MOMENT = range(7)


def derivative(case: Case, log_p: Any, z: Array) -> Array:
    """dz/dln p of the state ``z`` (7, ...): (3.8), (3.9), (3.6) and (3.10) with dp/dz = -nu (3.2)."""
    p, root_t = np.exp(log_p), np.exp(0.5 * z[B])
    nu, free_fraction = densities(z[LOGIT])
    g = Table1(case, nu, free_fraction)
    t = root_t * root_t
    # (3.6): q/nu = g_3 sqrt(T) T_p - g_4 T^(3/2) nu_p, and (3.8): g_1 T_p + g_1' T nu_p = 1
    t_p = (z[HEAT] / nu + g.g4 * root_t / g.dg1) / (root_t * (g.g3 + g.g4 * g.g1 / g.dg1))
    nu_p = (1.0 - g.g1 * t_p) / (g.dg1 * t)
    q_p = -((g.g1 * case.slope) ** 2 / g.g2 - g.g5) * t * root_t / nu
    shear = g.g1 * case.slope / g.g2 * root_t
    rates = np.empty_like(z)
    rates[LOGIT] = nu_p / (nu * free_fraction)
    rates[B] = t_p / t
    rates[HEAT] = q_p
    rates[DEPTH] = 1.0 / nu
    rates[LOST] = shear / nu
    rates[DEPTH_MOMENT] = z[DEPTH]
    rates[LOST_MOMENT] = z[LOST]
    rates *= p
    return rates


def start(case: Case, p: Any, surface_temperature: Any) -> Array:
    """State (7, ...) at normal stress ``p`` below a surface, by (3.23)-(3.25) or (3.31)-(3.32).

    On the half-line the leading terms err by the fraction (p/T)^2 in T and p/T in q, which is itself of order p^2.
    """
    t, p = np.broadcast_arrays(np.asarray(surface_temperature, dtype=float), np.asarray(p, dtype=float))
    z = np.zeros((7, *t.shape))
    if case.p_s > 0.0:
        z[B] = np.log(t)
        z[HEAT] = -p * np.sqrt(t) * case.slope**2
    else:
        # at nu -> 0: g_3 and g_2 finite, g_5/nu^2 finite
        g = Table1(case, np.array(1e-300), np.array(1.0))
        g52 = 12.0 / math.sqrt(math.pi) * (1.0 - case.e**2)
        z[B] = np.log(t) + np.log1p(g.g4 / g.g3 * p / t)
        z[HEAT] = -0.5 * (case.slope**2 / g.g2 - g52) * np.sqrt(t) * p**2
    z[LOGIT] = logit_at(case, p, z[B])
    return z


def rates_of(case: Case) -> tuple[float, float, float, float]:
    """Bounds over all densities: the rate at which trajectories part in p, conduction, balance of Y, base flux."""
    logit = np.linspace(-40.0, 40.0, 400)
    g = Table1(case, *densities(logit))
    conduction = g.g3 * g.nu / g.g1
    net = np.abs((g.g1 * case.slope) ** 2 / g.g2 - g.g5) / (g.nu * g.g1)
    base = np.abs(base_flux(case, logit))
    return (
        float(np.sqrt(2.0 * net / conduction).max()),
        float(conduction.max()),
        float(np.sqrt(2.0 * net * conduction).max()),
        float(base.max()),
    )


def first_stress(case: Case, surface_temperature: float, mass: float) -> float:
    """Normal stress at which integrations begin: small enough for the leading terms to be exact to rounding."""
    if case.p_s > 0.0:
        return case.p_s
    rate = rates_of(case)[0]
    return 1e-9 * min(surface_temperature, mass, 1.0, 1.0 / (rate + 1e-12))


def absolute_tolerance(case: Case, log_p: Array, z: Array, length: Any) -> Array:
    """What may be neglected in each component of ``z`` (7, ...): little beside one e-fold of the trajectory."""
    rates = np.abs(derivative(case, log_p, z)) * length
    atol = np.full_like(z, 1e-14)
    atol[HEAT] = 1e-250
    atol[[DEPTH, LOST]] = 1e-15 * rates[[DEPTH, LOST]]
    atol[[DEPTH_MOMENT, LOST_MOMENT]] = atol[[DEPTH, LOST]] * np.exp(log_p)
    return atol


def fall(case: Case, surface_temperature: float, mass: float, rtol: float = 1e-13) -> tuple[Array, float]:
    """One trajectory from the surface down to the hold-up ``mass``: its state there, and p at the start."""
    p0 = first_stress(case, surface_temperature, mass)
    first, last = np.array(math.log(p0)), math.log(case.p_s + mass)
    z = start(case, p0, surface_temperature)
    found = solve_ivp(
        lambda t, z: derivative(case, t, z),
        (float(first), last),
        z,
        method="DOP853",
        rtol=rtol,
        atol=absolute_tolerance(case, first, z, 1.0),
    )
    if not found.success:
        raise ArithmeticError(found.message)
    return found.y[:, -1], p0


def macroscopic(case: Case, z: Array, p: Any, p0: Any, surface_temperature: Any) -> tuple[Any, Any, Any]:
    """ln Q, ln h and B = Y - F_2/g_1 were the base where ``z`` (7, ...) is, with the layer above p0 added."""
    top = p0 if case.p_s == 0.0 else 0.0  # mass above the start
    mass = p - case.p_s
    f1, f2 = (g := Table1(case, *densities(z[LOGIT]))).bases()
    root_t = np.exp(0.5 * z[B])
    # above the start depth = T ln(p/p0) and W = 0, to the fraction p0/T
    moment = z[DEPTH] * mass - z[DEPTH_MOMENT] + top * surface_temperature
    flux = (f1 * root_t + z[LOST]) * mass - z[LOST_MOMENT]
    excess = z[HEAT] / (p * root_t) - f2 / g.g1
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(flux), np.log(moment / mass), excess


def sensitivity(case: Case, surface_temperature: float, mass: float, change: float = 1e-12) -> float:
    """How much a relative change of T_surface grows in T at the base, by the plain initial value problem."""
    one, _ = fall(case, surface_temperature, mass)
    other, _ = fall(case, surface_temperature * (1.0 + change), mass)
    return float(abs(one[B] - other[B]) / change)


# Accurate flows


@dataclass(frozen=True)
class ReferenceFlow:
    """ln Q, ln h, ln M, ln T_surface in ``logs``; ``error`` the largest absolute error of these but the last.

    ``stress`` is how far p = g_1(nu) T is missed at the base, relatively; the integration does not use it.
    """

    logs: Array
    error: float
    stress: float


@dataclass(frozen=True)
class Guess:
    """A rough flow: T_surface, M, and ln T and Y along the way at increasing ``p``."""

    surface_temperature: float
    mass: float
    p: Array
    b: Array
    y: Array


class Shooting:
    """Multiple shooting for one flow. Unknowns: ln T_surface, ln M, then (ln T, Y) at the inner joints."""

    def __init__(self, case: Case, guess: Guess, pieces_per_length: float) -> None:
        self.case = case
        self.p0 = first_stress(case, guess.surface_temperature, guess.mass)
        base = case.p_s + guess.mass
        rate = rates_of(case)[0]
        # pieces of equal length in ln p + rate p, where neither layer nor interior is long
        fine = np.geomspace(self.p0, base, 4000)
        pace = 0.35 * np.log(fine / self.p0) + rate * (fine - self.p0)
        count = int(np.clip(np.ceil(pieces_per_length * pace[-1]), 4, 240))
        joints = np.interp(np.linspace(0.0, pace[-1], count + 1), pace, np.log(fine))
        self.share = (joints - joints[0]) / (joints[-1] - joints[0])
        inner = joints[1:-1]
        log_p = np.log(guess.p)
        b = np.interp(inner, log_p, guess.b)
        y = np.interp(inner, log_p, guess.y / guess.p) * np.exp(inner)  # Y/p is regular at the surface
        self.first = np.concatenate(
            [[math.log(guess.surface_temperature), math.log(guess.mass)], np.stack([b, y], axis=1).ravel()]
        )

    def integrate(self, variants: list[Array], joints: list[int], rtol: float) -> Array:
        """States (7, k) at the lower ends of the pieces ``joints`` for the unknowns ``variants``, all at once."""
        t0 = math.log(self.p0)
        x = np.array(variants)
        j = np.array(joints)
        whole = np.log(self.case.p_s + np.exp(x[:, 1])) - t0
        upper, length = t0 + self.share[j] * whole, (self.share[j + 1] - self.share[j]) * whole
        z = np.zeros((7, len(j)))
        top = j == 0
        z[:, top] = start(self.case, np.full(top.sum(), self.p0), np.exp(x[top, 0]))
        rows = np.flatnonzero(~top)
        if rows.size:
            b, y = x[rows, 2 * j[rows]], x[rows, 2 * j[rows] + 1]
            z[B, rows] = b
            z[HEAT, rows] = y * np.exp(upper[rows] + 0.5 * b)
            z[LOGIT, rows] = logit_at(self.case, np.exp(upper[rows]), b)
        shape = z.shape

        def pulled(tau: float, flat: Array) -> Array:
            return (derivative(self.case, upper + tau * length, flat.reshape(shape)) * length).ravel()

        # The norm of the error is a mean over all components: one bad piece must not hide among many good ones.
        tight = max(rtol / math.sqrt(len(j)), 2.3e-14)
        atol = absolute_tolerance(self.case, upper, z, length).ravel()
        found = solve_ivp(pulled, (0.0, 1.0), z.ravel(), method="DOP853", rtol=tight, atol=atol, t_eval=[1.0])
        if not found.success:
            raise ArithmeticError(found.message)
        return found.y[:, -1].reshape(shape)

    def residual(self, x: Array, ends: Array, which: int, target: float) -> tuple[Array, Array]:
        """Gaps at the joints, the base condition and the condition asked for; and ln Q, ln h, ln M, ln T."""
        case = self.case
        t0 = math.log(self.p0)
        whole = math.log(case.p_s + math.exp(x[1])) - t0
        p = np.exp(t0 + self.share * whole)
        spans = np.diff(p)
        total = np.zeros(7)
        total[[LOGIT, B, HEAT]] = ends[[LOGIT, B, HEAT], -1]
        for what, moment in ((DEPTH, DEPTH_MOMENT), (LOST, LOST_MOMENT)):
            gained = np.concatenate([[0.0], np.cumsum(ends[what])])
            total[what] = gained[-1]
            total[moment] = float(gained[:-1] @ spans + ends[moment].sum())
        log_q, log_h, excess = macroscopic(case, total, case.p_s + math.exp(x[1]), self.p0, math.exp(x[0]))
        logs = np.array([log_q, log_h, x[1], x[0]])
        b, y = x[2::2], x[3::2]
        gaps_b = ends[B, :-1] - b
        gaps_y = ends[HEAT, :-1] / (p[1:-1] * np.exp(0.5 * ends[B, :-1])) - y
        return np.concatenate([[excess, logs[which] - target], np.stack([gaps_b, gaps_y], axis=1).ravel()]), logs

    def jacobian(self, x: Array, which: int, target: float, rtol: float) -> tuple[Array, Array]:
        """Residual, and its derivative by differences: only the piece below a joint feels its unknowns."""
        pieces = len(self.share) - 1
        size = 1e-7 * np.maximum(np.abs(x), 1e-2)
        size[:2] = 1e-7
        variants, joints, owner = [x] * pieces, list(range(pieces)), [-1] * pieces
        for k in range(len(x)):
            moved = x.copy()
            moved[k] += size[k]
            for j in range(pieces) if k == 1 else [0] if k == 0 else [k // 2]:
                variants.append(moved)
                joints.append(j)
                owner.append(k)
        ends = self.integrate(variants, joints, rtol)
        here, _ = self.residual(x, ends[:, :pieces], which, target)
        jac = np.empty((len(x), len(x)))
        owners = np.array(owner)
        at = np.array(joints)
        for k in range(len(x)):
            changed = ends[:, :pieces].copy()
            columns = np.flatnonzero(owners == k)
            changed[:, at[columns]] = ends[:, columns]
            moved = x.copy()
            moved[k] += size[k]
            jac[:, k] = (self.residual(moved, changed, which, target)[0] - here) / size[k]
        return here, jac

    def solve(self, which: int, target: float, rtol: float) -> tuple[Array, Array, Array]:
        """Unknowns, logarithms of Q, h, M, T_surface, and the states at the lower ends.

        Raises:
            ArithmeticError: where Newton's method does not converge.
        """
        x = self.first
        pieces = len(self.share) - 1
        jac, last = None, np.inf
        for _ in range(30):
            if jac is None:
                here, jac = self.jacobian(x, which, target, max(rtol, 1e-11))
            else:
                here, _ = self.residual(x, self.integrate([x] * pieces, list(range(pieces)), rtol), which, target)
            if not np.isfinite(here).all() or not np.isfinite(jac).all():
                raise ArithmeticError("left the range of numbers")
            step = np.linalg.solve(jac, -here)
            length = float(np.abs(step).max())
            x = x + step * min(1.0, 0.7 / length)
            if length < 1e-12 or (length < 1e-9 and length > 0.3 * last):
                ends = self.integrate([x] * pieces, list(range(pieces)), rtol)
                return x, self.residual(x, ends, which, target)[1], ends
            if length > 1e-5 or length > 0.1 * last:
                jac = None
            last = length
        raise ArithmeticError("Newton's method did not converge")


def refine(case: Case, which: int, value: float, guess: Guess) -> ReferenceFlow:
    """The flow near ``guess`` with the quantity QUANTITIES[``which``] equal to ``value``.

    Raises:
        ArithmeticError: where Newton's method does not converge.
    """
    target = math.log(value)
    fine = Shooting(case, guess, 1.0)
    with np.errstate(all="ignore"):
        x, logs, ends = fine.solve(which, target, 1e-13)
        again = Guess(math.exp(x[0]), math.exp(x[1]), *_joints(fine, x))
        _, other, _ = Shooting(case, again, 0.7).solve(which, target, 3e-12)
    base = ends[:, -1]
    g = Table1(case, *densities(base[LOGIT]))
    stress = float(abs(np.log(g.g1) + base[B] - math.log(case.p_s + math.exp(x[1]))))
    error = float(np.abs(logs - other)[:3].max()) + 2e-14
    return ReferenceFlow(logs, error, stress)


def _joints(shooting: Shooting, x: Array) -> tuple[Array, Array, Array]:
    case = shooting.case
    t0 = math.log(shooting.p0)
    p = np.exp(t0 + shooting.share[:-1] * (math.log(case.p_s + math.exp(x[1])) - t0))
    top = start(case, p[0], math.exp(x[0]))
    b = np.concatenate([[top[B]], x[2::2]])
    y = np.concatenate([[top[HEAT] / (p[0] * math.exp(0.5 * top[B]))], x[3::2]])
    return p, b, y


# Brute force


@dataclass(eq=False)
class Patch:
    """A batch of trajectories by fixed steps: rows are values of p, columns surface temperatures.

    ``b``, ``y``, ``logit`` (K, C) as in the notation; ``excess`` the base condition; ``logs`` (4, K, C) ln Q, ln h,
    ln M, ln T_surface were the base there. A patch other than the first lies between column ``column`` and the next
    of its ``parent``, from row ``row`` of it on; its first rows are interpolated between those two columns.
    """

    log_t: Array
    p: Array
    b: Array
    y: Array
    logit: Array
    excess: Array
    logs: Array
    states: Array
    frozen: NDArray[np.bool_]
    parent: Patch | None = None
    column: int = 0
    row: int = 0


#: Columns are diverging where ln T or the logit differ by more; a patch begins where they differ by less.
TORN, NEAR = 1.0, 0.03
#: Columns of a patch, and the most generations of patches.
INSERTED, GENERATIONS = 33, 60


class Scan:
    """Every flow of ``case`` with T_surface within ``temperatures`` and M up to ``mass``, by brute force.

    Where neighbouring trajectories part, more are laid between them, from where they are still together, as often
    as it takes: the zeros of deep flows lie between trajectories that no double T_surface tells apart.
    """

    def __init__(
        self,
        case: Case,
        columns: int = 1200,
        temperatures: tuple[float, float] = (1e-3, 1e5),
        mass: float = 30.0,
    ) -> None:
        self.case = case
        self.temperatures, self.mass = temperatures, mass
        rate, conduction, balance, base = rates_of(case)
        self._cold = base + 8.0 * (balance + rate)
        self._conduction = conduction
        log_t = np.log(np.geomspace(*temperatures, columns))
        first = case.p_s if case.p_s > 0.0 else 1e-3 * min(temperatures[0], 1.0 / (rate + 1e-12))
        self.p = _rows(first, case.p_s, mass, rate)
        #: the least hold-up of a flow that is seen
        self.thinnest = float(self.p[1] - case.p_s) if case.p_s > 0.0 else first
        top = start(case, np.full(columns, first), np.exp(log_t))
        self.patches = [self._integrate(log_t, top, 0)]
        pending = list(self._torn(self.patches[0]))
        for _ in range(GENERATIONS):
            patches = [self._inserted(*place) for place in pending]
            self.patches += patches
            pending = [place for patch in patches for place in self._torn(patch)]
            if not pending:
                break
        self.complete = not pending

    def candidates(self, which: int, value: float) -> list[Guess]:
        """Rough flows with the quantity QUANTITIES[``which``] equal to ``value``."""
        target = math.log(value)
        found = []
        for patch in self.patches:
            off = patch.logs[which] - target
            found += [self._guess(patch, r, c) for r, c in _meetings(patch.excess, off, ~self._whole(patch))]
        return found

    def flows(self, which: int, value: float) -> list[ReferenceFlow]:
        """All flows with the quantity QUANTITIES[``which``] equal to ``value``, from hot to cold, then by M.

        Raises:
            ArithmeticError: where a rough flow could not be refined.
        """
        kept: list[ReferenceFlow] = []
        for guess in self.candidates(which, value):
            flow = refine(self.case, which, value, guess)
            if all(np.abs(flow.logs - other.logs).max() > 1e-8 for other in kept):
                kept.append(flow)
        return sorted(kept, key=lambda flow: (-flow.logs[3], flow.logs[2]))

    def has_zeros(self) -> bool:
        """Whether there is any flow at all."""
        return any(bool((p.excess > 0.0).any() and (p.excess < 0.0).any()) for p in self.patches)

    def _integrate(self, log_t: Array, top: Array, row: int) -> Patch:
        case = self.case
        p = self.p[row:]
        z = top
        states = np.empty((len(p), 7, len(log_t)))
        frozen = np.zeros((len(p), len(log_t)), dtype=bool)
        states[0] = z
        stopped = np.zeros(len(log_t), dtype=bool)
        for k in range(1, len(p)):
            stopped |= self._over(states[k - 1], p[k - 1])
            live = np.flatnonzero(~stopped)
            states[k] = states[k - 1]
            frozen[k] = stopped
            if not live.size:
                continue
            h = math.log(p[k] / p[k - 1])
            t, z = math.log(p[k - 1]), states[k - 1][:, live]
            with np.errstate(all="ignore"):
                k1 = derivative(case, t, z)
                k2 = derivative(case, t + 0.5 * h, z + 0.5 * h * k1)
                k3 = derivative(case, t + 0.5 * h, z + 0.5 * h * k2)
                k4 = derivative(case, t + h, z + h * k3)
                after = z + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            bad = ~np.isfinite(after).all(axis=0) | (np.abs(after[LOGIT]) > 600.0)
            stopped[live[bad]] = True
            frozen[k, live[bad]] = True
            states[k][:, live[~bad]] = after[:, ~bad]
        z = np.moveaxis(states, 1, 0)
        with np.errstate(all="ignore"):
            log_q, log_h, excess = macroscopic(case, z, p[:, None], self.p[0], np.exp(log_t))
            y = z[HEAT] / (p[:, None] * np.exp(0.5 * z[B]))
            log_m = np.log(p - case.p_s)
        if row == 0 and case.p_s > 0.0:  # no mass yet
            log_m[0], log_q[0], log_h[0] = -np.inf, -np.inf, -np.inf
        logs = np.stack(np.broadcast_arrays(log_q, log_h, log_m[:, None], log_t[None]))
        # a stopped trajectory keeps the sign of its excess
        last = np.maximum.accumulate(np.where(frozen, 0, np.arange(len(p))[:, None]), axis=0)
        excess = np.take_along_axis(excess, last, axis=0)
        return Patch(log_t, p, z[B], y, z[LOGIT], excess, logs, states, frozen)

    def _over(self, z: Array, p: float) -> NDArray[np.bool_]:
        """Where a trajectory is sure to meet no base any more: cold without return, or beyond numbers."""
        with np.errstate(all="ignore"):
            y = z[HEAT] / (p * np.exp(0.5 * z[B]))
            return (y < -self._cold - 16.0 * self._conduction / p) | (z[B] > 300.0) | ~np.isfinite(y)

    def _whole(self, patch: Patch) -> NDArray[np.bool_]:
        """Cells (K-1, C-1) whose trajectories are together."""
        apart = np.maximum(np.abs(np.diff(patch.b, axis=1)), np.abs(np.diff(patch.logit, axis=1)))
        good = (apart < TORN) & ~patch.frozen[:, 1:] & ~patch.frozen[:, :-1]
        return good[1:] & good[:-1]

    def _torn(self, patch: Patch) -> list[tuple[Patch, int, int]]:
        """Where to insert columns: (patch, column, row)."""
        crossing = _cells_with_zeros(patch.excess) & ~self._whole(patch)
        out = []
        for c in np.flatnonzero(crossing.any(axis=0)):
            apart = np.abs(np.diff(patch.b[:, c : c + 2], axis=1)) + np.abs(np.diff(patch.logit[:, c : c + 2], axis=1))
            apart = apart[:, 0] + np.abs(patch.y[:, c + 1] - patch.y[:, c]) / (1.0 + np.abs(patch.y[:, c]))
            first = int(np.argmax(crossing[:, c]))
            near = np.flatnonzero(apart[: first + 1] < NEAR)
            out.append((patch, int(c), int(near[-1]) if near.size else 0))
        return out

    def _inserted(self, parent: Patch, column: int, row: int) -> Patch:
        share = np.linspace(0.0, 1.0, INSERTED)
        pair = parent.states[row][:, column : column + 2]
        top = pair[:, :1] + share * (pair[:, 1:] - pair[:, :1])
        top[LOGIT] = logit_at(self.case, parent.p[row], top[B])
        log_t = parent.log_t[column] + share * (parent.log_t[column + 1] - parent.log_t[column])
        patch = self._integrate(log_t, top, len(self.p) - len(parent.p) + row)
        patch.parent, patch.column, patch.row = parent, column, row
        return patch

    def _guess(self, patch: Patch, row: float, column: float) -> Guess:
        """The rough flow at a fractional place, with its trajectory put together from the patches above."""
        k, c = int(row), int(column)
        share = column - c
        p_end = float(patch.p[k] + (row - k) * (patch.p[min(k + 1, len(patch.p) - 1)] - patch.p[k]))
        log_t = float(patch.log_t[c] + share * (patch.log_t[min(c + 1, len(patch.log_t) - 1)] - patch.log_t[c]))
        p, b, y = [], [], []
        here, last = patch, k + 2
        while True:
            other = min(c + 1, len(here.log_t) - 1)
            p.append(here.p[:last])
            b.append((1.0 - share) * here.b[:last, c] + share * here.b[:last, other])
            y.append((1.0 - share) * here.y[:last, c] + share * here.y[:last, other])
            if here.parent is None:
                break
            place = (c + share) / (INSERTED - 1)
            here, c, share, last = here.parent, here.column, place, here.row
        joined = [np.concatenate(parts[::-1]) for parts in (p, b, y)]
        return Guess(math.exp(log_t), p_end - self.case.p_s, *joined)


def _rows(first: float, p_s: float, mass: float, rate: float) -> Array:
    """Values of p: at first the overburden grows by 8 % a step, then by a fixed fraction of the shortest length."""
    step = min(0.15 / (rate + 1e-12), 0.05)
    thin = first if p_s == 0.0 else 1e-6 * min(1.0, step)
    turn = min(max(step / 0.08, thin), mass)
    layer = np.geomspace(thin, turn, max(2, math.ceil(math.log(turn / thin) / 0.08) + 1))
    rest = np.linspace(turn, mass, max(2, math.ceil((mass - turn) / step) + 1))
    over = np.concatenate([layer[:-1], rest])
    return over if p_s == 0.0 else p_s + np.concatenate([[0.0], over])


def _cells_with_zeros(f: Array) -> NDArray[np.bool_]:
    positive = f > 0.0
    corners = positive[1:, 1:].astype(int) + positive[1:, :-1] + positive[:-1, 1:] + positive[:-1, :-1]
    return (corners > 0) & (corners < 4)


def _cells_of_numbers(f: Array) -> NDArray[np.bool_]:
    good = np.isfinite(f)
    return good[1:, 1:] & good[1:, :-1] & good[:-1, 1:] & good[:-1, :-1]


def _meetings(f: Array, g: Array, masked: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Places (row, column) where f = 0 and g = 0, by straight lines through every cell that is not masked.

    In a cell f = 0 is a chord between two of its edges (in a saddle: any two), on which g changes sign.
    """
    rows, columns = np.nonzero(_cells_with_zeros(f) & ~masked & _cells_of_numbers(g))
    found = []
    for k, c in zip(rows.tolist(), columns.tolist(), strict=True):
        corners = ((k, c), (k, c + 1), (k + 1, c + 1), (k + 1, c))
        ends = []
        for (k0, c0), (k1, c1) in zip(corners, corners[1:] + corners[:1], strict=True):
            if (f[k0, c0] > 0.0) != (f[k1, c1] > 0.0):
                share = f[k0, c0] / (f[k0, c0] - f[k1, c1])
                at = (k0 + share * (k1 - k0), c0 + share * (c1 - c0))
                ends.append((at, (1.0 - share) * g[k0, c0] + share * g[k1, c1]))
        for i in range(len(ends)):
            for j in range(i):
                (one, g_one), (two, g_two) = ends[i], ends[j]
                if (g_one > 0.0) != (g_two > 0.0):
                    share = g_one / (g_one - g_two)
                    found.append((one[0] + share * (two[0] - one[0]), one[1] + share * (two[1] - one[1])))
    return found
