"""Compilation of the loops that are written as scalar code, and where what was compiled is kept."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core import event

#: Without fast-math, so that bits stay; a division by zero gives what numpy gives.
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
_LOG = logging.getLogger(__name__)


def compiled(function: Callable[..., Any]) -> Any:
    """The function, compiled at its first call.

    What was compiled is kept beside the package, or where that cannot be written to among the user's cached files; and
    where neither can, it is compiled in each process.
    """
    return _compiled(function, _OPTIONS)


def compiled_in_place(function: Callable[..., Any]) -> Any:
    """The same for a function that makes no arrays, but fills or reads those that it is given.

    References to these are then not counted, which in short inner loops takes most of the time.
    """
    return _compiled(function, {**_OPTIONS, "_nrt": False})


def _compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:
        return njit(**options)(function)


class _Announcement(event.Listener):
    """Says once that something is being compiled, which the reader waits for."""

    def __init__(self) -> None:
        self._told = False

    def on_start(self, event: event.Event) -> None:
        if not self._told:
            self._told = True
            _LOG.warning("compiling the search, once on this machine: some 20 seconds")

    def on_end(self, event: event.Event) -> None:
        pass


event.register("numba:compile", _Announcement())
