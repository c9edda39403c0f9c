"""``chuteflow boundary``: the object that other programs rely on, files, pictures, text, and lines for mistakes."""

import csv
import json

import h5netcdf
import numpy as np
import pytest
from matplotlib.text import Annotation

from chuteflow import Chute, boundary
from chuteflow.bifurcations import diagram as diagrams
from chuteflow.bifurcations.diagram import diagram
from chuteflow.cli.program import main
from chuteflow.io.boundary_records import boundaries_object
from chuteflow.io.files import save
from chuteflow.plotting.boundary_plot import plot_boundaries

CHUTE = Chute(0.3, 0.8, 0.8, 0.6)
MATERIAL = ["--e", "0.8", "--ew", "0.8", "--roughness", "0.6"]


@pytest.fixture(scope="module")
def folds():
    return boundary(CHUTE, bounds=(0.29, 0.31), samples=2)


@pytest.fixture(scope="module")
def onset():
    return boundary(CHUTE, of="density-inversion", bounds=(0.28, 0.30), samples=2)


def run(capsys, *arguments):
    code = main(["boundary", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_everything_at_once(capsys, folds, tmp_path):
    picture, file = tmp_path / "a.png", tmp_path / "a.json"
    outputs = ["--json", "--plot", str(picture), "--save", str(file), "--samples", "2"]
    code, out, err = run(capsys, "--of", "fold-Q", "--in", "slope,Q", "--slope", "0.29:0.31", *MATERIAL, *outputs)
    assert (code, err) == (0, "")
    printed = json.loads(out)
    assert printed == boundaries_object(folds) == json.loads(file.read_text())
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert printed.keys() == {"chute", "of", "in", "range", "boundaries", "searched", "reason", "incomplete"}
    assert printed["chute"] == {
        "slope": None, "e": 0.8, "ew": 0.8, "roughness": 0.6, "surface": "free", "closure": "lun",
    }  # fmt: skip
    assert (printed["of"], printed["in"], printed["range"]) == ("fold-Q", "slope", [0.29, 0.31])
    assert printed["searched"]["slope"] == [0.29, 0.31]
    for line in printed["boundaries"]:
        assert line.keys() == {"slope", "Q", "h", "M", "T_surface", "error", "special", "ends"}
        assert len({len(line[name]) for name in ("slope", "Q", "h", "M", "T_surface", "error")}) == 1
        assert 0.0 < max(line["error"]) < 1e-8


def test_the_text_says_what_was_found_and_what_could_be_missed(capsys):
    code, out, err = run(capsys, "--of", "density-inversion", "--slope", "0.28:0.3", *MATERIAL, "--samples", "2")
    assert (code, err) == (0, "")
    assert "density-inversion through slope from 0.28 to 0.3" in out
    assert "the boundary turns back in the parameter" in out
    assert "entered at 2 values of slope" in out
    assert "could be missed" in out
    assert "searched: T_surface from 0.001 to 1e+05, M up to 30" in out


def test_files_hold_every_point_in_order(onset, tmp_path):
    save(onset, tmp_path / "a.csv")
    save(onset, tmp_path / "a.nc")
    (line,) = onset
    lines = [row for row in (tmp_path / "a.csv").read_text().splitlines() if not row.startswith("#")]
    rows = list(csv.DictReader(lines))
    assert [float(row["slope"]) for row in rows if not row["special"]] == line.parameter.tolist()
    assert [row["special"] for row in rows if row["special"]] == [turn.kind for turn in line.special]
    with h5netcdf.File(tmp_path / "a.nc", "r") as file:
        plain = file["special"][...] == 0
        np.testing.assert_array_equal(file["mass_flux"][...][plain], line.mass_flux)
        np.testing.assert_array_equal(file["error"][...][plain], line.error)
        assert file.attrs["Conventions"] == "CF-1.11"


def texts(figure):
    return [text.get_text() for text in figure.axes[0].texts]


def test_a_picture_counts_the_flows_of_every_region(folds):
    figure = plot_boundaries(diagram(folds))
    assert sorted(texts(figure)) == ["1", "1", "3"]
    for text in figure.axes[0].texts:
        assert isinstance(text, Annotation)
        slope, flux = text.xy
        low, high = sorted(flow.mass_flux for line in folds for flow in line.at(slope))
        assert (text.get_text() == "3") == (low < flux < high)


def test_a_region_whose_places_disagree_has_no_number(folds, monkeypatch):
    counts = iter(range(100))
    monkeypatch.setattr(diagrams, "count_flows", lambda found, value, quantity: next(counts))
    assert texts(plot_boundaries(diagram(folds))) == []


def test_a_picture_names_the_kinds_beside_an_onset(onset):
    assert sorted(texts(plot_boundaries(diagram(onset, "surface_temperature")))) == ["inverted", "monotonic"]


def test_nothing_to_draw_is_drawn_with_its_reason(capsys, tmp_path):
    picture = tmp_path / "a.svg"
    line = ["--of", "fold-M", "--slope", "0.29:0.3", *MATERIAL, "--samples", "2", "--plot", str(picture)]
    code, out, _ = run(capsys, *line)
    assert code == 0
    assert "no boundary: no branch of flows in the range searched has a point of the kind fold-M" in out
    assert picture.exists()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (["--slope", "0.2:0.4", "--e", "0.8", "--ew", "0.8"], "missing --roughness"),
        (["--slope", "0.3", *MATERIAL], "--slope is 0.3: the second parameter takes a range LO:HI"),
        ([*MATERIAL], "--slope is missing: the second parameter takes a range"),
        (["--slope", "0.4:0.3", *MATERIAL], "the range must rise"),
        (["--slope", "0.3:x", *MATERIAL], "'0.3:x' is not a range"),
        (["--slope", "0.2:0.4", "--e", "0.7:0.8", "--ew", "0.8", "--roughness", "0.6"], "only --slope takes a range"),
        (["--of", "fold-h", "--slope", "0.2:0.4", *MATERIAL], "fold-h"),
        (["--in", "slope", "--slope", "0.2:0.4", *MATERIAL], "write one of slope, e, ew, roughness"),
        (["--slope", "0.2:0.4", *MATERIAL, "--samples", "1"], "samples = 1"),
        (["--slope", "0.2:0.4", *MATERIAL, "--save", "a.xyz"], "must end in"),
        (["--in", "roughness,Q", "--slope", "0.3", "--e", "0.8", "--ew", "0.8", "--roughness", "0.6:2"], "roughness"),
    ],
)
def test_bad_input_is_one_line(capsys, line, message):
    code, out, err = run(capsys, *line)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert message in err
