"""Curves: complete branches, located special points, independence of the path."""

import numpy as np
import pytest

from chuteflow import Chute, InputError, SolveError, curve, flows
from chuteflow.branches import solution_branches
from chuteflow.branches.ranges import BranchEnd
from chuteflow.steady.collocation import LOG_M

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
RANGE = (0.01, 500.0)


def special(branch, kind):
    return [s.flow for s in branch.special if s.kind == kind]


def test_the_curve_of_the_paper():
    result = curve(PAPER, surface_temperature=RANGE)
    (branch,) = result.branches
    assert len(branch.flows) == 200
    assert branch.surface_temperature[0] == pytest.approx(500.0)
    assert branch.surface_temperature[-1] == pytest.approx(0.01)
    low, high = sorted(f.mass_flux for f in special(branch, "fold-Q"))
    assert 2.7 < low < 3.0 < high < 5.1
    assert special(branch, "fold-M") == special(branch, "fold-T") == []
    assert len(special(branch, "density-inversion")) == 1
    assert max(f.error for f in branch.flows) <= 1e-10
    assert "above 500" in branch.ends[0]
    assert "below 0.01" in branch.ends[1]


def test_folds_are_extrema_to_rounding():
    (branch,) = curve(PAPER, surface_temperature=RANGE).branches
    for fold in special(branch, "fold-Q"):
        t = fold.surface_temperature
        beside = [
            min(flows(PAPER, T_surface=t * factor), key=lambda f: abs(f.mass_holdup - fold.mass_holdup))
            for factor in (0.99, 0.999, 1.001, 1.01)
        ]
        off = np.array([f.mass_flux for f in beside]) / fold.mass_flux - 1.0
        assert (np.sign(off) == np.sign(off[0])).all()
        # an extremum: the distance grows with the square
        assert off[0] / off[1] == pytest.approx(100.0, rel=0.1)
        assert off[3] / off[2] == pytest.approx(100.0, rel=0.1)


def test_special_points_do_not_depend_on_the_points_of_the_curve():
    coarse = curve(PAPER, surface_temperature=RANGE, points=60)
    fine = curve(PAPER, surface_temperature=RANGE, points=300)
    pairs = zip(coarse.branches[0].special, fine.branches[0].special, strict=True)
    for a, b in pairs:
        assert a.kind == b.kind
        assert a.flow.surface_temperature == pytest.approx(b.flow.surface_temperature, rel=1e-7)
        assert a.flow.mass_flux == pytest.approx(b.flow.mass_flux, rel=1e-9)


def test_the_onset_of_inversion_is_where_the_density_is_flat_at_the_base():
    (branch,) = curve(PAPER, surface_temperature=RANGE).branches
    (onset,) = special(branch, "density-inversion")
    z = np.array([0.0, 1e-3])
    nu = onset.profile(z).volume_fraction
    assert (nu[1] - nu[0]) / 1e-3 == pytest.approx(0.0, abs=1e-4)
    kinds = [flow.density for flow in branch.flows]
    change = kinds.index("inverted")
    assert kinds == ["monotonic"] * change + ["inverted"] * (len(kinds) - change)


def test_folds_in_every_quantity_and_a_change_of_interior():
    (branch,) = curve(Chute(0.3, 0.9, 0.6, 0.8), surface_temperature=RANGE).branches
    assert len(special(branch, "fold-T")) == 1
    assert len(special(branch, "fold-M")) == 1
    assert len(special(branch, "fold-Q")) == 1
    assert all("hold-ups above 30" in end for end in branch.ends)


def test_every_flow_at_a_flux_is_on_the_curve_and_the_other_way_round():
    for chute in (PAPER, Chute(0.27, 0.9, 0.8, 0.7), Chute(0.36, 0.8, 0.8, 0.85), Chute(0.34, 0.8, 0.8, 0.6)):
        result = curve(chute, surface_temperature=RANGE)
        for flux in (0.7, 3.0, 20.0):
            crossings = sum(int(np.sum(np.diff(np.sign(branch.mass_flux - flux)) != 0)) for branch in result.branches)
            found = [f for f in flows(chute, Q=flux) if RANGE[0] <= f.surface_temperature <= RANGE[1]]
            assert len(found) == crossings


def test_several_families():
    result = curve(Chute(0.29, 0.9, 0.8, 0.7), surface_temperature=(1e-3, 1e5))
    assert len(result.branches) == 3
    for branch in result.branches:
        assert np.isfinite(branch.mass_flux).all()
        assert (np.diff(np.log(branch.mass_holdup)) != 0.0).all()


def test_a_deep_family_between_two_columns_of_the_search_is_seen_with_its_turns():
    # It lives between T = 2.731 and 2.749 alone, where trajectories part into cold and deep ones.
    chute = Chute(0.4, 0.8, 0.8, 0.834)
    _, deep = curve(chute).branches
    (narrow,) = curve(chute, surface_temperature=(2.6, 2.9)).branches
    assert deep.surface_temperature.max() == pytest.approx(narrow.surface_temperature.max(), rel=1e-8)
    for kind in ("fold-M", "fold-T"):
        (found,), (expected,) = special(deep, kind), special(narrow, kind)
        assert found.mass_holdup == pytest.approx(expected.mass_holdup, rel=1e-8)
        assert found.surface_temperature == pytest.approx(expected.surface_temperature, rel=1e-8)
    found = [f.mass_holdup for f in flows(chute, T_surface=2.74)]
    within = narrow.surface_temperature - 2.74
    assert len(found) == int(np.sum(np.diff(np.sign(within)) != 0)) == 2


@pytest.mark.slow
def test_a_family_that_the_finest_grid_hardly_resolves_is_one_family():
    chute = Chute(0.48942004601103606, 0.6744975382236548, 0.41699976506445435, 0.8428280523681839, "interface")
    branches = curve(chute, points=60, tolerance=1e-8).branches
    tops = sorted(branch.mass_holdup.min() for branch in branches)
    assert np.diff(np.log(tops)).min() > 1e-3


def test_a_steep_branch_is_followed_to_the_largest_holdup():
    result = curve(Chute(0.38, 0.8, 0.8, 0.6), largest_holdup=150, points=16)
    (branch,) = result.branches
    assert branch.ends == ("it goes on to surface temperatures above 100000", "it goes on to hold-ups above 150")
    assert branch.mass_holdup.max() == pytest.approx(150.0, rel=1e-9)
    assert max(flow.error for flow in branch.flows) <= 1e-9


def test_no_family_says_why():
    result = curve(Chute(0.2, 0.8, 0.8, 0.85))
    assert result.branches == ()
    assert result.reason is not None
    assert "both lose energy" in result.reason


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"points": 1}, "points = 1"),
        ({"tolerance": 0.5}, "tolerance"),
        ({"surface_temperature": (0.0, 1.0)}, "rise"),
    ],
)
def test_bad_input(given, message):
    with pytest.raises(InputError, match=message):
        curve(PAPER, **given)


def test_a_branch_that_is_lost_leaves_the_curve_incomplete(monkeypatch):
    refine = solution_branches.refine_path

    def lost(points, tolerance):
        if points[0].m[LOG_M] < 0.0 <= points[-1].m[LOG_M]:
            raise SolveError("no")
        return refine(points, tolerance)

    monkeypatch.setattr(solution_branches, "refine_path", lost)
    found = curve(PAPER, points=10)
    assert any(BranchEnd.of(end) is BranchEnd.LOST for branch in found.branches for end in branch.ends)
    assert str(found.incomplete).startswith("a branch could not be followed beyond M = 0.")
