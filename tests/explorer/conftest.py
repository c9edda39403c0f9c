"""What several tests of the explorer use."""

import socket
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path

import pytest


@pytest.fixture
def compute(monkeypatch):
    """A computation that does what a query says, which workers find too: they take the path of this process."""
    monkeypatch.syspath_prepend(Path(__file__).parent)
    return import_module("explorer_computations").compute


@pytest.fixture
def half_sent():
    """The context manager of connections on which a request was begun and is not finished."""

    @contextmanager
    def half_sent(port, count, source="127.0.0.1"):
        with ExitStack() as opened:
            those = []
            for _ in range(count):
                one = opened.enter_context(
                    socket.create_connection(("127.0.0.1", port), 10, source_address=(source, 0))
                )
                one.sendall(b"GET /about HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Long: ")
                those.append(one)
            yield those

    return half_sent
