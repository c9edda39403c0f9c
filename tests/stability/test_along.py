"""Stability marked along a curve: by a known verdict, and by the real one."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import chuteflow
from chuteflow.errors import InputError, SolveError
from chuteflow.stability import along
from chuteflow.stability.result import stability_of

PAPER = chuteflow.Chute(0.3, 0.8, 0.8, 0.6)


@pytest.fixture(scope="module")
def curve():
    return chuteflow.curve(PAPER, points=60, surface_temperature=(0.1, 20.0))


def verdict(flow, unknown_below=0.0):
    """Stable for surface temperatures from 1 to 2; unstable across above, along below."""
    T = flow.surface_temperature
    if unknown_below > T:
        raise SolveError("the finest grids do not resolve it")
    mode = SimpleNamespace(direction="across" if T > 1.5 else "along", growth=0.01)
    return SimpleNamespace(stable=1.0 < T < 2.0, mode=mode)


def test_changes_are_located_between_samples_and_stand_among_the_special_points(curve, monkeypatch):
    monkeypatch.setattr(along, "stability_of", verdict)
    shares = []
    found = along.mark_stability(curve, samples=12, progress=shares.append)
    (branch,) = found.branches
    changes = [point for point in found.curve.branches[0].special if point.kind == "stability-change"]
    # to 1/128 of the gap between two samples
    assert [point.flow.surface_temperature for point in changes] == pytest.approx([2.0, 1.0], rel=5e-3)
    flows = branch.branch.flows
    for point in changes:
        before, after = (flows[point.position + i].surface_temperature for i in (0, 1))
        assert before >= point.flow.surface_temperature >= after
    assert [run.label for run in branch.runs] == ["across", "stable", "along"]
    for one, two in zip(branch.runs, branch.runs[1:], strict=False):
        assert one.flows[-1].surface_temperature == pytest.approx(two.flows[0].surface_temperature, rel=1e-8)
    assert len(branch.samples) == 12
    assert shares[-1] == pytest.approx(1.0)
    # what was special stays so
    assert {point.kind for point in branch.branch.special} > {point.kind for point in curve.branches[0].special}


def test_what_is_not_known_is_said(curve, monkeypatch):
    monkeypatch.setattr(along, "stability_of", lambda flow: verdict(flow, unknown_below=0.3))
    (branch,) = along.mark_stability(curve, samples=12).branches
    assert [run.label for run in branch.runs] == ["across", "stable", "along", "unknown"]
    assert sum(point.kind == along.CHANGE for point in branch.branch.special) == 2


def test_a_verdict_that_is_not_given_is_not_known(curve, monkeypatch):
    mode = SimpleNamespace(direction="along")
    monkeypatch.setattr(along, "stability_of", lambda flow: SimpleNamespace(stable=None, mode=mode))
    (branch,) = along.mark_stability(curve, samples=3).branches
    assert [run.label for run in branch.runs] == ["unknown"]
    assert branch.changes == ()


def test_samples_out_of_range_and_surfaces_that_cannot_be_posed_are_refused(curve):
    refused: list[Any] = [1, "20", 2.5]
    for samples in refused:
        with pytest.raises(InputError, match=r"samples = .*must be"):
            along.mark_stability(curve, samples=samples)
    interface = chuteflow.curve(
        chuteflow.Chute(0.3, 0.8, 0.8, 0.6, surface="interface"), points=8, surface_temperature=(1.0, 5.0)
    )
    with pytest.raises(InputError, match="free surface"):
        along.mark_stability(interface, samples=2)


def test_a_flow_between_two_of_a_family_is_a_flow_of_it(curve):
    flows = curve.branches[0].flows
    between = along.flow_between(flows, 20.4)
    assert flows[20].surface_temperature > between.surface_temperature > flows[21].surface_temperature
    assert along.flow_between(flows, 7.0) is flows[7]
    (again,) = (f for f in chuteflow.flows(PAPER, T_surface=between.surface_temperature))
    assert again.mass_flux == pytest.approx(between.mass_flux, rel=1e-9)


@pytest.mark.slow
def test_the_family_of_the_paper_is_stable_in_its_middle_alone(curve):
    found = along.mark_stability(curve, samples=12)
    (branch,) = found.branches
    labels = [run.label for run in branch.runs]
    assert labels.count("stable") == 1
    changes = [point.flow for point in branch.branch.special if point.kind == along.CHANGE]
    assert len(changes) == 2
    # On both sides of each, the verdict is the one told
    for flow in changes:
        T = flow.surface_temperature
        verdicts = {stability_of(chuteflow.flows(PAPER, T_surface=share * T)[0]).stable for share in (0.93, 1.07)}
        assert verdicts == {False, True}
    # Each end is a neutral point: of waves across in hot flows, along in cold ones.
    assert [change.flow.surface_temperature for change in branch.changes] == pytest.approx([1.92236, 1.00689], abs=2e-5)
    assert all(change.neutral and change.error < 1e-4 for change in branch.changes)
    assert np.all([0.5 < flow.surface_temperature < 3.0 for flow in changes])
