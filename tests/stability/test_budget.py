"""Energy budgets of modes: they close, the pressure only passes energy on, and what feeds which mode."""

import numpy as np
import pytest

import chuteflow
from chuteflow import Chute
from chuteflow.stability.budget import TERMS, energy_budget
from chuteflow.stability.modes import Disturbances, leading

STEEP = Chute(0.568, 0.627, 0.478, 0.847)


@pytest.fixture(scope="module")
def steep():
    return Disturbances(chuteflow.flows(STEEP, T_surface=9.5)[0])


def budget_at(disturbances, kx, ky):
    (mode,) = leading(disturbances, kx, ky)
    return energy_budget(mode)


@pytest.mark.parametrize(
    ("name", "kx", "ky"),
    [("A", 0.0, 0.01), ("A", 0.004, 0.0), ("A", 0.1, 0.1), ("B", 0.0, 0.0126), ("C", 0.0111, 0.0), ("C", 0.3, 0.3)],
)
def test_a_budget_adds_up_to_the_growth_of_the_eigenvalue(disturbances, name, kx, ky):
    budget = budget_at(disturbances[name], kx, ky)
    rates = [term.total for term in budget.terms]
    assert budget.closure == pytest.approx(budget.mode.growth - sum(rates), abs=1e-18)
    assert abs(budget.closure) < 1e-5 * max(map(abs, rates))
    assert [term.name for term in budget.terms] == list(TERMS)
    assert sum(budget.shares) == pytest.approx(1.0)
    # In this norm the pressure only passes energy from one part to another.
    (pressure,) = (term for term in budget.terms if term.name == "pressure work")
    assert abs(pressure.total) < 1e-5 * max(map(abs, rates))
    assert abs(pressure.total) < 1e-3 * max(map(abs, (pressure.kinetic, pressure.density, pressure.thermal)))


def test_the_closure_shrinks_with_the_grid(disturbances):
    closures = [abs(energy_budget(disturbances["C"].accepted(0.0111, 0.0, level)[0][0]).closure) for level in (0, 1, 2)]
    assert closures[0] > 10.0 * closures[1] > 100.0 * closures[2]


def test_terms_that_can_only_take_energy_do_so(disturbances):
    for name, kx, ky in (("A", 0.1, 0.1), ("B", 0.05, 0.05), ("C", 0.3, 0.3)):
        assert budget_at(disturbances[name], kx, ky).rate("collisional loss by temperature") < 0.0


def test_without_its_loss_a_mode_that_clusters_would_decay(disturbances, steep):
    """Along, across and oblique: what is lost where it is dense feeds the wave, and no other term as much."""
    for of, kx, ky in ((disturbances["A"], 0.0, 0.01), (disturbances["C"], 0.0111, 0.0), (steep, 0.005, 0.0428)):
        budget = budget_at(of, kx, ky)
        net = budget.rate("collisional loss by density", "collisional loss by temperature")
        assert budget.largest_source.name == "collisional loss by density"
        assert budget.mode.growth - net < 0.0 < budget.mode.growth
        assert net > max(term.total for term in budget.terms if not term.name.startswith("collisional"))


def test_short_waves_across_are_fed_by_the_shear():
    (flow,) = (f for f in chuteflow.flows(Chute(0.283, 0.892, 0.715, 0.555), Q=238.0) if f.density == "inverted")
    budget = budget_at(Disturbances(flow), 0.0, 2.4 / flow.centre_of_mass)
    assert budget.largest_source.name == "shear production"
    assert np.isclose(budget.rate(*TERMS), budget.mode.growth, rtol=1e-6)
