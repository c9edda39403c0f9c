"""A result as NetCDF 4 with CF attributes.

One row along ``flow`` for each flow, on a curve the special points in their places. The group ``restore``
holds the unknowns, those of all flows one after the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

import h5netcdf
import h5py
import numpy as np

from chuteflow import __version__
from chuteflow.branches.results import KINDS, Curve
from chuteflow.checks import whole
from chuteflow.errors import InputError
from chuteflow.io import contract, records
from chuteflow.io.contract import factor, finite
from chuteflow.io.records import HEIGHTS, KIND_OF, Result, Row
from chuteflow.io.references import PAPER, TITLES, numbers_are
from chuteflow.steady.collocation import WHOLE
from chuteflow.steady.kinds import DENSITIES, INTERIORS
from chuteflow.steady.quantities import FIELDS, NUMBERS, VALIDITY, Quantity, Scales
from chuteflow.steady.solver import Status
from chuteflow.steady.validity import WORDS

_STATUS = tuple(Status)
#: Numbers in one variable of a file at most: as many as 10^5 flows have on the finest grid.
_LARGEST = 50_000_000
_INTEGERS = ("unknowns", "status", "branch", "special")
_PER_FLOW = {"degree": "i4", "stretch": "f8", "error": "f8"}


def write(result: Result, stream: BinaryIO, scales: Scales | None) -> None:
    """Write ``result`` to ``stream``, in memory: HDF5 may end the process where a disk is full."""
    found = records.rows(result)
    with create(stream) as file:
        file.dimensions = {"flow": len(found), "height_index": HEIGHTS}
        file.attrs.update(_attributes(result, scales))
        _write_numbers(file, found, scales)
        _write_kinds(file, found)
        _write_validity(file, found)
        if isinstance(result, Curve):
            _write_branches(file, found)
        _write_profiles(file, found, scales)
        _write_unknowns(file.create_group("restore"), result, found)


def create(stream: BinaryIO) -> h5netcdf.File:
    """A new file in ``stream``, whose metadata have checksums: HDF5 may read damaged ones without them for ever."""
    return h5netcdf.File(stream, "w", libver=("v108", "v108"))


def fixed_text(text: str) -> np.bytes_:
    """A text in ASCII as an attribute that lies in its metadata: others lie in a heap, which has no checksum."""
    return np.bytes_(text.encode("ascii"))


def read(path: Path) -> Result:
    """The result in the file.

    Raises:
        InputError: for a later or unknown format.
        OSError, ValueError, KeyError, TypeError: for a file that is not of this format.
    """
    with restored_group(path) as group:
        head = contract.parsed(group.attrs["head"])
        columns = {name: group[name][...].tolist() for name in (*_PER_FLOW, *_INTEGERS, "z", "macroscopic")}
        columns["breaks"] = contract.parsed(group.attrs.get("breaks", "[]"))
    return records.restored(head, list(_rows(columns)))


@contextmanager
def restored_group(path: Path) -> Iterator[Any]:
    """The group of a file that restores its result, once it is sure that it is not larger than any result.

    It is read without h5netcdf, which leaves what it has of a damaged file to complain when it is collected.

    Raises:
        InputError: where a variable is too large: a file can claim any size.
        OSError, KeyError: for a file that is damaged.
    """
    with h5py.File(path, "r") as file:
        group: Any = file["restore"]
        for name in group:
            size = math.prod(group[name].shape)
            if size > _LARGEST:
                raise InputError(f"{name} claims {size} numbers")
        yield group


def _rows(columns: Mapping[str, list[Any]]) -> Iterator[dict[str, Any]]:
    """The values of each flow, as :func:`records.unknowns` gives them."""
    lengths = [whole("the number of unknowns", length, 0) for length in columns["unknowns"]]
    if sum(lengths) != len(columns["z"]):
        raise InputError("a flow has the wrong number of unknowns")
    breaks = columns.get("breaks") or [[]] * len(lengths)
    if len(breaks) != len(lengths):
        raise InputError("the pieces of a grid: as many as flows are needed")
    statuses, kinds = [status.name for status in _STATUS], ("", *KINDS)
    end = 0
    for i, length in enumerate(lengths):
        end += length
        yield {name: columns[name][i] for name in ("degree", "stretch", "branch")} | {
            "breaks": breaks[i] or None,
            "z": columns["z"][end - length : end],
            "macroscopic": [finite(value) for value in columns["macroscopic"][i]],
            "error": None if columns["error"][i] == math.inf else columns["error"][i],
            "status": statuses[whole("status", columns["status"][i], 0, len(statuses) - 1)],
            "special": kinds[whole("special", columns["special"][i], 0, len(kinds) - 1)],
        }


def _attributes(result: Result, scales: Scales | None) -> dict[str, Any]:
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    attributes: dict[str, Any] = {
        "Conventions": "CF-1.11",
        "title": TITLES[KIND_OF[type(result)]],
        "source": f"chuteflow {__version__}",
        "history": f"{now} written by chuteflow {__version__}",
        "references": PAPER,
        "comment": numbers_are(scales),
        **result.chute.as_dict(),
    }
    if scales is not None:
        attributes |= {
            "grain_diameter_in_m": scales.diameter,
            "grain_density_in_kg_per_m3": scales.density,
            "gravity_in_m_per_s2": scales.gravity,
        }
    if not isinstance(result, records.Flow):
        attributes |= {
            "searched_surface_temperature": np.array(result.searched.surface_temperature),
            "searched_largest_holdup": result.searched.largest_holdup,
            "searched_comment": "dimensionless range in which flows were searched for",
            "tolerance": result.tolerance,
            "tolerance_comment": "relative error allowed in Q, h and M",
            "reason": result.reason or "",
        }
    return attributes


def _write_numbers(file: h5netcdf.File, found: Sequence[Row], scales: Scales | None) -> None:
    for name, quantity in NUMBERS.items():
        values = np.array([getattr(row.flow, name) * factor(name, row.flow.chute, scales) for row in found])
        # There is no interface on the half-line.
        if not len(values) or np.isfinite(values).all():
            attributes = _described(quantity, scales) | {"ancillary_variables": "error status"}
            write_variable(file, name, ("flow",), values, attributes)
    error = np.array([row.flow.error for row in found])
    attributes = {"units": "1", "long_name": "estimated relative error of Q, h and M, the largest"}
    write_variable(file, "error", ("flow",), error, attributes)


def _write_kinds(file: h5netcdf.File, found: Sequence[Row]) -> None:
    flows = [row.flow for row in found]
    for name, meanings, long_name in (
        ("interior", INTERIORS, "balance of fluctuation energy inside the flow"),
        ("density", DENSITIES, "course of the volume fraction with height"),
    ):
        _write_flags(file, name, [getattr(flow, name) for flow in flows], meanings, long_name)
    status = [flow.solution.status.name.lower() for flow in flows]
    _write_flags(file, "status", status, [s.name.lower() for s in _STATUS], "how the solution ended")


def _write_validity(file: h5netcdf.File, found: Sequence[Row]) -> None:
    """Numbers that tell how far flows keep to the theory, and a bit for each limit that is passed."""
    known = [row.flow.validity for row in found]
    for name, quantity in VALIDITY.items():
        values = np.array([getattr(one, name) for one in known], dtype="f8")
        write_variable(file, name, ("flow",), values, {"units": "1", "long_name": quantity.description})
    bits = {word: 1 << i for i, word in enumerate(WORDS)}
    attributes = {
        "long_name": "limits of the theory that are passed",
        "flag_masks": np.array([*bits.values()], dtype="i1"),
        "flag_meanings": " ".join(word.partition(":")[0].replace(" ", "_") for word in WORDS),
        "comment": "; ".join(f"{word}: {meaning}" for word, meaning in WORDS.items()),
    }
    passed = np.array([sum(bits[word] for word in one.words) for one in known], dtype="i1")
    write_variable(file, "validity", ("flow",), passed, attributes)


def _write_branches(file: h5netcdf.File, found: Sequence[Row]) -> None:
    branch = np.array([row.branch for row in found], dtype="i4")
    attributes = {"long_name": "number of the family of flows", "units": "1"}
    write_variable(file, "branch", ("flow",), branch, attributes)
    kinds = [row.special or "none" for row in found]
    comment = "; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS.items())
    _write_flags(file, "special_kind", kinds, ("none", *KINDS), "kind of special point", comment)


def _write_profiles(file: h5netcdf.File, found: Sequence[Row], scales: Scales | None) -> None:
    profiles = [row.flow.sampled(HEIGHTS) for row in found]
    for name, quantity in FIELDS.items():
        values = np.array(
            [getattr(p, name) * factor(name, row.flow.chute, scales) for p, row in zip(profiles, found, strict=True)]
        ).reshape(len(found), HEIGHTS)
        attributes = _described(quantity, scales)
        attributes |= {"positive": "up"} if name == "height" else {"coordinates": "height"}
        write_variable(file, name, ("flow", "height_index"), values, attributes)


def _write_unknowns(group: h5netcdf.Group, result: Result, found: Sequence[Row]) -> None:
    solutions = [row.flow.solution for row in found]
    group.attrs["long_name"] = "discretised unknowns, from which chuteflow rebuilds the flows to the last bit"
    group.attrs["head"] = fixed_text(contract.text(records.head(result, found)))
    breaks = [list(s.problem.breaks) if s.problem.breaks != WHOLE else [] for s in solutions]
    if any(breaks):
        group.attrs["breaks"] = fixed_text(contract.text(breaks))
    group.dimensions = {"unknown": sum(len(s.z) for s in solutions), "logarithm": 4}
    for name, kind in _PER_FLOW.items():
        values = [getattr(s if name == "error" else s.problem, name) for s in solutions]
        write_variable(group, name, ("flow",), np.array(values, dtype=kind).reshape(-1), {})
    kinds = ("", *KINDS)
    integers = {
        "unknowns": [len(s.z) for s in solutions],
        "status": [_STATUS.index(s.status) for s in solutions],
        "branch": [row.branch for row in found],
        "special": [kinds.index(row.special) for row in found],
    }
    for name, values in integers.items():
        write_variable(group, name, ("flow",), np.array(values, dtype="i4"), {})
    write_variable(group, "z", ("unknown",), np.concatenate([np.empty(0), *(s.z for s in solutions)]), {})
    macroscopic = np.array([s.macroscopic for s in solutions], dtype=float).reshape(-1, 4)
    attributes = {"long_name": "ln Q, ln h, ln M, ln T_surface"}
    write_variable(group, "macroscopic", ("flow", "logarithm"), macroscopic, attributes)


def _write_flags(
    group: h5netcdf.Group,
    name: str,
    values: Sequence[str],
    meanings: Sequence[str],
    long_name: str,
    comment: str = "",
) -> None:
    attributes = {
        "long_name": long_name,
        "flag_values": np.arange(len(meanings), dtype="i1"),
        "flag_meanings": " ".join(meanings),
        **({"comment": comment} if comment else {}),
    }
    write_variable(
        group, name, ("flow",), np.array([meanings.index(value) for value in values], dtype="i1"), attributes
    )


def write_variable(
    group: h5netcdf.Group, name: str, dimensions: tuple[str, ...], values: Any, attributes: dict[str, Any]
) -> None:
    """A variable of ``group`` with its values and attributes."""
    variable = group.create_variable(name, dimensions, values.dtype, data=values)
    variable.attrs.update(attributes)


def _described(quantity: Quantity, scales: Scales | None) -> dict[str, str]:
    return {
        "units": "1" if scales is None else quantity.unit,
        "long_name": quantity.description,
        "symbol": quantity.symbol,
        "comment": f"{quantity.equation} of the paper",
    }
