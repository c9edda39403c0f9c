"""The server of the explorer: it serves the page and its files, and passes questions to the scheduler."""

from __future__ import annotations

import asyncio
import base64
import json
import socket
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from chuteflow.errors import InputError
from chuteflow.explorer.about import about
from chuteflow.explorer.answers import QUESTIONS, Answer, answer
from chuteflow.explorer.scheduler import Scheduler
from chuteflow.explorer.worker import Compute

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: Names by which only this machine reaches itself.
LOOPBACK = ("localhost", "127.0.0.1", "::1")
PAGE = Path(__file__).parent / "page"


_LONGEST_QUERY = 1000
#: Where a file of measurements is sent to, the bytes that it may have, and seconds within which it must have come.
DATA, LARGEST_FILE, _SENT_WITHIN = "/data", 2_000_000, 10.0
_HEADERS = {
    b"content-security-policy": b"default-src 'self'; img-src 'self' data: blob:; style-src 'self'; "
    b"frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    b"x-content-type-options": b"nosniff",
    b"referrer-policy": b"no-referrer",
    b"cache-control": b"no-cache",
}


class Guard:
    """Refuses requests for other hosts, from pages of other hosts, with long queries or with methods other than GET,
    and POST where a file is sent."""

    def __init__(self, app: ASGIApp, hosts: Sequence[str] | None) -> None:
        self._app = app
        self._hosts = hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let through or answer."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *_HEADERS.items()]
            await send(message)

        refusal = self._refusal(scope)
        await (refusal or self._app)(scope, receive, send_guarded)

    def _refusal(self, scope: Scope) -> Response | None:
        headers = {name: value.decode("latin-1") for name, value in reversed(scope["headers"])}
        host = headers.get(b"host", "")
        if self._hosts is not None and host_of(host) not in self._hosts:
            return _error(400, f"host {host[:80]!r} is not served: ask for {' or '.join(self._hosts)}")
        if headers.get(b"sec-fetch-site") == "cross-site" and headers.get(b"sec-fetch-mode") != "navigate":
            return _error(403, "pages of other servers are not answered")
        if scope["method"] not in (("POST",) if scope["path"] == DATA else ("GET", "HEAD")):
            return _error(405, f"{scope['method'][:20]} is not served here")
        if len(scope["query_string"]) > _LONGEST_QUERY:
            return _error(414, f"the query is longer than {_LONGEST_QUERY} characters")
        return None


def host_of(header: str) -> str:
    """The host of a Host header, without its port."""
    name, colon, port = header.rpartition(":")
    return (name if colon and port.isdigit() else header).strip("[]").lower()


def application(
    hosts: Sequence[str] | None = LOOPBACK,
    compute: Compute = answer,
    data: Sequence[Mapping[str, Any]] = (),
    first: Mapping[str, Any] | None = None,
) -> Starlette:
    """The application, for requests to one of ``hosts``, or to any for None; its state has the ``scheduler``.

    The page draws ``data``, what was measured, behind the flows; ``first`` is the state in which it opens.
    """
    scheduler = Scheduler(compute)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        scheduler.start()
        yield
        scheduler.close()

    def asked(question: str) -> Callable[[Request], Any]:
        async def respond(request: Request) -> Response:
            names = [name for name, _ in request.query_params.multi_items()]
            repeated = next((name for name in names if names.count(name) > 1), None)
            if repeated is not None:
                return _error(400, f"{repeated[:40]!r} is given several times: give it once")
            client = (request.client.host, request.client.port) if request.client else ("", 0)
            given = await scheduler.ask(question, request.query_params, client, request.is_disconnected)
            return _response(given, in_answer=_in_answer(request))

        return respond

    async def read(request: Request) -> Response:
        content = await _body(request)
        if content is None:
            return _error(413, f"the file has more than {LARGEST_FILE / 1e6:g} MB, or took too long to be sent")
        query = dict(request.query_params) | {"content": base64.b64encode(content).decode()}
        client = (request.client.host, request.client.port) if request.client else ("", 0)
        return _response(await scheduler.ask("data", query, client), in_answer=_in_answer(request))

    async def metadata(_: Request) -> Response:
        return JSONResponse(about(data, first))

    served = Starlette(
        routes=[
            Route("/", _page),
            Route("/about", metadata),
            *(Route(f"/ask/{question}", asked(question)) for question in QUESTIONS if question != "data"),
            Route(DATA, read, methods=["POST"]),
            Mount("/page", StaticFiles(directory=PAGE)),
        ],
        middleware=[Middleware(Guard, hosts=hosts)],
        exception_handlers={HTTPException: _refuse, Exception: _report_failure},
        lifespan=lifespan,
    )
    served.state.scheduler = scheduler
    return served


def bind_socket(host: str, port: int | None) -> socket.socket:
    """Open a socket that listens at ``host``, at ``port`` or at 8765 or the next free one.

    Raises:
        InputError: where that is impossible.
    """
    wanted = [port] if port is not None else [8765, 0]
    try:
        family, *_, address = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError):
        raise InputError(f"--host {host!r}: not an address of this machine, try 127.0.0.1") from None
    problem = ""
    for number in wanted:
        # With the protocol named, asyncio sends small answers at once instead of waiting for more to send.
        listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((address[0], number))
            listener.listen(128)
        except (OSError, OverflowError) as error:
            listener.close()
            problem = getattr(error, "strerror", None) or str(error)
        else:
            return listener
    raise InputError(f"cannot listen at {host} port {wanted[0]}: {problem}; try --port 0 for any free one")


async def _body(request: Request) -> bytes | None:
    """The file that is sent, or None where it is too large or does not come."""
    content = bytearray()
    try:
        async with asyncio.timeout(_SENT_WITHIN):
            async for part in request.stream():
                content += part
                if len(content) > LARGEST_FILE:
                    return None
    except TimeoutError:
        return None
    return bytes(content)


def _in_answer(request: Request) -> bool:
    """Whether the status of a failure is wanted within the answer."""
    return request.headers.get("x-status") == "in-answer"


async def _page(_: Request) -> Response:
    return FileResponse(PAGE / "index.html")


def _response(given: Answer, in_answer: bool) -> Response:
    """The response with the status of the answer, or with status 200 and the status of a failure within it.

    The page asks for the latter: browsers report every failure status as an error of the page.
    """
    if in_answer and given.status >= 400:
        return JSONResponse(json.loads(given.body) | {"status": given.status})
    headers = {} if given.name is None else {"content-disposition": f'attachment; filename="{given.name}"'}
    if given.status == 503:
        headers["retry-after"] = "1"
    return Response(given.body, status_code=given.status, media_type=given.media, headers=headers)


def _error(status: int, what: str) -> Response:
    return JSONResponse({"error": what}, status_code=status)


async def _refuse(request: Request, error: Exception) -> Response:
    status = error.status_code if isinstance(error, HTTPException) else 500
    return _error(status, f"{request.url.path[:80]!r}: {getattr(error, 'detail', 'failed')}")


async def _report_failure(_: Request, __: Exception) -> Response:
    return _error(500, "the server failed on this request")
