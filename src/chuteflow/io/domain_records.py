"""Maps of domains as objects, tables and NetCDF, and back.

A file keeps the columns from which a map is read, so that it loads back to the last bit.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from chuteflow import __version__
from chuteflow.branches.ranges import Range
from chuteflow.checks import checked_size, number, whole
from chuteflow.errors import InputError
from chuteflow.io import contract
from chuteflow.io.contract import SHORT
from chuteflow.io.csv_file import kept_in, lines_of, require_columns
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
from chuteflow.maps import KINDS_OF_BOUNDARIES, Axis, Boundary, Domain, Plane
from chuteflow.maps.columns import Column, Part
from chuteflow.maps.domain import COARSEST, FINEST, LARGEST_SIZE
from chuteflow.maps.kinds import DENSITIES, INTERIORS
from chuteflow.maps.plane import CODES, HOT_CODES
from chuteflow.steady.quantities import Scales

TITLE = "domains of existence of steady, fully developed flows of grains down a chute"
KIND, FORMAT = "domain", 1
#: More cells than this are not printed with an object.
MOST_CELLS = 10_000
_RESTORE = "# restore: "
#: Numbers of a cell: what they mean, and what their values mean, or the bits of which they are sums.
CLASSES: dict[str, tuple[str, dict[int, str]]] = {
    "hot": (
        "hot, dilute flows by the closed form of section 4",
        {-1: "not_known_with_interface_conditions", 0: "no_hot_flows", 1: "hot_flows"},
    ),
    "exists": ("any flow in the range searched", {0: "no_flow", 1: "flows"}),
    "most": ("largest number of flows that share one mass flux", {}),
    "families": ("number of families, connected sets of flows", {}),
    "hidden": (
        "hidden families: more than one, so that a continuation from a known flow does not meet all",
        {0: "none", 1: "hidden_families"},
    ),
    "interior": ("kinds of interior among the flows", {bit: name for name, bit in INTERIORS.items()}),
    "density": ("kinds of density among the flows", {bit: name for name, bit in DENSITIES.items()}),
}
#: Those of CLASSES whose values are sums of bits.
BITS = ("interior", "density")


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
        "searched": {
            "T_surface": list(found.searched.surface_temperature),
            "M_max": found.searched.largest_holdup,
        },
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
    """The share of the cells that has each value, number by number; of ``exists_at`` at each temperature."""
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


def _boundary(one: Boundary) -> dict[str, Any]:
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
    x, y = (Axis(str(name), low, high) for name, low, high in kept["axes"])
    surface_temperature, deepest = kept["searched"]
    within = Range.checked(surface_temperature, deepest, chute.surface)
    temperatures = numbers("temperatures", kept["temperatures"])
    plane = Plane(x, y, chute, tuple(temperatures.tolist()), within)
    found = Domain.on_cells(
        plane,
        checked_size(kept["size"], 1, LARGEST_SIZE),
        number("tolerance", kept["tolerance"], FINEST, COARSEST),
        _columns_from(kept["columns"], len(CODES) + len(temperatures)),
        _columns_from(kept["hot_columns"], len(HOT_CODES)),
    )
    require_checksum(kept)
    return found


def _columns_from(kept: Sequence[Any], count: int) -> tuple[Column, ...]:
    """Columns of ``count`` parts each.

    Raises:
        InputError: for places or stops that are no shares of an axis, or do not rise.
    """
    places = _shares_from([place for place, _ in kept])
    columns = tuple(
        Column(place, tuple(_part_from(*part) for part in parts))
        for place, (_, parts) in zip(places, kept, strict=True)
    )
    if any(len(one.parts) != count for one in columns):
        raise InputError(f"a column must have {count} numbers")
    return columns


def _part_from(stops: Any, values: Any) -> Part:
    part = Part(_shares_from(stops), tuple(whole("a class", value, -1, 10**6) for value in values))
    if len(part.values) != len(part.stops) + 1:
        raise InputError("a column must have one class more than stops")
    return part


def _shares_from(kept: Any) -> tuple[float, ...]:
    found = tuple(number("a share of an axis", share, 0.0, 1.0) for share in kept)
    if any(one >= two for one, two in pairwise(found)):
        raise InputError("shares of an axis must rise")
    return found


# Files


def write(found: Domain, stream: BinaryIO, suffix: str) -> None:
    """Write a map to ``stream`` in the format of ``suffix``: .nc, .csv or .json."""
    {".nc": _write_netcdf, ".csv": _write_csv, ".json": _write_json}[suffix](found, stream)


def read(path: Path) -> Domain | None:
    """The map in a file, .nc, .csv or .json; None where it holds something else.

    Raises:
        InputError: for a later format.
        OSError, ValueError, KeyError, TypeError: for a file that is damaged.
    """
    kept = {".nc": _kept_in_netcdf, ".csv": _kept_in_csv, ".json": _kept_in_json}[path.suffix.lower()](path)
    return None if kept is None else _restored(kept)


def _write_json(found: Domain, stream: BinaryIO) -> None:
    whole = domain_object(found, found.most.size) | {"source": f"chuteflow {__version__}", "restore": _kept(found)}
    stream.write(contract.text(whole).encode() + b"\n")


def _kept_in_json(path: Path) -> Any:
    kept = contract.parsed(path.read_bytes())["restore"]
    return kept if kept["kind"] == KIND else None


def _write_csv(found: Domain, stream: BinaryIO) -> None:
    """One row for each cell, row by row from the lowest y, between comment lines."""
    plane = found.plane
    layers = {name: getattr(found, name).astype(int).ravel() for name in CLASSES}
    layers |= {
        f"exists_at_{temperature:g}": layer.astype(int).ravel()
        for temperature, layer in zip(plane.temperatures, found.exists_at, strict=True)
    }
    y, x = np.meshgrid(found.y, found.x, indexing="ij")
    with as_text(stream) as file:
        file.writelines(f"# {line}\n" for line in _comments(found))
        table = csv.writer(file, lineterminator="\n")
        table.writerow([plane.x.name, plane.y.name, *layers])
        columns = [x.ravel().tolist(), y.ravel().tolist(), *(layer.tolist() for layer in layers.values())]
        table.writerows(zip(*columns, strict=True))
        file.write(_RESTORE + contract.text(_kept(found)) + "\n")


def _comments(found: Domain) -> Iterator[str]:
    plane = found.plane
    yield f"chuteflow {__version__}: {TITLE}"
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
    if not lines or TITLE not in lines[0]:
        return None
    require_columns(lines)
    return kept_in(lines, _RESTORE)


def _write_netcdf(found: Domain, stream: BinaryIO) -> None:
    from chuteflow.io.netcdf_file import create, fixed_text

    plane = found.plane
    x, y = plane.x.name, plane.y.name
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    fixed = {name: value for name, value in plane.chute.as_dict().items() if name not in (x, y)}
    with create(stream) as file:
        layers = {"temperature": len(plane.temperatures)} if plane.temperatures else {}
        file.dimensions = {**layers, y: len(found.y), x: len(found.x)}
        file.attrs.update(
            {
                "Conventions": "CF-1.11",
                "title": TITLE,
                "source": f"chuteflow {__version__}",
                "history": f"{now} written by chuteflow {__version__}",
                "references": PAPER,
                "comment": numbers_are(None),
                **fixed,
                "searched_surface_temperature": np.array(found.searched.surface_temperature),
                "searched_largest_holdup": found.searched.largest_holdup,
                "tolerance": found.tolerance,
                "tolerance_comment": "share of each axis to which boundaries are located",
            }
        )
        for name, values in ((x, found.x), (y, found.y)):
            _put(file, name, (name,), values, {"units": "1", "long_name": f"{name.replace('_', ' ')} of the chute"})
        for name in CLASSES:
            _put(file, name, (y, x), getattr(found, name).astype("i2" if name == "most" else "i1"), _flags(name))
        if plane.temperatures:
            attributes = {"units": "1", "long_name": "surface temperature"}
            _put(file, "temperature", ("temperature",), np.array(plane.temperatures), attributes)
            attributes = {"long_name": "a flow at the surface temperature", **_two("no_flow", "flow")}
            _put(file, "exists_at", ("temperature", y, x), found.exists_at.astype("i1"), attributes)
        _write_boundaries(file.create_group("boundaries"), found)
        kept = np.frombuffer(contract.text(_kept(found)).encode(), dtype="u1")
        group = file.create_group("restore")
        group.attrs["long_name"] = "columns, from which chuteflow restores the map to the last bit"
        group.attrs["kind"] = fixed_text(KIND)
        group.dimensions = {"byte": len(kept)}
        _put(group, "columns", ("byte",), kept, {})


def _flags(name: str) -> dict[str, Any]:
    meaning, values = CLASSES[name]
    if not values:
        return {"long_name": meaning, "units": "1"}
    numbers = np.array(list(values), dtype="i1")
    flags = "flag_masks" if name in BITS else "flag_values"
    return {"long_name": meaning, flags: numbers, "flag_meanings": " ".join(values.values())}


def _two(no: str, yes: str) -> dict[str, Any]:
    return {"flag_values": np.arange(2, dtype="i1"), "flag_meanings": f"{no} {yes}"}


def _write_boundaries(group: Any, found: Domain) -> None:
    """All boundaries, point after point, with the number of the line and its kind."""
    lines, kinds = found.boundaries, tuple(KINDS_OF_BOUNDARIES)
    lengths = [len(one.points) for one in lines]
    points = np.concatenate([np.empty((0, 2)), *(one.points for one in lines)])
    group.attrs["long_name"] = "boundaries between classes as lines"
    group.dimensions = {"point": len(points)}
    for name, values in ((found.plane.x.name, points[:, 0]), (found.plane.y.name, points[:, 1])):
        _put(group, name, ("point",), values, {"units": "1", "long_name": name.replace("_", " ")})
    number = np.repeat(np.arange(len(lines), dtype="i4"), lengths)
    _put(group, "line", ("point",), number, {"units": "1", "long_name": "number of the line"})
    attributes = {
        "long_name": "kind of boundary",
        "flag_values": np.arange(len(kinds), dtype="i1"),
        "flag_meanings": " ".join(kinds),
        "comment": "; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS_OF_BOUNDARIES.items()),
    }
    kind = np.repeat(np.array([kinds.index(one.kind) for one in lines], dtype="i1"), lengths)
    _put(group, "kind", ("point",), kind, attributes)


def _put(group: Any, name: str, dimensions: tuple[str, ...], values: np.ndarray, attributes: dict[str, Any]) -> None:
    variable = group.create_variable(name, dimensions, values.dtype, data=values)
    variable.attrs.update(attributes)


def _kept_in_netcdf(path: Path) -> Any:
    from chuteflow.io.netcdf_file import restored_group

    with restored_group(path) as group:
        # Files of chuteflow 0.1 have it as a text of any length.
        if group.attrs.get("kind") not in (KIND, KIND.encode()):
            return None
        return contract.parsed(bytes(group["columns"][...]))
