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
        with _controller(frozenset(_LIBRARIES & sys.modules.keys())).limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


@lru_cache(maxsize=len(_LIBRARIES) ** 2)
def _controller(loaded: frozenset[str]) -> Any:
    """What sets the threads of the libraries of linear algebra that came with the modules ``loaded``."""
    del loaded
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
