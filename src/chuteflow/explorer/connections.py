"""Connections of the server, limited in time and number: clients who never finish a request do not block others.

A connection either waits for a request or is answered. A waiting connection is closed after some seconds, and at once
where the limit on their number is reached: the client with the most connections loses one first.
"""

from __future__ import annotations

import asyncio
import json
import signal
from collections import defaultdict
from collections.abc import Callable, Iterable
from types import FrameType
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

#: Seconds within which a request must be complete, and within which its answer must be received.
_REQUEST, _ANSWER = 10.0, 300.0
#: Connections of one client that may wait for a request longer than so many seconds.
_WAITING, _AT_FIRST = 32, 1.0
#: Connections in all, if the system allows so many open files, and files that are left for other purposes.
_MOST, _OTHER_FILES = 512, 64
#: Ticks of the server, of 0.1 s, between two inspections.
_TICKS = 5


class Connection(H11Protocol):
    """A connection that knows since when it waits for a request or is answered."""

    since = 0.0
    #: Whether a part of a request has come, and how many requests were answered.
    begun = False
    answered = 0

    @property
    def waits(self) -> bool:
        """Whether it waits for a request, or for the rest of one."""
        return self.cycle is None or self.cycle.response_complete  # pyright: ignore[reportUnnecessaryComparison]

    @property
    def address(self) -> str:
        """The address of the client."""
        return self.client[0] if self.client else ""

    def connection_made(self, transport: asyncio.Transport) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Take the connection; where there are too many, one is dropped for it."""
        super().connection_made(transport)
        self.since = self.loop.time()
        others = [one for one in self.connections if isinstance(one, Connection) and not one.transport.is_closing()]
        if len(others) > connection_limit():
            _connection_to_drop(others).drop(503, "too many connections: finish requests, and close what is not needed")

    def data_received(self, data: bytes) -> None:
        """Take a part of a request."""
        waited = self.waits
        self.begun = True
        super().data_received(data)
        if waited and not self.waits:
            self.since = self.loop.time()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        self.since = self.loop.time()
        self.begun = False
        self.answered += 1
        super().on_response_complete()

    def drop(self, status: int, why: str) -> None:
        """Close the connection; who has begun a request is told why."""
        if self.transport.is_closing():
            return
        if not self.waits:
            self.transport.abort()
            return
        if self.begun:
            body = json.dumps({"error": why}).encode()
            phrase = {408: "Request Timeout", 503: "Service Unavailable"}[status]
            lines = f"HTTP/1.1 {status} {phrase}", "content-type: application/json", "connection: close"
            head = "\r\n".join((*lines, f"content-length: {len(body)}", "", ""))
            self.transport.write(head.encode() + body)
        self.transport.close()


def drop_overdue(connections: Iterable[Connection], now: float) -> None:
    """Close connections that took too long, and those of a client that has too many waiting."""
    waiting: defaultdict[str, list[Connection]] = defaultdict(list)
    for connection in list(connections):
        age = now - connection.since
        if connection.waits and age > _REQUEST:
            connection.drop(408, f"the request was not complete within {_REQUEST:g} seconds")
        elif connection.waits and age > _AT_FIRST:
            waiting[connection.address].append(connection)
        elif age > _ANSWER:
            connection.drop(408, "the answer was not received")
    for address, those in waiting.items():
        those.sort(key=_priority)
        for connection in those[: max(0, len(those) - _WAITING)]:
            connection.drop(503, f"{address} has more than {_WAITING} unfinished requests: finish them first")


def connection_limit() -> int:
    """How many connections there may be."""
    try:
        import resource
    except ImportError:
        return _MOST
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return _MOST if files == resource.RLIM_INFINITY else max(8, min(_MOST, files - _OTHER_FILES))


def _connection_to_drop(connections: Iterable[Connection]) -> Connection:
    """Of the client with the most connections: one that waits, if there is one, the oldest first."""
    of_client: defaultdict[str, list[Connection]] = defaultdict(list)
    for connection in connections:
        of_client[connection.address].append(connection)
    return min(max(of_client.values(), key=len), key=lambda one: (not one.waits, *_priority(one)))


def _priority(connection: Connection) -> tuple[bool, float]:
    """Connections on which a request was answered are worth more, then those that are younger."""
    return connection.answered > 0, connection.since


class Server(uvicorn.Server):
    """A server that inspects its connections, and that ends without waiting for what is in work."""

    def __init__(self, config: uvicorn.Config, end: Callable[[], None]) -> None:
        super().__init__(config)
        self._end = end

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End, at once and once, however many signals there are. An interrupt is the way to end it, and no failure."""
        if sig == signal.SIGINT:
            self.should_exit = True
        elif not self.should_exit:
            super().handle_exit(sig, frame)

    async def on_tick(self, counter: int) -> bool:
        """Inspect the connections now and then."""
        if counter % _TICKS == 0:
            drop_overdue(self._connections(), asyncio.get_running_loop().time())
        return await super().on_tick(counter)

    async def shutdown(self, sockets: Any = None) -> None:
        """Tell those who wait that the server ends, and end."""
        self._end()
        await super().shutdown(sockets)

    def _connections(self) -> list[Connection]:
        return [one for one in self.server_state.connections if isinstance(one, Connection)]
