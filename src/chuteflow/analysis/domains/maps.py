"""Maps of the domains of existence: classes over two parameters, and the boundaries between them.

The outer axis gets as many columns as the boundaries ask for (:mod:`chuteflow.analysis.domains.columns`), which are
worked out side by side in processes; the grid of the map is read off them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from chuteflow.analysis.domains.columns import Column, between, column, shares_for, to_halve
from chuteflow.analysis.domains.plane import CODES, Axis, Code, Plane
from chuteflow.analysis.ranges import LARGEST_HOLDUP, SURFACE_TEMPERATURE, Range
from chuteflow.errors import InputError
from chuteflow.steady.chute import Chute

#: Shares of an axis to which boundaries are located, unless another is asked for; the finest allowed.
TOLERANCE, FINEST = 1e-3, 1e-6
#: Columns to begin with, and places along a column that are always looked at: at first, and later.
_FIRST_COLUMNS, _GUARDS, _LATER_GUARDS = 65, 33, 9
#: Progress: columns done, and columns known to be needed.
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Domain:
    """Classes over ``plane`` on a grid, and the columns from which they are read.

    ``x`` (m,) and ``y`` (n,) are the centres of the cells. All else on the grid is (n, m), row by row from the
    lowest y. ``tolerance`` is the share of either axis to which boundaries are known.
    """

    plane: Plane
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    codes: NDArray[np.int16]
    columns: tuple[Column, ...]
    tolerance: float

    @cached_property
    def hot(self) -> NDArray[np.int8]:
        """Whether there are hot flows, in closed form: 1, 0, or -1 where the theory does not say (interface)."""
        return self._named("hot").astype(np.int8)

    @cached_property
    def exists(self) -> NDArray[np.bool_]:
        """Whether there is any flow in the range searched."""
        return self._named("families") > 0

    @cached_property
    def most(self) -> NDArray[np.int16]:
        """The largest number of flows that share one mass flux."""
        return self._named("most")

    @cached_property
    def families(self) -> NDArray[np.int16]:
        """The number of families: connected sets of flows in the range searched."""
        return self._named("families")

    @cached_property
    def hidden(self) -> NDArray[np.bool_]:
        """Whether there are hidden families: more than one, so that no continuation from one flow meets all."""
        return self._named("families") > 1

    @cached_property
    def interior(self) -> NDArray[np.int16]:
        """Bits of the kinds of interior among the flows: see chuteflow.analysis.domains.kinds.INTERIORS."""
        return self._named("interior")

    @cached_property
    def density(self) -> NDArray[np.int16]:
        """Bits of the kinds of density among the flows: see chuteflow.analysis.domains.kinds.DENSITIES."""
        return self._named("density")

    @cached_property
    def exists_at(self) -> NDArray[np.bool_]:
        """Whether there is a flow at each temperature asked for, (T, n, m)."""
        return np.moveaxis(self.codes[..., len(CODES) :], -1, 0) > 0

    def _named(self, name: str) -> NDArray[np.int16]:
        return self.codes[..., CODES.index(name)]


def domain(
    chute: Chute,
    x: Axis,
    y: Axis,
    *,
    size: tuple[int, int] = (400, 400),
    temperatures: Sequence[float] = (),
    tolerance: float = TOLERANCE,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Domain:
    """Which flows there are, over two parameters.

    Args:
        chute: all other parameters; those of the axes are ignored.
        x, y: the axes, any two of the four parameters.
        size: cells along x and y.
        temperatures: surface temperatures at which flows are looked for too.
        tolerance: share of an axis to which boundaries are located, from 1e-6 to 0.1.
        surface_temperature: range searched.
        largest_holdup: range searched.
        workers: processes; by default one for each processor, at most 8. With 1 all is done in this process.
        progress: told how many columns are done, and how many are known to be needed.

    Raises:
        InputError: for a size, tolerance, temperature or range out of bounds, or where a corner is no chute.
    """
    if not (min(size) >= 1 and max(size) <= 5000):
        raise InputError(f"size {size[0]}x{size[1]}: must be from 1x1 to 5000x5000")
    if not FINEST <= tolerance <= 0.1:
        raise InputError(f"tolerance = {tolerance:g}: must be from {FINEST:g} to 0.1, as a share of an axis")
    within = Range.checked(surface_temperature, largest_holdup, chute.surface)
    for t in temperatures:
        if not within.coldest <= t <= within.hottest:
            raise InputError(
                f"temperature {t:g}: must be in the range searched, {within.coldest:g} to {within.hottest:g}"
            )
    plane = Plane(x, y, chute, tuple(map(float, temperatures)), within)
    with _pool(workers) as pool:
        columns = _columns(plane, tolerance, pool, progress or (lambda done, known: None))
    grid = _on_grid(columns, *(size[::-1] if plane.transposed else size))
    codes = grid if plane.transposed else np.swapaxes(grid, 0, 1)
    return Domain(plane, x.at(_centres(size[0])), y.at(_centres(size[1])), codes, tuple(columns), tolerance)


@contextmanager
def _pool(workers: int | None) -> Iterator[Executor | None]:
    """Processes to compute in, or None for this one."""
    count = min(os.cpu_count() or 1, 8) if workers is None else workers
    if count < 1:
        raise InputError(f"workers = {count}: must be at least 1")
    if count == 1:
        yield None
        return
    pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _columns(plane: Plane, tolerance: float, pool: Executor | None, progress: Progress) -> list[Column]:
    """Columns as many as it takes, from left to right."""
    places = np.linspace(0.0, 1.0, _FIRST_COLUMNS).tolist()
    tasks = [(plane, place, shares_for(place, (), _GUARDS, tolerance), tolerance) for place in places]
    columns: list[Column] = []
    while tasks:
        known = len(columns) + len(tasks)
        for found in _computed(tasks, pool):
            columns.append(found)
            progress(len(columns), known)
        columns.sort(key=lambda one: one.place)
        tasks = [
            (plane, place, shares_for(place, columns[i : i + 2], _LATER_GUARDS, tolerance), tolerance)
            for i, place in to_halve(columns, tolerance, tolerance)
        ]
    return columns


_Task = tuple[Plane, float, list[float], float]


def _computed(tasks: Sequence[_Task], pool: Executor | None) -> Iterator[Column]:
    return map(_column, tasks) if pool is None else pool.map(_column, tasks)


def _column(task: _Task) -> Column:
    return column(*task)


def _centres(count: int) -> NDArray[np.float64]:
    return (np.arange(count) + 0.5) / count


def _on_grid(columns: Sequence[Column], outer: int, inner: int) -> NDArray[np.int16]:
    """The classes at the centres of cells, (outer, inner, codes)."""
    places = np.array([one.place for one in columns])
    shares = _centres(inner)
    grid = np.empty((outer, inner, len(columns[0].codes[0])), dtype=np.int16)
    for i, place in enumerate(_centres(outer)):
        stops, codes = _row_at(columns, places, float(place))
        grid[i] = np.array(codes, dtype=np.int16)[np.searchsorted(stops, shares, side="right")]
    return grid


def _row_at(
    columns: Sequence[Column], places: NDArray[np.float64], place: float
) -> tuple[Sequence[float], tuple[Code, ...]]:
    """Stops and classes at a place: on the line between two columns, or those of the nearer one."""
    right = int(np.clip(np.searchsorted(places, place), 1, len(columns) - 1))
    pair = columns[right - 1], columns[right]
    if pair[0].codes == pair[1].codes:
        return between(*pair, place), pair[0].codes
    nearer = min(pair, key=lambda one: abs(one.place - place))
    return nearer.stops, nearer.codes
