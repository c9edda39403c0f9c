"""Bases: the formulas of their sources, limits, and what is refused."""

import math

import numpy as np
import pytest

from chuteflow import Chute, InputError, flows, hot, stability_of
from chuteflow.steady.model import SHEAR, WALL_SHEAR, model
from chuteflow.theory.bases import BASES, base
from chuteflow.theory.laws import LAWS

SLOPE, E, E_W, R = 0.3, 0.8, 0.75, 0.6


def coefficients(nu):
    law = LAWS["lun"]
    g = law.coefficients(nu, 1.0 - nu / law.densest, E, SLOPE)
    return g.radial, nu * g.compressibility, g.viscosity


def of_model(name, nu):
    """F1 and F2/g1 of the model at nu, from the tabulated functions."""
    m = model(Chute(SLOPE, E, E_W, R, base=name))
    g0, g1, g2 = coefficients(nu)
    bumps = 1.0 + math.pi / (12.0 * math.sqrt(2.0)) * (1.0 + 5.0 / (8.0 * nu * g0))
    f = np.zeros((8, len(nu)))
    if name.startswith("richman"):
        f[SHEAR], f[WALL_SHEAR] = g1 / g2, bumps * g1 / g2
    else:
        f[SHEAR], f[WALL_SHEAR] = g1 / nu / g0, g0 * nu / g1
    return m.slip(f), m.base_flux(f)


@pytest.mark.parametrize("diameter", [0.5, 1.0, 2.0])
def test_richman_with_hemispheres_of_another_size(diameter):
    nu = np.linspace(0.01, 0.6, 30)
    r = 0.68
    g0, g1, g2 = coefficients(nu)
    mean = 0.5 * (1.0 + diameter)
    bumps = 1.0 + math.pi / (12.0 * math.sqrt(2.0) * mean) * (1.0 + 5.0 / (8.0 * nu * g0))
    lid = math.sqrt(1.0 - r * r)
    kappa = 2.0 / 3.0 * (2.0 / (1.0 + lid) - lid)
    # M_x = P_xz with (2.10) and (2.13): kappa u_s + dbar (kappa - A r^2/2) du/dz
    expected = SLOPE / kappa * (math.sqrt(math.pi / 2.0) + mean * (kappa - 0.5 * bumps * r * r) * g1 / g2)
    on = base(f"richman:diameter={diameter}")
    shear, wall_shear = g1 / g2, (1.0 + math.pi / (12.0 * math.sqrt(2.0)) * (1.0 + 5.0 / (8.0 * nu * g0))) * g1 / g2
    np.testing.assert_allclose(on.slip(shear, wall_shear, r, SLOPE), expected, rtol=1e-12)


def test_johnson_and_jackson_as_printed():
    nu = np.linspace(0.01, 0.6, 30)
    g0, g1, _ = coefficients(nu)
    phi, packing = 0.4, 0.62
    f1, flux = of_model(f"johnson-jackson:specularity={phi}", nu)
    expected = SLOPE * g1 * 6.0 * packing / (math.pi * math.sqrt(3.0) * phi * nu * g0)
    np.testing.assert_allclose(f1, expected, rtol=1e-12)
    f2 = g1 * SLOPE * expected - math.pi * math.sqrt(3.0) / (4.0 * packing) * (1.0 - E_W**2) * nu * g0
    np.testing.assert_allclose(g1 * flux, f2, rtol=1e-12)


def test_hemispheres_as_large_as_grains_give_the_base_of_the_paper():
    plain = flows(Chute(SLOPE, E, 0.8, R), Q=3.0)
    same = flows(Chute(SLOPE, E, 0.8, R, base="richman:diameter=1"), Q=3.0)
    nearly = flows(Chute(SLOPE, E, 0.8, R, base="richman:diameter=1.0000000000001"), Q=3.0)
    assert [flow.mass_holdup for flow in plain] == [flow.mass_holdup for flow in same]
    for one, other in zip(plain, nearly, strict=True):
        assert other.mass_holdup == pytest.approx(one.mass_holdup, rel=1e-12)


def test_flows_meet_the_condition_of_their_base():
    """The base condition of Johnson & Jackson, from the profile alone."""
    phi, packing, e_w = 0.2, 0.62, 0.8
    found = flows(Chute(0.4, E, e_w, R, base=f"johnson-jackson:specularity={phi}"), M=1.0)
    assert len(found)
    for flow in found:
        at = flow.profile([0.0])
        nu, T, u, q = (
            float(values[0]) for values in (at.volume_fraction, at.granular_temperature, at.velocity, at.heat_flux)
        )
        g0 = float(coefficients(np.array([nu]))[0][0])
        pull = math.pi * math.sqrt(3.0) * phi / (6.0 * packing) * nu * g0 * math.sqrt(T) * u
        assert pull == pytest.approx(-float(at.shear_stress[0]), rel=1e-9)
        loss = math.pi * math.sqrt(3.0) / (4.0 * packing) * (1.0 - e_w**2) * nu * g0 * T**1.5
        assert q == pytest.approx(pull * u - loss, rel=1e-8)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"base": "bagnold"}, "unknown base 'bagnold': choose one of richman, johnson-jackson"),
        ({"base": "richman:size=2"}, "base 'richman' has no parameter 'size': choose from diameter"),
        ({"base": "richman:diameter=x"}, "diameter = 'x': must be a number"),
        ({"base": "johnson-jackson:specularity=2"}, "specularity = 2: must be from 1e-06 to 1"),
        ({"base": "richman:diameter=3", "roughness": 0.6}, "roughness r = 0.6: must be from 0.75"),
        ({"base": 3}, "unknown base 3"),
    ],
)
def test_what_is_wrong_with_a_base_is_named(change, message):
    with pytest.raises(InputError) as caught:
        Chute(**({"slope": SLOPE, "restitution": E, "wall_restitution": E_W, "roughness": R} | change))
    assert message in str(caught.value)


def test_what_knows_the_base_of_the_paper_alone_says_so():
    chute = Chute(SLOPE, E, 0.8, R, base="richman:diameter=1.1")
    with pytest.raises(InputError, match="known for the base richman alone"):
        hot(chute)
    with pytest.raises(InputError, match="known for the base richman alone"):
        stability_of(flows(chute, Q=3.0)[0], kx=0.1, ky=0.0)


def test_every_base_is_known_by_its_text():
    for name, one in BASES.items():
        assert base(name) == one
        assert base(str(one)) == one
    assert str(base("richman:diameter=1.5")) == "richman:diameter=1.5"
