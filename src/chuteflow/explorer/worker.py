"""A worker process that computes answers, one at a time, each within a time limit."""

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

# A starting process imports this module first; the code that computes is imported later, under the watchdog.
if TYPE_CHECKING:
    from chuteflow.explorer.answers import Answer

#: Computes the answer to a question with its query, in the worker, which imports it by its module and name.
Compute = Callable[[str, Mapping[str, str]], "Answer"]
#: Questions with their queries that a worker answers once as it starts, so that code is loaded, and compiled where it
#: is not cached. No time limit applies.
Questions = Sequence[tuple[str, Mapping[str, str]]]

#: Seconds between two checks of the time that a computation has taken, and between two attempts to interrupt it.
_POLL, _RETRY = 0.05, 0.25
#: Seconds that a computation may take to end once it is interrupted, and that a process may take to start and compile.
_GRACE, _START = 1.0, 300.0
T = TypeVar("T")


@dataclass(frozen=True)
class Limits:
    """Seconds that one answer may take: of the processor, and by the clock."""

    processor: float
    clock: float


class NoAnswer(Enum):
    """Why there is no answer."""

    TOO_LONG = "the computation took longer than its limit"
    BUSY = "the time limit by the clock passed before the computation had used its processor time"
    CANCELLED = "the request was cancelled"
    CRASHED = "the process ended"


class _Interrupt(BaseException):
    """Raised within a computation to end it; nothing that computes catches it."""

    def __init__(self, why: NoAnswer) -> None:
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
        warm_up: questions that it answers as it starts.
        compute: what computes an answer, a function of a module.
    """

    def __init__(self, *, nice: int = 0, warm_up: Questions = (), compute: Compute) -> None:
        self._nice = nice
        self._warm_up = warm_up
        self._compute = compute
        self._process: SpawnProcess | None = None
        self._pipe: Pipe | None = None
        self._control: Pipe | None = None
        self._number = 0
        # The question that is being computed, so that no other is cancelled in its place.
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

    def put(self, ticket: object, question: str, query: Mapping[str, str], limits: Limits) -> Answer | NoAnswer:
        """The answer, waited for in this thread, or why there is none."""
        self.start()
        with self._lock:
            if self._pipe is None or self._closed:
                return NoAnswer.CRASHED
            self._ticket = ticket
            self._number += 1
        try:
            self._pipe.send((self._number, question, dict(query), limits))
            if self._pipe.poll(limits.clock + _GRACE):
                return self._pipe.recv()
            ended = NoAnswer.TOO_LONG
        except (EOFError, OSError):
            ended = NoAnswer.CRASHED
        finally:
            with self._lock:
                self._ticket = None
        self._stop()
        return ended

    def cancel(self, ticket: object) -> None:
        """End the computation of the question that ``put`` was given with this ticket, if it is being computed."""
        with self._lock:
            if self._ticket is ticket and self._control is not None:
                try:
                    self._control.send(self._number)
                except OSError:
                    return  # the process has ended, which ``put`` notices

    def close(self) -> None:
        """End the process for good; a running computation is lost."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()

    def _launch(self) -> Pipe:
        context = multiprocessing.get_context("spawn")
        parent_end, child_end = context.Pipe()
        control, child_control = context.Pipe()
        arguments = (
            child_end,
            child_control,
            self._nice,
            self._warm_up,
            self._compute.__module__,
            self._compute.__qualname__,
        )
        process = context.Process(target=_serve, args=arguments, daemon=True)
        with starting_processes():
            process.start()
        child_end.close()
        child_control.close()
        with self._lock:
            self._process, self._pipe, self._control = process, parent_end, control
            if self._closed:
                process.kill()
        return parent_end

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


def _serve(pipe: Pipe, control: Pipe, nice: int, warm_up: Questions, module: str, name: str) -> None:
    """Answer until the other end closes."""
    watchdog = _Watchdog(control)
    if hasattr(os, "nice"):
        os.nice(nice)

    def loaded() -> Compute:
        compute = getattr(import_module(module), name)
        for question, query in warm_up:
            compute(question, query)
        return compute

    compute = watchdog.bounded(0, Limits(math.inf, math.inf), loaded)
    if isinstance(compute, NoAnswer):
        return
    try:
        pipe.send("ready")
        while True:
            number, question, query, limits = pipe.recv()
            pipe.send(watchdog.bounded(number, limits, partial(compute, question, query)))
    except (EOFError, OSError):
        return


class _Watchdog:
    """A thread that interrupts the main one when a computation has taken too long or is cancelled."""

    def __init__(self, control: Pipe) -> None:
        self._control = control
        self._busy = threading.Event()
        self._number = 0
        self._limits = Limits(0.0, 0.0)
        self._began = (0.0, 0.0)
        # The question that is to end, by its number so that the next one never ends in its place.
        self._due: tuple[int, NoAnswer] | None = None
        # Ctrl-C is for the server alone. The same signal interrupts a computation, on every system.
        signal.signal(signal.SIGINT, self._on_signal)
        self._hook, sys.unraisablehook = sys.unraisablehook, self._unraisable
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        threading.Thread(target=self._run, daemon=True).start()

    def bounded(self, number: int, limits: Limits, compute: Callable[[], T]) -> T | NoAnswer:
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

    def _on_signal(self, *_: object) -> None:
        if self._busy.is_set() and self._due is not None and self._due[0] == self._number:
            raise _Interrupt(self._due[1])

    def _unraisable(self, given: Any) -> None:
        """Ignore an interrupt that is lost in a finaliser: another follows."""
        if not issubclass(given.exc_type, _Interrupt):
            self._hook(given)

    def _run(self) -> None:
        while self._busy.wait():
            number = self._number
            try:
                if self._control.poll(_POLL) and self._control.recv() == number:
                    self._due = number, NoAnswer.CANCELLED
            except (EOFError, OSError):
                os._exit(1)  # the server has ended
            overdue = self._overdue()
            if overdue is not None:
                self._due = number, overdue
            if self._due is not None and self._due[0] == self._number:
                _interrupt_main_thread()
                # An exception raised within a finaliser is lost, so interrupts are repeated until the computation ends.
                time.sleep(_RETRY)

    def _overdue(self) -> NoAnswer | None:
        processor, clock = self._began
        if time.process_time() - processor > self._limits.processor:
            return NoAnswer.TOO_LONG
        return NoAnswer.BUSY if time.monotonic() - clock > self._limits.clock else None


def _interrupt_main_thread() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, signal.SIGINT)  # ends a sleep as well
    else:
        import _thread

        _thread.interrupt_main()
