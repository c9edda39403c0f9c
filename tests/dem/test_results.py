"""Many measured flows together: the table, the picture, and the data of the study that the pages show."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from chuteflow.branches.enumeration import flows
from chuteflow.cli.program import main
from chuteflow.dem import records, study
from chuteflow.dem.recovery import recover
from chuteflow.dem.results import read_folder, rest_slope, table, thin
from chuteflow.errors import InputError
from chuteflow.plotting.results_plot import plot_results

from .test_comparison import CHUTE, taken_from

ROOT = Path(__file__).resolve().parents[2]
DATA, SHOWN = ROOT / "docs" / "measured" / "particles", ROOT / "docs" / "measured" / "particles.txt"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("flows")
    records.save(taken_from(flows(CHUTE, M=1.264)[0]), path / "one.csv")
    return path


def test_a_folder_of_flows_is_one_table_and_one_picture(folder, capsys, tmp_path):
    found = list(read_folder(folder, ["lun"]))
    (header, row) = table(found, ["lun"])
    cells = dict(zip(header, row, strict=True))
    assert cells["run"] == "one"
    assert cells["state"] == "steady"
    assert float(cells["Q lun/area"]) == pytest.approx(1.0, abs=2e-3)
    assert float(cells["Q lun/spacing"]) > 1.1
    assert float(cells["g2"].partition("±")[0]) == pytest.approx(0.0, abs=0.5)
    figure = plot_results(found)
    (points,) = (line for line in figure.axes[0].get_lines() if len(np.atleast_1d(line.get_xdata())) == 7)
    np.testing.assert_allclose(np.asarray(points.get_ydata()), 1.0, atol=5e-3)
    assert main(["dem", "results", str(folder), "--with", "lun", "--plot", str(tmp_path / "a.png")]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("one")
    assert (tmp_path / "a.png").exists()


def test_a_folder_without_flows_is_told(tmp_path):
    with pytest.raises(InputError, match="holds no measured flows"):
        list(read_folder(tmp_path))


def test_fewer_heights_keep_the_means(folder):
    whole = records.load(folder / "one.csv")
    few = thin(whole, 20)
    assert 10 <= len(few.height) <= 20
    assert few.tenths is whole.tenths
    assert set(few.height) <= set(whole.height)


def test_a_pocket_holds_a_grain_by_its_geometry():
    # Two bumps 2 r apart in front of it, and one behind: the weight must point between them.
    r, angle = 0.6, math.atan(rest_slope(0.6))
    centre = np.array([0.0, 0.0, math.sqrt(1.0 - 4.0 * r**2 / 3.0)])
    bumps = np.array(
        [[r / math.sqrt(3.0), r, 0.0], [r / math.sqrt(3.0), -r, 0.0], [-2.0 * r / math.sqrt(3.0), 0.0, 0.0]]
    )
    np.testing.assert_allclose(np.linalg.norm(bumps - centre, axis=1), 1.0)
    gravity = np.array([math.sin(angle), 0.0, -math.cos(angle)])
    forces = np.linalg.solve((centre - bumps).T, -gravity)
    assert forces == pytest.approx([forces[0], forces[0], 0.0], abs=1e-12)
    assert forces[0] > 0.0
    assert rest_slope(0.9) == math.inf


def test_the_study_has_what_was_promised():
    every = list(study.cases())
    names = [case.name for case in every]
    assert len(set(names)) == len(names)
    chutes = {(one[0], one[1], one[2], one[3]) for one in study.HOT}
    assert len(chutes) >= 12
    assert {case.scene.base for case in every} == {"triangular", "random"}
    assert {case.scene.seed for case in every} == {1, 2, 3}
    cold = [case for case in every if case.scene.start == "cold"]
    assert sorted(case.scene.holdup for case in cold) == [0.44, 0.59, 1.26]


def test_the_study_resumes_what_is_there(tmp_path):
    case = next(study.cases())
    first = study.prepare_case(case, tmp_path)
    assert study.prepare_case(case, tmp_path) == first
    assert first.scene.temperature != case.scene.temperature


def test_the_command_leaves_what_is_done_alone(folder, tmp_path, monkeypatch, capsys):
    from chuteflow.dem.engine import VARIABLE

    case = next(study.cases())
    monkeypatch.setattr(study, "cases", lambda: iter([case]))
    monkeypatch.setenv(VARIABLE, sys.executable)
    done = tmp_path / "data" / f"{case.name}.csv"
    done.parent.mkdir()
    done.write_bytes((folder / "one.csv").read_bytes())
    words = ["dem", "study", "--out", str(tmp_path / "study"), "--data", str(done.parent)]
    assert main(words) == 0
    assert "1 runs are in" in capsys.readouterr().out
    assert not (tmp_path / "study").exists()
    done.unlink()
    # It is simulated now, by what is no LAMMPS.
    assert main(words) == 1
    assert f"run 1 of 1: {case.name}" in capsys.readouterr().err


@pytest.mark.skipif(not DATA.exists(), reason="the data of the study are part of the repository, not of the package")
def test_the_data_of_the_study_are_whole():
    known = {case.name for case in study.cases()}
    files = sorted(DATA.glob("*.csv"))
    assert len(files) >= 10
    for file in files:
        assert file.stem in known
        found = records.load(file)
        assert found.drifts.keys() == {"mass_flux", "centre_of_mass", "mean_temperature"}
        assert np.isfinite(found.numbers["mass_flux"])


FREE = ["e", "ew", "roughness"]


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason="the data of the study are part of the repository, not of the package")
@pytest.mark.parametrize(
    "name",
    ["hot01-triangular-1", "hot01-triangular-2", "hot01-triangular-3", "hot01-random-1", "hot10-triangular-1", "finer"],
)
def test_the_restitution_of_the_grains_comes_back(name):
    found = recover(records.load(DATA / f"{name}.csv"), "lun", FREE)
    assert found.fit.values[0] == pytest.approx(0.95, abs=0.003)


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason="the data of the study are part of the repository, not of the package")
def test_that_of_inelastic_grains_comes_back_under_the_law_for_these_alone():
    measured = records.load(DATA / "paper-B-hot.csv")
    inside, outside = (recover(measured, law, FREE).fit.estimates[0] for law in ("garzo-dufty-fourier", "lun"))
    assert inside.interval.low < 0.8 < inside.interval.high
    assert inside.value == pytest.approx(0.8, abs=0.01)
    assert outside.interval.low > 0.8


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason="the data of the study are part of the repository, not of the package")
def test_the_table_on_the_page_is_that_of_the_data(capsys):
    assert main(["dem", "results", str(DATA)]) == 0
    assert capsys.readouterr().out == SHOWN.read_text(encoding="utf-8")
