from functools import cache

import numpy as np
import pytest

from chuteflow import Chute, InputError, Scales, flows
from chuteflow.amounts import read_si
from chuteflow.io.units import in_si, read_amount

GRAINS = Scales(diameter=2e-3, density=2500.0)


@cache
def flow():
    return flows(Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)[0]


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.001", "m", 1e-3),
        ("1 mm", "m", 1e-3),
        ("1mm", "m", 1e-3),
        ("2.5 g/cm^3", "kg/m^3", 2500.0),
        ("2500 kg/m**3", "kg/m^3", 2500.0),
        ("981 cm/s^2", "m/s^2", 9.81),
    ],
)
def test_amounts_are_read(text, unit, value):
    assert read_si("--diameter", text, unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", ["", "mm", "1 parsnip", "1 s", "one mm", "1 m; 2", "1e999 m", "__import__('os')"])
def test_what_is_no_length_is_refused(text):
    with pytest.raises(InputError) as caught:
        read_si("--diameter", text, "m")
    assert str(caught.value).startswith(f"--diameter {text!r}: ")
    assert "\n" not in str(caught.value)


def test_an_amount_with_a_unit_is_made_dimensionless():
    kilograms = 3.0 * GRAINS.factor("mass_flux", 0.3)
    assert read_amount("--flux", f"{kilograms!r} kg/m/s", "mass_flux", GRAINS, 0.3) == pytest.approx(3.0)
    assert read_amount("--flux", "3", "mass_flux", GRAINS, 0.3) == 3.0
    with pytest.raises(InputError, match="a unit needs the grains"):
        read_amount("--flux", "3 kg/m/s", "mass_flux", None, 0.3)


def test_grains_are_given_with_units():
    assert Scales("2 mm", "2.5 g/cm^3").diameter == pytest.approx(2e-3, rel=1e-12)
    assert Scales("2 mm", 2500) == GRAINS
    for wrong, message in (
        ({"diameter": "2 s"}, "'s' is not a unit like m"),
        ({"diameter": "2"}, "must be a number, in m, or a text with a unit"),
        ({"diameter": "0 mm"}, "must be a positive number"),
    ):
        with pytest.raises(InputError, match=message):
            Scales(**{"density": 2500.0, **wrong})


def test_an_amount_in_si_units_is_made_dimensionless_in_python():
    factor = GRAINS.factor("mass_flux", 0.3)
    assert GRAINS.dimensionless("mass_flux", 0.5, 0.3) == pytest.approx(0.5 / factor)
    assert GRAINS.dimensionless("mass_flux", "500 g/m/s", 0.3) == pytest.approx(0.5 / factor)
    assert GRAINS.dimensionless("mass_flux", "2e-4 m^2/s", 0.3) == pytest.approx(0.5 / factor)
    for amount in ("0.5 kg", "much", True):
        with pytest.raises(InputError, match="mass_flux"):
            GRAINS.dimensionless("mass_flux", amount, 0.3)
    with pytest.raises(InputError, match="slope = "):
        GRAINS.factor("mass_flux", Chute(0.3, 0.8, 0.8, 0.6))  # pyright: ignore[reportArgumentType]


def test_a_flow_in_si_units_by_hand():
    numbers = in_si(flow(), GRAINS).numbers
    g_cos = 9.81 * np.cos(np.arctan(0.3))
    assert numbers["mass_flux"].check("[mass]/[length]/[time]")
    assert numbers["mass_flux"].m_as("g/cm/s") == pytest.approx(3.0 * 2500 * 2e-3 * np.sqrt(g_cos * 2e-3) * 10)
    assert numbers["centre_of_mass"].m_as("mm") == pytest.approx(2.0 * flow().centre_of_mass)
    assert numbers["surface_temperature"].m_as("m^2/s^2") == pytest.approx(flow().surface_temperature * g_cos * 2e-3)
    assert numbers["base_volume_fraction"].m_as("") == flow().base_volume_fraction


def test_profiles_in_si_units():
    si = in_si(flow(), GRAINS)
    profile = si.profile(points=11)
    wanted = flow().sampled(11)
    assert profile["height"].m_as("mm")[-1] == pytest.approx(2.0 * flow().depth)
    assert profile["production"].check("[mass]/[length]/[time]**3")
    np.testing.assert_allclose(
        profile["velocity"].m_as("m/s"), wanted.velocity * GRAINS.factor("velocity", 0.3), rtol=1e-12
    )
    at = si.profile([0.0, 4e-3])
    np.testing.assert_allclose(at["volume_fraction"].m_as(""), flow().profile([0.0, 2.0]).volume_fraction, rtol=1e-12)
