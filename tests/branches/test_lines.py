"""A branch as one line: order, and where it is cut."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from chuteflow import Branch, Chute, SpecialPoint, curve
from chuteflow.branches.lines import in_order, runs

BRANCHES = {
    "one inversion": lambda: curve(Chute(0.3, 0.8, 0.8, 0.6), points=40).branches[0],
    "two inversions": lambda: curve(Chute(0.36, 0.8, 0.8, 0.85), points=60).branches[0],
    "monotonic": lambda: curve(Chute(0.25, 0.8, 0.8, 0.6), points=20).branches[0],
}


@cache
def branch_of(name):
    return BRANCHES[name]()


@pytest.mark.parametrize("name", BRANCHES)
def test_special_points_come_after_the_flow_before_them(name):
    branch = branch_of(name)
    found = list(in_order(branch))
    assert [point.flow for point in found if not point.special] == list(branch.flows)
    assert [(point.flow, point.special) for point in found if point.special] == [
        (special.flow, special.kind) for special in branch.special
    ]
    for special in branch.special:
        flows = [point.flow for point in found]
        before = flows.index(branch.flows[special.position])
        after = flows.index(branch.flows[special.position + 1])
        assert before < flows.index(special.flow) < after


@pytest.mark.parametrize(("name", "kinds"), [
    ("one inversion", ["monotonic", "inverted"]),
    ("two inversions", ["monotonic", "inverted", "monotonic"]),
    ("monotonic", ["monotonic"]),
])  # fmt: skip
def test_runs_are_of_one_kind_and_meet_at_the_onset(name, kinds):
    branch = branch_of(name)
    found = runs(branch)
    assert [run.density for run in found] == kinds
    for run in found:
        inner = [flow for flow in run.flows if flow in branch.flows]
        assert {flow.density for flow in inner} == {run.density}
    onsets = [special.flow for special in branch.special if special.kind == "density-inversion"]
    assert [run.flows[-1] for run in found[:-1]] == onsets
    assert all(before.flows[-1] is after.flows[0] for before, after in pairwise(found))
    assert found[0].flows[0] is branch.flows[0]
    assert found[-1].flows[-1] is branch.flows[-1]


def test_a_change_without_a_special_point_still_cuts():
    branch = branch_of("one inversion")
    bare = Branch(branch.flows, (), branch.ends)
    found = runs(bare)
    assert [run.density for run in found] == ["monotonic", "inverted"]
    assert found[0].flows[-1] is found[1].flows[0]


def test_a_special_point_before_a_fold_keeps_the_order_of_the_line():
    branch = branch_of("one inversion")
    middle = SpecialPoint("fold-Q", branch.flows[5], 4)
    found = [point.flow for point in in_order(Branch(branch.flows, (middle,), branch.ends))]
    fluxes = np.array([flow.mass_flux for flow in found])
    assert fluxes[5] == fluxes[6] == branch.mass_flux[5]
