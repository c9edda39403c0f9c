"""Numbers from outside: what is no real number is refused in one line, everywhere alike."""

import re
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from chuteflow import Chute, InputError, Scales, boundary, curve, domain, flows
from chuteflow.checks import number, number_in, real_array, shorten, whole
from chuteflow.io.units import in_si
from chuteflow.stability.planes import family_map, wave_map

PAPER = Chute(0.3, 0.8, 0.8, 0.6)

NO_NUMBERS = {
    "truth": True,
    "numpy's truth": np.True_,
    "complex": complex(0.3, 5.0),
    "complex without imaginary part": complex(0.3),
    "numpy's complex": np.complex128(0.3),
    "complex array": np.array(0.3 + 0j),
    "text": "0.3",
    "numpy's text": np.str_("0.3"),
    "bytes": b"0.3",
    "none": None,
    "list": [0.3],
    "array": np.array([0.3]),
    "a large integer": 10**400,
    "a larger integer": -(10**5000),
    "not finite": float("inf"),
    "nan": np.float32("nan"),
    "object": object(),
}
NUMBERS = [0.5, np.float64(0.5), np.float32(0.5), np.array(0.5), Fraction(1, 2), Decimal("0.5"), np.longdouble(0.5)]


def listed(value: Any) -> Any:
    """A list in another one: that of one number is a list of conditions, which flows() takes."""
    return [value] if isinstance(value, list | np.ndarray) else value


@pytest.mark.parametrize("value", NO_NUMBERS.values(), ids=NO_NUMBERS)
def test_what_is_no_number_is_refused_in_one_line(value):
    asked = [
        lambda: Chute(value, 0.8, 0.8, 0.6),
        lambda: Chute(0.3, 0.8, value, 0.6),
        lambda: Chute.at_angle(value, restitution=0.8, wall_restitution=0.8, roughness=0.6),
        lambda: Scales(value, 2500.0),
        lambda: Scales(1e-3, 2500.0, gravity=value),
        lambda: whole("points", value, 0) if value is None else flows(PAPER, M=listed(value)),
        lambda: flows(PAPER, Q=3.0, tolerance=value),
        lambda: flows(PAPER, Q=3.0, largest_holdup=value),
        lambda: flows(PAPER, Q=3.0, surface_temperature=(value, 1e3)),
        lambda: flows(PAPER, Q=3.0, surface_temperature=value),
        lambda: curve(PAPER, points=value),
        lambda: boundary(PAPER, bounds=(0.3, value)),
        lambda: boundary(PAPER, bounds=(0.3, 0.4), samples=value),
        lambda: domain(PAPER, ("slope", 0.3, value), ("roughness", 0.5, 0.6)),
        lambda: domain(PAPER, ("slope", 0.3, 0.4), ("roughness", 0.5, 0.6), size=(value, 4)),
        lambda: domain(PAPER, ("slope", 0.3, 0.4), ("roughness", 0.5, 0.6), size=value),
        lambda: domain(PAPER, ("slope", 0.3, 0.4), ("roughness", 0.5, 0.6), tolerance=value),
        lambda: domain(PAPER, ("slope", 0.3, 0.4), ("roughness", 0.5, 0.6), temperatures=(value,)),
        lambda: whole("points", value, 0, 30),
    ]
    for ask in asked:
        with pytest.raises(InputError) as caught:
            ask()
        assert len(str(caught.value).splitlines()) == 1
        assert len(str(caught.value)) < 300


@pytest.mark.parametrize("value", NUMBERS, ids=lambda value: type(value).__name__)
def test_a_number_of_any_kind_is_a_float(value):
    chute = Chute(value, 0.8, 0.8, 0.6)
    assert chute == Chute(0.5, 0.8, 0.8, 0.6)
    assert type(chute.slope) is float
    assert type(Scales(value, 2500.0).diameter) is float
    assert [f.mass_holdup for f in flows(PAPER, Q=value)] == [f.mass_holdup for f in flows(PAPER, Q=0.5)]


def test_whole_numbers():
    for value in (20, 20.0, np.int64(20), np.uint8(20), np.float32(20), Fraction(20)):
        assert whole("points", value, 2, 30) == 20
        assert type(whole("points", value, 2, 30)) is int
    for value in (20.5, 31, 1, "20"):
        with pytest.raises(InputError, match=r"points = .*20\.5|points = .*: must be"):
            whole("points", value, 2, 30)


def test_heights_of_a_profile():
    flow = flows(PAPER, Q=3.0)[0]
    with pytest.raises(InputError, match="points = '20': must be a whole number"):
        flow.sampled("20")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="points = '20': must be a whole number"):
        in_si(flow, Scales(1e-3, 2500.0)).profile(points="20")  # pyright: ignore[reportArgumentType]
    for z in ("1", ["1", "2"], 1j, [True], [[1.0], [1.0, 2.0]], [None]):
        with pytest.raises(InputError, match=r"z = .*: must be an array of numbers"):
            flow.profile(z)  # pyright: ignore[reportArgumentType]
    assert flow.profile([0, 1]).height.tolist() == [0.0, 1.0]


def test_maps_of_growth():
    found = flows(PAPER, Q=3.0)
    with pytest.raises(InputError, match="size"):
        wave_map(found[0], size=("4", 4))  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="angle = '0'"):
        family_map(list(found), angle="0", size=(4, 4))  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="depth_wavenumber = 3"):
        family_map(list(found), angle=0.0, depth_wavenumber=3, size=(4, 4))  # pyright: ignore[reportArgumentType]


def test_what_was_given_is_shown_on_one_line():
    assert shorten(10**5000) == "an integer of 16610 bits"
    assert "\n" not in shorten("a\nb" * 1000)
    assert len(shorten("a\nb" * 1000)) < 80
    assert shorten(0.5) == "0.5"


def test_numbers_that_come_as_text():
    assert number_in("x", " 3e-1 ", 0.0, 1.0) == 0.3
    for text, said in (
        ("", "''"),
        ("three", "'three'"),
        ("1+2j", "'1+2j'"),
        ("inf", "inf"),
        ("nan", "nan"),
        ("2", "2"),
    ):
        with pytest.raises(InputError, match=rf"^x = {re.escape(said)}: must be .*from 0 to 1$"):
            number_in("x", text, 0.0, 1.0)


def test_what_cannot_be_printed_is_shown():
    nested: list[object] = []
    for _ in range(10_000):
        nested = [nested]
    assert shorten(nested) == "a list"
    assert shorten([10**5000]) == "a list"


def test_ranges_are_told():
    with pytest.raises(InputError, match=r"^x = 3: must be from 0 to 1$"):
        number("x", 3, 0.0, 1.0)
    with pytest.raises(InputError, match=r"^x = 'a': must be a number from 0 to 1$"):
        number("x", "a", 0.0, 1.0)
    assert real_array("x", []).tolist() == []
