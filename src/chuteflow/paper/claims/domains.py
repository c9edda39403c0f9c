"""Section 4.3, figure 14: which chutes have flows."""

from __future__ import annotations

import itertools
import math

import numpy as np

from chuteflow import Chute, curve, flows, hot
from chuteflow.maps import exists_at
from chuteflow.numerics.roots import bisect
from chuteflow.paper.claims.cold import cold_slope_bounds
from chuteflow.paper.claims.hot_flows import slope_of_lambda
from chuteflow.paper.claims.registry import Finding, claim, close, decide, rounds_to
from chuteflow.paper.claims.shared import PRODUCTIVE, SLOPE, all_flows, curve_of, folds, hot_flow
from chuteflow.paper.materials import dissipative, productive
from chuteflow.theory.boundary import ROUGHNESS_RANGE
from chuteflow.theory.hot import HotEnergyBudget, budget, hot_solution, inversion_lambda, slope_at, slope_bounds

#: The bound that section 4.3 gives for lambda.
PRINTED = 2.284
_ROUGHNESS = np.linspace(*ROUGHNESS_RANGE, 41).tolist()


@claim(
    "lambda-c",
    "section 4.3",
    "Dissipative hot flows exist for 0 < lambda < 2.284.",
)
def lambda_c() -> Finding:
    """The bound of the exact solution, and full solutions between the two bounds and beyond."""
    from scipy.special import i0e, i1e

    far = 1e9
    bound = 3.0 * float(i1e(far) / i0e(far)) ** 2  # (4.13): I1/I0 = sqrt(lambda/3) at the base
    between, beyond = dissipative(0.4), dissipative(0.405)
    lambdas = {chute: hot(chute).parameters.lambda_ for chute in (between, beyond)}
    found = [hot_flow(between, T) for T in (1e2, 1e4)]
    M = hot(between).mass_holdup or math.nan
    agree = all(close(flow.mass_holdup, M, 1e-6) and flow.error < 1e-8 for flow in found)
    none = not any(len(flows(beyond, T_surface=T)) for T in (1e2, 1e4))
    c = hot_solution(PRINTED).c
    return decide(
        PRINTED,
        bound,
        holds=rounds_to(bound, "2.284") and not agree,
        corrected=PRINTED < lambdas[between] < bound < lambdas[beyond] and agree and none,
        reason=f"I1/I0 = sqrt(lambda/3) has one root for each lambda below {bound:.6g}.",
        correction=f"The full equations have hot flows at tan(theta) = 0.4, lambda = {lambdas[between]:.3f}, with M = "
        f"{found[-1].mass_holdup:.5g} at T_inf = 1e2 and 1e4 as the exact solution says, and none at 0.405, lambda = "
        f"{lambdas[beyond]:.3f}. At 2.284 c = {c:.1e}: shooting from s well below 1/c meets rounding there.",
    )


@claim(
    "deep-near-the-bound",
    "section 4.3",
    "Near the upper bound of lambda the depth of the flow increases dramatically.",
)
def deep_near_the_bound() -> Finding:
    """ln(h/T_inf) as lambda nears its bound."""
    values = (1.0, 2.0, PRINTED, 2.6, 2.9)
    logs = {f"{value:g}": hot_solution(value).log_centre_of_mass for value in values}
    steps = np.diff(list(logs.values()))
    return decide(
        "dramatically",
        logs,
        holds=bool(np.all(steps > 0.0)) and logs["2.9"] > math.log(1e6),
        reason=f"ln(h/T_inf) by lambda; h/T_inf is {math.exp(logs['1']):.3g} at 1, {math.exp(logs['2.284']):.3g} at "
        f"2.284 and {math.exp(logs['2.9']):.1e} at 2.9.",
    )


@claim(
    "sign-of-lambda",
    "section 4.3, (4.14)",
    "The bound lambda = 0 separates flows from lambda < 0 with delta > 0, where base and interior both lose energy.",
)
def sign_of_lambda() -> Finding:
    """Signs of lambda, delta and F21 over a grid of chutes."""
    grid = itertools.product((0.1, 0.2, 0.3, 0.4, 0.5), (0.7, 0.8, 0.9), (0.5, 0.7, 0.9), (0.5, 0.6, 0.7, 0.8))
    parameters = [hot(Chute(*values)).parameters for values in grid]
    apart = sum(p.lambda_ * p.delta < 0.0 for p in parameters)
    both_lose = [p for p in parameters if p.F21 < 0.0 < p.delta]
    return decide(
        "lambda < 0 with delta > 0",
        f"{apart} of {len(parameters)} chutes",
        holds=apart > 0,
        corrected=apart == 0 and bool(both_lose) and all(p.obstacle for p in both_lose),
        reason="lambda = 3 F21^2/(2 g30 delta) has the sign of delta.",
        correction=f"On {len(both_lose)} chutes base and interior both lose energy, and lambda is positive: it "
        "touches 0 where F21 = 0 without changing sign. What is meant is F21 < 0 with delta > 0, where there is no "
        "hot flow.",
    )


@claim("minimum-slope", "section 4.3", "The bound lambda = 0 predicts the minimum chute slope for steady flows.")
def minimum_slope() -> Finding:
    """The bound of hot flows at r = 0.6, flows below it, and the bound of the coldest."""
    bound = slope_of_lambda(0.0)
    found = {slope: exists_at([dissipative(slope)], [2e-3, 1.0, 1e2])[0].tolist() for slope in (0.185, 0.193)}
    cold = cold_slope_bounds(dissipative(SLOPE))[0]
    solved = flows(dissipative(0.185), T_surface=2e-3)
    hottest = max(flow.surface_temperature for flow in all_flows(curve_of(dissipative(0.185))))
    return decide(
        bound,
        cold,
        holds=not any(found[0.185]),
        corrected=found[0.185] == [True, False, False]
        and all(found[0.193])
        and len(solved) > 0
        and cold < 0.185 < bound,
        reason="The slope with F21 = 0 for e = e_w = 0.8, r = 0.6, and the slope from which on any flow exists.",
        correction="For hot flows it does. Gentler slopes have flows that are cold and dense: at 0.185 with T_inf "
        f"up to {hottest:.2g}. The slope on which the base gives nothing to the densest flow is {cold:.4g}.",
    )


@claim(
    "lambda-zero-agrees",
    "section 4.3, figure 14(a)",
    "The curve lambda = 0 is in good agreement with the boundary at which solutions of the full equations are found.",
)
def lambda_zero_agrees() -> Finding:
    """Whether there are flows just on the steeper side of the curve, at two temperatures of figure 14."""
    limit = hot(dissipative(SLOPE)).parameters.dilute
    roughness = (0.5, 0.6, 0.7, 0.8)
    found = {}
    for factor in (0.995, 1.005):
        slopes = [factor * (slope_at(limit, 0.8, r, 0.0) or math.nan) for r in roughness]
        chutes = [Chute(slope, 0.8, 0.8, r) for slope, r in zip(slopes, roughness, strict=True)]
        found[factor] = exists_at(chutes, [10.0, 500.0])
    near = bool(found[1.005].all() and not found[0.995].any())
    return decide(
        "good agreement",
        "within 0.5 %" if near else "apart",
        holds=near,
        reason="At T_inf = 10 and 500 and r = 0.5, 0.6, 0.7 and 0.8 there are flows on slopes 0.5 % above the curve, "
        f"in {found[1.005].mean():.0%} of these cases, and 0.5 % below it in {found[0.995].mean():.0%}.",
    )


@claim(
    "small-cold-region",
    "section 4.3, figure 14(a)",
    "Beyond the curve lambda = 0 there are flows in a small region with tan(theta) > 0.35 and r > 0.83, at T_inf = 1 "
    "alone.",
)
def small_cold_region() -> Finding:
    """The roughness from which on flows at T_inf = 1 exist just below the slope with F21 = 0."""
    roughness = np.arange(0.80, 0.8601, 0.0025)
    limit = hot(dissipative(SLOPE)).parameters.dilute
    slopes = [0.999 * (slope_at(limit, 0.8, float(r), 0.0) or math.nan) for r in roughness]
    exists = exists_at(
        [Chute(s, 0.8, 0.8, float(r)) for s, r in zip(slopes, roughness, strict=True)], [1.0, 10.0, 100.0]
    )
    first = int(np.argmax(exists[:, 0]))
    onset = {"r": float(roughness[first]), "tan(theta)": slopes[first]}
    contiguous = bool(exists[first:, 0].all() and not exists[:first, 0].any() and first > 0)
    return decide(
        {"r": 0.83, "tan(theta)": 0.35},
        onset,
        holds=contiguous
        and not exists[:, 1:].any()
        and abs(onset["r"] - 0.83) < 0.0076
        and rounds_to(slopes[first], "0.35"),
        reason="Where such flows begin along the curve; at T_inf = 10 and 100 there are none.",
    )


@claim(
    "lambda-inversion",
    "section 4.3",
    "Hot flows are monotonic for lambda < 0.660, and inverted beyond.",
)
def lambda_inversion() -> Finding:
    """Where 2 x I1/I0 = 1 at the base, and full solutions on both sides."""
    found = inversion_lambda()
    sides = [hot_flow(dissipative(slope_of_lambda(value)), 1e5).density for value in (0.659, 0.662)]
    return decide(
        0.660,
        found,
        holds=rounds_to(found, "0.660") and sides == ["monotonic", "inverted"],
        reason=f"Full solutions at T_inf = 1e5 are {sides[0]} at lambda = 0.659 and {sides[1]} at 0.662.",
    )


@claim(
    "inversion-slope",
    "section 4.3",
    "lambda = 0.660 is at tan(theta) = 0.335, or 18.6 degrees, for e = e_w = 0.8, r = 0.6.",
)
def inversion_slope() -> Finding:
    """The slope in closed form; lambda at the printed one; the full equations on both sides."""
    found = slope_of_lambda(0.660)
    angle = math.degrees(math.atan(found))
    at_printed = hot(dissipative(0.335)).parameters.lambda_
    sides = [hot_flow(dissipative(slope), 1e5).density for slope in (0.3355, 0.3365)]
    return decide(
        {"tan(theta)": 0.335, "theta": 18.6},
        {"tan(theta)": found, "theta": angle},
        holds=rounds_to(found, "0.335"),
        corrected=sides == ["monotonic", "inverted"] and rounds_to(found, "0.336") and rounds_to(angle, "18.6"),
        reason=f"At tan(theta) = 0.335 lambda is {at_printed:.4f}.",
        correction="The slope rounds to 0.336, which is the printed angle of 18.6 degrees; hot full solutions are "
        "monotonic at 0.3355 and inverted at 0.3365.",
    )


@claim(
    "inversion-and-transition",
    "section 4.3; section 5",
    "The change from three flows at one flux to two above a minimum coincides with, and results from, the density "
    "inversion of hot flows.",
)
def inversion_and_transition() -> Finding:
    """The upper end of the range with three flows, near the slope of the inversion, for three bases."""
    here = {slope: len(folds(curve_of(dissipative(slope), 1e-6, 40))) for slope in (0.338, 0.339)}
    together = here == {0.338: 2, 0.339: 1}
    smooth, rough = _near_inversion(0.55, 1.03), _near_inversion(0.7, 0.97)
    return decide(
        "coincide",
        {
            "r = 0.6": "within 1 %" if together else "apart",
            "r = 0.55": "change later by over 3 %" if smooth == 2 else "not later",
            "r = 0.7": "change earlier by over 3 %" if rough == 1 else "not earlier",
        },
        holds=together and smooth == 1 and rough == 2,
        reason=f"At r = 0.6 the upper fold in Q leaves to infinity between tan(theta) = 0.338 and 0.339, and hot flows "
        f"turn inverted at {slope_of_lambda(inversion_lambda()):.4g}. At r = 0.55 there are {smooth} folds on a "
        f"slope 3 % beyond the inversion; at r = 0.7 there is {rough} on a slope 3 % before it.",
    )


def _near_inversion(roughness: float, factor: float) -> int:
    """Folds of Q on a slope that is ``factor`` times that of the inversion of hot flows, e = e_w = 0.8."""
    slope = slope_at(hot(dissipative(SLOPE)).parameters.dilute, 0.8, roughness, inversion_lambda()) or math.nan
    chute = Chute(factor * slope, 0.8, 0.8, roughness)
    return len(folds(curve_of(chute, 1e-4, 40)))


@claim(
    "no-productive-flows",
    "section 4.3",
    "With e = e_w = 0.8 no roughness from 1/2 to sqrt(3)/2 and no slope have delta < 0 and F21 < 0: no productive hot "
    "flows.",
)
def no_productive_flows() -> Finding:
    """Slopes with F21 = 0 and with delta = 0 over the roughness."""
    limit = hot(dissipative(SLOPE)).parameters.dilute
    kinds = {bounds.interior for r in _ROUGHNESS if (bounds := slope_bounds(limit, 0.8, r))}
    base = [slope_at(limit, 0.8, r, 0.0) or math.nan for r in _ROUGHNESS]
    interior = math.sqrt(limit.g20 * limit.g52)
    return decide(
        "none",
        "none" if "productive" not in kinds else "some",
        holds=kinds == {"dissipative"} and max(base) < interior,
        reason=f"F21 < 0 up to slopes of at most {max(base):.4g}, delta < 0 from {interior:.4g} on.",
    )


@claim(
    "productive-flows",
    "section 4.3, figure 14(b)",
    "With e = 0.9 and e_w = 0.6 there are productive hot flows on relatively steep slopes, L/M < tan^2(theta) < l/m, "
    "and dissipative ones on relatively gentle slopes.",
)
def productive_flows() -> Finding:
    """The bounds over the roughness, and full solutions next to them."""
    limit = hot(productive(SLOPE)).parameters.dilute
    by_roughness = {r: bounds for r in _ROUGHNESS if (bounds := slope_bounds(limit, 0.6, r))}
    kinds = {kind: [b for b in by_roughness.values() if b.interior == kind] for kind in ("dissipative", "productive")}
    bounds = by_roughness[min(by_roughness, key=lambda r: abs(r - 0.8))]
    r = min(by_roughness, key=lambda r: abs(r - 0.8))
    inside, outside = ([Chute(s, 0.9, 0.6, r) for s in pair] for pair in _around(bounds.lowest, bounds.highest))
    exists = [bool(row.any()) for row in (exists_at(inside, [1e4]).T[0], exists_at(outside, [1e4]).T[0])]
    return decide(
        "productive and dissipative",
        {
            kind: f"{min(b.lowest for b in rows):.4g} to {max(b.highest for b in rows):.4g}"
            for kind, rows in kinds.items()
            if rows
        },
        holds=bool(kinds["dissipative"])
        and bool(kinds["productive"])
        and exists == [True, False]
        and max(b.lowest for b in kinds["dissipative"]) < min(b.highest for b in kinds["productive"]),
        reason=f"Slopes of hot flows over all roughnesses; at r = {r:.3g} the full equations have flows at T_inf = "
        f"1e4 just inside {bounds.lowest:.4g} to {bounds.highest:.4g}, and none just outside.",
    )


def _around(low: float, high: float) -> tuple[tuple[float, float], tuple[float, float]]:
    return (1.02 * low, 0.99 * high), (0.98 * low, 1.01 * high)


@claim(
    "mixed-flows",
    "section 4.3, figure 14(b)",
    "With e = 0.9 and e_w = 0.6, where delta > 0 and the base takes energy, there are flows that are productive in "
    "parts and dissipative in others, but not at arbitrarily large T_inf.",
)
def mixed_flows() -> Finding:
    """Kinds and hottest flows at r = 0.8, with hold-ups up to 100, by slope."""
    hottest, kinds, deeper = {}, set(), []
    for slope in (0.32, 0.34):
        chute = productive(slope)
        p = hot(chute).parameters
        if p.delta > 0.0 > p.F21:
            found = [
                all_flows(curve(chute, points=30, surface_temperature=(1e-2, 1e6), largest_holdup=M)) for M in (50, 200)
            ]
            tops = [max(flow.surface_temperature for flow in part) for part in found]
            hottest[f"{slope:g}"] = tops[-1]
            deeper.append(tops[1] / tops[0] - 1.0)
            kinds |= {flow.interior for flow in found[0]}
    return decide(
        "mixed, T_inf bounded",
        {f"T_inf up to, {name}": value for name, value in hottest.items()},
        holds=len(hottest) == 2 and kinds == {"mixed"} and max(map(abs, deeper)) < 1e-2,
        reason=f"Interior {' or '.join(sorted(kinds))}; between hold-ups of 50 and 200 the hottest flow changes by "
        f"{max(map(abs, deeper)):.0e}.",
    )


@claim(
    "no-lower-bound",
    "section 4.3",
    "For delta < 0 hot flows exist for all lambda < 0.",
)
def no_lower_bound() -> Finding:
    """The exact solution for very negative lambda, put into its base condition, and a full solution."""
    from scipy.special import j0, j1

    off = []
    for value in (-1e-3, -1.0, -1e3, -1e9):
        x = hot_solution(value).x
        off.append(abs(float(j0(x) / j1(x)) * math.sqrt(-value / 3.0) - 1.0))
    chute = productive(0.347)
    full = len(flows(chute, T_surface=1e4))
    lambda_ = hot(chute).parameters.lambda_
    return decide(
        "no bound",
        {"lambda of a full solution": lambda_, "largest misfit down to -1e9": max(off)},
        holds=max(off[:3]) < 1e-6 and full == 1 and lambda_ < -5.0,
        reason="J1/J0 = sqrt(-lambda/3) always has a root below the first zero of J0. At tan(theta) = 0.347 of the "
        f"productive chute the full equations have {full} flow at T_inf = 1e4.",
    )


@claim(
    "productive-monotonic",
    "section 4.3",
    "All productive hot flows have monotonic volume fraction profiles.",
)
def productive_monotonic() -> Finding:
    """The exact solution for lambda from -1e-3 to -1e6, and all flows of figure 6."""
    exact = [_falls_with_height(-(10.0**power)) for power in range(-3, 7)]
    full = {flow.density for slope in PRODUCTIVE for flow in all_flows(curve_of(productive(slope)))}
    return decide(
        "monotonic",
        " or ".join(sorted(full)),
        holds=all(exact) and full == {"monotonic"},
        reason="psi = P/J0(P/k)^2 rises with P for every lambda < 0; all flows of figure 6, hot and cold, are "
        "monotonic too.",
    )


def _falls_with_height(lambda_: float) -> bool:
    solution = hot_solution(lambda_)
    psi = np.abs(solution.psi(np.linspace(0.0, 1.0, 400) * solution.P_b))
    return bool(np.all(np.diff(psi) > 0.0))


@claim(
    "interior-bound",
    "section 4.3, (4.25)",
    "delta > 0 is tan^2(theta) < L/M, and L/M = g20 g52.",
)
def interior_bound() -> Finding:
    """L/M from (4.25), g20 g52, and the sign of delta around it."""
    limit = hot(dissipative(SLOPE)).parameters.dilute
    b = _budget(PRINTED)
    root = math.sqrt(b.L / b.M)
    signs = [hot(dissipative(factor * root)).parameters.delta > 0.0 for factor in (0.999, 1.001)]
    return decide(
        limit.g20 * limit.g52,
        b.L / b.M,
        holds=close(b.L / b.M, limit.g20 * limit.g52, 1e-12) and signs == [True, False],
        reason=f"For e = 0.8 a slope of {root:.4g}, where delta changes sign.",
    )


def _budget(lambda_: float) -> HotEnergyBudget:
    return budget(hot(dissipative(SLOPE)).parameters.dilute, 0.8, 0.6, lambda_)


@claim(
    "slope-bounds",
    "section 4.3, (4.26)-(4.27)",
    "The slopes with 0 < lambda < lambda_c are l/m < tan^2(theta) < tan^2(theta_0), where m tan^2(theta_0) - l = "
    "(L - M tan^2(theta_0))^(1/2).",
)
def bounds_of_slope() -> Finding:
    """The printed formulas with lambda_c = 2.284, solved by bisection, put back into (4.14)."""
    b = _budget(PRINTED)
    lowest = math.sqrt(b.l / b.m)

    def surplus(square: float) -> float:
        return b.m * square - b.l - math.sqrt(max(b.L - b.M * square, 0.0))

    highest = math.sqrt(bisect(surplus, b.l / b.m, b.L / b.M))
    back = {"lambda at theta_0": hot(dissipative(highest)).parameters.lambda_}
    F21 = hot(dissipative(lowest)).parameters.F21
    return decide(
        PRINTED,
        {"lowest": lowest, "highest": highest, **back},
        holds=close(back["lambda at theta_0"], PRINTED, 1e-9) and abs(F21) < 1e-9,
        reason=f"(4.14) at the upper bound gives lambda_c, and F21 = {F21:.0e} at the lower. The formulas hold; with "
        f"lambda_c = 3 the upper bound is {slope_of_lambda(3.0):.5g}.",
    )


@claim(
    "less-accurate-upper-bound",
    "section 4.3, figure 14(a)",
    "The bound lambda = 2.284 approximates the existence boundary less accurately, perhaps due to numerical errors.",
)
def less_accurate_upper_bound() -> Finding:
    """The steepest slope with flows at T_inf = 100, r = 0.6, beside both bounds."""
    slopes = np.arange(0.385, 0.4051, 0.0025)
    exists = exists_at([dissipative(float(slope)) for slope in slopes], [100.0])[:, 0]
    steepest = float(slopes[exists].max()) if exists.any() else math.nan
    printed, exact = slope_of_lambda(PRINTED), slope_of_lambda(3.0)
    return decide(
        {"bound as printed": printed},
        {"steepest slope with flows": steepest, "bound for lambda = 3": exact},
        holds=steepest > printed and steepest < exact and exact - steepest < 0.005,
        reason="Slopes at r = 0.6 in steps of 0.0025, T_inf = 100 and M up to 30. The exact bound is as accurate as "
        "that of lambda = 0.",
    )
