"""A result as NetCDF 4 with CF attributes.

One row along ``flow`` for each flow, on a curve the special points in their places. The group ``restore``
holds the unknowns, those of all flows one after the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

import h5netcdf
import h5py
import numpy as np

from chuteflow import __version__
from chuteflow.branches.results import KINDS
from chuteflow.checks import whole
from chuteflow.errors import InputError
from chuteflow.io import contract, records
from chuteflow.io.contract import finite
from chuteflow.io.dataset import Dataset, Variable
from chuteflow.io.datasets import flow_dataset
from chuteflow.io.records import Result
from chuteflow.steady.collocation import WHOLE
from chuteflow.steady.quantities import Scales
from chuteflow.steady.solver import SolverStatus

_STATUS = tuple(SolverStatus)
#: Numbers in one variable of a file at most: as many as 10^5 flows have on the finest grid.
_LARGEST = 50_000_000
_INTEGERS = ("unknowns", "status", "branch", "special")
_PER_FLOW = ("degree", "stretch", "error")


def write(result: Result, stream: BinaryIO, scales: Scales | None) -> None:
    """Write ``result`` to ``stream``, in memory: HDF5 may end the process where a disk is full."""
    write_groups(stream, flow_dataset(result, scales, history()), restore=_unknowns(result))


def write_groups(stream: BinaryIO, root: Dataset, **groups: Dataset) -> None:
    """Write ``root``, and ``groups`` into groups of these names, which inherit its dimensions."""
    with create(stream) as file:
        root.write(file)
        for name, group in groups.items():
            group.write(file.create_group(name), inherited=[one for one in group.sizes if one in root.sizes])


def history() -> str:
    """Who writes a file, and when."""
    return f"{datetime.now(UTC).strftime('%Y-%m-%dT%H:%M:%SZ')} written by chuteflow {__version__}"


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


def _unknowns(result: Result) -> Dataset:
    found = records.rows(result)
    solutions = [row.flow.solution for row in found]
    attributes: dict[str, Any] = {
        "long_name": "discretised unknowns, from which chuteflow rebuilds the flows to the last bit",
        "head": fixed_text(contract.text(records.head(result, found))),
    }
    breaks = [list(s.problem.breaks) if s.problem.breaks != WHOLE else [] for s in solutions]
    if any(breaks):
        attributes["breaks"] = fixed_text(contract.text(breaks))
    kinds = ("", *KINDS)
    per_flow = {
        "degree": np.array([s.problem.degree for s in solutions], dtype="i4"),
        "stretch": np.array([s.problem.stretch for s in solutions], dtype="f8").reshape(-1),
        "error": np.array([s.error for s in solutions], dtype="f8"),
        "unknowns": np.array([len(s.z) for s in solutions], dtype="i4"),
        "status": np.array([_STATUS.index(s.status) for s in solutions], dtype="i4"),
        "branch": np.array([row.branch for row in found], dtype="i4"),
        "special": np.array([kinds.index(row.special) for row in found], dtype="i4"),
    }
    macroscopic = np.array([s.macroscopic for s in solutions], dtype=float).reshape(-1, 4)
    logarithms = {"long_name": "ln Q, ln h, ln M, ln T_surface"}
    return Dataset(
        {
            **{name: Variable(("flow",), values) for name, values in per_flow.items()},
            "z": Variable(("unknown",), np.concatenate([np.empty(0), *(s.z for s in solutions)])),
            "macroscopic": Variable(("flow", "logarithm"), macroscopic, logarithms),
        },
        attributes,
    )
