"""Bits do not depend on the number of threads that linear algebra is allowed."""

import hashlib
import os
import subprocess
import sys

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from chuteflow.threads import VARIABLES, on_one_thread

#: Its branches need grids on which LAPACK with two threads has other bits than with one.
DEEP = ("0.49126", "0.632", "0.5484", "0.8133")


def run(code_or_module, threads):
    environment = dict(os.environ) | dict.fromkeys(VARIABLES, str(threads))
    command = [sys.executable, *code_or_module]
    done = subprocess.run(command, capture_output=True, env=environment, check=True)
    assert done.stderr == b""
    return hashlib.sha256(done.stdout).hexdigest()


def blas_threads():
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


@pytest.mark.slow
def test_the_command_line_has_the_same_bits_with_any_setting():
    options = [part for pair in zip(("--slope", "--e", "--ew", "--roughness"), DEEP, strict=True) for part in pair]
    arguments = ["-m", "chuteflow", "curve", *options, "--surface", "interface", "--points", "20", "--json"]
    assert run(arguments, 1) == run(arguments, 2)


@pytest.mark.slow
def test_the_package_has_the_same_bits_with_any_setting():
    code = (
        "import chuteflow\n"
        f"found = chuteflow.curve(chuteflow.Chute({', '.join(DEEP)}, surface='interface'), points=20)\n"
        "flows = [flow for branch in found.branches for flow in branch.flows]\n"
        "assert max(flow.solution.problem.degree for flow in flows) > 128\n"
        "print([flow.solution.z.tolist() for flow in flows])\n"
    )
    assert run(["-c", code], 1) == run(["-c", code], 2)


def test_a_process_of_the_command_line_has_one_thread():
    code = (
        "import sys, threadpoolctl\n"
        "from chuteflow.cli.program import main\n"
        "sys.argv = ['chuteflow', 'hot', '--slope', '0.3', '--e', '0.8', '--ew', '0.8', '--roughness', '0.6']\n"
        "main()\n"
        "import scipy.linalg\n"
        "threads = {one['num_threads'] for one in threadpoolctl.threadpool_info()}\n"
        "assert threads == {1}, threads\n"
    )
    run(["-c", code], 2)


@pytest.fixture
def two_threads():
    with threadpool_limits(2, user_api="blas"):
        if set(blas_threads()) != {2}:
            pytest.skip("linear algebra has one thread here, whatever it is told")
        yield


def test_an_analysis_takes_one_thread_and_gives_back_the_others(two_threads):
    inside = on_one_thread(lambda: (blas_threads(), on_one_thread(blas_threads)(), blas_threads()))()
    assert all(set(seen) == {1} for seen in inside)
    assert set(blas_threads()) == {2}
    with pytest.raises(ZeroDivisionError):
        on_one_thread(lambda: 1 / 0)()
    assert set(blas_threads()) == {2}
