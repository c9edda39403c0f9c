"""One flow: the error estimate, the choice of resolution, extreme temperatures, failure as data."""

import numpy as np
import pytest

from chuteflow import Chute, InputError, flows
from chuteflow.steady.collocation import LOG_M, LOG_Q, LOG_T, Collocation
from chuteflow.steady.model import model
from chuteflow.steady.solver import (
    Condition,
    Status,
    checked_tolerance,
    prolong,
    resolve,
    solve,
    solve_many,
)

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
STEEP = Chute(0.34, 0.8, 0.8, 0.6)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("temperature", [1e-3, 0.1, 2.0])
@pytest.mark.parametrize("chute", [PAPER, STEEP, Chute(0.3, 0.8, 0.8, 0.6, surface="interface")])
def test_the_estimated_error_bounds_the_true_one(chute, temperature, tolerance):
    for flow in flows(chute, T_surface=temperature, tolerance=tolerance):
        solution = flow.solution
        condition = Condition.fix(LOG_T, temperature)
        exact = solve(*prolong(solution.problem, solution.z, 180), condition, 1e-11)
        true = np.abs(np.expm1(solution.macroscopic - exact.macroscopic))[:LOG_T].max()
        assert true <= flow.error <= tolerance


@pytest.mark.parametrize("temperature", [1e-3, 1e-2, 1.0, 1e2, 1e5])
def test_from_cold_to_hot(temperature):
    (flow,) = flows(PAPER, T_surface=temperature)
    assert flow.surface_temperature == pytest.approx(temperature, rel=1e-12)
    assert flow.error <= 1e-10
    assert flow.solution.problem.degree <= 54


def test_a_hot_flow_needs_no_more_than_24_unknowns():
    (flow,) = flows(PAPER, T_surface=10.0)
    assert flow.solution.problem.degree <= 24


def test_a_neighbouring_flow_is_reached_from_a_flow():
    first = flows(PAPER, Q=3.0)[0].solution
    second = resolve(first, Condition.fix(LOG_Q, 3.1))
    assert second.converged
    assert np.exp(second.macroscopic[LOG_Q]) == pytest.approx(3.1, rel=1e-12)
    # Q = 3.1 by the search
    found = flows(PAPER, Q=3.1)[0]
    np.testing.assert_allclose(second.macroscopic, found.solution.macroscopic, atol=1e-10)


def test_many_flows_are_the_same_as_one_by_one():
    starts = [flow.solution for flow in flows(PAPER, Q=3.0)]
    conditions = [Condition.fix(LOG_M, 1.01 * np.exp(s.macroscopic[LOG_M])) for s in starts]
    many = solve_many([(s.problem, s.z) for s in starts], conditions)
    for s, condition, together in zip(starts, conditions, many, strict=True):
        alone = solve(s.problem, s.z, condition)
        assert together.converged
        np.testing.assert_allclose(together.macroscopic, alone.macroscopic, atol=2e-11)


def test_many_flows_fall_back_where_one_start_is_poor():
    good = flows(PAPER, Q=3.0)[0].solution
    poor = good.z.copy()
    poor[:-2] += 1.5 * np.sin(9.0 * good.problem.grid.nodes)
    condition = Condition.fix(LOG_T, 7.0)
    first, second = solve_many([(good.problem, good.z), (good.problem, poor)], [condition] * 2)
    assert first.converged
    if second.converged:
        np.testing.assert_allclose(first.macroscopic, second.macroscopic, atol=1e-9)


def test_no_solution_is_data_not_an_exception():
    steady = model(Chute(0.2, 0.8, 0.8, 0.85))  # base and interior both lose energy
    problem = Collocation(steady, 16, 0.0)
    z = np.concatenate([0.1 * problem.grid.nodes, [0.0, 0.0]])
    solution = solve(problem, z, Condition.fix(LOG_T, 1.0))
    assert solution.status is Status.NO_CONVERGENCE
    assert not solution.converged
    assert "start from a nearer flow" in solution.status.value


@pytest.mark.parametrize("tolerance", [0.0, 1e-12, 0.1, float("nan")])
def test_a_tolerance_out_of_range_is_refused(tolerance):
    with pytest.raises(InputError, match="must be from 1e-11 to 1e-3"):
        checked_tolerance(tolerance)
