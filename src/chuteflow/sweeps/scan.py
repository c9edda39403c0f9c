"""Small studies in memory: the flows of every combination of some parameters, by the engine of the sweeps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chuteflow import display
from chuteflow.checks import real_array
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import BY_KEY, CONDITIONS, LARGEST_HOLDUP, SURFACE_TEMPERATURE
from chuteflow.progress import report_progress
from chuteflow.result import Result
from chuteflow.steady.chute import Chute
from chuteflow.sweeps.engine import Chunk, solve_chunk
from chuteflow.sweeps.numbers import KINDS
from chuteflow.sweeps.outcome import PointStatus, meanings
from chuteflow.sweeps.study import DEFAULT_QUANTITIES, TOLERANCE, from_dict
from chuteflow.threads import on_one_thread

#: Points at most, and those that are solved at a time, after which progress is told.
MOST_POINTS, _AT_A_TIME = 1_000_000, 256
#: Names of the parameters in Python, and their keys in a study.
_KEYS = {parameter.name: key for key, parameter in BY_KEY.items()}


@dataclass(frozen=True, eq=False)
class Scan(Result):
    """The flows of every combination of the values of ``axes``, the last axis fastest.

    ``fixed`` are the other parameters. Over the axes are ``count``, the number of flows of each point, and ``status``,
    one of :class:`chuteflow.sweeps.outcome.PointStatus`. The ``quantities`` have the flows of a point as a further
    axis, from hot to cold, NaN (kinds: -1) where there are fewer. ``failures`` says why points failed, by their
    numbers.
    """

    axes: Mapping[str, Array]
    fixed: Mapping[str, float | str]
    count: NDArray[np.int32]
    status: NDArray[np.int8]
    quantities: Mapping[str, NDArray[Any]]
    failures: Mapping[int, str]

    def __repr__(self) -> str:
        points = display.count_of(self.count.size, "point")
        reach = [display.span(name, values) for name, values in self.axes.items()]
        failed = f"{len(self.failures)} failed" if self.failures else None
        return display.line("Scan", points, *reach, display.count_of(int(self.count.sum()), "flow"), failed)

    def _repr_html_(self) -> str:
        numbers, points = np.unique(self.count, return_counts=True)
        rows = [[str(n), str(p)] for n, p in zip(numbers.tolist(), points.tolist(), strict=True)]
        return display.html_table(repr(self)[1:-1], ["flows", "points"], rows)

    @staticmethod
    def description(name: str) -> str:
        """What an axis is."""
        return BY_KEY[name].description if name in BY_KEY else CONDITIONS[name].description

    @cached_property
    def status_flags(self) -> dict[str, Any]:
        """What the values of ``status`` mean, as attributes."""
        values, names = meanings(PointStatus)
        return {"flag_values": values, "flag_meanings": names}

    @staticmethod
    def flags(name: str) -> dict[str, Any]:
        """What the values of a kind mean, as attributes."""
        kinds = KINDS[name]
        return {"flag_values": np.arange(-1, len(kinds), dtype="i1"), "flag_meanings": " ".join(("no_flow", *kinds))}

    def over_slopes(self, function: Callable[[float], float]) -> Array:
        """A function of the slope at each point, with a further axis for the flows."""
        if "slope" not in self.axes:
            return np.array(function(float(self.fixed["slope"])))
        shape = [len(values) if name == "slope" else 1 for name, values in self.axes.items()]
        return np.array([function(slope) for slope in self.axes["slope"].tolist()]).reshape(*shape, 1)


@on_one_thread
def scan(
    chute: Chute | None = None,
    *,
    quantities: tuple[str, ...] = DEFAULT_QUANTITIES,
    flows: int = 8,
    tolerance: float = TOLERANCE,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
    progress: Callable[[float], None] | None = None,
    **parameters: ArrayLike,
) -> Scan:
    """The flows of every combination of some parameters, for studies that fit in memory.

    ``scan(chute, slope=[0.25, 0.3], Q=numpy.logspace(-1, 2, 50))`` has 100 points. Larger studies, which are kept on
    disk and go on after an interruption, are for :func:`chuteflow.sweep`.

    Args:
        chute: what the parameters are that are not given; may be left out where all are.
        quantities: what is kept of each flow: names of the registry, "interior" and "density".
        flows: how many flows of a point are kept; all are counted.
        tolerance: relative error allowed in Q, h and M.
        surface_temperature: range searched.
        largest_holdup: range searched.
        progress: called with the fraction that is done; without it, a terminal or notebook shows a line.
        parameters: ``slope``, ``restitution`` or ``e``, ``wall_restitution`` or ``ew``, ``roughness``, and one of
            ``Q``, ``M``, ``h`` and ``T_surface``: numbers, or one-dimensional arrays, which become axes in their order.

    Raises:
        InputError: for a parameter that is missing, unknown or out of range, or too many points.
    """
    given = _collect_parameters(chute, parameters)
    axes = {name: values for name, values in given.items() if isinstance(values, np.ndarray)}
    points = int(np.prod([len(values) for values in axes.values()]))
    if not 1 <= points <= MOST_POINTS:
        raise InputError(
            f"{points} points: must be from 1 to {MOST_POINTS}; chuteflow.sweep keeps larger studies on disk"
        )
    table = {
        "parameters": {n: v.tolist() if isinstance(v, np.ndarray) else v for n, v in given.items()},
        "search": {
            "tolerance": tolerance,
            "surface_temperature": [float(end) for end in surface_temperature],
            "largest_holdup": largest_holdup,
        },
        "results": {"quantities": list(quantities), "flows": flows, "chunk": min(points, _AT_A_TIME)},
    }
    study = from_dict(table, Path())
    chunks: list[Chunk] = []
    with report_progress("scan", progress) as tell:
        for number in range(study.chunks):
            chunks.append(solve_chunk(study, number))
            tell(len(chunks) / study.chunks)
    shape = tuple(len(values) for values in axes.values())
    fixed = {name: value for name, value in given.items() if name not in axes}
    return Scan(
        axes,
        fixed,
        np.concatenate([one.n_flows for one in chunks]).reshape(shape),
        np.concatenate([one.status for one in chunks]).reshape(shape),
        {n: np.concatenate([one.quantities[n] for one in chunks]).reshape(*shape, -1) for n in study.quantities},
        {point: why for one in chunks for point, why in one.failures.items()},
    )


def _collect_parameters(chute: Chute | None, parameters: Mapping[str, ArrayLike]) -> dict[str, Any]:
    """All parameters by their keys in a study, those that were given first and in their order."""
    found: dict[str, Any] = {}
    for name, value in parameters.items():
        key = _KEYS.get(name, name)
        if key not in (*BY_KEY, *CONDITIONS):
            raise InputError(f"unknown parameter {name!r}: choose from {', '.join((*_KEYS, *CONDITIONS))}")
        if key in found:
            raise InputError(f"{name} is given twice, also as {key}")
        values = real_array(name, value)
        if values.ndim > 1 or not values.size:
            raise InputError(f"{name}: must be a number or a one-dimensional array of some")
        found[key] = values if values.ndim else float(values)
    if chute is not None:
        own = {key: getattr(chute, parameter.name) for key, parameter in BY_KEY.items()}
        found |= {key: value for key, value in own.items() if key not in found}
        found |= {name: value for name, value in chute.as_dict().items() if name in ("surface", "closure", "base")}
    return found
