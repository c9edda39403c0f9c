"""Runs of LAMMPS in folders: their input files, start, progress and resumption."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from chuteflow import __version__
from chuteflow.dem import script
from chuteflow.dem.engine import Engine, EngineError, engine, reason
from chuteflow.dem.output import read_totals, trim
from chuteflow.dem.scene import Scene
from chuteflow.dem.script import Schedule, Steps
from chuteflow.errors import InputError
from chuteflow.io.writing import write_whole

#: What a folder says of its run.
RECORD, LOCK = "run.json", "run.lock"
#: Bytes of a disk that are left free.
_SPARE = 30_000_000
#: Grains are at rest where the mean squares of their velocities are below this; so many blocks of it are measured.
_STILL, _RESTING = 1e-9, 4
#: Lines of output that are kept to explain a failure.
_KEPT = 200
_STEP = re.compile(r"\s*(\d+)\s+[-\d.e+]+")


@dataclass(frozen=True)
class Run:
    """A scene and a schedule in a folder."""

    folder: Path
    scene: Scene
    schedule: Schedule

    @property
    def steps(self) -> Steps:
        """The schedule in time steps."""
        return Steps.of(self.schedule, self.scene.contacts.time_step)

    @property
    def done(self) -> int:
        """Time steps whose sums are written."""
        with suppress(InputError, ValueError):
            steps, _ = read_totals(self.folder / script.TOTALS)
            return int(steps[-1]) if len(steps) else 0
        return 0

    @property
    def is_at_rest(self) -> bool:
        """Whether no grain moves any more, and that was measured."""
        with suppress(InputError, ValueError):
            steps, totals = read_totals(self.folder / script.TOTALS)
            enough = self.steps.first + _RESTING * self.steps.block
            return len(steps) > 0 and steps[-1] >= enough and totals[-1, 2:4].max() < _STILL
        return False

    @property
    def is_complete(self) -> bool:
        """Whether it has reached its last step, or its grains are at rest."""
        return self.done >= self.steps.last or self.is_at_rest


@dataclass(frozen=True)
class Moment:
    """The progress of a run: its time step, the last one, and the time."""

    step: int
    last: int
    time: float


def prepare(folder: str | os.PathLike[str], scene: Scene, schedule: Schedule) -> Run:
    """The run in ``folder``, with its input files; an existing run must be of the same scene, and goes
    on to the end of ``schedule``.

    Raises:
        InputError: for a folder that holds something else or cannot be written, or a disk that is too small.
    """
    path = Path(folder)
    run = Run(path, scene, schedule)
    if (path / RECORD).exists():
        there = read_record(path)
        lengths = {"settle": schedule.settle, "measure": schedule.measure}
        if there.scene != scene or replace(there.schedule, **lengths) != schedule:
            raise InputError(f"{folder} holds another run: name another folder, or remove it")
        if there.schedule != schedule:
            _write(run, (script.SETTINGS, script.START, script.RESUME))
        return run
    try:
        path.mkdir(parents=True, exist_ok=True)
        others = [entry.name for entry in path.iterdir() if entry.name != LOCK]
    except OSError as error:
        raise InputError(f"cannot write {folder}: {error.strerror or error}") from None
    if others:
        raise InputError(f"{folder} is not empty and holds no run: name another folder")
    needed, free = script.estimate_bytes(scene, schedule), shutil.disk_usage(path).free
    if needed + _SPARE > free:
        raise InputError(
            f"the run would write about {needed / 1e6:.0f} MB into {folder}, where {free / 1e6:.0f} MB are free and "
            f"{_SPARE / 1e6:.0f} MB have to stay free: give a shorter --measure or a longer --frame"
        )
    _write(run, (script.DATA, script.SETTINGS, script.START, script.RESUME))
    return run


def _write(run: Run, names: tuple[str, ...]) -> None:
    """Write input files, and last the record, which makes a folder that of a run."""
    inputs = script.files(run.scene, run.schedule)
    for name in names:
        write_whole(run.folder / name, inputs[name])
    record = {"chuteflow": __version__, "scene": run.scene.as_dict(), "schedule": asdict(run.schedule)}
    write_whole(run.folder / RECORD, json.dumps(record, indent=1) + "\n")


def read_record(folder: str | os.PathLike[str]) -> Run:
    """The run that a folder holds.

    Raises:
        InputError: for a folder that holds none.
    """
    path = Path(folder) / RECORD
    try:
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return Run(Path(folder), Scene.of(record["scene"]), Schedule(**record["schedule"]))
    except OSError as error:
        raise InputError(f"{folder} holds no run of chuteflow: {RECORD}: {error.strerror or error}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{path} is damaged, or was not written by chuteflow") from None


def go_on(run: Run, processes: int = 1) -> Generator[Moment, None, None]:
    """Run or resume LAMMPS to the end of the schedule, and yield the progress.

    Raises:
        EngineError: where LAMMPS is missing or fails, naming the reason; what was written is kept.
        InputError: where another process uses the same run.
    """
    with _locked(run.folder):
        if run.is_complete:
            return
        chosen = engine(processes)
        states = _states(run.folder)
        for number, state in enumerate(states or [None]):
            arguments = _resume(run, state) if state else _from_start(run)
            try:
                yield from _watch(run, chosen, arguments)
                return
            except _StateError:
                if number + 1 == max(len(states), 1):
                    raise EngineError(
                        f"neither restart file of {run.folder} can be read: remove them to begin again"
                    ) from None


class _StateError(Exception):
    """A restart file that is incomplete."""


def _states(folder: Path) -> list[Path]:
    """The restart files, the newest first."""
    found = [folder / name for name in script.STATES if (folder / name).exists()]
    return sorted(found, key=lambda path: path.stat().st_mtime_ns, reverse=True)


def _from_start(run: Run) -> list[str]:
    for name in script.WRITTEN:
        (run.folder / name).unlink(missing_ok=True)
    return ["-in", script.START]


def _resume(run: Run, state: Path) -> list[str]:
    trim(run.folder, script.WRITTEN)
    return ["-in", script.RESUME, "-var", "from", state.name]


def _watch(run: Run, chosen: Engine, arguments: list[str]) -> Iterator[Moment]:
    command = [*chosen.command, *arguments, "-log", script.LOG]
    steps = run.steps
    lines: deque[str] = deque(maxlen=_KEPT)
    with _child(command, run.folder, chosen.environment) as child:
        assert child.stdout is not None
        for line in child.stdout:
            lines.append(line)
            found = _STEP.match(line)
            if found:
                step = int(found[1])
                yield Moment(step, steps.last, step * steps.step)
                if shutil.disk_usage(run.folder).free < _SPARE:
                    raise EngineError(f"the disk is almost full: stopped; the data in {run.folder} are kept")
                if step % steps.block == 0 and run.is_at_rest:
                    return
        code = child.wait()
    output = "".join(lines)
    if code == 0 and run.is_complete:
        return
    if "read_restart" in output and "ERROR" in output:
        raise _StateError
    kept = f"; the data up to step {run.done} of {steps.last} in {run.folder} are kept" if run.done else ""
    again = "; the same command goes on" if kept and "ERROR" not in output else ""
    raise EngineError(f"{reason(output, code)}{kept}{again}")


@contextmanager
def _child(command: list[str], folder: Path, environment: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    try:
        child = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            preexec_fn=_end_with_parent if sys.platform == "linux" else None,
        )
    except OSError as error:
        raise EngineError(f"LAMMPS cannot be started: {command[0]}: {error.strerror or error}") from None
    try:
        yield child
    finally:
        if child.poll() is None:
            child.terminate()
            with suppress(subprocess.TimeoutExpired):
                child.wait(1.0)
            child.kill()
        child.wait()
        if child.stdout is not None:
            child.stdout.close()


def _end_with_parent() -> None:
    """Have the system end this process with the one that started it, however that ends."""
    import ctypes

    set_signal_at_death = 1  # PR_SET_PDEATHSIG
    ctypes.CDLL(None).prctl(set_signal_at_death, signal.SIGKILL)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock the folder against other processes."""
    from filelock import FileLock, Timeout

    lock = FileLock(folder / LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise InputError(f"another process uses the run in {folder}") from None
    except OSError as error:
        raise InputError(f"cannot write {folder}: {error.strerror or error}") from None
    try:
        yield
    finally:
        lock.release()
