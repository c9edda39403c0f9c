"""Averages: exact on states whose fields are known."""

import math

import numpy as np
import pytest

from chuteflow.dem import averages
from chuteflow.dem.averages import Sums, fields_of, pair_contacts, plane_contacts, sums_of, tenths_of, with_errors
from chuteflow.dem.contacts import MASS, PAIR_MASS
from chuteflow.dem.correlation import correlation_time, long_run_variance
from chuteflow.dem.output import Frame, Layers
from chuteflow.dem.script import BIN, MOMENTS
from chuteflow.dem.steadiness import Drift, drift, overall_steadiness

BINS = 200


def frame(position, velocity, bumps=(), spin=None, step=1):
    position = np.array(position, dtype=float)
    is_bump = np.array([i in bumps for i in range(len(position))])
    return Frame(step, np.arange(len(position)), is_bump, position, np.array(velocity, dtype=float), spin)


def empty_layers(bins=100):
    return Layers(np.array([10]), np.zeros((1, bins)), np.zeros((1, bins, len(MOMENTS))))


def test_a_contact_has_the_force_work_and_loss_of_spring_and_dashpot(small):
    # One above the other across the periodic boundary, the upper coming down on the lower.
    found = pair_contacts(small, frame([[0.05, 3.0, 2.0], [small.size[0] - 0.05, 3.0, 2.98]], [[0, 0, 1], [0, 0, -1]]))
    apart = np.array([-0.1, 0.0, 0.98])
    distance = np.linalg.norm(apart)
    law = small.contacts
    parting = -2.0 * 0.98 / distance
    press = law.stiffness * (1.0 - distance) - law.damping(0.95, PAIR_MASS) * parting
    np.testing.assert_allclose(found.force[0], press * apart / distance)
    assert found.loss[0] == pytest.approx(law.damping(0.95, PAIR_MASS) * parting**2)
    assert found.work[0] == pytest.approx(0.0, abs=1e-9)
    assert not found.is_base[0]


def test_a_force_crosses_the_planes_between_its_grains_alone(small):
    sums = sums_of(small, empty_layers(), [frame([[1, 1, 2.03], [1, 1, 3.01]], [[0, 0, 0], [0, 0, 0]])])
    force = small.contacts.stiffness * 0.02 / small.area
    planes = np.arange(100) * BIN
    inside = (planes > 2.03) & (planes < 3.01)
    np.testing.assert_allclose(sums.force[0, :, 1], np.where(inside, force, 0.0), rtol=1e-9, atol=1e-9)


def test_contacts_with_bumps_and_plane_are_losses_of_the_base(small):
    bump = frame([[1, 1, 0.0], [1, 1, 0.98]], [[0, 0, 0], [0, 0, -2.0]], bumps=(0,))
    sums = sums_of(small, empty_layers(), [bump])
    loss = small.contacts.damping(0.95, MASS) * 4.0
    assert sums.base_loss[0] == pytest.approx(loss / small.area)
    assert sums.dissipation[0].sum() == 0.0
    plane = plane_contacts(small, frame([[1, 1, 0.49]], [[0, 0, -2.0]]))
    assert plane.loss[0] == pytest.approx(loss)
    assert plane.force[0, 2] == pytest.approx(small.contacts.stiffness * 0.01 + small.contacts.damping(0.95, MASS) * 2)


def test_a_grain_on_the_edge_of_the_box_is_in_it(small):
    found = pair_contacts(small, frame([[-1e-18, 1, 2.0], [small.size[0], 1, 2.98]], [[0, 0, 0]] * 2))
    assert found.overlap == pytest.approx([0.02])


def test_two_bumps_that_touch_are_no_contact(small):
    assert pair_contacts(small, frame([[1, 1, 0], [1.99, 1, 0]], [[0, 0, 0]] * 2, bumps=(0, 1))).low.size == 0


def stratified(nu, u, T, blocks=1):
    """Sums of a gas with the fields nu(z), u(z), T(z): Maxwellian, without contacts."""
    z = (np.arange(BINS) + 0.5) * BIN
    mass, speed, heat = nu(z) * BIN, u(z), T(z)
    zero = np.zeros_like(z)
    moments = {
        "vx": speed,
        "vy": zero,
        "vz": zero,
        "xx": speed**2 + heat,
        "yy": heat,
        "zz": heat,
        "xz": zero,
        "ex": zero,
        "ez": zero,
    }
    # The flux of kinetic energy upward of a Maxwellian vanishes.
    stack = np.stack([moments[name] for name in MOMENTS], axis=-1) * mass[:, None]
    return Sums(
        mass=np.tile(mass, (blocks, 1)),
        moments=np.tile(stack, (blocks, 1, 1)),
        dissipation=np.zeros((blocks, BINS)),
        across=np.zeros((blocks, BINS, 2)),
        touching=np.zeros((blocks, BINS)),
        force=np.zeros((blocks, BINS, 2)),
        work=np.zeros((blocks, BINS)),
        base_loss=np.zeros(blocks),
        overlap=np.zeros((blocks, 2)),
    )


def test_fields_of_a_gas_are_its_own():
    sums = stratified(lambda z: 0.2 * np.exp(-z / 4.0), lambda z: 3.0 + 0.5 * z, lambda z: 2.0 + 0.1 * z)
    z = np.arange(2.0, 10.0, 0.5)
    found = fields_of(sums, z, 0.25)
    # A Gaussian of width w makes nu larger by exp(w^2/(2 l^2)), and moves u and T by their slopes times w^2/l.
    np.testing.assert_allclose(found["volume_fraction"], 0.2 * np.exp(-z / 4.0), rtol=3e-3)
    np.testing.assert_allclose(found["velocity"], 3.0 + 0.5 * z, rtol=3e-3)
    np.testing.assert_allclose(found["shear_rate"], 0.5, rtol=2e-3)
    np.testing.assert_allclose(found["granular_temperature"], 2.0 + 0.1 * z, rtol=2e-3)
    np.testing.assert_allclose(
        found["normal_stress"], found["volume_fraction"] * found["granular_temperature"], rtol=5e-3
    )
    whole = 0.8 * np.exp(-z / 4.0) - 0.8 * np.exp(-BINS * BIN / 4.0)
    np.testing.assert_allclose(found["overburden"], whole, rtol=0.02)
    assert np.abs(found["heat_flux"]).max() < 1e-9


def test_tenths_of_a_shear_flow_are_its_functions():
    z = np.linspace(0.0, 30.0, 601)
    p = 2.0 * np.exp(-z / 4.0)
    found = {
        "overburden": p,
        "volume_fraction": p / 4.0,
        "granular_temperature": np.full_like(z, 4.0),
        "velocity": 1.0 + 0.7 * z,
        "normal_stress": p,
        "shear_stress": 0.2 * p,
        "dissipation": p**2,
    }
    tenths = tenths_of(z, found, 2.0)
    np.testing.assert_allclose(tenths["g1"], tenths["normal_stress"] / 4.0)
    np.testing.assert_allclose(tenths["g2"], tenths["shear_stress"] / (2.0 * 0.7), rtol=1e-3)
    np.testing.assert_allclose(tenths["g5"], tenths["dissipation"] / 8.0, rtol=1e-9)
    assert (np.diff(tenths["volume_fraction"]) > 0.0).all()


def with_losses(values):
    """Sums of blocks that differ in the loss at the base."""
    sums = stratified(lambda z: np.exp(-z), lambda z: z, lambda z: 1.0 + 0.0 * z, blocks=len(values))
    return Sums(**{**vars(sums), "base_loss": np.array(values)})


def test_the_error_of_a_mean_of_independent_blocks_is_its_standard_error():
    values = np.random.default_rng(1).normal(5.0, 2.0, 400)
    mean, error = with_errors(
        with_losses(values), lambda one: {"loss": one.base_loss[0], "square": one.base_loss[0] ** 2}
    )
    assert mean["loss"] == pytest.approx(values.mean())
    assert error["loss"] == pytest.approx(2.0 / 20.0, rel=0.15)
    assert error["square"] == pytest.approx(2.0 * values.mean() * error["loss"], rel=1e-3)


def memory(count, decay, series, seed):
    """Series (count, series) of variance 1 whose values are forgotten as exp(-t/decay)."""
    random = np.random.default_rng(seed)
    kept = math.exp(-1.0 / decay)
    values = [random.normal(size=series)]
    for _ in range(count - 1):
        values.append(kept * values[-1] + math.sqrt(1.0 - kept**2) * random.normal(size=series))
    return np.array(values)


@pytest.mark.parametrize(("decay", "blocks"), [(0.1, 90), (4.0, 90), (4.0, 360), (8.0, 360)])
def test_errors_count_the_correlation_of_blocks(decay, blocks):
    values = memory(blocks, decay, 400, 7)
    mean = values.mean(axis=0)
    error = np.sqrt(long_run_variance(values - mean) / blocks)
    # Means of independent series scatter as their errors say; of ten blocks without correlation they do by 1.4 to 2.
    assert 0.9 < math.sqrt(((mean / error) ** 2).mean()) < 1.3


@pytest.mark.parametrize("decay", [0.1, 40.0])
def test_errors_of_drifts_count_the_correlation(decay):
    times = np.arange(1800.0)
    found = [drift(times, 10.0 + values) for values in memory(1800, decay, 100, 3).T]
    assert 0.8 < math.sqrt(np.mean([(one.value / one.error) ** 2 for one in found])) < 1.35


def test_the_correlation_time_is_that_of_the_memory():
    assert correlation_time(memory(40_000, 20.0, 1, 1)[:, 0]) == pytest.approx(20.0, rel=0.25)
    assert correlation_time(np.random.default_rng(1).normal(size=10_000)) == pytest.approx(0.5, rel=0.1)
    assert correlation_time(np.ones(10)) == 0.5


@pytest.mark.parametrize(
    ("slope", "noise", "expected"),
    [(0.0, 1e-3, "steady"), (3e-4, 1e-3, "not steady"), (0.0, 0.3, "undecided")],
)
def test_drift_is_told_with_its_error(slope, noise, expected):
    t = np.arange(600.0)
    random = np.random.default_rng(3)
    found = drift(t, 4.0 * (1.0 + slope * (t - 300.0)) + 4.0 * noise * random.normal(size=t.size))
    assert found.steadiness == expected
    assert abs(found.value - 300.0 * slope) < 4.0 * found.error


def test_one_drift_that_is_not_steady_decides():
    steady, moving = Drift(0.001, 0.001), Drift(0.2, 0.01)
    assert overall_steadiness({"a": steady, "b": steady}) == "steady"
    assert overall_steadiness({"a": steady, "b": moving}) == "not steady"
    assert overall_steadiness({"a": steady, "b": drift(np.arange(3.0), np.ones(3))}) == "undecided"


def test_friction_is_at_most_its_share_of_the_press(small):
    from dataclasses import replace

    rough = replace(small, friction=0.3)
    still = frame([[1, 1, 2.0], [1, 1, 2.98]], [[0, 0, 0], [50.0, 0, 0]], spin=np.zeros((2, 3)))
    found = pair_contacts(rough, still)
    assert found.force[0, 0] == pytest.approx(-0.3 * found.force[0, 2])
    assert found.loss[0] == pytest.approx(0.3 * found.force[0, 2] * 50.0)
    # Grains that roll on one another do not slide.
    rolling = frame([[1, 1, 2.0], [1, 1, 2.98]], [[0, 0, 0], [0.5, 0, 0]], spin=np.array([[0, 0.0, 0], [0, 1.0, 0]]))
    assert averages.pair_contacts(rough, rolling).force[0, 0] == pytest.approx(0.0, abs=1e-9)
