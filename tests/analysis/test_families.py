"""Families: solved side by side they are what following them gives, and those of the last chutes are remembered."""

import numpy as np
import pytest

from chuteflow import Chute, curve, flows
from chuteflow.analysis.crossings import solved
from chuteflow.analysis.families import chains, families, traced_families
from chuteflow.analysis.ranges import LARGEST_HOLDUP, SURFACE_TEMPERATURE, Range
from chuteflow.analysis.tracing import solved_together, traced
from chuteflow.steady.flow import Flow, flows_of
from chuteflow.steady.model import model

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
#: Chutes whose families are whole, on both surfaces; of the last two the family turns back in temperature.
WHOLE = [
    PAPER,
    Chute(0.3, 0.8, 0.8, 0.6, surface="interface"),
    Chute(0.29, 0.729, 0.674, 0.534, surface="interface"),
    Chute(0.3222, 0.8171, 0.8206, 0.85),
    Chute(0.2221, 0.8763, 0.8288, 0.7075),
]


def searched(chute):
    within = Range.checked(SURFACE_TEMPERATURE, LARGEST_HOLDUP, chute.surface)
    return within, [scene.knots(chain) for scene, chain in chains(model(chute), within) if not chain.torn]


@pytest.mark.parametrize("chute", WHOLE)
def test_solved_side_by_side_a_family_is_the_one_that_is_followed(chute):
    within, found = searched(chute)
    assert found
    for knots in found:
        together = solved_together(knots, within)
        assert together is not None
        start, ahead = solved(knots, len(knots) // 2)
        followed = traced(start, ahead, within)
        ends, others = ([(tuple(t.macroscopic[i]), t.ends[i]) for i in (0, -1)] for t in (together, followed))
        for (one, words), (other, same) in zip(sorted(ends), sorted(others), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-6)
            assert words == same
        assert all(followed.holds(solution) for solution in together.solutions)
        assert max(solution.error for solution in together.solutions) <= 1e-8


def test_what_ends_inside_the_range_or_strays_is_not_solved_side_by_side():
    within, (knots,) = searched(PAPER)
    assert solved_together(knots[10:-10], within) is None
    assert solved_together(knots[:2], within) is None
    gap = [*knots[: len(knots) // 3], *knots[-len(knots) // 3 :]]
    assert solved_together(gap, within) is None


def test_a_piece_torn_off_that_leads_nowhere_is_of_the_family_that_passes_there():
    chute = Chute(0.5434225512790919, 0.7005437569942514, 0.9230351569159698, 0.8462493049634314)
    within = Range.checked(SURFACE_TEMPERATURE, LARGEST_HOLDUP)
    pieces = [scene.knots(chain) for scene, chain in chains(model(chute), within)]
    assert any(not solved(knots, i)[0].converged for knots in pieces for i in range(len(knots)) if len(knots) == 1)
    (family,) = traced_families(model(chute), within)
    assert all(family.passes(knots) for knots in pieces)
    (hot,) = traced_families(model(PAPER), within)
    assert not hot.passes(pieces[0])


def test_the_families_of_the_last_chutes_are_remembered():
    within = Range.checked(SURFACE_TEMPERATURE, LARGEST_HOLDUP)
    assert families(model(PAPER), within) is families(model(PAPER), within)
    first = [flow.solution.z for flow in flows(PAPER, Q=3.0)]
    families.cache_clear()
    chains.cache_clear()
    for z, flow in zip(first, flows(PAPER, Q=3.0), strict=True):
        np.testing.assert_array_equal(z, flow.solution.z)


def test_kinds_told_side_by_side_are_those_of_each_flow_alone():
    (branch,) = curve(Chute(0.3, 0.8, 0.8, 0.6, surface="interface"), points=40).branches
    together = flows_of(branch.flows[0].chute, [flow.solution for flow in branch.flows])
    assert len({flow.solution.problem.degree for flow in together}) > 1
    for one, other in zip(together, branch.flows, strict=True):
        alone = Flow(other.chute, other.solution)
        assert one.density_excess == pytest.approx(alone.density_excess, rel=1e-12, abs=1e-12)
        assert one.net_loss_range == pytest.approx(alone.net_loss_range, rel=1e-11)
