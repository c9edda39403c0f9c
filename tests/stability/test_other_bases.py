"""Disturbed flows on other bases, and under a law that knows the shear rate: two discretisations agree."""

import numpy as np
import pytest

from chuteflow import Chute, flows, relax, stability_of
from chuteflow.stability.base import Resolution, base
from chuteflow.stability.layer import Layer
from chuteflow.stability.linear import steady_motion
from chuteflow.stability.modes import Disturbances, leading
from chuteflow.theory.bases import base as base_of
from chuteflow.theory.transport import base_conditions

CHUTES = [
    Chute(0.3, 0.8, 0.8, 0.6, base="richman:diameter=1.2"),
    Chute(0.4, 0.8, 0.8, 0.6, base="johnson-jackson:specularity=0.2"),
    # Its dissipation depends on the shear rate from the surface down.
    Chute(0.3, 0.93, 0.3, 0.6, closure="extended:radial=carnahan-starling"),
]


@pytest.fixture(scope="module", params=CHUTES, ids=lambda chute: f"{chute.closure} {chute.base}")
def flow(request):
    return flows(request.param, M=1.0)[0]


def test_a_steady_flow_meets_the_conditions_of_its_base(flow):
    chute = flow.chute
    moving = steady_motion(base(flow, Resolution(60, 12.0, 6.0)))
    ends = base_conditions(moving, base_of(chute.base), chute.roughness, chute.wall_restitution)
    for value in ends:
        assert abs(value[-1]) < 1e-7


def test_a_steady_flow_does_not_move(flow):
    layer = Layer.of(flow)
    state = layer.steady(flow)
    assert np.abs(layer.rate(state)).max() < 1e-6


def test_the_leading_mode_is_one_of_another_discretisation(flow):
    layer = Layer.of(flow, 60)
    rates = layer.growth_rates(layer.steady(flow))
    (mode,) = (mode for mode in leading(Disturbances(flow), 0.0, 0.0, count=2) if mode.kind != "mass")
    sigma = complex(mode.growth, mode.frequency)
    assert np.minimum(np.abs(rates - sigma), np.abs(rates - sigma.conjugate())).min() < 2e-3 * abs(sigma)


@pytest.mark.slow
def test_a_disturbed_flow_is_followed_and_a_wave_is_told(flow):
    assert np.isfinite([moment.mass_flux for moment in relax(flow, duration=2.0).moments]).all()
    found = stability_of(flow, kx=0.1, ky=0.0)
    assert found.mode is not None
    assert np.isfinite(found.mode.growth)
