"""Scenes: bumps of the density and spacing asked for, grains of the hold-up asked for, and contacts within bounds."""

import math

import numpy as np
import pytest

from chuteflow.dem.contacts import MASS, PAIR_MASS, Bounds, Contacts, damping_ratio
from chuteflow.dem.scene import Scene, bump_positions, starting_grains
from chuteflow.errors import InputError
from chuteflow.steady.chute import Chute

CHUTE = Chute(0.18, 0.95, 0.95, 0.6)
ROUGHER = Chute(0.18, 0.95, 0.95, 0.7)


def distances(points, size):
    """The distance of each point from its nearest neighbour in a periodic box."""
    away = points[:, None, :] - points[None, :, :]
    for axis, length in enumerate(size):
        away[:, :, axis] -= length * np.round(away[:, :, axis] / length)
    square = (away**2).sum(axis=2)
    np.fill_diagonal(square, np.inf)
    return np.sqrt(square.min(axis=1))


def test_bumps_on_a_lattice_are_two_r_apart_and_fill_the_box():
    scene = Scene(CHUTE, 1.0, box=(10.0, 10.0))
    bumps = bump_positions(scene)
    np.testing.assert_allclose(distances(bumps, scene.size), 1.2)
    assert len(bumps) == pytest.approx(scene.density_of_bumps * scene.area)
    assert scene.roughness_by_spacing == pytest.approx(0.6)
    assert scene.roughness_by_area == pytest.approx(1.0 / math.sqrt(math.pi * 0.801875), rel=1e-6)


def test_a_pocket_of_the_lattice_holds_a_grain_up_to_the_slope_of_the_rows_across_it():
    scene = Scene(CHUTE, 1.0)
    bumps = bump_positions(scene)
    row = bumps[np.isclose(bumps[:, 0], bumps[0, 0])]
    # Rows go across the slope: the two bumps that a grain leaves a pocket between are side by side.
    assert len(row) == scene.cells[1]
    r = 0.6
    inward = math.sqrt(3.0) / 2.0 * 1.2 / 3.0
    assert inward == pytest.approx(r / math.sqrt(3.0))
    assert inward / math.sqrt(1.0 - (2.0 * inward) ** 2) == pytest.approx(
        r / math.sqrt(3.0) / math.sqrt(1.0 - 4.0 * r**2 / 3.0)
    )


def test_random_bumps_keep_apart_and_are_not_a_lattice():
    scene = Scene(ROUGHER, 1.0, box=(8.0, 8.0), base="random")
    bumps = bump_positions(scene)
    nearest = distances(bumps, scene.size)
    assert nearest.min() >= 1.0
    assert nearest.std() > 0.02
    assert len(bumps) == round(scene.density_of_bumps * scene.area)
    np.testing.assert_array_equal(bumps, bump_positions(scene))


@pytest.mark.parametrize("start", ["hot", "cold"])
def test_grains_have_the_holdup_and_do_not_touch(start):
    scene = Scene(CHUTE, 1.5, box=(8.0, 8.0), start=start, velocity=2.0)
    grains = starting_grains(scene)
    assert len(grains.position) * MASS / scene.area == pytest.approx(1.5, abs=MASS / scene.area)
    assert distances(grains.position, scene.size).min() > 1.0
    bumps = np.column_stack([bump_positions(scene), np.zeros(len(bump_positions(scene)))])
    gaps = np.linalg.norm(grains.position[:, None] - bumps[None], axis=2)
    assert gaps.min() > 1.0
    np.testing.assert_allclose(grains.velocity.mean(axis=0), [2.0, 0.0, 0.0], atol=1e-12)
    assert grains.velocity.var(axis=0).mean() == pytest.approx(scene.temperature, rel=0.2)


def test_contacts_keep_their_bounds():
    bounds = Bounds(overlap=0.01, contact_share=0.02)
    contacts = Scene(CHUTE, 1.0, temperature=4.0, bounds=bounds).contacts
    largest = 4.0 * math.sqrt(4.0) * math.sqrt(PAIR_MASS / contacts.stiffness)
    assert largest <= 0.01 * (1.0 + 1e-12)
    assert contacts.duration * 24.0 * 0.3 * 2.05 / math.sqrt(math.pi) <= 0.02 * (1.0 + 1e-3)


@pytest.mark.parametrize("e", [0.5, 0.9, 0.99])
def test_the_dashpot_gives_the_restitution(e):
    # A half-period of the damped oscillator.
    contacts = Contacts(1e4, e, e)
    rate = contacts.damping(e, PAIR_MASS) / (2.0 * PAIR_MASS)
    assert math.exp(-rate * contacts.duration) == pytest.approx(e)
    assert damping_ratio(1.0) == 0.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"holdup": -1.0}, "hold-up M = -1"),
        ({"holdup": float("nan")}, "hold-up M = nan"),
        ({"box": (1.0, 10.0)}, "length of the box"),
        ({"box": 12}, "give length and width"),
        ({"base": "square"}, "choose one of triangular, random"),
        ({"start": "warm"}, "choose one of hot, cold"),
        ({"seed": 0}, "seed"),
        ({"friction": -0.1}, "friction"),
        ({"bumps": 0.5}, "for the random base"),
        ({"base": "random", "bumps": 2.0}, "can be random"),
        ({"bump_diameter": 2.5}, "they would overlap"),
        ({"box": (5000.0, 5000.0)}, "give a smaller box"),
        ({"chute": Chute(0.3, 0.8, 0.0, 0.6)}, "wall restitution = 0"),
    ],
)
def test_what_is_out_of_range_is_named(arguments, said):
    with pytest.raises(InputError, match=said) as raised:
        Scene(**{"chute": CHUTE, "holdup": 1.0, **arguments})
    assert "\n" not in str(raised.value)


def test_a_scene_goes_to_a_dictionary_and_back():
    scene = Scene(ROUGHER, 1.2, base="random", bumps=0.5, seed=7, friction=0.2, bounds=Bounds(0.01, 0.03, 0.002))
    assert Scene.of(scene.as_dict()) == scene
    with pytest.raises(InputError, match="no scene"):
        Scene.of({"chute": {}})
