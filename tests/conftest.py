"""Flows, the explorer, and built sites of the documentation, that several tests look at."""

import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from filelock import FileLock

import chuteflow
from chuteflow.stability.modes import Disturbances

CHUTE = chuteflow.Chute(slope=0.3, restitution=0.8, wall_restitution=0.8, roughness=0.6)


def pytest_collection_modifyitems(items):
    """Begin with the pages of the built documentation, the longest test, so that no worker waits for it at the end."""
    items.sort(key=lambda item: item.path.name != "test_docs_browser.py")


@pytest.fixture(scope="session")
def three():
    """The flows A, B and C of the paper."""
    return dict(zip("ABC", chuteflow.flows(CHUTE, Q=3.0), strict=True))


@pytest.fixture(scope="session")
def disturbances(three):
    """The disturbances of A, B and C."""
    return {name: Disturbances(flow) for name, flow in three.items()}


@pytest.fixture
def refused(capsys):
    """Checks that a command refuses its arguments: exit code 2, and one line on standard error alone, which has certain
    words."""
    from chuteflow.cli.program import main

    def check(arguments, *words):
        assert main(list(arguments)) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert len(err.splitlines()) == 1, err
        assert [word for word in words if word not in err] == [], err

    return check


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


DOCS = Path(__file__).resolve().parents[1] / "docs"
#: The build of the documentation in a process whose sockets lead nowhere.
BUILD = """
import socket, sys

def refuse(*_):
    raise OSError("no network")

socket.socket.connect = socket.socket.connect_ex = socket.getaddrinfo = refuse
from sphinx.cmd.build import main

sys.exit(main(sys.argv[1:]))
"""


def built(tmp_path_factory, name, *options):
    """The site, built by the first that asks for it; any warning fails."""
    # The workers of pytest-xdist have their folders side by side.
    folder = tmp_path_factory.getbasetemp()
    folder = folder.parent if os.environ.get("PYTEST_XDIST_WORKER") else folder
    site, done = folder / name, folder / f"{name}.done"
    with FileLock(folder / f"{name}.lock"):
        if not done.exists():
            arguments = ["--quiet", "--fail-on-warning", "--keep-going", *options, DOCS, site]
            build = subprocess.run(
                [sys.executable, "-c", BUILD, *arguments], capture_output=True, text=True, check=False
            )
            assert build.returncode == 0, build.stderr
            done.touch()
    return site


@pytest.fixture(scope="session")
def quick_site(tmp_path_factory):
    """The site without pictures, source code and all claims but one."""
    return built(tmp_path_factory, "quick-site", "-t", "quick")


@pytest.fixture(scope="session")
def whole_site(tmp_path_factory):
    """The site as it is published."""
    return built(tmp_path_factory, "whole-site")
