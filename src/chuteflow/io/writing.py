"""Files that are whole or absent: made in memory, written apart, and put in their place by one step."""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import BinaryIO, TextIO

from chuteflow.errors import InputError

#: Names of files that are being written: machine, process and random digits.
_PARTIAL = re.compile(r"\.chuteflow-([0-9a-f]{8})-(\d{1,10})-[0-9a-f]{12}(?:\.\w+)?")
#: What a file system says that has no files without names, or no way to name them.
_NOT_HERE = (errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL, errno.ENOENT, errno.ENOSYS, errno.EXDEV, errno.EPERM)


def write_whole(path: str | os.PathLike[str], content: bytes | str) -> None:
    """Write ``content``, text as UTF-8, to ``path``; what was there is replaced in one step, or stays as it was.

    Raises:
        InputError: where the file cannot be written; nothing is left behind.
    """
    data = content.encode() if isinstance(content, str) else content
    target = _target(path)
    partial = _beside(target)
    try:
        _remove_abandoned(target.parent)
        if not _write_unnamed(partial, data):
            _write_named(partial, data)
        if target.exists():
            shutil.copymode(target, partial)
        partial.replace(target)
    except OSError as error:
        raise _cannot_write(path, error) from None
    finally:
        with suppress(OSError):
            partial.unlink()


def write_file(path: str | os.PathLike[str], writers: Mapping[str, Callable[[BinaryIO], None]]) -> None:
    """Write a file in the format of its ending, by the one of ``writers`` that is for it, whole or not at all.

    Raises:
        InputError: for another ending, or a file that cannot be written.
    """
    write = writers[require_writable(path, tuple(writers))]
    stream = BytesIO()
    write(stream)
    write_whole(path, stream.getvalue())


@contextmanager
def as_text(stream: BinaryIO) -> Iterator[TextIO]:
    """``stream`` as one of text in UTF-8, whose lines end as they are written."""
    text = TextIOWrapper(stream, encoding="utf-8", newline="")
    yield text
    text.detach()


def require_writable(path: str | os.PathLike[str], suffixes: Sequence[str]) -> str:
    """Check that ``path`` has one of ``suffixes`` and can be written, and leave nothing behind; the suffix.

    Raises:
        InputError: naming the path and what is wrong with it.
    """
    suffix = require_suffix(path, suffixes)
    trial = _beside(_target(path))
    try:
        descriptor = _open_unnamed(trial.parent)
        if descriptor is None:
            trial.touch(exist_ok=False)
            trial.unlink()
        else:
            os.close(descriptor)
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
        allowed = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
        raise InputError(f"{str(path)!r}: the name must end in {allowed}")
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
    except ValueError as error:
        raise InputError(f"cannot write {str(path)!r}: {error}") from None
    except OSError as error:
        raise _cannot_write(path, error) from None
    return target


def _open_unnamed(folder: Path) -> int | None:
    """A descriptor of a new file in ``folder`` that has no name, and so never outlives its process; None where the
    system has no such files."""
    flag = getattr(os, "O_TMPFILE", None)
    if flag is None:
        return None
    try:
        return os.open(folder, flag | os.O_WRONLY, 0o666)
    except OSError as error:
        if error.errno in _NOT_HERE:
            return None
        raise


def _write_unnamed(partial: Path, data: bytes) -> bool:
    """Write a file without a name, and name it ``partial`` once it is whole; whether the system can."""
    descriptor = _open_unnamed(partial.parent)
    if descriptor is None:
        return False
    with os.fdopen(descriptor, "wb") as file:
        _fill(file, data)
        folder = os.open(partial.parent, os.O_RDONLY)
        try:
            # With a folder of its own the call follows the link to the file, and without it does not.
            os.link(f"/proc/self/fd/{descriptor}", partial.name, dst_dir_fd=folder, follow_symlinks=True)
        except OSError as error:
            if error.errno in _NOT_HERE:
                return False
            raise
        finally:
            os.close(folder)
    return True


def _write_named(partial: Path, data: bytes) -> None:
    with partial.open("xb") as file:
        _fill(file, data)


def _fill(file: BinaryIO, data: bytes) -> None:
    file.write(data)
    file.flush()
    # A disk that is full may say so only now.
    os.fsync(file.fileno())


def _beside(target: Path) -> Path:
    return target.with_name(f".chuteflow-{_machine()}-{os.getpid()}-{secrets.token_hex(6)}{target.suffix}")


def _machine() -> str:
    """This machine in a few digits: numbers of processes mean nothing on another that shares the folder."""
    return hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def _remove_abandoned(folder: Path) -> None:
    """Remove what processes that were killed have left in ``folder``."""
    if os.name != "posix":
        return  # elsewhere there is no harmless way to ask whether a process lives
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            found = _PARTIAL.fullmatch(entry.name)
            if found and found[1] == _machine() and not _alive(int(found[2])):
                with suppress(OSError):
                    os.unlink(entry.path)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _cannot_write(path: str | os.PathLike[str], error: OSError) -> InputError:
    return InputError(f"cannot write {path}: {error.strerror or error}")
