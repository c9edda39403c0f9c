"""What was measured, read for the page: tables of experiments, and runs of particles."""

from pathlib import Path

import numpy as np
import pytest
from starlette.testclient import TestClient

import chuteflow
from chuteflow.dem import records
from chuteflow.explorer.about import about
from chuteflow.explorer.data import read_data
from chuteflow.explorer.server import LARGEST_FILE, application

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
def test_what_cannot_be_read_is_told_on_one_line(content, said, tmp_path, refused):
    path = tmp_path / "own.csv"
    if content is not None:
        path.write_text(content)
    refused(["explore", "--no-browser", "--port", "0", "--data", str(path)], said)


def test_the_page_is_told(table):
    found = read_data([RUNS / "hot01-random-1.csv"])
    assert about(found)["data"] == found
    assert about()["data"] == []


# Files that are sent


@pytest.fixture(scope="module")
def client():
    with TestClient(application(), base_url="http://127.0.0.1:8765") as client:
        yield client


def test_a_file_that_is_sent_is_read_as_one_of_the_command_line(table, client):
    grains = {"diameter": "0.002", "density": "2500"}
    given = client.post("/data", params={"name": "own.csv", "slope": "0.3", **grains}, content=table.read_bytes())
    assert given.status_code == 200
    assert given.json()["data"] == read_data([table], slope=0.3, scales=chuteflow.Scales(2e-3, 2500.0))
    # Its numbers in units belong to this slope, whatever the sliders say later.
    assert [one["slope"] for one in given.json()["data"]] == [0.3, 0.3]
    run = RUNS / "paper-C-cold.csv"
    given = client.post("/data", params={"name": "paper-C-cold.csv"}, content=run.read_bytes())
    assert given.json()["data"] == read_data([run])


def test_a_netcdf_file_is_sent(tmp_path, client):
    path = tmp_path / "run.nc"
    records.save(records.load(RUNS / "paper-C-cold.csv"), path)
    given = client.post("/data", params={"name": "run.nc"}, content=path.read_bytes())
    assert given.json()["data"] == read_data([path])


@pytest.mark.parametrize(
    ("query", "content", "status", "said"),
    [
        ({"name": "own.csv"}, b"a,b\n1,2\n", 400, "own.csv: unknown column 'a'"),
        ({"name": "own.csv"}, b"", 400, "own.csv: "),
        ({"name": "own.csv"}, b"z [mm],u\n1,2\n2,3\n3,4\n", 400, "tick SI units"),
        ({"name": "own.csv"}, b"\x00\xff" * 500, 400, "own.csv: "),
        ({"name": "run.nc"}, b"not HDF5", 400, "run.nc"),
        ({"name": "own.toml"}, b"", 400, "must be a file .csv or .nc"),
        ({"name": "../../own.csv"}, b"a,b\n1,2\n", 400, "own.csv: unknown column 'a'"),
        ({"name": "a\n.csv"}, b"", 400, "must be a file .csv or .nc"),
        ({"name": "x" * 300 + ".csv"}, b"", 400, "must be a file .csv or .nc"),
        ({}, b"", 400, "must be a file .csv or .nc"),
        ({"name": "own.csv", "slope": "x"}, b"", 400, "slope = 'x'"),
        ({"name": "own.csv", "diameter": "1"}, b"", 400, "only diameter is given"),
        ({"name": "own.csv", "colour": "1"}, b"", 400, "unknown parameter 'colour'"),
        ({"name": "own.csv"}, b"1" * (LARGEST_FILE + 1), 413, "more than 2 MB"),
    ],
)
def test_a_file_that_cannot_be_read_is_one_line(query, content, status, said, client):
    given = client.post("/data", params=query, content=content)
    assert given.status_code == status
    assert said in given.json()["error"]
    assert "\n" not in given.json()["error"]
    assert "/tmp" not in given.json()["error"]


def test_files_are_sent_to_one_place_and_from_its_own_pages(client):
    assert client.get("/data").status_code == 405
    assert client.get("/ask/data").status_code == 404
    assert client.post("/about").status_code == 405
    headers = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "cors"}
    assert client.post("/data", params={"name": "own.csv"}, content=b"", headers=headers).status_code == 403
