"""Files of measured flows: NetCDF 4 with CF attributes, and CSV, which other codes can write too.

A CSV begins with lines "# name = value" for what is one number or text, and then has one row for each height, with the
names of the columns before them. Needed are slope, e and the columns height, volume_fraction, velocity and
granular_temperature (or their symbols z, nu, u and T); a column NAME_error has standard errors. All numbers are
dimensionless. The overburden follows from the volume fraction where it is not given, the hold-up and the flux as well.
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from chuteflow import __version__
from chuteflow.checks import number, number_in, shorten
from chuteflow.dem.averages import tenths_of
from chuteflow.dem.measured import FIELDS, NUMBERS, Measured
from chuteflow.dem.output import Array
from chuteflow.dem.steadiness import Drift
from chuteflow.errors import InputError
from chuteflow.io.csv_file import write_rows
from chuteflow.io.dataset import Dataset, Variable
from chuteflow.io.references import PAPER, numbers_are
from chuteflow.io.writing import as_text, write_file

SAVED = (".nc", ".csv")
#: Parameters by their names in files.
_CHUTE = {
    "slope": "slope",
    "e": "restitution",
    "ew": "wall_restitution",
    "roughness": "roughness",
    "roughness_by_area": "roughness_by_area",
}
_ERROR = "_error"
_DRIFT = "drift_of_"
#: Names of columns that other codes may use.
_SYMBOLS = {"z": "height", **{symbol: name for name, (symbol, _) in FIELDS.items()}}
_NEEDED = ("height", "volume_fraction", "velocity", "granular_temperature")
_LEAST_HEIGHTS, _MOST_BYTES = 5, 50_000_000
#: Digits in CSV.
_DIGITS = 6


def save(measured: Measured, path: str | os.PathLike[str]) -> None:
    """Write a measured flow to ``path``, .nc or .csv; the file is whole or absent.

    Raises:
        InputError: for another ending, or a file that cannot be written.
    """
    write_file(path, {".nc": partial(_write_netcdf, measured), ".csv": partial(_write_csv, measured)})


def load(path: str | os.PathLike[str]) -> Measured:
    """The measured flow in a file, .nc or .csv.

    Raises:
        InputError: for a file that is missing, damaged or holds something else, naming what.
    """
    from chuteflow.io.reading import loading
    from chuteflow.io.writing import require_suffix

    suffix = require_suffix(path, SAVED)
    with loading(path, "holds no measured flow"):
        if os.path.getsize(path) > _MOST_BYTES:
            raise InputError(f"it is larger than {_MOST_BYTES // 1_000_000} MB")
        return _from_netcdf(Path(path)) if suffix == ".nc" else _from_csv(Path(path))


def _write_netcdf(measured: Measured, stream: BinaryIO) -> None:
    from chuteflow.io.netcdf_file import history, write_groups

    write_groups(stream, _dataset(measured, history()))


def _dataset(measured: Measured, history: str) -> Dataset:
    attributes = {
        "Conventions": "CF-1.11",
        "title": "a flow of grains down a chute, measured in a simulation of single grains",
        "source": f"chuteflow {__version__}",
        "history": history,
        "references": PAPER,
        "comment": f"{numbers_are(None)}; standard errors count the correlation of blocks of time",
        "steadiness": measured.steadiness,
        **{name: getattr(measured, attribute) for name, attribute in _CHUTE.items()},
        **measured.notes,
    }
    told = {"units": "1", "long_name": "height above the plane of the bumps' centres", "positive": "up"}
    variables = {"height": Variable(("height",), measured.height, told)}
    told = {"units": "1", "long_name": "fraction of the hold-up above, middle of a tenth"}
    variables["tenth"] = Variable(("tenth",), np.arange(1, 10) / 10.0 + 0.05, told)
    for name, values in measured.fields.items():
        variables |= _describe(name, ("height",), values, measured.errors.get(name), FIELDS[name])
    for name, values in measured.tenths.items():
        variables |= _describe(f"mean_{name}", ("tenth",), values, measured.tenth_errors.get(name), FIELDS[name])
    for name, value in measured.numbers.items():
        variables |= _describe(name, (), value, measured.number_errors.get(name), NUMBERS[name])
    for name, one in measured.drifts.items():
        about = ("", f"change of {name} over 300 time units, as a fraction of its mean")
        variables |= _describe(f"{_DRIFT}{name}", (), one.value, one.error, about)
    return Dataset(variables, attributes)


def _describe(
    name: str, dimensions: tuple[str, ...], values: Any, errors: Any, about: tuple[str, str]
) -> dict[str, Variable]:
    """A variable, and that of its standard errors where they are known."""
    symbol, long_name = about
    attributes = {"units": "1", "long_name": long_name} | ({"symbol": symbol} if symbol else {})
    if errors is None:
        return {name: Variable(dimensions, np.asarray(values), attributes)}
    own = {"units": "1", "long_name": f"standard error of {name}"}
    return {
        name: Variable(dimensions, np.asarray(values), attributes | {"ancillary_variables": name + _ERROR}),
        name + _ERROR: Variable(dimensions, np.asarray(errors), own),
    }


def _from_netcdf(path: Path) -> Measured:
    import h5py

    with h5py.File(path, "r") as file:
        if "tenth" not in file or "volume_fraction" not in file:
            raise InputError("it holds no measured flow; `chuteflow dem` writes one")
        datasets: dict[str, Any] = dict(file.items())
        columns = {name: np.asarray(found[()], dtype=float) for name, found in datasets.items()}
        attributes = {name: _plain(value) for name, value in file.attrs.items()}

    def part(names: Any, prefix: str = "", suffix: str = "") -> dict[str, Array]:
        return {name: columns[f"{prefix}{name}{suffix}"] for name in names if f"{prefix}{name}{suffix}" in columns}

    drifts = {
        name: Drift(float(columns[_DRIFT + name]), float(columns[_DRIFT + name + _ERROR]))
        for name in NUMBERS
        if _DRIFT + name in columns
    }
    known = {"Conventions", "title", "source", "history", "references", "comment", "steadiness", *_CHUTE}
    return Measured(
        **{attribute: float(attributes.get(name, math.nan)) for name, attribute in _CHUTE.items()},
        height=columns["height"],
        fields=part(FIELDS),
        errors=part(FIELDS, suffix=_ERROR),
        numbers={name: float(value) for name, value in part(NUMBERS).items()},
        number_errors={name: float(value) for name, value in part(NUMBERS, suffix=_ERROR).items()},
        tenths=part(FIELDS, prefix="mean_"),
        tenth_errors=part(FIELDS, prefix="mean_", suffix=_ERROR),
        drifts=drifts,
        notes={name: value for name, value in attributes.items() if name not in known and not name.startswith("_")},
    )


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if hasattr(value, "item") and np.size(value) == 1 else value


def _write_csv(measured: Measured, stream: BinaryIO) -> None:
    heads: dict[str, Any] = {"chuteflow": __version__}
    heads |= {name: getattr(measured, attribute) for name, attribute in _CHUTE.items()}
    for name, value in measured.numbers.items():
        heads[name] = value
        heads[name + _ERROR] = measured.number_errors.get(name, math.nan)
    for name, one in measured.drifts.items():
        heads |= {f"{_DRIFT}{name}": one.value, f"{_DRIFT}{name}{_ERROR}": one.error}
    for name, values in measured.tenths.items():
        errors = measured.tenth_errors.get(name, np.full(9, np.nan))
        for key, array in ((f"mean_{name}", values), (f"mean_{name}{_ERROR}", errors)):
            heads[key] = " ".join(_cell(value) or "nan" for value in array)
    heads |= measured.notes
    columns = {"height": measured.height}
    for name, values in measured.fields.items():
        columns[name] = values
        if name in measured.errors:
            columns[name + _ERROR] = measured.errors[name]
    with as_text(stream) as file:
        for name, value in heads.items():
            file.write(f"# {name} = {_cell(value) if isinstance(value, float) else value}\n")
        write_rows(file, [list(columns), *([_cell(v) for v in row] for row in zip(*columns.values(), strict=True))])


def _cell(value: float) -> str:
    return f"{value:.{_DIGITS}g}" if math.isfinite(value) else ""


def _from_csv(path: Path) -> Measured:
    heads: dict[str, str] = {}
    rows: list[list[str]] = []
    for line in path.read_text(encoding="utf-8-sig").splitlines():
        if line.startswith("#"):
            name, equals, value = line[1:].partition("=")
            if equals:
                heads[name.strip()] = value.strip()
        elif line.strip():
            rows.append(next(csv.reader([line])))
    if len(rows) < 1 + _LEAST_HEIGHTS:
        raise InputError(f"it has {max(len(rows) - 1, 0)} heights: at least {_LEAST_HEIGHTS} are needed")
    columns = _columns(rows)
    for name in ("slope", "e"):
        if name not in heads:
            raise InputError(f'it does not say {name}: write a line such as "# {name} = 0.18" at its beginning')
    return _complete(heads, columns)


def _columns(rows: list[list[str]]) -> dict[str, Array]:
    names = []
    for text in rows[0]:
        plain, error = (
            (text.strip().removesuffix(_ERROR), _ERROR) if text.strip().endswith(_ERROR) else (text.strip(), "")
        )
        names.append(_SYMBOLS.get(plain, plain) + error)
    if len(set(names)) < len(names):
        raise InputError("two columns have one name")
    for name in names:
        if name.removesuffix(_ERROR) not in ("height", *FIELDS):
            raise InputError(f"unknown column {shorten(name)}: choose from height, {', '.join(FIELDS)}")
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        raise InputError(f"the columns {', '.join(missing)} are missing")
    values = []
    for count, row in enumerate(rows[1:], 1):
        if len(row) != len(names):
            raise InputError(f"row {count} has {len(row)} cells, and there are {len(names)} columns")
        values.append([_value(f"{name} of row {count}", cell) for name, cell in zip(names, row, strict=True)])
    table = np.array(values)
    return {name: table[:, i] for i, name in enumerate(names)}


def _value(name: str, cell: str) -> float:
    return math.nan if cell.strip().lower() in ("", "nan") else number_in(name, cell)


def _complete(heads: Mapping[str, str], columns: dict[str, Array]) -> Measured:
    """A measured flow of what a file says, with the overburden, the hold-up and the flux from the profiles where they
    are not given."""
    z, nu, u = columns["height"], columns["volume_fraction"], columns["velocity"]
    if not (np.isfinite(z).all() and (np.diff(z) > 0.0).all()):
        raise InputError("the heights must ascend")
    if (nu[np.isfinite(nu)] < 0.0).any() or (columns["granular_temperature"] < 0.0).any():
        raise InputError("a volume fraction or granular temperature is negative")
    steps = np.diff(z) * 0.5 * (nu[1:] + nu[:-1])
    above = np.append(np.cumsum(steps[::-1])[::-1], 0.0)
    columns.setdefault("overburden", above)

    def head(name: str, otherwise: float = math.nan) -> float:
        return _value(name, heads[name]) if name in heads else otherwise

    numbers = {name: head(name) for name in NUMBERS if name in heads}
    numbers.setdefault("mass_holdup", float(columns["overburden"].max()))
    numbers.setdefault("mass_flux", float((np.diff(z) * 0.5 * (nu[1:] * u[1:] + nu[:-1] * u[:-1])).sum()))
    number("hold-up M", numbers["mass_holdup"], 1e-6, 1e3)
    fields = {name: columns[name] for name in FIELDS if name in columns}
    tenths = {name: _nine(heads[f"mean_{name}"]) for name in FIELDS if f"mean_{name}" in heads}
    drifts = {
        name: Drift(head(_DRIFT + name), head(_DRIFT + name + _ERROR)) for name in NUMBERS if _DRIFT + name in heads
    }
    own = ("chuteflow", *_CHUTE, *NUMBERS)
    notes = {
        name: value
        for name, value in heads.items()
        if name.removesuffix(_ERROR) not in own and not name.startswith(("mean_", _DRIFT))
    }
    return Measured(
        **{attribute: head(name) for name, attribute in _CHUTE.items()},
        height=z,
        fields=fields,
        errors={name: columns[name + _ERROR] for name in FIELDS if name + _ERROR in columns},
        numbers=numbers,
        number_errors={name: head(name + _ERROR) for name in numbers if name + _ERROR in heads},
        tenths=tenths or tenths_of(z, fields, numbers["mass_holdup"]),
        tenth_errors={name: _nine(heads[f"mean_{name}{_ERROR}"]) for name in FIELDS if f"mean_{name}{_ERROR}" in heads},
        drifts=drifts,
        notes=notes,
    )


def _nine(text: str) -> Array:
    values = np.array([_value("a mean over a tenth", cell) for cell in text.split()])
    if values.size != 9:
        raise InputError(f"{values.size} means over tenths of the overburden: there must be 9")
    return values
