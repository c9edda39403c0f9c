"""One thread for linear algebra: the systems solved here are small, and more threads change the last digits.

LAPACK orders its sums by the number of its threads, for matrices of about 100 rows and more. On busy processors,
threads that wait for one another also cost many times the time of one. A process of this package takes one thread
from its start. Within another program, the analyses take one thread while they run.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from functools import lru_cache, wraps
from threading import RLock
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

#: What the libraries of linear algebra read when they are loaded.
VARIABLES = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "BLIS_NUM_THREADS",
)
#: Modules that bring a library of linear algebra each.
_LIBRARIES = frozenset({"numpy", "scipy.linalg"})


def limit_process() -> None:
    """Give this process, and those that it starts, one thread, whatever the environment says.

    It has an effect only before numpy is loaded, and does nothing afterwards.
    """
    if "numpy" not in sys.modules:
        os.environ.update(dict.fromkeys(VARIABLES, "1"))


def on_one_thread(function: Callable[P, R]) -> Callable[P, R]:
    """``function`` with linear algebra on one thread while it runs, so that its bits depend on no setting."""

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        with _limit:
            return function(*args, **kwargs)

    return limited


class _Limit:
    """The limit in force, entered any number of times, by any number of Python threads.

    The libraries have one setting for the whole process: the first to enter sets it, and the last to leave gives
    back what was before. A library that was loaded in between is limited by whoever enters next.
    """

    def __init__(self) -> None:
        self._lock = RLock()
        self._depth = 0
        self._limited: list[tuple[frozenset[str], Any]] = []

    def __enter__(self) -> None:
        with self._lock:
            self._depth += 1
            loaded = frozenset(_LIBRARIES & sys.modules.keys())
            if all(loaded != before for before, _ in self._limited):
                self._limited.append((loaded, _controller(loaded).limit(limits=1, user_api="blas")))

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._depth -= 1
            while self._limited and self._depth == 0:
                self._limited.pop()[1].restore_original_limits()


@lru_cache(maxsize=4)
def _controller(loaded: frozenset[str]) -> Any:
    """The libraries of linear algebra in this process, where the modules ``loaded`` are."""
    del loaded
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


_limit = _Limit()
