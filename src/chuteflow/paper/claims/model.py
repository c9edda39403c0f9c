"""Sections 1 to 3.1: the constitutive laws, the base and the equations of a fully developed flow."""

from __future__ import annotations

import math

import numpy as np

from chuteflow import Flow, hot
from chuteflow.paper.claims.registry import Finding, claim, close, decide
from chuteflow.paper.claims.shared import (
    SLOPE,
    STEEP,
    all_flows,
    closures,
    curve_of,
    flows_at,
    named_flows,
    profile_slope,
)
from chuteflow.paper.materials import dissipative
from chuteflow.theory.boundary import kappa
from chuteflow.theory.constitutive import WALL_CONTACT, require_positive
from chuteflow.theory.hot import dilute
from chuteflow.theory.laws import law

E, ROUGHNESS, WALL = 0.8, 0.6, 0.8
_DENSITIES = np.linspace(0.0, 0.6, 61)


@claim(
    "moderate-density",
    "section 1",
    "The study is limited to relatively dilute flows, below the volume fraction 0.49 at which Jenkins (2007) alters "
    "the kinetic theory.",
)
def moderate_density() -> Finding:
    """The largest volume fraction in the flows of figures 2 and 3."""
    limit = 0.49
    found = sorted(all_flows(curve_of(dissipative(SLOPE))), key=lambda flow: flow.surface_temperature)
    dense = [flow for flow in found if flow.largest_volume_fraction >= limit]
    at_three = max(flow.largest_volume_fraction for flow in flows_at())
    contiguous = bool(dense) and dense == found[: len(dense)]
    hottest = dense[-1] if dense else found[0]
    return decide(
        "below 0.49",
        max(flow.largest_volume_fraction for flow in found),
        holds=not dense,
        corrected=at_three < limit and contiguous,
        reason=f"The densest of the flows at Q = 3 reaches {at_three:.3g}.",
        correction=f"On the curve of figure 3 all flows colder than T_inf = {hottest.surface_temperature:.3g}, that is "
        f"with Q below {hottest.mass_flux:.3g} on the low temperature branch, exceed 0.49 at their densest.",
    )


@claim(
    "maximum-flow-rate",
    "section 2",
    "A purely collisional theory predicts no maximum flow rate, in contrast to Anderson & Jackson (1992).",
)
def maximum_flow_rate() -> Finding:
    """Whether Q is unbounded: on the slopes of figure 4, and where the chute is too gentle for hot flows."""
    hot_everywhere = all(hot(dissipative(slope)).exists for slope in STEEP)
    gentle = dissipative(0.18)
    found = curve_of(gentle, 1e-4)
    largest = max(flow.mass_flux for flow in all_flows(found))
    ends = max(float(branch.mass_flux[end]) for branch in found.branches for end in (0, -1))
    bounded = not hot(gentle).exists and ends < largest
    return decide(
        "none",
        f"none on slopes with hot flows; {largest:.3g} at tan(theta) = 0.18",
        holds=hot_everywhere and not bounded,
        corrected=hot_everywhere and bounded,
        reason="Where there are hot flows Q grows like sqrt(T_inf), so that every flux is met.",
        correction=f"At tan(theta) = 0.18, where the base takes energy from hot flows, there are cold flows alone, and "
        f"their flux is at most {largest:.3g}.",
    )


@claim(
    "elastic-limit",
    "section 2.1, table 1",
    "K* is not negative and vanishes for elastic grains; gamma is proportional to 1 - e^2.",
)
def elastic_limit() -> Finding:
    """Signs and proportionality over all e that the law allows."""
    allowed = allowed_restitutions()
    least = min(float(closures(_DENSITIES, e).density_conductivity.min()) for e in allowed)
    elastic = float(np.abs(closures(_DENSITIES, 1.0).density_conductivity).max())
    ratios = [closures(_DENSITIES, e).dissipation / (1.0 - e**2) for e in allowed if e < 1.0]
    spread = float(max(np.abs(ratio / ratios[0] - 1.0).max() for ratio in ratios))
    return decide(
        {"g4 at e = 1": 0.0},
        {"g4 at e = 1": elastic, "least g4": least, "spread of gamma/(1 - e^2)": spread},
        holds=least >= 0.0 and elastic == 0.0 and spread < 1e-12,
        reason=f"Over volume fractions up to 0.6 and e from {allowed[0]:.2f} to 1.",
    )


def allowed_restitutions() -> list[float]:
    """Values of e for which the law of Lun et al. keeps its meaning."""
    found = []
    for e in np.round(np.linspace(1.0, 0.05, 96), 2).tolist():
        try:
            require_positive(law("lun"), e, SLOPE)
        except ValueError:
            break
        found.append(e)
    return sorted(found)


@claim(
    "roughness-range",
    "section 2.2, (2.8)",
    "With d_w = d the roughness is from 1/2 to sqrt(3)/2, so that no grain touches the flat base.",
)
def roughness_range() -> Finding:
    """Where a grain that rests between bumps touches the flat base, from the geometry of equal spheres."""
    # In diameters, bumps are 2 r apart; the grain lies 1 from the centres of those that carry it.
    between_two = math.sqrt(1.0 - 0.5**2)
    between_three = math.sqrt(3.0) / 2.0 * between_two
    touching_bumps = (0.0 + 1.0) / (1.0 + 1.0)
    return decide(
        {"least": 0.5, "largest": math.sqrt(3.0) / 2.0},
        {"least": touching_bumps, "largest": between_two},
        holds=close(between_two, math.sqrt(3.0) / 2.0, 1e-12) and touching_bumps == 0.5,
        reason="For a grain on two neighbouring bumps, and bumps that touch at the least; in a hollow of three bumps "
        f"that are equally far apart a grain reaches the base from r = {between_three:.3g} on.",
    )


@claim(
    "slip-not-small",
    "section 2.2",
    "In many solutions the slip velocity is not small in comparison with sqrt(T), as Richman (1988) assumes.",
)
def slip_not_small() -> Finding:
    """The slip velocity over sqrt(T) at the base, along the curve of figure 3."""

    def slip(flow: Flow) -> float:
        return flow.slip_velocity / math.sqrt(flow.base_temperature)

    along = [slip(flow) for flow in all_flows(curve_of(dissipative(SLOPE)))]
    return decide(
        "not small",
        {name: slip(flow) for name, flow in named_flows().items()},
        holds=sum(value > 1.0 for value in along) > 0.5 * len(along),
        reason=f"Along the curve of figure 3 it is from {min(along):.3g} to {max(along):.3g}.",
    )


@claim(
    "dilute-limits",
    "section 3.1, table 2; (4.4)",
    "Table 2 and A0 = 5 pi/(96 sqrt(2)) are the limits of table 1 and of nu A(nu) at small volume fraction.",
)
def dilute_limits() -> Finding:
    """The printed formulas against the limits of table 1."""
    worst = 0.0
    root = math.sqrt(math.pi)
    for e in (0.6, 0.8, 0.9, 1.0):
        limit = dilute(law("lun"), e, SLOPE)
        printed = {
            "g20": 5.0 * root / (24.0 * (3.0 - e) * (1.0 + e)),
            "g30": 25.0 * root / (4.0 * (1.0 + e) * (49.0 - 33.0 * e)),
            "g40": 15.0 * root * e * (1.0 - e) / (2.0 * (49.0 - 33.0 * e)),
            "g52": 12.0 / root * (1.0 - e**2),
            "A0": 5.0 * math.pi / (96.0 * math.sqrt(2.0)),
        }
        worst = max(worst, *(abs(getattr(limit, name) - value) for name, value in printed.items()))
    return decide(
        {"A0": 5.0 * math.pi / (96.0 * math.sqrt(2.0))},
        {"A0": dilute(law("lun"), E, SLOPE).A0, "largest difference": worst},
        holds=worst < 1e-13,
        reason="Compared for g20, g30, g40, g52 and A0 at e = 0.6, 0.8, 0.9 and 1.",
    )


@claim(
    "coulomb-stress",
    "section 3.1, (3.1)-(3.5)",
    "P_xz = -tan(theta) P_zz throughout the flow.",
)
def coulomb_stress() -> Finding:
    """Stresses from the constitutive laws, with du/dz by differentiation of the velocity."""
    ratios = []
    for flow in flows_at():
        z = np.linspace(0.2, 0.8, 13) * flow.centre_of_mass
        at = flow.profile(z)
        g = closures(at.volume_fraction, E)
        shear = -g.viscosity * np.sqrt(at.granular_temperature)
        shear = shear * profile_slope(flow, "velocity", 0.0, flow.centre_of_mass)(z)
        normal = g.compressibility * at.volume_fraction * at.granular_temperature
        ratios.append(shear / normal)
    worst = float(np.abs(np.array(ratios) + SLOPE).max())
    return decide(
        -SLOPE,
        float(np.mean(ratios)),
        holds=worst < 1e-6,
        reason=f"In the flows of figure 2 the ratio of the stresses by (3.4) and (3.5) differs by {worst:.0e} at most.",
    )


@claim(
    "base-traction",
    "section 3.1, (3.13)",
    "The traction along the base is proportional to kappa u_s + (kappa - r^2/2) du/dz.",
)
def base_traction() -> Finding:
    """The factor of du/dz in (2.10), summed over its tensors for a shear flow, at the base of flow A."""
    nu = named_flows()["A"].base_volume_fraction
    radial = float(closures(np.array([nu]), E).radial[0])
    big_a = 1.0 + WALL_CONTACT * (1.0 + 5.0 / (8.0 * nu * radial))
    factor = _traction_factor(big_a)
    k, half = kappa(ROUGHNESS), 0.5 * ROUGHNESS**2
    return decide(
        k - half,
        factor,
        holds=close(factor, k - half, 1e-9),
        corrected=close(factor, k - big_a * half, 1e-12),
        reason=f"At the base of flow A, where A(nu) = {big_a:.4g}.",
        correction="The tensors of (2.13) give kappa - A r^2/2, which (3.16) has.",
    )


def _traction_factor(big_a: float) -> float:
    """A J_xzx + n_z I_xx of (2.10) and (2.13), with the normal along z."""
    t, tau, n = np.eye(3)  # along x, y and z
    lid = math.sqrt(1.0 - ROUGHNESS**2)
    k = kappa(ROUGHNESS)
    plane = np.outer(tau, tau) + np.outer(t, t)
    second = (k + 2.0 * lid) * np.outer(n, n) + k * plane
    third = (ROUGHNESS**2 - 2.0) * np.einsum("i,j,k", n, n, n) - 0.5 * ROUGHNESS**2 * (
        np.einsum("i,jk->ijk", n, plane) + np.einsum("j,ki->ijk", n, plane) + np.einsum("k,ij->ijk", n, plane)
    )
    return float(big_a * third[0, 2, 0] + n[2] * second[0, 0])


@claim(
    "slip-velocity",
    "section 3.1, (3.15)-(3.16)",
    "The slip velocity at the base is u_s = -F1 sqrt(T), with F1 as in (3.16).",
)
def slip_velocity() -> Finding:
    """F1 as printed, and the slip that balances (3.11) with the tensors of (2.13) and a differentiated velocity."""
    printed, computed, own = {}, {}, []
    k = kappa(ROUGHNESS)
    for name, flow in named_flows().items():
        nu, T = flow.base_volume_fraction, flow.base_temperature
        g = closures(np.array([nu]), E)
        g1, g2, g0 = nu * g.compressibility[0], g.viscosity[0], g.radial[0]
        big_a = 1.0 + WALL_CONTACT * (1.0 + 5.0 / (8.0 * nu * g0))
        printed[name] = float(SLOPE / k * (math.sqrt(math.pi / 2.0) + (k - 0.5 * big_a * ROUGHNESS**2) * g1 / g2))
        shear = profile_slope(flow, "velocity", 0.0, 0.5 * flow.centre_of_mass)(np.zeros(1))[0]
        # M_x = -tan(theta) g1 T, over sqrt(2/pi) g1 sqrt(T)
        u_s = -(math.sqrt(0.5 * math.pi * T) * SLOPE + _traction_factor(big_a) * shear) / k
        computed[name] = float(-u_s / math.sqrt(T))
        own.append(close(flow.slip_velocity / math.sqrt(T), printed[name], 1e-9))
    return decide(
        printed,
        computed,
        holds=all(close(computed[name], printed[name], 1e-6) for name in printed) and all(own),
        reason="F1 by (3.16), and -u_s/sqrt(T) from the balance of momentum (3.11) at the bases of figure 2.",
    )


@claim(
    "base-energy",
    "section 3.1, (3.17)-(3.18)",
    "The energy balance q = M_x u_s - D at the base is (3.17) with F2 as in (3.18).",
)
def base_energy() -> Finding:
    """(3.18) as printed against the heat flux (3.6) with differentiated profiles, at the bases of figure 2."""
    printed, computed = {}, {}
    k, lid = kappa(ROUGHNESS), math.sqrt(1.0 - ROUGHNESS**2)
    for name, flow in named_flows().items():
        nu, T, zero = flow.base_volume_fraction, flow.base_temperature, np.zeros(1)
        g = closures(np.array([nu]), E)
        g1, g2, g0 = nu * g.compressibility[0], g.viscosity[0], g.radial[0]
        wall_shear = 0.5 * ROUGHNESS**2 * (1.0 + WALL_CONTACT * (1.0 + 5.0 / (8.0 * nu * g0)))
        f1 = SLOPE / k * (math.sqrt(math.pi / 2.0) + (k - wall_shear) * g1 / g2)
        loss = 2.0 * (1.0 - WALL) / (1.0 + lid)
        work = k * f1**2 - g1 * SLOPE / g2 * (k - wall_shear) * f1
        printed[name] = float(g1 * math.sqrt(2.0 / math.pi) * (work - loss))
        depth = 0.5 * flow.centre_of_mass
        falls = profile_slope(flow, "granular_temperature", 0.0, depth)(zero)[0]
        thins = profile_slope(flow, "volume_fraction", 0.0, depth)(zero)[0]
        computed[name] = float(-g.conductivity[0] * falls / T + g.density_conductivity[0] * thins)
    return decide(
        printed,
        computed,
        holds=all(close(computed[name], printed[name], 1e-6) for name in printed),
        reason="F2 by (3.18), and the heat flux over T^(3/2) at the bases of the flows of figure 2.",
    )
