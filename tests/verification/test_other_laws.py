"""Flows under every law against integration from the surface down with the breaks of the law located."""

import math

import numpy as np
import pytest

from chuteflow import Chute, InputError, flows, hot, stability_of
from chuteflow.theory.constitutive import reduce
from chuteflow.theory.laws import law

from . import downwards

#: Slope, e, e_w and r of the paper's chute.
PAPER = (0.3, 0.8, 0.8, 0.6)
#: T_surface and M at Q = 3 (and 2) on it, found by an independent shooting program.
FOUND = {
    ("garzo-dufty-fourier", 3.0): [(10.655, 0.402), (1.557, 0.706), (0.331, 1.153)],
    ("extended", 3.0): [(10.92, 0.399), (1.527, 0.715), (0.294, 1.239), (0.053, 2.168)],
    ("extended", 2.0): [(0.126, 1.334), (0.058, 1.711)],
    ("jenkins-berzi", 3.0): [(10.92, 0.399), (1.527, 0.715), (0.294, 1.239), (0.003, 4.526)],
    ("jenkins-berzi", 2.0): [(0.117, 1.382), (0.004, 3.625)],
    ("garzo-dufty", 3.0): [(None, 0.366), (None, 0.743), (None, 1.137)],
}
LAWS_TRIED = [
    "garzo-dufty-fourier",
    "extended",
    "jenkins-berzi",
    "lun:radial=torquato",
    "lun:radial=vescovi,friction=0.1",
    "garzo-dufty-fourier:radial=chialvo-sundaresan",
    "garzo-dufty",
]
BASES = ["richman", "richman:diameter=1.1", "johnson-jackson:specularity=0.1", "johnson-jackson:specularity=0.6"]


@pytest.mark.parametrize(("name", "flux"), FOUND)
def test_flows_are_those_of_an_independent_program(name, flux):
    found = flows(Chute(*PAPER, closure=name), Q=flux)
    got = [(flow.surface_temperature, flow.mass_holdup) for flow in found]
    assert len(got) == len(FOUND[name, flux])
    for (temperature, mass), (known_temperature, known_mass) in zip(got, FOUND[name, flux], strict=True):
        if known_temperature is not None:
            assert temperature == pytest.approx(known_temperature, rel=1e-2, abs=6e-4)
        assert mass == pytest.approx(known_mass, rel=1e-2)


def assert_carried(flow, chosen, e_w, r, rtol, **on):
    """The flow is that of an integration down from its surface, and its base condition is met there."""
    chute = flow.chute
    e, slope = chute.restitution, chute.slope
    b = -float(reduce(chosen, np.zeros(1), e, slope).drift[0])
    state = downwards.down(chosen, e, slope, flow.surface_temperature, flow.mass_holdup, b / (1.0 - b))
    nu, T, q = math.exp(state[0]), math.exp(state[1]), state[2]
    f1, f2 = downwards.base_flux(chosen, e, slope, e_w, r, nu, **on)
    y = q / (flow.mass_holdup * math.sqrt(T))
    assert nu == pytest.approx(flow.base_volume_fraction, rel=rtol)
    assert flow.base_temperature == pytest.approx(T, rel=rtol)
    assert y == pytest.approx(f2, rel=rtol, abs=rtol)
    assert flow.centre_of_mass == pytest.approx(state[3] / flow.mass_holdup, rel=rtol)
    assert flow.mass_flux == pytest.approx(state[4] + f1 * math.sqrt(T) * flow.mass_holdup, rel=rtol)


@pytest.mark.parametrize("name", LAWS_TRIED)
def test_flows_agree_with_integration_down_to_nine_digits(name):
    found = flows(Chute(*PAPER, closure=name), Q=3.0)
    assert found
    for flow in found:
        assert_carried(flow, law(name), PAPER[2], PAPER[3], 1e-9)


def test_temperature_of_garzo_and_dufty_far_above_is_a_power_of_the_stress():
    """T ~ p^(-0.297) at e = 0.8, and T p^0.297 is what is called the surface temperature."""
    for flow in flows(Chute(*PAPER, closure="garzo-dufty"), Q=3.0):
        far = flow.at_overburden(np.array([1e-12, 1e-9]))
        exponent = np.diff(np.log(far.granular_temperature)) / np.diff(np.log(far.normal_stress))
        assert exponent[0] == pytest.approx(-0.297, abs=5e-4)
        assert exponent[0] == pytest.approx(-0.29690507947761713, rel=1e-8)
        label = far.granular_temperature * far.normal_stress**0.29690507947761713
        np.testing.assert_allclose(label, flow.surface_temperature, rtol=1e-8)


@pytest.mark.parametrize("surface", ["free", "interface"])
@pytest.mark.parametrize("name", ["garzo-dufty", "extended"])
def test_heights_hold_the_mass_of_the_profile(name, surface):
    for flow in flows(Chute(*PAPER, closure=name, surface=surface), Q=3.0):
        top = min(5.0 * flow.centre_of_mass, flow.interface_height)
        nodes, weights = np.polynomial.legendre.leggauss(400)
        profile = flow.profile(0.5 * top * (nodes + 1.0))
        mass = 0.5 * top * float(weights @ profile.volume_fraction)
        below, above = flow.profile([0.0, top]).normal_stress
        assert mass == pytest.approx(below - above, rel=1e-5)


def test_where_the_centre_of_mass_is_infinite_or_nothing_is_known_far_above_says_so():
    for chute, run in (
        (Chute(0.3, 0.55, 0.8, 0.6, closure="garzo-dufty"), lambda chute: flows(chute, Q=3.0)),
        (Chute(*PAPER, closure="garzo-dufty"), lambda chute: stability_of(flows(chute, Q=3.0)[0], kx=0.1, ky=0.0)),
        (Chute(*PAPER, closure="garzo-dufty"), hot),
    ):
        with pytest.raises(InputError, match=r"closure '?garzo-dufty"):
            run(chute)


@pytest.mark.slow
def test_random_chutes_under_random_laws_on_random_bases():
    rng = np.random.default_rng(15)
    checked = 0
    for _ in range(200):
        name = LAWS_TRIED[rng.integers(len(LAWS_TRIED))]
        e, e_w, r = rng.uniform(0.7, 0.98), rng.uniform(0.5, 1.0), rng.uniform(0.53, 0.86)
        slope = rng.uniform(0.15, 0.5)
        base = BASES[rng.integers(len(BASES))]
        on = {key: float(value) for key, value in (part.split("=") for part in base.split(":")[1:])}
        chute = Chute(slope, e, e_w, r, closure=name, base=base)
        for flow in flows(chute, M=float(rng.uniform(0.3, 3.0))):
            if flow.surface_temperature > 1e-2:
                assert_carried(flow, law(name), e_w, r, 1e-8, **on)
                checked += 1
    assert checked > 30
