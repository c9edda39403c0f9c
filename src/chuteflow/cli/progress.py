"""Progress on a terminal: one line on standard error that is written over; nothing where no terminal shows it."""

from __future__ import annotations

import sys
import time
from types import TracebackType

import click

from chuteflow.cli.options import is_quiet

_CLEAR = "\r\x1b[K"


class Progress:
    """A line that shows how far a command is, inside a ``with`` block, at whose end it is taken away.

    It is written over at most once in ``seconds``.
    """

    def __init__(self, seconds: float = 0.0) -> None:
        self.is_shown = sys.stderr.isatty() and not is_quiet()
        self._seconds, self._next = seconds, time.monotonic() + seconds

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.clear()

    def show(self, text: str) -> None:
        """Show ``text`` in place of what stands there."""
        if self.is_shown and time.monotonic() >= self._next:
            self._next = time.monotonic() + self._seconds
            click.echo(f"{_CLEAR}{text}", nl=False, err=True)

    def clear(self) -> None:
        """Take the line away, so that something else can be written."""
        if self.is_shown:
            click.echo(_CLEAR, nl=False, err=True)
