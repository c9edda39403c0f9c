"""The paper's method against the overburden one, and against itself: order, counts, limits, continuation."""

from collections.abc import Sequence
from dataclasses import fields, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from chuteflow import Chute, Flow, InputError, curve, flows
from chuteflow.numerics.continuation import ContinuationSettings, CurvePoint, fold_of, locate, trace
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T
from chuteflow.steady.mapped.solution import (
    DEGREES,
    MappedSolution,
    MappedSystem,
    best_multiple,
    refine,
    sampling,
    solve_mapped,
)
from chuteflow.steady.solver import Condition, SolverStatus

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
CHUTES = {
    "paper": PAPER,
    "interface": Chute(0.3, 0.8, 0.8, 0.6, surface="interface"),
    "fourier": Chute(0.3, 0.8, 0.8, 0.6, closure="lun-fourier"),
    "interface-fourier": Chute(0.3, 0.8, 0.8, 0.6, surface="interface", closure="lun-fourier"),
    "productive": Chute(0.4, 0.9, 0.6, 0.8),
    "productive-interface": Chute(0.4, 0.9, 0.6, 0.8, surface="interface"),
}
AT_FLUX = Condition.fix(LOG_Q, 3.0)


@cache
def references(name: str) -> Sequence[Flow]:
    """The flows at Q = 3 by the overburden method."""
    return flows(CHUTES[name], Q=3.0, tolerance=1e-11).flows


CASES = [
    pytest.param(name, i, id=f"{name}-{letter}")
    for name in CHUTES
    for i, letter in enumerate({"productive": "A", "productive-interface": "AB"}.get(name, "ABC"))
]


@pytest.mark.parametrize("name", CHUTES)
def test_the_cases_are_all_the_flows(name):
    assert len(references(name)) == sum(case.values[0] == name for case in CASES)


# Against the overburden method


@pytest.mark.parametrize(("name", "which"), CASES)
def test_both_methods_agree(name, which):
    flow = references(name)[which]
    mapped = refine(CHUTES[name], flow, AT_FLUX)
    assert mapped.converged
    assert mapped.error <= 1e-10
    for quantity in ("mass_flux", "centre_of_mass", "mass_holdup"):
        difference = getattr(mapped, quantity) / getattr(flow, quantity) - 1.0
        assert abs(difference) <= mapped.error + flow.error
    assert mapped.surface_temperature == pytest.approx(flow.surface_temperature, rel=1e-8)
    assert mapped.residual < 1e-6


@pytest.mark.parametrize(("name", "which"), CASES)
def test_profiles_agree(name, which):
    flow = references(name)[which]
    mapped = refine(CHUTES[name], flow, AT_FLUX, 1e-11)
    highest = min(5.0 * flow.centre_of_mass, flow.interface_height, mapped.interface_height)
    z = np.linspace(0.0, highest, 60).reshape(3, 20)
    ours, theirs = mapped.profile(z), flow.profile(z)
    for field in fields(ours):
        a, b = getattr(ours, field.name), getattr(theirs, field.name)
        assert a.shape == z.shape
        # The part of the heat flux along the density gradient takes a derivative of nu, which costs digits.
        allowed = 1e-7 if field.name == "density_heat_flux" else 1e-8
        assert np.abs(a - b).max() <= allowed * np.abs(b).max(), field.name


@pytest.mark.parametrize("temperature", [0.1, 1.0, 1e3, 1e5])
@pytest.mark.parametrize("surface", ["free", "interface"])
def test_from_cold_to_hot(surface, temperature):
    chute = Chute(0.3, 0.8, 0.8, 0.6, surface=surface)
    (flow,) = flows(chute, T_surface=temperature, tolerance=1e-11)
    mapped = refine(chute, flow, Condition.fix(LOG_T, temperature))
    assert mapped.converged
    assert np.abs(mapped.macroscopic - flow.solution.macroscopic).max() < 1e-8
    assert mapped.degree <= (40 if surface == "interface" or temperature > 1.0 else 300)


@pytest.mark.parametrize("multiple", [None, 1, 3])
@pytest.mark.parametrize("temperature", [0.04, 0.2, 1.0, 10.0])
@pytest.mark.parametrize("name", ["paper", "interface", "steep"])
def test_the_error_is_honest_also_where_it_is_large(name, temperature, multiple):
    chute = CHUTES.get(name, Chute(0.34, 0.8, 0.8, 0.6))
    condition = Condition.fix(LOG_T, temperature)
    for flow in flows(chute, T_surface=temperature, tolerance=1e-11):
        for degree in (8, 14, 24, 60):
            mapped = solve_mapped(chute, flow, condition, degree, multiple=multiple)
            if mapped.status is SolverStatus.NO_CONVERGENCE:
                assert np.isnan(mapped.macroscopic).all()
                continue
            true = np.abs(mapped.macroscopic - flow.solution.macroscopic)[:LOG_T].max()
            assert true <= mapped.error + flow.error
            assert mapped.converged == (mapped.error < np.inf)


# The equations


@pytest.mark.parametrize("name", ["paper", "interface", "fourier"])
@pytest.mark.parametrize("multiple", [1, 3])
def test_the_jacobian_is_that_of_the_residual(name, multiple):
    rng = np.random.default_rng(7)
    start = solve_mapped(CHUTES[name], references(name)[1], AT_FLUX, 10, multiple=multiple)
    z = start.z + 0.002 * rng.standard_normal(start.z.shape)
    _, jacobian, _, gradient = start.system.evaluate(z)
    for _ in range(5):
        direction = rng.standard_normal(z.shape)
        step = 1e-6 * direction
        ahead, behind = (start.system.evaluate(z + sign * step) for sign in (1.0, -1.0))
        for exact, part in ((jacobian, 0), (gradient, 2)):
            difference = (ahead[part] - behind[part]) / 2e-6
            np.testing.assert_allclose(exact @ direction, difference, atol=1e-7 * np.abs(exact).sum(axis=1).max())


@pytest.mark.parametrize("degree", [8, 30])
@pytest.mark.parametrize("surface", ["free", "interface"])
def test_one_equation_is_missing(surface, degree):
    system = MappedSystem(Chute(0.3, 0.8, 0.8, 0.6, surface=surface), degree)
    n = 2 * degree + (4 if surface == "free" else 5)
    assert system.weights.shape == (n,)
    flow = references("paper" if surface == "free" else "interface")[0]
    solution = solve_mapped(system.chute, flow, AT_FLUX, degree)
    residual, jacobian = system.residual_and_jacobian(solution.z)
    assert residual.shape == (n - 1,)
    assert jacobian.shape == (n - 1, n)
    assert np.linalg.matrix_rank(jacobian) == n - 1


@pytest.mark.parametrize("multiple", [1, 2, 4])
def test_the_far_field_conditions_are_met_unasked(multiple):
    solution = refine(PAPER, references("paper")[0], AT_FLUX, 1e-11, multiple=multiple)
    signs = (-1.0) ** np.arange(solution.degree + 1)
    assert solution.map_length == pytest.approx(2.0 * multiple * solution.surface_temperature, rel=1e-13)
    assert abs(signs @ solution.x_coefficients) < 1e-12
    assert signs @ solution.y_coefficients == pytest.approx(np.sqrt(solution.surface_temperature), rel=1e-13)


def test_the_flow_does_not_depend_on_the_multiple():
    found = [refine(PAPER, references("paper")[1], AT_FLUX, multiple=k).macroscopic for k in (1, 2, 3, 5, 8)]
    assert np.ptp(found, axis=0)[:LOG_T].max() < 1e-10


@pytest.mark.parametrize(("name", "which"), CASES)
def test_the_base_carries_the_holdup(name, which):
    solution = refine(CHUTES[name], references(name)[which], AT_FLUX)
    bottom = solution.profile(0.0)
    above = np.sqrt(np.pi) / 48.0 if "interface" in name else 0.0
    assert float(bottom.normal_stress) == pytest.approx(solution.mass_holdup + above, rel=1e-9)
    assert float(bottom.shear_stress) == pytest.approx(-solution.chute.slope * float(bottom.normal_stress))


@pytest.mark.parametrize(("name", "largest"), [("paper", 64), ("interface", 32)])
def test_coefficients_and_residuals_fall_exponentially(name, largest):
    degrees = np.arange(8, 21, 4)
    found = [solve_mapped(CHUTES[name], references(name)[0], AT_FLUX, int(n)) for n in degrees]
    for values in (
        [s.residual for s in found],
        [s.error for s in found],
        [np.abs(s.x_coefficients[-2:]).max() for s in found],
    ):
        rate = np.polyfit(degrees, np.log(values), 1)[0]
        assert rate < -1.0
    assert refine(CHUTES[name], references(name)[2], AT_FLUX, multiple=9).degree > largest / 4


def test_the_sampling_is_exact_for_polynomials():
    m = sampling(9)
    nodes = m.points[1:-1]
    np.testing.assert_allclose(np.cos(9 * np.arccos(2.0 * nodes - 1.0)), 0.0, atol=1e-13)
    np.testing.assert_allclose(m.differentiate @ m.points**10, 10.0 * nodes**9, atol=1e-12)
    np.testing.assert_allclose(m.accumulate @ nodes**8, nodes**9 / 9.0, atol=1e-14)
    assert m.weights @ nodes**8 == pytest.approx(1.0 / 9.0)
    series = m.to_coefficients @ nodes**8
    assert m.basis[-1, :9] @ series == pytest.approx(1.0)
    assert m.basis_slope[-1, :9] @ series == pytest.approx(8.0)


# Starts, conditions, failures


@pytest.mark.parametrize("which", [LOG_Q, LOG_H, LOG_M, LOG_T])
@pytest.mark.parametrize("name", ["paper", "interface"])
def test_any_quantity_can_be_prescribed(name, which):
    flow = references(name)[0]
    value = 1.02 * float(np.exp(flow.solution.macroscopic[which]))
    mapped = refine(CHUTES[name], flow, Condition.fix(which, value))
    assert np.exp(mapped.macroscopic[which]) == pytest.approx(value, rel=1e-12)
    found = {
        LOG_Q: lambda: flows(CHUTES[name], Q=value),
        LOG_H: lambda: flows(CHUTES[name], h=value),
        LOG_M: lambda: flows(CHUTES[name], M=value),
        LOG_T: lambda: flows(CHUTES[name], T_surface=value),
    }[which]()
    nearest = min(found, key=lambda f: np.abs(f.solution.macroscopic - mapped.macroscopic).max())
    np.testing.assert_allclose(mapped.macroscopic, nearest.solution.macroscopic, atol=1e-8)


def test_it_can_go_on_by_itself_to_another_chute():
    first = refine(PAPER, references("paper")[1], AT_FLUX)
    other = Chute(0.305, 0.8, 0.79, 0.61)
    second = refine(other, first, AT_FLUX)
    assert second.converged
    assert second.chute == other
    reference = flows(other, Q=3.0)[1]
    np.testing.assert_allclose(second.macroscopic, reference.solution.macroscopic, atol=1e-8)


def test_another_degree_and_multiple_is_the_same_flow():
    first = refine(PAPER, references("paper")[1], AT_FLUX, 1e-11, multiple=1)
    system, matrix = first.system.transfer(60, 3)
    residual, _ = system.residual_and_jacobian(matrix @ first.z)
    assert np.abs(residual).max() < 1e-7
    np.testing.assert_allclose(system.macroscopic(matrix @ first.z), first.macroscopic, atol=1e-9)


def test_a_cold_flow_on_the_half_line_is_said_to_be_unresolved():
    (flow,) = flows(PAPER, T_surface=0.04)
    mapped = refine(PAPER, flow, Condition.fix(LOG_T, 0.04), largest_degree=150)
    assert mapped.status is SolverStatus.UNRESOLVED
    assert mapped.degree == 150
    assert np.abs(mapped.macroscopic - flow.solution.macroscopic)[:LOG_T].max() <= mapped.error < 0.1


def test_what_only_the_discrete_equations_know_is_not_believed():
    # L = 2 T_inf is far too short for a cold flow.
    mapped = solve_mapped(PAPER, references("paper")[2], AT_FLUX, 64, multiple=1)
    assert mapped.status is SolverStatus.UNRESOLVED
    assert mapped.residual > 1.0
    assert mapped.error == np.inf


def test_no_flow_is_no_flow():
    # Q has a minimum of 2.77 on the branch of A and B.
    mapped = solve_mapped(PAPER, references("paper")[0], Condition.fix(LOG_Q, 0.3), 24)
    assert mapped.status is SolverStatus.NO_CONVERGENCE
    assert mapped.error == np.inf
    assert np.isnan(mapped.macroscopic).all()


def test_the_caller_keeps_its_arrays():
    first = solve_mapped(PAPER, references("paper")[0], AT_FLUX, 16)
    before = first.z.copy()
    solve_mapped(PAPER, first, Condition.fix(LOG_Q, 3.1), 20)
    first.profile(np.ones(3))
    assert (first.z == before).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"degree": 3}, "degree N = 3"),
        ({"degree": 16, "multiple": 0}, "multiple k = 0"),
        ({"degree": 16, "multiple": 1.5}, "multiple k = 1.5"),
        ({"degree": 16, "chute": CHUTES["interface"]}, "surface 'free'"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(InputError, match=message):
        solve_mapped(**({"chute": PAPER, "start": references("paper")[0], "condition": AT_FLUX} | arguments))


def test_heights_outside_the_flow_are_refused():
    solution = solve_mapped(CHUTES["interface"], references("interface")[0], AT_FLUX, 16)
    for z in (-0.1, 1.01 * solution.interface_height, np.nan):
        with pytest.raises(InputError, match="heights"):
            solution.profile(z)


def test_the_best_multiple_follows_the_depth():
    assert [best_multiple(x) for x in (0.2, 1.2, 2.6, 9.0)] == [1, 1, 3, 9]
    cold = references("paper")[2]
    degrees = {k: refine(PAPER, cold, AT_FLUX, 1e-8, multiple=k).degree for k in (2, 9, 40)}
    assert degrees[9] < min(degrees[2], degrees[40])


# Continuation


def traced(
    solution: MappedSolution, direction: float, coldest: float, control: ContinuationSettings
) -> list[CurvePoint[MappedSystem]]:
    """Points from a solution on, as ln S times ``direction`` grows, until T_surface is below ``coldest``."""
    degree = min(d for d in DEGREES if d >= solution.degree)
    system, matrix = solution.system.transfer(degree, solution.system.multiple)
    ahead = np.zeros(len(system.weights))
    ahead[-2] = direction
    points = []
    for point in trace(system, matrix @ solution.z, direction=ahead, control=control):
        points.append(point)
        if point.system.macroscopic(point.z)[LOG_T] < np.log(coldest):
            return points
    raise AssertionError("the curve ended early")


@pytest.mark.parametrize("name", ["paper", "interface"])
def test_the_curve_is_followed_through_both_folds_of_the_flux(name):
    control = ContinuationSettings(initial_step=0.05, max_step=0.4, max_angle=0.3, tolerance=1e-9, min_step=1e-6)
    start = refine(CHUTES[name], references(name)[0], AT_FLUX)
    points = traced(start, -1.0, 0.5, control)
    fold = fold_of(lambda z, system: np.eye(len(z))[-1])
    found = []
    for a, b in pairwise(points):
        if b.step > 0.0 and (a.tangent[-1] > 0.0) != (b.tangent[-1] > 0.0):
            found.append(locate(a, b, b.system, fold, control=control).point.z[-1])
    (branch,) = curve(CHUTES[name], points=60, surface_temperature=(0.4, 20.0)).branches
    expected = [np.log(special.flow.mass_flux) for special in branch.special if special.kind == "fold-Q"]
    assert len(expected) == 2
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_the_curve_adapts_degree_and_multiple_and_passes_the_known_flows():
    control = ContinuationSettings(initial_step=0.05, max_step=0.4, max_angle=0.3, tolerance=1e-9, min_step=1e-6)
    start = refine(PAPER, references("paper")[1], AT_FLUX)
    points = traced(start, -1.0, 0.25, control)
    assert points[-1].system.degree > 2 * points[0].system.degree
    assert points[-1].system.multiple > points[0].system.multiple
    last = points[-1]
    near = MappedSolution(
        last.system, last.z, last.system.macroscopic(last.z), np.inf, np.inf, SolverStatus.CONVERGED, last.iterations
    )
    third = refine(PAPER, near, AT_FLUX)
    np.testing.assert_allclose(third.macroscopic, references("paper")[2].solution.macroscopic, atol=1e-8)


def test_another_base_is_refused():
    other = replace(PAPER, base="johnson-jackson:specularity=0.5")
    with pytest.raises(InputError, match="the mapped method is known for the base richman alone"):
        solve_mapped(other, flows(PAPER, Q=3.0)[0], AT_FLUX, 16)
