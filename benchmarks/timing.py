"""Medians of repeated runs, and one table of them."""

from __future__ import annotations

import resource
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

from chuteflow.branches.solution_branches import find_branches
from chuteflow.trajectories.refining import integrate_trajectories


@dataclass(frozen=True)
class Row:
    """One line: what was measured, ``value`` and ``unit``, ``cpu`` time in ms, and a note.

    ``target`` is aimed at, and ``limit`` not to be passed. ``best`` tells whether small or large values are good. A
    time is compared by the processor time where there is one: on a quiet machine the two are the same.
    """

    what: str
    value: float | None
    unit: str
    cpu: float | None = None
    target: float | None = None
    limit: float | None = None
    best: str = "small"
    note: str = ""

    @property
    def verdict(self) -> str:
        if self.value is None or self.target is None:
            return ""
        limit = self.target if self.limit is None else self.limit
        sign = 1.0 if self.best == "small" else -1.0
        compared = sign * (self.value if self.cpu is None else self.cpu)
        if compared <= sign * self.target:
            return "met"
        return "within limit" if compared <= sign * limit else "MISSED"


@dataclass(frozen=True)
class Time:
    """Medians in ms: ``wall`` as the user waits, ``cpu`` as the processor works, which a busy machine leaves alone."""

    wall: float
    cpu: float


def median_time(run: Callable[[], object], repeats: int, before: Callable[[], object] | None = None) -> Time:
    """Median time of ``run``, processes that it waits for included; ``before`` runs ahead, outside the clock."""
    walls, cpus = [], []
    for _ in range(repeats):
        if before is not None:
            before()
        wall, cpu = time.perf_counter(), _processor_time()
        run()
        cpus.append(1e3 * (_processor_time() - cpu))
        walls.append(1e3 * (time.perf_counter() - wall))
    return Time(statistics.median(walls), statistics.median(cpus))


def forget() -> None:
    """Clear every cache of the package."""
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] == "chuteflow":
            for thing in vars(module).values():
                if hasattr(thing, "cache_clear"):
                    thing.cache_clear()


def forget_search() -> None:
    """Forget the branches of the last chutes, and nothing else."""
    find_branches.cache_clear()
    integrate_trajectories.cache_clear()


def _processor_time() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def table(rows: list[Row]) -> str:
    """The rows as text."""
    lines = [("what", "measured", "cpu", "target", "limit", "", "")]
    for row in rows:
        sign = "<" if row.best == "small" else ">"
        lines.append(
            (
                row.what,
                "-" if row.value is None else f"{row.value:.3g} {row.unit}".strip(),
                "" if row.cpu is None else f"{row.cpu:.3g} ms",
                "" if row.target is None else f"{sign} {row.target:g}",
                "" if row.limit is None else f"{sign} {row.limit:g}",
                row.verdict,
                row.note,
            )
        )
    widths = [max(len(line[i]) for line in lines) for i in range(7)]
    out = []
    for line in lines:
        cells = [line[0].ljust(widths[0]), *(line[i].rjust(widths[i]) for i in (1, 2, 3, 4)), line[5].ljust(widths[5])]
        out.append("  ".join([*cells, line[6]]).rstrip())
    return "\n".join(out)
