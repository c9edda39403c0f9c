"""The grid of trajectories: regions that no trajectory leaves, and what does not depend on its refinement."""

import os
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chuteflow import Chute, flows
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.solution_branches import explain_incompleteness
from chuteflow.steady.model import CONDUCTION, COUPLING, LOSS, WORK, model
from chuteflow.trajectories import kernel
from chuteflow.trajectories.refining import REFINEMENT, integrate_trajectories
from chuteflow.trajectories.tables import BASE, tables

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
#: Deep flows wind around a state of balance on these.
WINDING = (
    Chute(0.6, 0.36, 0.0, 0.866),
    Chute(0.44588, 0.7122, 0.1765, 0.6753),
    Chute(0.49126, 0.632, 0.5484, 0.8133, "interface"),
)
#: Chutes with such a state that are drawn; CHUTEFLOW_WINDING_CHUTES sets the number.
DRAWN = int(os.environ.get("CHUTEFLOW_WINDING_CHUTES", "40"))


def equations(problem):
    """The right sides, written here once more: d(ln x, y)/dp."""

    def derivative(p, state):
        big_l, y = state
        f, _ = problem.closures(np.exp(np.array([big_l])))
        a, k = f[CONDUCTION, 0], f[COUPLING, 0]
        net = f[LOSS, 0] - problem.slope**2 * f[WORK, 0]
        v = p * y / a
        return [(1.0 - v) / p, net - y * (1.0 + 0.5 * (v + k * (1.0 - v))) / p]

    return derivative


class RunsOff:
    """Ends an integration where y is larger than ``most``."""

    terminal = True

    def __init__(self, most):
        self.most = most

    def __call__(self, _p, state):
        return abs(state[1]) - self.most


def base_flux(problem, big_l):
    f, _ = problem.closures(np.exp(np.atleast_1d(big_l)))
    return problem.base_flux(f)


@pytest.mark.parametrize(
    "chute", [PAPER, WINDING[0], *(pytest.param(one, marks=pytest.mark.slow) for one in WINDING[1:])], ids=str
)
def test_no_trajectory_leaves_a_region(chute):
    problem = model(chute)
    bounds, scale = tables(problem).bounds, problem.flux_scale
    random = np.random.default_rng(3)
    seen = set()
    for _ in range(400):
        p, big_l, y = 10.0 ** random.uniform(-2.0, 1.3), random.uniform(-9.0, 6.0), scale * random.uniform(-3.0, 3.0)
        region = kernel.find_region(bounds, p, big_l, y)
        if region == kernel.FREE or (region in seen and len(seen) == 3 and random.random() < 0.9):
            continue
        seen.add(region)
        runs_off = RunsOff(50.0 * scale)
        path = solve_ivp(equations(problem), (p, p + 30.0), [big_l, y], events=runs_off, rtol=1e-8, atol=1e-10)
        residual = path.y[1] - base_flux(problem, path.y[0])
        assert (residual > 0.0).all() if region == kernel.HOT else (residual < 0.0).all()
    assert kernel.COLD in seen


@pytest.mark.parametrize("chute", WINDING, ids=str)
def test_trajectories_are_those_of_another_integrator(chute):
    problem = model(chute)
    grid = integrate_trajectories(problem, 0.1, 100.0, 3.0)
    derivative = equations(problem)
    first, last = len(grid.overburden) - 30, len(grid.overburden) - 10
    p = grid.overburden[[first, last]] + problem.surface_stress
    rows = [grid.states[grid.first[row] : grid.first[row + 1]] for row in (first, last)]
    compared = 0
    for begin in rows[0][::6]:
        # Trajectories keep their surface temperature; others are inserted between them.
        (same,) = np.nonzero(np.abs(rows[1][:, kernel.S_T] - begin[kernel.S_T]) < 1e-12)
        if len(same) != 1 or abs(begin[kernel.S_Y]) > problem.flux_scale:
            continue
        path = solve_ivp(derivative, (p[0], p[1]), begin[:2], rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(rows[1][same[0], :2], path.y[:, -1], rtol=1e-3, atol=5e-3)
        compared += 1
    assert compared > 2


@pytest.mark.parametrize("chute", [PAPER, WINDING[0], Chute(0.2, 0.95, 0.7, 0.7)], ids=str)
def test_the_expansion_in_the_layer_is_what_another_integrator_gives(chute):
    problem = model(chute)
    t = tables(problem)
    deepest = 0.2 / t.rate
    base = np.ascontiguousarray(t.values[:, BASE])
    layer, _ = kernel.expand_in_layer(t.values, base, base, np.log(1e-4), deepest)
    for temperature in (1e-3, 0.05, 1.0, 1e3):
        p = 1e-5 * min(temperature, 1.0)
        above, below = kernel.states_in_layer(t.values, layer, np.array([p, deepest]), np.log(temperature))
        path = solve_ivp(equations(problem), (p, deepest), above, method="LSODA", rtol=1e-9, atol=1e-13)
        np.testing.assert_allclose(below, path.y[:, -1], rtol=2e-4, atol=1e-5)


def test_no_trajectory_is_near_the_flux_of_the_base_above_where_the_curve_starts():
    random = np.random.default_rng(7)
    starts = []
    for _ in range(12):
        chute = Chute(*random.uniform((0.15, 0.6, 0.5, 0.5), (0.45, 1.0, 1.0, 0.86)))
        problem = model(chute)
        t = tables(problem)
        deepest, coldest = 0.2 / t.rate, 1e-3
        base = np.ascontiguousarray(t.values[:, BASE])
        layer, first = kernel.expand_in_layer(t.values, base, base, np.log(coldest), deepest)
        starts.append(first / deepest)
        over = first * np.geomspace(1e-6, 0.999, 40)
        for temperature in np.geomspace(coldest, 1e5, 60):
            big_l, y = kernel.states_in_layer(t.values, layer, over, np.log(temperature)).T
            assert (np.abs(y) < 0.6 * np.abs(base_flux(problem, big_l))).all(), (chute, temperature)
    assert min(starts) < 0.1
    assert max(starts) == 1.0


@pytest.mark.parametrize("chute", WINDING, ids=str)
def test_a_finer_grid_shows_the_same_flows(chute):
    problem = model(chute)
    finer = replace(REFINEMENT, delta=0.1, finest=0.006, lengths=0.2, per_decade=20.0)
    counts = [
        [
            crossings_of(integrate_trajectories(problem, 1e-3, 1e5, 25.0, refinement), mass)
            for mass in (2.0, 7.5, 12.0, 19.0, 24.0)
        ]
        for refinement in (REFINEMENT, finer)
    ]
    assert counts[0] == counts[1]
    assert max(counts[0]) > 3


def crossings_of(grid, mass):
    """How many of the rough branches pass a hold-up."""
    off = [branch.macroscopic[:, 2] - np.log(mass) for branch in grid.branches]
    return sum(int(((o[1:] >= 0.0) != (o[:-1] >= 0.0)).sum()) for o in off)


@pytest.mark.parametrize("chute", [PAPER, *WINDING], ids=str)
def test_branches_end_at_the_edges_of_the_range_alone(chute):
    grid = integrate_trajectories(model(chute), 1e-3, 1e5, 25.0)
    assert grid.complete
    assert not len(grid.undecided)
    for branch in grid.branches:
        if branch.closed or len(branch) < 2:
            continue
        for end in branch.macroscopic[[0, -1]]:
            at_depth = abs(end[2] - np.log(25.0)) < 1e-9
            at_temperature = min(abs(end[3] - np.log(1e-3)), abs(end[3] - np.log(1e5))) < 1e-9
            assert at_depth or at_temperature or end[2] < np.log(1e-8)


def test_a_grid_that_grows_too_large_says_where_it_ends():
    grid = integrate_trajectories(model(WINDING[0]), 1e-3, 1e5, 25.0, replace(REFINEMENT, most=20_000))
    assert not grid.complete
    assert 1.0 < grid.deepest < 25.0
    assert len(grid.states) <= 20_000


@pytest.mark.slow
def test_on_random_chutes_the_flows_are_those_of_a_finer_grid():
    random = np.random.default_rng(11)
    finer = replace(REFINEMENT, delta=0.1, finest=0.006, lengths=0.2, per_decade=20.0)
    found = doubtful = 0
    for _ in range(DRAWN):
        chute, mass = winding(random), float(random.uniform(6.0, 29.5))
        answer = flows(chute, M=mass)
        in_doubt = answer.incomplete is not None and "does not tell flows apart" in answer.incomplete
        doubtful += in_doubt
        assert in_doubt or answer.incomplete is None or "outside the range" in answer.incomplete
        assert len(answer) == crossings_of(integrate_trajectories(model(chute), 1e-3, 1e5, 30.0, finer), mass), (
            chute,
            mass,
        )
        found += len(answer)
    assert found > DRAWN // 2
    assert doubtful <= DRAWN // 10


def winding(random):
    """A random chute on which loss and shear work balance at two densities."""
    while True:
        surface, closure = random.choice(["free", "interface"]), random.choice(["lun", "lun-fourier"])
        slope, e, e_w, r = random.uniform((0.1, 0.3, 0.0, 0.5), (0.65, 1.0, 1.0, 0.866))
        chute = Chute(slope, e, e_w, r, surface=str(surface), closure=str(closure))
        f, _ = model(chute).closures(np.append(0.0, np.geomspace(1e-3, 1e6, 200)))
        net = f[LOSS] - slope**2 * f[WORK]
        if net[0] > 0.0 > net.min() and net[-1] > 0.0:
            return chute


def test_a_cell_too_short_to_be_divided_in_which_the_residual_turns_to_zero_is_undecided():
    """A coarse limit makes cells undecided that are divided otherwise; the flows there are named as doubtful."""
    problem = model(WINDING[0])
    coarse = integrate_trajectories(problem, 1e-3, 1e5, 25.0, replace(REFINEMENT, delta=0.8, finest=0.7))
    fine = integrate_trajectories(problem, 1e-3, 1e5, 25.0)
    assert len(coarse.undecided) > len(fine.undecided) == 0
    assert coarse.hidden.shape == (len(coarse.undecided), 4)
    assert (coarse.hidden[:, 2] <= np.log(25.0) + 1e-9).all()
    assert fine.cells > coarse.cells > 1000
    left = explain_incompleteness(coarse, SearchRange(1e-3, 1e5, 25.0, 0.0), [], ("a flow", "flows"))
    assert left is not None
    assert "does not tell flows apart near M = " in left
