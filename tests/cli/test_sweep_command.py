"""``chuteflow sweep``: as it is used, and interrupted, killed and out of disk."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import xarray

from chuteflow.cli.program import main

from ..studies import study_at_temperatures

STUDY = study_at_temperatures("sobol", 60, 12)
CHUNKS = 5
#: The command with no file that it writes above 64 bytes, as if the disk were full there.
SMALL = (
    "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
    "resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64)); "
    "from chuteflow.cli.program import main; sys.exit(main(sys.argv[1:]))"
)


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    return path


def run(*arguments):
    return main(["sweep", *map(str, arguments)])


def contents(store):
    """All arrays and metadata, byte by byte; what is only about the run is left out."""
    files = [path for path in Path(store).rglob("*") if path.is_file() and ".chuteflow" not in path.parts]
    return {str(path.relative_to(store)): path.read_bytes() for path in files}


def markers(store):
    return sorted((store / ".chuteflow" / "done").glob("*.json"))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The contents of a store that was computed at one go."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "study.toml").write_text(STUDY)
    assert run(folder / "study.toml", "--out", folder / "whole.zarr", "--workers", 1) == 0
    return contents(folder / "whole.zarr")


def test_a_study_is_computed_and_told(study, tmp_path, capsys, whole):
    store = tmp_path / "study.zarr"
    assert run(study, "--out", store, "--chunks", "0:2,4") == 0
    told = capsys.readouterr()
    assert "3 of 5 chunks, 36 points" in told.out
    assert "chunk 3 of 3:" in told.err
    assert "points a second" in told.err
    assert "s left" in told.err

    assert run(study, "--out", store, "--status") == 0
    assert "3 of 5 chunks" in capsys.readouterr().out

    before = {path: path.stat().st_mtime_ns for path in markers(store)}
    assert run(study, "--out", store, "--workers", 1) == 0
    told = capsys.readouterr()
    assert "3 of 5 chunks are done already" in told.err
    assert "5 of 5 chunks, 60 points" in told.out
    assert all(path.stat().st_mtime_ns == at for path, at in before.items())
    assert contents(store) == whole
    with xarray.open_zarr(store) as data:
        assert int(data["n_flows"].sum()) > 0

    assert run(study, "--out", store) == 0
    assert "5 of 5 chunks, 60 points" in capsys.readouterr().out


def test_a_dry_run_tells_the_time_and_writes_nothing(study, tmp_path, capsys):
    assert run(study, "--dry-run", "--workers", 2) == 0
    assert capsys.readouterr().out.startswith("60 points in 5 chunks of 12; about ")
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]


def test_points_that_failed_are_listed_by_status(tmp_path, capsys):
    (tmp_path / "study.toml").write_text(
        '[design]\nkind = "list"\n[parameters]\nslope = [0.3, -1]\ne = 0.8\new = 0.8\nroughness = 0.6\nT_surface = 7\n'
    )
    assert run(tmp_path / "study.toml", "--out", tmp_path / "study.zarr", "--workers", 1) == 0
    assert "1 points failed" in capsys.readouterr().out
    assert run(tmp_path / "study.toml", "--out", tmp_path / "study.zarr", "--status") == 0
    assert "point 1: slope = -1: must be from 1e-08 to 10000" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "missing --out STORE, for example --out study.zarr"),
        (("--out", "none.zarr", "--status"), "there is no store none.zarr yet"),
        (("--out", "study.toml"), "study.toml is no store of a study: take a path that does not exist yet"),
        (("--out", "s.zarr", "--workers", "0"), "--workers 0: must be 1 or more"),
        (("--dry-run", "--workers", "0"), "--workers 0: must be 1 or more"),
        (("--dry-run", "--workers", "2000"), "--workers 2000: must be 1024 or less"),
        (("--out", "s.zarr", "--workers", "2", "--cluster", "x"), "--workers 2 and --cluster x: give one of them"),
        (("--out", "s.zarr", "--chunks", "a"), "'a': write N, A:B or A:B:STEP, for example 0:100"),
        (("--out", "s.zarr", "--chunks", "7:"), "--chunks: the study has chunks 0 to 4, none of those asked for"),
    ],
)
def test_what_is_wrong_is_told_in_a_line(study, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(study.parent)
    assert run(study, *arguments) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert message in told.err
    assert told.err.count("\n") == 1
    assert [path.name for path in study.parent.iterdir()] == ["study.toml"]


def test_a_different_study_is_refused(study, tmp_path, capsys):
    store = tmp_path / "study.zarr"
    assert run(study, "--out", store, "--chunks", "0", "--workers", 1) == 0
    capsys.readouterr()
    before = contents(store)
    study.write_text(STUDY.replace("0.8\n", "0.9\n", 1))
    assert run(study, "--out", store) == 2
    told = capsys.readouterr().err
    assert "holds a different study (it differs in parameters.e): take another --out, or remove it" in told
    assert told.count("\n") == 1
    assert contents(store) == before


# Interruptions


def started(*arguments):
    command = [sys.executable, "-m", "chuteflow", "sweep", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


def waited_for(true, seconds=120.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def alive(session):
    """Whether any process of a session is left."""
    listed = subprocess.run(["ps", "-o", "stat=", "-s", str(session)], capture_output=True, text=True, check=False)
    return any(not line.startswith("Z") for line in listed.stdout.split())


def test_interrupted_and_killed_it_goes_on_to_the_same_result(study, tmp_path, whole):
    store = tmp_path / "study.zarr"
    computed = []
    for end in (signal.SIGINT, signal.SIGKILL):
        already = len(markers(store)) if store.exists() else 0
        process = started(study, "--out", store, "--workers", 1)
        waited_for(lambda already=already: store.exists() and len(markers(store)) > already)
        process.send_signal(end)
        _, told = process.communicate(timeout=60)
        if end == signal.SIGINT:
            assert process.returncode == 130
            assert "stopped; to go on: chuteflow sweep" in told
            assert "Traceback" not in told
        waited_for(lambda session=process.pid: not alive(session))
        computed.append({path: path.stat().st_mtime_ns for path in markers(store)})
    assert computed[0]
    assert run(study, "--out", store, "--workers", 1) == 0
    assert contents(store) == whole
    # None that was done is done again.
    for before in computed:
        assert all(path.stat().st_mtime_ns == at for path, at in before.items())
    assert len(markers(store)) == CHUNKS


def test_out_of_disk_it_stops_with_a_line_and_goes_on_to_the_same_result(study, tmp_path, whole):
    store = tmp_path / "study.zarr"
    assert run(study, "--out", store, "--chunks", "3", "--workers", 1) == 0
    before = contents(store)
    command = [sys.executable, "-c", SMALL, "sweep", study, "--out", store, "--workers", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "could not be written: File too large; what is done is kept" in done.stderr
    assert "Traceback" not in done.stderr
    assert len(markers(store)) == 1
    assert contents(store) == before
    assert run(study, "--out", store, "--workers", 1) == 0
    assert contents(store) == whole


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root may mount a small disk")
def test_on_a_disk_that_is_full(study, tmp_path, whole):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "none", disk], capture_output=True, check=False)
    if mounted.returncode != 0:
        pytest.skip("no small disk can be mounted here")
    try:
        filler = disk / "filler"
        store = disk / "study.zarr"
        assert run(study, "--out", store, "--chunks", "0", "--workers", 1) == 0
        with filler.open("wb", buffering=0) as file:
            try:
                while file.write(b"0" * 4096):
                    pass
            except OSError:
                pass
        assert run(study, "--out", store, "--workers", 1) == 1
        assert len(markers(store)) == 1
        filler.unlink()
        assert run(study, "--out", store, "--workers", 1) == 0
        assert contents(store) == whole
    finally:
        subprocess.run(["umount", disk], check=True)
