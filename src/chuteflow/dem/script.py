"""The input of LAMMPS for a scene: files for any LAMMPS that has the package GRANULAR.

A folder holds grains.data (all positions), settings.in (everything but where the grains come from), start.in and
resume.in. LAMMPS writes layers.txt, totals.txt, waves.txt, contacts.dump and the restart files state.a and state.b
into it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chuteflow.checks import number
from chuteflow.dem.contacts import Contacts
from chuteflow.dem.scene import Scene, bump_positions, starting_grains
from chuteflow.errors import InputError

#: Names of the files in the folder of a run.
DATA, SETTINGS, START, RESUME = "grains.data", "settings.in", "start.in", "resume.in"
LAYERS, TOTALS, WAVES, CONTACTS, LOG = "layers.txt", "totals.txt", "waves.txt", "contacts.dump", "log.lammps"
#: What LAMMPS appends to.
WRITTEN = (LAYERS, TOTALS, WAVES, CONTACTS)
STATES = ("state.a", "state.b")
#: Height of the bins of layers.txt.
BIN = 0.1
#: What layers.txt has of each bin beside the number of grains: means over the grains in it.
MOMENTS = ("vx", "vy", "vz", "xx", "yy", "zz", "xz", "ex", "ez")
#: What totals.txt has in each line.
SUMS = ("flux", "height", "yy", "zz", "force_x", "force_z")
#: What waves.txt has in each line: means over all grains of the cosine and the sine of the longest wave that fits into
#: the box along and across the slope, and of the same times the velocity.
WAVE_PARTS = tuple(
    f"{part}_{weight}{direction}" for direction in ("x", "y") for weight in ("", "v") for part in ("cos", "sin")
)
#: Times between samples of the velocities, between lines of totals.txt and between frames of contacts.dump.
_SAMPLE, _LINE = 0.05, 1.0
_MOST_BLOCKS = 1000


@dataclass(frozen=True)
class Schedule:
    """How long a run is, in time units: it settles, and then it is measured in blocks of ``block`` each.

    ``frame`` is the time between two snapshots of the grains in contact.
    """

    settle: float = 300.0
    measure: float = 300.0
    block: float = 10.0
    frame: float = 0.05

    def __post_init__(self) -> None:
        for name, low, high in (
            ("settle", 0.0, 1e7),
            ("measure", 1.0, 1e7),
            ("block", 0.5, 1e6),
            ("frame", 1e-3, 100.0),
        ):
            object.__setattr__(self, name, number(name, getattr(self, name), low, high))
        if not 4 <= self.blocks <= _MOST_BLOCKS:
            raise InputError(
                f"measure = {self.measure:g} in blocks of {self.block:g}: there must be 4 to {_MOST_BLOCKS} blocks"
            )

    @property
    def blocks(self) -> int:
        """Blocks that are measured."""
        return round(self.measure / self.block)

    @property
    def settling_blocks(self) -> int:
        """Blocks before those."""
        return math.ceil(self.settle / self.block - 1e-9)


@dataclass(frozen=True)
class Steps:
    """A schedule in time steps."""

    step: float
    sample: int
    line: int
    frame: int
    block: int
    first: int
    last: int

    @classmethod
    def of(cls, schedule: Schedule, step: float) -> Steps:
        """Whole numbers of steps, each a multiple of that before where LAMMPS asks for it."""
        sample = max(round(_SAMPLE / step), 1)
        line = sample * max(round(min(_LINE, schedule.block) / (sample * step)), 1)
        block = line * max(round(schedule.block / (line * step)), 1)
        frame = max(round(schedule.frame / step), 1)
        first = schedule.settling_blocks * block
        return cls(step, sample, line, frame, block, first, first + schedule.blocks * block)


def files(scene: Scene, schedule: Schedule) -> dict[str, str]:
    """The input files by name."""
    steps = Steps.of(schedule, scene.contacts.time_step)
    opening = "# A chute with grains, made by chuteflow: lengths in d, times in sqrt(d/(g cos theta)).\n"
    head = (
        f"{opening}units lj\natom_style sphere\nboundary p p fs\nnewton off\ncomm_modify vel yes\n"
        # What one rank has to hear of its neighbours; there may be many empty bins above.
        "atom_modify map array\n"
    )
    run = f"run {steps.last} upto\nwrite_restart {STATES[0]}\n"
    return {
        DATA: _data(scene),
        SETTINGS: _settings(scene, steps),
        START: f"{head}read_data {DATA}\ninclude {SETTINGS}\n{run}",
        RESUME: f"{head}variable from index {STATES[0]}\nread_restart ${{from}}\ninclude {SETTINGS}\n{run}",
    }


def _data(scene: Scene) -> str:
    bumps, grains = bump_positions(scene), starting_grains(scene)
    count, (length, width) = scene.grains, scene.size
    highest = float(grains.position[:, 2].max()) + 2.0
    lines = [
        "grains (type 1) and bumps (type 2)",
        "",
        f"{count + len(bumps)} atoms",
        "2 atom types",
        "",
        f"0 {length!r} xlo xhi",
        f"0 {width!r} ylo yhi",
        f"-2 {highest!r} zlo zhi",
        "",
        "Atoms # sphere",
        "",
    ]
    # id, type, diameter, density, position; nothing weighs the bumps, which never move.
    lines += [f"{i} 1 1 1 {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(grains.position.tolist(), 1)]
    d = scene.bump_diameter
    lines += [f"{count + i} 2 {d!r} 1 {x!r} {y!r} 0" for i, (x, y) in enumerate(bumps.tolist(), 1)]
    lines += ["", "Velocities", ""]
    lines += [f"{i} {u!r} {v!r} {w!r} 0 0 0" for i, (u, v, w) in enumerate(grains.velocity.tolist(), 1)]
    lines += [f"{count + i} 0 0 0 0 0 0" for i in range(1, len(bumps) + 1)]
    return "\n".join(lines) + "\n"


def _settings(scene: Scene, steps: Steps) -> str:
    contacts, slope = scene.contacts, scene.chute.slope
    bins = round(scene.top / BIN)
    rotation = "omegax omegay omegaz" if scene.friction else ""
    lines = [
        "group base type 2",
        "group grains type 1",
        "neighbor 0.3 bin",
        "neigh_modify every 1 delay 0 check yes exclude group base base",
        *contact_lines(contacts),
        f"timestep {steps.step!r}",
        f"fix gravity grains gravity {math.hypot(1.0, slope)!r} vector {slope!r} 0 -1",
        "fix base base freeze",
        f"fix plane grains wall/gran granular {_law(contacts, contacts.wall_restitution)} zplane 0 NULL",
        f"fix motion grains nve{'/sphere' if scene.friction else ''}",
        "thermo_modify lost error flush yes",
        f"thermo {steps.line}",
        "",
        "# Means over the grains in layers of equal height, the last of them with all grains above it.",
        f"compute layer grains chunk/atom bin/1d z 0.0 {BIN} units box bound z 0.0 {bins * BIN:g} nchunk once ids "
        "every discard no",
        *(f"variable {name} atom {formula}" for name, formula in _PER_GRAIN.items()),
        f"fix layers grains ave/chunk {steps.sample} {steps.block // steps.sample} {steps.block} layer "
        f"{' '.join('v_' + name for name in MOMENTS)} norm all append {LAYERS} format ' %.10g'",
        "",
        "# Sums over all grains: flux, height of the centre of mass, mean squares, and the force on the bumps.",
        *(f"compute mean_{name} grains reduce ave v_{name}" for name in ("vx", "height", "yy", "zz")),
        f"fix totals all ave/time {steps.sample} {steps.line // steps.sample} {steps.line} c_mean_vx c_mean_height "
        f"c_mean_yy c_mean_zz f_base[1] f_base[3] append {TOTALS} format ' %.10g'",
        "",
        "# The longest waves that fit into the box: density, and momentum down the slope.",
        *(f"variable {name} atom {formula}" for name, formula in _wave_formulas(scene).items()),
        f"compute waves grains reduce ave {' '.join('v_' + name for name in WAVE_PARTS)}",
        f"fix waves grains ave/time {steps.sample} {steps.line // steps.sample} {steps.line} c_waves[*] "
        f"append {WAVES} format ' %.10g'",
        "",
        "# The grains that touch another, a bump or the plane, from which the forces follow.",
        "compute touching all contact/atom",
        "variable touches atom (c_touching>0)||((type==1)&&(z<0.5))",
        f"dump contacts all custom {steps.frame} {CONTACTS} id type x y z vx vy vz {rotation}".rstrip(),
        "dump_modify contacts append yes thresh v_touches > 0 sort id format float %.10g",
        f"restart {steps.block} {' '.join(STATES)}",
    ]
    return "\n".join(lines) + "\n"


#: What is averaged of a grain: velocities, their products, and the flux of kinetic energy along the slope and upward.
_PER_GRAIN = {
    "vx": "vx",
    "vy": "vy",
    "vz": "vz",
    "xx": "vx*vx",
    "yy": "vy*vy",
    "zz": "vz*vz",
    "xz": "vx*vz",
    "ex": "0.5*(vx*vx+vy*vy+vz*vz)*vx",
    "ez": "0.5*(vx*vx+vy*vy+vz*vz)*vz",
    "height": "z",
}


def _wave_formulas(scene: Scene) -> dict[str, str]:
    phases = {axis: f"({2.0 * math.pi / length!r}*{axis})" for axis, length in zip("xy", scene.size, strict=True)}
    formulas = {f"{part}_{axis}": f"{part}{phase}" for axis, phase in phases.items() for part in ("cos", "sin")}
    return formulas | {name.replace("_", "_v"): f"{formula}*vx" for name, formula in formulas.items()}


def contact_lines(contacts: Contacts) -> list[str]:
    """The lines of the forces between grains (type 1), and between grains and bumps (type 2)."""
    return [
        "pair_style granular",
        f"pair_coeff 1 1 {_law(contacts, contacts.restitution)}",
        f"pair_coeff * 2 {_law(contacts, contacts.wall_restitution)}",
    ]


def _law(contacts: Contacts, restitution: float) -> str:
    ratio = contacts.tangential_ratio(restitution)
    return (
        f"hooke {contacts.stiffness!r} {restitution!r} tangential linear_nohistory {ratio!r} {contacts.friction!r} "
        "damping coeff_restitution"
    )


def estimate_bytes(scene: Scene, schedule: Schedule) -> float:
    """About how many bytes a run writes."""
    steps = Steps.of(schedule, scene.contacts.time_step)
    blocks, bins = steps.last / steps.block, scene.top / BIN
    # A tenth of the grains in contact in a frame is more than the bounds of contacts allow.
    frames = steps.last / steps.frame
    touching = 0.1 * scene.grains
    return blocks * bins * 110.0 + frames * (150.0 + 85.0 * touching)
