"""A result as CSV: one table between comment lines.

One row for each height of each flow, or for a curve one row for each flow, the special points in their
places. The comments above the table are for people; those below it hold the unknowns, as JSON.
"""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import numpy as np

from chuteflow import __version__
from chuteflow.branches.results import Curve
from chuteflow.checks import shorten
from chuteflow.errors import InputError
from chuteflow.io import contract, records
from chuteflow.io.contract import factor
from chuteflow.io.records import HEIGHTS, KIND_OF, Result, Row
from chuteflow.io.references import PAPER, TITLES, numbers_are
from chuteflow.io.writing import as_text
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import FIELDS, NUMBERS, QUANTITIES, VALIDITY, Scales
from chuteflow.steady.validity import WORDS

_HEAD, _ROW = "# restore: ", "# unknowns: "
_KINDS = ("interior", "density", "error", *VALIDITY, "validity", "name")


def write(result: Result, stream: BinaryIO, scales: Scales | None) -> None:
    """Write ``result`` to ``stream``."""
    found = records.rows(result)
    with as_text(stream) as file:
        file.writelines(f"# {line}\n" for line in _comments(result, scales))
        _write_table(file, result, found, scales)
        file.write(_HEAD + contract.text(records.head(result, found) | {"rows": len(found)}) + "\n")
        for row in found:
            file.write(_ROW + contract.text(records.unknowns(row)) + "\n")


def read(path: Path) -> Result:
    """The result in the file.

    Raises:
        InputError: for a later or unknown format, or a file that is cut short.
        ValueError, KeyError, TypeError: for a file that is not of this format.
    """
    lines = lines_of(path)
    require_columns(lines)
    head = kept_in(lines, _HEAD)
    rows = [contract.parsed(line.removeprefix(_ROW)) for line in lines if line.startswith(_ROW)]
    count = head.pop("rows")
    if len(rows) != count:
        raise InputError(f"it is cut short, or has lines twice: {len(rows)} of {shorten(count)} flows are in it")
    return records.restored(head, rows)


def lines_of(path: Path) -> list[str]:
    """The lines of a text in UTF-8, with or without a byte-order mark."""
    with path.open(encoding="utf-8-sig") as file:
        return list(file)


def kept_in(lines: Sequence[str], start: str) -> Any:
    """The JSON value in the one line that begins with ``start``.

    Raises:
        InputError: where there is none, or several.
    """
    found = [line.removeprefix(start) for line in lines if line.startswith(start)]
    if len(found) != 1:
        raise InputError("it is cut short, or was not written by chuteflow")
    return contract.parsed(found[0])


def require_columns(lines: Sequence[str]) -> None:
    """Check that the table between the comments names no column twice.

    Raises:
        InputError: naming the column.
    """
    names = next((line for line in lines if not line.startswith("#")), "").rstrip("\n").split(",")
    for name, times in Counter(names).items():
        if times > 1:
            raise InputError(f"it has the column {name[:40]!r} {times} times")


def write_rows(file: TextIO, rows: Iterable[Sequence[Any]]) -> None:
    """Rows of a table, each number in full, and an empty cell for None and for what is not finite."""
    csv.writer(file, lineterminator="\n").writerows([_cell(value) for value in row] for row in rows)


def _cell(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_columns(file: TextIO, columns: Mapping[str, Any]) -> None:
    """Columns of equal size by name as the rows of a table."""
    write_rows(file, [list(columns), *zip(*(np.ravel(values).tolist() for values in columns.values()), strict=True)])


def _comments(result: Result, scales: Scales | None) -> Iterator[str]:
    yield f"chuteflow {__version__}: {TITLES[KIND_OF[type(result)]]}"
    yield "theory: " + PAPER
    yield "chute: " + ", ".join(f"{name} = {value}" for name, value in result.chute.as_dict().items())
    if not isinstance(result, Flow):
        low, high = result.searched.surface_temperature
        deepest = result.searched.largest_holdup
        yield f"searched (dimensionless): surface_temperature {low} to {high}, mass_holdup up to {deepest}"
        yield f"tolerance: {result.tolerance} relative in mass_flux, centre_of_mass and mass_holdup"
        if result.reason:
            yield f"no flow: {result.reason}"
    yield numbers_are(scales)
    names = [*NUMBERS] if isinstance(result, Curve) else [*NUMBERS, *FIELDS]
    for name in names:
        quantity = QUANTITIES[name]
        unit = "" if scales is None else f" [{quantity.unit}]"
        yield f"{name}: {quantity.symbol}{unit}, {quantity.description}, {quantity.equation}"
    yield "error: estimated relative error of mass_flux, centre_of_mass and mass_holdup, the largest"
    for name, quantity in VALIDITY.items():
        yield f"{name}: {quantity.description}"
    yield "validity: " + "; ".join(f"{word}: {meaning}" for word, meaning in WORDS.items())


def _write_table(file: TextIO, result: Result, found: Sequence[Row], scales: Scales | None) -> None:
    write_rows(file, _rows(result, found, scales))


def _rows(result: Result, found: Sequence[Row], scales: Scales | None) -> Iterator[Sequence[Any]]:
    if isinstance(result, Curve):
        yield ["branch", "special", *NUMBERS, *_KINDS]
        yield from ([row.branch, row.special, *_numbers(row.flow, scales)] for row in found)
        return
    yield ["flow", *FIELDS, *NUMBERS, *_KINDS]
    for i, row in enumerate(found):
        profile = row.flow.sampled(HEIGHTS)
        numbers = _numbers(row.flow, scales)
        columns = [getattr(profile, name) * factor(name, row.flow.chute, scales) for name in FIELDS]
        for values in zip(*columns, strict=True):
            yield [i, *map(float, values), *numbers]


def _numbers(flow: Flow, scales: Scales | None) -> list[Any]:
    """The numbers and kinds of a flow."""
    numbers = [getattr(flow, name) * factor(name, flow.chute, scales) for name in NUMBERS]
    known = flow.validity
    limits = [float(getattr(known, name)) for name in VALIDITY]
    return [*numbers, flow.interior, flow.density, flow.error, *limits, known.summary, flow.name]
