"""The discretised problem: exact derivatives, and equations that hold between the nodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chuteflow import Chute, flows
from chuteflow.numerics.chebyshev import grid, refinement
from chuteflow.steady.collocation import Collocation, stretch_map, stretch_position
from chuteflow.steady.model import model

CHUTES = [
    Chute(0.3, 0.8, 0.8, 0.6),
    Chute(0.3, 0.8, 0.8, 0.6, surface="interface", closure="lun-fourier"),
    Chute(0.4, 0.9, 0.6, 0.8),
]


def unknowns(problem, seed):
    rng = np.random.default_rng(seed)
    s = problem.grid.nodes
    waves = rng.normal(size=3) @ np.stack([np.cos(2.0 * s), np.sin(3.0 * s), s])
    return np.concatenate([waves, rng.normal(size=2)])


@pytest.mark.parametrize("chute", CHUTES)
@pytest.mark.parametrize("stretch", [0.0, 2.5])
@pytest.mark.parametrize("seed", [1, 2])
def test_derivatives_are_exact(chute, stretch, seed):
    problem = Collocation(model(chute), 9, stretch)
    z = unknowns(problem, seed)
    state = problem.state(z)
    jacobian, gradient = state.jacobian(), state.macroscopic_gradient()
    h = 1e-5
    for k in range(len(z)):
        step = np.zeros_like(z)
        step[k] = h
        ahead, behind = problem.state(z + step), problem.state(z - step)
        slope = (ahead.residual() - behind.residual()) / (2.0 * h)
        np.testing.assert_allclose(jacobian[:, k], slope, atol=1e-7 * np.abs(jacobian).max())
        slope = (ahead.macroscopic() - behind.macroscopic()) / (2.0 * h)
        np.testing.assert_allclose(gradient[:, k], slope, atol=1e-8)


def test_many_flows_at_once_are_the_same_as_one_by_one():
    steady = model(CHUTES[0])
    stretches = [0.0, 1.3, 4.0]
    single = [Collocation(steady, 9, a) for a in stretches]
    zs = [unknowns(problem, seed) for seed, problem in enumerate(single)]
    together = Collocation(steady, 9, np.array(stretches)[:, None]).state(np.array(zs))
    for i, (problem, z) in enumerate(zip(single, zs, strict=True)):
        alone = problem.state(z)
        np.testing.assert_allclose(together.residual()[i], alone.residual(), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(together.jacobian()[i], alone.jacobian(), rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(together.macroscopic()[i], alone.macroscopic(), rtol=1e-12)
        np.testing.assert_allclose(
            together.macroscopic_gradient()[i], alone.macroscopic_gradient(), rtol=1e-11, atol=1e-12
        )


@pytest.mark.parametrize("chute", CHUTES)
def test_the_residual_is_small_between_the_nodes(chute):
    for flow in flows(chute, Q=3.0):
        problem, z = flow.solution.problem, flow.solution.z
        finer = 2 * problem.degree + 1
        matrix = refinement(problem.degree, finer)
        between = Collocation(problem.model, finer, problem.stretch)
        residual = between.state(np.concatenate([matrix @ z[:-2], z[-2:]])).residual()
        assert np.abs(residual).max() < 1e-9


@given(st.floats(0.0, 40.0), st.integers(4, 40))
def test_the_stretch_is_monotonic_from_0_to_1_and_invertible(stretch, degree):
    s = grid(degree).nodes
    m, slope = stretch_map(s, stretch)
    assert m[0] == 0.0
    assert m[-1] == pytest.approx(1.0)
    assert (np.diff(m) > 0.0).all()
    assert (slope > 0.0).all()
    np.testing.assert_allclose(stretch_position(m, stretch), s, atol=1e-12)


def test_transfer_to_another_grid_keeps_the_flow():
    flow = flows(CHUTES[0], Q=3.0)[1]
    problem, z = flow.solution.problem, flow.solution.z
    other, matrix = problem.transfer(54, 3.0)
    moved = other.state(np.concatenate([matrix @ z[:-2], z[-2:]]))
    np.testing.assert_allclose(moved.macroscopic(), flow.solution.macroscopic, atol=1e-9)
