"""Files that cannot be written: one line, the answer printed, and nothing left behind, however the process ends."""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from chuteflow import InputError
from chuteflow.cli.program import main
from chuteflow.io.writing import require_writable, write_whole

PAPER = ["--slope", "0.3", "--e", "0.8", "--ew", "0.8", "--roughness", "0.6"]
#: Commands that write a file of their own beside what they print, and some of what they print.
COMMANDS = {
    "solve": (["solve", *PAPER, "--flux", "3"], "searched:"),
    "curve": (["curve", *PAPER, "--points", "40"], "searched:"),
    "boundary": (["boundary", "--slope", "0.29:0.31", *PAPER[2:], "--samples", "2"], "searched:"),
    "domain": (
        ["domain", "--ew", "0.7:0.9", "--roughness", "0.55:0.65", *PAPER[:4], "--size", "40x40", "--tolerance", "0.1",
         "--processes", "1"], "searched:",
    ),
    "relax": (["relax", *PAPER, "--flux", "3", "--duration", "20"], "closure lun"),
    "growth": (
        ["growth", *PAPER, "--flux", "3", "--size", "4x4", "--kx", "0:0.01", "--ky", "0.01:0.02"], "largest growth",
    ),
    "stability": (["stability", *PAPER, "--flux", "3", "--kx", "0.01", "--ky", "0.1"], "searched:"),
}  # fmt: skip
SAVED = {name: (".csv", ".json") if name in ("relax", "growth", "stability") else (".nc", ".csv", ".json")
         for name in COMMANDS}  # fmt: skip


@pytest.fixture
def full_disk(monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)


@pytest.mark.parametrize("name", ["solve", *(pytest.param(n, marks=pytest.mark.slow) for n in [*COMMANDS][1:])])
def test_a_full_disk_does_not_cost_the_answer(name, capsys, tmp_path, full_disk):
    command, said = COMMANDS[name]
    for suffix in SAVED[name]:
        saved = tmp_path / f"a{suffix}"
        assert main([*command, "--save", str(saved)]) == 2
        out, err = capsys.readouterr()
        assert said in out
        assert err == f"chuteflow: cannot write {saved}: No space left on device\n"
    files = tmp_path / f"a{SAVED[name][0]}", tmp_path / "a.svg"
    assert main([*command, "--save", str(files[0]), "--plot", str(files[1])]) == 2
    out, err = capsys.readouterr()
    assert said in out
    assert err == "chuteflow: " + "; ".join(f"cannot write {path}: No space left on device" for path in files) + "\n"
    assert list(tmp_path.iterdir()) == []


def test_claims_that_cannot_be_written_are_printed(capsys, tmp_path, full_disk):
    code = main(["claims", "--only", "moderate-density", "--out", str(tmp_path / "claims.json")])
    out, err = capsys.readouterr()
    assert code == 2
    assert '"id": "moderate-density"' in out
    assert len(err.splitlines()) == 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="limits of files are those of POSIX")
@pytest.mark.parametrize("suffix", [".nc", ".csv", ".json"])
def test_a_limit_on_files_is_one_line(suffix, tmp_path):
    """As a disk of 3 kB: HDF5 used to end the process with a segmentation fault."""
    program = f"ulimit -f 3; exec {sys.executable} -m chuteflow solve {' '.join(PAPER)} --flux 3 --save x{suffix}"
    done = subprocess.run(["bash", "-c", program], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert "searched: T_surface" in done.stdout
    assert done.stderr == f"chuteflow: cannot write x{suffix}: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_what_is_there_is_replaced_in_one_step(tmp_path):
    path = tmp_path / "a.csv"
    write_whole(path, "old\n")
    path.chmod(0o640)
    with path.open() as kept:
        write_whole(path, b"new\n")
        assert path.read_text() == "new\n"
        assert kept.read() == "old\n"
    assert path.stat().st_mode & 0o777 == 0o640
    link = tmp_path / "link.csv"
    link.symlink_to(path)
    write_whole(link, "newer\n")
    assert link.is_symlink()
    assert path.read_text() == "newer\n"


@pytest.mark.parametrize("unnamed", [True, False])
def test_files_are_written_with_and_without_a_name(unnamed, tmp_path, monkeypatch):
    if not unnamed:
        monkeypatch.delattr(os, "O_TMPFILE", raising=False)
    path = tmp_path / "a.json"
    assert require_writable(path, (".json",)) == ".json"
    assert list(tmp_path.iterdir()) == []
    write_whole(path, "x" * 100_000)
    assert path.stat().st_size == 100_000
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["a\0b.nc", "x" * 300 + ".nc", "a.nc/b.nc"])
def test_names_that_no_file_can_have(name, tmp_path):
    (tmp_path / "a.nc").touch()
    with pytest.raises(InputError, match="cannot write"):
        require_writable(f"{tmp_path}/{name}", (".nc",))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="whether a process lives is asked on POSIX")
def test_files_of_killed_processes_are_removed_and_those_of_others_stay(tmp_path):
    code = (
        "import os, sys, time\n"
        "from chuteflow.io import writing\n"
        "path = writing._beside(writing._target('a.csv'))\n"
        "path.write_text('half')\n"
        "print(path.name, flush=True)\n"
        "time.sleep(60)\n"
    )
    own = tmp_path / ".chuteflow-notes.txt"
    own.touch()
    with started(code, tmp_path) as killed, started(code, tmp_path) as alive:
        names = [process.stdout.readline().strip() for process in (killed, alive)]
        killed.kill()
        killed.wait()
        write_whole(tmp_path / "b.csv", "whole\n")
        assert {path.name for path in tmp_path.iterdir()} == {names[1], own.name, "b.csv"}
        alive.kill()


def started(code, folder) -> Any:
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=folder)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="killed as on POSIX")
def test_a_kill_while_saving_leaves_nothing_half_done(tmp_path):
    """Killed at random times while one file is saved again and again."""
    code = (
        "from chuteflow import Chute, flows, save\n"
        "found = flows(Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)\n"
        "print('ready', flush=True)\n"
        "while True:\n"
        "    for suffix in ('.nc', '.csv', '.json'):\n"
        "        save(found, 'a' + suffix)\n"
    )
    for i in range(12):
        with started(code, tmp_path) as process:
            process.stdout.readline()
            time.sleep(0.3 + 0.013 * i)
            process.kill()
    from chuteflow import load

    for suffix in (".nc", ".csv", ".json"):
        assert len(load(tmp_path / f"a{suffix}")) == 3  # pyright: ignore[reportArgumentType]
    write_whole(tmp_path / "b.csv", "whole\n")
    assert not list(Path(tmp_path).glob(".chuteflow-*"))
