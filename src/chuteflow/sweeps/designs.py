"""Designs: which parameters the points of a study have. Any piece of one can be made without the rest."""

from __future__ import annotations

import csv
import math
import os
from array import array
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.checks import MOST_SHOWN, number, number_in, shorten
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.sobol import Sobol

#: Points of a study at most.
MOST_POINTS = 1 << 40
#: Points of a random design that share one stream of numbers.
_BLOCK = 4096
_LARGEST_SEED = (1 << 64) - 1
_SCALES = ("linear", "log")


def show_key(name: str) -> str:
    """The name of a key for a message: as it is, or quoted where it is long or cannot be printed."""
    return name if name.isprintable() and len(name) <= MOST_SHOWN else shorten(name)


def show_path(path: str | os.PathLike[str]) -> str:
    """A path for a message: as it is, or quoted where it cannot be printed."""
    return str(path) if str(path).isprintable() else shorten(str(path))


@dataclass(frozen=True, eq=False)
class DesignAxis:
    """One parameter: ``values`` (k,) as numbers, or where it is ``words`` their places among these; or a range from
    ``low`` to ``high``, even in the parameter or, where it is ``log``, in its logarithm, of ``steps`` values where it
    is divided."""

    name: str
    values: Array
    words: tuple[str, ...] = ()
    low: float = 0.0
    high: float = 0.0
    log: bool = False
    ranged: bool = False
    steps: int = 0

    @property
    def count(self) -> int:
        """How many values there are: 0 for a range that is not divided."""
        return self.steps if self.ranged else len(self.values)

    def nth(self, places: NDArray[np.intp]) -> Array:
        """The values at ``places``, counted from 0."""
        if not self.ranged:
            return self.values[places]
        # As numpy.linspace has it to the last bit, without the values that are not asked for.
        fraction = np.where(places == self.steps - 1, 1.0, places * (1.0 / (self.steps - 1)))
        return _between(self.low, self.high, fraction, self.log)

    @property
    def extremes(self) -> tuple[float, float]:
        """Least and largest value."""
        if self.ranged:
            return self.low, self.high
        return float(self.values.min()), float(self.values.max())

    def at(self, fraction: Array) -> Array:
        """Values at fractions from 0 to 1: of the range, or of the list of values."""
        if self.ranged:
            return _between(self.low, self.high, fraction, self.log)
        return self.values[np.minimum((fraction * len(self.values)).astype(np.intp), len(self.values) - 1)]


@dataclass(frozen=True, eq=False)
class StudyDesign:
    """The points of a study: ``rows(first, last)`` gives their parameters as columns by name."""

    points: int
    axes: Mapping[str, DesignAxis]
    rows: Callable[[int, int], dict[str, Array]]

    @classmethod
    def listed(cls, axes: Mapping[str, DesignAxis]) -> StudyDesign:
        """The points as they are in columns of equal length."""
        points = max(len(axis.values) for axis in axes.values())

        def rows(first: int, last: int) -> dict[str, Array]:
            return {
                name: axis.values[first:last]
                if len(axis.values) > 1 or points == 1
                else np.repeat(axis.values, last - first)
                for name, axis in axes.items()
            }

        return cls(points, axes, rows)


#: Parameters that take other words than those that have a number of their own.
OPEN = ("closure", "base")


def axis_from(name: str, value: Any, words: Mapping[str, tuple[tuple[str, ...], str]]) -> DesignAxis:
    """The axis that a value of the study's table describes: one value, a list of them, or a range.

    Raises:
        InputError: naming the parameter, for what is none of these.
    """
    key = f"parameters.{name}"
    if name in words:
        known = words[name][0]
        names = _as_list(value)
        for one in names:
            if isinstance(one, str) and one in known:
                continue
            if name not in OPEN or not isinstance(one, str):
                raise InputError(f"{key}: unknown {name} {shorten(one)}: choose one of {', '.join(known)}")
            known = (*known, one)
        if not names:
            raise InputError(f"{key} = []: give at least one value")
        return DesignAxis(name, np.array([known.index(one) for one in names], dtype=float), known)
    if isinstance(value, Mapping):
        return _range(name, key, value)
    if isinstance(value, np.ndarray) and value.dtype == float and np.isfinite(value).all():
        return DesignAxis(name, value)
    values = _as_list(value)
    if not values:
        raise InputError(f"{key} = []: give at least one value")
    return DesignAxis(name, np.array([number(key, one) for one in values]))


def _as_list(value: Any) -> list[Any]:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value if isinstance(value, list) else [value]


def _range(name: str, key: str, value: Mapping[str, Any]) -> DesignAxis:
    for one in value:
        if one not in ("from", "to", "points", "scale"):
            raise InputError(f"unknown key {key}.{show_key(one)}: a range has from, to, points and scale")
    for one in ("from", "to"):
        if one not in value:
            raise InputError(f"{key}.{one} is missing: a range has from and to")
    low, high = number(f"{key}.from", value["from"]), number(f"{key}.to", value["to"])
    scale = value.get("scale", "linear")
    if scale not in _SCALES:
        raise InputError(f"{key}.scale = {shorten(scale)}: choose one of {', '.join(_SCALES)}")
    if not low < high:
        raise InputError(f"{key} from {low:g} to {high:g}: must rise")
    if scale == "log" and low <= 0.0:
        raise InputError(f"{key}.from = {low:g}: must be above 0 on the log scale")
    count = value.get("points", 0)
    if isinstance(count, bool) or not isinstance(count, int) or (count != 0 and not 2 <= count <= MOST_POINTS):
        raise InputError(f"{key}.points = {shorten(count)}: must be a whole number from 2 to {MOST_POINTS}")
    return DesignAxis(name, np.empty(0), (), low, high, scale == "log", True, count)


def _between(low: float, high: float, fraction: Array, log: bool) -> Array:
    inside = (
        np.exp(math.log(low) + fraction * (math.log(high) - math.log(low))) if log else low + fraction * (high - low)
    )
    # The ends are the numbers given, to the last digit.
    return np.where(fraction == 1.0, high, np.where(fraction == 0.0, low, inside))


@dataclass(frozen=True)
class DesignKind:
    """A kind of design: what its table may hold, and how it is made."""

    settings: tuple[str, ...]
    make: Callable[[Mapping[str, Any], Mapping[str, DesignAxis]], StudyDesign]


def _product(head: Mapping[str, Any], axes: Mapping[str, DesignAxis]) -> StudyDesign:
    """Every combination of the values; the last parameter of the table runs fastest."""
    del head
    for axis in axes.values():
        if not axis.count:
            raise InputError(f"parameters.{axis.name}.points is missing: a product needs the number of values")
    shape = tuple(axis.count for axis in axes.values())

    def rows(first: int, last: int) -> dict[str, Array]:
        places = np.unravel_index(np.arange(first, last), shape)
        return {name: axis.nth(place) for (name, axis), place in zip(axes.items(), places, strict=True)}

    return StudyDesign(math.prod(shape), axes, rows)


def _random(head: Mapping[str, Any], axes: Mapping[str, DesignAxis]) -> StudyDesign:
    """Independent points, the same whatever the size of the pieces."""
    points, seed = _points(head), _seed(head)

    def block(index: int) -> Array:
        return np.random.default_rng([seed, index]).random((_BLOCK, len(axes)))

    def rows(first: int, last: int) -> dict[str, Array]:
        begin = first // _BLOCK
        fractions = np.concatenate([block(b) for b in range(begin, -(-last // _BLOCK))])
        fractions = fractions[first - begin * _BLOCK : last - begin * _BLOCK]
        return _at(axes, fractions)

    return StudyDesign(points, axes, rows)


def _sobol(head: Mapping[str, Any], axes: Mapping[str, DesignAxis]) -> StudyDesign:
    """Sobol' points, scrambled: evenly spread, in pieces and as a whole."""
    points, seed = _points(head), _seed(head)
    source = Sobol(len(axes), seed)

    def rows(first: int, last: int) -> dict[str, Array]:
        return _at(axes, source.points(first, last))

    return StudyDesign(points, axes, rows)


def _at(axes: Mapping[str, DesignAxis], fractions: Array) -> dict[str, Array]:
    return {
        name: axis.at(np.ascontiguousarray(column))
        for (name, axis), column in zip(axes.items(), fractions.T, strict=True)
    }


#: Kinds of designs by name; a list is made from columns instead.
DESIGNS: dict[str, DesignKind] = {
    "product": DesignKind((), _product),
    "random": DesignKind(("points", "seed"), _random),
    "sobol": DesignKind(("points", "seed"), _sobol),
}


@dataclass(frozen=True, eq=False)
class PointList:
    """The columns of a list: as axes, and as the table that they were given by."""

    axes: dict[str, DesignAxis]
    table: dict[str, Any]


def list_design(
    head: Mapping[str, Any],
    parameters: Mapping[str, Any],
    folder: Path,
    words: Mapping[str, tuple[tuple[str, ...], str]],
) -> PointList:
    """The columns of a list, in the study or in a CSV file beside it, whose first line names the parameters.

    Raises:
        InputError: for columns of different lengths, in both places or with what is not a number.
    """
    table: dict[str, Any] = dict(parameters)
    if "file" in head:
        for name, column in _csv(folder / str(head["file"]), words).items():
            if name in table:
                raise InputError(
                    f"parameters.{show_key(name)} is given in the study and in {head['file']}: give it once"
                )
            table[name] = column
    for name, value in table.items():
        if isinstance(value, Mapping):
            raise InputError(f"parameters.{show_key(name)}: a list design takes values, not a range")
    axes = {name: axis_from(name, value, words) for name, value in table.items()}
    lengths = {len(axis.values) for axis in axes.values()} - {1}
    if len(lengths) > 1:
        what = ", ".join(f"{name} {len(axis.values)}" for name, axis in axes.items())
        raise InputError(f"the columns of a list must be equally long, or one value: got {what}")
    return PointList(axes, table)


def _csv(path: Path, words: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of a CSV file: numbers as arrays, words as lists."""
    try:
        # Spreadsheets put a byte-order mark before the first name.
        with path.open(newline="", encoding="utf-8-sig") as file:
            return _columns(path, csv.reader(file), words)
    except InputError:
        raise
    except (OSError, ValueError, csv.Error) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(f"design.file: cannot read {show_path(path)}: {why}") from None


def _columns(path: Path, lines: Iterator[list[str]], words: Mapping[str, Any]) -> dict[str, Any]:
    names = [name.strip() for name in next((line for line in lines if line), [])]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"design.file: {path} has the column {shorten(name)} more than once: keep one of them")
    columns: dict[str, Any] = {name: [] if name in words else array("d") for name in names}
    for i, line in enumerate((line for line in lines if line), 2):
        if len(line) != len(names):
            raise InputError(f"design.file: line {i} of {path} has {len(line)} columns: the first has {len(names)}")
        for name, text in zip(names, line, strict=True):
            columns[name].append(text.strip() if name in words else number_in(f"{path.name}, {show_key(name)}", text))
    if not names or not columns[names[0]]:
        raise InputError(f"design.file: {path} needs a line of names and at least one of numbers")
    return {name: column if isinstance(column, list) else np.array(column) for name, column in columns.items()}


def _points(head: Mapping[str, Any]) -> int:
    return _whole(head, "points", 1, MOST_POINTS, None)


def _seed(head: Mapping[str, Any]) -> int:
    return _whole(head, "seed", 0, _LARGEST_SEED, 0)


def _whole(head: Mapping[str, Any], name: str, low: int, high: int, default: int | None) -> int:
    value = head.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        given = "is missing" if value is None else f"= {shorten(value)}"
        raise InputError(f"design.{name} {given}: must be a whole number from {low} to {high}")
    return value
