"""Figures 2 and 3 by the numbers that they show; pictures are compared with no picture."""

import csv
import subprocess
import sys
from functools import cache
from importlib import import_module

import numpy as np
import pytest

from chuteflow.cli.program import main
from chuteflow.paper import figure_02, figure_03
from chuteflow.paper.data import csv_text
from chuteflow.paper.figures import FIGURES, figure, method_note
from chuteflow.paper.sources import OVERBURDEN
from chuteflow.plotting import style

#: The caption of figure 2: T_surface, h and M, to the digits printed. The paper has 0.19 for the 0.197 of C.
PRINTED = {"A": (7.34, 8.84, 0.44), "B": (2.54, 3.98, 0.59), "C": (0.197, 1.77, 1.26)}
DIGITS = {"A": (2, 2, 2), "B": (2, 2, 2), "C": (3, 2, 2)}


@cache
def profiles():
    return figure_02.compute()


@cache
def curves():
    return figure_03.compute()


def drawn(axes):
    """The curves of a panel, without its points."""
    return [line for line in axes.lines if len(line.get_xdata()) > 2]


def points(axes):
    return [(line.get_xdata()[0], line.get_ydata()[0]) for line in axes.lines if len(line.get_xdata()) == 1]


def read(text):
    lines = text.splitlines()
    notes = [line for line in lines if line.startswith("#")]
    return notes, list(csv.DictReader(line for line in lines if not line.startswith("#")))


# The registry


@pytest.mark.parametrize("number", FIGURES)
def test_a_registered_figure_has_a_module_that_computes_and_draws(number):
    module = import_module(f"chuteflow.paper.figure_{number:02d}")
    assert figure(number) is module
    assert callable(module.compute)
    assert callable(module.draw)


def test_a_figure_that_is_not_there_is_refused():
    with pytest.raises(KeyError):
        figure(99)


# Figure 2


@pytest.mark.parametrize("name", PRINTED)
@pytest.mark.parametrize("computed", [profiles, curves], ids=["figure 2", "figure 3"])
def test_the_flows_are_those_of_the_caption(computed, name):
    flow = computed().flows[name]
    numbers = (flow.surface_temperature, flow.centre_of_mass, flow.mass_holdup)
    assert tuple(map(round, numbers, DIGITS[name])) == PRINTED[name]
    assert flow.mass_flux == pytest.approx(3.0, rel=1e-10)
    assert flow.error <= 1e-10


def test_the_profiles_are_those_of_the_text():
    density = {name: profile.volume_fraction for name, profile in profiles().profiles.items()}
    assert np.argmax(density["C"]) > 0, "C shows a density inversion"
    for name in "AB":
        assert np.all(np.diff(density[name]) < 0.0), "A and B decay monotonically"
    slip = [profiles().profiles[name].velocity[0] for name in "ABC"]
    assert slip == sorted(slip, reverse=True), "slip falls with increasing density"
    for profile in profiles().profiles.values():
        assert np.argmax(profile.granular_temperature) == 0, "the temperature is largest at the base"


@pytest.mark.parametrize(("panel", "field"), [*enumerate(figure_02.FIELDS)])
def test_figure_2_draws_the_profiles_in_the_strokes_of_the_caption(panel, field):
    axes = figure_02.draw(profiles()).axes[panel]
    lines = drawn(axes)
    dashes = [style.SOLID, style.DOTTED, style.DASHED]
    wanted = axes.plot([], [], linestyle=dashes[0])[0], *(axes.plot([], [], linestyle=d)[0] for d in dashes[1:])
    for line, like, (name, profile) in zip(lines, wanted, profiles().profiles.items(), strict=True):
        assert str(line.get_label()).startswith(f"{name}: ")
        assert line.get_linestyle() == like.get_linestyle()
        np.testing.assert_array_equal(line.get_xdata(), getattr(profile, field))
        np.testing.assert_array_equal(line.get_ydata(), profile.height)
        low, high = axes.get_xlim()
        assert low <= getattr(profile, field).min()
        assert getattr(profile, field).max() <= high
    assert len({line.get_color() for line in lines}) == 3


# Figure 3


def test_the_curve_has_three_flows_between_its_folds():
    (branch,) = curves().curve.branches
    folds = sorted(point.flow.mass_flux for point in branch.special if point.kind == "fold-Q")
    assert len(folds) == 2
    assert folds[0] < 3.0 < folds[1]
    assert all(point.kind not in ("fold-M", "fold-T") for point in branch.special)


def test_hold_up_and_centre_of_mass_are_one_to_one():
    (branch,) = curves().curve.branches
    order = np.argsort(branch.mass_holdup)
    assert np.all(np.diff(branch.centre_of_mass[order]) < 0.0)


@pytest.mark.parametrize(("panel", "axes_of"), [*enumerate(figure_03.PANELS)])
def test_the_named_flows_lie_on_the_curves(panel, axes_of):
    x, y, right, top, _ = axes_of
    axes = figure_03.draw(curves()).axes[panel]
    assert points(axes) == [(getattr(f, x), getattr(f, y)) for f in curves().flows.values()]
    assert sorted(text.get_text() for text in axes.texts) == ["A", "B", "C"]
    (line,) = drawn(axes)
    u, v = np.asarray(line.get_xdata()) / right, np.asarray(line.get_ydata()) / top
    for px, py in points(axes):
        assert 0.0 < px < right
        assert 0.0 < py < top
        start, step = np.array([u[:-1], v[:-1]]), np.array([np.diff(u), np.diff(v)])
        to_point = np.array([[px / right], [py / top]]) - start
        share = np.clip((to_point * step).sum(axis=0) / (step**2).sum(axis=0), 0.0, 1.0)
        distance = np.hypot(*(to_point - share * step)).min()
        assert distance < 1e-3, "no farther from the line than a fraction of its width"


def test_the_curves_leave_the_panels_smoothly():
    for axes in figure_03.draw(curves()).axes:
        (line,) = drawn(axes)
        size = np.array([axes.get_xlim()[1], axes.get_ylim()[1]])
        path = np.array([line.get_xdata(), line.get_ydata()]).T / size
        inside = np.all(path[:-1] <= 1.0, axis=1)
        assert np.hypot(*np.diff(path, axis=0).T)[inside].max() < 0.05, "the line shows no corners"


# Data beside the pictures


def test_the_data_of_figure_2_hold_what_is_drawn():
    notes, rows = read(csv_text(profiles()))
    assert any("slope = 0.3" in note for note in notes)
    assert any(note.startswith("# C: T_surface = 0.19680") for note in notes)
    for name, profile in profiles().profiles.items():
        for field in ("height", *figure_02.FIELDS):
            values = [float(row[field]) for row in rows if row["flow"] == name]
            np.testing.assert_array_equal(values, getattr(profile, field))


def test_the_data_of_figure_3_hold_what_is_drawn():
    notes, rows = read(csv_text(curves()))
    assert sum("fold-Q" in note for note in notes) == 2
    (line,) = drawn(figure_03.draw(curves()).axes[0])
    along = [row for row in rows if row["flows"] == "family 1"]
    np.testing.assert_array_equal([float(row["mass_flux"]) for row in along], line.get_xdata())
    np.testing.assert_array_equal([float(row["centre_of_mass"]) for row in along], line.get_ydata())
    assert [row["flows"] for row in rows if len(row["flows"]) == 1] == ["A", "B", "C"]


# The command


@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_the_command_writes_pictures_and_data(kind, tmp_path, capsys):
    out = tmp_path / "new" / "folder"
    assert main(["figures", "--only", "3,2,2", "--out", str(out), "--format", kind]) == 0
    names = {path.name for path in out.iterdir()}
    assert names == {f"figure_02.{kind}", "figure_02.csv", f"figure_03.{kind}", "figure_03.csv"}
    begins = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[kind]
    assert (out / f"figure_02.{kind}").read_bytes().startswith(begins)
    assert len(capsys.readouterr().out.splitlines()) == 2
    written = csv_text(profiles(), method_note(2, OVERBURDEN))
    assert (out / "figure_02.csv").read_text(encoding="utf-8") == written


def test_a_picture_is_the_same_bytes_each_time(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    for out in (first, second):
        assert main(["figures", "--only", "2", "--out", str(out), "--format", "pdf"]) == 0
    assert (first / "figure_02.pdf").read_bytes() == (second / "figure_02.pdf").read_bytes()


def test_drawing_sets_nothing_global():
    # To look at the backend would choose one.
    code = (
        "import sys, matplotlib; kept = [k for k in matplotlib.rcParams if not k.startswith('backend')]; "
        "before = {k: matplotlib.rcParams[k] for k in kept}; "
        "from chuteflow.paper import figure_02 as f; f.draw(f.compute()); "
        "print(all(matplotlib.rcParams[k] == before[k] for k in kept), 'matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--only", "2,99"], "there is no figure 99 here: choose from "),
        (["--only", "2,three"], "write numbers separated by commas"),
        (["--only", ""], "write numbers separated by commas"),
        (["--format", "gif"], "gif"),
        (["--out", "file/folder"], "cannot make the directory file/folder"),
    ],
)
def test_a_mistake_draws_nothing(arguments, message, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    refused(["figures", *arguments], message)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
