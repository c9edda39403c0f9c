"""The Q-h curve of figure 3 by AUTO-07p: boundary value problems by collocation, continued in Q through both folds.

Three unknown numbers, Q, h and M, for three conditions more than equations. What AUTO is given is in auto/: the
equations as the paper poses them, on the half-line cut at a height, and in the overburden coordinate of this package.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chuteflow import Flow
from timing import Time, median_time

Array = NDArray[np.float64]
SOURCES = Path(__file__).parent / "auto"
#: Numbers of the columns of a line of fort.7, from the end: h and M; the first after the labels is Q.
_H, _M = -2, -1
#: How AUTO marks a fold and a value that was asked for.
_FOLD, _ASKED = 5, 4


@dataclass(frozen=True)
class Setting:
    """What AUTO is given: a formulation in auto/, collocation intervals, and for the half-line where it is cut.

    The height of the cut is ``multiple`` times h, of the flow at hand or, ``fixed``, of that at the start. ``weighed``
    leaves h and T, which range over decades, out of the arclength. Either way AUTO misses something in most
    formulations; each has the better choice.
    """

    name: str
    formulation: str
    intervals: int
    multiple: float = 0.0
    fixed: bool = False
    weighed: bool = True


SETTINGS = (
    Setting("cut at 8 times the h of the start, 80 intervals", "halfline", 80, 8.0, fixed=True, weighed=False),
    Setting("cut at 8 h, 80 intervals", "halfline", 80, 8.0),
    Setting("cut at 20 h, 80 intervals", "halfline", 80, 20.0),
    Setting("overburden, 80 intervals", "overburden", 80, weighed=False),
    Setting("overburden, 40 intervals", "overburden", 40, weighed=False),
)


@dataclass(frozen=True)
class Outcome:
    """A curve by AUTO: its time, points (k, 3) in Q, h and M, folds and the flows asked for likewise, and its words."""

    time: Time
    points: Array
    folds: Array
    asked: Array
    said: str


def missing() -> str | None:
    """What is not installed, if anything."""
    if not (library() / "main.o").is_file():
        return f"AUTO-07p is not in {library().parent} (Debian package auto-07p, or set AUTO_DIR): skipped"
    return None if shutil.which("gfortran") else "gfortran is not installed: AUTO-07p is skipped"


def library() -> Path:
    """The folder of AUTO's object files."""
    return Path(os.environ.get("AUTO_DIR", "/usr/lib/auto-07p")) / "lib"


def built(formulation: str, folder: Path) -> Path:
    """The program of a formulation, compiled and linked with AUTO."""
    program = folder / formulation
    sources = [str(SOURCES / f"{name}.f90") for name in ("closures", "starting", formulation)]
    objects = [str(path) for path in sorted(library().glob("*.o"))]
    command = ["gfortran", "-O3", "-w", "-fopenmp", "-J", str(folder), *sources, *objects, "-o", str(program)]
    subprocess.run(command, check=True, capture_output=True, cwd=folder)
    return program


def traced(setting: Setting, start: Flow, last_flux: float, asked_flux: float, folder: Path, repeats: int) -> Outcome:
    """The curve from ``start`` towards smaller Q, until ``last_flux``; the program alone is timed, on one core."""
    program = built(setting.formulation, folder)
    (folder / "start.dat").write_text(_table(setting, start), encoding="ascii")
    (folder / "fort.2").write_text(_constants(setting, start, last_flux, asked_flux), encoding="ascii")
    said = ""

    def run() -> None:
        nonlocal said
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        done = subprocess.run([program], cwd=folder, capture_output=True, text=True, env=environment, check=False)
        said = done.stdout.strip()

    time = median_time(run, repeats)
    return Outcome(time, *_read(folder / "fort.7"), said)


def _table(setting: Setting, flow: Flow) -> str:
    """start.dat: the coordinate, the fields and the numbers of the start."""
    numbers = [flow.mass_flux, flow.centre_of_mass, flow.mass_holdup]
    if setting.formulation == "halfline":
        t, fields = _on_the_half_line(flow, setting.multiple)
        height = setting.multiple * flow.centre_of_mass
        numbers += [height, 0.0] if setting.fixed else [0.0, setting.multiple]
    else:
        t, fields = _in_the_overburden(flow)
    rows = np.column_stack([t, fields])
    lines = [[f"{value:.17g}" for value in row] for row in (numbers, *rows)]
    return "\n".join([f"{len(t)} {fields.shape[1]} {len(numbers)}", *map(" ".join, lines)]) + "\n"


def _on_the_half_line(flow: Flow, multiple: float) -> tuple[Array, Array]:
    t = np.linspace(0.0, 1.0, 400)
    at = flow.profile(t * multiple * flow.centre_of_mass)
    return t, np.column_stack([at.volume_fraction, at.granular_temperature, at.heat_flux, at.velocity])


def _in_the_overburden(flow: Flow) -> tuple[Array, Array]:
    t = np.linspace(0.0, 1.0, 400)
    above = flow.depth + flow.surface_temperature * np.linspace(0.02, 40.0, 2000)
    at = flow.profile(np.concatenate([np.linspace(0.0, flow.depth, 2000), above])[::-1])
    p = at.normal_stress
    log_w = np.interp(t, p / flow.mass_holdup, np.log(at.volume_fraction / p))
    y = np.interp(t, p / flow.mass_holdup, at.heat_flux / (p * np.sqrt(at.granular_temperature)))
    log_w[0], y[0] = -math.log(flow.surface_temperature), 0.0
    rate = p * at.shear_rate / at.volume_fraction
    carried = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(p))])
    return t, np.column_stack([log_w, y, t, np.interp(t, p / flow.mass_holdup, carried)])


def _constants(setting: Setting, start: Flow, last_flux: float, asked_flux: float) -> str:
    """fort.2: AUTO's constants, of which EPS and DS decide the accuracy and the steps."""
    halfline = setting.formulation == "halfline"
    of_parameters = "{2: 0.0}" if setting.weighed else "{}"
    of_fields = "{2: 0.0}" if setting.weighed and halfline else "{}"
    return f"""NDIM = 4, IPS = 4, IRS = 0, ILP = 1, NBC = {3 if halfline else 5}, NINT = {3 if halfline else 1}
ICP = [1, 2, 3], NTST = {setting.intervals}, NCOL = 4, IAD = 3, ISP = 0, ISW = 1, IPLT = 0
NMX = 500, NPR = 10000, MXBF = 0, IID = 0, ITMX = 20, ITNW = 7, NWTN = 3, JAC = 0
EPSL = 1e-10, EPSU = 1e-10, EPSS = 1e-8, DS = -0.1, DSMIN = 1e-6, DSMAX = 0.5, IADS = 1
THL = {of_parameters}, THU = {of_fields}
UZR = {{1: [{asked_flux}]}}, UZSTOP = {{1: [{last_flux}, {2.0 * start.mass_flux}]}}
"""


def _read(path: Path) -> tuple[Array, Array, Array]:
    """Points, folds and the flows asked for, each (k, 3)."""
    found: dict[int, list[list[float]]] = {0: [], _FOLD: [], _ASKED: []}
    for line in path.read_text(encoding="ascii").splitlines():
        words = line.split()
        if len(words) < 8 or words[0] == "0":
            continue
        kind, numbers = abs(int(words[2])) % 10, [float(word) for word in words[4:]]
        row = [numbers[0], numbers[_H], numbers[_M]]
        if np.isfinite(row).all():
            found[0].append(row)
            if kind in found:
                found[kind].append(row)
    return tuple(np.reshape(rows, (-1, 3)) for rows in found.values())
