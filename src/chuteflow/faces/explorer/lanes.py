"""Processes that compute while the server stays free: one question at a time each, bounded in time and number."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import threading
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing.context import SpawnProcess
from typing import Any, Protocol

from chuteflow.faces.explorer.answers import Answer, answer, problem

#: Answers that a lane remembers, and questions that wait in it at most.
_REMEMBERED, _WAITING = 256, 64
#: Seconds after which it is looked again whether anybody still waits for an answer.
_PATIENCE = 0.2

#: Tells whether who asked is gone.
Gone = Callable[[], Awaitable[bool]]


class Pipe(Protocol):
    """One end of a connection between processes; its class differs between systems."""

    def send(self, obj: Any, /) -> None: ...  # noqa: D102

    def recv(self) -> Any: ...  # noqa: D102

    def poll(self, timeout: float | None = ..., /) -> bool: ...  # noqa: D102

    def close(self) -> None: ...  # noqa: D102


class Lane:
    """One process that answers one question at a time; a question that takes too long costs the process its life.

    Args:
        limit: seconds that one question may take.
        nice: by how much the priority of the process is lower than that of this one, 0 to 19.
        breaks_off: a question in work that nobody waits for any more is broken off.
    """

    def __init__(self, limit: float, *, nice: int = 0, breaks_off: bool = False) -> None:
        self._limit = limit
        self._nice = nice
        self._breaks_off = breaks_off
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._waiting = 0
        self._remembered: OrderedDict[tuple[str, frozenset[tuple[str, str]]], Answer] = OrderedDict()
        self._process: SpawnProcess | None = None
        self._pipe: Pipe | None = None
        # Which question is in work, so that another is never broken off in its place.
        self._lock = threading.Lock()
        self._in_work: object | None = None

    async def ask(self, question: str, query: Mapping[str, str], gone: Gone | None = None) -> Answer:
        """The answer, remembered or computed; one that says so where too many wait or time is up."""
        key = question, frozenset(query.items())
        if key in self._remembered:
            self._remembered.move_to_end(key)
            return self._remembered[key]
        if self._waiting >= _WAITING:
            return problem(503, f"{_WAITING} questions wait already: ask again in a moment")
        self._waiting += 1
        try:
            given = await self._computed(question, dict(query), gone)
        finally:
            self._waiting -= 1
        if given.status == 200 and given.name is None:
            self._remembered[key] = given
            if len(self._remembered) > _REMEMBERED:
                self._remembered.popitem(last=False)
        return given

    def close(self) -> None:
        """End the process; a question in work is lost."""
        self._thread.shutdown(wait=False, cancel_futures=True)
        self._stop()

    async def _computed(self, question: str, query: dict[str, str], gone: Gone | None) -> Answer:
        ticket = object()
        work = self._thread.submit(self._work, ticket, question, query)
        waited = asyncio.wrap_future(work)
        while gone is not None and not (await asyncio.wait({waited}, timeout=_PATIENCE))[0]:
            if await gone():
                return self._broken_off(ticket, work)
        return await waited

    def _broken_off(self, ticket: object, work: Future[Answer]) -> Answer:
        """Take back a question that waits, and where that is wanted also one in work."""
        if not work.cancel() and self._breaks_off:
            with self._lock:
                if self._in_work is ticket and self._process is not None:
                    self._process.kill()
        return problem(499, "nobody waits for this answer")

    def _work(self, ticket: object, question: str, query: dict[str, str]) -> Answer:
        with self._lock:
            self._in_work = ticket
        try:
            return self.put(question, query)
        finally:
            with self._lock:
                self._in_work = None

    def put(self, question: str, query: dict[str, str]) -> Answer:
        """The answer of the process, waited for in this thread."""
        try:
            pipe = self._started()
            pipe.send((question, query))
            if pipe.poll(self._limit):
                return pipe.recv()
        except (EOFError, OSError):
            self._stop()
            return problem(500, "the computation broke off: ask again")
        self._stop()
        return problem(504, f"no answer within {self._limit:g} seconds: this chute needs the command line")

    def _started(self) -> Pipe:
        if self._pipe is None or self._process is None or not self._process.is_alive():
            # Systems here are small: more threads gain nothing, and take the cores from the other lanes.
            os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
            context = multiprocessing.get_context("spawn")
            near, far = context.Pipe()
            process = context.Process(target=_serve, args=(far, self._nice), daemon=True)
            process.start()
            far.close()
            self._pipe, self._process = near, process
        return self._pipe

    def _stop(self) -> None:
        process, pipe = self._process, self._pipe
        self._process = self._pipe = None
        if process is not None:
            process.kill()
            process.join()
        if pipe is not None:
            pipe.close()


def _serve(pipe: Pipe, nice: int) -> None:
    """Answer until the other end closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(nice)
    while True:
        try:
            question, query = pipe.recv()
        except EOFError:
            return
        pipe.send(answer(question, query))
