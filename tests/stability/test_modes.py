"""Normal modes against what is known of them exactly, and against an independent linearisation."""

from itertools import pairwise

import numpy as np
import pytest

import chuteflow
from chuteflow.numerics.eigenproblem import drift, refine_eigenvalue, spectrum
from chuteflow.stability.base import Resolution, base
from chuteflow.stability.linear import operator, without_top
from chuteflow.stability.modes import Disturbances, relative_fields
from chuteflow.stability.result import leading
from chuteflow.steady.chute import Chute

from .reference import Problem


def neighbours(flow, change):
    """The flows with the hold-up a little smaller and larger on the same branch."""
    return [
        min(
            chuteflow.flows(flow.chute, M=flow.mass_holdup * (1.0 + step)),
            key=lambda other: abs(np.log(other.surface_temperature / flow.surface_temperature)),
        )
        for step in (-change, change)
    ]


@pytest.fixture(scope="module")
def branches(three):
    """(less, more): neighbours of A, B and C, 0.02 % away in the hold-up."""
    return {name: neighbours(flow, 2e-4) for name, flow in three.items()}


def slope_of(pair, quantity):
    less, more = pair
    return (quantity(more) - quantity(less)) / (more.mass_holdup - less.mass_holdup)


def mass_mode(disturbances, kx):
    modes = disturbances.modes(kx, 0.0, count=6, tolerance=1.0)
    return min(modes, key=lambda mode: abs(mode.sigma))


# At k = 0


@pytest.mark.parametrize("name", ["A", "B", "C"])
def test_the_mass_mode_at_rest_leads_to_the_neighbouring_flow(disturbances, branches, name):
    (mode,) = disturbances[name].modes(0.0, 0.0)
    assert mode.kind == "mass"
    assert abs(mode.sigma) < 1e-10
    heights = mode.height[mode.height < 3.0 * mode.flow.depth]
    nu, u, v, w, T = (field[-len(heights) :] for field in mode.fields)
    by_mass = [
        slope_of(branches[name], lambda flow, f=f: getattr(flow.profile(heights), f))
        for f in ("volume_fraction", "velocity", "granular_temperature")
    ]
    scale = np.vdot(by_mass[1], u) / np.vdot(by_mass[1], by_mass[1])
    for found, expected in zip((nu, u, T), by_mass, strict=True):
        assert np.abs(found - scale * expected).max() < 1e-4 * np.abs(scale * expected).max()
    assert np.abs(v).max() < 1e-9
    assert np.abs(w).max() < 1e-9


def test_only_one_mode_is_at_rest(disturbances):
    for all_of in disturbances.values():
        _, other = all_of.modes(0.0, 0.0, count=2)
        assert other.growth < -0.1


def test_uniform_disturbances_change_stability_at_a_fold_of_the_holdup():
    chute = Chute(0.3, 0.9, 0.6, 0.8)
    fold = chuteflow.curve(chute, points=40, surface_temperature=(0.5, 5.0)).branches[0].special
    (smallest,) = (point.flow for point in fold if point.kind == "fold-M")
    growth = []
    for excess in (1e-3, 4e-3):
        warm, cold = (
            flow for flow in chuteflow.flows(chute, M=smallest.mass_holdup * (1.0 + excess)) if flow.mass_flux < 20.0
        )
        assert warm.surface_temperature > smallest.surface_temperature > cold.surface_temperature
        modes = [leading(Disturbances(flow), 0.0, 0.0, count=2) for flow in (warm, cold)]
        stable, unstable = (next(mode for mode in found if mode.kind != "mass") for found in modes)
        assert stable.growth < -0.1
        assert unstable.sigma.imag == pytest.approx(0.0, abs=1e-12)
        growth.append(unstable.growth)
    # It starts from zero at the fold, as the distance along the branch does.
    assert growth[0] > 1e-4
    assert growth[1] / growth[0] == pytest.approx(2.0, abs=0.1)


# Long waves


@pytest.mark.parametrize(("name", "speed"), [("A", -11.788125), ("B", 3.848646), ("C", -33.890025)])
def test_long_waves_along_the_slope_tend_to_the_kinematic_speed(disturbances, branches, name, speed):
    assert slope_of(branches[name], lambda flow: flow.mass_flux) == pytest.approx(speed, rel=3e-5)
    away = [mass_mode(disturbances[name], kx).speed - speed for kx in (1e-5, 1e-6, 1e-7, 1e-8)]
    assert abs(away[-1]) < 1e-3
    assert all(abs(later) < 0.2 * abs(sooner) or abs(later) < 1e-3 for sooner, later in pairwise(away))


@pytest.mark.parametrize("name", ["A", "B", "C"])
def test_long_waves_across_grow_as_the_pressure_of_the_neighbouring_flow_pushes(three, branches, disturbances, name):
    # nu, T follow the branch; v is driven by the gradient of its pressure across and carries the mass:
    # eta v'' is balanced by i ky dp/dM, with Richman's base; sigma = -i ky Int nu v dz, of order ky^2.
    flow = three[name]
    z = np.linspace(0.0, 25.0 * flow.surface_temperature + 2.0 * flow.depth, 20001)
    at = flow.profile(z)
    push = slope_of(branches[name], lambda other: other.profile(z).normal_stress)
    step = z[1] - z[0]

    def from_above(f):
        return np.concatenate([np.cumsum((0.5 * (f[1:] + f[:-1]))[::-1] * step)[::-1], [0.0]])

    viscosity = -at.shear_stress / at.shear_rate
    rate = -from_above(push) / viscosity  # v'/(i ky)
    slip = flow.slip_velocity / at.shear_rate[0]  # Richman's base is linear: v = slip length times v'
    v = slip * rate[0] + np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * step)])
    expected = float(np.sum(0.5 * ((at.volume_fraction * v)[1:] + (at.volume_fraction * v)[:-1]) * step))
    away = []
    for ky in (2e-3 / flow.centre_of_mass, 1e-3 / flow.centre_of_mass):
        (mode,) = disturbances[name].modes(0.0, ky, tolerance=1.0)
        away.append(abs(mode.growth / ky**2 / expected - 1.0))
    assert away[1] < 0.1
    assert away[1] < 0.6 * away[0]
    assert expected > 0.0


def test_a_long_wave_of_flow_a_grows(disturbances):
    mode = mass_mode(disturbances["A"], 1e-3)
    assert mode.growth == pytest.approx(2.3526e-3, abs=3e-7)
    assert mode.error < 1e-6


# Symmetries and budgets


@pytest.mark.parametrize("name", ["A", "C"])
def test_mirror_images_and_opposite_waves(disturbances, name):
    of = disturbances[name].coarse_operator(0.1, 0.07)
    there = spectrum(of.matrix(0.1, 0.07), of.weights, 0.1 - 0.3j).values[:12]
    mirrored = spectrum(of.matrix(0.1, -0.07), of.weights, 0.1 - 0.3j).values[:24]
    opposite = spectrum(of.matrix(-0.1, 0.07), of.weights, 0.1 + 0.3j).values[:24]
    assert drift(there, mirrored).max() < 1e-8
    assert drift(there.conj(), opposite).max() < 1e-8


@pytest.mark.parametrize(("name", "kx", "ky"), [("A", 0.01, 0.0), ("B", 0.02, 0.05), ("C", 0.05, 0.0), ("C", 0.0, 0.3)])
def test_modes_conserve_mass(disturbances, name, kx, ky):
    (mode,) = disturbances[name].modes(kx, ky, tolerance=1e-5)
    at, vector = mode.operator.base, mode.vector
    n, u, v, _, _ = relative_fields(mode.operator, vector)
    nu, U = at.profile.volume_fraction, at.profile.velocity
    above = at.profile.normal_stress[0]  # mass above the grid, which carries omega, the first unknown
    content = at.weights @ (nu * n) + above * vector[0]
    outflow = 1j * at.weights @ (nu * (kx * (U * n + u) + ky * v)) + 1j * above * (
        kx * (U[0] * vector[0] + u[0]) + ky * v[0]
    )
    assert abs(mode.sigma * content + outflow) < 1e-6 * max(abs(mode.sigma * content), abs(outflow))


# Against the other linearisation, and much finer grids


@pytest.mark.parametrize(
    ("name", "kx", "ky", "n"),
    [
        ("A", 0.1, 0.0, 50),
        ("A", 0.01, 0.0, 60),
        ("A", 0.0, 0.01, 60),
        ("A", 0.2, 0.3, 50),
        ("B", 0.02, 0.03, 80),
        ("B", 0.1, 0.05, 70),
        ("C", 0.1, 0.0, 100),
    ],
)
def test_modes_are_those_of_an_independent_linearisation(three, disturbances, name, kx, ky, n):
    for mode in disturbances[name].modes(kx, ky, count=2, tolerance=1e-5):
        other = Problem(three[name], kx, ky, n).nearest(mode.sigma)
        assert abs(other - mode.sigma) < max(2.0 * mode.error, 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kx", "growth"), [("A", 1e-3, 2.3526e-3), ("B", 1e-3, 1.4099e-4)])
def test_a_long_wave_is_that_of_an_independent_linearisation(three, disturbances, name, kx, growth):
    mode = mass_mode(disturbances[name], kx)
    assert mode.growth == pytest.approx(growth, rel=1e-3)
    assert abs(Problem(three[name], kx, 0.0, 200).nearest(mode.sigma) - mode.sigma) < 1e-3 * abs(mode.sigma)


@pytest.mark.parametrize(
    "name", ["A", pytest.param("B", marks=pytest.mark.slow), pytest.param("C", marks=pytest.mark.slow)]
)
def test_no_error_is_understated(three, disturbances, name):
    h = three[name].centre_of_mass
    fine = operator(base(three[name], Resolution(112, 19.0, 4.0)))
    for kx, ky in ((1e-3 / h, 0.0), (0.03 / h, 0.0), (0.0, 0.05 / h), (0.5 / h, 0.5 / h), (2.0 / h, 0.0)):
        for mode in leading(disturbances[name], kx, ky, count=2):
            sigma, _ = refine_eigenvalue(fine.matrix(kx, ky), fine.weights, mode.sigma)
            assert abs(sigma - mode.sigma) < 2.0 * mode.error


def test_density_at_the_top_follows_from_the_others(disturbances):
    at = disturbances["A"].coarse_operator(0.1, 0.0).base
    s = at.grid.nodes
    for power in range(4):
        np.testing.assert_allclose(without_top(at) @ (1.0 - s) ** power, (1.0 - s) ** power, atol=1e-12)


# What is refused


def test_laws_and_surfaces_that_know_steady_flows_alone_are_refused():
    (flow, *_) = chuteflow.flows(Chute(0.3, 0.8, 0.8, 0.6, surface="interface"), Q=3.0)
    with pytest.raises(chuteflow.InputError, match="use the free surface"):
        Disturbances(flow).modes(0.1, 0.0)


@pytest.mark.parametrize(("kx", "ky"), [(float("nan"), 0.0), (0.0, float("inf")), (1e5, 0.0), (1e-17, 0.0)])
def test_wavenumbers_out_of_range_are_refused(disturbances, kx, ky):
    with pytest.raises(chuteflow.InputError, match="wavenumber"):
        disturbances["A"].modes(kx, ky)
