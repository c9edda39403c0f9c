"""A chute in a TOML file: its numbers, its names, and its grains for SI units.

The keys are those of JSON and of the command line; the names of :class:`chuteflow.Chute` are taken too, as is ``angle``
in degrees in the place of ``slope``. The numbers may stand in a table ``[chute]`` or at the top; ``case`` names a case
whose numbers hold where the file does not say others.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from chuteflow.amounts import positive_amount
from chuteflow.checks import number, shorten
from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY
from chuteflow.steady.cases import Case, CaseNumber, case, nearest_names
from chuteflow.steady.chute import slope_of
from chuteflow.steady.quantities import GRAINS

#: Names of the model.
_NAMES = ("surface", "closure", "base")
#: What the file calls the numbers of a chute.
_NUMBERS = {key: key for key in BY_KEY} | {parameter.name: key for key, parameter in BY_KEY.items()}
_KEYS = ("case", *_NUMBERS, "angle", *_NAMES, *GRAINS)
_LARGEST = 1_000_000


def read_chute(path: str | os.PathLike[str]) -> Case:
    """The chute of a TOML file, as a case of the file's name.

    Raises:
        InputError: for a file that cannot be read, is no TOML, or says what is not known, twice or no number.
    """
    try:
        return _case(Path(path).name, _flat(_parse(path)))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _parse(path: str | os.PathLike[str]) -> dict[str, Any]:
    try:
        with Path(path).open("rb") as file:
            text = file.read(_LARGEST + 1)
        if len(text) > _LARGEST:
            raise InputError("it is too large for the description of a chute")
        return tomllib.loads(text.decode("utf-8-sig"))
    except (OSError, ValueError) as error:
        if isinstance(error, OSError):
            raise InputError(f"cannot be read: {error.strerror or error}") from None
        raise InputError(f"not a TOML file: {error}") from None
    except RecursionError:
        raise InputError("its tables are nested too deeply") from None


def _flat(found: Mapping[str, Any]) -> dict[str, Any]:
    """All keys beside one another, those of the tables ``[chute]`` and ``[grains]`` too."""
    flat: dict[str, Any] = {}
    for key, value in found.items():
        inside = value if key in ("chute", "grains") else {key: value}
        if not isinstance(inside, Mapping):
            raise InputError(f"{key} = {shorten(value)}: must be a table")
        for name, one in inside.items():
            if name not in _KEYS:
                raise InputError(f"unknown key {name[:40]!r}: {nearest_names(name[:40], _KEYS)}")
            if name in flat:
                raise InputError(f"{name} is given twice")
            flat[name] = one
    return flat


def _case(name: str, given: dict[str, Any]) -> Case:
    start = case(_text("case", given.pop("case"))) if "case" in given else Case(name, "", {})
    own: dict[str, CaseNumber] = {}
    for key in [one for one in given if one in _NUMBERS]:
        if _NUMBERS[key] in own:
            raise InputError(f"{_NUMBERS[key]} is given twice, also as {key}")
        own[_NUMBERS[key]] = CaseNumber(number(key, given[key]))
    if "angle" in given:
        if "slope" in own:
            raise InputError("slope and angle: give one of them, not both")
        own["slope"] = CaseNumber(slope_of(given["angle"]))
    names = {one: _text(one, given[one]) for one in _NAMES if one in given}
    grains = {one: CaseNumber(positive_amount(one, given[one], GRAINS[one])) for one in GRAINS if one in given}
    return Case(
        name,
        f"{start.description or 'the chute'} of {name}",
        {**start.numbers, **own},
        {**start.names, **names},
        {**start.grains, **grains},
    )


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise InputError(f"{name} = {shorten(value)}: must be a name in quotes")
    return value
