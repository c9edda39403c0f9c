"""The law that the documents add, checked by an integration of the printed equations with formulas of its own."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chuteflow import Chute, flows
from chuteflow.theory.laws import LAWS

FILE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "carnahan_starling.py"
SLOPE, E, E_W, R = 0.3, 0.8, 0.8, 0.6
#: Relative agreement; the way up magnifies what errs at the base.
AGREEMENT = 1e-8


@pytest.fixture
def chute(monkeypatch):
    spec = importlib.util.spec_from_file_location("carnahan_starling", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    law = module.CARNAHAN_STARLING
    monkeypatch.setitem(LAWS, law.name, law)
    return Chute(SLOPE, E, E_W, R, closure=law.name)


def table_1(nu):
    """g0 to g5, g0' and dg1/dnu, as printed but for g2, whose nu is cancelled."""
    f, root = 1.0 + E, math.sqrt(math.pi)
    g0 = (2.0 - nu) / (2.0 * (1.0 - nu) ** 3)
    dg0 = (5.0 - 2.0 * nu) / (2.0 * (1.0 - nu) ** 4)
    x = nu * g0
    g1 = nu * (1.0 + 2.0 * f * x)
    dg1 = 1.0 + 2.0 * f * (2.0 * x + nu**2 * dg0)
    g2 = root * (5.0 + 4.0 * f * x) / (120.0 * (3.0 - E) * f * g0) * (5.0 + 2.0 * f * (3.0 * E - 1.0) * x)
    g2 += 4.0 / (5.0 * root) * f * nu**2 * g0
    g3 = root * (5.0 + 6.0 * f * x) / (4.0 * f * (49.0 - 33.0 * E) * g0) * (5.0 + 3.0 * f**2 * (2.0 * E - 1.0) * x)
    g3 += 2.0 / root * f * nu**2 * g0
    g4 = 3.0 * root * (5.0 + 6.0 * f * x) / (4.0 * (49.0 - 33.0 * E) * x) * E * (1.0 - E) * (2.0 * x + nu**2 * dg0)
    g5 = 12.0 / root * (1.0 - E**2) * nu**2 * g0
    return g0, g1, g2, g3, g4, g5, dg1


def base(nu):
    """F1 (3.16) and F2 (3.18)."""
    g0, g1, g2 = table_1(nu)[:3]
    lid = math.sqrt(1.0 - R**2)
    kappa = 2.0 / 3.0 * (2.0 / (1.0 + lid) - lid)
    wall_shear = kappa - 0.5 * R**2 * (1.0 + math.pi / (12.0 * math.sqrt(2.0)) * (1.0 + 5.0 / (8.0 * nu * g0)))
    f1 = SLOPE / kappa * (math.sqrt(math.pi / 2.0) + wall_shear * g1 / g2)
    bracket = kappa * f1**2 - g1 * SLOPE / g2 * wall_shear * f1 - 2.0 * (1.0 - E_W) / (1.0 + lid)
    return f1, g1 * math.sqrt(2.0 / math.pi) * bracket


def upwards(z, state):
    """d/dz of ln nu, T, q, u and the integrals of nu, nu z and nu u, by (3.6) and (3.8)-(3.10)."""
    nu, (T, q, u) = math.exp(state[0]), state[1:4]
    _, g1, g2, g3, g4, g5, dg1 = table_1(nu)
    # g1' nu_z T + g1 T_z = -nu and g4 T^(3/2) nu_z - g3 T^(1/2) T_z = q
    matrix = np.array([[dg1 * T, g1], [g4 * T**1.5, -g3 * math.sqrt(T)]])
    nu_z, T_z = np.linalg.solve(matrix, [-nu, q])
    q_z = ((g1 * SLOPE) ** 2 / g2 - g5) * T**1.5
    u_z = g1 * SLOPE / g2 * math.sqrt(T)
    return [nu_z / nu, T_z, q_z, u_z, nu, nu * z, nu * u]


def test_the_radial_distribution_of_carnahan_and_starling(chute):
    nu = np.array([0.0, 0.1, 0.3, 0.49])
    got = LAWS[chute.closure].coefficients(nu, 1.0 - nu, E, SLOPE)
    np.testing.assert_allclose(got.radial, (1.0 - nu / 2.0) / (1.0 - nu) ** 3, rtol=1e-14)
    expected = np.array([table_1(v)[1:6] for v in nu[1:]])
    found = [
        nu * got.compressibility,
        got.viscosity,
        got.conductivity,
        got.density_conductivity,
        nu**2 * got.dissipation,
    ]
    np.testing.assert_allclose(np.array(found)[:, 1:].T, expected, rtol=1e-13)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_its_flows_solve_the_printed_equations(chute, number):
    found = flows(chute, Q=3.0)
    assert len(found) == 3
    flow = found[number]
    nu, T = flow.base_volume_fraction, flow.base_temperature
    f1, f2 = base(nu)
    start = [math.log(nu), T, f2 * T**1.5, f1 * math.sqrt(T), 0.0, 0.0, 0.0]
    top = 2.0 * flow.centre_of_mass
    up = solve_ivp(upwards, (0.0, top), start, method="DOP853", rtol=1e-12, atol=1e-14, dense_output=True)
    z = np.linspace(0.0, top, 9)
    profile = flow.profile(z)
    assert up.sol is not None
    log_nu, T, q, u, mass, moment, flux = up.sol(z)
    np.testing.assert_allclose(np.exp(log_nu), profile.volume_fraction, rtol=AGREEMENT)
    np.testing.assert_allclose(T, profile.granular_temperature, rtol=AGREEMENT)
    np.testing.assert_allclose(u, profile.velocity, rtol=AGREEMENT)
    np.testing.assert_allclose(q, profile.heat_flux, atol=AGREEMENT * np.abs(profile.heat_flux).max())
    # What is below and the weight above are the hold-up.
    assert mass[-1] + profile.normal_stress[-1] == pytest.approx(flow.mass_holdup, rel=AGREEMENT)
    moment_above, flux_above = far_above(flow, top)
    assert moment[-1] + moment_above == pytest.approx(flow.mass_holdup * flow.centre_of_mass, rel=AGREEMENT)
    assert flux[-1] + flux_above == pytest.approx(3.0, rel=AGREEMENT)


def far_above(flow, top):
    """Integrals of nu z and nu u from ``top`` up, by Gauss's rule over the overburden above."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    root = 0.5 * (1.0 + nodes)  # of the fourth order, to smooth the logarithm in the height
    there = flow.profile([top])
    part = float(there.normal_stress[0]) / flow.mass_holdup
    profile = flow.at_overburden(part * root**4)
    weights = 2.0 * root**3 * weights * part * flow.mass_holdup
    return float(weights @ profile.height), float(weights @ profile.velocity)
