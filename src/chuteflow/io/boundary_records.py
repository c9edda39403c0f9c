"""Boundaries as JSON, CSV and NetCDF: the second parameter, the place of the flow and the error of every point.

Turning points stand in their places along a boundary in tables, and apart in JSON.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator
from io import BytesIO
from typing import Any, BinaryIO

from chuteflow import __version__
from chuteflow.bifurcations.boundary import Boundary, BoundarySet, Turning
from chuteflow.io import contract
from chuteflow.io.contract import PLACE, SHORT, finite
from chuteflow.io.references import PAPER, numbers_are
from chuteflow.io.writing import as_text, require_writable, write_whole
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import NUMBERS, Scales


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
            "T_surface": list(found.searched.surface_temperature),
            "M_max": found.searched.largest_holdup,
            second: list(found.sampled),
            "skipped": list(found.skipped),
        },
        "reason": found.reason,
        "incomplete": found.incomplete,
        **contract.units_object(scales, PLACE),
    }


def save(found: BoundarySet, path: str | os.PathLike[str], *, scales: Scales | None = None) -> None:
    """Write boundaries to ``path``: .nc, .csv or .json, whole or not at all; in SI units where ``scales`` are given.

    Raises:
        InputError: for another ending, or a file that cannot be written.
    """
    write = {".json": _write_json, ".csv": _write_csv, ".nc": _write_netcdf}
    suffix = require_writable(path, tuple(write))
    stream = BytesIO()
    write[suffix](found, stream, scales)
    write_whole(path, stream.getvalue())


def _boundary(boundary: Boundary, second: str, scales: Scales | None) -> dict[str, Any]:
    return {
        second: boundary.parameter.tolist(),
        **{NUMBERS[name].symbol: [finite(_scaled(f, name, scales)) for f in boundary.flows] for name in PLACE},
        "error": [finite(v) for v in boundary.error],
        "special": [
            {
                "kind": turn.kind,
                second: getattr(turn.flow.chute, boundary.second),
                **{NUMBERS[name].symbol: finite(_scaled(turn.flow, name, scales)) for name in PLACE},
                "error": finite(turn.error),
            }
            for turn in boundary.special
        ],
        "ends": list(boundary.ends),
    }


def _scaled(flow: Flow, name: str, scales: Scales | None) -> float:
    return getattr(flow, name) * contract.factor(name, flow.chute, scales)


def _write_json(found: BoundarySet, stream: BinaryIO, scales: Scales | None) -> None:
    stream.write(contract.text(boundaries_object(found, scales)).encode() + b"\n")


def _rows(found: BoundarySet) -> Iterator[tuple[int, str, Flow, float]]:
    """Number of the boundary, kind of turning point or empty, flow and error of every point, in order."""
    for number, boundary in enumerate(found):
        for i, (flow, error) in enumerate(zip(boundary.flows, boundary.error.tolist(), strict=True)):
            yield number, "", flow, error
            yield from ((number, t.kind, t.flow, t.error) for t in _after(boundary, i))


def _after(boundary: Boundary, position: int) -> list[Turning]:
    return [turn for turn in boundary.special if turn.position == position]


def _columns(found: BoundarySet, scales: Scales | None) -> dict[str, list[Any]]:
    rows = list(_rows(found))
    return {
        "boundary": [number for number, *_ in rows],
        "special": [kind for _, kind, *_ in rows],
        found.second: [getattr(flow.chute, found.second) for _, _, flow, _ in rows],
        **{name: [_scaled(flow, name, scales) for _, _, flow, _ in rows] for name in PLACE},
        "error": [error for *_, error in rows],
    }


def _about(found: BoundarySet, scales: Scales | None) -> dict[str, str]:
    others = {name: value for name, value in found.chute.as_dict().items() if name != found.second}
    return {
        "title": f"boundaries of the kind {found.kind} through {found.second}",
        "source": f"chuteflow {__version__}",
        "references": PAPER,
        "comment": numbers_are(scales),
        "chute": ", ".join(f"{name} = {value}" for name, value in others.items()),
        "ends": "; ".join(f"boundary {i}: {b.ends[0]}, {b.ends[1]}" for i, b in enumerate(found)) or str(found.reason),
    }


def _write_csv(found: BoundarySet, stream: BinaryIO, scales: Scales | None) -> None:
    columns = _columns(found, scales)
    with as_text(stream) as file:
        file.writelines(f"# {name}: {text}\n" for name, text in _about(found, scales).items())
        file.write("# error: estimated relative error of Q, h, M and the second parameter, the largest\n")
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows(zip(*columns.values(), strict=True))


def _write_netcdf(found: BoundarySet, stream: BinaryIO, scales: Scales | None) -> None:
    import numpy as np

    from chuteflow.bifurcations.tracing import TURNS
    from chuteflow.io.netcdf_file import create

    columns = _columns(found, scales)
    kinds = ("none", *TURNS)
    described: dict[str, tuple[Any, dict[str, Any]]] = {
        "boundary": (np.array(columns["boundary"], dtype="i4"), {"long_name": "number of the boundary"}),
        "special": (
            np.array([kinds.index(kind or "none") for kind in columns["special"]], dtype="i1"),
            {
                "long_name": "kind of turning point",
                "flag_values": np.arange(len(kinds), dtype="i1"),
                "flag_meanings": " ".join(kinds),
                "comment": "; ".join(f"{kind}: {meaning}" for kind, meaning in TURNS.items()),
            },
        ),
        found.second: (np.array(columns[found.second]), {"long_name": found.second, "units": "1"}),
        **{
            name: (
                np.array(columns[name]),
                {"long_name": NUMBERS[name].description, "units": "1" if scales is None else NUMBERS[name].unit},
            )
            for name in PLACE
        },
        "error": (
            np.array(columns["error"]),
            {"long_name": "estimated relative error of Q, h, M and the second parameter, the largest", "units": "1"},
        ),
    }
    with create(stream) as file:
        file.dimensions = {"point": len(columns["error"])}
        file.attrs.update({"Conventions": "CF-1.11", **_about(found, scales)})
        for name, (values, attributes) in described.items():
            file.create_variable(name, ("point",), values.dtype, data=values).attrs.update(attributes)
