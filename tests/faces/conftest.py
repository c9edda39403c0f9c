"""What several tests of the faces use."""

import re
import socket
import subprocess
import sys
import threading
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path

import pytest


class Served:
    """The command in a process of its own; its address inside the block, and a clean end after it."""

    def __enter__(self):
        command = [sys.executable, "-m", "chuteflow", "explore", "--no-browser", "--port", "0"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        match = re.search(r"http://127\.0\.0\.1:\d+/", line)
        assert match, line
        return match[0]

    def __exit__(self, *_):
        self.process.send_signal(2)
        timer = threading.Timer(20, self.process.kill)
        timer.start()
        _, complaints = self.process.communicate()
        timer.cancel()
        assert self.process.returncode == 0, complaints
        assert "Traceback" not in complaints


@pytest.fixture(scope="session")
def served():
    """The context manager that serves the explorer."""
    return Served


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
