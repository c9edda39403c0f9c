"""Curves over the whole box of parameters: branches of numbers or a reason, within seconds of processor time."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from chuteflow import Chute, curve

from .limits import processor_time

#: Seconds of processor time after which a curve counts as hanging.
DEADLINE = 20.0

CHUTES = st.builds(
    Chute,
    slope=st.one_of(st.sampled_from([1e-3, 1e3]), st.floats(-3.0, 3.0).map(lambda x: 10.0**x), st.floats(0.1, 0.8)),
    restitution=st.one_of(st.sampled_from([1.0, 1e-6]), st.floats(1e-3, 1.0), st.floats(0.6, 1.0)),
    wall_restitution=st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.0, 1.0)),
    roughness=st.one_of(st.sampled_from([0.5, math.sqrt(0.75)]), st.floats(0.5, math.sqrt(0.75))),
    surface=st.sampled_from(["free", "interface"]),
    closure=st.sampled_from(["lun", "lun-fourier"]),
)


def check(chute: Chute) -> None:
    with processor_time(DEADLINE):
        found = curve(chute, points=20)
    assert bool(found.reason) != bool(found.branches)
    for branch in found.branches:
        assert len(branch.flows) >= 2
        for values in (branch.mass_flux, branch.centre_of_mass, branch.mass_holdup, branch.surface_temperature):
            assert np.isfinite(values).all()
            assert values.min() > 0.0
        for point in branch.special:
            assert 0 <= point.position < len(branch.flows)
            assert math.isfinite(point.flow.mass_flux)


@settings(max_examples=10, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(CHUTES)
def test_branches_or_a_reason(chute):
    check(chute)


@pytest.mark.slow
@settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(CHUTES)
def test_branches_or_a_reason_everywhere(chute):
    check(chute)
