"""Boundaries as JSON, CSV and NetCDF: the second parameter, the place of the flow and the error of every point.

Turning points stand in their places along a boundary in tables, and apart in JSON.
"""

from __future__ import annotations

from typing import Any, BinaryIO

import numpy as np

from chuteflow.bifurcations.boundary import Boundary, BoundarySet
from chuteflow.io import contract
from chuteflow.io.contract import PLACE, SHORT, finite, place_object, places_object
from chuteflow.io.csv_file import write_columns
from chuteflow.io.datasets import dataset
from chuteflow.io.writing import as_text
from chuteflow.steady.quantities import Scales


def boundaries_object(found: BoundarySet, scales: Scales | None = None) -> dict[str, Any]:
    """What ``chuteflow boundary --json`` prints; the second parameter is null in the chute. Each flow takes SI units on
    its own slope; the range searched stays dimensionless."""
    chute = contract.chute_object(found.chute)
    second = SHORT[found.second]
    return {
        "chute": {**chute, second: None},
        "of": found.kind,
        "in": second,
        "range": list(found.bounds),
        "boundaries": [_boundary(boundary, second, scales) for boundary in found],
        "searched": {
            **contract.searched_object(found.chute, found.searched),
            second: list(found.sampled),
            "skipped": list(found.skipped),
        },
        "reason": found.reason,
        "incomplete": found.incomplete,
        **contract.units_object(scales, PLACE),
    }


def _boundary(boundary: Boundary, second: str, scales: Scales | None) -> dict[str, Any]:
    return {
        second: boundary.parameter.tolist(),
        **places_object(boundary.flows, scales),
        "error": [finite(v) for v in boundary.error],
        "special": [
            {
                "kind": turn.kind,
                second: getattr(turn.flow.chute, boundary.second),
                **place_object(turn.flow, scales),
                "error": finite(turn.error),
            }
            for turn in boundary.special
        ],
        "ends": list(boundary.ends),
    }


def _write_json(found: BoundarySet, stream: BinaryIO, scales: Scales | None) -> None:
    stream.write(contract.text(boundaries_object(found, scales)).encode() + b"\n")


def _write_csv(found: BoundarySet, stream: BinaryIO, scales: Scales | None) -> None:
    table = dataset(found, scales)
    columns = table.columns()
    kinds = columns["special"].tolist()
    columns["special"] = np.array(["" if kind == "none" else kind for kind in kinds], dtype=object)
    with as_text(stream) as file:
        about = {name: text for name, text in table.attributes.items() if name != "Conventions"}
        file.writelines(f"# {name}: {text}\n" for name, text in about.items())
        file.write("# error: estimated relative error of Q, h, M and the second parameter, the largest\n")
        write_columns(file, columns)


def _write_netcdf(found: BoundarySet, stream: BinaryIO, scales: Scales | None) -> None:
    from chuteflow.io.netcdf_file import write_groups

    write_groups(stream, dataset(found, scales))


#: What writes boundaries to a stream, by the ending of the file.
WRITERS = {".nc": _write_netcdf, ".csv": _write_csv, ".json": _write_json}
