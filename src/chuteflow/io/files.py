"""Results to files and back: NetCDF, CSV or JSON, by the ending of the name."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from chuteflow.errors import InputError
from chuteflow.io import contract
from chuteflow.io.reading import loading
from chuteflow.io.records import KIND_OF, Result
from chuteflow.io.writing import as_text, require_suffix, write_file
from chuteflow.steady.quantities import Scales

if TYPE_CHECKING:
    from chuteflow.bifurcations.boundary import BoundarySet
    from chuteflow.maps import Domain

#: The module of each format, imported when it is needed; each has write(result, stream, scales) and read(path).
FORMATS = {".nc": "netcdf_file", ".csv": "csv_file", ".json": "json_file"}
#: Other results that can be saved: their classes, the modules of these, and the modules with their writers by ending.
_OTHERS = (("Domain", "maps", "domain_records"), ("BoundarySet", "bifurcations.boundary", "boundary_records"))


def save(result: Result | Domain | BoundarySet, path: str | os.PathLike[str], *, scales: Scales | None = None) -> None:
    """Write a result to ``path``: .nc (NetCDF 4, CF conventions), .csv or .json.

    Results are a flow, a set of flows, a curve, a domain or boundaries; :func:`load` reads all but the last.

    The file holds every number of the registry; .nc and, but for curves, .csv also the profiles of all fields
    up to the depth. Numbers are dimensionless, or in SI units where ``scales`` are given. :func:`load` gives
    the result back to the last bit in either case. The file is whole or absent.

    Raises:
        InputError: for a result or an ending that is not known, or a file that cannot be written.
    """

    def write(suffix: str, stream: BinaryIO) -> None:
        _writer(result, suffix)(result, stream, scales)

    write_file(path, {suffix: partial(write, suffix) for suffix in FORMATS})


def _writer(result: Any, suffix: str) -> Callable[[Any, BinaryIO, Scales | None], None]:
    """What writes a result of this kind to a stream, in the format of ``suffix``.

    Raises:
        InputError: for what cannot be saved.
    """
    if type(result) in KIND_OF:
        return import_module(f"chuteflow.io.{FORMATS[suffix]}").write
    for kind, home, module in _OTHERS:
        if isinstance(result, getattr(import_module(f"chuteflow.{home}"), kind)):
            return import_module(f"chuteflow.io.{module}").WRITERS[suffix]
    raise InputError(
        f"cannot save a {type(result).__name__}: save a flow, a set of flows, a curve, a domain or boundaries"
    )


def write_answer(
    path: str | os.PathLike[str], content: Callable[[], Any], rows: Callable[[], Iterable[Sequence[Any]]]
) -> None:
    """Write the object ``content`` to a JSON file, or ``rows`` to a CSV file, as the ending of ``path`` says.

    Raises:
        InputError: for another ending, or a file that cannot be written.
    """

    def write_json(stream: BinaryIO) -> None:
        stream.write(contract.text(content()).encode() + b"\n")

    def write_csv(stream: BinaryIO) -> None:
        from chuteflow.io.csv_file import write_rows

        with as_text(stream) as file:
            write_rows(file, rows())

    write_file(path, {".json": write_json, ".csv": write_csv})


def load(path: str | os.PathLike[str]) -> Result | Domain:
    """The flow, set of flows, curve or domain that :func:`save` wrote to ``path``; its numbers are dimensionless.

    Raises:
        InputError: for a file that is missing, damaged, of another program or of a later version.
    """
    from chuteflow.io import domain_records

    reader = import_module(f"chuteflow.io.{FORMATS[require_suffix(path, tuple(FORMATS))]}")
    with loading(path, "was not written by chuteflow"):
        found = domain_records.read(Path(path))
        return reader.read(Path(path)) if found is None else found
