"""Profiles and numbers of a flow, by definitions that share nothing with how they are computed."""

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.optimize import brentq

from chuteflow import QUANTITIES, Chute, InputError, Scales, flows
from chuteflow.steady.names import name_of
from chuteflow.steady.validity import WORDS, Validity
from chuteflow.theory.boundary import base_loss, kappa
from chuteflow.theory.lun import DENSEST, LUN

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
INTERFACE = Chute(0.3, 0.8, 0.8, 0.6, surface="interface")
CASES = [(chute, i) for chute in (PAPER, INTERFACE) for i in range(3)]


def flow_of(case):
    chute, i = case
    return flows(chute, Q=3.0)[i]


@pytest.mark.parametrize("case", CASES)
def test_depth_integrals_by_definition(case):
    flow = flow_of(case)
    top = min(flow.interface_height, 45.0 * flow.surface_temperature + 10.0)
    z = np.linspace(0.0, top, 40001)
    p = flow.profile(z)
    assert simpson(p.volume_fraction, x=z) == pytest.approx(flow.mass_holdup, rel=1e-10)
    assert simpson(p.volume_fraction * p.velocity, x=z) == pytest.approx(flow.mass_flux, rel=1e-10)
    moment = simpson(p.volume_fraction * z, x=z)
    assert moment / flow.mass_holdup == pytest.approx(flow.centre_of_mass, rel=1e-10)
    # the base carries the energy that the interior loses net of its shear work, and the surface gives
    net = simpson(p.dissipation - p.production, x=z)
    assert p.heat_flux[0] - p.heat_flux[-1] == pytest.approx(net, rel=1e-9)
    assert p.normal_stress[0] - p.normal_stress[-1] == pytest.approx(flow.mass_holdup, rel=1e-10)


@pytest.mark.parametrize("case", CASES)
def test_profiles_satisfy_the_printed_equations(case):
    flow = flow_of(case)
    slope, e = flow.chute.slope, flow.chute.restitution
    z = np.linspace(0.0, min(flow.interface_height, 3.0 * flow.centre_of_mass), 4001)
    p = flow.profile(z)
    nu, t = p.volume_fraction, p.granular_temperature
    g = LUN.coefficients(nu, 1.0 - nu / DENSEST, e, slope)

    def d_dz(values):
        h = z[1] - z[0]
        return (values[:-4] - 8.0 * values[1:-3] + 8.0 * values[3:-1] - values[4:]) / (12.0 * h)

    inner = slice(2, -2)
    np.testing.assert_allclose(nu * g.compressibility * t, p.normal_stress, rtol=1e-11)  # (3.4)
    np.testing.assert_allclose(p.shear_stress, -slope * p.normal_stress, rtol=1e-13)
    np.testing.assert_allclose(p.shear_stress, -g.viscosity * np.sqrt(t) * p.shear_rate, rtol=1e-10)  # (3.5)
    np.testing.assert_allclose(nu**2 * g.dissipation * t**1.5, p.dissipation, rtol=1e-10)  # (3.7)
    np.testing.assert_allclose(-p.shear_stress * p.shear_rate, p.production, rtol=1e-10)
    np.testing.assert_allclose(p.conductive_heat_flux + p.density_heat_flux, p.heat_flux, atol=1e-13)
    np.testing.assert_allclose(d_dz(p.normal_stress), -nu[inner], atol=1e-7)  # (3.2)
    np.testing.assert_allclose(d_dz(p.velocity), p.shear_rate[inner], atol=1e-6)  # (3.10)
    np.testing.assert_allclose(d_dz(p.heat_flux), (p.production - p.dissipation)[inner], atol=1e-6)  # (3.3)
    conductive = -(g.conductivity * np.sqrt(t))[inner] * d_dz(t)
    np.testing.assert_allclose(conductive, p.conductive_heat_flux[inner], atol=1e-6)  # (3.6)
    along_density = (g.density_conductivity * t**1.5)[inner] * d_dz(nu)
    np.testing.assert_allclose(along_density, p.density_heat_flux[inner], atol=1e-6)


@pytest.mark.parametrize("case", CASES)
def test_the_base_condition_as_printed(case):
    flow = flow_of(case)
    chute = flow.chute
    p = flow.profile(0.0)
    nu, t = float(p.volume_fraction), float(p.granular_temperature)
    g = LUN.coefficients(np.array(nu), np.array(1.0 - nu / DENSEST), chute.restitution, chute.slope)
    g1, g2, k, r = nu * g.compressibility, g.viscosity, kappa(chute.roughness), chute.roughness
    contact = 1 + np.pi / (12 * np.sqrt(2)) * (1 + 5 / (8 * nu * g.radial))  # (2.12)
    f1 = chute.slope / k * (np.sqrt(np.pi / 2) + (k - 0.5 * contact * r**2) * g1 / g2)
    assert p.velocity == pytest.approx(f1 * np.sqrt(t), rel=1e-11)  # (3.15)
    work = k * f1**2 - g1 * chute.slope / g2 * (k - 0.5 * contact * r**2) * f1
    f2 = g1 * (np.sqrt(2 / np.pi) * work - base_loss(chute.wall_restitution, r))
    assert p.heat_flux == pytest.approx(f2 * t**1.5, rel=1e-9)  # (3.17)
    assert flow.slip_velocity == pytest.approx(float(p.velocity), rel=1e-13)
    assert flow.base_temperature == pytest.approx(t, rel=1e-13)
    assert flow.base_volume_fraction == pytest.approx(nu, rel=1e-13)


def test_the_far_field_is_that_of_the_paper():
    flow = flows(PAPER, Q=3.0)[1]
    t_inf, e = flow.surface_temperature, 0.8
    g40_g30 = 15 * e * (1 - e) / 2 * 4 * (1 + e) / 25
    z = t_inf * np.array([8.0, 10.0, 12.0, 300.0])
    p = flow.profile(z)
    rates = -np.diff(np.log(p.volume_fraction)) / np.diff(z)
    assert (np.abs(t_inf * rates - 1.0) < [1e-3, 2e-4, 1e-6]).all()  # (3.23)
    rise = (p.granular_temperature - t_inf) / (g40_g30 * t_inf * p.volume_fraction)  # (3.24)
    np.testing.assert_allclose(rise[:3], 1.0, rtol=1e-2)
    assert abs(rise[2] - 1.0) < 0.03 * abs(rise[0] - 1.0)
    assert (p.volume_fraction > 0.0).all()


def test_numbers_that_are_found_in_the_profile():
    for case in CASES:
        flow = flow_of(case)
        z = np.linspace(0.0, min(flow.interface_height, 10.0 * flow.centre_of_mass), 20001)
        nu = flow.profile(z).volume_fraction
        assert flow.largest_volume_fraction == pytest.approx(nu.max(), rel=1e-7)
        assert flow.largest_volume_fraction >= nu.max() * (1 - 1e-12)
        inverted = bool(np.diff(nu).max() > 0.0)
        assert flow.density == ("inverted" if inverted else "monotonic")
        if flow.interface_height == np.inf or nu[-1] < 0.01 * nu.max():
            wanted = brentq(
                lambda h, flow=flow: float(flow.profile(h).volume_fraction) - 0.01 * flow.largest_volume_fraction,
                z[nu.argmax()],
                z[-1],
                xtol=1e-12,
            )
            assert flow.depth == pytest.approx(wanted, rel=1e-9)
        else:
            assert flow.depth == flow.interface_height


@pytest.mark.parametrize(
    ("chute", "condition", "interior"),
    [
        (PAPER, {"Q": 3.0}, "dissipative"),
        (Chute(0.4, 0.9, 0.6, 0.8), {"Q": 3.0}, "productive"),
        (Chute(0.3, 0.9, 0.6, 0.8), {"T_surface": 1.0}, "mixed"),
        (Chute(0.3, 1.0, 0.0, 0.8), {"T_surface": 1.0}, "productive"),
    ],
)
def test_interior(chute, condition, interior):
    found = flows(chute, **condition)
    assert len(found) > 0
    for flow in found:
        assert flow.interior == interior
        p = flow.sampled(400)
        signs = set(np.sign(np.round(p.dissipation - p.production, 14))) - {0.0}
        assert signs == {"dissipative": {1.0}, "productive": {-1.0}, "mixed": {-1.0, 1.0}}[interior]


def test_heights_in_any_shape_and_order():
    flow = flows(PAPER, Q=3.0)[0]
    z = np.array([[3.0, 0.0], [1.0, 20.0]])
    p = flow.profile(z)
    assert p.velocity.shape == (2, 2)
    np.testing.assert_array_equal(p.height, z)
    np.testing.assert_allclose(p.velocity[0, 0], flow.profile(3.0).velocity, rtol=1e-13)


@pytest.mark.parametrize("z", [-0.1, np.nan, np.inf])
def test_a_height_outside_is_refused(z):
    flow = flows(PAPER, Q=3.0)[0]
    with pytest.raises(InputError, match="heights must be from 0"):
        flow.profile(z)


def test_above_the_interface_nothing_is_defined():
    flow = flows(INTERFACE, Q=3.0)[0]
    flow.profile(flow.interface_height)
    with pytest.raises(InputError, match="heights must be"):
        flow.profile(1.01 * flow.interface_height)


def test_scales_by_hand():
    scales = Scales(diameter=2e-3, density=2500.0, gravity=9.81)
    slope = 0.3
    g_cos = 9.81 * np.cos(np.arctan(slope))
    assert scales.factor("height", slope) == pytest.approx(2e-3)
    assert scales.factor("velocity", slope) == pytest.approx(np.sqrt(g_cos * 2e-3))
    assert scales.factor("granular_temperature", slope) == pytest.approx(g_cos * 2e-3)
    assert scales.factor("normal_stress", slope) == pytest.approx(2500.0 * g_cos * 2e-3)
    assert scales.factor("mass_flux", slope) == pytest.approx(2500.0 * np.sqrt(g_cos) * 2e-3**1.5)
    assert scales.factor("mass_holdup", slope) == pytest.approx(5.0)
    assert scales.factor("shear_rate", slope) == pytest.approx(np.sqrt(g_cos / 2e-3))
    assert scales.factor("heat_flux", slope) == pytest.approx(2500.0 * (g_cos * 2e-3) ** 1.5)
    assert scales.factor("dissipation", slope) == pytest.approx(2500.0 * g_cos**1.5 * np.sqrt(2e-3))


def test_bad_scales_and_unknown_quantities_are_refused():
    with pytest.raises(InputError, match="diameter = -1"):
        Scales(diameter=-1.0, density=2500.0)
    with pytest.raises(InputError, match="unknown quantity 'colour'"):
        Scales(1e-3, 2500.0).factor("colour", 0.3)


def test_every_quantity_of_the_registry_is_offered():
    flow = flows(PAPER, Q=3.0)[0]
    profile = flow.sampled(5)
    for name in QUANTITIES:
        assert hasattr(flow, name) or hasattr(profile, name), name


@pytest.mark.parametrize("surface", ["free", "interface"])
def test_the_energy_budget_closes(surface):
    for flow in flows(Chute(0.3, 0.8, 0.8, 0.6, surface), Q=3.0):
        b = flow.energy_budget
        assert b.heat_from_base + b.shear_work == pytest.approx(b.dissipation + b.heat_through_surface, rel=1e-9)


def test_gravity_pays_for_all_of_it_on_the_half_line():
    # The work of the weight along the slope, s Int nu u dz, goes into slip and shear alone.
    for flow in flows(Chute(0.3, 0.8, 0.8, 0.6), Q=3.0):
        b = flow.energy_budget
        assert b.slip_work + b.shear_work == pytest.approx(0.3 * flow.mass_flux, rel=1e-9)
        assert b.base_loss > 0.0


def test_nothing_is_denser_than_the_densest_where_grains_are_packed_to_the_last():
    flow = flows(Chute(0.3, 1.0, 0.0, 0.5), Q=1e-6)[-1]
    assert flow.base_volume_fraction > 0.6199
    assert flow.base_volume_fraction <= flow.largest_volume_fraction


# How far flows keep to the theory


@pytest.mark.parametrize("case", CASES)
def test_validity_by_definition(case):
    flow = flow_of(case)
    top = min(flow.interface_height, 45.0 * flow.surface_temperature + 10.0)
    p = flow.profile(np.linspace(0.0, top, 40001))
    nu = p.volume_fraction
    g0 = (1.0 - nu / DENSEST) ** (-2.5 * DENSEST)
    mean = simpson(nu * nu * g0, x=p.height) / simpson(nu, x=p.height)
    known = flow.validity
    assert known.knudsen_number == pytest.approx(1.0 / (6.0 * np.sqrt(2.0) * mean) / flow.centre_of_mass, rel=1e-9)
    assert known.slip_ratio == pytest.approx(p.velocity[0] / np.sqrt(p.granular_temperature[0]), rel=1e-10)
    assert known.largest_volume_fraction == flow.largest_volume_fraction
    assert known.packing == pytest.approx(nu.max() / DENSEST, rel=1e-7)
    assert known.density_turns == np.count_nonzero(np.diff(np.sign(np.diff(nu))))


def test_a_density_that_turns_often_is_told():
    # Deep flows: the density rises and falls in layers.
    found = flows(Chute(0.44588, 0.7122, 0.1765, 0.6753), M=22.0, surface_temperature=(3.02, 3.07))
    assert len(found) >= 1
    for flow in found:
        nu = flow.profile(np.linspace(0.0, flow.depth, 20001)).volume_fraction
        turns = np.count_nonzero(np.diff(np.sign(np.diff(nu))))
        assert flow.validity.density_turns == turns > 2
        assert "layered" in flow.validity.words


@pytest.mark.parametrize(
    ("nu_max", "packing", "slip", "knudsen", "turns", "words"),
    [
        (0.3, 0.48, 0.5, 0.01, 1, ()),
        (0.49, 0.79, 1.0, 0.1, 1, ()),
        (0.5, 0.81, 0.5, 0.01, 1, ("dense: beyond the theory",)),
        (0.6, 0.97, 0.5, 0.01, 1, ("packed: beyond the theory",)),
        (0.04, 0.06, 1.5, 0.5, 0, ("large slip", "rarefied")),
        (0.3, 0.48, 0.5, 0.01, 2, ("layered",)),
    ],
)
def test_words_of_validity(nu_max, packing, slip, knudsen, turns, words):
    known = Validity(nu_max, packing, slip, knudsen, turns)
    assert known.words == words
    assert known.summary == (", ".join(words) or "within the theory")
    assert set(words) <= set(WORDS)


@pytest.mark.parametrize(
    ("temperature", "nu_max", "h", "name"),
    [
        (7.3, 0.04, 8.8, "hot, dilute, deep"),
        (5.0, 0.1, 5.0, "hot, moderately dense, deep"),
        (4.9, 0.3, 4.9, "warm, dense"),
        (0.9, 0.29, 1.9, "cold, moderately dense, shallow"),
    ],
)
def test_names(temperature, nu_max, h, name):
    assert name_of(temperature, nu_max, h) == name
