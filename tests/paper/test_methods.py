"""Figures by either method: the flows agree, and where the paper's method ends is said."""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from chuteflow import Curve, Flow, curve
from chuteflow.branches.lines import in_order
from chuteflow.cli.program import main
from chuteflow.paper import figure_17
from chuteflow.paper.curves import Curves, trace
from chuteflow.paper.data import csv_text
from chuteflow.paper.figures import FIGURES, METHODS, WITHOUT_METHOD, compute, drawn, figure, method_note
from chuteflow.paper.materials import dissipative, productive
from chuteflow.paper.sources import (
    NOT_REACHED,
    OVERBURDEN,
    Mapped,
    MappedCurves,
    Source,
    UnreachedBranch,
    reach,
    source,
)
from chuteflow.steady.collocation import LOG_M, LOG_T
from chuteflow.steady.mapped.curve import TOLERANCE, MappedCurve
from chuteflow.steady.mapped.solution import MappedSolution
from chuteflow.steady.solver import Condition, resolve

#: Figures of single flows, and those of curves.
SINGLE, OF_CURVES = (2, 5, 7, 12, 13, 15, 16), (3, 4, 6, 8, 9, 10, 17)
#: So many flows of the overburden method on a curve that one is near to any.
CLOSE_BY = 1000
#: How far the methods may be apart in Q, h and M, relatively.
AGREEMENT = 1e-8


def data_by(number: int, method: Source) -> Any:
    """The data of a figure by a method."""
    return compute(number, method)


def named(data: Any) -> list[Any]:
    """The single flows of a figure, in its order."""
    return [data.flow] if hasattr(data, "flow") else list(data.flows.values())


def apart(found: Any, other: Any) -> float:
    """The largest relative difference in Q, h and M."""
    names = ("mass_flux", "centre_of_mass", "mass_holdup")
    return max(abs(getattr(found, name) / getattr(other, name) - 1.0) for name in names)


def test_every_figure_has_flows_by_a_method_or_says_that_it_has_not():
    assert sorted((*SINGLE, *OF_CURVES, *WITHOUT_METHOD)) == list(FIGURES)
    for number in WITHOUT_METHOD:
        assert method_note(number, source(METHODS[0])) == method_note(number, source(METHODS[1]))


@pytest.mark.parametrize("number", SINGLE)
def test_single_flows_agree(number):
    pairs = [named(data_by(number, method)) for method in (Mapped(), OVERBURDEN)]
    for ours, theirs in zip(*pairs, strict=True):
        assert isinstance(ours, MappedSolution)
        assert isinstance(theirs, Flow)
        assert ours.error < 1e-8
        assert apart(ours, theirs) < AGREEMENT
        assert ours.density == theirs.density


@pytest.mark.parametrize("number", [2, 5, 7, 15])
def test_profiles_agree(number):
    """Beyond Q, h and M: the curves that are drawn."""
    ours, theirs = (data_by(number, method) for method in (Mapped(), OVERBURDEN))
    profiles = ("profile",) if number == 5 else tuple(ours.profiles)
    for key in profiles:
        a, b = (data.profile if number == 5 else data.profiles[key] for data in (ours, theirs))
        # Below an interface the last height is that of each method.
        np.testing.assert_allclose(a.height, b.height, rtol=1e-8)
        for field in ("volume_fraction", "granular_temperature", "velocity"):
            scale = np.abs(getattr(b, field)).max()
            np.testing.assert_allclose(getattr(a, field), getattr(b, field), rtol=0.0, atol=2e-7 * scale)


@pytest.fixture(scope="module")
def mapped_curves() -> Mapped:
    """One source for all figures: several ask for the same curves."""
    return Mapped(workers=2)


def chutes_of(data: Any) -> Iterator[Any]:
    yield from data.curves.values() if isinstance(data, Curves) else [data.curve]


@pytest.mark.slow
@pytest.mark.parametrize("number", OF_CURVES)
def test_every_flow_of_a_curve_agrees(number, mapped_curves):
    assert sum(map(agreeing, chutes_of(data_by(number, mapped_curves)))) > 50


@pytest.mark.parametrize(
    ("chute", "ends"),
    [
        (dissipative(0.3), (0.8, 6.0)),
        (dissipative(0.33, "interface"), (2.0, 6.0)),
        (dissipative(0.3, closure="lun-fourier"), (2.0, 6.0)),
        (productive(0.42), (0.01, 1.0)),
    ],
    ids=["figure 3", "figure 9", "figure 17", "figure 6"],
)
def test_the_flows_of_a_part_of_a_curve_agree(chute, ends):
    (found,) = Mapped().curves([chute], ends)
    assert agreeing(found) > 5


def agreeing(found: MappedCurves) -> int:
    """How many flows there are; they agree with the overburden method, one and all, and so do the folds."""
    theirs = curve(found.chute, surface_temperature=found.surface_temperature, points=CLOSE_BY)
    flows = 0
    for branch in found.branches:
        for flow, other in beside(branch, theirs):
            assert flow.error <= TOLERANCE
            assert apart(flow, other) < AGREEMENT, (found.chute, flow.surface_temperature)
            flows += 1
    assert_folds_agree(found, theirs)
    return flows


def beside(branch: MappedCurve, theirs: Curve) -> Iterator[tuple[MappedSolution, Any]]:
    """Every flow of ``branch``, and that of the overburden method in the same plane across the curve."""
    known = [flow for branch in theirs.branches for flow in branch.flows]
    places = np.array([flow.solution.macroscopic for flow in known])
    line: list[Any] = [point.flow for point in in_order(branch)]
    along = np.gradient(np.array([flow.macroscopic[LOG_M:] for flow in line]), axis=0)
    for flow, ahead in zip(line, along, strict=True):
        near = known[int(np.argmin(np.abs(places - flow.macroscopic).sum(axis=1)))]
        plane = Condition.plane(ahead / np.linalg.norm(ahead), flow.macroscopic)
        found = resolve(near.solution, plane)
        assert found.converged
        Q, h, M = np.exp(found.macroscopic[:LOG_T])
        yield flow, SimpleNamespace(mass_flux=Q, centre_of_mass=h, mass_holdup=M)


def assert_folds_agree(found: MappedCurves, theirs: Curve) -> None:
    """The folds in Q are the same, as far as the mapped method reaches."""
    folds = sorted(flow.mass_flux for branch in found.branches for flow in branch.folds)
    expected = [p.flow for branch in theirs.branches for p in branch.special if p.kind == "fold-Q"]
    coldest = min(float(branch.surface_temperature.min()) for branch in found.branches)
    expected = sorted(flow.mass_flux for flow in expected if flow.surface_temperature > coldest)
    assert folds == pytest.approx(expected, rel=1e-8)


# Where it ends


UNRESOLVED = "the series are not resolved with N = 400"


@pytest.fixture(scope="module")
def cut_short() -> MappedCurves:
    """A branch that is known from the surface temperature 2 on, of all from 0.5 on."""
    (found,) = Mapped().curves([dissipative(0.3)], (2.0, 4.0))
    (branch,) = found.branches
    return replace(
        found, surface_temperature=(0.5, 4.0), branches=(replace(branch, ends=(branch.ends[0], UNRESOLVED)),)
    )


def test_where_the_mapped_method_ends_is_said(cut_short):
    (branch,) = cut_short.branches
    coldest = branch.surface_temperature.min()
    (note,) = reach(cut_short)
    assert note == f"{NOT_REACHED}: what lies beyond the surface temperature {coldest:g} on a branch: {UNRESOLVED}"
    assert f"# {note}" in csv_text(Curves("Title", "slope", {0.3: cut_short})).splitlines()


def test_a_family_out_of_reach_is_said(cut_short):
    lost = replace(cut_short, branches=(), unreached=(UnreachedBranch((0.001, 0.005), "no series converges"),))
    assert reach(lost) == [
        f"{NOT_REACHED}: a branch with surface temperatures from 0.001 to 0.005: no series converges"
    ]


@pytest.mark.slow
def test_cold_flows_on_steep_slopes_are_out_of_reach():
    """At 0.36 they are deep in units of T_inf; the second branch of 0.34 is colder than 0.006."""
    steep, thin = (
        Mapped().curves([dissipative(s)], ends)[0] for s, ends in ((0.36, (0.3, 2.0)), (0.34, (1.5e-3, 5e-3)))
    )
    (branch,) = steep.branches
    assert branch.surface_temperature.max() >= 2.0
    assert branch.surface_temperature.min() == pytest.approx(0.6, abs=0.05)
    assert [note.endswith(UNRESOLVED) for note in reach(steep)] == [True]
    assert thin.branches == ()
    assert thin.unreached
    assert all(
        note.startswith(f"{NOT_REACHED}: a branch with surface temperatures from 0.0015") for note in reach(thin)
    )


def test_the_overburden_method_reaches_all_of_its_range():
    (found,) = OVERBURDEN.curves([dissipative(0.36)], (0.3, 2.0), 20)
    assert reach(found) == ["all flows with surface temperatures from 0.3 to 2.0"]


def test_curves_are_kept_for_their_own_range_alone():
    method = Mapped()
    (first,) = method.curves([dissipative(0.3)], (2.0, 4.0))
    (wider,) = method.curves([dissipative(0.3)], (2.0, 6.0))
    (again,) = method.curves([dissipative(0.3)], (2.0, 4.0))
    assert first is again
    assert wider.branches[0].surface_temperature.max() >= 6.0


# The command


def test_the_command_takes_the_method_and_says_so_in_the_data(tmp_path, capsys):
    for method in METHODS:
        assert main(["figures", "--only", "2,11", "--out", str(tmp_path), "--method", method]) == 0
        said = capsys.readouterr().out.splitlines()
        assert [line.split(":")[0] for line in said] == ["figure 2", "figure 11"]
        assert said[1].endswith("--method changes nothing: the reduced model alone")
        # A second run into the same place keeps nothing of the first.
        notes = (tmp_path / "figure_02.csv").read_text(encoding="utf-8").splitlines()[1]
        assert notes.startswith(f"# method: {method}: ")
        written = csv_text(figure(2).compute(source(method)), method_note(2, source(method)))
        assert (tmp_path / "figure_02.csv").read_text(encoding="utf-8") == written


@pytest.mark.slow
def test_all_figures_are_there_in_well_under_a_minute(tmp_path, capsys):
    """40 s on two cores are allowed, and all is done on one: as much processor time is the same on a quiet machine."""
    begin = time.process_time()
    assert main(["figures", "--out", str(tmp_path)]) == 0
    assert time.process_time() - begin < 40.0
    names = {f"figure_{number:02d}.{kind}" for number in FIGURES for kind in ("png", "csv")}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert [line.split(":")[0] for line in capsys.readouterr().out.splitlines()] == [f"figure {n}" for n in FIGURES]


def test_only_leaves_the_others_alone(tmp_path):
    (tmp_path / "figure_03.csv").write_text("of another run", encoding="utf-8")
    assert main(["figures", "--only", "2", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "figure_03.csv").read_text(encoding="utf-8") == "of another run"


def test_the_figure_at_work_is_said_on_a_terminal_alone(tmp_path, monkeypatch, capsys):
    for terminal in (True, False):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal, raising=False)
        assert main(["figures", "--only", "11", "--out", str(tmp_path)]) == 0
        assert ("figure 11 ..." in capsys.readouterr().err) == terminal


def test_flows_out_of_reach_are_said_by_the_command(cut_short, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(Mapped, "curves", lambda *_: [cut_short])
    monkeypatch.setattr(figure_17, "LINES", {"lun": figure_17.LINES["lun"]})
    assert main(["figures", "--only", "17", "--out", str(tmp_path), "--method", "mapped"]) == 0
    assert "the method does not reach all flows: see the notes in the data" in capsys.readouterr().out
    titles = [
        picture.get_suptitle()
        for picture in (
            drawn(17, trace("Title", "closure", [dissipative(0.3)], source)) for source in (Mapped(), OVERBURDEN)
        )
    ]
    assert titles == ["lines end where the method does not converge: see the data", ""]


@pytest.mark.parametrize("command", ["figures", "report"])
def test_an_unknown_method_is_one_line_and_2(command, refused):
    refused([command, "--method", "shooting"], "'overburden', 'mapped'")
