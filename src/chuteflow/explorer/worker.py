"""A process that computes answers, one at a time, each within a bounded time."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from importlib import import_module
from multiprocessing.context import SpawnProcess
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from chuteflow.processes import starting_processes

# A process that starts imports this module first: what computes is imported later, by who watches over it.
if TYPE_CHECKING:
    from chuteflow.explorer.answers import Answer

#: Computes the answer to a question with its query; it runs in the worker, which finds it by its module and name.
Compute = Callable[[str, Mapping[str, str]], "Answer"]
#: Questions with their queries that a worker answers once as it starts, so that what they need is loaded, and compiled
#: where this machine has not done that before. No limit counts it.
Questions = Sequence[tuple[str, Mapping[str, str]]]

#: Seconds between two looks at the time a computation has taken, and between two attempts to interrupt it.
_LOOK, _AGAIN = 0.05, 0.25
#: Seconds that a computation may take to end once it is interrupted, and a process to start, which may have to compile.
_GRACE, _START = 1.0, 300.0
T = TypeVar("T")


@dataclass(frozen=True)
class Limits:
    """Seconds that one answer may take: of the processor, and by the clock."""

    processor: float
    clock: float


class Ended(Enum):
    """Why there is no answer."""

    TOO_LONG = "the computation took longer than its limit"
    BUSY = "the time by the clock was up before the computation had its share of the processor"
    TAKEN_BACK = "nobody waits for the answer"
    BROKEN = "the process ended"


class _Interrupt(BaseException):
    """Raised within a computation to end it; nothing that computes catches it."""

    def __init__(self, why: Ended) -> None:
        super().__init__(why)
        self.why = why


class Pipe(Protocol):
    """One end of a connection between processes; its class differs between systems."""

    def send(self, obj: Any, /) -> None: ...  # noqa: D102

    def recv(self) -> Any: ...  # noqa: D102

    def poll(self, timeout: float | None = ..., /) -> bool: ...  # noqa: D102

    def close(self) -> None: ...  # noqa: D102


class Worker:
    """A process that is started when it is needed, and replaced when it has ended.

    Args:
        nice: by how much the priority of the process is lower than that of this one, 0 to 19.
        warm: questions that it answers as it starts.
        compute: what computes an answer, a function of a module.
    """

    def __init__(self, *, nice: int = 0, warm: Questions = (), compute: Compute) -> None:
        self._nice = nice
        self._warm = warm
        self._compute = compute
        self._process: SpawnProcess | None = None
        self._pipe: Pipe | None = None
        self._control: Pipe | None = None
        self._number = 0
        # Which question is in work, so that another is never taken back in its place.
        self._lock = threading.Lock()
        self._ticket: object | None = None
        self._closed = False

    @property
    def pid(self) -> int | None:
        """The number of the process, or None where it does not run."""
        return self._process.pid if self._process is not None else None

    def start(self) -> None:
        """Start the process unless it runs, and wait until it is ready."""
        if self._closed:
            return
        try:
            if self._pipe is None or self._process is None or not self._process.is_alive():
                self._stop()
                pipe = self._launch()
                if not pipe.poll(_START):
                    raise EOFError
                pipe.recv()
        except (EOFError, OSError):
            self._stop()

    def put(self, ticket: object, question: str, query: Mapping[str, str], limits: Limits) -> Answer | Ended:
        """The answer, waited for in this thread, or why there is none."""
        self.start()
        with self._lock:
            if self._pipe is None or self._closed:
                return Ended.BROKEN
            self._ticket = ticket
            self._number += 1
        try:
            self._pipe.send((self._number, question, dict(query), limits))
            if self._pipe.poll(limits.clock + _GRACE):
                return self._pipe.recv()
            ended = Ended.TOO_LONG
        except (EOFError, OSError):
            ended = Ended.BROKEN
        finally:
            with self._lock:
                self._ticket = None
        self._stop()
        return ended

    def take_back(self, ticket: object) -> None:
        """End the computation of the question that ``put`` was given with this ticket, if it is in work."""
        with self._lock:
            if self._ticket is ticket and self._control is not None:
                try:
                    self._control.send(self._number)
                except OSError:
                    return  # the process has ended, which ``put`` notices

    def close(self) -> None:
        """End the process for good; a question in work is lost."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()

    def _launch(self) -> Pipe:
        context = multiprocessing.get_context("spawn")
        near, far = context.Pipe()
        control, heard = context.Pipe()
        arguments = far, heard, self._nice, self._warm, self._compute.__module__, self._compute.__qualname__
        process = context.Process(target=_serve, args=arguments, daemon=True)
        with starting_processes():
            process.start()
        far.close()
        heard.close()
        with self._lock:
            self._process, self._pipe, self._control = process, near, control
            if self._closed:
                process.kill()
        return near

    def _stop(self) -> None:
        with self._lock:
            process, pipes = self._process, (self._pipe, self._control)
            self._process = self._pipe = self._control = None
        if process is not None:
            process.kill()
            process.join()
        for pipe in pipes:
            if pipe is not None:
                pipe.close()


def _serve(pipe: Pipe, control: Pipe, nice: int, warm: Questions, module: str, name: str) -> None:
    """Answer until the other end closes."""
    watch = _Watch(control)
    if hasattr(os, "nice"):
        os.nice(nice)

    def loaded() -> Compute:
        compute = getattr(import_module(module), name)
        for question, query in warm:
            compute(question, query)
        return compute

    compute = watch.bounded(0, Limits(math.inf, math.inf), loaded)
    if isinstance(compute, Ended):
        return
    try:
        pipe.send("ready")
        while True:
            number, question, query, limits = pipe.recv()
            pipe.send(watch.bounded(number, limits, partial(compute, question, query)))
    except (EOFError, OSError):
        return


class _Watch:
    """A thread that interrupts the main one when a computation has taken too long or is taken back."""

    def __init__(self, control: Pipe) -> None:
        self._control = control
        self._busy = threading.Event()
        self._number = 0
        self._limits = Limits(0.0, 0.0)
        self._began = (0.0, 0.0)
        # The question that is to end, by its number so that the next one never ends in its place.
        self._due: tuple[int, Ended] | None = None
        # Ctrl-C is for the server alone. The same signal interrupts a computation, on every system.
        signal.signal(signal.SIGINT, self._heard)
        self._hook, sys.unraisablehook = sys.unraisablehook, self._unraisable
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        threading.Thread(target=self._run, daemon=True).start()

    def bounded(self, number: int, limits: Limits, compute: Callable[[], T]) -> T | Ended:
        """What ``compute`` returns, or why it was interrupted."""
        self._limits, self._began = limits, (time.process_time(), time.monotonic())
        try:
            self._number = number
            self._busy.set()
            try:
                return compute()
            finally:
                self._busy.clear()
        except _Interrupt as interrupt:
            self._busy.clear()
            return interrupt.why
        except Exception:
            # Compiled code that is interrupted as it is loaded turns that into another error.
            if self._due is not None and self._due[0] == number:
                return self._due[1]
            raise

    def _heard(self, *_: object) -> None:
        if self._busy.is_set() and self._due is not None and self._due[0] == self._number:
            raise _Interrupt(self._due[1])

    def _unraisable(self, given: Any) -> None:
        """An interrupt that is lost in a finaliser needs no words: another follows."""
        if not issubclass(given.exc_type, _Interrupt):
            self._hook(given)

    def _run(self) -> None:
        while self._busy.wait():
            number = self._number
            try:
                if self._control.poll(_LOOK) and self._control.recv() == number:
                    self._due = number, Ended.TAKEN_BACK
            except (EOFError, OSError):
                os._exit(1)  # the server has ended
            overdue = self._overdue()
            if overdue is not None:
                self._due = number, overdue
            if self._due is not None and self._due[0] == self._number:
                _interrupt_main_thread()
                # An exception within a finaliser, for one, is lost: until the computation ends, there are more.
                time.sleep(_AGAIN)

    def _overdue(self) -> Ended | None:
        processor, clock = self._began
        if time.process_time() - processor > self._limits.processor:
            return Ended.TOO_LONG
        return Ended.BUSY if time.monotonic() - clock > self._limits.clock else None


def _interrupt_main_thread() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, signal.SIGINT)  # ends a sleep as well
    else:
        import _thread

        _thread.interrupt_main()
