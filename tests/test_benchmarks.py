"""The benchmarks run where only some of what they compare with is installed, and take it for what it is."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from chuteflow import Chute, flows

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
PAPER = Chute(0.3, 0.8, 0.8, 0.6)
FOLDS = (2.7684295323, 5.0133405206)


@pytest.fixture
def programs(monkeypatch):
    """The modules of the benchmarks, which are programs and no package."""
    monkeypatch.syspath_prepend(str(FOLDER))
    names = ("by_auto", "by_bice", "curves", "timing")
    yield {name: importlib.import_module(name) for name in names}
    for name in names:
        sys.modules.pop(name)


def test_without_auto_the_table_says_so(programs, monkeypatch, tmp_path):
    monkeypatch.setenv("AUTO_DIR", str(tmp_path))
    (row,) = programs["curves"]._by_auto(1.0, np.array(FOLDS), 1e-12)
    assert row.value is None
    assert row.note == f"AUTO-07p is not in {tmp_path} (Debian package auto-07p, or set AUTO_DIR): skipped"


def test_without_bice_the_table_says_so(programs, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    row = programs["curves"]._by_bice(1.0, np.array(FOLDS))
    assert row.value is None
    assert row.note == "the package bice is not installed (pip install bice): skipped"


def test_what_is_missed_counts_as_missed(programs):
    off = programs["curves"]._off
    assert off(np.array([2.7684, 4.98]), np.array(FOLDS)) == pytest.approx([1.1e-5, 6.65e-3], rel=0.1)
    assert off(np.array([2.7684]), np.array(FOLDS))[1] == np.inf
    assert off(np.array([]), np.array(FOLDS)) == [np.inf, np.inf]
    assert programs["curves"]._in_words([1e-5, np.inf]) == "folds off by 1e-05 and a fold missed"


def test_a_row_without_value_is_printed(programs):
    Row, table = programs["timing"].Row, programs["timing"].table
    text = table([Row("AUTO-07p", None, "times", note="skipped")])
    assert text.splitlines()[-1].split() == ["AUTO-07p", "-", "skipped"]


@pytest.mark.slow
def test_auto_finds_both_folds_in_the_overburden(programs, tmp_path):
    by_auto = programs["by_auto"]
    if by_auto.missing():
        pytest.skip(by_auto.missing())
    setting = by_auto.SETTINGS[-1]
    found = by_auto.traced(setting, flows(PAPER, Q=6.0)[0], 0.7, 3.0, tmp_path, 1)
    np.testing.assert_allclose(np.sort(found.folds[:, 0]), FOLDS, rtol=1e-9)
    assert found.points[-1, 0] == pytest.approx(0.7, rel=1e-6)
