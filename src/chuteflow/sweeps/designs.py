"""Designs: which parameters the points of a study have. Any piece of one can be made without the rest."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.sobol import Sobol

#: Points of a random design that share one stream of numbers.
_BLOCK = 4096
_SCALES = ("linear", "log")


@dataclass(frozen=True, eq=False)
class Axis:
    """One parameter: ``values`` (k,) as numbers, or where it is ``words`` their places among these; or a range from
    ``low`` to ``high``, even in the parameter or, where it is ``log``, in its logarithm."""

    name: str
    values: Array
    words: tuple[str, ...] = ()
    low: float = 0.0
    high: float = 0.0
    log: bool = False
    ranged: bool = False

    @property
    def extremes(self) -> tuple[float, float]:
        """Least and largest value."""
        if self.ranged:
            return self.low, self.high
        return float(self.values.min()), float(self.values.max())

    def at(self, share: Array) -> Array:
        """Values at shares from 0 to 1: of the range, or of the list of values."""
        if self.ranged:
            return _between(self.low, self.high, share, self.log)
        return self.values[np.minimum((share * len(self.values)).astype(np.intp), len(self.values) - 1)]


@dataclass(frozen=True, eq=False)
class Design:
    """The points of a study: ``rows(first, last)`` gives their parameters as columns by name."""

    points: int
    axes: Mapping[str, Axis]
    rows: Callable[[int, int], dict[str, Array]]

    @classmethod
    def listed(cls, axes: Mapping[str, Axis]) -> Design:
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


def axis_from(name: str, value: Any, words: Mapping[str, tuple[tuple[str, ...], str]]) -> Axis:
    """The axis that a value of the study's table describes: one value, a list of them, or a range.

    Raises:
        InputError: naming the parameter, for what is none of these.
    """
    key = f"parameters.{name}"
    if name in words:
        known = words[name][0]
        names = value if isinstance(value, list) else [value]
        for one in names:
            if one not in known:
                raise InputError(f"{key}: unknown {name} {one!r}: choose one of {', '.join(known)}")
        if not names:
            raise InputError(f"{key} = []: give at least one value")
        return Axis(name, np.array([known.index(one) for one in names], dtype=float), known)
    if isinstance(value, Mapping):
        return _range(name, key, value)
    values = value if isinstance(value, list) else [value]
    if not values:
        raise InputError(f"{key} = []: give at least one value")
    return Axis(name, np.array([_number(key, one) for one in values]))


def _range(name: str, key: str, value: Mapping[str, Any]) -> Axis:
    for one in value:
        if one not in ("from", "to", "points", "scale"):
            raise InputError(f"unknown key {key}.{one}: a range has from, to, points and scale")
    for one in ("from", "to"):
        if one not in value:
            raise InputError(f"{key}.{one} is missing: a range has from and to")
    low, high = _number(f"{key}.from", value["from"]), _number(f"{key}.to", value["to"])
    scale = value.get("scale", "linear")
    if scale not in _SCALES:
        raise InputError(f"{key}.scale = {scale!r}: choose one of {', '.join(_SCALES)}")
    if not low < high:
        raise InputError(f"{key} from {low:g} to {high:g}: must rise")
    if scale == "log" and low <= 0.0:
        raise InputError(f"{key}.from = {low:g}: must be above 0 on the log scale")
    count = value.get("points", 0)
    if isinstance(count, bool) or not isinstance(count, int) or (count != 0 and count < 2):
        raise InputError(f"{key}.points = {count!r}: must be a whole number from 2")
    log = scale == "log"
    values = _between(low, high, np.linspace(0.0, 1.0, count), log) if count else np.empty(0)
    return Axis(name, values, (), low, high, log, True)


def _between(low: float, high: float, share: Array, log: bool) -> Array:
    inside = np.exp(math.log(low) + share * (math.log(high) - math.log(low))) if log else low + share * (high - low)
    # The ends are the numbers given, to the last digit.
    return np.where(share == 1.0, high, np.where(share == 0.0, low, inside))


@dataclass(frozen=True)
class Kind:
    """A kind of design: what its table may hold, and how it is made."""

    settings: tuple[str, ...]
    make: Callable[[Mapping[str, Any], Mapping[str, Axis]], Design]


def _product(head: Mapping[str, Any], axes: Mapping[str, Axis]) -> Design:
    """Every combination of the values; the last parameter of the table runs fastest."""
    del head
    for axis in axes.values():
        if axis.ranged and not len(axis.values):
            raise InputError(f"parameters.{axis.name}.points is missing: a product needs the number of values")
    shape = tuple(len(axis.values) for axis in axes.values())

    def rows(first: int, last: int) -> dict[str, Array]:
        places = np.unravel_index(np.arange(first, last), shape)
        return {name: axis.values[place] for (name, axis), place in zip(axes.items(), places, strict=True)}

    return Design(math.prod(shape), axes, rows)


def _random(head: Mapping[str, Any], axes: Mapping[str, Axis]) -> Design:
    """Independent points, the same whatever the size of the pieces."""
    points, seed = _whole(head, "points", 1, None), _whole(head, "seed", 0, 0)

    def block(number: int) -> Array:
        return np.random.default_rng([seed, number]).random((_BLOCK, len(axes)))

    def rows(first: int, last: int) -> dict[str, Array]:
        begin = first // _BLOCK
        shares = np.concatenate([block(b) for b in range(begin, -(-last // _BLOCK))])
        shares = shares[first - begin * _BLOCK : last - begin * _BLOCK]
        return _at(axes, shares)

    return Design(points, axes, rows)


def _sobol(head: Mapping[str, Any], axes: Mapping[str, Axis]) -> Design:
    """Sobol' points, scrambled: evenly spread, in pieces and as a whole."""
    points, seed = _whole(head, "points", 1, None), _whole(head, "seed", 0, 0)
    source = Sobol(len(axes), seed)

    def rows(first: int, last: int) -> dict[str, Array]:
        return _at(axes, source.points(first, last))

    return Design(points, axes, rows)


def _at(axes: Mapping[str, Axis], shares: Array) -> dict[str, Array]:
    return {
        name: axis.at(np.ascontiguousarray(column)) for (name, axis), column in zip(axes.items(), shares.T, strict=True)
    }


#: Kinds of designs by name; a list is made from columns instead.
DESIGNS: dict[str, Kind] = {
    "product": Kind((), _product),
    "random": Kind(("points", "seed"), _random),
    "sobol": Kind(("points", "seed"), _sobol),
}


@dataclass(frozen=True, eq=False)
class Columns:
    """The columns of a list: as axes, and as the table that they were given by."""

    axes: dict[str, Axis]
    table: dict[str, Any]


def list_design(
    head: Mapping[str, Any],
    parameters: Mapping[str, Any],
    folder: Path,
    words: Mapping[str, tuple[tuple[str, ...], str]],
) -> Columns:
    """The columns of a list, in the study or in a CSV file beside it, whose first line names the parameters.

    Raises:
        InputError: for columns of different lengths, in both places or with what is not a number.
    """
    table: dict[str, Any] = dict(parameters)
    if "file" in head:
        for name, column in _csv(folder / str(head["file"]), words).items():
            if name in table:
                raise InputError(f"parameters.{name} is given in the study and in {head['file']}: give it once")
            table[name] = column
    for name, value in table.items():
        if isinstance(value, Mapping):
            raise InputError(f"parameters.{name}: a list design takes values, not a range")
    axes = {name: axis_from(name, value, words) for name, value in table.items()}
    lengths = {len(axis.values) for axis in axes.values()} - {1}
    if len(lengths) > 1:
        what = ", ".join(f"{name} {len(axis.values)}" for name, axis in axes.items())
        raise InputError(f"the columns of a list must be equally long, or one value: got {what}")
    return Columns(axes, table)


def _csv(path: Path, words: Mapping[str, Any]) -> dict[str, list[Any]]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"design.file: cannot read {path}: {getattr(error, 'strerror', None) or error}") from None
    lines = [line for line in lines if line]
    if len(lines) < 2:
        raise InputError(f"design.file: {path} needs a line of names and at least one of numbers")
    names = [name.strip() for name in lines[0]]
    for i, line in enumerate(lines[1:], 2):
        if len(line) != len(names):
            raise InputError(f"design.file: line {i} of {path} has {len(line)} columns: the first has {len(names)}")
    return {
        name: [line[k].strip() if name in words else _number(f"{path.name}, {name}", line[k]) for line in lines[1:]]
        for k, name in enumerate(names)
    }


def _number(key: str, value: Any) -> float:
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{key} = {value!r}: must be a number")
    return number


def _whole(head: Mapping[str, Any], name: str, low: int, default: int | None) -> int:
    value = head.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or value < low:
        given = "is missing" if value is None else f"= {value!r}"
        raise InputError(f"design.{name} {given}: must be a whole number from {low}")
    return value
