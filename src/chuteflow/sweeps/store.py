"""Results of a study as a Zarr directory that is whole at every moment, and that shows its damage.

One chunk of the study is one chunk of every array. Zarr encodes it, with a checksum that its readers verify. It is
written into a folder of its own and renamed into its place, array by array, and a marker is renamed into place last.
The marker has the checksums of all files of the chunk, and one of itself: a chunk is done if it has a marker and all
of them hold. Whatever is killed or damaged at whatever moment leaves chunks that are done and chunks that are
computed again, to the same bits.

    study.zarr/                      zarr.json, and one folder for each array
    study.zarr/.chuteflow/           study.json, folder, columns/NAME.npy, lock, done/NUMBER.json, partial/

Stores of version 0.1.0 have no checksums. Their chunks are done if they can be read, with the parameters of their
points and the counts of their markers.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import secrets
import shutil
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow import __version__
from chuteflow.errors import ChuteflowError, InputError
from chuteflow.extras import require
from chuteflow.parameters import BY_KEY, CONDITIONS
from chuteflow.steady.quantities import NUMBERS
from chuteflow.sweeps.designs import show_path
from chuteflow.sweeps.numbers import KINDS
from chuteflow.sweeps.outcome import PointStatus, Reason, meanings
from chuteflow.sweeps.stability import STABILITY_NUMBERS
from chuteflow.sweeps.study import Column, Study, from_canonical

_OWN, _DONE, _PARTIAL, _COLUMNS = ".chuteflow", "done", "partial", "columns"
#: The file that holds the folder of the study, in which the laws of files are searched for.
_FOLDER = "folder"
_LEVEL = 1
#: The version whose markers name none.
_FIRST_VERSION = "0.1.0"
#: The name of a marker, and how its content begins: with the checksum of all that follows.
_MARKER = re.compile(r"\d{8,}\.json", re.ASCII)
_HEAD = re.compile(rb'\{"crc32": (\d+), ')
#: Attributes that depend on the versions that wrote the store.
_OF_VERSIONS = ("source", "history", "study", "study_digest")
#: What reading an array that is damaged may raise.
_DAMAGE = (ValueError, RuntimeError, LookupError, TypeError, OSError)
_TITLE = "Every steady flow of many inclined chutes"
_PAPER = "Woodhouse, Hogg & Sellar, Rapid granular flows down inclined planar chutes. Part 1, J. Fluid Mech. (2010)"
_LONG_NAMES = {
    **{key: parameter.description for key, parameter in BY_KEY.items()},
    "surface": "surface condition",
    "closure": "constitutive law",
    "base": "condition at the base",
    **{key: f"{condition.description} asked for" for key, condition in CONDITIONS.items()},
}


class StoreError(ChuteflowError):
    """A store that cannot be read or written, or is in use."""


class DamageError(StoreError):
    """A chunk or the study of a store that is damaged; says what of it."""


@dataclass(frozen=True)
class Marker:
    """What is known of a chunk that is done. ``sums`` has the checksum of the file of each array, and ``version`` the
    version of the program that computed the chunk; the first one kept no sums."""

    chunk: int
    points: int
    flows: int
    singly: int
    seconds: float
    failures: dict[int, str]
    version: str = _FIRST_VERSION
    sums: dict[str, int] = field(default_factory=dict)

    @classmethod
    def of(cls, content: bytes, chunk: int) -> Marker:
        """The marker of a file's content.

        Raises:
            DamageError: where that is no marker of this chunk.
        """
        head = _HEAD.match(content)
        try:
            if head is not None and int(head[1]) != zlib.crc32(content[head.end() :]):
                raise DamageError("the checksum of its marker differs")
            given = json.loads(content)
            if head is not None:
                del given["crc32"]
            failures = {int(point): str(why) for point, why in given.pop("failures").items()}
            marker = cls(failures=failures, **given)
            counts = (marker.chunk, marker.points, marker.flows, marker.singly)
            if marker.chunk != chunk or not all(type(count) is int and count >= 0 for count in counts):
                raise DamageError("its marker is that of another chunk, or of another program")
        except (ValueError, RecursionError, LookupError, TypeError, AttributeError):
            raise DamageError("its marker is damaged") from None
        return marker

    @property
    def content(self) -> bytes:
        """The marker as the content of a file."""
        rest = json.dumps(vars(self), allow_nan=False).encode()[1:]
        return b'{"crc32": %d, ' % zlib.crc32(rest) + rest


@dataclass(frozen=True)
class StoreVariable:
    """One array of a store: its type, the value where nothing was computed, whether it has the dimension ``flow``
    besides ``point``, and its attributes."""

    dtype: str
    fill: float
    by_flow: bool
    attributes: dict[str, Any]


def variables(study: Study) -> dict[str, StoreVariable]:
    """All arrays of the store of a study."""
    out: dict[str, StoreVariable] = {}
    for name, axis in study.design.axes.items():
        words = axis.words
        attributes: dict[str, Any] = {"long_name": _LONG_NAMES[name]}
        if words:
            attributes |= {
                "flag_values": list(range(len(words))),
                "flag_meanings": " ".join(word.replace(" ", "_") for word in words),
            }
        else:
            attributes |= {"units": "1"}
        out[name] = StoreVariable("int8" if words else "float64", -1 if words else float("nan"), False, attributes)
    for name, flags, text in (
        ("status", PointStatus, "how the point ended"),
        ("reason", Reason, "why the point has no flow"),
    ):
        values, names = meanings(flags)
        attributes = {"long_name": text, "flag_values": values.tolist(), "flag_meanings": names}
        out[name] = StoreVariable("int8", -1, False, attributes)
    out["n_flows"] = StoreVariable("int32", -1, False, {"long_name": "number of flows found", "units": "1"})
    text = "estimated relative error of Q, h and M, the largest"
    out["error"] = StoreVariable("float64", float("nan"), True, {"long_name": text, "units": "1"})
    for name in study.quantities:
        out[name] = _kind(name) if name in KINDS else _number(name)
    for variable in out.values():
        variable.attributes["coordinates"] = " ".join(study.design.axes)
    return out


def _kind(name: str) -> StoreVariable:
    attributes = {"flag_values": list(range(len(KINDS[name]))), "flag_meanings": " ".join(KINDS[name])}
    return StoreVariable("int8", -1, True, {"long_name": f"{name} of the flow"} | attributes)


def _number(name: str) -> StoreVariable:
    if name in STABILITY_NUMBERS:
        attributes: dict[str, Any] = {
            "long_name": STABILITY_NUMBERS[name],
            "units": "1",
            "ancillary_variables": "stable",
        }
        return StoreVariable("float64", float("nan"), True, attributes)
    quantity = NUMBERS[name]
    attributes = {
        "long_name": quantity.description,
        "units": quantity.unit_without_scales,
        "symbol": quantity.symbol,
        "comment": f"{quantity.equation} of the paper",
        "ancillary_variables": "error status",
    }
    return StoreVariable("float64", float("nan"), True, attributes)


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
            except (OSError, ValueError) as error:
                shutil.rmtree(partial, ignore_errors=True)
                # Another process may have been first.
                if not (target / _OWN).is_dir():
                    why = getattr(error, "strerror", None) or error
                    raise InputError(f"cannot make the store {show_path(path)}: {why}") from None
        try:
            store = cls.opened(target)
            if store.study.digest == study.digest:
                return store
            what = ", ".join(_differences(json.loads(store.study.canonical), json.loads(study.canonical)))
            why = f"the store {path} holds a different study (it differs in {what})"
        except DamageError as error:
            why = str(error)
        if _root(target).get("attributes", {}).get("study_digest") != study.digest:
            raise InputError(f"{why}: take another --out, or remove it")
        # The arrays are those of the study given, so it is what is kept of that which is damaged.
        store = cls(target, study)
        store.write_study()
        return store

    @classmethod
    def opened(cls, path: str | os.PathLike[str]) -> Store:
        """The store at ``path``.

        Raises:
            InputError: where there is none.
            DamageError: where its study cannot be read.
        """
        own = Path(path) / _OWN
        if not own.is_dir():
            raise InputError(f"{show_path(path)} is no store of a study: take a path that does not exist yet")
        try:
            text = (own / "study.json").read_text(encoding="utf-8")
            return cls(Path(path), _study(text, own / _COLUMNS, _folder(own)))
        except (OSError, ValueError) as error:
            # An InputError of the study is a ValueError.
            why = getattr(error, "strerror", None) or error
            raise DamageError(f"the study of the store {path} cannot be read: {why}") from None

    def write_study(self) -> None:
        """Write the study into the store.

        Raises:
            OSError: where that is impossible.
        """
        for name, column in self.study.columns.items():
            content = io.BytesIO()
            np.save(content, column, allow_pickle=False)
            _put(self._own / _COLUMNS / f"{name}.npy", content.getvalue())
        _put(self._own / _FOLDER, str(self.study.folder).encode())
        _put(self._own / "study.json", self.study.canonical.encode())

    # What is done

    def done(self) -> set[int]:
        """Numbers of the chunks that have a marker."""
        try:
            names = os.listdir(self._own / _DONE)
        except OSError:
            return set()
        numbers = (int(name[:-5]) for name in names if _MARKER.fullmatch(name))
        return {number for number in numbers if number < self.study.chunks}

    def is_done(self, chunk: int) -> bool:
        """Whether a chunk is done, and nothing of it is damaged."""
        try:
            self.checked(chunk)
        except DamageError:
            return False
        return True

    def marker(self, chunk: int) -> Marker:
        """What is known of a chunk that is done; its arrays are not looked at.

        Raises:
            DamageError: where it has no marker that can be read.
        """
        try:
            content = _content(f"{self._own}/{_DONE}/{chunk:08d}.json")
        except OSError:
            raise DamageError("it has no marker that can be read") from None
        return Marker.of(content, chunk)

    def checked(self, chunk: int) -> Marker:
        """What is known of a chunk that is done, once all of it has been checked.

        Raises:
            DamageError: where anything of it is damaged or missing.
        """
        marker = self.marker(chunk)
        if not marker.sums:
            self._check_counts(marker)
            return marker
        for name, variable in _variables(self.study).items():
            try:
                content = _content(
                    f"{self.path}/{name}/c/{chunk}/0" if variable.by_flow else f"{self.path}/{name}/c/{chunk}"
                )
            except OSError:
                raise DamageError(f"its part of {name} is missing") from None
            if zlib.crc32(content) != marker.sums.get(name):
                raise DamageError(f"the checksum of its part of {name} differs")
        return marker

    def _check_counts(self, marker: Marker) -> None:
        """Check a chunk without checksums: by its parameters, and the counts of its marker."""
        names = list(_variables(self.study))
        for name in names:
            # Zarr takes a file that is missing for one that is all fill value.
            if not os.path.isfile(f"{self.path}/{self._key(name, marker.chunk)}"):
                raise DamageError(f"its part of {name} is missing")
        first, last = self.study.extent(marker.chunk)
        rows = self.study.design.rows(first, last)
        arrays: dict[str, NDArray[Any]] = {}
        name = "the store"
        try:
            group = self._open(self.path)
            for name in names:
                arrays[name] = np.asarray(group[name][first:last])
        except _DAMAGE:
            raise DamageError(f"its part of {name} cannot be read") from None
        # Processors may differ in the last digit of a logarithm.
        same = all(np.allclose(arrays[name], values, rtol=1e-12, atol=0.0) for name, values in rows.items())
        counts = last - first == marker.points and int(arrays["n_flows"].sum()) == marker.flows
        if not (same and counts and (arrays["status"] != PointStatus.NOT_COMPUTED).all()):
            raise DamageError("its arrays are not those of its marker and of the study")

    def find_damaged_metadata(self) -> list[str]:
        """Names of the arrays whose metadata are missing or damaged; "" for those of the whole store."""
        expected = self._describe_expected(self._versions())
        names = [name for name, content in expected.items() if _essence(_json(self.path / name)) != _essence(content)]
        return sorted(name.removesuffix("zarr.json").rstrip("/") for name in names)

    # Writing

    def mend(self, *versions: str) -> None:
        """Mend what is damaged of the metadata, and add ``versions`` to those that computed into the store.

        Raises:
            OSError: where that is impossible.
        """
        expected = self._describe_expected(dict.fromkeys((*self._versions(), *versions)))
        for name, content in expected.items():
            if _json(self.path / name) != json.loads(content):
                _put(self.path / name, content)

    def put(self, chunk: int, arrays: Mapping[str, NDArray[Any]], marker: Marker) -> Marker:
        """Write a chunk, all or nothing, and return its marker with version and checksums.

        Raises:
            OSError: where it cannot be written; nothing of it counts then.
        """
        partial = self._own / _PARTIAL / f"{chunk}-{secrets.token_hex(6)}"
        _make_folder(partial)
        try:
            contents = self._encode(chunk, arrays)
            marker = replace(marker, version=__version__, sums={n: zlib.crc32(c) for n, c in contents.items()})
            for name, content in contents.items():
                _write(partial / name, content)
            _write(partial / "marker", marker.content)
            # The status last: where that of a chunk is there, so is the rest.
            for name in sorted(contents, key=lambda name: name == "status"):
                _place(partial / name, self.path / self._key(name, chunk))
            _place(partial / "marker", self._own / _DONE / f"{chunk:08d}.json")
        finally:
            shutil.rmtree(partial, ignore_errors=True)
        return marker

    def _encode(self, chunk: int, arrays: Mapping[str, NDArray[Any]]) -> dict[str, bytes]:
        """The files of a chunk, as Zarr writes them."""
        _require_zarr()
        from zarr.storage import MemoryStore

        first, last = self.study.extent(chunk)
        # Into memory, so that a chunk gets to the disk whole or not at all.
        memory = _buffers(_lay_out_metadata(self.study, checksums=self._has_checksums(), versions=()))
        group = self._open(MemoryStore(memory))
        out = {}
        for name in _variables(self.study):
            # What is all fill value is written too: a file that is missing is damage.
            group[name].with_config({"write_empty_chunks": True})[first:last] = arrays[name]
            out[name] = memory[self._key(name, chunk)].to_bytes()
        return out

    @staticmethod
    def _open(place: Any) -> Any:
        _require_zarr()
        import zarr

        return zarr.open_group(place, mode="r" if isinstance(place, Path) else "r+", use_consolidated=False)

    # Metadata

    def _key(self, name: str, chunk: int) -> str:
        """The file of a chunk of an array."""
        return f"{name}/c/{chunk}/0" if _variables(self.study)[name].by_flow else f"{name}/c/{chunk}"

    def _has_checksums(self) -> bool:
        """Whether arrays are to have checksums in their files: but in a store of the first version."""
        for name in _variables(self.study):
            given = _json(self.path / name / "zarr.json")
            if given.get("codecs"):
                return any(codec.get("name") == "crc32c" for codec in given["codecs"])
        return True

    def _versions(self) -> tuple[str, ...]:
        """The versions that computed into the store, in their order."""
        text = _root(self.path).get("attributes", {}).get("source")
        found = re.findall(r"chuteflow (\S+?)(?:,|$)", text) if isinstance(text, str) else []
        return tuple(found) or tuple(dict.fromkeys(self._versions_of_chunks()))

    def _versions_of_chunks(self) -> Iterator[str]:
        for chunk in sorted(self.done()):
            with suppress(DamageError):
                yield self.marker(chunk).version

    def _describe_expected(self, versions: Iterable[str]) -> dict[str, bytes]:
        return _lay_out_metadata(self.study, checksums=self._has_checksums(), versions=tuple(versions))

    # Clients

    @contextmanager
    def held(self, *, alone: bool) -> Iterator[None]:
        """The store, held by this process: alone, or with others that compute certain chunks only.

        The lock is the system's, and ends with the process, however that ends.

        Raises:
            StoreError: where another process holds it.
        """
        with self._lock(alone=alone):
            if alone:
                with suppress(OSError):
                    shutil.rmtree(self._own / _PARTIAL)
            yield

    def _lock(self, *, alone: bool) -> Any:
        import sqlite3

        from filelock import ReadWriteLock, Timeout

        try:
            lock = ReadWriteLock(self._own / "lock", blocking=False, is_singleton=False)
            return lock.acquire_write() if alone else lock.acquire_read()
        except Timeout:
            raise StoreError(
                f"another process computes into {self.path}: wait for it, or compute certain chunks with --chunks "
                "in all of them"
            ) from None
        except (sqlite3.Error, OSError, ValueError):
            # A file system without locks, or a file of another program: markers still keep every chunk whole.
            return nullcontext()

    @property
    def _own(self) -> Path:
        return self.path / _OWN


@lru_cache(maxsize=4)
def _study(text: str, columns: Path, folder: Path) -> Study:
    def column(name: str) -> Column:
        return np.load(columns / f"{name}.npy", allow_pickle=False)

    return from_canonical(text, column, folder)


def _folder(own: Path) -> Path:
    """The folder of the study; stores of earlier versions do not tell, and need none."""
    try:
        return Path((own / _FOLDER).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return Path()


@lru_cache(maxsize=4)
def _variables(study: Study) -> dict[str, StoreVariable]:
    return variables(study)


# Files


def _content(path: str) -> bytes:
    with open(path, "rb", buffering=0) as file:
        return file.readall()


def _write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _put(path: Path, content: bytes) -> None:
    """Write a file, all or nothing."""
    partial = path.with_name(f".{path.name}-{secrets.token_hex(6)}")
    _make_folder(path.parent)
    try:
        _write(partial, content)
        _place(partial, path)
    finally:
        with suppress(OSError):
            partial.unlink()


def _place(partial: Path, path: Path) -> None:
    """Rename a file into its place, whatever has got there."""
    _make_folder(path.parent)
    if path.is_dir():
        shutil.rmtree(path)
    os.replace(partial, path)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        # A file stands where the store has a folder.
        for place in (path, *path.parents):
            if place.is_file():
                place.unlink()
                break
        path.mkdir(parents=True, exist_ok=True)


def _json(path: Path) -> dict[str, Any]:
    """The object in a file; an empty one where there is none."""
    try:
        given = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return given if isinstance(given, dict) else {}


def _essence(metadata: bytes | dict[str, Any]) -> dict[str, Any]:
    """Metadata but for what may differ between versions of the program: names of them, and the form of the study."""
    given = dict(json.loads(metadata) if isinstance(metadata, bytes) else metadata)
    attributes = given.get("attributes")
    if isinstance(attributes, dict) and "study" in attributes:
        study, digest = str(attributes["study"]), attributes.get("study_digest")
        rest = {name: value for name, value in attributes.items() if name not in _OF_VERSIONS}
        given["attributes"] = rest | {"sound": hashlib.sha256(study.encode()).hexdigest() == digest}
    return given


def _root(path: Path) -> dict[str, Any]:
    given = _json(path / "zarr.json")
    return given if isinstance(given.get("attributes", {}), dict) else {}


def _differences(one: Any, other: Any, where: str = "") -> Iterator[str]:
    """Keys in which two tables differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        if list(one) != list(other) and set(one) == set(other):
            yield f"the order of {where or 'keys'}"
        for key in dict.fromkeys((*one, *other)):
            yield from _differences(one.get(key), other.get(key), f"{where}.{key}" if where else key)
    elif one != other:
        yield where


# Metadata


def _lay_out(path: Path, study: Study) -> None:
    """Make the folders and the metadata of a store without a chunk."""
    (path / _OWN / _DONE).mkdir(parents=True)
    Store(path, study).write_study()
    for name, content in _lay_out_metadata(study, checksums=True, versions=(__version__,)).items():
        _put(path / name, content)


def _require_zarr() -> None:
    require("zarr", "sweep", "a sweep")


@lru_cache(maxsize=4)
def _lay_out_metadata(study: Study, *, checksums: bool, versions: tuple[str, ...]) -> dict[str, bytes]:
    """The metadata of a store by their place in it, as Zarr writes them."""
    _require_zarr()
    import zarr
    from zarr.codecs import BytesCodec, Crc32cCodec, ZstdCodec
    from zarr.storage import MemoryStore

    memory: dict[str, Any] = {}
    store = MemoryStore(memory)
    codecs = [ZstdCodec(level=_LEVEL, checksum=False), *([Crc32cCodec()] if checksums else [])]
    group = zarr.create_group(store, attributes=_attributes(study, versions))
    for name, variable in variables(study).items():
        flows = (study.flows,) if variable.by_flow else ()
        group.create_array(
            name,
            shape=(study.points, *flows),
            chunks=(study.chunk, *flows),
            dtype=variable.dtype,
            fill_value=variable.fill,
            serializer=BytesCodec(endian=None if variable.dtype == "int8" else "little"),
            compressors=codecs,
            dimension_names=["point", "flow"] if variable.by_flow else ["point"],
            attributes=variable.attributes,
        )
    # An empty group, so that readers that list the folder know what it is.
    zarr.create_group(store, path=_OWN)
    contents = {name: content.to_bytes() for name, content in memory.items()}
    # Readers that know consolidated metadata need not list the folder. Zarr writes them with a warning that they are
    # not in the standard, which cannot be held back where several threads compute.
    arrays = {name: json.loads(contents[f"{name}/zarr.json"]) for name in variables(study)}
    consolidated = {"kind": "inline", "must_understand": False, "metadata": arrays}
    root = json.loads(contents["zarr.json"]) | {"consolidated_metadata": consolidated}
    return contents | {"zarr.json": json.dumps(root).encode()}


def _buffers(contents: Mapping[str, bytes]) -> dict[str, Any]:
    from zarr.core.buffer import default_buffer_prototype

    return {name: default_buffer_prototype().buffer.from_bytes(content) for name, content in contents.items()}


def _attributes(study: Study, versions: tuple[str, ...]) -> dict[str, Any]:
    programs = ", ".join(f"chuteflow {version}" for version in versions)
    return {
        "Conventions": "CF-1.11",
        "title": study.title or _TITLE,
        "source": programs,
        "history": f"written by {programs}",
        "references": _PAPER,
        "comment": "dimensionless: lengths in grain diameters d, velocities in sqrt(g d cos theta), granular "
        "temperature in g d cos theta, densities in that of a grain; n_flows flows of each point, from hot to cold",
        "study": study.canonical,
        "study_digest": study.digest,
    }
