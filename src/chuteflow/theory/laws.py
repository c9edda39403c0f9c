"""The registry of constitutive laws: those of this package, of files, and of other packages.

A law is asked for in one line of text, wherever one is asked for:

    lun                             by its name
    extended:packing=0.64           with other values of some of its parameters
    grains.py:OWN                   the Law called OWN in a file
    grains.py:OWN:packing=0.64      and with other values there

Other packages offer laws as entry points of the group ``chuteflow.closures``, each a Law.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from chuteflow.checks import shorten
from chuteflow.errors import InputError
from chuteflow.theory.constitutive import Law
from chuteflow.theory.extended import EXTENDED, JENKINS_BERZI
from chuteflow.theory.formula import parsed
from chuteflow.theory.garzo_dufty import GARZO_DUFTY, GARZO_DUFTY_FOURIER
from chuteflow.theory.lun import LUN, LUN_FOURIER

#: The group of entry points by which other packages offer laws.
ENTRY_POINTS = "chuteflow.closures"

LAWS: dict[str, Law] = {
    law.name: law for law in (LUN, LUN_FOURIER, GARZO_DUFTY, GARZO_DUFTY_FOURIER, EXTENDED, JENKINS_BERZI)
}


def law(asked: str | Law) -> Law:
    """The law that ``asked`` means: itself, or what a text names, see the head of this module.

    Raises:
        InputError: for an unknown name, a file that cannot be imported or has no such law, or a parameter that the law
            does not have.
    """
    if isinstance(asked, Law):
        return asked
    if not isinstance(asked, str):
        raise InputError(f"unknown closure {shorten(asked)}: must be a text or a Law; choose one of {', '.join(LAWS)}")
    if asked in LAWS:
        return LAWS[asked]
    where, settings = _parts(asked)
    found = _in_file(where) if _is_in_file(where) else _find(where)
    if not settings:
        return found
    values = {}
    for name, text in settings.items():
        if name not in found.parameters:
            found.configured(**{name: text})  # raises
        values[name] = parsed(found.coefficients, name, text)
    return found.configured(**values)


def closures() -> dict[str, Law]:
    """The constitutive laws that there are, by the names that :class:`chuteflow.Chute` takes as its closure."""
    return dict(known_laws())


def add_settings(asked: str, settings: tuple[str, ...]) -> str:
    """The text ``asked`` with more ``settings``, each KEY=VALUE.

    Raises:
        InputError: for one that is not of this form.
    """
    where, known = _parts(asked)
    for text in settings:
        known |= _settings(text)
    return where + (":" + ",".join(f"{name}={value}" for name, value in known.items()) if known else "")


def in_folder(asked: str, folder: Path) -> str:
    """The text ``asked`` with the file in it, if there is one, relative to ``folder``."""
    where, settings = _parts(asked)
    if not _is_in_file(where):
        return asked
    file, _, name = where.rpartition(":")
    return add_settings(f"{folder / file}:{name}", tuple(f"{key}={value}" for key, value in settings.items()))


def runs_code(asked: str) -> bool:
    """Whether :func:`law` would run a file for the first time: nothing that is read may make it do so."""
    where, _ = _parts(asked)
    return _is_in_file(where) and str(Path(where.rpartition(":")[0]).resolve()) not in _RUN


def known_laws() -> dict[str, Law]:
    """All laws by name, with those of other packages.

    Raises:
        InputError: for an entry point that cannot be loaded, or is no law.
    """
    return {name: _load_offered(name, entry) for name, entry in _entry_points().items()} | LAWS


def _parts(asked: str) -> tuple[str, dict[str, str]]:
    """The name or the file with its name, and the settings behind it."""
    where, colon, last = asked.rpartition(":")
    return (where, _settings(last)) if colon and "=" in last else (asked, {})


def _is_in_file(where: str) -> bool:
    return ".py:" in where


def _settings(text: str) -> dict[str, str]:
    found = {}
    for part in text.split(","):
        name, equals, value = part.partition("=")
        if not (equals and name.strip() and value.strip()):
            raise InputError(f"{shorten(part)}: parameters of a closure are given as KEY=VALUE, such as packing=0.64")
        found[name.strip()] = value.strip()
    return found


def _find(name: str) -> Law:
    if name in LAWS:
        return LAWS[name]
    entries = _entry_points()
    if name in entries:
        return _load_offered(name, entries[name])
    known = ", ".join(dict.fromkeys((*LAWS, *entries)))
    raise InputError(f"unknown closure {name!r}: choose one of {known}, or FILE.py:NAME")


@lru_cache(maxsize=1)
def _entry_points() -> dict[str, Any]:
    # Imported late: it takes longer than all else that a built-in law needs.
    from importlib.metadata import entry_points

    return {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}


def _load_offered(name: str, entry: Any) -> Law:
    try:
        found = entry.load()
    except Exception as error:  # noqa: BLE001 - what another package raises is its own
        raise InputError(f"closure {name!r}: its package cannot be imported: {_reason(error)}") from None
    if not isinstance(found, Law):
        raise InputError(f"closure {name!r}: {entry.value} is a {type(found).__name__}, not a Law")
    return found


def _in_file(where: str) -> Law:
    """The law of FILE.py:NAME."""
    file, _, name = where.rpartition(":")
    path = Path(file)
    try:
        stamp = os.stat(path)
    except (OSError, ValueError) as error:
        raise InputError(f"closure {where!r}: cannot read {file}: {getattr(error, 'strerror', error)}") from None
    module = _module(str(path.resolve()), (stamp.st_mtime_ns, stamp.st_size))
    laws = [key for key, value in vars(module).items() if isinstance(value, Law)]
    found = getattr(module, name, None)
    if not isinstance(found, Law):
        there = f"its laws are {', '.join(laws)}" if laws else "there is no Law in it"
        kind = "is not in it" if found is None else f"is a {type(found).__name__}"
        raise InputError(f"closure {where!r}: {name!r} {kind}; {there}")
    return replace(found, spec=where)


#: Files that were run in this process.
_RUN: set[str] = set()


@lru_cache(maxsize=32)
def _module(path: str, stamp: tuple[int, int]) -> Any:
    """The module in a file; imported again where the file has changed."""
    name = f"chuteflow_closure_{abs(hash((path, stamp))):x}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look their module up.
    sys.modules[name] = module
    folder = str(Path(path).parent)
    sys.path.insert(0, folder)
    try:
        spec.loader.exec_module(module)
        _RUN.add(path)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - the file may raise anything
        del sys.modules[name]
        raise InputError(f"closure file {path} cannot be imported: {_reason(error)}") from None
    finally:
        sys.path.remove(folder)
    return module


def _reason(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
