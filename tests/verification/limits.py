"""A limit on the processor time of what is tested."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class TooLate(Exception):
    """An answer took longer than it may."""


@contextmanager
def processor_time(limit: float) -> Iterator[None]:
    """Raise TooLate where the body takes longer than ``limit`` seconds of processor time."""

    def late(*_: Any) -> None:
        raise TooLate(f"no answer after {limit:g} s of processor time")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
