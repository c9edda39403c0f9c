"""Command lines and damaged files at random: no traceback, no hang, no damage that goes unnoticed.

CHUTEFLOW_FUZZ is a factor on how many are tried; with 10 it is the whole campaign, of 10,000 and 1,000.
"""

import os

import numpy as np
import pytest

from chuteflow import Chute, Curve, Domain, FlowSet, curve, flows, load, save
from chuteflow.io.records import rows
from chuteflow.maps.domain import domain

from . import fuzzing

FACTOR = float(os.environ.get("CHUTEFLOW_FUZZ", "1"))
PAPER = Chute(0.3, 0.8, 0.8, 0.6)


def assert_same(found, whole):
    assert type(found) is type(whole)
    if isinstance(whole, Domain):
        assert found.plane == whole.plane
        assert found.columns == whole.columns
        assert found.hot_columns == whole.hot_columns
        assert found.tolerance == whole.tolerance
        return
    assert found.chute == whole.chute
    if isinstance(whole, (FlowSet, Curve)):
        assert (found.searched, found.tolerance, found.reason) == (whole.searched, whole.tolerance, whole.reason)
    for one, two in zip(rows(found), rows(whole), strict=True):
        assert (one.branch, one.special, one.flow.error) == (two.branch, two.special, two.flow.error)
        np.testing.assert_array_equal(one.flow.solution.z, two.flow.solution.z)
        np.testing.assert_array_equal(one.flow.solution.macroscopic, two.flow.solution.macroscopic)


@pytest.fixture
def wholes(tmp_path):
    """Files of every kind of result and of every format, and what is in them."""
    results = {
        "flow": flows(PAPER, Q=3.0)[1],
        "flows": flows(PAPER, Q=3.0),
        "curve": curve(PAPER, points=10),
        "domain": domain(PAPER, ("wall_restitution", 0.7, 0.9), ("roughness", 0.55, 0.65), size=(3, 3), tolerance=0.1),
    }
    found = {}
    for name, result in results.items():
        for suffix in (".nc", ".csv", ".json"):
            path = tmp_path / f"{name}{suffix}"
            save(result, path)
            assert_same(load(path), result)
            found[path] = result
    return found


@pytest.mark.slow
def test_damaged_files_are_refused_or_hold_what_they_held(wholes, tmp_path):
    def same(path, found):
        try:
            assert_same(found, wholes[path])
        except (AssertionError, ValueError):
            return False
        return True

    count = round(100 * FACTOR)
    faults, ends = fuzzing.try_files(list(wholes), same, tmp_path, count, seed=1)
    assert faults == [], ends
    assert ends["refused"] > count / 3


@pytest.mark.slow
def test_command_lines_at_random_end_in_an_exit_code(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    count = round(1000 * FACTOR)
    faults, codes = fuzzing.try_command_lines(count, seed=2)
    assert faults == []
    assert codes[0] > count / 20
    assert set(codes) <= {0, 1, 2}
    assert [path.name for path in tmp_path.rglob(".chuteflow-*")] == []


def test_a_few_command_lines_at_random(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    faults, _ = fuzzing.try_command_lines(40, seed=3)
    assert faults == []
