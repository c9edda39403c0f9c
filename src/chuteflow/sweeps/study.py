"""A study as a TOML file: what is varied, how, what is kept, and in which pieces; read and checked once."""

from __future__ import annotations

import hashlib
import json
import math
import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.branches.ranges import SearchRange
from chuteflow.checks import shorten
from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY, CONDITIONS, DEEPEST, LARGEST_HOLDUP, SHALLOWEST, SURFACE_TEMPERATURE
from chuteflow.steady.chute import SURFACES
from chuteflow.steady.quantities import NUMBERS
from chuteflow.sweeps.designs import (
    DESIGNS,
    MOST_POINTS,
    DesignAxis,
    StudyDesign,
    axis_from,
    list_design,
    show_key,
    show_path,
)
from chuteflow.sweeps.stability import STABILITY_CHUNK, STABILITY_KINDS, STABILITY_NUMBERS, needs_stability
from chuteflow.theory.bases import BASES, BaseCondition, base
from chuteflow.theory.constitutive import Law, digest
from chuteflow.theory.laws import in_folder, law

#: A list of numbers or words.
Column = NDArray[Any]

#: Least and largest values of the numbers of a study: of a chute, and conditions.
RANGES = {key: (parameter.low, parameter.highest) for key, parameter in BY_KEY.items()} | {
    key: (condition.low, condition.high) for key, condition in CONDITIONS.items()
}
#: Names, and what they are where a study does not give them. Other closures of a study are numbered after these.
WORDS = {"surface": (SURFACES, "free"), "closure": (("lun", "lun-fourier"), "lun"), "base": (("richman",), "richman")}
#: Those that a study without them does not have at all, as those of earlier versions.
_OPTIONAL = ("base",)
#: Restitution and slope at which values of a law are taken, by which it is known again.
_KNOWN_BY = (0.9, 0.3)
#: Kinds of a flow that can be kept beside the numbers of the registry.
KINDS = ("interior", "density", *STABILITY_KINDS)
DEFAULT_QUANTITIES = ("mass_flux", "centre_of_mass", "mass_holdup", "surface_temperature")
#: Points of a chunk: at a given surface temperature, and otherwise, when more has to be done for each.
CHUNKS = {"T_surface": 32768}
CHUNK = 8192
TOLERANCE = 1e-8
_MOST_CHUNK, _MOST_FLOWS = 1 << 20, 64
#: Bytes of a study's file at most.
_MOST_BYTES = 1 << 28
#: A longer list of values is known in the canonical form by its length and checksum.
_LONG = 64


@dataclass(frozen=True)
class Study:
    """A study of very many chutes.

    ``design`` gives the parameters of each point; ``condition`` is the name of the one of them that is a condition on
    the flow ("T_surface", "Q", "M" or "h"). ``quantities`` are kept of each of at most ``flows`` flows of a point.
    Flows are sought at surface temperatures in ``surface_temperature`` and hold-ups up to ``largest_holdup``,
    each to a relative error of ``tolerance`` in Q, h and M. Points are treated in pieces of ``chunk``.
    """

    title: str
    design: StudyDesign
    condition: str
    quantities: tuple[str, ...] = DEFAULT_QUANTITIES
    flows: int = 8
    tolerance: float = TOLERANCE
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE
    largest_holdup: float = LARGEST_HOLDUP
    chunk: int = CHUNK
    canonical: str = field(default="", compare=False)
    #: Lists of values that are too long for the canonical form, by the name of their parameter.
    columns: Mapping[str, Column] = field(default_factory=dict, compare=False, repr=False)
    #: The laws and the bases in the order of their numbers, and the folder to which those of files are relative.
    laws: tuple[Law, ...] = field(default=(), compare=False, repr=False)
    bases: tuple[BaseCondition, ...] = field(default=(BASES["richman"],), compare=False, repr=False)
    folder: Path = field(default_factory=Path, compare=False, repr=False)

    @property
    def points(self) -> int:
        """How many points there are."""
        return self.design.points

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return -(-self.points // self.chunk)

    def extent(self, chunk: int) -> tuple[int, int]:
        """First point of a chunk, and the one after its last."""
        return chunk * self.chunk, min((chunk + 1) * self.chunk, self.points)

    @property
    def digest(self) -> str:
        """What tells this study from every other, whatever its file looks like."""
        return hashlib.sha256(self.canonical.encode()).hexdigest()


def read(path: str | os.PathLike[str]) -> Study:
    """The study in the TOML file ``path``.

    Raises:
        InputError: naming the key that is missing, unknown or out of range.
    """
    source = Path(path)
    try:
        with source.open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
        # Some editors put a byte-order mark before the text.
        text = content.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(f"cannot read the study {show_path(path)}: {why}") from None
    if len(content) > _MOST_BYTES:
        raise InputError(f"the study {path} has more than {_MOST_BYTES} bytes: give long lists as design.file")
    try:
        given = tomllib.loads(text)
    except RecursionError:
        raise InputError(f"the study {path} is not a study: its brackets are nested too deep") from None
    except ValueError as error:
        raise InputError(f"the study {path} is not TOML: {error}") from None
    return from_dict(given, source.parent)


def from_canonical(text: str, column: Callable[[str], Column] | None = None, folder: Path = Path()) -> Study:
    """The study of a canonical form, with ``column``, which gives the list of a parameter that is too long for it; laws
    of files are searched for from ``folder``.

    Raises:
        InputError: for what is no canonical form, or a column that is not the one meant.
    """
    try:
        given = json.loads(text)
    except (ValueError, RecursionError):
        raise InputError("the study is damaged: it is not JSON") from None
    if not isinstance(given, dict):
        raise InputError(f"the study is damaged: it is {shorten(given)}")
    parameters = dict(_table(given, "parameters"))
    for name, value in parameters.items():
        if column is not None and isinstance(value, Mapping) and "sha256" in value:
            parameters[name] = column(name)
            if _outline(parameters[name]) != value:
                raise InputError(f"the list of parameters.{name} is damaged")
    closures = given.pop("closures", {})
    study = from_dict(given | {"parameters": parameters}, folder)
    known = _closures(study)
    for name, kept in closures.items() if isinstance(closures, dict) else ():
        if known.get(name) != kept:
            raise InputError(f"the closure {name!r} is another now than that of the study: it gives other numbers")
    return study


def from_dict(given: Mapping[str, Any], folder: Path) -> Study:
    """The study of a table, with files relative to ``folder``.

    Raises:
        InputError: naming the key that is missing, unknown or out of range.
    """
    _only(given, "", ("title", "design", "parameters", "search", "results"))
    head, search, results = (_table(given, name) for name in ("design", "search", "results"))
    kind = head.get("kind", "product")
    if kind not in (*DESIGNS, "list"):
        raise InputError(f"design.kind = {shorten(kind)}: choose one of {', '.join((*DESIGNS, 'list'))}")
    parameters = _table(given, "parameters")
    if kind == "list":
        _only(head, "design.", ("kind", "file"))
        columns = list_design(head, parameters, folder, WORDS)
        parameters = columns.table
        axes = columns.axes
    else:
        _only(head, "design.", ("kind", *DESIGNS[kind].settings))
        axes = {name: axis_from(name, value, WORDS) for name, value in parameters.items()}
    condition = _check_names(axes)
    for name, (_, default) in WORDS.items():
        if name not in axes and name not in _OPTIONAL:
            axes[name] = axis_from(name, default, WORDS)
    if kind != "list":
        for axis in axes.values():
            _check_range(axis)
    design = DESIGNS[kind].make(head, axes) if kind != "list" else StudyDesign.listed(axes)
    if not 1 <= design.points <= MOST_POINTS:
        raise InputError(f"the design has {design.points} points: must be from 1 to {MOST_POINTS}")
    _only(search, "search.", ("tolerance", "surface_temperature", "largest_holdup"))
    _only(results, "results.", ("quantities", "flows", "chunk"))
    tolerance = _number(search, "search.tolerance", TOLERANCE, 1e-10, 1e-3)
    deepest = _number(search, "search.largest_holdup", LARGEST_HOLDUP, SHALLOWEST, DEEPEST)
    warm = _interval(search.get("surface_temperature", SURFACE_TEMPERATURE))
    SearchRange.checked(warm, deepest)
    quantities = _quantities(results.get("quantities", list(DEFAULT_QUANTITIES)))
    chunk = STABILITY_CHUNK if needs_stability(quantities) else CHUNKS.get(condition, CHUNK)
    study = Study(
        title=_title(given),
        design=design,
        condition=condition,
        quantities=quantities,
        flows=int(_number(results, "results.flows", 8, 1, _MOST_FLOWS, whole=True)),
        tolerance=tolerance,
        surface_temperature=warm,
        largest_holdup=deepest,
        chunk=int(_number(results, "results.chunk", chunk, 1, _MOST_CHUNK, whole=True)),
    )
    columns = {name: _column(name, value) for name, value in parameters.items() if _is_long(value)}
    object.__setattr__(study, "columns", columns)
    object.__setattr__(study, "folder", folder.absolute())
    if "base" in axes:
        object.__setattr__(study, "bases", tuple(_base(name) for name in axes["base"].words))
    object.__setattr__(study, "laws", tuple(_law(name, folder) for name in axes["closure"].words))
    object.__setattr__(study, "canonical", _canonical(study, kind, head, {**parameters, **columns}))
    return study


def _canonical(study: Study, kind: str, head: Mapping[str, Any], parameters: Mapping[str, Any]) -> str:
    """The study as JSON with every default written out: the same for all files that mean the same."""
    settings = {name: head[name] for name in head if name not in ("kind", "file")}
    whole = {
        "title": study.title,
        "design": {"kind": kind, **settings},
        # In their order, in which the points are counted.
        "parameters": {n: _plain(v) for n, v in parameters.items()}
        | {n: d for n, (_, d) in WORDS.items() if n not in (*parameters, *_OPTIONAL)},
        "search": {
            "tolerance": study.tolerance,
            "surface_temperature": list(study.surface_temperature),
            "largest_holdup": study.largest_holdup,
        },
        "results": {"quantities": list(study.quantities), "flows": study.flows, "chunk": study.chunk},
    }
    closures = _closures(study)
    if closures:
        whole["closures"] = closures
    return json.dumps(whole, allow_nan=False, separators=(",", ":"))


def _law(name: str, folder: Path) -> Law:
    try:
        return law(in_folder(name, folder))
    except InputError as error:
        raise InputError(f"parameters.closure: {error}") from None


def _base(name: str) -> BaseCondition:
    try:
        return base(name)
    except InputError as error:
        raise InputError(f"parameters.base: {error}") from None


def _closures(study: Study) -> dict[str, Any]:
    """What the canonical form has of the laws that are not the paper's: parameters, and what tells their values."""
    names = study.design.axes["closure"].words
    return {
        name: {
            "law": chosen.name,
            "source": chosen.source,
            "parameters": chosen.parameters,
            "digest": digest(chosen, *_KNOWN_BY),
        }
        for name, chosen in zip(names, study.laws, strict=True)
        if name not in WORDS["closure"][0]
    }


def _is_long(value: Any) -> bool:
    return isinstance(value, list | np.ndarray) and len(value) > _LONG


def _column(name: str, values: Any) -> Column:
    """A list of values of a parameter as an array of numbers or words."""
    return np.array(values, dtype=str if name in WORDS else float)


def _outline(column: Column) -> dict[str, Any]:
    """What the canonical form has of a long list."""
    numbers = column.dtype.kind == "f"
    content = column.astype("<f8").tobytes() if numbers else "\n".join(column.tolist()).encode()
    return {"sha256": hashlib.sha256(content).hexdigest(), "values": len(column)}


def _title(given: Mapping[str, Any]) -> str:
    try:
        return str(given.get("title", ""))
    except (ValueError, RecursionError):
        raise InputError(f"title = {shorten(given['title'])}: must be a text") from None


def _plain(value: Any) -> Any:
    """A value of the table with numbers as floats, long lists in outline, and the keys of a range in order."""
    if isinstance(value, np.ndarray):
        return _outline(value) if len(value) > _LONG else value.tolist()
    if isinstance(value, Mapping):
        plain = {"scale": "linear"} | {k: v if k in ("points", "scale") else float(v) for k, v in value.items()}
        return dict(sorted(plain.items()))
    if isinstance(value, list):
        return [_plain(v) for v in value]
    return value if isinstance(value, str) else float(value)


def _check_names(axes: Mapping[str, DesignAxis]) -> str:
    """The condition among the parameters, once it is sure that they are complete."""
    known = (*RANGES, *WORDS)
    for name in axes:
        if name not in known:
            raise InputError(f"unknown parameter {shorten(name)}: choose from {', '.join(known)}")
    missing = [name for name in BY_KEY if name not in axes]
    if missing:
        raise InputError(f"parameters.{missing[0]} is missing: the study needs {', '.join(BY_KEY)} and a condition")
    conditions = [name for name in CONDITIONS if name in axes]
    if len(conditions) != 1:
        got = ", ".join(conditions) or "none"
        raise InputError(f"parameters: give exactly one of {', '.join(CONDITIONS)} as the condition: got {got}")
    return conditions[0]


def _check_range(axis: DesignAxis) -> None:
    if axis.name in WORDS:
        return
    low, high = RANGES[axis.name]
    for value in axis.extremes:
        if not low <= value <= high:
            raise InputError(f"parameters.{axis.name} reaches {value:g}: must be from {low:g} to {high:g}")


def _quantities(names: Any) -> tuple[str, ...]:
    known = (*NUMBERS, *KINDS, *STABILITY_NUMBERS)
    if not isinstance(names, list) or not names:
        raise InputError(f"results.quantities = {shorten(names)}: must be a list of names, from {', '.join(known)}")
    for name in names:
        if name not in known:
            raise InputError(f"results.quantities: unknown quantity {shorten(name)}: choose from {', '.join(known)}")
    return tuple(dict.fromkeys(names))


def _table(given: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = given.get(name, {})
    if not isinstance(table, Mapping):
        raise InputError(f"{name} = {shorten(table)}: must be a table, [{name}]")
    return table


def _only(table: Mapping[str, Any], where: str, known: tuple[str, ...]) -> None:
    for name in table:
        if name not in known:
            raise InputError(f"unknown key {where}{show_key(name)}: choose from {', '.join(known)}")


def _number(
    table: Mapping[str, Any], key: str, default: float, low: float, high: float, *, whole: bool = False
) -> float:
    value = table.get(key.rpartition(".")[2], default)
    kinds = int if whole else (int, float)
    if isinstance(value, bool) or not isinstance(value, kinds) or not low <= value <= high:
        what = "a whole number" if whole else "a number"
        raise InputError(f"{key} = {shorten(value)}: must be {what} from {low:g} to {high:g}")
    return value if whole else float(value)


def _interval(value: Any) -> tuple[float, float]:
    numbers = isinstance(value, list | tuple) and all(type(v) in (int, float) for v in value)
    try:
        low, high = (float(v) for v in value) if numbers else (math.nan, math.nan)
    except (ValueError, OverflowError):
        low = high = math.nan
    if not math.isfinite(low + high):
        raise InputError(f"search.surface_temperature = {shorten(value)}: must be two numbers, [low, high]")
    return low, high
