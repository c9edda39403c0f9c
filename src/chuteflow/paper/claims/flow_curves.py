"""Section 3.5, figures 3 and 4: branches of flows, and how they change with the slope."""

from __future__ import annotations

import itertools
import math

import numpy as np

from chuteflow import Curve, Flow, flows, hot
from chuteflow.maps import exists_at
from chuteflow.paper.claims.cold import cold_slope_bounds
from chuteflow.paper.claims.registry import Finding, claim, close, decide, rounds_to
from chuteflow.paper.claims.shared import GENTLE, SLOPE, STEEP, all_flows, count, curve_of, folds
from chuteflow.paper.materials import dissipative
from chuteflow.parameters import DEEPEST
from chuteflow.theory.laws import law


def _curve(slope: float) -> Curve:
    return curve_of(dissipative(slope))


@claim(
    "finite-range-of-slopes",
    "section 3.5",
    "For fixed material parameters steady solutions are found only for a finite range of inclination angles.",
)
def finite_range_of_slopes() -> Finding:
    """Slopes with any flow in steps of 0.01, for e = e_w = 0.8 and r = 0.6, with hold-ups up to 300."""
    slopes = np.arange(0.1, 0.6001, 0.01)
    temperatures = np.geomspace(1e-4, 1e4, 9)
    chutes = [dissipative(float(slope)) for slope in slopes]
    with_flow = np.flatnonzero(np.any(exists_at(chutes, temperatures, DEEPEST), axis=1))
    low, high = (float(slopes[with_flow[end]]) if with_flow.size else math.nan for end in (0, -1))
    gaps = bool(np.any(np.diff(with_flow) > 1))
    coldest = cold_slope_bounds(dissipative(SLOPE))[0]
    bounds = hot(dissipative(SLOPE)).slope_bounds
    hottest = bounds.highest if bounds else math.nan
    return decide(
        "finite",
        {"from tan(theta)": low, "to tan(theta)": high},
        holds=not gaps and coldest < low < coldest + 0.011 and hottest - 0.011 < high < hottest,
        reason=f"In steps of 0.01 from 0.1 to 0.6, T_inf from 1e-4 to 1e4, hold-ups up to {DEEPEST:g}. The limits of "
        f"the coldest and of hot flows are {coldest:.4g} and {hottest:.4g}.",
    )


@claim(
    "three-branches",
    "section 3.5, figure 3",
    "At tan(theta) = 0.3 there is a range of Q with three flows, and a unique flow outside it.",
)
def three_branches() -> Finding:
    """Folds, and the number of flows on their sides."""
    found = _curve(SLOPE)
    ends = folds(found)
    low, high = ends[0], ends[-1]
    inside = [count(found, Q) for Q in np.linspace(low, high, 12)[1:-1]]
    outside = [count(found, Q) for Q in (0.3, 0.5 * low, 0.99 * low, 1.01 * high, 2.0 * high, 50.0)]
    return decide(
        "three inside a range of Q, one outside",
        {"from Q": low, "to Q": high},
        holds=len(ends) == 2 and set(inside) == {3} and set(outside) == {1},
        reason=f"Inside the range there are {_counts(inside)} flows, outside {_counts(outside)}.",
    )


def _counts(numbers: list[int]) -> str:
    return " or ".join(str(number) for number in sorted(set(numbers)))


@claim(
    "holdup-one-to-one",
    "section 3.5, figure 3(c)",
    "Between mass hold-up and centre-of-mass there is a one-to-one relationship at tan(theta) = 0.3.",
)
def holdup_one_to_one() -> Finding:
    """Whether M rises and h falls all along the branch; the same a little steeper."""

    def monotonic(slope: float) -> bool:
        (branch,) = _curve(slope).branches
        return bool(np.all(np.diff(branch.mass_holdup) > 0.0) and np.all(np.diff(branch.centre_of_mass) < 0.0))

    return decide(
        "one-to-one",
        "one-to-one" if monotonic(SLOPE) else "not one-to-one",
        holds=monotonic(SLOPE),
        reason="Along the branch from hot to cold M rises and h falls all the way; at tan(theta) = 0.32 "
        f"{'too' if monotonic(0.32) else 'no longer, as M turns'}.",
    )


@claim(
    "window-grows",
    "section 3.5, figure 4(a)",
    "On gentle slopes, 0.22 to 0.3, there always is a range of Q with three flows, and it grows with the slope.",
)
def window_grows() -> Finding:
    """The range for each slope of figure 4(a)."""
    windows = {slope: folds(_curve(slope)) for slope in GENTLE}
    pairs = [ends for ends in windows.values() if len(ends) == 2]
    sizes = np.array([high - low for low, high in pairs])
    return decide(
        "grows",
        {f"{slope:g}": " to ".join(f"{Q:.4g}" for Q in ends) for slope, ends in windows.items()},
        holds=len(pairs) == len(GENTLE) and bool(np.all(np.diff(sizes) > 0.0)),
        reason="Ranges of Q by slope; their widths are " + _list(sizes.tolist()) + ".",
    )


@claim(
    "no-three-flows-on-steep-slopes",
    "section 3.5, figure 4(b)",
    "For tan(theta) > 0.33 three flows at one mass flux are no longer found.",
)
def no_three_flows_on_steep_slopes() -> Finding:
    """How many flows share one mass flux beyond 0.33, and up to which slope there is a third."""
    at_steeper, past = count(_curve(0.34), 50.0), count(_curve(0.36), 100.0)
    upper = {slope: folds(_curve(slope))[-1] for slope in (0.32, 0.33)}
    bound = cold_slope_bounds(dissipative(SLOPE))[1]
    again = flows(dissipative(0.34), Q=50.0)
    return decide(
        0.33,
        bound,
        holds=at_steeper < 3,
        corrected=len(again) == 3 and past == 2 and 0.34 < bound < 0.36,
        reason=f"The range with three flows ends at Q = {upper[0.32]:.3g} for tan(theta) = 0.32, and {upper[0.33]:.3g} "
        "for 0.33.",
        correction=f"At 0.34 a search at Q = 50 finds three flows, with T_inf = {_temperatures(list(again))}. The "
        f"third is dense and cold; such flows exist up to tan(theta) = {bound:.4g}, where the base gives more energy "
        f"than the densest flow can lose, and at 0.36 there are {past} flows.",
    )


def _temperatures(found: list[Flow]) -> str:
    return ", ".join(f"{flow.surface_temperature:.2g}" for flow in found)


@claim(
    "minimum-flux",
    "section 3.5, figure 4(b)",
    "On slopes steeper than 0.33 there is a minimum mass flux, and always two flows above it.",
)
def minimum_flux() -> Finding:
    """How many flows there are below and above the fold in Q, for the steep slopes of figure 4(b)."""
    found = {}
    for slope in (0.34, 0.35, 0.36):
        (fold,) = folds(_curve(slope))
        found[slope] = (fold, count(_curve(slope), 0.7 * fold), count(_curve(slope), 1.5 * fold))
    bound = cold_slope_bounds(dissipative(SLOPE))[1]
    gentle = len(flows(dissipative(0.34), Q=0.7 * found[0.34][0]))
    return decide(
        "none below, two above",
        {f"{slope:g}": f"{below} below Q = {fold:.4g}, {above} above" for slope, (fold, below, above) in found.items()},
        holds=all((below, above) == (0, 2) for _, below, above in found.values()),
        corrected=gentle == 1 and found[0.36][1:] == (0, 2) and bound < 0.36,
        reason="Flows with T_inf from 0.001 to 10000.",
        correction=f"It holds from tan(theta) = {bound:.4g} on. Below, there is one flow more at every flux, dense and "
        "cold, whose Q falls to zero with T_inf; the steeper, the colder.",
    )


@claim("transition-angle", "section 3.5", "tan(theta) > 0.33 is an inclination of more than 18 degrees.")
def transition_angle() -> Finding:
    """The angle."""
    angle = dissipative(0.33).angle
    return decide(18.0, angle, holds=rounds_to(angle, "18"), reason="The inclination for tan(theta) = 0.33 in degrees.")


@claim(
    "cold-gentle",
    "section 3.5",
    "On gentle slopes mass flux and flow depth approach zero at low granular temperature.",
)
def cold_gentle() -> Finding:
    """Q and h of ever colder flows at tan(theta) = 0.3."""
    chute = dissipative(SLOPE)
    cold = [flows(chute, T_surface=T)[-1] for T in (1e-4, 1e-5, 1e-6)]
    Q, h = ([getattr(flow, name) for flow in cold] for name in ("mass_flux", "centre_of_mass"))
    steady = close(h[2], h[1], 1e-2)
    packed = cold[-1].mass_holdup / (2.0 * law("lun").densest)
    return decide(
        {"Q": 0.0, "h": 0.0},
        {"Q at 1e-6": Q[2], "h at 1e-6": h[2]},
        holds=Q[2] < 0.4 * Q[1] and h[2] < 0.7 * h[1],
        corrected=Q[2] < 0.4 * Q[1] < 0.16 * Q[0] and steady and close(h[2], packed, 2e-2),
        reason=f"For T_inf = 1e-4, 1e-5, 1e-6 at tan(theta) = 0.3 Q = {_list(Q)} and h = {_list(h)}.",
        correction=f"The flux vanishes like sqrt(T_inf), the depth does not: M tends to {cold[-1].mass_holdup:.4g}, "
        f"and h to that of a layer of the densest packing, M/(2 nu*) = {packed:.4g}.",
    )


def _list(values: list[float]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)


@claim(
    "cold-steep",
    "section 3.5",
    "On steep slopes, tan(theta) > 0.33, mass flux and flow depth increase as the temperature approaches zero.",
)
def cold_steep() -> Finding:
    """Q and h of the deepest of ever colder flows."""
    found = {slope: [_deepest(slope, T) for T in (1e-1, 1e-2, 1e-3)] for slope in (0.34, 0.35, 0.36)}
    rising = all(
        a.mass_flux < b.mass_flux and a.centre_of_mass < b.centre_of_mass
        for row in found.values()
        for a, b in itertools.pairwise(row)
    )
    return decide(
        "increase",
        {f"{slope:g}": "Q = " + _list([flow.mass_flux for flow in row]) for slope, row in found.items()},
        holds=rising,
        reason="Deepest flows at T_inf = 0.1, 0.01, 0.001; at 0.34 there is also a branch of thin flows, whose flux "
        "falls.",
    )


def _deepest(slope: float, temperature: float) -> Flow:
    return max(flows(dissipative(slope), T_surface=temperature), key=lambda flow: flow.mass_holdup)


@claim(
    "no-inversion-on-gentle-slopes",
    "section 3.5, figure 4(a)",
    "For tan(theta) < 0.29 no flow has a density inversion.",
)
def no_inversion_on_gentle_slopes() -> Finding:
    """The slope at which the first flow turns inverted."""
    onset = inversion_onset("free")
    return decide(
        0.29,
        onset,
        holds=rounds_to(onset, "0.29"),
        reason="The slope from which on some flow of the branch is inverted.",
    )


def inversion_onset(surface: str) -> float:
    """The slope at which the first flow turns inverted, by linear interpolation between 0.289 and 0.29."""
    low, high = 0.289, 0.29
    below, above = largest_excess(low, surface), largest_excess(high, surface)
    return low - below * (high - low) / (above - below)


def largest_excess(slope: float, surface: str) -> float:
    """The largest rise of the density among the flows of a chute; positive where one is inverted."""
    return max(flow.density_excess for flow in all_flows(curve_of(dissipative(slope, surface))))


@claim(
    "inverted-if-shallow",
    "section 3.5, figure 4",
    "On steeper slopes, from 0.29 to 0.333, flows are inverted if the depth is sufficiently small.",
)
def inverted_if_shallow() -> Finding:
    """Depths at which the density turns, by slope."""
    slopes = (0.29, *STEEP[:4])
    turns = {
        slope: sorted(p.flow.centre_of_mass for p in _curve(slope).branches[0].special if p.kind == "density-inversion")
        for slope in slopes
    }
    kinds = {slope: _kinds_below(slope, ends[-1]) for slope, ends in turns.items()}
    single = [slope for slope in slopes if len(turns[slope]) == 1 and kinds[slope] == {"inverted"}]
    return decide(
        "below a depth",
        {f"{slope:g}": " to ".join(f"{h:.4g}" for h in ends) for slope, ends in turns.items()},
        holds=single == list(slopes),
        corrected=single == list(slopes[1:])
        and len(turns[0.29]) == 2
        and _kinds_below(0.29, turns[0.29][0]) == {"monotonic"},
        reason="Centres of mass at which the density turns, by slope.",
        correction="From 0.3 on all shallower flows are inverted; at 0.29 only those between the two depths are, and "
        "shallower flows are monotonic again.",
    )


def _kinds_below(slope: float, depth: float) -> set[str]:
    """Kinds of density of the flows shallower than ``depth``."""
    return {flow.density for branch in _curve(slope).branches for flow in branch.flows if flow.centre_of_mass < depth}


@claim(
    "all-inverted-on-steep-slopes",
    "section 3.5, figure 4(b)",
    "For tan(theta) > 0.333 all flows are inverted.",
)
def all_inverted_on_steep_slopes() -> Finding:
    """Whether hot flows are still monotonic beyond 0.333, and from which slope on none is."""
    from chuteflow import hot
    from chuteflow.theory.hot import inversion_lambda, slope_at

    bound = slope_at(hot(dissipative(SLOPE)).parameters.dilute, 0.8, 0.6, inversion_lambda()) or math.nan
    turn = {
        slope: max(p.flow.centre_of_mass for p in _curve(slope).branches[0].special if p.kind == "density-inversion")
        for slope in (0.332, 0.334)
    }
    hotter = flows(dissipative(0.334), T_surface=1e3)[0]
    steeper = {flow.density for slope in (0.337, *STEEP[4:]) for flow in all_flows(_curve(slope))}
    return decide(
        0.333,
        bound,
        holds=hotter.density == "inverted" and rounds_to(bound, "0.333"),
        corrected=hotter.density == "monotonic" and steeper == {"inverted"} and 0.334 < bound < 0.337,
        reason=f"Flows turn monotonic above h = {turn[0.332]:.3g} at tan(theta) = 0.332, and {turn[0.334]:.3g} at "
        "0.334.",
        correction=f"Hot flows stay monotonic up to lambda = {inversion_lambda():.4g}, a slope of {bound:.4g}; at "
        "0.337 and beyond all are inverted.",
    )


@claim(
    "base-gives-energy-on-all-slopes",
    "section 3.5, figure 4",
    "For all slopes of figure 4 the base remains a source of energy.",
)
def base_gives_energy_on_all_slopes() -> Finding:
    """The least heat flux from the base, over p sqrt(T), among all flows of all slopes."""
    slopes = sorted({*GENTLE, *STEEP})
    least = {
        slope: min(
            float(flow.profile(0.0).heat_flux) / (flow.mass_holdup * math.sqrt(flow.base_temperature))
            for flow in all_flows(_curve(slope))
        )
        for slope in slopes
    }
    return decide(
        "positive",
        {f"{slope:g}": value for slope, value in least.items()},
        holds=min(least.values()) > 0.0,
        reason="Least heat flux at the base over p sqrt(T) on each slope, of flows with T_inf from 0.001 to 10000.",
    )
