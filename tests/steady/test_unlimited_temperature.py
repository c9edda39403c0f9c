"""Flows under laws whose temperature has no limit far above."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from chuteflow import Chute, flows

CHUTE = Chute(0.3, 0.8, 0.8, 0.6, closure="garzo-dufty")


@pytest.fixture(scope="module")
def flow():
    return flows(CHUTE, M=0.7)[0]


def test_the_velocity_far_above_is_finite(flow):
    # du = tan(theta) g1/(nu g2) sqrt(T) dP, whose integrand goes like P^(-beta/2) at the surface: smooth in P^(1/4).
    law, holdup = flow.law, flow.mass_holdup

    def integrand(root):
        at = flow.at_overburden(np.array([root**4]))
        nu, root_t = at.volume_fraction[0], np.sqrt(at.granular_temperature[0])
        return at.shear_rate[0] / nu * holdup * 4.0 * root**3 if nu * root_t > 0.0 else 0.0

    found, error = quad(integrand, 0.0, 1.0, epsabs=1e-9, epsrel=1e-9, limit=400)
    assert law.name == "garzo-dufty"
    assert error < 1e-7
    assert flow.surface_velocity == pytest.approx(flow.slip_velocity + found, abs=1e-7)
    assert flow.at_overburden(np.array([1e-12])).velocity[0] == pytest.approx(flow.surface_velocity, rel=1e-6)


def test_its_derivatives_are_those_of_neighbouring_flows(flow):
    step = 1e-5
    one, other = (flows(replace(CHUTE, slope=0.3 + sign * step), M=0.7)[0].surface_velocity for sign in (-1, 1))
    rate = flow.sensitivity(("slope",), at="M").numbers["surface_velocity"][0]
    assert rate == pytest.approx((other - one) / (2.0 * step), rel=1e-5)
