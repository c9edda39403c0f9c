"""The fields of flows as functions of height: equations, boundary conditions and integrals of the paper."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import chebyshev, legendre

from chuteflow import Chute, Flow, flows

from .reference import P_H, Case, Table1

#: Chute and condition, and which of the flows.
FLOWS: dict[str, tuple[Case, dict[str, Any], int]] = {
    "hot": (Case(0.3, 0.8, 0.8, 0.6), {"Q": 3.0}, 0),
    "cold and dense": (Case(0.3, 0.8, 0.8, 0.6), {"Q": 3.0}, 2),
    "below an interface": (Case(0.3, 0.8, 0.8, 0.6, "interface"), {"Q": 3.0}, 1),
    "Fourier": (Case(0.3, 0.8, 0.8, 0.6, "free", "lun-fourier"), {"Q": 3.0}, 2),
    "productive": (Case(0.4, 0.9, 0.6, 0.8), {"Q": 3.0}, 0),
    "deep": (Case(0.29, 0.9, 0.8, 0.7), {"M": 20.0}, 1),
    "elastic": (Case(0.2, 1.0, 0.5, 0.6), {"M": 1.0}, 1),
    "very cold": (Case(0.3, 0.8, 0.8, 0.6), {"T_surface": 1e-2}, 0),
    "very hot": (Case(0.3, 0.8, 0.8, 0.6), {"T_surface": 1e4}, 0),
}
#: Fields are compared to this fraction of their largest value.
CLOSE = 1e-8


@cache
def solved(name: str) -> Flow:
    case, condition, place = FLOWS[name]
    return flows(Chute(case.slope, case.e, case.e_w, case.r, case.surface, case.closure), **condition)[place]


def closures(name: str, nu: np.ndarray) -> Table1:
    return Table1(FLOWS[name][0], nu, 1.0 - nu / 0.62)


def close(one: np.ndarray, other: np.ndarray, tolerance: float = CLOSE) -> None:
    size = np.abs(other).max()
    assert size > 0.0
    np.testing.assert_allclose(one, other, rtol=0.0, atol=tolerance * size)


class Window:
    """Heights within a flow, and the derivatives of fields there by an own interpolant."""

    def __init__(self, low: float, high: float, degree: int = 30) -> None:
        self.x = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
        self.half = 0.5 * (high - low)
        self.z = low + self.half * (1.0 + self.x)

    def derivative(self, values: np.ndarray) -> np.ndarray:
        fit = chebyshev.chebfit(self.x, values, len(self.x) - 1)
        return chebyshev.chebval(self.x, chebyshev.chebder(fit)) / self.half


@pytest.fixture(params=FLOWS)
def name(request):
    return request.param


@pytest.fixture(params=[(0.0, 0.1), (0.2, 0.4), (0.7, 0.9)], ids=["base", "middle", "top"])
def window(request, name):
    """Part of a flow: points that have nothing to do with the nodes of the engine."""
    flow = solved(name)
    top = min(flow.depth, flow.interface_height)
    return Window(request.param[0] * top, request.param[1] * top)


def test_equations_hold_between_the_nodes(name, window):
    case, flow = FLOWS[name][0], solved(name)
    f = flow.profile(window.z)
    nu, t = f.volume_fraction, f.granular_temperature
    g, root_t = closures(name, nu), np.sqrt(t)
    d = window.derivative
    close(f.normal_stress, g.g1 * t, 1e-11)  # (3.4), where nearly packed an error of nu is a hundredfold one of g_1
    close(f.shear_stress, -case.slope * f.normal_stress, 1e-14)
    close(f.shear_rate, g.g1 * case.slope / g.g2 * root_t, 1e-11)  # (3.10)
    close(f.production, (g.g1 * case.slope) ** 2 / g.g2 * t * root_t, 1e-11)
    close(f.production, -f.shear_stress * f.shear_rate, 1e-12)
    if case.e < 1.0:
        close(f.dissipation, g.g5 * t * root_t, 1e-11)  # (3.7)
    else:
        assert np.all(f.dissipation == 0.0)
    close(d(f.normal_stress), -nu)  # (3.2)
    close(d(f.velocity), f.shear_rate)  # (3.10)
    size = np.abs(f.production).max() + np.abs(f.dissipation).max()
    np.testing.assert_allclose(d(f.heat_flux), f.production - f.dissipation, rtol=0.0, atol=CLOSE * size)  # (3.3)
    conducted, by_density = -g.g3 * root_t * d(t), g.g4 * t * root_t * d(nu)
    size = np.abs(conducted).max() + np.abs(by_density).max()
    np.testing.assert_allclose(f.conductive_heat_flux, conducted, rtol=0.0, atol=CLOSE * size)  # (3.6)
    np.testing.assert_allclose(f.density_heat_flux, by_density, rtol=0.0, atol=CLOSE * size)
    np.testing.assert_allclose(f.heat_flux, conducted + by_density, rtol=0.0, atol=CLOSE * size)


def test_conditions_at_the_base(name):
    case, flow = FLOWS[name][0], solved(name)
    f = flow.profile(0.0)
    g = closures(name, f.volume_fraction)
    slip, heat = g.bases()
    root_t = np.sqrt(f.granular_temperature)
    weight = flow.mass_holdup + case.p_s
    assert f.normal_stress == pytest.approx(weight, rel=1e-13)
    assert f.velocity == pytest.approx(slip * root_t, rel=1e-12)  # (3.15)
    assert abs(f.heat_flux - heat * root_t**3) < 1e-10 * weight * root_t  # (3.17)
    assert f.velocity == pytest.approx(flow.slip_velocity, rel=1e-13)
    assert f.granular_temperature == pytest.approx(flow.base_temperature, rel=1e-13)
    assert f.volume_fraction == pytest.approx(flow.base_volume_fraction, rel=1e-13)


def test_conditions_at_the_surface(name):
    case, flow = FLOWS[name][0], solved(name)
    t = flow.surface_temperature
    if case.surface == "interface":
        f = flow.profile(flow.interface_height)
        assert f.normal_stress == pytest.approx(P_H, rel=1e-10)  # (3.31)
        assert f.granular_temperature == pytest.approx(t, rel=1e-10)
        assert f.heat_flux == pytest.approx(-P_H * np.sqrt(t) * case.slope**2, rel=1e-10)  # (3.32)
        return
    high = flow.depth + t * np.array([9.0, 12.0])
    f = flow.profile(high)
    g = closures(name, np.full(2, 1e-12))
    nu = f.volume_fraction
    np.testing.assert_allclose(nu[1] / nu[0], np.exp(-3.0), rtol=20.0 * nu[0])  # (3.23)
    np.testing.assert_allclose(  # (3.24), where the leading term is well above rounding
        (f.granular_temperature - t)[0], (g.g4 / g.g3 * t * nu)[0], rtol=1e-2, atol=flow.error * t
    )
    g52 = 12.0 / np.sqrt(np.pi) * (1.0 - case.e**2)
    leading = -0.5 * (case.slope**2 / g.g2 - g52) * t**2.5 * nu**2
    np.testing.assert_allclose(f.heat_flux, leading, rtol=1e-3)  # (3.25)


def test_integrals_over_height(name):
    flow = solved(name)
    top = min(flow.interface_height, flow.depth + 36.0 * flow.surface_temperature)
    x, w = legendre.leggauss(24)
    pieces = np.linspace(0.0, 1.0, 61) ** 1.5 * top
    half = 0.5 * np.diff(pieces)[:, None]
    z = (pieces[:-1, None] + half * (1.0 + x)).ravel()
    weights = (half * w).ravel()
    f = flow.profile(z)
    nu = f.volume_fraction
    mass = weights @ nu
    assert mass == pytest.approx(flow.mass_holdup, rel=1e-9)  # (3.27)
    assert weights @ (nu * z) / mass == pytest.approx(flow.centre_of_mass, rel=1e-9)
    assert weights @ (nu * f.velocity) == pytest.approx(flow.mass_flux, rel=1e-9)  # (3.26)
    ends = flow.profile(np.array([0.0, top])).heat_flux
    lost, made = weights @ f.dissipation, weights @ f.production
    assert abs(ends[0] - ends[1] - (lost - made)) < 1e-9 * (lost + made)


def test_depth_is_where_a_hundredth_of_the_largest_density_is_left(name):
    flow = solved(name)
    z = np.linspace(0.0, min(flow.interface_height, 1.2 * flow.depth), 4001)
    nu = flow.profile(z).volume_fraction
    assert flow.largest_volume_fraction >= nu.max() * (1.0 - 1e-12)
    assert flow.largest_volume_fraction == pytest.approx(nu.max(), rel=1e-4)
    if flow.depth < flow.interface_height:
        edge = flow.profile(flow.depth).volume_fraction
        assert edge == pytest.approx(0.01 * flow.largest_volume_fraction, rel=1e-9)
    assert flow.density == ("inverted" if np.any(np.diff(nu) > 0.0) else "monotonic")


def test_interior_is_what_the_profile_says(name):
    flow = solved(name)
    f = flow.profile(np.linspace(0.0, min(flow.interface_height, flow.depth), 2001))
    net = f.dissipation - f.production
    kind = "dissipative" if np.all(net >= 0.0) else "productive" if np.all(net <= 0.0) else "mixed"
    assert flow.interior == kind
