"""Results of a study as a Zarr directory that is whole at every moment.

One chunk of the study is one chunk of every array. It is written into a folder of its own and renamed into its
place, array by array, and a marker is renamed into place last: a chunk is done if its marker is there. Whatever
is killed at whatever moment leaves chunks that are done and chunks that are computed again, to the same bits.

    study.zarr/                      zarr.json, and one folder for each array
    study.zarr/.chuteflow/           study.json, lock, done/NUMBER.json, partial/
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow import __version__
from chuteflow.errors import ChuteflowError, InputError
from chuteflow.steady.quantities import NUMBERS
from chuteflow.sweeps.judged import JUDGED_NUMBERS
from chuteflow.sweeps.numbers import KINDS
from chuteflow.sweeps.outcome import Reason, Status, meanings
from chuteflow.sweeps.study import WORDS, Study, from_canonical

_OWN, _DONE, _PARTIAL = ".chuteflow", "done", "partial"
_LEVEL = 1
_TITLE = "Every steady flow of many inclined chutes"
_PAPER = "Woodhouse, Hogg & Sellar, Rapid granular flows down inclined planar chutes. Part 1, J. Fluid Mech. (2010)"
_LONG_NAMES = {
    "slope": "slope tan(theta) of the chute",
    "e": "restitution of two grains",
    "ew": "restitution of a grain and the base",
    "roughness": "roughness r of the base",
    "surface": "surface condition",
    "closure": "constitutive law",
    "T_surface": "surface temperature asked for",
    "Q": "mass flux asked for",
    "M": "mass hold-up asked for",
    "h": "centre of mass asked for",
}


class StoreError(ChuteflowError):
    """A store that cannot be read or written, or is in use."""


@dataclass(frozen=True)
class Marker:
    """What is known of a chunk that is done."""

    chunk: int
    points: int
    flows: int
    singly: int
    seconds: float
    failures: dict[int, str]


@dataclass(frozen=True)
class Variable:
    """One array of a store: its type, the value where nothing was computed, whether it has the dimension ``flow``
    besides ``point``, and its attributes."""

    dtype: str
    fill: float
    by_flow: bool
    attributes: dict[str, Any]


def variables(study: Study) -> dict[str, Variable]:
    """All arrays of the store of a study."""
    out: dict[str, Variable] = {}
    for name in study.design.axes:
        words = WORDS[name][0] if name in WORDS else ()
        attributes: dict[str, Any] = {"long_name": _LONG_NAMES[name]}
        if words:
            attributes |= {"flag_values": list(range(len(words))), "flag_meanings": " ".join(words)}
        else:
            attributes |= {"units": "1"}
        out[name] = Variable("int8" if words else "float64", -1 if words else float("nan"), False, attributes)
    for name, flags, text in (
        ("status", Status, "how the point ended"),
        ("reason", Reason, "why the point has no flow"),
    ):
        values, names = meanings(flags)
        attributes = {"long_name": text, "flag_values": values.tolist(), "flag_meanings": names}
        out[name] = Variable("int8", -1, False, attributes)
    out["n_flows"] = Variable("int32", -1, False, {"long_name": "number of flows found", "units": "1"})
    text = "estimated relative error of Q, h and M, the largest"
    out["error"] = Variable("float64", float("nan"), True, {"long_name": text, "units": "1"})
    for name in study.quantities:
        out[name] = _kind(name) if name in KINDS else _number(name)
    for variable in out.values():
        variable.attributes["coordinates"] = " ".join(study.design.axes)
    return out


def _kind(name: str) -> Variable:
    attributes = {"flag_values": list(range(len(KINDS[name]))), "flag_meanings": " ".join(KINDS[name])}
    return Variable("int8", -1, True, {"long_name": f"{name} of the flow"} | attributes)


def _number(name: str) -> Variable:
    if name in JUDGED_NUMBERS:
        attributes: dict[str, Any] = {"long_name": JUDGED_NUMBERS[name], "units": "1", "ancillary_variables": "stable"}
        return Variable("float64", float("nan"), True, attributes)
    quantity = NUMBERS[name]
    attributes = {
        "long_name": quantity.description,
        "units": "1",
        "symbol": quantity.symbol,
        "comment": f"{quantity.equation} of the paper",
        "ancillary_variables": "error status",
    }
    return Variable("float64", float("nan"), True, attributes)


@dataclass(frozen=True)
class Store:
    """The store of a study at ``path``."""

    path: Path
    study: Study

    # Opening

    @classmethod
    def made(cls, path: str | os.PathLike[str], study: Study) -> Store:
        """The store at ``path``, made if there is none.

        Raises:
            InputError: where something else is there, or the store of a different study.
        """
        target = Path(path)
        if not target.exists():
            partial = target.with_name(f".{target.name}-{secrets.token_hex(6)}")
            try:
                _lay_out(partial, study)
                os.rename(partial, target)
            except OSError as error:
                shutil.rmtree(partial, ignore_errors=True)
                # Another process may have been first.
                if not (target / _OWN).is_dir():
                    raise InputError(f"cannot make the store {path}: {error.strerror or error}") from None
        store = cls.opened(target)
        if store.study.digest != study.digest:
            what = ", ".join(_differences(json.loads(store.study.canonical), json.loads(study.canonical)))
            raise InputError(
                f"the store {path} holds a different study (it differs in {what}): take another --out, or remove it"
            )
        return store

    @classmethod
    def opened(cls, path: str | os.PathLike[str]) -> Store:
        """The store at ``path``.

        Raises:
            InputError: where there is none.
        """
        own = Path(path) / _OWN
        try:
            text = (own / "study.json").read_text(encoding="utf-8")
        except OSError:
            raise InputError(f"{path} is no store of a study: take a path that does not exist yet") from None
        return cls(Path(path), _study(text))

    # What is done

    def done(self) -> set[int]:
        """Numbers of the chunks that are done."""
        return {int(name[:-5]) for name in os.listdir(self._own / _DONE) if name.endswith(".json")}

    def is_done(self, chunk: int) -> bool:
        """Whether a chunk is done."""
        return self._marker(chunk).exists()

    def marker(self, chunk: int) -> Marker:
        """What is known of a chunk that is done."""
        given = json.loads(self._marker(chunk).read_text(encoding="utf-8"))
        failures = {int(point): why for point, why in given.pop("failures").items()}
        return Marker(failures=failures, **given)

    # Writing

    def put(self, chunk: int, arrays: Mapping[str, NDArray[Any]], marker: Marker) -> None:
        """Write a chunk, all or nothing.

        Raises:
            OSError: where it cannot be written; nothing of it counts then.
        """
        partial = self._own / _PARTIAL / f"{chunk}-{secrets.token_hex(6)}"
        partial.mkdir(parents=True)
        try:
            for name, variable in variables(self.study).items():
                _write(partial / name, self._encoded(variable, arrays[name]))
            text = json.dumps(vars(marker), allow_nan=False)
            _write(partial / "marker", text.encode())
            # The status last: where that of a chunk is there, so is the rest.
            for name, variable in sorted(variables(self.study).items(), key=lambda item: item[0] == "status"):
                place = self.path / name / "c" / str(chunk)
                if variable.by_flow:
                    place.mkdir(parents=True, exist_ok=True)
                    place = place / "0"
                else:
                    place.parent.mkdir(exist_ok=True)
                os.replace(partial / name, place)
            os.replace(partial / "marker", self._marker(chunk))
        finally:
            shutil.rmtree(partial, ignore_errors=True)

    def _encoded(self, variable: Variable, values: NDArray[Any]) -> bytes:
        """A chunk as Zarr has it: in full size, little endian, compressed by Zstandard."""
        from numcodecs.zstd import Zstd

        shape = (self.study.chunk, self.study.flows) if variable.by_flow else (self.study.chunk,)
        whole = np.full(shape, variable.fill, dtype=np.dtype(variable.dtype).newbyteorder("<"))
        whole[: len(values)] = values
        return bytes(Zstd(level=_LEVEL).encode(whole.tobytes()))

    # Clients

    @contextmanager
    def held(self, *, alone: bool) -> Iterator[None]:
        """The store, held by this process: alone, or with others that compute certain chunks only.

        The lock is the system's, and ends with the process, however that ends.

        Raises:
            StoreError: where another process holds it.
        """
        import fcntl

        with (self._own / "lock").open("a") as file:
            try:
                fcntl.flock(file, (fcntl.LOCK_EX if alone else fcntl.LOCK_SH) | fcntl.LOCK_NB)
            except BlockingIOError:
                raise StoreError(
                    f"another process computes into {self.path}: wait for it, or compute certain chunks with --chunks "
                    "in all of them"
                ) from None
            except OSError:
                # A file system without locks: markers still keep every chunk whole.
                pass
            if alone:
                with suppress(OSError):
                    shutil.rmtree(self._own / _PARTIAL)
            yield

    @property
    def _own(self) -> Path:
        return self.path / _OWN

    def _marker(self, chunk: int) -> Path:
        return self._own / _DONE / f"{chunk:08d}.json"


@lru_cache(maxsize=4)
def _study(text: str) -> Study:
    return from_canonical(text)


def _write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _differences(one: Any, other: Any, where: str = "") -> Iterator[str]:
    """Keys in which two tables differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        if list(one) != list(other) and set(one) == set(other):
            yield f"the order of {where or 'keys'}"
        for key in one.keys() | other.keys():
            yield from _differences(one.get(key), other.get(key), f"{where}.{key}" if where else key)
    elif one != other:
        yield where


def _lay_out(path: Path, study: Study) -> None:
    """Make the folders and the metadata of a store without a chunk."""
    (path / _OWN / _DONE).mkdir(parents=True)
    (path / _OWN / "study.json").write_text(study.canonical, encoding="utf-8")
    # An empty group, so that readers that list the folder know what it is.
    _write_json(path / _OWN / "zarr.json", {"zarr_format": 3, "node_type": "group", "attributes": {}})
    metadata: dict[str, Any] = {}
    for name, variable in variables(study).items():
        (path / name).mkdir()
        metadata[name] = _array_metadata(study, variable)
        _write_json(path / name / "zarr.json", metadata[name])
    group = {
        "zarr_format": 3,
        "node_type": "group",
        "attributes": _attributes(study),
        # With which readers need not list the folder.
        "consolidated_metadata": {"kind": "inline", "must_understand": False, "metadata": metadata},
    }
    _write_json(path / "zarr.json", group)


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content), encoding="utf-8")


def _attributes(study: Study) -> dict[str, Any]:
    return {
        "Conventions": "CF-1.11",
        "title": study.title or _TITLE,
        "source": f"chuteflow {__version__}",
        "history": f"written by chuteflow {__version__}",
        "references": _PAPER,
        "comment": "dimensionless: lengths in grain diameters d, velocities in sqrt(g d cos theta), granular "
        "temperature in g d cos theta, densities in that of a grain; n_flows flows of each point, from hot to cold",
        "study": study.canonical,
        "study_digest": study.digest,
    }


def _array_metadata(study: Study, variable: Variable) -> dict[str, Any]:
    shape, chunk = [study.points], [study.chunk]
    if variable.by_flow:
        shape, chunk = [*shape, study.flows], [*chunk, study.flows]
    little = {} if variable.dtype == "int8" else {"configuration": {"endian": "little"}}
    return {
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": variable.dtype,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": "NaN" if variable.fill != variable.fill else variable.fill,
        "codecs": [
            {"name": "bytes", **little},
            {"name": "zstd", "configuration": {"level": _LEVEL, "checksum": False}},
        ],
        "attributes": variable.attributes,
        "dimension_names": ["point", "flow"] if variable.by_flow else ["point"],
        "storage_transformers": [],
    }
