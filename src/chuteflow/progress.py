"""How far a long computation is: one line, written over again and again, on a terminal or below a cell of a notebook;
nothing where neither shows it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any

_CLEAR = "\r\x1b[K"
#: Seconds between two lines, and before the first, of what was not asked to show any.
_SECONDS = 0.5


class ProgressLine:
    """A line that shows how far something is, inside a ``with`` block, at whose end it is taken away.

    It is written over at most once in ``seconds``, and not at all where it is ``quiet`` or in a worker process.
    """

    def __init__(self, seconds: float = 0.0, *, quiet: bool = False) -> None:
        quiet = quiet or _is_worker()
        self._notebook = None if quiet else _notebook_display()
        self.is_shown = not quiet and (self._notebook is not None or _is_terminal())
        self._handle: Any = None
        self._seconds, self._next = seconds, time.monotonic() + seconds

    def __enter__(self) -> ProgressLine:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.clear()

    def show(self, text: str) -> None:
        """Show ``text`` in place of what stands there."""
        if self.is_shown and time.monotonic() >= self._next:
            self._next = time.monotonic() + self._seconds
            self._write(text)

    def clear(self) -> None:
        """Take the line away, so that something else can be written."""
        if self.is_shown and (self._notebook is None or self._handle is not None):
            self._write("")

    def _write(self, text: str) -> None:
        if self._notebook is None:
            sys.stderr.write(_CLEAR + text)
            sys.stderr.flush()
        elif self._handle is None:
            self._handle = self._notebook({"text/plain": text}, raw=True, display_id=True)
        else:
            self._handle.update({"text/plain": text}, raw=True)


@contextmanager
def report_progress(what: str, given: Callable[[float], Any] | None) -> Iterator[Callable[[float], Any]]:
    """What is called with the fraction that is done: the function that is ``given``, or where there is none a line that
    says ``what`` it is."""
    if given is not None:
        yield given
        return
    with ProgressLine(_SECONDS) as line:
        yield lambda fraction: line.show(f"{what}: {fraction:.0%}")


def _is_terminal() -> bool:
    try:
        return sys.stderr.isatty()
    except (AttributeError, ValueError):  # no stream, or a closed one
        return False


def _is_worker() -> bool:
    """Whether this process computes for another one."""
    multiprocessing = sys.modules.get("multiprocessing.process")
    return multiprocessing is not None and multiprocessing.parent_process() is not None


def _notebook_display() -> Callable[..., Any] | None:
    """What shows something below the cell of a notebook that runs, or None elsewhere."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is None or not hasattr(shell, "kernel"):
        return None
    from IPython.display import display  # pyright: ignore[reportMissingImports]

    return display
