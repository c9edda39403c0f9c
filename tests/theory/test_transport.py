"""The full equations and Richman's base: tensors, steady flows, symmetry, and short waves."""

from itertools import product
from typing import Any

import numpy as np
import pytest

from chuteflow.numerics.first_order import FirstOrder, variables
from chuteflow.stability.base import Resolution, base
from chuteflow.stability.linear import grains, steady_motion
from chuteflow.steady.chute import Chute
from chuteflow.theory import boundary
from chuteflow.theory.bases import BASES
from chuteflow.theory.transport import (
    Fields,
    base_conditions,
    motion,
    pressure_tensor,
    richman_tensors,
    traction,
)

ROUGHNESS = 0.7
CHUTE = Chute(0.3, 0.8, 0.75, ROUGHNESS)


def rotation(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def tensor(array) -> Any:
    return tuple(tuple(row) for row in array)


def random(seed, *shape):
    return np.random.default_rng(seed).standard_normal(shape)


def test_tensors_of_the_base_are_those_of_richman():
    r = ROUGHNESS
    lid, k = np.sqrt(1 - r**2), boundary.kappa(r)
    n, tau, t = np.eye(3)[[2, 0, 1]]
    second, third = richman_tensors(r)
    for i, m in product(range(3), repeat=2):
        assert second[i, m] == pytest.approx(
            (k + 2 * lid) * n[i] * n[m] + k * (tau[i] * tau[m] + t[i] * t[m]), abs=1e-15
        )
    for i, j, m in product(range(3), repeat=3):
        printed = (r**2 - 2) * n[i] * n[j] * n[m] - 0.5 * r**2 * (
            n[i] * (tau[j] * tau[m] + t[j] * t[m])
            + n[j] * (tau[m] * tau[i] + t[m] * t[i])
            + n[m] * (tau[i] * tau[j] + t[i] * t[j])
        )
        assert third[i, j, m] == pytest.approx(printed, abs=1e-15)


@pytest.mark.parametrize("angle", [0.3, 1.0, 2.0, np.pi / 2])
def test_stress_and_traction_turn_with_the_flow_about_the_normal_of_the_base(angle):
    turn, grad, slip = rotation(angle), random(1, 3, 3), random(2, 3)
    turned = turn @ grad @ turn.T
    p, eta, xi = 1.3, 0.4, 0.2

    def stress(g):
        return np.array(pressure_tensor(p, eta, xi, tensor(g)))

    def push(u, g):
        return np.array(traction(tuple(u), 0.9, tensor(g), 2.1, ROUGHNESS))

    np.testing.assert_allclose(stress(turned), turn @ stress(grad) @ turn.T, atol=1e-14)
    np.testing.assert_allclose(push(turn @ slip, turned), turn @ push(slip, grad), atol=1e-14)


def test_stress_is_newtonian():
    grad = random(3, 3, 3)
    p, eta, xi = 1.3, 0.4, 0.2
    strain = 0.5 * (grad + grad.T) - np.trace(grad) / 3.0 * np.eye(3)
    expected = (p - xi * np.trace(grad)) * np.eye(3) - 2.0 * eta * strain
    np.testing.assert_allclose(pressure_tensor(p, eta, xi, tensor(grad)), expected, atol=1e-14)


def test_traction_in_plain_shear_is_that_of_the_paper():
    # (3.13), with A in front of r^2/2, and (3.14).
    u, rate, root, A = 0.7, 0.4, 1.2, 3.1
    along, across, up = traction((-u, 0.0, 0.0), root, tensor([[0.0, 0.0, rate], [0.0] * 3, [0.0] * 3]), A, ROUGHNESS)
    k = boundary.kappa(ROUGHNESS)
    assert along == pytest.approx(np.sqrt(2 / np.pi) / root * (-k * u + (k - 0.5 * A * ROUGHNESS**2) * rate))
    assert across == 0.0
    assert up == 1.0


def plain_motion(nu, T, u, rate, heating, thinning, slope=0.3):
    """Everything at one point of a parallel flow with given gradients along z."""
    fields = Fields(np.log([nu]), (np.array([u]), np.zeros(1), np.zeros(1)), np.log([T]))
    slopes = iter([thinning, heating, rate, 0.0, 0.0])

    def gradient(f):
        return 0.0 * f, 0.0 * f, np.array([next(slopes, 0.0)])

    chute = Chute(slope, 0.8, 0.75, ROUGHNESS)
    moving = motion(fields, gradient, grains_of(chute))
    return moving, base_conditions(moving, BASES["richman"], ROUGHNESS, 0.75)


def grains_of(chute):
    from chuteflow.theory.laws import law
    from chuteflow.theory.transport import Material

    return Material(law(chute.closure), chute.restitution, chute.slope)


@pytest.mark.parametrize("nu", [0.05, 0.3, 0.5])
def test_conditions_at_the_base_are_slip_and_heat_flux_of_the_paper(nu):
    from chuteflow.theory.laws import law

    slope, T, e = 0.3, 1.7, 0.8
    g = law("lun").coefficients(np.array([nu]), 1.0 - np.array([nu]) / 0.62, e, slope)
    g1, g2 = nu * g.compressibility, g.viscosity
    A = 1.0 + np.pi / (12.0 * np.sqrt(2.0)) * (1.0 + 5.0 / (8.0 * nu * g.radial))
    k = boundary.kappa(ROUGHNESS)
    F1 = slope / k * (np.sqrt(np.pi / 2) + (k - 0.5 * A * ROUGHNESS**2) * g1 / g2)  # (3.16)
    lid = np.sqrt(1 - ROUGHNESS**2)
    F2 = (
        g1
        * np.sqrt(2 / np.pi)
        * (k * F1**2 - g1 * slope / g2 * (k - 0.5 * A * ROUGHNESS**2) * F1 - 2 * (1 - 0.75) / (1 + lid))
    )  # (3.18)
    rate = g1 * slope / g2 * np.sqrt(T)  # (3.10)
    heating = -F2 / g.conductivity  # -K dT/dz = F2 T^(3/2) with a uniform density
    _, residual = plain_motion(nu, T, (F1 * np.sqrt(T)).item(), rate.item(), heating.item(), 0.0)
    for value in residual:
        assert value == pytest.approx(0.0, abs=1e-12)


def test_steady_flows_exert_no_force(three):
    for flow, limit in zip(three.values(), (1e-9, 1e-9, 1e-7), strict=True):
        at = base(flow, Resolution(64, 8.0, 1.0))
        moving = steady_motion(at)
        for force, scale in zip(moving.forces, (1.0, at.profile.volume_fraction.max(), 1.0, 1.0, 1.0), strict=True):
            assert np.abs(force).max() < limit * scale
        chute = flow.chute
        ends = [
            value[-1] for value in base_conditions(moving, BASES["richman"], chute.roughness, chute.wall_restitution)
        ]
        np.testing.assert_allclose(ends, 0.0, atol=limit)


def test_short_waves_relax_as_the_continuous_spectrum_says(three):
    # d/dz is i kappa of the disturbance: at one height, the one slow eigenvalue tends to sigma_c.
    from chuteflow.stability.essential import relaxation_at

    for flow in three.values():
        at = base(flow, Resolution(16, 6.0, 1.0))
        steady = steady_motion(at)
        gradients = {
            "nu": at.derivative @ np.log(at.profile.volume_fraction),
            "T": at.derivative @ np.log(at.profile.granular_temperature),
        }
        kx = 0.5
        velocity, rate = relaxation_at(flow, at.fraction)
        for node in (2, 8, 15):
            found = []
            for kappa in (1e3, 1e4):
                a, b = local_problem(flow, at, node, kx, kappa, gradients, steady)
                values = np.linalg.eigvals(a / b[:, None])
                found.append(values[np.argmin(np.abs(values))])
            expected = -1j * kx * velocity[node] - rate[node]
            assert abs(found[1] - expected) < 0.2 * abs(found[0] - expected)
            assert abs(found[1] - expected) < 1e-3 * max(rate[node], 1e-4)


def local_problem(flow, at, node, kx, kappa, gradients, steady):
    values = np.array(
        [
            [np.log(at.profile.volume_fraction[node])],
            [at.profile.velocity[node]],
            [0.0],
            [0.0],
            [np.log(at.profile.granular_temperature[node])],
        ]
    )
    numbers = variables(values)
    known = {
        id(numbers[0]): gradients["nu"][node],
        id(numbers[1]): at.profile.shear_rate[node],
        id(numbers[4]): gradients["T"][node],
    }

    def gradient(f):
        # Gradients of stresses and heat fluxes of the steady flow have no part in the coefficients.
        rise = np.array([known.get(id(f), 0.0)])
        zero = np.zeros_like(f.value)
        return (
            FirstOrder(zero, 1j * kx * f.slope),
            FirstOrder(zero, 0j * f.slope),
            FirstOrder(rise, 1j * kappa * f.slope),
        )

    moving = motion(
        Fields(numbers[0], (numbers[1], numbers[2], numbers[3]), numbers[4]),
        gradient,
        grains(at.flow.chute, at.flow.law),
    )
    a = np.concatenate([force.slope for force in moving.forces])
    b = np.array([1.0, *(np.asarray(i.value).item() for i in moving.inertia[1:])])
    return a, b
