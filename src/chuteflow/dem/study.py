"""The study of theory and particle simulations: its runs, each in a folder that can be resumed."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from chuteflow.dem.contacts import Bounds
from chuteflow.dem.run import RECORD, Run, prepare, read_record
from chuteflow.dem.scene import Scene
from chuteflow.dem.script import Schedule
from chuteflow.dem.start import start_near_theory
from chuteflow.steady.chute import Chute

#: e, slope, M and r of the hot flows; the base has the restitution of the grains.
HOT = (
    (0.95, 0.18, 1.264, 0.6),
    (0.95, 0.15, 0.6, 0.6),
    (0.9, 0.25, 1.3, 0.6),
    (0.98, 0.12, 1.3, 0.7),
    (0.93, 0.2, 1.3, 0.6),
    (0.95, 0.18, 1.3, 0.7),
    (0.9, 0.22, 0.6, 0.6),
    (0.9, 0.25, 1.3, 0.7),
    (0.98, 0.1, 0.6, 0.6),
    (0.95, 0.2, 1.3, 0.7),
    (0.95, 0.18, 3.0, 0.6),
    (0.93, 0.22, 3.0, 0.6),
    (0.98, 0.12, 3.0, 0.7),
    (0.9, 0.25, 3.0, 0.6),
)
#: Hot flows that are simulated on random bases too.
RANDOM = (0, 2, 1, 5)
#: Hot flows that keep their state. They settle slowly, in some 1500 time units. It takes 5000 more to tell a drift of
#: their temperature of 1 % in 300 units from the fluctuations of so few grains.
LASTING = (0, 3, 9, 2)
SEEDS = (1, 2, 3)
#: The paper's chute, and the hold-ups of its flows A, B and C at Q = 3.
PAPER, PAPER_HOLDUPS = Chute(0.3, 0.8, 0.8, 0.6), {"A": 0.44, "B": 0.59, "C": 1.26}
#: Errors of the restitution in one collision; they cancel over many.
_BOUNDS = Bounds(restitution=3e-3)
_SCHEDULE = Schedule(settle=300.0, measure=900.0)
_LONG = Schedule(settle=1500.0, measure=5400.0)
_BOX, _SMALLER_BOX = (12.0, 12.0), (9.0, 9.0)
#: Flows on which the theory has waves across the slope that grow, by their numbers among the hot ones, each with a box
#: that is about as wide as the fastest of them is long.
WAVY = {13: (9.0, 48.0), 11: (9.0, 60.0)}
_WAVE_SCHEDULE = Schedule(settle=100.0, measure=300.0)


@dataclass(frozen=True)
class StudyCase:
    """One run of the study: its name, which is that of its folder, its scene and its schedule."""

    name: str
    scene: Scene
    schedule: Schedule = _SCHEDULE


def cases() -> Iterator[StudyCase]:
    """All runs, in the order in which they are done: every chute once before seeds are changed, and first the seeds of
    flows that keep their state."""
    done = set()
    for case in _list_in_order():
        if case.name not in done:
            done.add(case.name)
            yield case


def _list_in_order() -> Iterator[StudyCase]:
    yield from _waves()
    yield from _paper()
    yield from (_hot(0, seed) for seed in SEEDS)
    yield from _variations()
    yield from (_hot(number, 1) for number in range(11))
    yield from (_hot(number, 1, base="random") for number in (0, 2))
    yield from (_hot(number, seed) for seed in SEEDS for number in LASTING)
    for base in ("random", "triangular"):
        yield from (_hot(number, seed, base) for seed in SEEDS for number in _of(base))


def _of(base: str) -> Sequence[int]:
    return RANDOM if base == "random" else range(len(HOT))


def _hot(number: int, seed: int, base: str = "triangular") -> StudyCase:
    e, slope, holdup, roughness = HOT[number]
    box = _BOX if holdup < 2.0 else _SMALLER_BOX
    scene = Scene(Chute(slope, e, e, roughness), holdup, box=box, base=base, seed=seed, bounds=_BOUNDS)
    schedule = _LONG if number in LASTING else _SCHEDULE
    return StudyCase(f"hot{number + 1:02d}-{base}-{seed}", scene, schedule)


def _paper() -> Iterator[StudyCase]:
    for start in ("hot", "cold"):
        for name, holdup in PAPER_HOLDUPS.items():
            scene = Scene(PAPER, holdup, box=_BOX, start=start, bounds=Bounds(restitution=6e-3))
            yield StudyCase(f"paper-{name}-{start}", scene)


def _variations() -> Iterator[StudyCase]:
    """The first chute with contacts twice as stiff, half the time step, and a box of twice the length."""
    first = _hot(0, 1)
    scene = start_near_theory(first.scene)
    finer = replace(_BOUNDS, restitution=_BOUNDS.restitution / 2.0)
    for name, varied in (
        ("finer", replace(scene, bounds=finer)),
        ("longer", replace(scene, box=(2.0 * _BOX[0], _BOX[1]))),
        ("stiffer", replace(scene, stiffness=2.0 * scene.contacts.stiffness)),
    ):
        yield StudyCase(name, varied, first.schedule)


def _waves() -> Iterator[StudyCase]:
    """Flows with a wave that grows by the theory, in boxes for one wave across the slope."""
    for number, box in WAVY.items():
        scene = replace(_hot(number, 1).scene, box=box, bounds=Bounds(restitution=1e-2))
        yield StudyCase(f"wide-{number + 1}", scene, _WAVE_SCHEDULE)


def prepare_case(case: StudyCase, folder: str | os.PathLike[str]) -> Run:
    """The run of a case in its folder below ``folder``; a hot start begins near the flow of the theory."""
    path = Path(folder) / case.name
    if (path / RECORD).exists():
        scene = read_record(path).scene
    else:
        scene = start_near_theory(case.scene) if case.scene.start == "hot" else case.scene
    return prepare(path, scene, case.schedule)
