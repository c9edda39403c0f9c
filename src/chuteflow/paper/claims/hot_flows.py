"""Sections 4.1 and 4.2, figures 10 to 13: the equations of hot flows, their solution and their scaling laws."""

from __future__ import annotations

import itertools
import math
from functools import cache

import numpy as np

from chuteflow import Chute, Flow, HotModel, hot
from chuteflow.paper.claims.registry import Finding, claim, close, decide, rounds_to
from chuteflow.paper.claims.shared import GENTLE, SLOPE, Array, hot_flow
from chuteflow.paper.materials import dissipative, productive
from chuteflow.steady.hot import ShootingSolution, shoot
from chuteflow.theory.boundary import kappa
from chuteflow.theory.hot import HotSolution, expansion, hot_solution, slope_at

WALL, ROUGHNESS = 0.8, 0.6
#: Chutes with a hot flow of either interior.
_EITHER = (dissipative(0.25), dissipative(0.35), productive(0.37), productive(0.42))
_HOT = 1e5


@cache
def _model(chute: Chute) -> HotModel:
    return hot(chute)


def _exact(chute: Chute) -> HotSolution:
    solution = _model(chute).solution
    if solution is None:
        raise ValueError(f"no hot flow on {chute}")
    return solution


def slope_of_lambda(lambda_: float) -> float:
    """The slope of figure 11 at which lambda has this value."""
    return slope_at(_model(dissipative(SLOPE)).parameters.dilute, WALL, ROUGHNESS, lambda_) or math.nan


@claim(
    "hot-is-dilute",
    "section 4.1",
    "The regime of high temperature also corresponds to dilute flows.",
)
def hot_is_dilute() -> Finding:
    """The largest volume fraction times T_inf, against that of the exact solution."""
    limit = _model(dissipative(SLOPE)).largest_volume_fraction or math.nan
    found = {T: T * hot_flow(dissipative(SLOPE), T).largest_volume_fraction for T in (1e2, 1e3, 1e4, 1e5)}
    distances = [value / limit - 1.0 for value in found.values()]
    return decide(
        "nu << 1",
        {f"largest nu at T_inf = {T:g}": value / T for T, value in found.items()},
        holds=_like_inverse_temperature(distances),
        reason=f"The largest nu tends to {limit:.4g}/T_inf, at tan(theta) = 0.3; relative distances from that are "
        + ", ".join(f"{d:.2g}" for d in distances)
        + ", which fall like 1/T_inf.",
    )


@claim(
    "base-sign",
    "section 4.1, (4.3)",
    "F21 is the flux from the base over nu T^(3/2) of hot flows: productive boundary if positive, dissipative if "
    "negative.",
)
def base_sign() -> Finding:
    """The ratio of the flux of the full equations at T_inf = 1e5 to F21."""
    ratios = {}
    for chute in _EITHER:
        flow = hot_flow(chute, _HOT)
        scale = flow.base_volume_fraction * flow.base_temperature**1.5
        ratios[_name(chute)] = float(flow.profile(0.0).heat_flux) / scale / _model(chute).parameters.F21
    signs = {math.copysign(1.0, _model(chute).parameters.F21) for chute in _EITHER}
    return decide(
        1.0,
        ratios,
        holds=signs == {-1.0, 1.0} and all(close(value, 1.0, 1e-3) for value in ratios.values()),
        reason=f"Heat flux from the base over F21 nu T^(3/2) in full solutions at T_inf = {_HOT:g}, for both signs.",
    )


def _name(chute: Chute) -> str:
    return f"e = {chute.restitution:g}, tan(theta) = {chute.slope:g}"


@claim(
    "interior-sign",
    "section 4.1, (4.9)",
    "Where delta > 0 hot flows are dissipative throughout the interior; where delta < 0 they are productive "
    "throughout.",
)
def interior_sign() -> Finding:
    """Kinds of interior of full solutions at T_inf = 1e5."""
    kinds = {_name(chute): hot_flow(chute, _HOT).interior for chute in _EITHER}
    expected = ["dissipative" if _model(chute).parameters.delta > 0.0 else "productive" for chute in _EITHER]
    return decide(
        "the sign of delta",
        kinds,
        holds=list(kinds.values()) == expected and len(set(expected)) == 2,
        reason="delta = " + ", ".join(f"{_model(chute).parameters.delta:.3g}" for chute in _EITHER) + " in turn.",
    )


@claim(
    "slip-limit",
    "section 4.1, (4.2)",
    "The slip of hot flows is F10 = (tan(theta)/kappa) (sqrt(pi/2) - A0 r^2 g20/2).",
)
def slip_limit() -> Finding:
    """The slip velocity over sqrt(T) of a full solution at T_inf = 1e6."""
    limit = _model(dissipative(SLOPE)).parameters.dilute
    k, half = kappa(ROUGHNESS), 0.5 * limit.A0 * ROUGHNESS**2
    printed = SLOPE / k * (math.sqrt(math.pi / 2.0) - half * limit.g20)
    mended = SLOPE / k * (math.sqrt(math.pi / 2.0) - half / limit.g20)
    flow = hot_flow(dissipative(SLOPE), 1e6)
    found = flow.slip_velocity / math.sqrt(flow.base_temperature)
    return decide(
        printed,
        found,
        holds=close(found, printed, 1e-4),
        corrected=close(found, mended, 1e-4),
        reason="Slip velocity over sqrt(T) in a full solution at T_inf = 1e6, tan(theta) = 0.3.",
        correction=f"A0 r^2/(2 g20) instead, which (4.3) has, gives {mended:.5g}.",
    )


@claim(
    "no-analytic-solution",
    "section 4.1",
    "The system (4.11)-(4.13) remains nonlinear, and no analytic solution can be found.",
)
def no_analytic_solution() -> Finding:
    """The Bessel functions against shooting, for both signs of lambda."""
    differences = {}
    for value in (1.0, -1.0):
        exact, s = hot_solution(value), np.linspace(0.05, 1.0, 20)
        shot = _shoot(value, tuple(s.tolist()))
        P = shot.psi * shot.tau  # P = psi tau at the same s
        psi, tau = exact.psi(P), exact.tau(P)
        worst = max(np.abs(psi / shot.psi - 1.0).max(), np.abs(tau / shot.tau - 1.0).max())
        differences[f"lambda = {value:g}"] = float(max(worst, abs(exact.log_c - shot.log_c)))
    return decide(
        "none",
        {f"difference, {name}": value for name, value in differences.items()},
        holds=max(differences.values()) > 1e-8,
        corrected=max(differences.values()) <= 1e-8,
        reason="Largest relative difference of psi, tau and c from a Runge-Kutta solution.",
        correction="In the overburden P = psi tau (4.12) is linear in sqrt(tau): sqrt(tau) = I0(P/sqrt(3 lambda)), "
        "and J0 for lambda < 0.",
    )


@cache
def _shoot(lambda_: float, s: tuple[float, ...], mu: float = 0.0) -> ShootingSolution:
    return shoot(lambda_, mu, np.array(s))


def _laws() -> dict[str, list[float]]:
    """Relative distances of Q/sqrt(T_inf), M and h/T_inf from their limits, for T_inf rising by tens."""
    model, found = _model(dissipative(SLOPE)).as_dict(), {"Q": [], "M": [], "h": []}
    for T in (1e2, 1e3, 1e4, 1e5):
        flow = hot_flow(dissipative(SLOPE), T)
        found["Q"].append(flow.mass_flux / math.sqrt(T) / model["Q_over_sqrt_T"] - 1.0)
        found["M"].append(flow.mass_holdup / model["M"] - 1.0)
        found["h"].append(flow.centre_of_mass / T / model["h_over_T"] - 1.0)
    return found


def _like_inverse_temperature(distances: list[float]) -> bool:
    """Whether distances at temperatures that rise by tens fall by tens."""
    return all(close(b, 0.1 * a, 0.1) for a, b in itertools.pairwise(distances))


def _law(quantity: str, name: str, limit: float, words: str) -> Finding:
    distances = _laws()[quantity]
    return decide(
        words,
        {name: limit, "distance at 1e5": distances[-1]},
        holds=_like_inverse_temperature(distances) and abs(distances[-1]) < 1e-4,
        reason="Relative distances of full solutions at T_inf = 1e2, 1e3, 1e4, 1e5, tan(theta) = 0.3: "
        + ", ".join(f"{d:.2g}" for d in distances)
        + ", which fall like 1/T_inf.",
    )


@claim("flux-of-hot-flows", "section 4.1, (4.18)", "Q grows like sqrt(T_inf) in hot flows.")
def flux_of_hot_flows() -> Finding:
    """Against the closed form."""
    return _law("Q", "Q/sqrt(T_inf)", _model(dissipative(SLOPE)).as_dict()["Q_over_sqrt_T"], "Q ~ sqrt(T_inf)")


@claim("holdup-of-hot-flows", "section 4.1, (4.19)", "M tends to a constant along the high temperature branch.")
def holdup_of_hot_flows() -> Finding:
    """Against the closed form."""
    return _law("M", "M", _model(dissipative(SLOPE)).as_dict()["M"], "constant")


@claim("depth-of-hot-flows", "section 4.1, (4.20)", "h grows like T_inf in hot flows.")
def depth_of_hot_flows() -> Finding:
    """Against the closed form."""
    return _law("h", "h/T_inf", _model(dissipative(SLOPE)).as_dict()["h_over_T"], "h ~ T_inf")


@claim("h-q-squared", "section 4.1, figure 10", "h ~ Q^2 at high temperature, on slopes from 0.22 to 0.3.")
def h_q_squared() -> Finding:
    """The logarithmic slope of the Q-h curve between T_inf = 1e3 and 1e4."""
    found = {}
    for slope in GENTLE:
        low, high = (hot_flow(dissipative(slope), T) for T in (1e3, 1e4))
        found[f"{slope:g}"] = math.log(high.centre_of_mass / low.centre_of_mass) / math.log(
            high.mass_flux / low.mass_flux
        )
    return decide(
        2.0,
        found,
        holds=all(close(value, 2.0, 5e-3) for value in found.values()),
        reason="d ln h/d ln Q between T_inf = 1e3 and 1e4, by slope.",
    )


@claim(
    "other-scalings",
    "section 4.1",
    "h ~ Q^(1/3) for a Newtonian fluid, and h ~ Q^(2/5) for Bagnold's law at constant density.",
)
def other_scalings() -> Finding:
    """The exponents, from velocity profiles integrated for two depths."""
    found = {"Newton": _exponent(1.0), "Bagnold": _exponent(0.5)}
    printed = {"Newton": 1.0 / 3.0, "Bagnold": 2.0 / 5.0}
    return decide(
        printed,
        found,
        holds=all(close(found[name], value, 1e-4) for name, value in printed.items()),
        reason="d ln h/d ln Q of layers whose shear rate is the stress to the power 1 and 1/2.",
    )


def _exponent(power: float) -> float:
    def flux(depth: float) -> float:
        z = np.linspace(0.0, depth, 20_001)
        rate = (depth - z) ** power
        u = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(z))])
        return float(np.trapezoid(u, z))

    return math.log(2.0) / math.log(flux(2.0) / flux(1.0))


@claim("lambda-of-figure-12", "section 4.2, figure 12", "lambda = 0.27 at tan(theta) = 0.3.")
def lambda_of_figure_12() -> Finding:
    """lambda of the chute."""
    found = _model(dissipative(SLOPE)).parameters.lambda_
    return decide(0.27, found, holds=rounds_to(found, "0.27"), reason="By (4.14).")


@claim("lambda-below-one", "section 4.2, figure 11", "abs(lambda) < 1 for tan(theta) < 0.354.")
def lambda_below_one() -> Finding:
    """The largest lambda on gentler slopes, and the slope at which it reaches 1."""
    below = [_model(dissipative(slope)).parameters.lambda_ for slope in np.linspace(0.001, 0.354, 200)]
    bound = slope_of_lambda(1.0)
    return decide(
        0.354,
        bound,
        holds=rounds_to(bound, "0.354") and max(map(abs, below)) < 1.0,
        reason=f"On 200 slopes up to 0.354 it is at most {max(map(abs, below)):.4f}.",
    )


@claim(
    "lambda-diverges",
    "section 4.2, figure 11",
    "lambda diverges as delta tends to 0, on either side with the sign of delta.",
)
def lambda_diverges() -> Finding:
    """lambda delta on either side of the slope where delta = 0, against 3 F21^2/(2 g30) there."""
    limit = _model(dissipative(SLOPE)).parameters.dilute
    balance = math.sqrt(limit.g20 * limit.g52)
    residue = 1.5 * _model(dissipative(balance)).parameters.F21 ** 2 / limit.g30
    sides = [_model(dissipative(factor * balance)).parameters for factor in (1.0 - 1e-6, 1.0 + 1e-6)]
    below, above = (p.lambda_ for p in sides)
    return decide(
        "diverges",
        {"just below": below, "just above": above},
        holds=below > 1e5 and above < -1e5 and all(close(p.lambda_ * p.delta, residue, 1e-4) for p in sides),
        reason=f"At slopes 1e-6 off {balance:.5g}, where delta = 0; lambda delta tends to {residue:.5g} there.",
    )


@claim("slope-at-lambda-one", "section 4.2, figure 13", "lambda = 1 at tan(theta) = 0.354.")
def slope_at_lambda_one() -> Finding:
    """The slope in closed form, put back into (4.14)."""
    bound = slope_of_lambda(1.0)
    back = _model(dissipative(bound)).parameters.lambda_
    return decide(
        0.354,
        bound,
        holds=rounds_to(bound, "0.354") and close(back, 1.0, 1e-9),
        reason=f"(4.14) at this slope gives lambda = {back:.10g}.",
    )


@claim(
    "local-series",
    "section 4.2, (4.24)",
    "psi ~ c s, tau ~ 1 + c^2 s^2/(6 lambda) and tau' ~ c^2 s/(3 lambda) near s = 0.",
)
def local_series() -> Finding:
    """psi/s, (tau - 1)/s^2 and tau'/s of the exact solution at small s, over what is printed."""
    exact = hot_solution(1.0)
    P = 1e-3 * exact.P_b * np.array([0.999, 1.0, 1.001])
    s, tau = np.exp(exact.log_s(P)), exact.tau(P)
    square = exact.c**2 / exact.lambda_
    ratios = {
        "psi": float(exact.psi(P)[1] / (exact.c * s[1])),
        "tau - 1": float((tau[1] - 1.0) / (square * s[1] ** 2 / 6.0)),
        "tau'": float((tau[2] - tau[0]) / (s[2] - s[0]) / (square * s[1] / 3.0)),
    }
    return decide(
        1.0,
        ratios,
        holds=all(close(value, 1.0, 1e-5) for value in ratios.values()),
        reason=f"Ratios to the printed terms in the exact solution for lambda = 1, at s = {s[1]:.2g}.",
    )


@claim("shooting-constant", "section 4.2, figure 13", "c = 4.5861 at lambda = 1.")
def shooting_constant() -> Finding:
    """c by the exact solution and by shooting."""
    exact = hot_solution(1.0).c
    shot = _shoot(1.0, tuple(np.linspace(0.05, 1.0, 20).tolist())).c
    return decide(
        4.5861,
        exact,
        holds=rounds_to(exact, "4.5861") and close(shot, exact, 1e-9),
        reason=f"A Runge-Kutta solution gives {shot:.9g}.",
    )


_S = tuple(np.linspace(0.05, 1.0, 20).tolist())
_SMALL, _SMALLER, _MU = 0.04, 0.02, 1.454


def _order(which: int) -> float:
    """The power of lambda with which psi, tau or U of the expansion differ from the exact solution."""
    errors = []
    for value in (_SMALL, _SMALLER):
        shot = _shoot(value, _S, _MU)
        exact: Array = (shot.psi, shot.tau, shot.U)[which]
        errors.append(float(np.abs(expansion(value, np.array(_S), _MU)[which] - exact).max()))
    return math.log(errors[0] / errors[1]) / math.log(_SMALL / _SMALLER)


@claim(
    "expansion",
    "section 4.2, (4.21)-(4.22)",
    "psi and tau for small lambda, up to lambda^2.",
)
def expansion_of_psi_and_tau() -> Finding:
    """The order of the error of the expansions."""
    orders = {"psi": _order(0), "tau": _order(1)}
    return decide(
        {"psi": 3.0, "tau": 3.0},
        orders,
        holds=all(abs(order - 3.0) < 0.2 for order in orders.values()),
        reason=f"The power of lambda of the difference from a Runge-Kutta solution, from lambda = {_SMALL} to "
        f"{_SMALLER}.",
    )


@claim(
    "expansion-of-velocity",
    "section 4.2, (4.23)",
    "U = F10 + (2 mu (1 - s) + F10/3) lambda + ... for small lambda.",
)
def expansion_of_velocity() -> Finding:
    """U at the base, where (4.17) makes it sqrt(tau), as printed and with 1 for F10."""
    F10 = _model(dissipative(SLOPE)).parameters.F10
    shot = _shoot(_SMALLER, _S, _MU)
    printed = F10 * (1.0 + _SMALLER / 3.0 + 5.0 / 36.0 * _SMALLER**2)
    order = _order(2)
    exact = float(shot.U[-1])
    return decide(
        printed,
        exact,
        holds=close(printed, exact, 1e-4),
        corrected=abs(order - 3.0) < 0.2 and close(printed / F10, exact, 1e-4),
        reason=f"U at the base for lambda = {_SMALLER} and F10 = {F10:.4g}.",
        correction=f"With 1 in place of F10 the error of the whole profile falls with the power {order:.2f} of "
        "lambda: U is in units of F10 already.",
    )


@claim(
    "figure-12",
    "section 4.2, figure 12",
    "At tan(theta) = 0.3 and T_inf = 50 the expansion up to lambda^2 is close to the full solution.",
)
def figure_12() -> Finding:
    """Largest differences of the profiles, over their maxima."""
    chute, T = dissipative(SLOPE), 50.0
    p, flow = _model(chute).parameters, hot_flow(chute, T)
    z = np.linspace(0.0, 4.0 * T, 201)
    psi, tau, U = expansion(p.lambda_, np.exp(-z / T), p.mu)
    found = _differences(flow, z, p.alpha * psi / T, T * tau, p.F10 * math.sqrt(T) * U)
    return decide(
        "close",
        found,
        holds=max(found.values()) < 0.05,
        reason="Largest differences over the maxima, up to z = 200.",
    )


def _differences(flow: Flow, z: Array, nu: Array, T: Array, u: Array) -> dict[str, float]:
    at = flow.profile(z)
    pairs = {"nu": (nu, at.volume_fraction), "T": (T, at.granular_temperature), "u": (u, at.velocity)}
    return {name: float(np.abs(a - b).max() / np.abs(b).max()) for name, (a, b) in pairs.items()}


@claim(
    "figure-13",
    "section 4.2, figure 13",
    "At lambda = 1 and T_inf = 100 the full solution has a density inversion, which the reduced system reproduces.",
)
def figure_13() -> Finding:
    """Height of the largest volume fraction over T_inf, and the rise above the base, by both."""
    chute, T = dissipative(slope_of_lambda(1.0)), 100.0
    exact, model, flow = _exact(chute), _model(chute), hot_flow(chute, T)
    P = np.linspace(1e-6, 1.0, 400) * exact.P_b
    z = -T * exact.log_s(P)
    nu = model.parameters.alpha * exact.psi(P) / T
    found = flow.profile(np.maximum(z, 0.0)).volume_fraction
    rise = {"reduced": float(nu.max() / nu[-1]), "full": float(found.max() / found[-1])}
    difference = float(np.abs(nu - found).max() / found.max())
    return decide(
        "inverted",
        rise,
        holds=flow.density == "inverted" and exact.inverted and difference < 0.05,
        reason=f"Largest nu over nu at the base; the profiles differ by {difference:.1%} of the maximum at most.",
    )
