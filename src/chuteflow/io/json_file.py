"""A result as JSON: the object of the command line's ``--json``, and beside it what restores the result."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

from chuteflow import __version__
from chuteflow.branches.results import FlowSet
from chuteflow.io import contract, records
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import Scales


def write(result: records.Result, stream: BinaryIO, scales: Scales | None) -> None:
    """Write ``result`` to ``stream``; a single flow has the shape of a set of one."""
    found = records.rows(result)
    whole = _readable(result, scales) | {
        "source": f"chuteflow {__version__}",
        "restore": records.head(result, found) | {"rows": [records.unknowns(row) for row in found]},
    }
    stream.write(contract.text(whole).encode() + b"\n")


def read(path: Path) -> records.Result:
    """The result in the file.

    Raises:
        InputError: for a later or unknown format.
        ValueError, KeyError, TypeError: for a file that is not of this format.
    """
    kept = contract.parsed(path.read_bytes())["restore"]
    rows = kept.pop("rows")
    return records.restored(kept, rows)


def _readable(result: records.Result, scales: Scales | None) -> dict[str, Any]:
    if isinstance(result, Flow):
        return contract.single_flow_object(result, scales)
    if isinstance(result, FlowSet):
        return contract.flow_set_object(result, scales)
    return contract.curve_object(result, scales)
