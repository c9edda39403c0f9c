"""Maps of the domains of existence: classes over two parameters, and the boundaries between them.

The outer axis gets as many columns as the boundaries ask for (:mod:`chuteflow.maps.columns`), which are
worked out in parallel processes; the grid of the map is read off them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from chuteflow import display
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.results import Searched
from chuteflow.checks import check_size, number
from chuteflow.errors import InputError
from chuteflow.maps.columns import (
    Classify,
    Column,
    choose_fractions,
    classify_column,
    find_intervals_to_halve,
    interpolate_column,
)
from chuteflow.maps.kinds import DENSITIES, INTERIORS
from chuteflow.maps.outlines import Outline, Region, make_regions, trace_outlines
from chuteflow.maps.plane import CODES, HOT_CODES, ParameterAxis, ParameterPlane, classify, classify_hot
from chuteflow.parameters import LARGEST_HOLDUP, SURFACE_TEMPERATURE
from chuteflow.processes import worker_pool
from chuteflow.progress import report_progress
from chuteflow.result import Result
from chuteflow.steady.chute import Chute
from chuteflow.threads import on_one_thread

#: Fractions of an axis to which boundaries are located, by default; the finest and coarsest allowed.
TOLERANCE, FINEST, COARSEST = 2e-3, 1e-6, 0.1
#: Columns to begin with; at the coarsest tolerance allowed; and in closed form.
_FIRST_COLUMNS, _FEWEST_COLUMNS, _HOT_COLUMNS = 33, 17, 129
#: Places along a column that are always looked at: at first, and later.
_GUARDS, _LATER_GUARDS = 24, 8
#: Progress: columns done, and columns known to be needed.
Progress = Callable[[int, int], None]
#: Cells along an axis at most.
LARGEST_SIZE = 5000


@dataclass(frozen=True, eq=False)
class Domain(Result):
    """Classes over ``plane``, on a grid of cells and by their outlines.

    ``x`` (m,) and ``y`` (n,) are the centres of the cells. All else on the grid is (n, m), row by row from the
    lowest y. ``tolerance`` is the share of either axis to which boundaries are known. ``columns`` are those from
    which grid and outlines are read, and ``hot_columns`` those of the closed form of section 4, none where that
    leaves out the chutes: with the interface conditions, and under laws without a temperature far above.
    """

    plane: ParameterPlane
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    tolerance: float
    columns: tuple[Column, ...]
    hot_columns: tuple[Column, ...]

    def __repr__(self) -> str:
        axes = [f"{axis.name} from {axis.low:g} to {axis.high:g}" for axis in (self.plane.x, self.plane.y)]
        cells = f"{len(self.x)} x {len(self.y)} cells"
        return display.line("Domain", cells, *axes, f"tolerance {self.tolerance:g} of the axes")

    def _repr_html_(self) -> str:
        rows = [
            [name, str(value), f"{float((values == value).mean()):.2%}"]
            for name in ("hot", "most", "families", "interior", "density")
            for values in (getattr(self, name),)
            for value in np.unique(values)
        ]
        return display.html_table(repr(self)[1:-1], ["class", "value", "fraction of the cells"], rows)

    @classmethod
    def on_cells(
        cls,
        plane: ParameterPlane,
        size: tuple[int, int],
        tolerance: float,
        columns: tuple[Column, ...],
        hot_columns: tuple[Column, ...],
    ) -> Domain:
        """The map on ``size`` cells along x and y."""
        centres = [(np.arange(count) + 0.5) / count for count in size]
        return cls(plane, plane.x.at(centres[0]), plane.y.at(centres[1]), tolerance, columns, hot_columns)

    @cached_property
    def hot(self) -> NDArray[np.int8]:
        """Whether there are hot flows, in closed form: 1, 0, or -1 where that is not known (see ``hot_columns``)."""
        if not self.hot_columns:
            return np.full((len(self.y), len(self.x)), -1, dtype=np.int8)
        return self._on_grid(self.hot_columns, HOT_CODES.index("hot")).astype(np.int8)

    @cached_property
    def exists(self) -> NDArray[np.bool_]:
        """Whether there is any flow in the range searched."""
        return self._get("families") > 0

    @cached_property
    def most(self) -> NDArray[np.int16]:
        """The largest number of flows that share one mass flux."""
        return self._get("most")

    @cached_property
    def families(self) -> NDArray[np.int16]:
        """The number of branches: connected sets of flows in the range searched."""
        return self._get("families")

    @cached_property
    def hidden(self) -> NDArray[np.bool_]:
        """Whether there are hidden branches: more than one, so that no continuation from one flow meets all."""
        return self._get("families") > 1

    @cached_property
    def interior(self) -> NDArray[np.int16]:
        """Bits of the kinds of interior among the flows: 1 dissipative, 2 mixed, 4 productive."""
        return self._bits(INTERIORS)

    @cached_property
    def density(self) -> NDArray[np.int16]:
        """Bits of the kinds of density among the flows: 1 monotonic, 2 inverted."""
        return self._bits(DENSITIES)

    @cached_property
    def exists_at(self) -> NDArray[np.bool_]:
        """Whether there is a flow at each requested temperature, (T, n, m)."""
        first = len(CODES)
        layers = [self._on_grid(self.columns, first + i) > 0 for i in range(len(self.plane.temperatures))]
        return np.array(layers, dtype=bool).reshape(len(layers), len(self.y), len(self.x))

    @cached_property
    def boundaries(self) -> tuple[Outline, ...]:
        """All boundaries between classes, as lines in the plane of the parameters."""
        return trace_outlines(self.plane, self.columns, self.hot_columns, self.tolerance)

    def regions(self, *names: str) -> tuple[Region, ...]:
        """The plane cut up by the value of a number of the class, a name of CODES; of several names, by the sum of
        the first, twice the second and so on."""
        bits = {CODES.index(name): 2**i for i, name in enumerate(names)}
        return make_regions(self.plane, self.columns, bits, self.tolerance)

    @property
    def searched(self) -> Searched:
        """The range in which flows were searched for."""
        within = self.plane.within
        return Searched((within.coldest, within.hottest), within.deepest)

    def _get(self, name: str) -> NDArray[np.int16]:
        return self._on_grid(self.columns, CODES.index(name))

    def _bits(self, kinds: dict[str, int]) -> NDArray[np.int16]:
        total = np.zeros((len(self.y), len(self.x)), dtype=np.int16)
        for name, bit in kinds.items():
            total += self._get(name) * np.int16(bit)
        return total

    def _on_grid(self, columns: Sequence[Column], number: int) -> NDArray[np.int16]:
        plane = self.plane
        x, y = ((values - axis.low) / (axis.high - axis.low) for values, axis in ((self.x, plane.x), (self.y, plane.y)))
        grid = _interpolate_on_grid(columns, number, self.tolerance, *((y, x) if plane.transposed else (x, y)))
        return grid if plane.transposed else grid.T


@on_one_thread
@np.errstate(under="ignore")
def domain(
    chute: Chute,
    x: ParameterAxis | tuple[str, float, float],
    y: ParameterAxis | tuple[str, float, float],
    *,
    size: tuple[int, int] = (400, 400),
    temperatures: Sequence[float] = (),
    tolerance: float = TOLERANCE,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
    workers: int = 1,
    progress: Progress | None = None,
) -> Domain:
    """Which flows there are, over two parameters.

    Args:
        chute: all other parameters; those of the axes are ignored.
        x, y: the axes, any two of the four parameters: their name in :class:`chuteflow.Chute`, lowest and highest
            value, such as ``("slope", 0.1, 0.5)``.
        size: cells along x and y.
        temperatures: surface temperatures at which flows are searched for too.
        tolerance: fraction of an axis to which boundaries are located, from 1e-6 to 0.1.
        surface_temperature: range searched.
        largest_holdup: range searched.
        workers: processes. With 1 all is done in this one; with more, a script needs the usual
            ``if __name__ == "__main__":`` around what it does.
        progress: told how many columns are done, and how many are known to be needed; without it, a terminal or
            notebook shows a line.

    Raises:
        InputError: for a size, tolerance, temperature or range out of bounds, or where a corner is no chute.
        ChuteflowError: where the processes cannot start, or die.
    """
    size = check_size(size, 1, LARGEST_SIZE)
    tolerance = number("tolerance", tolerance)
    if not FINEST <= tolerance <= COARSEST:
        raise InputError(
            f"tolerance = {tolerance:g}: must be from {FINEST:g} to {COARSEST:g}, as a fraction of an axis"
        )
    within = SearchRange.checked(surface_temperature, largest_holdup, chute.surface)
    temperatures = tuple(number("temperature", t) for t in temperatures)
    for t in temperatures:
        if not within.coldest <= t <= within.hottest:
            raise InputError(
                f"temperature {t:g}: must be in the range searched, {within.coldest:g} to {within.hottest:g}"
            )
    x, y = (axis if isinstance(axis, ParameterAxis) else ParameterAxis(*axis) for axis in (x, y))
    plane = ParameterPlane(x, y, chute, temperatures, within)
    with _pool(workers) as pool:
        if progress is not None:
            columns = _columns(plane, tolerance, pool, progress)
        else:
            with report_progress("domain", None) as tell:
                columns = _columns(plane, tolerance, pool, lambda done, known: tell(done / known))
    hot_columns = _hot_columns(plane, tolerance) if plane.hot_known else ()
    return Domain.on_cells(plane, size, tolerance, tuple(columns), tuple(hot_columns))


def _pool(workers: int) -> AbstractContextManager[Executor | None]:
    """Processes to compute in, or None for this one."""
    if not 1 <= workers <= 256:
        raise InputError(f"workers = {workers}: must be from 1 to 256")
    return worker_pool(workers) if workers > 1 else nullcontext()


def _columns(plane: ParameterPlane, tolerance: float, pool: Executor | None, progress: Progress) -> list[Column]:
    """Columns as many as it takes, in order along the outer axis."""
    first = _FIRST_COLUMNS if tolerance < 5.0 * TOLERANCE else _FEWEST_COLUMNS
    tasks = [
        _Task(plane, place, choose_fractions(place, (), _GUARDS, tolerance), tolerance)
        for place in np.linspace(0.0, 1.0, first).tolist()
    ]
    columns: list[Column] = []
    while tasks:
        known = len(columns) + len(tasks)
        for found in map(_column, tasks) if pool is None else pool.map(_column, tasks):
            columns.append(found)
            progress(len(columns), known)
        columns.sort(key=lambda one: one.place)
        wanted = find_intervals_to_halve(columns, tolerance, tolerance)
        if len(columns) == first:
            # All that is narrower than the first columns are apart is searched for again.
            wanted = [(i, 0.5 * (left.place + right.place)) for i, (left, right) in enumerate(pairwise(columns))]
        tasks = [
            _Task(
                plane,
                place,
                choose_fractions(place, columns[max(i - 1, 0) : i + 3], _LATER_GUARDS, tolerance),
                tolerance,
            )
            for i, place in wanted
        ]
    return columns


@dataclass(frozen=True)
class _Task:
    """A column to work out."""

    plane: ParameterPlane
    place: float
    shares: Sequence[float]
    tolerance: float


def _column(task: _Task) -> Column:
    return classify_column(task.place, partial(classify, task.plane), task.shares, task.tolerance)


def _hot_columns(plane: ParameterPlane, tolerance: float) -> list[Column]:
    """Columns of what is known in closed form, finer than the others."""
    fine = 0.1 * tolerance
    classify: Classify = partial(classify_hot, plane)
    places = np.linspace(0.0, 1.0, _HOT_COLUMNS).tolist()
    columns = [classify_column(place, classify, choose_fractions(place, (), _GUARDS, fine), fine) for place in places]
    while wanted := find_intervals_to_halve(columns, fine, fine):
        columns += [
            classify_column(
                place, classify, choose_fractions(place, columns[max(i - 1, 0) : i + 3], _LATER_GUARDS, fine), fine
            )
            for i, place in wanted
        ]
        columns.sort(key=lambda one: one.place)
    return columns


def _interpolate_on_grid(
    columns: Sequence[Column],
    number: int,
    tolerance: float,
    outer: NDArray[np.float64],
    inner: NDArray[np.float64],
) -> NDArray[np.int16]:
    """One number of the class at fractions of the outer and inner axis, (outer, inner)."""
    places = np.array([one.place for one in columns])
    grid = np.empty((len(outer), len(inner)), dtype=np.int16)
    for i, place in enumerate(outer.tolist()):
        right = int(np.clip(np.searchsorted(places, place), 1, len(columns) - 1))
        part = interpolate_column(columns[right - 1], columns[right], number, place, tolerance)
        grid[i] = np.array(part.values, dtype=np.int16)[np.searchsorted(part.stops, inner, side="right")]
    return grid
