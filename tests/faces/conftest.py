"""What several tests of the faces use."""

import re
import subprocess
import sys
import threading
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
