"""Saving and loading: to the last bit, whole or absent, readable by other programs."""

import csv
import json
from functools import cache
from typing import Any

import h5netcdf
import h5py
import numpy as np
import pytest

from chuteflow import Chute, Curve, FlowSet, InputError, Scales, curve, flows, load, save
from chuteflow.io.contract import curve_object, flow_set_object
from chuteflow.io.records import rows
from chuteflow.steady.quantities import FIELDS, NUMBERS, VALIDITY

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
SUFFIXES = [".nc", ".csv", ".json"]
GRAINS = Scales(diameter=1e-3, density=2500.0)


RESULTS = {
    "flow": lambda: flows(PAPER, Q=3.0)[1],
    "flows": lambda: flows(PAPER, Q=3.0),
    "interface": lambda: flows(Chute(0.3, 0.8, 0.8, 0.6, surface="interface", closure="lun-fourier"), Q=3.0),
    "none": lambda: flows(Chute(0.2, 0.8, 0.8, 0.85), Q=3.0),
    "curve": lambda: curve(PAPER, points=20),
    "families": lambda: curve(Chute(0.29, 0.9, 0.8, 0.7), points=12),
    "no families": lambda: curve(Chute(0.2, 0.8, 0.8, 0.85)),
}


@cache
def result_of(name):
    return RESULTS[name]()


def assert_same_flow(a, b):
    assert a.chute == b.chute
    np.testing.assert_array_equal(a.solution.z, b.solution.z)
    np.testing.assert_array_equal(a.solution.macroscopic, b.solution.macroscopic)
    assert a.error == b.error
    assert a.solution.status is b.solution.status
    z = np.linspace(0.0, a.depth, 7)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(a.profile(z), name), getattr(b.profile(z), name))
    for name in NUMBERS:
        assert getattr(a, name) == getattr(b, name)


@pytest.mark.parametrize("name", RESULTS)
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("scales", [None, GRAINS])
def test_what_is_loaded_is_what_was_saved(name, suffix, scales, tmp_path):
    result, path = result_of(name), tmp_path / f"result{suffix}"
    save(result, path, scales=scales)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    loaded: Any = load(path)
    assert type(loaded) is type(result)
    assert loaded.chute == result.chute
    if isinstance(result, (FlowSet, Curve)):
        assert loaded.searched == result.searched
        assert loaded.tolerance == result.tolerance
        assert loaded.reason == result.reason
    if isinstance(result, Curve):
        for a, b in zip(result.branches, loaded.branches, strict=True):
            assert a.ends == b.ends
            assert [s.position for s in a.special] == [s.position for s in b.special]
    for a, b in zip(rows(result), rows(loaded), strict=True):
        assert (a.branch, a.special) == (b.branch, b.special)
        assert_same_flow(a.flow, b.flow)


def test_netcdf_says_what_it_holds(tmp_path):
    path = tmp_path / "flows.nc"
    save(result_of("flows"), path, scales=GRAINS)
    with h5netcdf.File(path) as file:
        assert str(file.attrs["Conventions"]).startswith("CF-")
        for name in ("title", "source", "history", "references", "slope", "restitution", "tolerance"):
            assert name in file.attrs
        flux = file.variables["mass_flux"]
        assert flux.attrs["units"] == "kg/m/s"
        assert flux.attrs["long_name"] == NUMBERS["mass_flux"].description
        np.testing.assert_allclose(flux[...], 3.0 * GRAINS.factor("mass_flux", 0.3), rtol=1e-12)
        density = file.variables["density"]
        meanings = density.attrs["flag_meanings"].split()
        assert [meanings[i] for i in density[...]] == ["monotonic", "monotonic", "inverted"]
        velocity = file.variables["velocity"]
        assert velocity.dimensions == ("flow", "height_index")
        heights = file.variables["height"][...] / GRAINS.factor("height", 0.3)
        flow = result_of("flows")[0]
        wanted = flow.profile(heights[0]).velocity * GRAINS.factor("velocity", 0.3)
        np.testing.assert_allclose(velocity[...][0], wanted, rtol=1e-10)


def test_files_tell_how_far_flows_keep_to_the_theory(tmp_path):
    wanted = result_of("flows")
    save(wanted, tmp_path / "flows.nc")
    with h5netcdf.File(tmp_path / "flows.nc") as file:
        for name in VALIDITY:
            assert file.variables[name][...].tolist() == [getattr(flow.validity, name) for flow in wanted]
        bits = file.variables["validity"]
        words = [*zip(bits.attrs["flag_meanings"].split(), bits.attrs["flag_masks"], strict=True)]
        said = [[word for word, mask in words if value & mask] for value in bits[...]]
        assert said == [["large_slip", "rarefied"], ["large_slip", "rarefied"], ["large_slip"]]
    save(wanted, tmp_path / "flows.csv")
    lines = [line for line in (tmp_path / "flows.csv").read_text().splitlines() if not line.startswith("#")]
    for row in csv.DictReader(lines):
        flow = wanted[int(row["flow"])]
        assert (row["name"], row["validity"]) == (flow.name, flow.validity.summary)
        assert float(row["knudsen_number"]) == flow.validity.knudsen_number


@pytest.mark.parametrize("name", ["flows", "curve"])
def test_metadata_of_netcdf_have_checksums(name, tmp_path):
    """Without them HDF5 may read damaged ones for ever: its formats have them from the second on."""
    save(result_of(name), tmp_path / "a.nc")
    begins = (tmp_path / "a.nc").read_bytes()[:9]
    assert begins[:8] == b"\x89HDF\r\n\x1a\n"
    assert begins[8] >= 2
    # Texts of any length would lie in a heap without one.
    with h5py.File(tmp_path / "a.nc") as file:
        assert isinstance(file["restore"].attrs["head"], bytes)


def test_csv_reads_as_a_table(tmp_path):
    path = tmp_path / "curve.csv"
    save(result_of("curve"), path)
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    plain = [float(row["mass_flux"]) for row in rows if not row["special"]]
    np.testing.assert_array_equal(plain, result_of("curve").branches[0].mass_flux)
    assert [row["special"] for row in rows if row["special"]] == ["fold-Q", "density-inversion", "fold-Q"]


def test_json_is_the_object_of_the_command_line(tmp_path):
    for name, shape in (("flows", flow_set_object), ("curve", curve_object)):
        path = tmp_path / f"{name}.json"
        save(result_of(name), path)
        text = path.read_text()
        assert "NaN" not in text
        assert "Infinity" not in text
        assert shape(result_of(name)).items() <= json.loads(text).items()


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("damage", ["cut", "foreign", "empty", "later"])
def test_a_damaged_file_is_refused_in_one_line(suffix, damage, tmp_path):
    path = tmp_path / f"result{suffix}"
    save(result_of("flow"), path)
    whole = path.read_bytes()
    if damage == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "foreign":
        path.write_bytes(b"something else, entirely\n1,2,3\n")
    elif damage == "empty":
        path.write_bytes(b"")
    elif suffix == ".nc":
        with h5py.File(path, "r+") as file:
            head = file["restore"].attrs["head"]
            assert isinstance(head, bytes)
            later = head.replace(b'"format": 1', b'"format": 9')
            assert later != head
            file["restore"].attrs["head"] = later
    else:
        later = whole.replace(b'"format": 1', b'"format": 9')
        assert later != whole
        path.write_bytes(later)
    with pytest.raises(InputError) as caught:
        load(path)
    assert str(caught.value).startswith(f"cannot load {path}: ")
    assert "\n" not in str(caught.value)
    if damage == "later":
        assert "update chuteflow" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("result.txt", "must end in .nc, .csv or .json"),
        ("result", "must end in"),
        ("nowhere/result.nc", "there is no directory"),
        (".", "must end in"),
    ],
)
def test_an_unwritable_target_is_named(name, message, tmp_path):
    with pytest.raises(InputError, match=message):
        save(result_of("flow"), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_failure_while_writing_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "result.json"
    save(result_of("flow"), path)
    before = path.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(InputError, match="No space left on device"):
        save(result_of("flows"), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_what_is_no_result_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot save a dict"):
        save({}, tmp_path / "result.nc")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="cannot load"):
        load(tmp_path / "missing.nc")
