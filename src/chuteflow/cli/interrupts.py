"""Ctrl-C on the command line: the first one ends the command, and it ends soon, whatever it is doing.

Python raises KeyboardInterrupt at whatever place the program has reached. A second one would be raised while the
first is cleaned up after; here it is ignored. A library may swallow the exception or be busy in compiled code; a
thread ends the process if it is still there after a moment.
"""

from __future__ import annotations

import atexit
import os
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread, current_thread, main_thread
from types import FrameType, TracebackType
from typing import Any

#: The exit code of a command that was interrupted.
INTERRUPTED = 130
_LINE = b"chuteflow: interrupted\n"
#: Seconds after an interrupt in which a command may clean up.
_GRACE = 1.5


class Interrupted(Exception):
    """An interrupt on its way out, with what there is to say of it."""


class Interrupts:
    """Interrupts of this process while the block runs. A block within another changes nothing.

    Args:
        to_the_end: after the block, interrupts are ignored for good, as at the end of the process. Otherwise all is
            put back as it was before.

    Attributes:
        seen: whether there was an interrupt, or the command is over and none matters any more.
        reported: whether the user has been informed.
    """

    current: Interrupts | None = None

    def __init__(self, *, to_the_end: bool = False) -> None:
        self._to_the_end = to_the_end
        self._installed = False
        self._over = Event()
        self.seen = self.reported = False

    def __enter__(self) -> Interrupts:
        # A shell that starts a command in the background has interrupts ignored; that remains.
        if current_thread() is main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            self._install()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if not self._installed:
            return
        if self._to_the_end:
            self.seen = True
            return
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.set_wakeup_fd(self._before)
        sys.unraisablehook = self._hook
        Interrupts.current = None
        self._over.set()
        self._near.close()

    def _install(self) -> None:
        Interrupts.current = self
        if self._to_the_end:
            # Registered before all others, so that it runs after them.
            atexit.register(self._end)
        self._near, far = socket.socketpair()
        self._near.setblocking(False)
        Thread(target=self._watch, args=(far,), daemon=True).start()
        self._hook, sys.unraisablehook = sys.unraisablehook, self._unraisable
        self._before = signal.set_wakeup_fd(self._near.fileno(), warn_on_full_buffer=False)
        self._installed = True
        signal.signal(signal.SIGINT, self._handle)

    def _handle(self, _: int, __: FrameType | None) -> None:
        if not self.seen:
            self.seen = True
            raise KeyboardInterrupt

    def _watch(self, far: socket.socket) -> None:
        """Told of every signal at once, also while the main thread is in compiled code."""
        with far:
            while received := far.recv(64):
                if signal.SIGINT in received and not self._over.wait(_GRACE):
                    if not self.reported:
                        os.write(2, _LINE)
                    os._exit(INTERRUPTED)

    def _end(self) -> None:
        """End with the exit code of an interrupt: Python has another one if the exception passed ``exec``."""
        if self.reported:
            with suppress(OSError, ValueError):
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(INTERRUPTED)

    def _unraisable(self, given: Any) -> None:
        """An interrupt that falls into a destructor is lost there; it needs no words."""
        if not issubclass(given.exc_type, KeyboardInterrupt):
            self._hook(given)


@contextmanager
def nothing_but_interrupts() -> Iterator[None]:
    """Once there was an interrupt, whatever the block raises counts as that: it is a consequence."""
    try:
        yield
    except BaseException as error:
        current = Interrupts.current
        if current is None or not current.seen or isinstance(error, (KeyboardInterrupt, Interrupted)):
            raise
        raise KeyboardInterrupt from None


def mark_reported() -> None:
    """Say that the user knows of the interrupt."""
    if Interrupts.current is not None:
        Interrupts.current.reported = True


def report() -> int:
    """Report an interrupt that no command reported, and return the exit code."""
    mark_reported()
    os.write(2, _LINE)
    return INTERRUPTED
