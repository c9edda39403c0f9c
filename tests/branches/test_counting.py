"""How many flows share a flux, and where that is not known."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner

from chuteflow import Chute, curve, flows, load, save
from chuteflow.branches.counting import flux_counts
from chuteflow.branches.ranges import BranchEnd
from chuteflow.branches.results import FlowSet
from chuteflow.cli.commands.curve import command as curve_command
from chuteflow.cli.commands.solve import command as solve_command
from chuteflow.io import contract, words

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
TUTORIAL = Chute(float(np.tan(np.radians(17.0))), 0.85, 0.75, 0.65)
RANGE = (0.01, 1000.0)
OPTIONS = ["--angle", "17", "--e", "0.85", "--ew", "0.75", "--roughness", "0.65", "--search-temperature", "0.01:1000"]
#: A deep branch of this chute leaves every range of hold-ups.
DEEP = Chute(0.3691297871800166, 0.8208947903273185, 0.6447144070112137, 0.8491400006337181)


def test_a_count_says_where_a_branch_leaves_the_range():
    counts = flux_counts(curve(TUTORIAL, surface_temperature=RANGE, points=20))
    assert [(count.flows, count.at_least) for count in counts] == [
        (0, True),
        (1, False),
        (3, False),
        (2, True),
        (0, True),
    ]
    assert counts[0].low == 0.0
    assert counts[-1].high == np.inf
    assert [round(count.high, 3) for count in counts[2:4]] == [19.146, 27.844]
    for before, after in pairwise(counts):
        assert before.high == after.low


def test_counts_hold_for_the_flows_of_one_flux():
    counts = flux_counts(curve(TUTORIAL, surface_temperature=RANGE, points=20))
    for count in counts[1:-1]:
        found = flows(TUTORIAL, Q=0.5 * (count.low + count.high), surface_temperature=RANGE)
        assert len(found) >= count.flows
        assert len(found) == count.flows or count.at_least
    assert len(flows(TUTORIAL, Q=25.0, surface_temperature=RANGE)) == 3


def test_a_branch_that_ends_for_good_leaves_nothing_open():
    found = curve(TUTORIAL, surface_temperature=RANGE, points=20)
    (branch,) = found.branches
    ended = replace(found, branches=(replace(branch, ends=(BranchEnd.CLOSED, BranchEnd.VANISHES)),))
    assert not any(count.at_least for count in flux_counts(ended))
    assert words.multiplicity(ended, None).endswith("2 for Q from 19.146 to 27.844")


def test_text_and_json_say_the_same():
    result = CliRunner().invoke(curve_command, [*OPTIONS, "--points", "20"])
    assert result.exit_code == 0
    assert "3 for Q from 2.2958 to 19.146, at least 2 for Q from 19.146 to 27.844" in result.output
    assert "not known for Q below 1.0043 and Q above 27.844, where branches leave the range searched" in result.output
    counts = contract.curve_object(curve(TUTORIAL, surface_temperature=RANGE, points=20))["counts"]
    assert counts[3] == pytest.approx({"Q_from": 19.146, "Q_to": 27.844, "flows": 2, "at_least": True}, abs=1e-3)
    assert counts[-1]["Q_to"] is None


def test_where_no_branch_leaves_nothing_is_said_of_it():
    found = curve(PAPER, points=20)
    counts = flux_counts(found)
    assert [count.at_least for count in counts] == [True, False, False, False, True]
    assert "at least" not in words.multiplicity(found, None)


def test_a_flux_to_which_a_branch_may_lead_is_not_called_complete(tmp_path):
    found = flows(DEEP, Q=1e5)
    assert found.incomplete == "a branch goes on to hold-ups above 30, outside the range searched"
    assert flows(PAPER, Q=3.0).incomplete is None
    assert flows(TUTORIAL, Q=25.0, surface_temperature=RANGE).incomplete is None
    save(found, tmp_path / "flows.json")
    loaded = load(tmp_path / "flows.json")
    assert isinstance(loaded, FlowSet)
    assert loaded.incomplete == found.incomplete
    assert contract.flow_set_object(found)["incomplete"] == found.incomplete


def test_solve_says_that_there_may_be_more():
    options = ["--slope", str(DEEP.slope), "--e", str(DEEP.restitution), "--ew", str(DEEP.wall_restitution)]
    result = CliRunner().invoke(solve_command, [*options, "--roughness", str(DEEP.roughness), "--flux", "1e5"])
    assert result.exit_code == 0
    assert "there may be more: a branch goes on to hold-ups above 30, outside the range searched" in result.output


def test_two_flows_beside_a_fold_are_found_where_the_first_and_last_rough_flows_lead_nowhere():
    chute = Chute(0.40847170317075593, 0.7569944039450864, 0.6230513469256415, 0.8343213599270958, surface="interface")
    pair = [f for f in flows(chute, Q=5084.14610269072) if 0.01 < f.surface_temperature < 0.1]
    assert [f.mass_holdup for f in pair] == pytest.approx([22.63645003, 22.64098017], rel=1e-9)
    assert [f.surface_temperature for f in pair] == pytest.approx([0.0485653639, 0.0443641143], rel=1e-8)


@pytest.mark.parametrize(("condition", "value"), [("Q", 7653.573889461369), ("M", 22.416297829409757)])
def test_flows_where_the_residual_is_near_to_zero_all_along_are_found(condition, value):
    """Beside the folds of two branches the signs of the residual are not known well enough to join what was seen."""
    chute = Chute(0.37141429564886336, 0.8023571956699849, 0.5399933535112227, 0.8100380660751175)
    found = flows(chute, **{condition: value})
    assert len(found) == 4
    assert found.incomplete is None


def test_flows_beside_a_fold_in_the_surface_temperature_that_the_search_saw_elsewhere_are_found():
    chute = Chute(0.3935197336569905, 0.7707341874124249, 0.5386050915592441, 0.7664872639067919)
    found = flows(chute, T_surface=1.8593081146840105)
    assert [f.mass_holdup for f in found] == pytest.approx([2.946825, 2.953381], rel=1e-6)
    assert abs(found[0].mass_holdup / found[1].mass_holdup - 1.0) > 1e-3


def test_flows_beside_a_fold_that_the_search_saw_three_percent_away_are_found():
    chute = Chute(0.2357558866569397, 0.9260824535899073, 0.6492970045856133, 0.5715986039755248)
    assert len(flows(chute, h=47.38846377607578)) == 5


def test_flows_that_were_found_in_a_range_are_kept_when_it_is_widened():
    chute = Chute(0.44793886974918284, 0.6856057331709164, 0.6319165062209413, 0.6507636112728579, surface="interface")
    found = flows(chute, Q=6425.7998944922265)
    assert found.searched.surface_temperature != (1e-3, 1e5)
    assert sum(f.mass_holdup > 17.0 for f in found) == 2
