"""Files that are whole or absent: written beside their place, and renamed into it."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from chuteflow.errors import InputError


@contextmanager
def written_beside(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path beside ``path`` to write to; it takes the place of ``path`` if the block ends without error.

    Raises:
        InputError: where the file cannot be written; nothing is left behind.
    """
    target = _target(path)
    partial = _beside(target)
    try:
        yield partial
        if target.exists():
            shutil.copymode(target, partial)
        partial.replace(target)
    except OSError as error:
        raise _cannot_write(path, error) from None
    finally:
        with suppress(OSError):
            partial.unlink()


def require_writable(path: str | os.PathLike[str], suffixes: Sequence[str]) -> str:
    """Check that ``path`` has one of ``suffixes`` and can be written, and leave nothing behind; the suffix.

    Raises:
        InputError: naming the path and what is wrong with it.
    """
    suffix = require_suffix(path, suffixes)
    trial = _beside(_target(path))
    try:
        trial.touch(exist_ok=False)
        trial.unlink()
    except OSError as error:
        raise _cannot_write(path, error) from None
    return suffix


def require_suffix(path: str | os.PathLike[str], suffixes: Sequence[str]) -> str:
    """The suffix of ``path``, in lower case.

    Raises:
        InputError: if it is none of ``suffixes``.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in suffixes:
        raise InputError(f"{str(path)!r}: the name must end in {', '.join(suffixes[:-1])} or {suffixes[-1]}")
    return suffix


def _target(path: str | os.PathLike[str]) -> Path:
    """Where ``path`` leads, links followed, once it is sure that a file may stand there."""
    try:
        target = Path(os.path.realpath(path))
        if target.exists() and not target.is_file():
            raise InputError(f"cannot write {path}: it is not a regular file")
        if target.exists() and not os.access(target, os.W_OK):
            raise InputError(f"cannot write {path}: it is write-protected")
        if not target.parent.is_dir():
            raise InputError(f"cannot write {path}: there is no directory {target.parent}")
    except OSError as error:
        raise _cannot_write(path, error) from None
    return target


def _beside(target: Path) -> Path:
    return target.with_name(f".chuteflow-{secrets.token_hex(6)}{target.suffix}")


def _cannot_write(path: str | os.PathLike[str], error: OSError) -> InputError:
    return InputError(f"cannot write {path}: {error.strerror or error}")
