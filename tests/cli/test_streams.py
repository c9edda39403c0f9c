"""What happens where nobody listens: closed streams, readers that go away, disks that are full."""

import json
import os
import subprocess
import sys
from typing import Any

import pytest

from chuteflow.cli.program import main

PAPER = "--slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6"
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="a shell of POSIX closes the streams")


def run(command):
    """Standard error and exit code of a command in a shell, without what the shell itself says."""
    command = command.replace("chuteflow", f"{sys.executable} -m chuteflow")
    return subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("command", "code", "said"),
    [
        (f"chuteflow hot {PAPER} >&-", 0, ""),
        (f"chuteflow hot {PAPER} >&- 2>&- <&-", 0, ""),
        (f"chuteflow curve {PAPER} --points 9 2>&-", 0, ""),
        ("chuteflow hot --slope x 2>&-", 2, ""),
        ("chuteflow hot --slope x 2>/dev/full", 2, ""),
        ("chuteflow --help >&-", 0, ""),
        (f"chuteflow hot {PAPER} >/dev/full", 1, "chuteflow: cannot write the output: No space left on device\n"),
    ],
)  # fmt: skip
def test_it_ends_quietly_with_its_exit_code(command, code, said):
    done = run(command)
    assert (done.returncode, done.stderr) == (code, said)


@pytest.mark.parametrize("closed", [("stdout",), ("stdout", "stderr")])
def test_readers_that_go_away_are_a_failure_without_a_word(closed):
    near, far = os.pipe()
    os.close(near)
    try:
        streams: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        streams |= dict.fromkeys(closed, far)
        done = subprocess.run([sys.executable, "-m", "chuteflow", "hot", *PAPER.split()], **streams, check=False)
    finally:
        os.close(far)
    assert done.returncode == 1
    assert not done.stderr


def test_a_reader_that_goes_away_is_a_failure_in_process(monkeypatch):
    class Gone:
        encoding = "utf-8"
        errors = "strict"

        def write(self, text):
            raise BrokenPipeError(32, "Broken pipe")

        def flush(self):
            raise BrokenPipeError(32, "Broken pipe")

        def isatty(self):
            return False

    monkeypatch.setattr(sys, "stdout", Gone())
    assert main(["hot", *PAPER.split()]) == 1


def test_claims_are_listed_as_json(capsys):
    assert main(["claims", "--list", "--json", "--section", "4.3"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert listed
    assert all(set(one) >= {"id", "statement", "printed", "computed", "verdict"} for one in listed)
    assert all(one["verdict"] is None for one in listed)
