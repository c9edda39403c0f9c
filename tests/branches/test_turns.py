"""Turning points along a branch: exact derivatives, pairs just past a cusp, and what is said next to a fold."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from chuteflow import Chute, SolveError, curve, flows
from chuteflow.branches import solution_branches
from chuteflow.branches.paths import Chord, locate_turning_points
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.rough_turns import find_extrema
from chuteflow.branches.solution_branches import trace_branches
from chuteflow.parameters import LARGEST_HOLDUP, SURFACE_TEMPERATURE
from chuteflow.steady.collocation import LOG_H, LOG_Q, LOG_T
from chuteflow.steady.model import model

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
#: Two folds in Q meet here: three flows of a flux become one.
CUSP = 0.3629916485
FOLDS = {1e-5: (897.18333, 897.193459), 3e-5: (899.026048, 899.078891), 1e-3: (991.68551, 1004.12061)}


def branches(chute):
    within = SearchRange.checked(SURFACE_TEMPERATURE, LARGEST_HOLDUP, chute.surface)
    return trace_branches(model(chute), within)


def reached(chord, sigma):
    point = chord.at(sigma)
    assert point is not None
    return point


def folds(chute, kind, **given):
    found = [s.flow for branch in curve(chute, **given).branches for s in branch.special if s.kind == kind]
    return sorted(found, key=lambda flow: flow.mass_flux)


@pytest.mark.parametrize("surface", ["free", "interface"])
def test_tangents_of_a_branch_are_those_of_its_flows(surface):
    (branch,) = branches(replace(PAPER, surface=surface))
    for first, last in list(pairwise(branch.points))[3:-4:4]:
        chord = Chord(first, last)
        middle, one, other = (reached(chord, sigma) for sigma in (0.5, 0.499, 0.501))
        np.testing.assert_allclose(chord.slope(middle), (other.m - one.m) / 2e-3, atol=1e-6)
        assert np.linalg.norm(middle.tangent) == pytest.approx(1.0, abs=1e-12)


def test_turns_of_all_four_quantities_are_extrema():
    (branch,) = branches(Chute(0.3, 0.9, 0.6, 0.8))
    found = [turn for which in range(4) for turn in branch.turns(which, 1e-10)]
    assert [turn.which for turn in found] == [0, 1, 2, 3]
    for turn in found:
        i = int(turn.place)
        chord = Chord(branch.points[i], branch.points[i + 1])
        values = [reached(chord, turn.place - i + step).m[turn.which] for step in (-0.02, -0.01, 0.01, 0.02)]
        off = np.array(values) - turn.point.m[turn.which]
        assert (np.sign(off) == np.sign(off[0])).all()
        assert off[0] / off[1] == pytest.approx(4.0, rel=0.1)
        assert off[3] / off[2] == pytest.approx(4.0, rel=0.1)


def test_two_folds_between_two_flows_are_seen():
    (branch,) = branches(Chute(CUSP + 1e-5, 0.8, 0.8, 0.6))
    found = [turn for turn in branch.turns(LOG_Q, 1e-10) if turn.point.m[LOG_Q] > np.log(500.0)]
    assert len(found) == 2
    assert int(found[0].place) == int(found[1].place)
    fluxes = sorted(np.exp(turn.point.m[LOG_Q]) for turn in found)
    assert fluxes == pytest.approx(FOLDS[1e-5], abs=2e-6)


def test_two_folds_far_between_two_flows_are_seen():
    # The chord is long, and the folds are far from its ends and from its middle.
    (branch,) = branches(Chute(CUSP + 1e-4, 0.8, 0.8, 0.6))
    every = branch.points
    found = [turn for turn in branch.turns(LOG_Q, 1e-10) if turn.point.m[LOG_Q] > np.log(500.0)]
    low, high = (int(turn.place) for turn in found)
    for wide in (1, 2):
        assert len(locate_turning_points([every[low - wide], every[high + 1 + wide]], LOG_Q)) == 2


@pytest.mark.parametrize(("beyond", "expected"), FOLDS.items())
def test_folds_do_not_depend_on_the_points_of_the_curve(beyond, expected):
    for points in (2, 10, 30):
        found = folds(Chute(CUSP + beyond, 0.8, 0.8, 0.6), "fold-Q", points=points)
        assert [flow.mass_flux for flow in found[1:]] == pytest.approx(expected, rel=2e-8), points


@pytest.mark.slow
def test_special_points_are_the_same_for_ten_points_and_for_four_thousand():
    for chute in (PAPER, Chute(CUSP + 1e-5, 0.8, 0.8, 0.6), Chute(0.29, 0.9, 0.8, 0.7), Chute(0.3, 0.9, 0.6, 0.8)):
        for few, many in zip(curve(chute, points=10).branches, curve(chute, points=4000).branches, strict=True):
            assert [s.kind for s in few.special] == [s.kind for s in many.special]
            for one, other in zip(few.special, many.special, strict=True):
                assert one.flow.mass_flux == pytest.approx(other.flow.mass_flux, rel=1e-8)
                # The position is that of the flow just before it.
                for point, branch in ((one, few), (other, many)):
                    mass = np.log(branch.mass_holdup / point.flow.mass_holdup)
                    log_temperature = np.log(branch.surface_temperature / point.flow.surface_temperature)
                    assert np.argmin(np.hypot(mass, log_temperature)) - point.position in (0, 1)


def test_four_flows_of_one_flux_between_two_folds_past_a_cusp():
    found = flows(Chute(0.3630916485143, 0.8, 0.8, 0.6), Q=905.627)
    assert [flow.mass_holdup for flow in found] == pytest.approx(
        [1.2321960, 7.8437031, 7.87705133, 7.91270504], rel=1e-7
    )
    assert [flow.surface_temperature for flow in found[2:]] == pytest.approx([0.78715584, 0.63827869], rel=1e-7)
    for flow in found:
        assert flow.mass_flux == pytest.approx(905.627, rel=1e-11)


def test_just_past_a_cusp_flows_are_counted_on_both_sides_of_both_folds():
    chute = Chute(CUSP + 1e-5, 0.8, 0.8, 0.6)
    low, high = (flow.mass_flux for flow in folds(chute, "fold-Q", points=10)[1:])
    gap = high - low
    for flux, expected in ((low - 0.1 * gap, 2), (low + 0.1 * gap, 4), (high - 0.1 * gap, 4), (high + 0.1 * gap, 2)):
        assert len(flows(chute, Q=flux)) == expected


def test_a_search_that_starts_at_a_fold_finds_both_flows():
    chute = Chute(0.2235282153342192, 0.9211854930464662, 0.8044288256031973, 0.6997605976034021)
    found = flows(chute, T_surface=0.161)
    assert [flow.mass_holdup for flow in found] == pytest.approx([0.20658356, 0.23873600], rel=1e-7)


@pytest.mark.parametrize("side", [0, 1])
def test_next_to_a_fold_every_flow_has_an_honest_error(side):
    fold = folds(PAPER, "fold-Q", surface_temperature=(0.01, 500.0), points=10)[side]
    inward = -1.0 if side else 1.0
    (far,) = flows(PAPER, Q=fold.mass_flux * (1.0 - 1e-6 * inward))
    for apart in (0.0, 1e-15, 1e-13, 3e-13, 1e-12, 1e-11, 1e-10):
        found = flows(PAPER, Q=fold.mass_flux * (1.0 + apart * inward))
        near = [flow for flow in found if abs(flow.mass_holdup - fold.mass_holdup) < 0.1 * fold.mass_holdup]
        assert 1 <= len(near) <= 2
        assert len(near) == 2 or apart < 1e-12
        assert len(found) == len(near) + 1
        (other,) = (flow for flow in found if flow not in near)
        assert other.mass_holdup == pytest.approx(far.mass_holdup, rel=1e-5)
        # The two flows move apart with the root of the distance: where they are is known to their errors.
        a_little_off = flows(PAPER, Q=fold.mass_flux * (1.0 + 1e-6 * inward))
        beside = [flow.mass_holdup / fold.mass_holdup - 1.0 for flow in a_little_off]
        scale = max(abs(off) for off in beside if abs(off) < 0.1)
        for flow in near:
            off = abs(abs(flow.mass_holdup / fold.mass_holdup - 1.0) - scale * np.sqrt(apart / 1e-6))
            assert off <= 1.5 * flow.error + 2e-3 * scale * np.sqrt(apart / 1e-6) + 2e-8
            assert flow.error < 1e-4


def test_beyond_a_fold_by_more_than_its_error_there_is_no_flow_of_it():
    low, high = folds(PAPER, "fold-Q", surface_temperature=(0.01, 500.0), points=10)
    assert len(flows(PAPER, Q=low.mass_flux * (1.0 - 1e-9))) == 1
    assert len(flows(PAPER, Q=high.mass_flux * (1.0 + 1e-9))) == 1


def test_turns_that_rounding_makes_are_none():
    # A deep branch along which the surface temperature is the same to ten digits.
    chute = Chute(0.4191510618260981, 0.7559395567904552, 0.6770602401681308, 0.5726889224411995)
    (branch,) = branches(chute)
    assert np.ptp(branch.macroscopic[-4:, LOG_T]) < 1e-8
    assert locate_turning_points(branch.points[-6:], LOG_T) == []


def test_a_dip_between_two_points_is_seen_with_its_zeros():
    place = np.array([-1.5, -0.7, 0.4, 1.2])
    (dip,) = find_extrema(place**2 - 0.09, place)
    assert dip.step == 1
    assert dip.value < 0.0
    zeros = [place[1] + share * (place[2] - place[1]) for share in dip.zeros]
    assert zeros == pytest.approx([-0.3, 0.3], abs=0.1)
    assert [dip.zeros for dip in find_extrema(place**2 + 0.3, place)] == [()]


def test_the_centre_of_mass_may_turn_too():
    chute = Chute(CUSP + 1e-5, 0.8, 0.8, 0.6)
    (branch,) = branches(chute)
    height = branch.turns(LOG_H, 1e-10)[0].point.m[LOG_H]
    counts = [len(flows(chute, h=float(np.exp(height + off)))) for off in (-1e-6, 1e-6)]
    assert abs(counts[0] - counts[1]) == 2


def test_flows_on_both_sides_of_a_turn_that_rough_flows_put_elsewhere():
    # Near T = 0.002 the branch turns in T and in M, and the search puts both off by some percent.
    chute = Chute(0.21884608899147887, 0.7105722342588351, 0.8714688629490833, 0.7447321261344501)
    found = flows(chute, M=3.860619404685411e-05)
    assert [flow.surface_temperature for flow in found] == pytest.approx([0.0020203051, 0.0019865979], rel=1e-6)


def test_a_flow_between_the_edge_of_the_range_and_a_rough_end_is_not_lost():
    # Q turns at T = 0.00103567; the range ends at 0.001, and the rough end of the branch lies a percent inside it.
    chute = Chute(0.1980454992720526, 0.8295696341995824, 0.5950206565393283, 0.5242155716627819, surface="interface")
    found = flows(chute, Q=5.079250231686532e-05)
    assert [flow.surface_temperature for flow in found] == pytest.approx([0.0010596683, 0.0010142], rel=4e-3)
    assert all(flow.mass_flux == pytest.approx(5.079250231686532e-05, rel=1e-9) for flow in found)


#: Two branches of this chute meet in a fold that the search sees 1 % away, on a wall that is nearly smooth.
MERGING = Chute(0.37, 0.8, 0.8, 0.6, base="johnson-jackson:specularity=0.1")


@pytest.mark.parametrize("mass", [14.6, 14.7, 14.77])
def test_flows_between_the_fold_that_the_search_saw_and_the_fold_are_found(mass):
    found = flows(MERGING, M=mass)
    assert len(found) == 2
    assert found.incomplete is None
    assert found[0].mass_flux > found[1].mass_flux > 3300.0


def test_a_curve_is_followed_around_a_fold_that_the_search_saw_elsewhere():
    found = curve(MERGING, points=30)
    assert found.incomplete is None
    (branch,) = found.branches
    folds = [p.flow.mass_holdup for p in branch.special if p.kind == "fold-M" and p.flow.surface_temperature > 1.0]
    assert folds == pytest.approx([14.78276044], rel=1e-8)


def test_a_branch_that_cannot_be_solved_near_the_value_is_told(monkeypatch):
    def fail(*_):
        raise SolveError("no")

    monkeypatch.setattr(solution_branches, "refine_path", fail)
    found = flows(MERGING, M=14.7)
    assert not found.flows
    assert found.incomplete is not None
    assert "could not be followed near M = 14.6" in found.incomplete


def test_a_short_piece_beside_a_branch_is_traced_once():
    chute = Chute(
        0.46323691751787266, 0.6662771445329538, 0.7099059862043923, 0.7438541675524014,
        surface="interface", closure="jenkins-berzi",
    )  # fmt: skip
    found = curve(chute, points=30)
    assert len(found.branches) == 2
    assert found.incomplete is None
