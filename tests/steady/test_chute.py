import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chuteflow import Chute, InputError

GOOD: dict[str, Any] = {"slope": 0.3, "restitution": 0.8, "wall_restitution": 0.8, "roughness": 0.6}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slope": 0.0}, "slope = 0.0: tan"),
        ({"slope": -0.3}, "slope = -0.3"),
        ({"slope": math.inf}, "slope = inf: must be a finite number"),
        ({"slope": math.nan}, "slope = nan"),
        ({"slope": "steep"}, "slope = 'steep': must be a number"),
        ({"slope": None}, "slope = None"),
        ({"restitution": 0.0}, "restitution e = 0.0: must be above 0"),
        ({"restitution": 1.1}, "restitution e = 1.1"),
        ({"wall_restitution": -0.1}, "wall restitution e_w = -0.1: must be from 0 to 1"),
        ({"wall_restitution": 1.01}, "wall restitution e_w = 1.01"),
        ({"roughness": 0.49}, "roughness r = 0.49: must be from 1/2"),
        ({"roughness": 0.87}, "roughness r = 0.87"),
        ({"surface": "wavy"}, "unknown surface 'wavy': choose one of free, interface"),
        ({"closure": "ideal"}, "unknown closure 'ideal': choose one of lun, lun-fourier"),
        ({"closure": ["lun"]}, "unknown closure"),
    ],
)
def test_bad_input_is_named_in_one_line(change, message):
    with pytest.raises(InputError) as caught:
        Chute(**(GOOD | change))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        {"restitution": 1},
        {"wall_restitution": 0},
        {"wall_restitution": 1},
        {"roughness": 0.5},
        {"roughness": 0.866025},
        {"roughness": 0.8660254037844387},
        {"slope": 1e-8},
    ],
)
def test_the_edges_of_the_ranges_are_allowed(change):
    Chute(**(GOOD | change))


@given(st.floats(0.01, 89.0))
def test_an_angle_is_its_tangent(degrees):
    others: dict[str, Any] = {name: value for name, value in GOOD.items() if name != "slope"}
    chute = Chute.at_angle(degrees, **others)
    assert chute.slope == pytest.approx(math.tan(math.radians(degrees)))
    assert chute.angle == pytest.approx(degrees)


@pytest.mark.parametrize("degrees", [0.0, 90.0, -5.0, math.nan, "x"])
def test_a_bad_angle_is_named(degrees):
    with pytest.raises(InputError, match="angle"):
        Chute.at_angle(degrees, restitution=0.8, wall_restitution=0.8, roughness=0.6)


def test_equal_chutes_are_equal_and_hash_alike():
    assert Chute(**GOOD) == Chute(**GOOD)
    assert hash(Chute(**GOOD)) == hash(Chute(**GOOD))
