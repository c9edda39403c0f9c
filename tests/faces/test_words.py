"""What is said of flows, chutes and curves, and how tables are set."""

import pytest

from chuteflow import Chute, Scales, curve, flows
from chuteflow.faces import tables, words

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
GRAINS = Scales(1e-3, 2500.0)
CURVE = curve(PAPER, points=50)


def test_three_flows_are_told_apart():
    found = flows(PAPER, Q=3.0)
    assert [words.among(flow, found) for flow in found] == ["hot, dilute, deep", "in between", "cold, dense, shallow"]


def test_flows_of_one_temperature_are_neither_hot_nor_cold():
    found = flows(Chute(0.3, 0.9, 0.6, 0.8), T_surface=1.0)
    assert [words.among(flow, found) for flow in found] == ["dilute, shallow", "dense, deep"]


def test_one_flow_is_compared_with_none():
    found = flows(PAPER, Q=8.0)
    assert [words.among(flow, found) for flow in found] == ["the only flow"]


def test_kinds_are_said_in_words():
    hot, _, cold = flows(PAPER, Q=3.0)
    assert "(monotonic)" in words.kinds(hot)
    assert "(density inverted)" in words.kinds(cold)
    assert "interior dissipative throughout" in words.kinds(cold)
    (productive,) = flows(Chute(0.42, 0.9, 0.6, 0.8), Q=3.0)
    assert "interior productive throughout" in words.kinds(productive)


def test_flows_that_share_a_flux_are_counted():
    said = words.multiplicity(CURVE, None)
    low, high = sorted(p.flow.mass_flux for p in CURVE.branches[0].special if p.kind == "fold-Q")
    assert f"1 for Q from 0.23541 to {low:.5g}, 3 for Q from {low:.5g} to {high:.5g}, 1 for" in said
    for flux, count in ((0.9 * low, 1), (0.5 * (low + high), 3), (1.1 * high, 1)):
        assert len(flows(PAPER, Q=flux)) == count


def test_ranges_carry_their_units():
    assert words.searched(CURVE.searched, PAPER, None) == "searched: T_surface from 0.001 to 1e+05, M up to 30"
    said = words.searched(CURVE.searched, PAPER, GRAINS)
    assert said.endswith("m^2/s^2, M up to 75 kg/m^2")


def test_numbers_have_five_digits():
    cells = [tables.number(value) for value in (7.338568375902412, 1e-12, 3.0, 123456.0, float("inf"))]
    assert cells == ["7.3386", "1e-12", "3", "1.2346e+05", "-"]


def test_columns_are_aligned():
    text = tables.table([["", "Q", "what"], ["a", "1", "first"], ["bb", "10.5", "2nd"]], words=(0, 2))
    assert text.splitlines() == ["       Q  what", "a      1  first", "bb  10.5  2nd"]


@pytest.mark.parametrize("scales", [None, GRAINS])
def test_headings_come_from_the_registry(scales):
    rows = tables.heading(["mass_flux", "centre_of_mass", "base_volume_fraction"], scales)
    assert rows[0] == ["Q", "h", "nu_base"]
    assert rows[1:] == ([["[kg/m/s]", "[m]", "[1]"]] if scales else [])
