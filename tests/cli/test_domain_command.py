"""``chuteflow domain``: what it prints, saves and draws, and how it refuses."""

import csv
import json
import subprocess
import sys

import h5netcdf
import numpy as np
import pytest

import chuteflow
from chuteflow.cli.program import main
from chuteflow.io.domain_records import CLASSES
from chuteflow.plotting.domain_plot import plot_domain

AXES = ["--ew", "0.7:0.9", "--roughness", "0.5:0.8"]
REST = ["--slope", "0.3", "--e", "0.8", "--size", "12x9", "--tolerance", "0.05", "--processes", "1"]


@pytest.fixture(scope="module")
def found():
    chute = chuteflow.Chute(0.3, 0.8, 0.7, 0.5)
    axes = ("wall_restitution", 0.7, 0.9), ("roughness", 0.5, 0.8)
    return chuteflow.domain(chute, *axes, size=(12, 9), tolerance=0.05, temperatures=(1.0, 10.0))


def test_json_object_is_that_of_the_library(found, capsys):
    assert main(["domain", *AXES, *REST, "--temperature", "1,10", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["x"] == {"name": "ew", "range": [0.7, 0.9]}
    assert printed["y"]["name"] == "roughness"
    assert printed["size"] == [12, 9]
    assert printed["chute"]["ew"] is None
    assert printed["chute"]["slope"] == 0.3
    assert printed["classes"].keys() == CLASSES.keys()
    for name in CLASSES:
        assert printed["cells"][name] == getattr(found, name).astype(int).tolist()
        assert sum(printed["shares"][name].values()) == pytest.approx(1.0)
    assert printed["cells"]["exists_at"] == found.exists_at.astype(int).tolist()
    assert len(printed["boundaries"]) == len(found.boundaries)
    assert printed["searched"] == {"T_surface": [1e-3, 1e5], "M_max": 30.0}


def test_many_cells_are_not_printed(found, capsys):
    assert (
        main(["domain", *AXES, *REST[:4], "--size", "200x100", "--tolerance", "0.1", "--processes", "1", "--json"]) == 0
    )
    printed = json.loads(capsys.readouterr().out)
    assert printed["cells"] is None
    assert printed["boundaries"]


def test_the_first_range_is_on_the_horizontal_axis(capsys):
    turned = [*AXES[2:], *AXES[:2]]
    assert main(["domain", *turned, *REST, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["x"]["name"] == "roughness"


def test_text_says_what_was_found_and_how_well(capsys):
    assert main(["domain", *AXES, *REST, "--temperature", "10"]) == 0
    printed = capsys.readouterr().out
    for words in ("fraction of the plane", "flow at T = 10", "located to 0.05", "searched: T_surface"):
        assert words in printed


@pytest.mark.parametrize("suffix", [".nc", ".csv", ".json"])
def test_a_saved_map_loads_back(found, suffix, tmp_path):
    path = tmp_path / f"map{suffix}"
    chuteflow.save(found, path)
    back = chuteflow.load(path)
    assert isinstance(back, chuteflow.Domain)
    assert back.plane == found.plane
    assert back.columns == found.columns
    assert back.hot_columns == found.hot_columns
    for name in (*CLASSES, "x", "y", "exists_at"):
        np.testing.assert_array_equal(getattr(back, name), getattr(found, name))


def test_netcdf_follows_the_conventions(found, tmp_path):
    path = tmp_path / "map.nc"
    chuteflow.save(found, path)
    with h5netcdf.File(path, "r") as file:
        assert file.attrs["Conventions"] == "CF-1.11"
        assert file.variables["wall_restitution"].attrs["units"] == "1"
        most = file.variables["most"]
        assert most.dimensions == ("roughness", "wall_restitution")
        assert most.attrs["units"] == "1"
        hot = file.variables["hot"].attrs
        assert hot["flag_values"].tolist() == [-1, 0, 1]
        assert len(hot["flag_meanings"].split()) == 3
        assert file.variables["interior"].attrs["flag_masks"].tolist() == [1, 2, 4]
        assert file.variables["exists_at"].dimensions[0] == "temperature"
        lines = file.groups["boundaries"].variables
        assert int(lines["line"][...].max()) + 1 == len(found.boundaries)


def test_csv_has_a_row_for_each_cell(found, tmp_path):
    path = tmp_path / "map.csv"
    chuteflow.save(found, path)
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) == 12 * 9
    assert [int(row["most"]) for row in rows] == found.most.ravel().tolist()
    assert float(rows[0]["wall_restitution"]) == found.x[0]


def test_a_map_that_is_cut_short_is_refused(found, tmp_path):
    path = tmp_path / "map.csv"
    chuteflow.save(found, path)
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(chuteflow.InputError, match="cut short"):
        chuteflow.load(path)


def test_a_map_has_no_units(found, tmp_path):
    with pytest.raises(chuteflow.InputError, match="no units"):
        chuteflow.save(found, tmp_path / "map.nc", scales=chuteflow.Scales(1e-3, 2500.0))


def test_the_picture_names_what_is_there(found):
    figure = plot_domain(found)
    (legend,) = figure.legends
    said = " ".join(text.get_text() for text in legend.get_texts())
    assert "F_{21} = 0" in said
    assert r"T_{\mathrm{surface}} = 10" in said
    number, kind = figure.axes
    assert number.get_xlim() == (0.7, 0.9)
    labels = {text.get_text() for text in number.texts}
    assert labels >= {"2", "3"}
    assert "monotonic" in {text.get_text() for text in kind.texts}


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--slope", "0.3", "--e", "0.8", "--ew", "0.8", "--roughness", "0.5:0.8"], "1 ranges"),
        (["--slope", "0.1:0.3", "--e", "0.8:0.9", "--ew", "0.8", "--roughness", "0.5:0.8"], "3 ranges"),
        (["--slope", "0.3", *AXES], "missing --e"),
        ([*AXES, *REST[:4], "--size", "10"], "whole numbers"),
        ([*AXES, *REST[:4], "--temperature", "1,hot"], "not a number"),
        ([*AXES, *REST[:4], "--tolerance", "1"], "tolerance"),
        ([*AXES, *REST[:4], "--plot", "map.gif"], "must end in"),
        (["--ew", "0.9:0.7", *AXES[2:], *REST], "must rise"),
        (["--ew", "0.7:1.7", *AXES[2:], *REST], "wall restitution"),
    ],
)
def test_bad_input_is_refused_in_one_line(arguments, what, capsys):
    assert main(["domain", *arguments]) == 2
    complaint = capsys.readouterr().err.strip()
    assert what in complaint
    assert "\n" not in complaint


def test_an_interrupt_ends_it_cleanly(tmp_path):
    path = tmp_path / "map.nc"
    words = ["domain", "--slope", "0.1:0.5", "--e", "0.7:0.9", "--ew", "0.8", "--roughness", "0.6", "--processes", "2"]
    process = subprocess.Popen(
        [sys.executable, "-m", "chuteflow", *words, "--save", str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        with pytest.raises(subprocess.TimeoutExpired):
            process.communicate(timeout=4.0)
        process.send_signal(2)
        _, complaints = process.communicate(timeout=60.0)
    finally:
        process.kill()
    assert process.returncode == 130
    assert "Traceback" not in complaints
    assert not list(tmp_path.iterdir())
