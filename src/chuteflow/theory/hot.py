"""Hot, dilute flows: the reduced system of section 4, solved exactly.

# notation: e restitution, e_w wall restitution, r roughness, tan slope, nu volume fraction, p normal stress,
# z height, u velocity, tau = T/T_inf, psi = nu T_inf/alpha, U = u/(F10 sqrt(T_inf)), s = exp(-z/T_inf),
# P = psi tau = p/alpha overburden, P_b at the base, Y = sqrt(tau), k = sqrt(3 |lambda|), x = |P_b|/k,
# C_n = I_n for lambda > 0 and J_n for lambda < 0, B = sqrt(|lambda|/3).

With s for coordinate (4.5) and nu = alpha psi/T_inf (4.10), the leading order (4.6)-(4.8) of the full equations is
(4.11)-(4.13), and that of the velocity (4.15) is (4.16), (4.17).

The paper solves (4.11)-(4.13) by shooting, but there is an exact solution. By (4.11) s d/ds = psi d/dP, and
with P for coordinate (4.12) is linear in Y,

    3 lambda (P Y')' = P Y,   Y(0) = 1,   so   Y = C_0(|P|/k),

while (4.13) is Y'/Y = 1/3 at P_b, that is C_1(x)/C_0(x) = B. I_1/I_0 rises from 0 to 1, so that lambda > 0
has one solution below lambda = 3, and none from there on, where section 4.3 has 2.284. J_1/J_0 rises from 0
without bound up to the first zero of J_0, so that lambda < 0 always has one. P has the sign of lambda, and
alpha has that of F21.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from chuteflow.errors import InputError
from chuteflow.numerics.roots import bisect
from chuteflow.theory import boundary
from chuteflow.theory.constitutive import Field, Law, reduce

#: lambda from which on there is no hot flow; 2.284 in section 4.3.
LAMBDA_C = 3.0

_LARGEST_LOG = math.log(np.finfo(float).max)


# The parameters of a hot flow


@dataclass(frozen=True)
class Dilute:
    """The limits of a law at nu = 0, (4.1) and table 2, and of Richman's A(nu).

    ``g20`` viscosity, ``g30`` conductivity, ``g40`` density conductivity, ``g52`` dissipation over nu^2,
    ``A0`` the limit of nu A(nu) (4.4). The normal stress is that of an ideal gas, nu T.
    """

    g20: float
    g30: float
    g40: float
    g52: float
    A0: float


def dilute(law: Law, e: float, slope: float) -> Dilute:
    """The dilute limit of ``law``.

    Raises:
        InputError: where the law has none, that is no finite and positive conductivity and viscosity.
    """
    _, _, limit = law.at(np.zeros(1), e, slope)
    g20, g30, g40, g52 = (
        float(value[0])
        for value in (limit.viscosity, limit.conductivity, limit.density_conductivity, limit.dissipation)
    )
    if not (all(map(math.isfinite, (g20, g30, g40, g52))) and g20 > 0.0 and g30 > 0.0):
        raise InputError(f"closure {law.name!r} has no dilute limit at e = {e}: take another closure")
    wall_shear = reduce(law, np.zeros(1), e, slope).wall_shear
    return Dilute(g20, g30, g40, g52, float(wall_shear[0]) * g20)


@dataclass(frozen=True)
class HotParameters:
    """What decides on a hot flow.

    ``F10`` slip velocity over sqrt(T) at the base (4.2), with r^2 A0/(2 g20) for r^2 A0 g20/2 as printed: the
    limit of (3.16), as in (4.3); ``F21`` heat flux from the base over nu T^(3/2) (4.3); ``delta`` dissipation
    minus production in the interior over nu^2 T^(3/2) (4.9).
    """

    slope: float
    dilute: Dilute
    F10: float
    F21: float
    delta: float

    @property
    def alpha(self) -> float:
        """Scale of nu T_inf (4.10); infinite where F21 = 0."""
        return 2.0 * self.dilute.g30 / (3.0 * self.F21) if self.F21 else math.inf

    @property
    def lambda_(self) -> float:
        """The parameter of the reduced system (4.14); infinite where delta = 0."""
        return 3.0 * self.F21**2 / (2.0 * self.dilute.g30 * self.delta) if self.delta else math.inf

    @property
    def mu(self) -> float:
        """Fraction of shear in the velocity (4.16); infinite where F21 = 0."""
        return self.alpha * self.slope / (self.F10 * self.dilute.g20)

    @property
    def obstacle(self) -> str | None:
        """One sentence on why there is no hot flow; None where there is one, and then there is just one.

        The signs of F21 and delta are examined apart: that of lambda is always that of delta.
        """
        base, interior = np.sign(self.F21), -np.sign(self.delta)
        if base > 0.0 > interior:
            if self.lambda_ < LAMBDA_C:
                return None
            return (
                f"the slope is too steep: lambda = {self.lambda_:.6g} is not below 3, "
                "and the base gives more energy than the grains can lose"
            )
        if base < 0.0 < interior:
            return None
        return _IMBALANCE[int(base), int(interior)]


#: Why there is no flow, by the signs of the energy that the base and the interior give.
_IMBALANCE = {
    (-1, -1): "base and interior both lose energy: the slope is too gentle",
    (0, -1): "the interior loses energy and the base gives none: the slope is too gentle",
    (-1, 0): "the base takes energy and the interior gives none: the slope is too gentle",
    (0, 0): "base and interior neither gain nor lose energy: any hold-up is in balance to leading order",
    (1, 0): "the base gives energy and the interior takes none: the slope is too steep",
    (0, 1): "the interior gains energy and the base takes none: the slope is too steep",
    (1, 1): "base and interior both gain energy: the slope is too steep",
}


def hot_parameters(limit: Dilute, wall_restitution: float, roughness: float, slope: float) -> HotParameters:
    """F10, F21 and delta, and what follows from them, for a chute of ``slope`` = tan(theta).

    Raises:
        InputError: where grains would slip up the slope, which no law in its range does.
    """
    F10 = _slip(limit, roughness, slope)
    return HotParameters(
        slope=slope,
        dilute=limit,
        F10=F10,
        F21=slope * F10 - boundary.base_loss(wall_restitution, roughness),
        delta=limit.g52 - slope**2 / limit.g20,
    )


def _slip(limit: Dilute, roughness: float, slope: float) -> float:
    no_shear, wall_shear = np.zeros(1), np.full(1, limit.A0 / limit.g20)
    F10 = float(boundary.slip_coefficient(no_shear, wall_shear, roughness, slope)[0])
    if F10 <= 0.0:
        raise InputError(f"slip velocity F10 = {F10}: must be positive, as it is for a larger viscosity g20")
    return F10


# The slopes that carry hot flows


@dataclass(frozen=True)
class HotEnergyBudget:
    """Energy lost and made, ``l`` and ``m`` tan^2 at the base (4.26), ``L`` and ``M`` tan^2 inside (4.25).

    L and M are for one value of lambda, which hot flows have where (m tan^2 - l)^2 = L - M tan^2 (4.27).
    """

    l: float  # noqa: E741, the paper's own name, next to L
    m: float
    L: float
    M: float


def budget(limit: Dilute, wall_restitution: float, roughness: float, lambda_: float) -> HotEnergyBudget:
    """The energy budget (4.25), (4.26) for one value of lambda, of either sign."""
    root = math.sqrt(math.pi / 2.0)
    inside = math.pi * lambda_ * limit.g30 / 3.0
    return HotEnergyBudget(
        l=root * boundary.base_loss(wall_restitution, roughness),
        m=root * _slip(limit, roughness, 1.0),
        L=inside * limit.g52,
        M=inside / limit.g20,
    )


def slope_at(limit: Dilute, wall_restitution: float, roughness: float, lambda_: float) -> float | None:
    """tan(theta) at which hot flows, or their bound, have this lambda: (4.27) with lambda for lambda_c.

    The slope has F21 of the sign of lambda, as a flow needs; lambda = 0 is the slope with F21 = 0. None where
    there is no such slope.
    """
    b = budget(limit, wall_restitution, roughness, lambda_)
    gap = b.m * b.L - b.l * b.M
    if lambda_ != 0.0 and gap <= 0.0:
        return None
    # The root of the quadratic in tan^2 on the side of l/m that F21 asks for, in a form without cancellation.
    shift = 2.0 * gap / (b.m * (abs(b.M) + math.sqrt(b.M**2 + 4.0 * b.m * gap))) if lambda_ else 0.0
    square = b.l / b.m + math.copysign(shift, lambda_)
    return math.sqrt(square) if square > 0.0 else None


@dataclass(frozen=True)
class SlopeBounds:
    """Hot flows exist for ``lowest`` < tan(theta) < ``highest``, with an ``interior`` of this name."""

    lowest: float
    highest: float
    interior: str


def slope_bounds(
    limit: Dilute, wall_restitution: float, roughness: float, lambda_c: float = LAMBDA_C
) -> SlopeBounds | None:
    """The slopes with hot flows, exactly (4.25)-(4.27), or None where there are none.

    There is one interval at most. Where l/m < L/M it is dissipative, from F21 = 0 to lambda = ``lambda_c``
    (2.284 gives the curve of figure 14); where l/m > L/M it is productive, from delta = 0 to F21 = 0.
    """
    b = budget(limit, wall_restitution, roughness, lambda_c)
    interior_zero = math.sqrt(limit.g20 * limit.g52)  # tan(theta) where delta = 0
    base_zero = math.sqrt(b.l / b.m)
    if base_zero < interior_zero:
        highest = slope_at(limit, wall_restitution, roughness, lambda_c)
        return SlopeBounds(base_zero, highest, "dissipative") if highest else None
    return SlopeBounds(interior_zero, base_zero, "productive") if interior_zero < base_zero else None


# The exact solution


@dataclass(frozen=True)
class HotSolution:
    """The exact solution of (4.11)-(4.13), (4.16), (4.17) for one ``lambda_``; see :func:`hot_solution`.

    Fields are functions of P, arrays, from 0 at the surface to ``P_b`` at the base. All is exact but for
    rounding, which a lambda near 3 magnifies by 3/(3 - lambda) in x.
    """

    lambda_: float
    x: float

    @property
    def k(self) -> float:
        """Length of the Bessel functions in P."""
        return math.sqrt(3.0 * abs(self.lambda_))

    @property
    def P_b(self) -> float:
        """P at the base, which is the hold-up over alpha: the integral of psi/s (4.19)."""
        return math.copysign(self.k * self.x, self.lambda_)

    @property
    def inverted(self) -> bool:
        """Whether the density rises with height above the base: 2 x C_1(x)/C_0(x) > 1, lambda > 0."""
        return self.lambda_ > 0.0 and 2.0 * self.x * math.sqrt(self.lambda_ / 3.0) > 1.0

    @cached_property
    def log_tau_b(self) -> float:
        """ln tau at the base."""
        from scipy.special import i0e, j0, j1

        if self.lambda_ > 0.0:
            return 2.0 * (math.log(i0e(self.x)) + self.x)
        B = math.sqrt(-self.lambda_ / 3.0)
        return 2.0 * math.log(j0(self.x) if B < 1.0 else j1(self.x) / B)  # J_0 loses its digits near its zero

    @cached_property
    def largest_psi(self) -> float:
        """psi where the density is largest, with the sign of P."""
        if not self.inverted:
            return self.P_b * math.exp(-self.log_tau_b)
        return float(self.psi(self.k * _inversion()))

    @cached_property
    def log_centre_of_mass(self) -> float:
        """ln of h/T_inf = (1/x) times the integral of C_0^2 from 0 to x: (4.20)."""
        if self.lambda_ < 0.0:
            return math.log(_integral(lambda y: _c0(y, -1.0) ** 2, 0.0, self.x) / self.x)
        from scipy.special import i0e

        scaled = _integral(lambda y: i0e(y) ** 2 * np.exp(2.0 * (y - self.x)), 0.0, self.x, reach=20.0)
        return 2.0 * self.x + math.log(scaled / self.x)

    @property
    def centre_of_mass(self) -> float:
        """h/T_inf; infinite where it overflows."""
        return _exp(self.log_centre_of_mass)

    def log_flux(self, mu: float) -> float:
        """ln of the absolute value of :meth:`flux`, for ``mu`` of the sign of lambda."""
        return math.log(abs(self.P_b)) + 0.5 * self.log_tau_b + math.log1p(mu * self.lambda_)

    def flux(self, mu: float) -> float:
        """Integral of psi U/s, which is Q/(alpha F10 sqrt(T_inf)) (4.18): P_b sqrt(tau_b) (1 + mu lambda).

        Of the sign of lambda; infinite where it overflows.
        """
        size = _exp(math.log(abs(self.P_b)) + 0.5 * self.log_tau_b)
        return math.copysign(size, self.lambda_) * (1.0 + mu * self.lambda_)

    @cached_property
    def log_c(self) -> float:
        """ln |c| of psi ~ c s far above (4.24); infinite where it overflows, beyond lambda = 2.9917."""
        return math.log(abs(self.P_b)) + _excess(0.0, self.x, self.lambda_)

    @property
    def c(self) -> float:
        """c of (4.24), of the sign of lambda; infinite where it overflows, beyond lambda = 2.517."""
        return math.copysign(_exp(self.log_c), self.lambda_)

    def log_tau(self, P: ArrayLike) -> Field:
        """ln(T/T_inf) at ``P``."""
        y = np.abs(np.asarray(P, dtype=float)) / self.k
        if self.lambda_ > 0.0:
            from scipy.special import i0e

            return 2.0 * (np.log(i0e(y)) + y)
        return 2.0 * np.log(_c0(y, -1.0))

    def tau(self, P: ArrayLike) -> Field:
        """T/T_inf at ``P``; infinite where it overflows."""
        with np.errstate(over="ignore"):
            return np.exp(self.log_tau(P))

    def psi(self, P: ArrayLike) -> Field:
        """nu T_inf/alpha at ``P``."""
        return np.asarray(P, dtype=float) * np.exp(-self.log_tau(P))

    def velocity(self, P: ArrayLike, mu: float) -> Field:
        """U at ``P`` for ``mu`` of (4.16): sqrt(tau_b) + mu times the integral of sqrt(tau) from P to P_b.

        Raises:
            InputError: where velocities overflow, beyond lambda = 2.9957.
        """
        root_b = _exp(0.5 * self.log_tau_b)
        if math.isinf(root_b):
            raise InputError(f"velocities overflow at lambda = {self.lambda_}: must be below 2.9957")
        y = np.abs(np.asarray(P, dtype=float)) / self.k
        sign = math.copysign(1.0, self.lambda_)

        def below(y: float) -> float:
            return _integral(lambda y: _c0(y, sign), y, self.x, reach=40.0)

        return root_b + sign * mu * self.k * _each(below, y)

    def log_s(self, P: ArrayLike) -> Field:
        """ln s = -z/T_inf at ``P``: ln(P/c) plus the integral of (tau - 1)/P from 0 to P.

        -inf at P = 0, and where it overflows, beyond lambda = 2.9917.
        """
        y = np.abs(np.asarray(P, dtype=float)) / self.k
        with np.errstate(divide="ignore"):
            # With the integral from P to P_b instead, c and its large errors near lambda = 3 drop out.
            return np.log(y / self.x) - _each(lambda y: _excess(y, self.x, self.lambda_), y)


def hot_solution(lambda_: float) -> HotSolution:
    """The exact solution for ``lambda_`` < 3, other than 0.

    Raises:
        InputError: where there is none.
    """
    if not (math.isfinite(lambda_) and lambda_ < LAMBDA_C and lambda_ != 0.0):
        raise InputError(f"lambda = {lambda_}: hot flows have a lambda below 3, other than 0")
    return HotSolution(lambda_, bisect(*_base_condition(lambda_)))


def _base_condition(lambda_: float) -> tuple[Callable[[float], float], float, float]:
    """A function of x that rises through 0 where (4.13) holds, and bounds of x."""
    from scipy.special import i0e, i1e, j0, j1, jn_zeros

    B = math.sqrt(abs(lambda_) / 3.0)
    if lambda_ < 0.0:
        norm = math.hypot(1.0, B)
        upper = min(2.0 * B, float(jn_zeros(0, 1)[0]))  # J_1/J_0 > x/2
        return lambda x: (j1(x) - B * j0(x)) / norm, 0.5 * upper, upper
    # x/(1 + sqrt(x^2 + 1)) < I_1/I_0 < x/(1/2 + sqrt(x^2 + 1/4)) (Amos 1974), solved for x.
    least = B * LAMBDA_C / (LAMBDA_C - lambda_)
    bounds = least * (1.0 - 1e-12), 2.0 * least * (1.0 + 1e-12)
    if least < 1e3:
        return lambda x: i1e(x) / i0e(x) - B, *bounds

    def mismatch(x: float) -> float:
        # Both I_1/I_0 = 1 - gap and B are too close to 1 to be compared, but not so as f in f/(1 - f^2).
        gap = (0.5 + (0.125 + (0.125 + (25.0 / 128.0 + 13.0 / 32.0 / x) / x) / x) / x) / x
        return (1.0 - gap) / (gap * (2.0 - gap)) - least

    return mismatch, *bounds


def inversion_lambda() -> float:
    """lambda above which the density of hot flows is inverted; 0.660 in section 4.3.

    nu ~ P/I_0(P/k)^2 is largest where 2 x I_1(x)/I_0(x) = 1; with this at the base, lambda = 3/(4 x^2).
    """
    return 0.75 / _inversion() ** 2


@lru_cache(maxsize=1)
def _inversion() -> float:
    """x at which 2 x I_1(x)/I_0(x) = 1."""
    from scipy.special import i0e, i1e

    return bisect(lambda x: 2.0 * x * i1e(x) - i0e(x), 0.5, 2.0)


def _c0(y: Field, sign: float) -> Field:
    from scipy.special import i0, j0

    return i0(y) if sign > 0.0 else j0(y)


def _excess(y: float, x: float, lambda_: float) -> float:
    """Integral of (C_0^2 - 1)/y from ``y`` to ``x``; infinite where it overflows."""
    if lambda_ < 0.0:
        return _integral(lambda y: (_c0(y, -1.0) ** 2 - 1.0) / y, y, x)
    from scipy.special import i0e

    def scaled(y: Field) -> Field:
        return (i0e(y) ** 2 - np.exp(-2.0 * y)) / y * np.exp(2.0 * (y - x))

    size = _integral(scaled, y, x, reach=20.0)
    return _exp(2.0 * x + math.log(size)) if size > 0.0 else 0.0


def _integral(f: Callable[[Field], Field], low: float, high: float, reach: float = math.inf) -> float:
    """Integral of f by Gauss's rule, where f is negligible farther than ``reach`` below ``high``."""
    nodes, weights = _gauss()
    width = min(max(high - low, 0.0), reach)
    return float(width * (weights @ f(high - width * nodes)))


@lru_cache(maxsize=1)
def _gauss() -> tuple[Field, Field]:
    """Nodes and weights on (0, 1), enough for exp(40 y)."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def _each(f: Callable[[float], float], values: Field) -> Field:
    return np.array([f(float(value)) for value in values.ravel()]).reshape(values.shape)


def _exp(log: float) -> float:
    return math.exp(log) if log < _LARGEST_LOG else math.inf


# The expansion for small lambda


def expansion(lambda_: float, s: ArrayLike, mu: float) -> tuple[Field, Field, Field]:
    """psi, tau and U at ``s`` up to lambda^2, (4.21)-(4.23); the error is of the order of lambda^3.

    (4.23) is printed with F10 where 1 must stand, as U = sqrt(tau) at s = 1 (4.17) says: 1, lambda/3 and
    5 lambda^2/36 are the expansion of sqrt(tau) there. All other coefficients are as printed.
    """
    s = np.asarray(s, dtype=float)
    psi = 2.0 * s * lambda_ + (s - 2.0 * s**3) * lambda_**2
    tau = 1.0 + 2.0 / 3.0 * s**2 * lambda_ + (2.0 / 3.0 * s**2 - 5.0 / 18.0 * s**4) * lambda_**2
    U = (
        1.0
        + (2.0 * mu * (1.0 - s) + 1.0 / 3.0) * lambda_
        + (5.0 / 9.0 * mu - (s - 4.0 / 9.0 * s**3) * mu + 5.0 / 36.0) * lambda_**2
    )
    return psi, tau, U
