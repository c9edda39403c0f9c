"""What was measured, read for the page: tables of experiments, and runs of particles."""

from pathlib import Path

import numpy as np
import pytest

import chuteflow
from chuteflow.cli.program import main
from chuteflow.dem import records
from chuteflow.explorer.about import about
from chuteflow.explorer.data import read_data

RUNS = Path(__file__).parents[2] / "docs" / "measured" / "particles"
TABLE = """experiment,z [mm],nu,nu_error,Q,slope
one,1,0.4,0.02,3,0.3
one,2,0.3,0.02,3,0.3
one,3,,,3,0.3
one,4,0.1,0.01,3,0.3
two,1,0.2,0.01,1,
two,2,0.1,0.01,1,
two,3,0.05,0.01,1,
"""


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "own.csv"
    path.write_text(TABLE)
    return path


def test_a_run_of_particles(tmp_path):
    (found,) = read_data([RUNS / "paper-C-cold.csv"])
    run = records.load(RUNS / "paper-C-cold.csv")
    assert found["name"] == "paper-C-cold"
    assert found["given"] == {"slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6}
    flux = found["numbers"]["Q"]
    assert (flux["value"], flux["error"]) == (run.numbers["mass_flux"], run.number_errors["mass_flux"])
    assert set(found["numbers"]) == {"Q", "h", "M"}
    nu = found["profiles"]["nu"]
    there = np.isfinite(run.fields["volume_fraction"])
    assert nu["z"] == pytest.approx(run.height[there], rel=1e-6)
    assert nu["value"] == pytest.approx(run.fields["volume_fraction"][there], rel=1e-6)
    assert nu["error"] == pytest.approx(run.errors["volume_fraction"][there], rel=1e-6, abs=1e-12)
    # The same from NetCDF.
    records.save(run, tmp_path / "paper-C-cold.nc")
    assert read_data([tmp_path / "paper-C-cold.nc"])[0]["numbers"] == found["numbers"]


def test_measurements_in_units(table):
    one, two = read_data([table], slope=0.3, scales=chuteflow.Scales(diameter=2e-3, density=2500.0))
    assert (one["name"], two["name"]) == ("own, one", "own, two")
    assert one["profiles"]["nu"] == {"z": [0.5, 1.0, 2.0], "value": [0.4, 0.3, 0.1], "error": [0.02, 0.02, 0.01]}
    assert one["numbers"]["Q"]["value"] == 3.0
    assert one["given"] == {"slope": 0.3}
    assert two["given"] == {}


def test_errors_that_are_not_known_are_none(tmp_path):
    path = tmp_path / "bare.csv"
    path.write_text("z,u,Q\n1,2,3\n2,3,3\n3,4,3\n")
    (found,) = read_data([path])
    assert found["profiles"] == {"u": {"z": [1.0, 2.0, 3.0], "value": [2.0, 3.0, 4.0], "error": None}}
    assert found["numbers"] == {"Q": {"value": 3.0, "error": None}}


def test_long_profiles_are_thinned(tmp_path):
    path = tmp_path / "long.csv"
    path.write_text("z,u\n" + "".join(f"{i / 100},1\n" for i in range(1, 3001)))
    assert 300 < len(read_data([path])[0]["profiles"]["u"]["z"]) <= 400


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "cannot be read"),
        ("", "names of its columns"),
        ("a,b\n1,2\n", "unknown column 'a'"),
        ("# slope = 0.3\n# e = 0.8\nz,nu\n1,2\n", "heights"),
        ("z [mm],u\n1,2\n2,3\n3,4\n", "give their diameter and density"),
        ("experiment,Q,h\n" + "".join(f"{i},1,2\n" for i in range(41)), "40 can be drawn at most"),
    ],
)
def test_what_cannot_be_read_is_told_on_one_line(content, said, tmp_path, capsys):
    path = tmp_path / "own.csv"
    if content is not None:
        path.write_text(content)
    assert main(["explore", "--no-browser", "--port", "0", "--data", str(path)]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert len(told.splitlines()) == 1


def test_the_page_is_told(table):
    found = read_data([RUNS / "hot01-random-1.csv"])
    assert about(found)["data"] == found
    assert about()["data"] == []
