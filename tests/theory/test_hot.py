"""Hot flows: the exact solution against a Runge-Kutta method, quadrature, printed numbers and full flows."""

import json
import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.special import i0, i0e, i1e, j0, j1, jn_zeros

from chuteflow.errors import InputError, SolveError
from chuteflow.steady import solver
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T, Collocation
from chuteflow.steady.elements import Elements
from chuteflow.steady.hot import HotModel, hot, shoot
from chuteflow.steady.model import CONDUCTION, COUPLING, LOSS, WORK, model
from chuteflow.theory import boundary
from chuteflow.theory.constitutive import reduce
from chuteflow.theory.hot import (
    Dilute,
    budget,
    dilute,
    expansion,
    hot_parameters,
    hot_solution,
    inversion_lambda,
    slope_at,
    slope_bounds,
)
from chuteflow.theory.laws import LAWS

LAMBDAS = (-1e3, -5.0, -1.0, 0.27, 0.66, 1.0, 2.0, 2.284, 2.5)
SOLVABLE = st.one_of(
    st.floats(1e-12, 3.0 - 1e-9),
    st.floats(-12.0, 0.0).map(lambda power: 10.0**power),
    st.floats(-9.0, 0.0).map(lambda power: 3.0 - 10.0**power),
    st.floats(-12.0, 12.0).map(lambda power: -(10.0**power)),
)
# Time is the machine's affair.
UNHURRIED = settings(deadline=None)
SMOOTHNESS = st.floats(0.0, 1.0)
ROUGHNESS = st.floats(0.5, math.sqrt(3.0) / 2.0)

#: e = e_w = 0.8, r = 0.6: the material and base of most of the paper's figures.
#: Laws with a temperature far above: that of Garzo & Dufty in full has none.
WITH_LIMIT = [name for name in LAWS if name != "garzo-dufty"]
MATERIAL = dilute(LAWS["lun"], 0.8, 0.3)
PRODUCTIVE = dilute(LAWS["lun"], 0.9, 0.4)


def paper(slope: float) -> Chute:
    return Chute(slope, 0.8, 0.8, 0.6)


# The dilute limits


@UNHURRIED
@given(st.floats(0.05, 1.0))
def test_dilute_limits_are_those_of_table_2(e):
    root = math.sqrt(math.pi)
    limit = dilute(LAWS["lun"], e, 0.3)
    assert limit.g20 == pytest.approx(5.0 * root / (24.0 * (3.0 - e) * (1.0 + e)), rel=1e-14)
    assert limit.g30 == pytest.approx(25.0 * root / (4.0 * (1.0 + e) * (49.0 - 33.0 * e)), rel=1e-14)
    assert limit.g40 == pytest.approx(15.0 * root * e * (1.0 - e) / (2.0 * (49.0 - 33.0 * e)), rel=1e-14)
    assert limit.g52 == pytest.approx(12.0 / root * (1.0 - e**2), rel=1e-14)
    assert pytest.approx(5.0 * math.pi / (96.0 * math.sqrt(2.0)), rel=1e-14) == limit.A0  # (4.4)


@pytest.mark.parametrize("name", [name for name in WITH_LIMIT if not LAWS[name].knows_slope])
def test_dilute_limits_do_not_know_the_slope(name):
    assert dilute(LAWS[name], 0.85, 0.1) == dilute(LAWS[name], 0.85, 0.7)


@pytest.mark.parametrize("name", WITH_LIMIT)
def test_boundary_functions_are_the_limits_of_3_16_and_3_18(name):
    """F1 -> F10 (4.2), F2/nu -> F21 (4.3), with an error of the order of nu."""
    e, e_w, r, slope = 0.8, 0.7, 0.65, 0.33
    limit = hot_parameters(dilute(LAWS[name], e, slope), e_w, r, slope)
    errors = []
    for nu in (1e-4, 1e-5):
        x = np.array([nu / (1.0 - nu / LAWS[name].densest)])
        f = reduce(LAWS[name], x, e, slope)
        shear, wall_shear = f.shear[0], f.wall_shear[0]
        g1 = nu * f.compressibility[0]
        k = boundary.kappa(r)
        F1 = slope / k * (math.sqrt(math.pi / 2.0) + k * shear - 0.5 * r**2 * wall_shear)
        within = k * F1**2 - slope * (k * shear - 0.5 * r**2 * wall_shear) * F1
        F2 = g1 * math.sqrt(2.0 / math.pi) * (within - 2.0 * (1.0 - e_w) / (1.0 + math.sqrt(1.0 - r**2)))
        errors.append((F1 - limit.F10, F2 / nu - limit.F21))
    assert np.abs(errors[1]).max() < 1e-3
    assert np.divide(*errors) == pytest.approx(10.0, rel=0.01)


def test_4_3_as_printed():
    e_w, r, slope = 0.8, 0.6, 0.3
    limit = hot_parameters(MATERIAL, e_w, r, slope)
    square, k = slope**2, boundary.kappa(r)
    half = math.pi / 2.0
    F21 = math.sqrt(1.0 / half) * (
        half * square / k
        - math.sqrt(half) * square / (2.0 * k * MATERIAL.g20) * MATERIAL.A0 * r**2
        - 2.0 * (1.0 - e_w) / (1.0 + math.sqrt(1.0 - r**2))
    )
    assert pytest.approx(F21, rel=1e-13) == limit.F21


def test_scales_are_consistent():
    """alpha (4.10) and lambda (4.14) are what makes (4.7), (4.8) into (4.12), (4.13)."""
    a = hot(paper(0.3)).parameters
    assert a.lambda_ == pytest.approx(2.0 * MATERIAL.g30 / (3.0 * a.delta * a.alpha**2), rel=1e-13)
    assert 2.0 * MATERIAL.g30 / 3.0 == pytest.approx(a.F21 * a.alpha, rel=1e-13)
    # The fraction of shear in the flux does not depend on alpha.
    assert a.mu * a.lambda_ == pytest.approx(0.3 * a.F21 / (MATERIAL.g20 * a.F10 * a.delta), rel=1e-13)


# The exact solution


@UNHURRIED
@given(SOLVABLE)
@example(1e-12)
@example(3.0 - 1e-9)
@example(3.0 * (1.0 - 2e-16))
def test_base_condition_is_met(lambda_):
    x = hot_solution(lambda_).x
    B = math.sqrt(abs(lambda_) / 3.0)
    if lambda_ > 0.0:
        ratio = i1e(x) / i0e(x)
        assert ratio == pytest.approx(B, rel=1e-14)
        assert 1.0 - 1e-12 <= x * (3.0 - lambda_) / (3.0 * B) <= 2.0 + 1e-12
    else:
        assert 0.0 < x <= jn_zeros(0, 1)[0]
        assert j1(x) - B * j0(x) == pytest.approx(0.0, abs=1e-14 * math.hypot(1.0, B))


def test_roots_near_both_ends():
    """x = 2 B + B^3 + O(B^5) for small lambda, x = 1/(2 (1 - B)) + 1/4 + O(1 - B) near 3."""
    B = math.sqrt(1e-6 / 3.0)
    assert hot_solution(1e-6).x == pytest.approx(2.0 * B + B**3, rel=1e-12)
    assert hot_solution(-1e-6).x == pytest.approx(2.0 * B - B**3, rel=1e-12)
    for gap in (1e-3, 1e-6, 1e-9):
        lambda_ = 3.0 - gap
        one_less_root = (3.0 - lambda_) / 3.0 / (1.0 + math.sqrt(lambda_ / 3.0))
        expected = 0.5 / one_less_root + 0.25
        assert hot_solution(lambda_).x == pytest.approx(expected, rel=2.0 * gap**2 + 1e-13)


@pytest.mark.parametrize("lambda_", [0.0, 3.0, 3.4, math.inf, -math.inf, math.nan])
def test_no_solution_is_an_error(lambda_):
    with pytest.raises(InputError, match=r"below 3, other than 0|must be a finite number"):
        hot_solution(lambda_)
    with pytest.raises(InputError, match=r"below 3, other than 0|must be a finite number"):
        shoot(lambda_)


@pytest.mark.parametrize("lambda_", LAMBDAS)
def test_exact_solution_is_that_of_the_shooting(lambda_):
    mu = math.copysign(0.7, lambda_)
    exact, shot = hot_solution(lambda_), shoot(lambda_, mu)
    P = shot.psi * shot.tau
    assert shot.log_c == pytest.approx(exact.log_c, abs=1e-11 * max(1.0, exact.tau(P).max()))
    assert [shot.flux, shot.holdup, shot.centre_of_mass] == pytest.approx(
        [exact.flux(mu), exact.P_b, exact.centre_of_mass], rel=1e-10
    )
    assert shot.tau == pytest.approx(exact.tau(P), rel=1e-10)
    assert shot.psi == pytest.approx(exact.psi(P), rel=1e-9)  # as tau, and steeper
    assert pytest.approx(exact.velocity(P, mu), rel=1e-10, abs=1e-10) == shot.U
    # d ln s = tau dP/P
    assert np.log(shot.s) == pytest.approx(exact.log_s(P), abs=1e-11 * max(1.0, exact.tau(P).max()))


@pytest.mark.parametrize("lambda_", [*LAMBDAS, 2.9])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_shooting_does_not_understate_its_error(lambda_, tolerance):
    mu = math.copysign(0.7, lambda_)
    exact, shot = hot_solution(lambda_), shoot(lambda_, mu, tolerance=tolerance)
    pairs = [
        (shot.flux, exact.flux(mu)),
        (shot.holdup, exact.P_b),
        (shot.centre_of_mass, exact.centre_of_mass),
    ]
    assert max(abs(there / here - 1.0) for there, here in pairs) <= shot.error
    assert abs(shot.log_c - exact.log_c) <= shot.error_of_log_c


def test_shooting_goes_beyond_the_printed_bound():
    """Section 4.3 finds no solution beyond 2.284; the same equations have one at 2.9."""
    shot = shoot(2.9, 0.6)
    assert shot.holdup == pytest.approx(hot_solution(2.9).P_b, rel=1e-9)
    assert shot.error < 1e-7


def test_shooting_says_where_it_fails():
    with pytest.raises(SolveError, match=r"hot_solution, which is exact"):
        shoot(2.995)


@pytest.mark.parametrize(("s", "tolerance"), [([0.0, 1.0], 1e-10), ([1.1], 1e-10), ([], 1e-10), ([1.0], 0.0)])
def test_shooting_checks_its_input(s, tolerance):
    with pytest.raises(InputError):
        shoot(1.0, s=s, tolerance=tolerance)


def test_shooting_gives_fields_above_its_start():
    s = np.array([1e-9, 1e-12])
    shot = shoot(1.0, s=s)
    assert shot.psi == pytest.approx(shot.c * s, rel=1e-12)
    assert shot.tau == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("lambda_", [*LAMBDAS, -1e-6, 1e-6, 2.9])
def test_closed_forms_agree_with_quadrature(lambda_):
    mu = math.copysign(0.7, lambda_)
    exact = hot_solution(lambda_)
    bessel = i0 if lambda_ > 0.0 else j0

    def integral(f, low, high):
        return quad(f, low, high, epsabs=0.0, epsrel=1e-12, limit=400)[0]

    mean = integral(lambda y: bessel(y) ** 2, 0.0, exact.x) / exact.x
    assert exact.centre_of_mass == pytest.approx(mean, rel=1e-11)
    # ds/s = tau dP/P and psi = P/tau: the integrals (4.18) to (4.20) over ln s are over P.
    flux = integral(lambda P: float(exact.velocity(P, mu)), 0.0, exact.P_b)
    assert exact.flux(mu) == pytest.approx(flux, rel=1e-10)
    assert exact.log_flux(mu) == pytest.approx(math.log(abs(flux)), abs=1e-10)
    height = -integral(lambda P: float(exact.log_s(P)), 0.0, exact.P_b) / exact.P_b
    assert exact.centre_of_mass == pytest.approx(height, rel=1e-7)
    sheared = mu * integral(lambda P: bessel(abs(P) / exact.k), 0.4 * exact.P_b, exact.P_b)
    rise = exact.velocity(0.4 * exact.P_b, mu) - exact.velocity(exact.P_b, mu)
    assert float(rise) == pytest.approx(sheared, rel=1e-9)
    if abs(lambda_) > 1e-3:
        excess = integral(lambda y: (bessel(y) ** 2 - 1.0) / y, 0.0, exact.x)
        assert exact.log_c == pytest.approx(math.log(abs(exact.P_b)) + excess, rel=1e-10)


@UNHURRIED
@given(SOLVABLE)
def test_profiles_meet_their_conditions(lambda_):
    assume(lambda_ < 2.99)
    exact = hot_solution(lambda_)
    P = np.array([0.0, 0.3, 0.7, 1.0]) * exact.P_b
    assert exact.tau(P)[0] == 1.0
    assert exact.psi(P)[0] == 0.0
    # (4.17), and s = 1 at the base; J_0 near its zero has an absolute error alone.
    assert exact.velocity(P, 0.0) == pytest.approx(math.exp(0.5 * exact.log_tau_b), rel=1e-12)
    assert exact.tau(P)[3] == pytest.approx(math.exp(exact.log_tau_b), rel=1e-11, abs=1e-14)
    s = np.exp(exact.log_s(P))
    assert s[0] == 0.0
    assert np.all(np.diff(s) >= 0.0)
    # d ln s = tau dP/P magnifies the last digit of P.
    assert exact.log_s(P)[3] == pytest.approx(0.0, abs=4e-16 * max(1.0, math.exp(exact.log_tau_b)))


@UNHURRIED
@given(SOLVABLE)
def test_largest_density(lambda_):
    exact = hot_solution(lambda_)
    assume(lambda_ > -1e6)
    if exact.inverted:
        P = np.linspace(0.0, min(exact.P_b, 6.0), 6001)
        assert exact.largest_psi == pytest.approx(np.abs(exact.psi(P)).max(), rel=1e-6)
    else:
        P = np.linspace(0.0, exact.P_b, 201)
        assert np.all(np.diff(np.abs(exact.psi(P))) > 0.0)
        assert exact.largest_psi == pytest.approx(exact.psi(P)[-1], rel=1e-6)


def test_density_is_inverted_above_a_computed_lambda():
    onset = inversion_lambda()
    assert onset == pytest.approx(0.6603935, abs=5e-8)
    assert not hot_solution(onset - 1e-9).inverted
    assert hot_solution(onset + 1e-9).inverted
    assert not hot_solution(-2.0).inverted


def test_c_as_printed():
    assert hot_solution(1.0).c == pytest.approx(4.5861, abs=5e-5)
    assert shoot(1.0).c == pytest.approx(4.5861, abs=5e-5)
    assert hot_solution(2.284).c == pytest.approx(9.7e14, rel=5e-3)
    assert hot_solution(-1.0).c < 0.0


def test_what_overflows_is_infinite_or_refused_but_has_a_logarithm():
    exact = hot_solution(2.995)
    assert exact.centre_of_mass == math.inf
    assert exact.log_c == exact.c == math.inf
    # I_0(x)^2 grows like exp(2 x)/(2 pi x), its mean like that over 2 x.
    assert exact.log_centre_of_mass == pytest.approx(2.0 * exact.x - math.log(4.0 * math.pi * exact.x**2), abs=1e-2)
    assert list(exact.log_s([0.0, 1.0, exact.P_b])) == [-math.inf, -math.inf, 0.0]
    with pytest.raises(InputError, match="velocities overflow"):
        hot_solution(2.999).velocity(1.0, 0.5)
    assert hot_solution(3.0 - 1e-9).flux(0.5) == math.inf
    assert math.isfinite(hot_solution(3.0 - 1e-9).log_flux(0.5))


# The expansion


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_expansion_errs_like_the_cube_of_lambda(sign):
    """In (4.23) the constant terms are 1, lambda/3 and 5 lambda^2/36, and the others as printed."""
    mu, sizes = 0.7, (4e-3, 2e-3, 1e-3)
    errors = []
    for size in sizes:
        exact = hot_solution(sign * size)
        P = np.linspace(0.02, 1.0, 40) * exact.P_b
        fields = expansion(exact.lambda_, np.exp(exact.log_s(P)), mu)
        truth = exact.psi(P), exact.tau(P), exact.velocity(P, mu)
        errors.append([np.abs(a - b).max() for a, b in zip(fields, truth, strict=True)])
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx(8.0, rel=0.02)
    assert np.max(np.array(errors) / np.array(sizes)[:, None] ** 3) < 5.0


def test_expansion_meets_the_slip_condition():
    """(4.17): U = sqrt(tau) at s = 1."""
    for size in (1e-2, 1e-3):
        _, tau, U = expansion(size, 1.0, 0.7)
        assert float(U) == pytest.approx(math.sqrt(tau), abs=size**3)


# The slopes of hot flows


@UNHURRIED
@given(st.floats(0.05, 0.999), st.floats(0.0, 0.999), ROUGHNESS, st.floats(-9.0, 2.9))
def test_slope_at_a_lambda_has_this_lambda(e, e_w, r, lambda_):
    assume(abs(lambda_) > 1e-3)
    limit = dilute(LAWS["lun"], e, 0.3)
    slope = slope_at(limit, e_w, r, lambda_)
    bounds = slope_bounds(limit, e_w, r)
    assert bounds is not None
    if slope is None:
        assert (bounds.interior == "productive") == (lambda_ > 0.0)
        return
    assume(bounds.highest - bounds.lowest > 1e-4)
    found = hot_parameters(limit, e_w, r, slope)
    assert found.lambda_ == pytest.approx(lambda_, rel=1e-8)
    assert found.obstacle is None
    assert bounds.lowest < slope < bounds.highest


@UNHURRIED
@given(st.floats(0.05, 1.0), SMOOTHNESS, ROUGHNESS, st.floats(0.01, 1.5))
def test_hot_flows_exist_within_the_bounds_and_nowhere_else(e, e_w, r, slope):
    model = hot(Chute(slope, e, e_w, r))
    bounds = model.slope_bounds
    if bounds is None:
        assert not model.exists
    else:
        assume(min(abs(slope - bounds.lowest), abs(slope - bounds.highest)) > 1e-9)
        assert model.exists == (bounds.lowest < slope < bounds.highest)
        assert model.interior in (None, bounds.interior)
    assert model.exists == (model.reason is None)


@UNHURRIED
@given(st.floats(0.05, 1.0), SMOOTHNESS, ROUGHNESS, st.floats(0.01, 1.5))
def test_lambda_has_the_sign_of_delta(e, e_w, r, slope):
    a = hot_parameters(dilute(LAWS["lun"], e, slope), e_w, r, slope)
    assume(abs(a.F21) > 1e-9)
    assert math.copysign(1.0, a.lambda_) == math.copysign(1.0, a.delta)


def test_bounds_of_the_dissipative_case():
    bounds = slope_bounds(MATERIAL, 0.8, 0.6)
    assert bounds is not None
    assert bounds.interior == "dissipative"
    assert hot_parameters(MATERIAL, 0.8, 0.6, bounds.highest).lambda_ == pytest.approx(3.0, rel=1e-12)
    assert hot_parameters(MATERIAL, 0.8, 0.6, bounds.lowest).lambda_ == pytest.approx(0.0, abs=1e-28)
    printed = slope_bounds(MATERIAL, 0.8, 0.6, lambda_c=2.284)
    assert printed is not None
    assert printed.lowest == bounds.lowest
    assert hot_parameters(MATERIAL, 0.8, 0.6, printed.highest).lambda_ == pytest.approx(2.284, rel=1e-12)


def test_bounds_of_the_productive_case():
    """e = 0.9, e_w = 0.6, r = 0.8: L/M < tan^2 < l/m, whatever lambda_c."""
    bounds = slope_bounds(PRODUCTIVE, 0.6, 0.8)
    assert bounds is not None
    assert bounds.interior == "productive"
    assert bounds == slope_bounds(PRODUCTIVE, 0.6, 0.8, lambda_c=2.284)
    b = budget(PRODUCTIVE, 0.6, 0.8, 3.0)
    assert (bounds.lowest**2, bounds.highest**2) == pytest.approx((b.L / b.M, b.l / b.m), rel=1e-14)
    assert hot_parameters(PRODUCTIVE, 0.6, 0.8, bounds.lowest).delta == pytest.approx(0.0, abs=1e-14)
    assert pytest.approx(0.0, abs=1e-14) == hot_parameters(PRODUCTIVE, 0.6, 0.8, bounds.highest).F21
    for slope in (0.40, 0.42, 0.44):
        assert hot(Chute(slope, 0.9, 0.6, 0.8)).interior == "productive"


def test_numbers_of_section_4_3():
    assert hot(paper(0.3)).parameters.lambda_ == pytest.approx(0.27, abs=5e-3)
    # Printed as 0.335.
    assert slope_at(MATERIAL, 0.8, 0.6, 0.660) == pytest.approx(0.336, abs=5e-4)
    assert slope_at(MATERIAL, 0.8, 0.6, 1.0) == pytest.approx(0.354, abs=5e-4)


@pytest.mark.parametrize(
    ("base", "delta", "words"),
    [
        (1.0, 1e-9, "lambda = .* is not below 3"),
        (-1.0, 1.0, "both lose"),
        (1.0, -1.0, "both gain"),
        (0.0, 1.0, "base gives none"),
        (0.0, -1.0, "base takes none"),
        (1.0, 0.0, "interior takes none"),
        (-1.0, 0.0, "interior gives none"),
        (0.0, 0.0, "neither gain nor lose"),
    ],
)
def test_reasons(base, delta, words):
    import re

    from chuteflow.theory.hot import HotParameters

    obstacle = HotParameters(0.3, MATERIAL, 1.0, base, delta).obstacle
    assert obstacle is not None
    assert re.search(words, obstacle)


def test_elastic_grains_have_productive_hot_flows_alone():
    model = hot(Chute(0.15, 1.0, 0.8, 0.6))
    assert model.interior == "productive"
    assert model.slope_bounds is not None
    assert model.slope_bounds.lowest == 0.0
    assert hot(Chute(0.2, 1.0, 1.0, 0.6)).slope_bounds is None


def test_a_smooth_base_keeps_the_gentlest_slopes_hot():
    model = hot(Chute(1e-6, 0.8, 1.0, 0.6))
    assert model.slope_bounds is not None
    assert model.slope_bounds.lowest == 0.0
    assert model.exists


def test_limits_at_the_ends_of_the_bounds():
    """The hold-up tends to 0 where F21 = 0, and grows without bound where delta = 0 and where lambda = 3."""

    def holdup(slope: float, e: float, e_w: float, r: float) -> float:
        found = hot(Chute(slope, e, e_w, r)).mass_holdup
        assert found is not None
        return found

    bounds = slope_bounds(MATERIAL, 0.8, 0.6)
    assert bounds is not None
    assert holdup(bounds.lowest + 1e-7, 0.8, 0.8, 0.6) < 1e-5
    assert holdup(bounds.highest - 1e-7, 0.8, 0.8, 0.6) > 1e5
    bounds = slope_bounds(PRODUCTIVE, 0.6, 0.8)
    assert bounds is not None
    assert holdup(bounds.lowest + 1e-9, 0.9, 0.6, 0.8) > 1e4
    assert holdup(bounds.highest - 1e-9, 0.9, 0.6, 0.8) < 1e-6


# What is returned


@UNHURRIED
@given(st.floats(1e-3, 1.0), SMOOTHNESS, ROUGHNESS, st.floats(1e-3, 10.0))
def test_numbers_can_be_written_as_json(e, e_w, r, slope):
    numbers = hot(Chute(slope, e, e_w, r)).as_dict()
    assert json.loads(json.dumps(numbers, allow_nan=False)) == numbers
    flow = (numbers["M"], numbers["log_Q_over_sqrt_T"], numbers["log_h_over_T"], numbers["inverted"])
    assert [value is not None for value in flow] == [numbers["exists"]] * 4


def test_a_flux_too_large_for_a_number_is_null():
    slope = slope_at(MATERIAL, 0.8, 0.6, 2.999)
    assert slope is not None
    numbers = hot(paper(slope)).as_dict()
    assert numbers["exists"]
    assert numbers["Q_over_sqrt_T"] is None
    assert numbers["log_Q_over_sqrt_T"] > 2000.0


def test_interface_conditions_are_refused():
    with pytest.raises(InputError, match="surface = 'interface'"):
        hot(Chute(0.3, 0.8, 0.8, 0.6, surface="interface"))


def test_a_law_without_dilute_limit_is_refused():
    from dataclasses import replace

    def singular(nu, free_fraction, e, slope):
        return replace(LAWS["lun"].coefficients(nu, free_fraction, e, slope), density_conductivity=np.full(1, np.inf))

    with pytest.raises(InputError, match="no dilute limit"):
        dilute(replace(LAWS["lun"], coefficients=singular), 0.8, 0.3)


def test_slip_up_the_slope_is_refused():
    with pytest.raises(InputError, match="must be positive"):
        hot_parameters(Dilute(1e-3, 1.0, 0.0, 1.0, 0.1), 0.8, 0.6, 0.3)


# The full equations


def full_flow(model_: HotModel, temperature: float, tolerance: float) -> solver.Solution:
    """The flow of the full equations at this temperature, from the hot flow as a start."""
    exact = model_.solution
    assert exact is not None
    assert model_.mass_holdup is not None
    problem = Collocation(model(model_.chute), 54, 0.0)
    y = exact.x * problem.fraction[0]
    gradient = 2.0 * exact.x * (i1e(y) / i0e(y) if exact.lambda_ > 0.0 else -j1(y) / j0(y))
    z = np.append(gradient, [math.log(temperature), math.log(model_.mass_holdup)])
    start = Elements.of_collocation(problem, z)
    return solver.solve(start, solver.Condition.fix(LOG_T, temperature), tolerance)


def distances(model_: HotModel, temperature: float) -> np.ndarray:
    """Relative distance of the full flow in Q/sqrt(T), h/T and M."""
    flow = full_flow(model_, temperature, 1e-10)
    assert flow.converged
    assert model_.log_flux is not None
    assert model_.log_centre_of_mass is not None
    assert model_.mass_holdup is not None
    log_t = math.log(temperature)
    q = flow.macroscopic
    return np.abs(
        [
            q[LOG_Q] - 0.5 * log_t - model_.log_flux,
            q[LOG_H] - log_t - model_.log_centre_of_mass,
            q[LOG_M] - math.log(model_.mass_holdup),
        ]
    )


@pytest.mark.parametrize(
    "chute",
    [
        paper(0.3),
        paper(0.354),
        Chute(0.3, 0.8, 0.8, 0.6, closure="lun-fourier"),
        Chute(0.42, 0.9, 0.6, 0.8),
        Chute(0.1, 1.0, 0.9, 0.6),
    ],
    ids=["monotonic", "inverted", "fourier", "productive", "elastic"],
)
def test_full_flows_tend_to_the_hot_flow_like_one_over_t(chute):
    model_ = hot(chute)
    far = [distances(model_, T) for T in (1e1, 1e2, 1e3, 1e4, 1e5)]
    assert np.all(np.diff(far, axis=0) < 0.0)
    assert np.divide(far[1:4], far[2:5]) == pytest.approx(10.0, rel=0.35)
    assert np.divide(far[3], far[4]) == pytest.approx(10.0, rel=0.01)
    assert far[4].max() < 1e-4


def test_a_full_flow_exists_beyond_the_printed_bound():
    """tan(theta) = 0.40, lambda = 2.91."""
    model_ = hot(paper(0.40))
    assert model_.parameters.lambda_ == pytest.approx(2.909, abs=1e-3)
    far = []
    for T in (1e3, 1e4):
        flow = full_flow(model_, T, 1e-8)
        assert flow.converged
        far.append(flow.macroscopic[LOG_Q] - 0.5 * math.log(T) - model_.log_flux)
    assert far[0] / far[1] == pytest.approx(10.0, rel=0.01)


def lack_of_base_flux(chute: Chute, temperature: float, p: np.ndarray) -> np.ndarray:
    """Flux that the base gives less flux y, at ``p`` on the full equations' trajectory from a temperature."""
    problem, slope = model(chute), chute.slope

    def net(f):
        return f[LOSS, 0] - slope**2 * f[WORK, 0]

    def derivative(log_p, state):
        p, y = math.exp(log_p), state[1]
        f, _ = problem.closures(np.exp(state[:1]))
        v, k = p * y / f[CONDUCTION, 0], f[COUPLING, 0]
        return [1.0 - v, p * net(f) - y * (1.0 + 0.5 * (v + k * (1.0 - v)))]

    empty, _ = problem.closures(np.zeros(1))
    start = [math.log(p[0] / temperature), 0.5 * p[0] * net(empty)]
    span = math.log(p[0]), math.log(p[-1])
    path = solve_ivp(derivative, span, start, t_eval=np.log(p), rtol=1e-9, atol=1e-12, method="LSODA")
    f, _ = problem.closures(np.exp(path.y[0]))
    return problem.base_flux(f) - path.y[1]


@pytest.mark.parametrize("temperature", [1e1, 1e3, 1e5])
def test_full_hot_flows_end_at_lambda_3(temperature):
    """Below 3 the trajectory meets the flux of the base, above 3 it does not, however deep it goes."""
    p = np.geomspace(1e-4, 200.0, 400)
    below, above = slope_at(MATERIAL, 0.8, 0.6, 2.9), slope_at(MATERIAL, 0.8, 0.6, 3.05)
    assert below is not None
    assert above is not None
    assert np.count_nonzero(np.diff(np.sign(lack_of_base_flux(paper(below), temperature, p)))) == 1
    lack = lack_of_base_flux(paper(above), temperature, p)
    assert lack.min() > 0.0
    # y tends to sqrt(2 g30 delta) I_1(x)/I_0(x), with x = p/sqrt(2 g30/delta), which stays below F21.
    a = hot(paper(above)).parameters
    root = math.sqrt(2.0 * MATERIAL.g30 * a.delta)
    x = p[-1] * a.delta / root
    assert lack[-1] == pytest.approx(a.F21 - root * i1e(x) / i0e(x), rel=1e-4)
    assert root < a.F21
