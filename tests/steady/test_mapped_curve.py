"""The curve of flows by the paper's own method: its folds and flows are those of the overburden method."""

from dataclasses import replace

import numpy as np
import pytest

from chuteflow import Chute, InputError, curve, flows
from chuteflow.numerics.continuation import trace
from chuteflow.steady.collocation import LOG_Q, LOG_T
from chuteflow.steady.mapped.curve import mapped_curve
from chuteflow.steady.mapped.solution import solve_mapped
from chuteflow.steady.solver import Condition

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
VARIANTS = {
    f"{surface}-{closure}": replace(PAPER, surface=surface, closure=closure)
    for surface in ("free", "interface")
    for closure in ("lun", "lun-fourier")
}
FLUX = Condition.fix(LOG_Q, 3.0)

every_variant = pytest.mark.parametrize("chute", VARIANTS.values(), ids=VARIANTS.keys())


@every_variant
def test_the_folds_of_the_flux_are_those_of_the_overburden_method(chute):
    traced = mapped_curve(flows(chute, Q=3.0)[0], surface_temperature=(0.4, 20.0))
    assert len(traced.folds) == 2
    (branch,) = curve(chute, points=40).branches
    expected = [point.flow for point in branch.special if point.kind == "fold-Q"]
    for ours, theirs in zip(traced.folds, expected, strict=True):
        assert ours.mass_flux == pytest.approx(theirs.mass_flux, rel=1e-9)
        assert ours.surface_temperature == pytest.approx(theirs.surface_temperature, rel=1e-7)
    assert all(flow.converged for flow in traced.flows)
    assert "above 20" in traced.ends[0]
    assert "below 0.4" in traced.ends[1]


def test_flows_of_a_traced_curve_are_flows_of_the_other_method():
    traced = mapped_curve(flows(PAPER, Q=3.0)[1], surface_temperature=(0.5, 20.0))
    assert (np.diff([flow.surface_temperature for flow in traced.flows]) < 0.0).all()
    for flow in traced.flows[::4]:
        near = flows(PAPER, T_surface=flow.surface_temperature)
        (other,) = near
        np.testing.assert_allclose(flow.macroscopic[:LOG_T], other.solution.macroscopic[:LOG_T], atol=1e-8)


def test_the_path_does_not_depend_on_the_resolution():
    flow = flows(PAPER, Q=3.0)[0]
    lengths = []
    for degree in (40, 60):
        solution = solve_mapped(PAPER, flow, FLUX, degree, multiple=1)
        fixed = _Fixed(solution.system)
        ahead = np.zeros(len(solution.z))
        ahead[-2] = -1.0
        path = trace(fixed, solution.z, direction=ahead)
        points = [point for point, _ in zip(path, range(6), strict=False)]
        lengths.append([point.arclength for point in points])
    np.testing.assert_allclose(lengths[0], lengths[1], rtol=1e-6)


def test_a_range_without_the_start_is_refused():
    with pytest.raises(InputError, match="hold that of the start"):
        mapped_curve(flows(PAPER, Q=3.0)[0], surface_temperature=(0.1, 1.0))


class _Fixed:
    """A system that keeps its discretisation."""

    def __init__(self, system):
        self.weights = system.weights
        self.residual_and_jacobian = system.residual_and_jacobian
