"""Processes that compute beside this one: how many there may be, how they start, and that none outlives this one.

All of them are spawned, on every system: they share neither locks nor threads with this process. An interrupt from
the terminal reaches every process of its group; here it is left to the process that started the others, which ends
them.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.process import current_process, parent_process
from threading import RLock, Thread
from typing import Any, ParamSpec, TypeVar

from chuteflow.errors import ChuteflowError
from chuteflow.threads import VARIABLES

P = ParamSpec("P")
R = TypeVar("R")

# The environment is that of all threads.
_environment = RLock()
#: The exit code of a worker that was about to run the script of its parent again.
_RUNS_SCRIPT = 76
#: Seconds that a dead process takes to be known as dead.
_MOMENT = 0.5
#: A wait for many processes takes no more handles than this on Windows.
_MOST_ON_WINDOWS = 61


class WorkerError(ChuteflowError, RuntimeError):
    """Workers that cannot start, or die."""


def available_cores() -> int:
    """How many processor cores this process may use: by its affinity, where the system tells it."""
    affinity: Callable[[int], set[int]] | None = getattr(os, "sched_getaffinity", None)
    if affinity is not None:
        return max(len(affinity(0)), 1)
    # From Python 3.13 on; the number for the machine is the best guess before.
    count: Callable[[], int | None] = getattr(os, "process_cpu_count", os.cpu_count)
    return count() or 1


class WorkerPool(ProcessPoolExecutor):
    """An executor of ``count`` spawned processes, each with one thread of linear algebra; see :func:`worker_pool`."""

    def __init__(self, count: int) -> None:
        if sys.platform == "win32":
            count = min(count, _MOST_ON_WINDOWS)
        super().__init__(count, mp_context=get_context("spawn"), initializer=begin_worker)

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """As of any executor. It may start a process, and no interrupt falls between its steps."""
        with starting_processes():
            return super().submit(fn, *args, **kwargs)

    @property
    def cannot_start(self) -> bool:
        """Whether workers died of an error at their start, and not of a signal."""
        workers = self._workers()
        for process in workers:
            process.join(_MOMENT)
        return any((process.exitcode or 0) > 0 for process in workers)

    def end(self) -> None:
        """End all workers at once, whatever they do."""
        # A second interrupt must not leave a half of them.
        with hold_back_interrupts():
            workers, manager = self._workers(), getattr(self, "_executor_manager_thread", None)
            self.shutdown(wait=False, cancel_futures=True)
            for process in workers:
                process.kill()
            for process in workers:
                process.join()
            if manager is not None:
                # It notices that they died. Left to the end of this process, it could meet pipes that are closed.
                manager.join(_MOMENT)

    def _workers(self) -> list[Any]:
        # There is no public way to ask for them, nor for the thread; shutdown sets both to None.
        return list((getattr(self, "_processes", None) or {}).values())


@contextmanager
def worker_pool(count: int) -> Iterator[WorkerPool]:
    """``count`` processes to compute in, that end with the block or with this process, however that ends.

    Raises:
        WorkerError: where the workers cannot start, as in a script without ``if __name__ == "__main__":``, or die
            and the block does not see to it.
    """
    require_main_guard()
    pool = WorkerPool(count)
    try:
        yield pool
    except BrokenProcessPool:
        raise death(pool) from None
    finally:
        pool.end()


def death(pool: Executor) -> WorkerError:
    """What to say of workers that died."""
    if isinstance(pool, WorkerPool) and pool.cannot_start:
        return WorkerError(
            "the workers cannot start: each imports the script that computes in several processes, so put what the "
            'script does under if __name__ == "__main__":, or use one process'
        )
    return WorkerError("a worker died, perhaps for lack of memory: use fewer processes, or give them more memory")


def begin_worker() -> None:
    """Set up this process as a worker: it leaves interrupts to its parent, and ends when that does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is None:
        return

    def end_with_parent() -> None:
        parent.join()
        os._exit(1)

    Thread(target=end_with_parent, daemon=True).start()


def require_main_guard() -> None:
    """End this process if it is a worker that runs the script of its parent, which would start workers without end.

    The parent is told by the exit code, and tells its user.
    """
    # What multiprocessing itself goes by, before it raises an error in every worker.
    if getattr(current_process(), "_inheriting", False):
        os._exit(_RUNS_SCRIPT)


@contextmanager
def hold_back_interrupts() -> Iterator[None]:
    """Interrupts of this thread come after the block, where the system can hold them back."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def starting_processes() -> Iterator[None]:
    """Processes started in the block never see an interrupt, and take one thread of linear algebra.

    They inherit both, the signals that are held back and the environment, and so before they import anything.
    """
    if hasattr(signal, "pthread_sigmask"):
        from multiprocessing import resource_tracker

        # Left to start with the first process, it would let interrupts through again.
        resource_tracker.ensure_running()
    with hold_back_interrupts(), _environment, _one_thread(), _script_that_is_a_file():
        yield


@contextmanager
def _script_that_is_a_file() -> Iterator[None]:
    """Processes started in the block import the script of this one, which may register laws, but for one that is
    read from standard input, which they cannot."""
    main = sys.modules["__main__"]
    name: str | None = getattr(main, "__file__", None)
    if name is None or os.path.isfile(name):
        yield
        return
    del main.__file__
    try:
        yield
    finally:
        main.__file__ = name


@contextmanager
def _one_thread() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in VARIABLES}
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
