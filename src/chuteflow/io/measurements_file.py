"""Measurements from CSV files: one row for each height, or for each experiment that has no profile.

The first line names the columns: ``z``, ``nu``, ``T``, ``u``, numbers of the flow such as ``Q`` or ``depth``,
parameters of the chute such as ``slope`` or ``angle``, and ``experiment``. A unit stands in brackets, as in ``z [mm]``;
without one a column is dimensionless. ``nu_error`` holds standard errors of ``nu``, ``nu_error [%]`` relative ones.
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from chuteflow.amounts import read_si
from chuteflow.checks import number, shorten
from chuteflow.errors import InputError
from chuteflow.fitting.measurements import (
    PROFILES,
    SCALARS,
    Experiment,
    Measurements,
    StandardErrors,
    assemble,
    together,
)
from chuteflow.io.units import WITHOUT_GRAINS
from chuteflow.parameters import BY_KEY
from chuteflow.steady.quantities import QUANTITIES, Scales

_COLUMN = re.compile(r"\s*([^\[\]()]+?)\s*(?:[\[(]\s*([^\[\]()]*?)\s*[\])])?\s*")
_ERROR = re.compile(r"(.+?)[ _](?:error|err|sd|std)|(?:sigma|error|err)[ _](.+)")
#: Other names of columns.
_ALIASES = {
    "volume_fraction": "nu",
    "granular_temperature": "T",
    "temperature": "T",
    "velocity": "u",
    "height": "z",
    "restitution": "e",
    "wall_restitution": "ew",
    "e_w": "ew",
    "r": "roughness",
} | {name: symbol for symbol, name in SCALARS.items()}
#: Rows of a file at most.
_MOST_ROWS = 1_000_000
_WORDS_FOR_NOTHING = ("", "-", "na", "n/a")


@dataclass(frozen=True)
class _MeasuredColumn:
    """One column: its title, what it holds, whether that is errors of it, and its unit, empty without one."""

    title: str
    key: str
    error: bool
    unit: str

    @property
    def relative(self) -> bool:
        return self.error and self.unit == "%"


def read_measurements(
    path: str | os.PathLike[str],
    *,
    slope: float | None = None,
    scales: Scales | None = None,
    trust: Mapping[str, tuple[float, float]] | None = None,
) -> Measurements:
    """The measurements in a CSV file.

    Args:
        path: the file.
        slope: of the chute, which units need, where the file has no such column.
        scales: grain diameter and density, which units need.
        trust: ranges (low, high) of z, nu, T and u, dimensionless, outside of which values are left out.

    Raises:
        InputError: for a file that cannot be read, unknown columns or units, and values that no flow has.
    """
    try:
        columns, rows = _table(Path(path))
        experiments = _group(columns, rows)
        parts = [_experiment(name, columns, part, slope, scales, trust or {}) for name, part in experiments.items()]
        in_units = any(column.unit and not column.relative for column in columns)
        return together(parts, in_units=in_units)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _table(path: Path) -> tuple[list[_MeasuredColumn], list[list[str]]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot read it: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise InputError("it is not a text in UTF-8") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) > _MOST_ROWS:
        raise InputError(f"{len(lines)} rows: must be {_MOST_ROWS} at most")
    try:
        table = list(csv.reader(lines, strict=True))
    except csv.Error as error:
        raise InputError(f"it is not CSV: {error}") from None
    if len(table) < 2:
        raise InputError("it needs a line with the names of its columns, and a row of values")
    columns = [_column(title) for title in table[0]]
    names = [(column.key, column.error) for column in columns]
    for column in columns:
        if names.count((column.key, column.error)) > 1:
            raise InputError(f"column {column.title!r} is there twice")
    for i, row in enumerate(table[1:], 2):
        if len(row) != len(columns):
            raise InputError(f"line {i} has {len(row)} cells, and the first has {len(columns)}")
    return columns, table[1:]


def _column(title: str) -> _MeasuredColumn:
    match = _COLUMN.fullmatch(title)
    if match is None:
        raise InputError(f"column {shorten(title)}: name it as in nu or z [mm]")
    name, unit = match[1], match[2] or ""
    found = _ERROR.fullmatch(name)
    error = found is not None
    key = (found[1] or found[2]) if found is not None else name
    key = _ALIASES.get(key, key)
    known = ("experiment", "z", *PROFILES, *SCALARS, *BY_KEY, "angle")
    if key not in known or (error and key not in PROFILES and key not in SCALARS):
        raise InputError(
            f"unknown column {shorten(title)}: choose from {', '.join(known)}, and errors such as nu_error"
        )
    return _MeasuredColumn(title.strip(), key, error, unit)


def _group(columns: Sequence[_MeasuredColumn], rows: Sequence[list[str]]) -> dict[str, list[list[str]]]:
    place = next((i for i, column in enumerate(columns) if column.key == "experiment"), None)
    found: dict[str, list[list[str]]] = {}
    for row in rows:
        found.setdefault("1" if place is None else row[place].strip(), []).append(row)
    return found


def _experiment(
    name: str,
    columns: Sequence[_MeasuredColumn],
    rows: Sequence[list[str]],
    slope: float | None,
    scales: Scales | None,
    trust: Mapping[str, tuple[float, float]],
) -> Experiment:
    values = {
        (column.key, column.error): [_cell(name, column, row[i]) for row in rows]
        for i, column in enumerate(columns)
        if column.key != "experiment"
    }
    given = {
        key: _single(name, key, values[key, False])
        for key in (*BY_KEY, "angle")
        if (key, False) in values and not all(map(math.isnan, values[key, False]))
    }
    if "angle" in given:
        if "slope" in given:
            raise InputError(f"experiment {name}: give slope or angle, not both")
        given["slope"] = math.tan(math.radians(number("angle", given.pop("angle"), 1e-6, 89.9999)))
    at = given.get("slope", slope)
    factors = {column: _factor(column, at, scales) for column in columns}
    scaled = {
        (column.key, column.error): [value * factors[column] for value in values[column.key, column.error]]
        for column in columns
        if column.key != "experiment"
    }
    has_profile = any((symbol, False) in scaled for symbol in PROFILES)
    profiles = {
        symbol: scaled[symbol, False]
        for symbol in PROFILES
        if (symbol, False) in scaled and not all(map(math.isnan, scaled[symbol, False]))
    }
    numbers = {
        symbol: _single(name, symbol, scaled[symbol, False])
        for symbol in SCALARS
        if (symbol, False) in scaled and not all(map(math.isnan, scaled[symbol, False]))
    }
    errors = {}
    for column in columns:
        if not column.error or (column.key not in profiles and column.key not in numbers):
            continue
        spread = scaled[column.key, True]
        if column.key in numbers:
            if all(map(math.isnan, spread)):
                continue
            errors[column.key] = StandardErrors(_single(name, column.title, spread), column.relative)
        else:
            there = [error for error, value in zip(spread, profiles[column.key], strict=True) if not math.isnan(value)]
            if any(map(math.isnan, there)) and not all(map(math.isnan, there)):
                raise InputError(f"experiment {name}: {column.title} is missing for some values of {column.key}")
            if not all(map(math.isnan, there)):
                errors[column.key] = StandardErrors(spread, column.relative)
    heights = scaled.get(("z", False)) if has_profile and profiles else None
    return assemble(name, heights, profiles, numbers, errors, given, trust)


def _cell(name: str, column: _MeasuredColumn, text: str) -> float:
    """The number in a cell; NaN for an empty one."""
    if text.strip().lower() in _WORDS_FOR_NOTHING:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"experiment {name}: {column.title} = {shorten(text)}: must be a number, or empty") from None
    if not math.isfinite(value):
        raise InputError(
            f"experiment {name}: {column.title} = {shorten(text)}: must be finite; leave it empty if missing"
        )
    return value


def _single(name: str, key: str, values: Sequence[float]) -> float:
    found = {value for value in values if not math.isnan(value)}
    if len(found) != 1:
        raise InputError(
            f"experiment {name}: {key} has several values: it is one number for the whole flow; "
            "where rows are several flows, name them in a column experiment"
        )
    return found.pop()


def _factor(column: _MeasuredColumn, slope: float | None, scales: Scales | None) -> float:
    """What the numbers of a column are multiplied with to be dimensionless."""
    if column.relative:
        return 0.01
    if not column.unit or column.unit == "1":
        return 1.0
    name = {"z": "height"} | {symbol: field for symbol, (field, _) in PROFILES.items()} | SCALARS
    if column.key not in name:
        raise InputError(f"column {column.title!r}: it has no unit")
    unit = QUANTITIES[name[column.key]].unit
    if unit == "1":
        raise InputError(f"column {column.title!r}: it has no unit; relative errors are in [%]")
    in_si = read_si(f"column {column.title!r}", f"1 {column.unit}", unit)
    if scales is None:
        raise InputError(f"column {column.title!r}: {WITHOUT_GRAINS}")
    if slope is None:
        raise InputError(f"column {column.title!r}: a unit needs the slope of the chute")
    return in_si / scales.factor(name[column.key], slope)
