"""The store: what xarray sees of it, and that a chunk is in it whole or not at all."""

import errno
import itertools
import os
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray
import zarr

from chuteflow.errors import InputError
from chuteflow.sweeps import store as module
from chuteflow.sweeps.engine import solve_chunk
from chuteflow.sweeps.outcome import PointStatus
from chuteflow.sweeps.store import DamageError, Marker, Store, StoreError
from chuteflow.sweeps.study import from_dict
from chuteflow.sweeps.work import work


@pytest.fixture
def fresh(tmp_path, table):
    return Store.made(tmp_path / "fresh.zarr", from_dict(table(), Path()))


# Reading


def test_xarray_opens_it_lazily_and_without_a_warning(whole):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with xarray.open_zarr(whole.path) as data:
            assert dict(data.sizes) == {"point": 48, "flow": 8}
            assert data["mass_flux"].chunks == ((12,) * 4, (8,))
            assert {"slope", "e", "ew", "roughness", "T_surface", "surface", "closure"} <= set(data.coords)
            assert set(data.data_vars) == {
                "status",
                "reason",
                "n_flows",
                "error",
                "mass_flux",
                "centre_of_mass",
                "mass_holdup",
                "surface_temperature",
            }
            data.load()


def test_xarray_reads_what_was_computed(whole):
    with xarray.open_zarr(whole.path, chunks=None) as data:
        for chunk in range(whole.study.chunks):
            solved = solve_chunk(whole.study, chunk)
            part = data.isel(point=slice(*whole.study.extent(chunk)))
            for name, values in solved.arrays().items():
                assert np.array_equal(part[name].values, values, equal_nan=True), name
            assert (solved.n_flows > 0).any()


def test_attributes_follow_the_conventions(whole):
    with xarray.open_zarr(whole.path) as data:
        assert {"Conventions", "title", "source", "history", "references", "study"} <= set(data.attrs)
        for name, variable in data.variables.items():
            assert variable.attrs["long_name"], name
            flagged = {"flag_values", "flag_meanings"} <= set(variable.attrs)
            assert flagged or variable.attrs["units"] == "1", name
            if flagged:
                assert len(variable.attrs["flag_values"]) == len(variable.attrs["flag_meanings"].split())
        meanings = data["status"].attrs["flag_meanings"].split()
        assert meanings == ["not_computed", "complete", "more_flows_than_kept", "invalid", "failed"]


def test_the_last_chunk_may_be_a_part(tmp_path, table):
    store = Store.made(tmp_path / "part.zarr", from_dict(table(points=40, chunk=32), Path()))
    work(str(store.path), 1)
    with xarray.open_zarr(store.path) as data:
        assert data.sizes["point"] == 40
        assert (data["status"][:32] == PointStatus.NOT_COMPUTED).all()
        assert (data["status"][32:] == PointStatus.COMPLETE).all()
        assert np.isnan(data["mass_flux"][:32]).all()


def test_its_arrays_are_those_that_zarr_itself_would_lay_out(whole):
    group = zarr.open_group(whole.path, mode="r")
    array = group["mass_flux"]
    assert isinstance(array, zarr.Array)
    assert array.metadata.zarr_format == 3
    assert array.chunks == (12, 8)
    with xarray.open_zarr(whole.path, consolidated=False) as data:
        assert "mass_flux" in data


# Writing


def failing(monkeypatch, name, owner, count):
    """Let the call number ``count`` of a function fail as a full disk does."""
    calls, sound = itertools.count(), getattr(owner, name)

    def fails(*arguments, **named):
        if next(calls) == count:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return sound(*arguments, **named)

    monkeypatch.setattr(owner, name, fails)


@pytest.mark.parametrize(("owner", "name"), [(module, "_write"), (os, "replace")])
def test_a_full_disk_leaves_nothing_that_counts_at_whatever_file(monkeypatch, fresh, whole, fingerprint, owner, name):
    arrays = solve_chunk(fresh.study, 0).arrays()
    marker = Marker(0, 12, 0, 0, 0.0, {})
    for count in range(len(arrays) + 1):
        with monkeypatch.context() as patch:
            failing(patch, name, owner, count)
            with pytest.raises(OSError, match="No space left"):
                fresh.put(0, arrays, marker)
        assert fresh.done() == set()
        assert not list((fresh.path / ".chuteflow" / "partial").iterdir())
        # A status that can be read is that of a chunk whose arrays are all there.
        status = (fresh.path / "status" / "c" / "0").exists()
        assert status == (name == "replace" and count == len(arrays))
    fresh.put(0, arrays, marker)
    assert fresh.done() == {0}
    done = fingerprint(fresh.path)
    assert done.items() <= fingerprint(whole.path).items()
    assert (len(done) - 1) % 2 == 0  # each array has metadata and one chunk


def test_a_chunk_that_is_done_is_not_computed_again(fresh):
    first = work(str(fresh.path), 2)
    place = fresh.path / "mass_flux" / "c" / "2" / "0"
    before = place.stat()
    assert work(str(fresh.path), 2) == first
    assert place.stat() == before


# Clients


def test_another_study_is_refused_in_a_line_that_says_how_it_differs(fresh, table):
    other = table()
    other["parameters"] = other["parameters"] | {"e": 0.9}
    other["results"] = other["results"] | {"flows": 4}
    with pytest.raises(InputError, match=r"holds a different study \(it differs in .*\): take another --out") as caught:
        Store.made(fresh.path, from_dict(other, Path()))
    assert "parameters.e" in str(caught.value)
    assert "results.flows" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_order_of_parameters_tells_studies_apart(fresh, table):
    other = table()
    other["parameters"] = dict(reversed(other["parameters"].items()))
    with pytest.raises(InputError, match="the order of parameters"):
        Store.made(fresh.path, from_dict(other, Path()))


def test_what_is_no_store_is_refused_and_left_alone(tmp_path, table):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="is no store of a study"):
        Store.made(tmp_path, from_dict(table(), Path()))
    with pytest.raises(InputError, match="cannot make the store"):
        Store.made(tmp_path / "notes.txt" / "study.zarr", from_dict(table(), Path()))
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_one_client_at_a_time_unless_each_has_its_own_chunks(fresh):
    with (
        fresh.held(alone=True),
        pytest.raises(StoreError, match="another process computes into"),
        fresh.held(alone=True),
    ):
        pass
    with fresh.held(alone=False), fresh.held(alone=False):
        pass


def test_a_long_list_is_kept_once_and_checked(tmp_path):
    count = 300_000
    rows = "".join(f"{0.2 + 0.2 * i / count!r},1.0,{'free' if i % 2 else 'interface'}\n" for i in range(count))
    (tmp_path / "points.csv").write_text("slope,T_surface,surface\n" + rows)
    given = {
        "design": {"kind": "list", "file": "points.csv"},
        "parameters": {"e": 0.8, "ew": 0.8, "roughness": 0.6},
        "results": {"chunk": 6},
    }
    study = from_dict(given, tmp_path)
    store = Store.made(tmp_path / "list.zarr", study)
    own = store.path / ".chuteflow"
    assert max((store.path / "zarr.json").stat().st_size, (own / "study.json").stat().st_size) < 100_000
    assert Store.opened(store.path).study.digest == study.digest
    work(str(store.path), 49_999)
    with xarray.open_zarr(store.path) as data:
        assert data["slope"][-6:].values.tolist() == [0.2 + 0.2 * i / count for i in range(count - 6, count)]
        assert data["surface"][-2:].values.tolist() == [1, 0]
    # Another list is another study, and a list that is damaged is noticed.
    (tmp_path / "points.csv").write_text("slope,T_surface,surface\n" + rows.replace("0.25,", "0.26,", 1))
    with pytest.raises(InputError, match=r"it differs in parameters\.slope\.sha256"):
        Store.made(store.path, from_dict(given, tmp_path))
    column = own / "columns" / "slope.npy"
    content = bytearray(column.read_bytes())
    content[1000] ^= 1
    column.write_bytes(content)
    module._study.cache_clear()
    with pytest.raises(DamageError, match=r"the list of parameters\.slope is damaged"):
        Store.opened(store.path)
    assert Store.made(store.path, study).study.digest == study.digest
    assert Store.opened(store.path).study.digest == study.digest
