"""Boundaries past the breaks of a law, and under a law without a temperature far above, against curves of flows."""

from typing import Any

import numpy as np
import pytest

from chuteflow import Chute, boundary, curve
from chuteflow.bifurcations.grids import pin
from chuteflow.numerics.complex_step import derivative, stepped
from chuteflow.steady.solver import SolverStatus

GRAINS: dict[str, Any] = {"restitution": 0.8, "wall_restitution": 0.8, "roughness": 0.6}


def fluxes_at(found, slope):
    return sorted(flow.mass_flux for line in found for flow in line.at(slope))


def folds_of_curve(slope, **chute):
    found = curve(Chute(slope, **GRAINS, **chute), points=40)
    return sorted(p.flow.mass_flux for branch in found.branches for p in branch.special if p.kind == "fold-Q")


@pytest.mark.parametrize(
    ("chute", "bounds", "slopes"),
    [
        # Along the fold of the coldest flows the base comes to a break of the law at 0.3013.
        pytest.param({"closure": "extended"}, (0.3, 0.304), (0.301, 0.3025), marks=pytest.mark.slow),
        pytest.param({"closure": "jenkins-berzi"}, (0.3, 0.31), (0.302, 0.308), marks=pytest.mark.slow),
        pytest.param({"closure": "garzo-dufty"}, (0.29, 0.31), (0.295, 0.305), marks=pytest.mark.slow),
        pytest.param({"closure": "garzo-dufty:radial=torquato"}, (0.31, 0.33), (0.315,), marks=pytest.mark.slow),
        pytest.param({"base": "johnson-jackson:specularity=0.1"}, (0.385, 0.4), (0.39,), marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_folds_are_followed_from_end_to_end_and_are_those_of_curves(chute, bounds, slopes):
    found = boundary(Chute(0.3, **GRAINS, **chute), second="slope", bounds=bounds, samples=2)
    ends = [end for line in found for end in line.ends]
    assert all("is the end of its range" in end or "it goes on to" in end for end in ends)
    for slope in slopes:
        np.testing.assert_allclose(fluxes_at(found, slope), folds_of_curve(slope, **chute), rtol=1e-8)


def test_pinned_breaks_have_exact_derivatives():
    """A flow that passes two breaks of its law: Jacobian and gradients against complex steps."""
    found = curve(Chute(0.3, **GRAINS, closure="extended"), points=12).branches[0].flows[-3]
    assert found.solution.status is SolverStatus.CONVERGED
    problem, z = pin(found.solution.problem, found.solution.z)
    assert len(problem.pins) >= 2
    assert np.abs(problem.state(z).residual()).max() < 1e-9
    nodes = len(problem.grid.nodes)
    z[nodes:-2] += 1e-3 * np.diff(problem.breaks).min()
    state, beyond = problem.state(z), problem.state(stepped(z, np.eye(len(z))[nodes]))
    column = state.jacobian()[:, nodes]
    np.testing.assert_allclose(derivative(beyond.residual()), column, rtol=1e-10, atol=1e-12 * np.abs(column).max())
    np.testing.assert_allclose(
        derivative(beyond.macroscopic()), state.macroscopic_gradient()[:, nodes], rtol=1e-10, atol=1e-13
    )
