"""Computations for the workers of the explorer, which find them by this module's name."""

import json
import os
import signal
import sys
import time
from pathlib import Path

from chuteflow.explorer.answers import Answer

if "WITHOUT_POSIX" in os.environ:  # as on other systems
    for module, name in ((os, "nice"), (os, "fork"), (signal, "pthread_kill"), (signal, "pthread_sigmask")):
        delattr(module, name)
    sys.modules["fcntl"] = None  # pyright: ignore[reportArgumentType]


def compute(question, query):
    """Do what the query says: ``do``, and note it in the file ``log``."""
    if "log" in query:
        with Path(query["log"]).open("a") as log:
            log.write(f"{query['name']} {question}\n")
    return _DOES[query["do"]](query)


def _told(content):
    return Answer(200, "application/json", json.dumps(content).encode())


def _nap(query):
    time.sleep(float(query["seconds"]))
    return _told("done")


def _loop(query):
    until = time.process_time() + 60.0
    while time.process_time() < until:
        sum(range(1000))
    return _told("done")


def _hold_on(query):
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        try:
            _loop(query)
        except BaseException:  # noqa: BLE001  as a library might
            continue
    return _told("done")


def _end_otherwise(query):
    try:
        return _loop(query)
    except BaseException as error:  # as an interpreter that calls back into Python does
        raise SystemError("returned a result with an exception set") from error


_DOES = {
    "nap": _nap,
    "loop": _loop,
    "hold on": _hold_on,
    "other error": _end_otherwise,
    "die": lambda query: os._exit(3),
    "tell": lambda query: _told({"threads": os.environ.get("OPENBLAS_NUM_THREADS"), "process": os.getpid()}),
}
