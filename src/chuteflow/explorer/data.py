"""Measurements and particle runs from files, as the page draws them behind the flows."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chuteflow.dem.measured import Measured
from chuteflow.errors import InputError
from chuteflow.explorer.contents import short
from chuteflow.fitting.measurements import Experiment, Scalar, Series
from chuteflow.io.contract import SHORT
from chuteflow.io.units import WITHOUT_GRAINS
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import PARAMETERS
from chuteflow.steady.quantities import PLACE, QUANTITIES, Scales

#: Fields that the page draws, by symbol, and numbers that place a flow on the curve.
_PROFILES = {"nu": "volume_fraction", "T": "granular_temperature", "u": "velocity"}
_NUMBERS = {QUANTITIES[name].symbol: name for name in PLACE}
#: Files, flows and heights of a flow at most.
_MOST_FLOWS, _MOST_HEIGHTS = 40, 400
#: A line at the beginning of a table of a particle run.
_HEAD = re.compile(rb"^#\s*(?:slope|e)\s*=", re.MULTILINE)


def read_data(
    paths: Sequence[str | os.PathLike[str]], *, slope: float | None = None, scales: Scales | None = None
) -> list[dict[str, Any]]:
    """What was measured, one entry for each flow: ``name``, ``what`` it is, ``profiles`` and ``numbers`` with errors
    by symbol, ``given``, parameters of its chute by key, and the ``slope`` that scales of its units belong to, or None.
    All is dimensionless.

    Args:
        paths: CSV as ``chuteflow fit`` reads it, and particle runs (.nc or .csv) as ``chuteflow dem read`` writes them.
        slope: of the chute, which units of measurements need where their file does not say it.
        scales: of the grains, which such units need too.

    Raises:
        InputError: for a file that is neither, naming what is wrong with it, or for more than can be drawn.
    """
    found = [one for path in paths for one in _read(Path(path), slope, scales)]
    if len(found) > _MOST_FLOWS:
        raise InputError(f"--data: {len(found)} flows are in the files: {_MOST_FLOWS} can be drawn at most")
    return found


def read_sent(
    name: str, content: bytes, *, slope: float | None = None, scales: Scales | None = None
) -> list[dict[str, Any]]:
    """What was measured, from the ``content`` of a file of some ``name``, as :func:`read_data`.

    Raises:
        InputError: as :func:`read_data`.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        try:
            return read_data([path], slope=slope, scales=scales)
        except InputError as error:
            said = str(error).replace(f"{path}", name).replace("--data: ", "")
            raise InputError(
                said.replace(WITHOUT_GRAINS, "a unit needs the grains: tick SI units and give them")
            ) from None


def _read(path: Path, slope: float | None, scales: Scales | None) -> Iterator[dict[str, Any]]:
    if _is_run(path):
        from chuteflow.dem.records import load

        yield _of_run(path.stem, load(path))
        return
    from chuteflow.io.measurements_file import read_measurements

    found = read_measurements(path, slope=slope, scales=scales)
    for one in found.experiments:
        name = path.stem if len(found.experiments) == 1 else f"{path.stem}, {one.name}"
        yield _of_experiment(name, one, known=found.errors_known) | {"slope": one.given.get("slope", slope)}


def _is_run(path: Path) -> bool:
    """Whether a file holds a particle run: it is NetCDF, or says the chute in lines before its table."""
    if path.suffix.lower() == ".nc":
        return True
    try:
        with path.open("rb") as file:
            return _HEAD.search(file.read(100_000)) is not None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None


def _of_run(name: str, run: Measured) -> dict[str, Any]:
    profiles = {
        symbol: _profile(run.height, run.fields[field], run.errors.get(field)) for symbol, field in _PROFILES.items()
    }
    numbers = {
        symbol: _number(run.numbers[field], run.number_errors.get(field))
        for symbol, field in _NUMBERS.items()
        if field in run.numbers
    }
    values = {SHORT[name]: getattr(run, name) for name in PARAMETERS}
    given = {key: float(value) for key, value in values.items() if np.isfinite(value)}
    what = f"particle run, {run.steadiness}; heights above the centres of the bumps"
    return {
        **{"name": name, "what": what, "profiles": profiles, "numbers": numbers, "given": given},
        "slope": given.get("slope"),
    }


def _of_experiment(name: str, one: Experiment, *, known: bool) -> dict[str, Any]:
    def spread(of: Series | Scalar) -> Any:
        return None if not known else of.error * np.abs(of.value) if of.relative else of.error

    profiles = {
        series.symbol: _profile(series.height, series.value, spread(series))
        for series in one.profiles
        if series.symbol in _PROFILES
    }
    numbers = {scalar.symbol: _number(scalar.value, spread(scalar)) for scalar in one.scalars}
    numbers |= {symbol: _number(value, None) for symbol, value in one.exact.items()}
    return {
        "name": name,
        "what": "measurements",
        "profiles": profiles,
        "numbers": {symbol: numbers[symbol] for symbol in _NUMBERS if symbol in numbers},
        "given": dict(one.given),
    }


def _profile(height: Array, value: Array, error: Array | None) -> dict[str, list[float] | None]:
    """Values at the heights that have one, thinned to _MOST_HEIGHTS; ``error`` is None where errors are unknown."""
    there = np.flatnonzero(np.isfinite(value))
    there = there[:: max(1, -(-len(there) // _MOST_HEIGHTS))]
    errors = None if error is None else short(np.nan_to_num(np.broadcast_to(error, value.shape)[there]))
    return {"z": short(height[there]), "value": short(value[there]), "error": errors}


def _number(value: float, error: float | None) -> dict[str, float | None]:
    return {"value": float(value), "error": float(error) if error is not None and np.isfinite(error) else None}
