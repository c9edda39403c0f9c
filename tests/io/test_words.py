"""What is said of flows, chutes and curves, and how tables are set."""

from functools import cache
from itertools import pairwise

import pytest

from chuteflow import Chute, Scales, curve, flows
from chuteflow.io import tables, words

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
GRAINS = Scales(1e-3, 2500.0)


@cache
def paper_curve():
    return curve(PAPER, points=50)


def test_three_flows_have_names_of_their_own():
    found = flows(PAPER, Q=3.0)
    names = ["hot, dilute, deep", "warm, moderately dense", "cold, dense, shallow"]
    assert [words.among(flow, found) for flow in found] == names
    assert [flow.name for flow in found] == names
    (alone,) = flows(PAPER, Q=8.0)
    assert words.among(alone, [alone]) == alone.name == "hot, dilute, deep"


def test_a_flow_is_called_the_same_among_any_others():
    # Of these two the second was called cold, dense and shallow, though it is hotter than the hot one above.
    found = flows(Chute(0.36, 0.8, 0.8, 0.6), Q=60.0)
    assert [flow.name for flow in found] == ["hot, dilute, deep"] * 2
    assert [words.among(flow, found) for flow in found] == ["hot, dilute, deep (1 of 2)", "hot, dilute, deep (2 of 2)"]
    assert words.among(found[1], found[1:]) == "hot, dilute, deep"


def test_names_of_the_flows_of_many_chutes_do_not_contradict_their_numbers():
    chutes = [Chute(slope, 0.8, 0.8, 0.6) for slope in (0.25, 0.3, 0.33, 0.36)]
    chutes += [Chute(0.4, 0.9, 0.6, 0.8), Chute(0.3, 0.8, 0.8, 0.6, surface="interface")]
    met = [flow for one in chutes for branch in curve(one, points=25).branches for flow in branch.flows]
    said = {word for flow in met for word in flow.name.split(", ")}
    assert {"hot", "warm", "cold", "dilute", "moderately dense", "dense", "deep", "shallow"} == said
    for order, name in (
        (("cold", "warm", "hot"), "surface_temperature"),
        (("dilute", "moderately dense", "dense"), "largest_volume_fraction"),
        (("shallow", "deep"), "centre_of_mass"),
    ):
        groups = [[getattr(flow, name) for flow in met if word in flow.name.split(", ")] for word in order]
        for lower, higher in pairwise(groups):
            assert max(lower) < min(higher)


def test_notes_explain_what_the_table_shows():
    found = flows(PAPER, Q=3.0)
    depth, speeds, *others = words.notes(found)
    assert speeds.startswith("U: Q/M; Fr: ")
    assert depth.startswith("depth: the height above which nu is below 1 % of nu_max")
    assert [note.split(":")[0] for note in others] == ["large slip", "rarefied"]
    (dense,) = flows(PAPER, T_surface=0.01)
    assert [note.split(":")[0] for note in words.notes([dense])[2:]] == ["dense", "large slip"]


def test_the_stretches_of_a_curve_have_their_validity():
    said = list(words.validity(paper_curve().branches[0].flows, PAPER, None))
    assert said[0].startswith("from T_surface = 1e+05 to ")
    assert said[0].endswith(": large slip, rarefied")
    assert said[-1].endswith("to 0.001: packed: beyond the theory, large slip")


def test_kinds_are_said_in_words():
    hot, _, cold = flows(PAPER, Q=3.0)
    assert "(monotonic)" in words.kinds(hot)
    assert "(density inverted)" in words.kinds(cold)
    assert "interior dissipative throughout" in words.kinds(cold)
    (productive,) = flows(Chute(0.42, 0.9, 0.6, 0.8), Q=3.0)
    assert "interior productive throughout" in words.kinds(productive)


def test_flows_that_share_a_flux_are_counted():
    said = words.multiplicity(paper_curve(), None)
    low, high = sorted(p.flow.mass_flux for p in paper_curve().branches[0].special if p.kind == "fold-Q")
    assert f"1 for Q from 0.23541 to {low:.5g}, 3 for Q from {low:.5g} to {high:.5g}, 1 for" in said
    for flux, count in ((0.9 * low, 1), (0.5 * (low + high), 3), (1.1 * high, 1)):
        assert len(flows(PAPER, Q=flux)) == count


def test_ranges_carry_their_units():
    assert words.searched(paper_curve().searched, PAPER, None) == "searched: T_surface from 0.001 to 1e+05, M up to 30"
    said = words.searched(paper_curve().searched, PAPER, GRAINS)
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
