"""Maps of domains as objects, tables and NetCDF, and back.

A file keeps the columns from which a map is read, so that it loads back to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from chuteflow import __version__
from chuteflow.branches.ranges import SearchRange
from chuteflow.checks import check_size, number, whole
from chuteflow.errors import InputError
from chuteflow.io import contract
from chuteflow.io.contract import SHORT
from chuteflow.io.csv_file import kept_in, lines_of, require_columns, write_columns
from chuteflow.io.dataset import Dataset, Variable
from chuteflow.io.datasets import BITS, CLASSES, DOMAIN_TITLE, dataset, outlines
from chuteflow.io.records import (
    CHECKSUM,
    CLOSURE,
    LAW,
    checksum,
    chute_from,
    fingerprint_of,
    numbers,
    require_checksum,
    require_format,
    require_law,
)
from chuteflow.io.references import PAPER, numbers_are
from chuteflow.io.writing import as_text
from chuteflow.maps import KINDS_OF_BOUNDARIES, Domain, Outline, ParameterAxis, ParameterPlane
from chuteflow.maps.columns import Column, PiecewiseConstant
from chuteflow.maps.domain import COARSEST, FINEST, LARGEST_SIZE
from chuteflow.maps.plane import CODES, HOT_CODES
from chuteflow.steady.quantities import Scales

KIND, FORMAT = "domain", 1
#: More cells than this are not printed with an object.
MOST_CELLS = 10_000
_RESTORE = "# restore: "


def domain_object(found: Domain, most_cells: int = MOST_CELLS) -> dict[str, Any]:
    """What ``chuteflow domain --json`` prints; ``cells`` is null where there are more than ``most_cells``."""
    plane = found.plane
    names = [SHORT[plane.x.name], SHORT[plane.y.name]]
    chute = contract.chute_object(plane.chute)
    return {
        "chute": {**chute, **dict.fromkeys(names)},
        "x": {"name": names[0], "range": [plane.x.low, plane.x.high]},
        "y": {"name": names[1], "range": [plane.y.low, plane.y.high]},
        "size": [len(found.x), len(found.y)],
        "temperatures": list(plane.temperatures),
        "tolerance": found.tolerance,
        "classes": {name: _explained(name) for name in CLASSES},
        "shares": shares(found),
        "cells": _cells(found) if found.most.size <= most_cells else None,
        "boundaries": [_boundary(one) for one in found.boundaries],
        "searched": contract.searched_object(plane.chute, found.searched),
    }


def in_si(found: Domain, scales: Scales | None) -> dict[str, Any]:
    """What an object has beside it with ``scales``: its temperatures in SI units, null where the slope is an axis, with
    which they change."""
    if scales is None:
        return {}
    plane = found.plane
    one = "slope" not in (plane.x.name, plane.y.name)
    factor = scales.factor("surface_temperature", plane.chute.slope)
    temperatures = [value * factor for value in plane.temperatures]
    return {"temperatures_si": temperatures if one else None, **contract.units_object(scales, ("surface_temperature",))}


def shares(found: Domain) -> dict[str, Any]:
    """The fraction of the cells that has each value, number by number; of ``exists_at`` at each temperature."""
    return {
        **{name: _shares(getattr(found, name)) for name in CLASSES},
        "exists_at": [_shares(layer) for layer in found.exists_at],
    }


def _shares(values: np.ndarray) -> dict[str, float]:
    each, counts = np.unique(values.astype(int), return_counts=True)
    return {str(value): count / values.size for value, count in zip(each.tolist(), counts.tolist(), strict=True)}


def _explained(name: str) -> dict[str, Any]:
    meaning, values = CLASSES[name]
    kind = {"bits": values} if name in BITS else {"values": values} if values else {}
    return {"meaning": meaning, **{key: {str(v): said for v, said in of.items()} for key, of in kind.items()}}


def _cells(found: Domain) -> dict[str, Any]:
    return {
        "x": found.x.tolist(),
        "y": found.y.tolist(),
        **{name: getattr(found, name).astype(int).tolist() for name in CLASSES},
        "exists_at": found.exists_at.astype(int).tolist(),
    }


def _boundary(one: Outline) -> dict[str, Any]:
    return {
        "kind": one.kind,
        "meaning": KINDS_OF_BOUNDARIES[one.kind],
        "values": list(one.values),
        "temperature": one.temperature,
        "points": one.points.tolist(),
    }


# What restores a map


def _kept(found: Domain) -> dict[str, Any]:
    plane = found.plane
    within = plane.within
    kept = {
        "format": FORMAT,
        "kind": KIND,
        "chute": contract.chute_object(plane.chute),
        LAW: fingerprint_of(plane.chute),
        CLOSURE: contract.closure_object(plane.chute),
        "axes": [[axis.name, axis.low, axis.high] for axis in (plane.x, plane.y)],
        "size": [len(found.x), len(found.y)],
        "temperatures": list(plane.temperatures),
        "searched": [[within.coldest, within.hottest], within.deepest],
        "tolerance": found.tolerance,
        "columns": _columns_kept(found.columns),
        "hot_columns": _columns_kept(found.hot_columns),
    }
    return kept | {CHECKSUM: checksum(kept)}


def _columns_kept(columns: Sequence[Column]) -> list[Any]:
    return [[one.place, [[list(part.stops), list(part.values)] for part in one.parts]] for one in columns]


def _restored(kept: Mapping[str, Any]) -> Domain:
    """The map that was kept.

    Raises:
        InputError: for a later format, or for what is no map.
    """
    require_format(kept)
    chute = chute_from(kept)
    require_law(chute, kept)
    x, y = (ParameterAxis(str(name), low, high) for name, low, high in kept["axes"])
    surface_temperature, deepest = kept["searched"]
    within = SearchRange.checked(surface_temperature, deepest, chute.surface)
    temperatures = numbers("temperatures", kept["temperatures"])
    plane = ParameterPlane(x, y, chute, tuple(temperatures.tolist()), within)
    found = Domain.on_cells(
        plane,
        check_size(kept["size"], 1, LARGEST_SIZE),
        number("tolerance", kept["tolerance"], FINEST, COARSEST),
        _columns_from(kept["columns"], len(CODES) + len(temperatures)),
        _columns_from(kept["hot_columns"], len(HOT_CODES)),
    )
    require_checksum(kept)
    return found


def _columns_from(kept: Sequence[Any], count: int) -> tuple[Column, ...]:
    """Columns of ``count`` parts each.

    Raises:
        InputError: for places or stops that are no fractions of an axis, or do not rise.
    """
    places = _shares_from([place for place, _ in kept])
    columns = tuple(
        Column(place, tuple(_part_from(*part) for part in parts))
        for place, (_, parts) in zip(places, kept, strict=True)
    )
    if any(len(one.parts) != count for one in columns):
        raise InputError(f"a column must have {count} numbers")
    return columns


def _part_from(stops: Any, values: Any) -> PiecewiseConstant:
    part = PiecewiseConstant(_shares_from(stops), tuple(whole("a class", value, -1, 10**6) for value in values))
    if len(part.values) != len(part.stops) + 1:
        raise InputError("a column must have one class more than stops")
    return part


def _shares_from(kept: Any) -> tuple[float, ...]:
    found = tuple(number("a fraction of an axis", fraction, 0.0, 1.0) for fraction in kept)
    if any(one >= two for one, two in pairwise(found)):
        raise InputError("fractions of an axis must rise")
    return found


# Files


def read(path: Path) -> Domain | None:
    """The map in a file, .nc, .csv or .json; None where it holds something else.

    Raises:
        InputError: for a later format.
        OSError, ValueError, KeyError, TypeError: for a file that is damaged.
    """
    kept = {".nc": _kept_in_netcdf, ".csv": _kept_in_csv, ".json": _kept_in_json}[path.suffix.lower()](path)
    return None if kept is None else _restored(kept)


def _require_none(scales: Scales | None) -> None:
    if scales is not None:
        raise InputError("a domain has no units: save it without scales")


def _write_json(found: Domain, stream: BinaryIO, scales: Scales | None) -> None:
    _require_none(scales)
    whole = domain_object(found, found.most.size) | {"source": f"chuteflow {__version__}", "restore": _kept(found)}
    stream.write(contract.text(whole).encode() + b"\n")


def _kept_in_json(path: Path) -> Any:
    kept = contract.parsed(path.read_bytes())["restore"]
    return kept if kept["kind"] == KIND else None


def _write_csv(found: Domain, stream: BinaryIO, scales: Scales | None) -> None:
    """One row for each cell, row by row from the lowest y, between comment lines."""
    _require_none(scales)
    plane = found.plane
    table = dataset(found)
    y, x = np.meshgrid(found.y, found.x, indexing="ij")
    layers = {name: table.variables[name].values for name in CLASSES}
    layers |= {
        f"exists_at_{temperature:g}": layer
        for temperature, layer in zip(plane.temperatures, found.exists_at.astype(int), strict=True)
    }
    with as_text(stream) as file:
        file.writelines(f"# {line}\n" for line in _comments(found))
        write_columns(file, {plane.x.name: x, plane.y.name: y, **layers})
        file.write(_RESTORE + contract.text(_kept(found)) + "\n")


def _comments(found: Domain) -> Iterator[str]:
    plane = found.plane
    yield f"chuteflow {__version__}: {DOMAIN_TITLE}"
    yield "theory: " + PAPER
    fixed = {k: v for k, v in plane.chute.as_dict().items() if k not in (plane.x.name, plane.y.name)}
    yield "chute: " + ", ".join(f"{name} = {value}" for name, value in fixed.items())
    low, high = found.searched.surface_temperature
    yield f"searched: surface_temperature {low} to {high}, mass_holdup up to {found.searched.largest_holdup}"
    yield f"tolerance: boundaries are located to {found.tolerance} of each axis"
    yield numbers_are(None)
    for name, (meaning, values) in CLASSES.items():
        said = ", ".join(f"{value} {what}" for value, what in values.items())
        kind = " (sum of)" if name in BITS else ""
        yield f"{name}: {meaning}" + (f"{kind}: {said}" if said else "")
    if plane.temperatures:
        yield "exists_at_T: 1 where there is a flow at the surface temperature T, else 0"


def _kept_in_csv(path: Path) -> Any:
    lines = lines_of(path)
    if not lines or DOMAIN_TITLE not in lines[0]:
        return None
    require_columns(lines)
    return kept_in(lines, _RESTORE)


def _write_netcdf(found: Domain, stream: BinaryIO, scales: Scales | None) -> None:
    _require_none(scales)
    from chuteflow.io.netcdf_file import fixed_text, history, write_groups

    map_ = dataset(found)
    kept = np.frombuffer(contract.text(_kept(found)).encode(), dtype="u1")
    about = {
        "long_name": "columns, from which chuteflow restores the map to the last bit",
        "kind": fixed_text(KIND),
    }
    root = Dataset(map_.variables, {**map_.attributes, "history": history()})
    restore = Dataset({"columns": Variable(("byte",), kept)}, about)
    write_groups(stream, root, boundaries=outlines(found), restore=restore)


#: What writes a map to a stream, by the ending of the file.
WRITERS = {".nc": _write_netcdf, ".csv": _write_csv, ".json": _write_json}


def _kept_in_netcdf(path: Path) -> Any:
    from chuteflow.io.netcdf_file import restored_group

    with restored_group(path) as group:
        # Files of chuteflow 0.1 have it as a text of any length.
        if group.attrs.get("kind") not in (KIND, KIND.encode()):
            return None
        return contract.parsed(bytes(group["columns"][...]))
