"""Stores that are damaged: it is noticed by reading, by --status and on resuming, and computed again."""

import json
import os
import random
import shutil
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace

import pytest
import xarray

from chuteflow.cli.program import main
from chuteflow.sweeps import runner
from chuteflow.sweeps import store as module
from chuteflow.sweeps.engine import solve_chunk
from chuteflow.sweeps.store import DamageError, Marker, Store
from chuteflow.sweeps.study import read
from chuteflow.sweeps.work import work

from ..studies import study_at_temperatures

STUDY = study_at_temperatures("random", 24, 6, design="seed = 3", results='quantities = ["mass_flux", "density"]')
CHUNKS = 4


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A study and its store, all of it computed."""
    folder = tmp_path_factory.mktemp("damage")
    (folder / "study.toml").write_text(STUDY)
    store = Store.made(folder / "sound.zarr", read(folder / "study.toml"))
    for chunk in range(CHUNKS):
        work(str(store.path), chunk)
    return store.path


@pytest.fixture
def damaged(sound, tmp_path):
    """A copy of the store, to be damaged."""
    return shutil.copytree(sound, tmp_path / "damaged.zarr")


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch):
    @contextmanager
    def pool(count):
        with ThreadPoolExecutor(count) as threads:
            yield threads

    monkeypatch.setattr(runner, "worker_pool", pool)
    monkeypatch.setattr("chuteflow.sweeps.work.solve_chunk", solved_once)


SOLVED = {}


def solved_once(study, chunk):
    """What a chunk holds is the same every time, as others of the tests show; here it is solved once."""
    key = study.digest, chunk
    if key not in SOLVED:
        SOLVED[key] = solve_chunk(study, chunk)
    return SOLVED[key]


def sweep(sound, store, *arguments):
    return main(["sweep", str(sound.parent / "study.toml"), "--out", str(store), *arguments])


def status(sound, store, capsys):
    assert sweep(sound, store, "--status") == 0
    return capsys.readouterr().out


def contents(store):
    files = [path for path in store.rglob("*") if path.is_file() and ".chuteflow" not in path.parts]
    return {str(path.relative_to(store)): path.read_bytes() for path in files}


def flip(path, bit):
    content = bytearray(path.read_bytes())
    content[bit // 8 % len(content)] ^= 1 << bit % 8
    path.write_bytes(content)


def chunk_file(store, name, chunk):
    place = store / name / "c" / str(chunk)
    return place / "0" if place.is_dir() else place


def marker_file(store, chunk):
    return store / ".chuteflow" / "done" / f"{chunk:08d}.json"


# Arrays


@pytest.mark.parametrize("bit", [3, 200, -7])
def test_a_flipped_bit_is_noticed_by_readers_by_status_and_on_resuming(sound, damaged, capsys, bit):
    flip(chunk_file(damaged, "mass_flux", 2), bit)
    with xarray.open_zarr(damaged) as data, pytest.raises(ValueError, match="checksum"):
        data["mass_flux"].load()
    told = status(sound, damaged, capsys)
    assert "3 of 4 chunks, 18 points" in told
    assert "chunk 2 is damaged: the checksum of its part of mass_flux differs" in told
    assert sweep(sound, damaged) == 0
    assert (
        "chunk 2 is damaged: the checksum of its part of mass_flux differs: computed again" in capsys.readouterr().err
    )
    assert contents(damaged) == contents(sound)
    assert "4 of 4 chunks, 24 points" in status(sound, damaged, capsys)


@pytest.mark.parametrize(
    "damage",
    [
        lambda store: chunk_file(store, "mass_flux", 1).unlink(),
        lambda store: chunk_file(store, "status", 1).write_bytes(b""),
        lambda store: shutil.rmtree(store / "mass_flux" / "c" / "1"),
        lambda store: shutil.copy(chunk_file(store, "slope", 2), chunk_file(store, "slope", 1)),
        lambda store: (chunk_file(store, "e", 1).unlink(), chunk_file(store, "e", 1).mkdir()),
    ],
)
def test_a_chunk_of_an_array_that_is_gone_or_another_is_computed_again(sound, damaged, capsys, damage):
    damage(damaged)
    assert "3 of 4 chunks" in status(sound, damaged, capsys)
    assert sweep(sound, damaged) == 0
    assert "4 of 4 chunks" in capsys.readouterr().out
    assert contents(damaged) == contents(sound)


@pytest.mark.parametrize("instead", ["nothing", "a file"])
def test_an_array_whose_folder_is_gone_is_computed_again(sound, damaged, capsys, instead):
    shutil.rmtree(damaged / "n_flows")
    if instead == "a file":
        (damaged / "n_flows").write_text("mine")
    told = status(sound, damaged, capsys)
    assert "0 of 4 chunks, 0 points" in told
    assert "the metadata of n_flows are damaged" in told
    assert sweep(sound, damaged) == 0
    assert contents(damaged) == contents(sound)


def test_metadata_that_are_damaged_are_written_again(sound, damaged, capsys):
    (damaged / "zarr.json").write_text("[]")
    (damaged / "density" / "zarr.json").write_text("{")
    told = status(sound, damaged, capsys)
    assert "the metadata of the store are damaged" in told
    assert "the metadata of density are damaged" in told
    assert sweep(sound, damaged) == 0
    assert contents(damaged) == contents(sound)


# Markers and study


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b'{"chunk": 3, "poi',
        b"{}",
        b"[]",
        b"null",
        b"\xff\xfe",
        b"[" * 5000,
        b'{"chunk": 3, "points": 1e999}',
        b"9" * 5001,
    ],
)
def test_a_marker_that_is_none_is_computed_again(sound, damaged, capsys, content):
    marker_file(damaged, 3).write_bytes(content)
    told = status(sound, damaged, capsys)
    assert "3 of 4 chunks" in told
    assert "chunk 3 is damaged: its marker is damaged" in told
    assert sweep(sound, damaged) == 0
    assert contents(damaged) == contents(sound)
    assert "4 of 4 chunks" in status(sound, damaged, capsys)


def test_a_marker_that_counts_wrongly_is_noticed(sound, damaged, capsys):
    path = marker_file(damaged, 0)
    path.write_bytes(path.read_bytes().replace(b'"points": 6', b'"points": 7'))
    assert "the checksum of its marker differs" in status(sound, damaged, capsys)
    shutil.copy(marker_file(damaged, 1), path)
    assert "its marker is that of another chunk" in status(sound, damaged, capsys)


def test_foreign_files_and_markers_beyond_the_study_count_for_nothing(sound, damaged, capsys):
    done = damaged / ".chuteflow" / "done"
    for name in ("._00000003.json", "copy of 3.json", "3.json", "٣٣٣٣٣٣٣٣.json", "-0000001.json"):
        (done / name).write_text("{}")
    shutil.copy(marker_file(damaged, 3), done / "00000012.json")
    told = status(sound, damaged, capsys)
    assert told == f"{damaged}: " + status(sound, sound, capsys).partition(": ")[2]
    assert "4 of 4 chunks, 24 points" in told


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe{}", b"[" * 5000, b'{"design": 3}', None])
def test_a_study_that_is_damaged_is_written_again_where_the_store_is_that_of_the_study(sound, damaged, capsys, content):
    path = damaged / ".chuteflow" / "study.json"
    path.unlink() if content is None else path.write_bytes(content)
    assert "4 of 4 chunks" in status(sound, damaged, capsys)
    assert path.read_bytes() == (sound / ".chuteflow" / "study.json").read_bytes()
    # Where that cannot be known, it is told.
    path.write_bytes(content or b"")
    (damaged / "zarr.json").unlink()
    assert sweep(sound, damaged) == 2
    told = capsys.readouterr().err
    assert "the study of the store" in told
    assert told.count("\n") == 1


# Versions


def test_a_store_resumed_by_another_version_names_both(sound, tmp_path, capsys, monkeypatch):
    store = tmp_path / "both.zarr"
    with monkeypatch.context() as patch:
        patch.setattr(module, "__version__", "0.0.9")
        assert sweep(sound, store, "--chunks", "0:3") == 0
    capsys.readouterr()
    assert sweep(sound, store) == 0
    told = capsys.readouterr()
    version = module.__version__
    assert f"the store has chunks of chuteflow 0.0.9; those computed now are of chuteflow {version}" in told.err
    assert f"chunks computed: 3 by chuteflow 0.0.9, 1 by chuteflow {version}" in told.out
    with xarray.open_zarr(store) as data:
        assert data.attrs["source"] == f"chuteflow 0.0.9, chuteflow {version}"
    assert Store.opened(store).marker(0).version == "0.0.9"
    assert Store.opened(store).marker(3).version == version
    assert f"3 by chuteflow 0.0.9, 1 by chuteflow {version}" in status(sound, store, capsys)


@pytest.fixture
def first(damaged):
    """The store as version 0.1.0 wrote it: without checksums, and without versions."""
    for path in damaged.rglob("zarr.json"):
        given = json.loads(path.read_text())
        for part in (given, *given.get("consolidated_metadata", {}).get("metadata", {}).values()):
            if "codecs" in part:
                part["codecs"] = [codec for codec in part["codecs"] if codec["name"] != "crc32c"]
        path.write_text(json.dumps(given))
    for path in damaged.rglob("c/**/*"):
        if path.is_file():
            path.write_bytes(path.read_bytes()[:-4])
    for chunk in range(CHUNKS):
        marker = vars(Store.opened(damaged).marker(chunk))
        for name in ("version", "sums"):
            del marker[name]
        marker_file(damaged, chunk).write_text(json.dumps(marker))
    return damaged


def test_stores_of_the_first_version_are_read_and_gone_on_with(sound, first, capsys):
    told = status(sound, first, capsys)
    assert "4 of 4 chunks, 24 points" in told
    assert "4 chunks have no checksums: their counts and parameters have been checked alone" in told
    before = contents(first)
    marker_file(first, 1).unlink()
    chunk_file(first, "mass_flux", 1).unlink()
    chunk_file(first, "mass_flux", 2).unlink()
    assert "2 of 4 chunks" in status(sound, first, capsys)
    assert sweep(sound, first) == 0
    assert contents(first) == before
    with xarray.open_zarr(first) as one, xarray.open_zarr(sound) as other:
        assert one.load().equals(other.load())
    assert "2 chunks have no checksums" in status(sound, first, capsys)


# Time


def test_a_marker_is_read_in_microseconds(sound, damaged):
    import time

    store = Store.opened(damaged)
    one = store.marker(0)
    done = damaged / ".chuteflow" / "done"
    large = replace(store, study=replace(store.study, chunk=1))
    for chunk in range(24):
        (done / f"{chunk:08d}.json").write_bytes(replace(one, chunk=chunk).content)
    begin = time.process_time()
    for _ in range(100):
        assert len([large.marker(chunk) for chunk in sorted(large.done())]) == 24
    # 39 s for 200,000 are 195 microseconds for each.
    assert time.process_time() - begin < 2400 * 100e-6


# Anything


def damages(store, rng):
    """One random piece of damage to a random file of a store."""
    files = sorted(path for path in store.rglob("*") if path.is_file())
    folders = sorted(path for path in store.rglob("*") if path.is_dir())
    path, other = rng.choice(files), rng.choice(files)
    kind = rng.randrange(12)
    content = path.read_bytes()
    if kind == 0:
        path.unlink()
    elif kind == 1:
        path.write_bytes(b"")
    elif kind == 2:
        path.write_bytes(content[: rng.randrange(len(content) + 1)])
    elif kind == 3:
        path.write_bytes(rng.randbytes(rng.randrange(200)))
    elif kind == 4:
        shutil.rmtree(rng.choice(folders))
    elif kind == 5:
        path.unlink()
        path.mkdir()
    elif kind == 6:
        folder = rng.choice(folders)
        shutil.rmtree(folder)
        folder.write_bytes(b"mine")
    elif kind == 7:
        path.write_bytes(other.read_bytes())
    elif kind == 8:
        path.with_name(rng.choice(["._x", "copy of 3.json", "00000099.json", "x.json", "00000001.json"])).write_bytes(
            content
        )
    elif kind == 9:
        path.write_text(rng.choice(["{}", "[]", "null", "3", '"x"', "[" * 4000, "NaN", '{"failures": {"a": 1}}']))
    else:
        for _ in range(rng.randint(1, 3)):
            if content:
                flip(path, rng.randrange(8 * len(content)))
    return kind, str(path.relative_to(store))


def damaged_and_mended(sound, store, seed, capsys):
    """Damage a copy of a store, and go on with it: to the same arrays, or to one line."""
    rng = random.Random(seed)
    shutil.copytree(sound, store)
    what = seed, [damages(store, rng) for _ in range(rng.randint(1, 3)) if any(p.is_file() for p in store.rglob("*"))]
    capsys.readouterr()
    code = sweep(sound, store, "--status")
    told = capsys.readouterr()
    assert code in (0, 2), what
    assert told.err.count("\n") == (code == 2), (what, told.err)
    code = sweep(sound, store)
    told = capsys.readouterr()
    assert "Traceback" not in told.err + told.out, what
    if code == 0:
        assert "4 of 4 chunks" in told.out, what
        with xarray.open_zarr(store) as one, xarray.open_zarr(sound) as other:
            assert one.load().identical(other.load()), what
    else:
        assert code in (1, 2), what
        assert told.err.strip().splitlines()[-1].startswith("chuteflow: "), what
        # The study cannot be known to be that of the store any more.
        assert "study" in told.err or "is no store" in told.err, (what, told.err)
    shutil.rmtree(store)
    return code


def test_a_few_damaged_stores(sound, tmp_path, capsys):
    codes = [damaged_and_mended(sound, tmp_path / "x.zarr", seed, capsys) for seed in range(12)]
    assert 0 in codes


@pytest.mark.slow
def test_damaged_stores(sound, tmp_path, capsys):
    count = int(os.environ.get("CHUTEFLOW_FUZZ_STORES", "100"))
    codes = [damaged_and_mended(sound, tmp_path / "x.zarr", 1000 + seed, capsys) for seed in range(count)]
    assert codes.count(0) > 0.7 * count
    with capsys.disabled():
        print(f"\ndamaged stores: {count}, mended {codes.count(0)}, told {count - codes.count(0)}")


def test_a_marker_is_what_it_was():
    marker = Marker(3, 6, 5, 1, 0.25, {18: "no"}, "1.2.3", {"slope": 7})
    assert Marker.of(marker.content, 3) == marker
    with pytest.raises(DamageError, match="another chunk"):
        Marker.of(marker.content, 4)


def test_a_study_whose_bits_flipped_to_another_is_written_again(sound, damaged, capsys):
    path = damaged / ".chuteflow" / "study.json"
    before = path.read_bytes()
    path.write_bytes(before.replace(b'"e":0.8', b'"e":0.9'))
    assert "4 of 4 chunks" in status(sound, damaged, capsys)
    assert path.read_bytes() == before
