"""Ctrl-C and the loss of the parent: a command ends at once, with a line, and takes its workers with it."""

import os
import random
import signal
import subprocess
import sys
import time
import warnings
from multiprocessing import current_process

import click
import pytest

from chuteflow import processes, threads
from chuteflow.cli import interrupts
from chuteflow.cli.commands import hot
from chuteflow.cli.program import main

from ..studies import study_at_temperatures

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as a terminal sends them")

PAPER = "--slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6"
STUDY = study_at_temperatures("sobol", 100_000, 64)
#: Commands that take long, with what they need.
LONG = {
    "sweep": "sweep study.toml --out study.zarr --workers 2",
    "domain": "domain --slope 0.1:0.5 --e 0.7:0.9 --ew 0.8 --roughness 0.6 --processes 2 --save map.nc",
    "figures": "figures --out figures",
    "mapped": "figures --only 4 --method mapped --out figures",
    "claims": "claims",
    "report": "report --out report",
    "relax": f"relax {PAPER} --flux 3 --save relax.csv",
    "growth": f"growth {PAPER} --flux 3 --save growth.json",
    "curve": f"curve {PAPER} --points 4000 --stability",
    "boundary": f"boundary --of fold-Q --in slope,Q --slope 0.34:0.38 {PAPER[12:]} --samples 60 --save lines.json",
    "explore": "explore --no-browser --port 0",
}


@pytest.fixture(autouse=True)
def _heard():
    """Interrupts as at a terminal, also where the tests run in the background of a shell, which ignores them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def started(command, folder):
    (folder / "study.toml").write_text(STUDY)
    return subprocess.Popen(
        [sys.executable, "-m", "chuteflow", *command.split()],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def left(session):
    """Processes of a session that are still there."""
    listed = subprocess.run(
        ["ps", "-ww", "-o", "stat=", "-o", "args=", "-s", str(session)], capture_output=True, text=True, check=False
    )
    return [line for line in listed.stdout.splitlines() if not line.startswith("Z")]


def none_left(session, seconds=5.0):
    end = time.monotonic() + seconds
    while found := left(session):
        assert time.monotonic() < end, found
        time.sleep(0.02)


def interrupted(name, folder, delay, gaps):
    """Interrupt a command as a terminal does, and again after each of ``gaps``; how it ended, after how many seconds,
    and what it said."""
    folder.mkdir(exist_ok=True)
    process = started(LONG[name], folder)
    try:
        try:
            process.communicate(timeout=delay)
        except subprocess.TimeoutExpired:
            begin = time.monotonic()
            os.killpg(process.pid, signal.SIGINT)
            for gap in gaps:
                time.sleep(gap)
                try:
                    os.killpg(process.pid, signal.SIGINT)
                except ProcessLookupError:
                    break
            _, told = process.communicate(timeout=30.0)
            spent = time.monotonic() - begin
            none_left(process.pid)
            return process.returncode, spent, told
        return None
    finally:
        if process.poll() is None or left(process.pid):
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def require_clean_end(name, code, told, folder):
    assert "Traceback" not in told, (name, told)
    assert "Exception ignored" not in told, (name, told)
    lines = [line for line in told.splitlines() if line.startswith("chuteflow: ")]
    # An interrupt is the way to end the explorer, once it serves.
    assert (code, len(lines)) in {(130, 1), (0, 0) if name == "explore" else (130, 1)}, (name, code, told)
    assert not list(folder.glob("**/.chuteflow-*")), name


# In this process


@pytest.mark.parametrize("times", [1, 2, 3])
def test_later_interrupts_do_not_disturb_the_end(monkeypatch, capsys, times):
    cleaned = []

    def interrupted_command(**_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5.0)
        finally:
            for _ in range(times - 1):
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(0.01)
            cleaned.append(True)

    monkeypatch.setattr(hot.command, "callback", interrupted_command)
    assert main(["hot", *PAPER.split()]) == 130
    assert capsys.readouterr().err == "chuteflow: interrupted\n"
    assert cleaned
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("error", [ImportError("numpy is half there"), OSError(4, "Interrupted"), click.Abort()])
def test_what_follows_from_an_interrupt_is_told_as_that(monkeypatch, capsys, error):
    def swallows(**_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5.0)
        except KeyboardInterrupt:
            raise error from None

    monkeypatch.setattr(hot.command, "callback", swallows)
    assert main(["hot", *PAPER.split()]) == 130
    assert capsys.readouterr().err == "chuteflow: interrupted\n"


def test_an_interrupt_in_a_destructor_is_not_shown(monkeypatch, capsys):
    class Swallows:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)

    monkeypatch.setattr(hot.command, "callback", lambda **_: Swallows())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        main(["hot", *PAPER.split()])
    assert "Traceback" not in capsys.readouterr().err


def test_a_command_that_heeds_no_interrupt_is_ended(tmp_path):
    code = (
        "import sys, time\nfrom chuteflow.cli.commands import hot\n"
        "def deaf(**_):\n    print('begun', flush=True)\n    while True:\n        try:\n            time.sleep(60)\n"
        "        except KeyboardInterrupt:\n            pass\n"
        "hot.command.callback = deaf\nfrom chuteflow.__main__ import run\nsys.exit(run())\n"
    )
    arguments = [sys.executable, "-c", code, "hot", *PAPER.split()]
    with subprocess.Popen(
        arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        begin = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=30.0)
        assert time.monotonic() - begin < 4.0
    assert process.returncode == 130
    assert told == "chuteflow: interrupted\n"


def test_where_interrupts_are_ignored_they_stay_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interrupts.Interrupts():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


# Workers


def test_cores_are_those_that_the_process_may_use(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3}, raising=False)
    assert processes.available_cores() == 1
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "process_cpu_count", lambda: 5, raising=False)
    assert processes.available_cores() == 5
    monkeypatch.delattr(os, "process_cpu_count")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert processes.available_cores() == 1


def test_the_commands_start_as_many_workers(monkeypatch, tmp_path):
    from chuteflow import maps as domains
    from chuteflow.cli.commands import sweep
    from chuteflow.paper import sources

    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    counts = [sweep._count(None)]

    def told(count):
        counts.append(count)
        raise KeyboardInterrupt

    monkeypatch.setattr(domains, "domain", lambda *_, workers, **__: told(workers))
    monkeypatch.setattr(sources, "source", lambda _, workers: told(workers))
    assert main(["domain", "--slope", "0.1:0.5", "--e", "0.7:0.9", "--ew", "0.8", "--roughness", "0.6"]) == 130
    assert main(["figures", "--out", str(tmp_path)]) == 130
    assert main(["report", "--out", str(tmp_path)]) == 130
    assert counts == [3, 3, 3, 3]


def test_workers_have_one_thread_and_leave_interrupts_to_their_parent():
    before = dict(os.environ)
    with processes.worker_pool(1) as pool:
        variables = [pool.submit(os.getenv, name).result() for name in threads.VARIABLES]
        handler = pool.submit(signal.getsignal, signal.SIGINT).result()
        blocked = pool.submit(signal.pthread_sigmask, signal.SIG_BLOCK, []).result()
        assert dict(os.environ) == before
    assert set(variables) == {"1"}
    assert handler == signal.SIG_IGN
    # Held back from before the first line of Python, so that importing is not interrupted either.
    assert signal.SIGINT in blocked


def test_a_worker_that_would_run_the_script_again_ends(monkeypatch):
    ended = []
    monkeypatch.setattr(os, "_exit", ended.append)
    monkeypatch.setattr(current_process(), "_inheriting", True, raising=False)
    processes.require_main_guard()
    assert ended == [processes._RUNS_SCRIPT]


@pytest.mark.parametrize(("guard", "code"), [("", 1), ('if __name__ == "__main__":\n    ', 0)])
def test_a_script_without_a_guard_is_told_so(tmp_path, guard, code):
    (tmp_path / "study.toml").write_text(STUDY.replace("100000", "24").replace("64", "12"))
    script = tmp_path / "script.py"
    script.write_text(
        "import sys\nfrom chuteflow.cli.program import main\n"
        f"{guard}sys.exit(main(['sweep', 'study.toml', '--out', 'study.zarr', '--workers', '2']))\n"
    )
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == code
    if code:
        assert done.stderr.count("\n") == 1
        assert 'put what the script does under if __name__ == "__main__":' in done.stderr
    else:
        assert "2 of 2 chunks" in done.stdout


@pytest.mark.parametrize(
    "end", ["SIGKILL", pytest.param("SIGTERM", marks=pytest.mark.slow), pytest.param("SIGHUP", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "name", ["domain", pytest.param("sweep", marks=pytest.mark.slow), pytest.param("mapped", marks=pytest.mark.slow)]
)
def test_no_worker_outlives_its_parent(tmp_path, name, end):
    process = started(LONG[name], tmp_path)
    try:
        limit = time.monotonic() + 60.0
        while sum("spawn_main" in line for line in left(process.pid)) < 2:
            assert time.monotonic() < limit
            time.sleep(0.05)
        process.send_signal(getattr(signal, end))
        process.communicate(timeout=30.0)
        none_left(process.pid)
    finally:
        if left(process.pid):
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


# Without what Windows has not

BLOCKED = """
import os, signal, sys
sys.modules["fcntl"] = None
for owner, name in ((os, "fork"), (os, "forkpty"), (os, "nice"), (os, "sched_getaffinity"), (os, "getppid"),
                    (signal, "pthread_sigmask"), (signal, "pthread_kill"), (signal, "SIGHUP")):
    if hasattr(owner, name):
        delattr(owner, name)
"""


@pytest.fixture
def bare(tmp_path, monkeypatch):
    """Processes started from here have no fcntl, fork, nice, affinity nor signal masks."""
    folder = tmp_path / "site"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(BLOCKED)
    paths = (str(folder), *filter(None, [os.environ.get("PYTHONPATH")]))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    trial = subprocess.run([sys.executable, "-c", "import fcntl"], capture_output=True, check=False)
    assert trial.returncode == 1


@pytest.mark.usefixtures("bare")
def test_a_sweep_needs_nothing_that_windows_lacks(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY.replace("100000", "24").replace("64", "12"))
    command = [sys.executable, "-m", "chuteflow", *LONG["sweep"].split()]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "2 of 2 chunks" in done.stdout


@pytest.mark.usefixtures("bare")
def test_the_explorer_needs_nothing_that_windows_lacks(served):
    from urllib.request import urlopen

    with served() as address, urlopen(f"{address}ask/flows?slope=0.3&e=0.8&ew=0.8&roughness=0.6&Q=3") as answer:
        assert answer.status == 200


# At any time


@pytest.mark.parametrize("name", ["sweep", "claims"])
def test_a_command_ends_soon_after_two_interrupts(tmp_path, name):
    code, _, told = interrupted(name, tmp_path / name, 2.5, (0.005,)) or (None, 0.0, "")
    require_clean_end(name, code, told, tmp_path / name)


@pytest.mark.slow
def test_interrupts_at_any_time(tmp_path, capsys):
    count, rng = int(os.environ.get("CHUTEFLOW_FUZZ_INTERRUPTS", "22")), random.Random(12)
    spent, before, over = [], 0, 0
    for i in range(count):
        name = list(LONG)[i % len(LONG)]
        gaps = [rng.choice((0.0, 0.002, 0.02, 0.2)) * rng.random() for _ in range(rng.randrange(3))]
        folder = tmp_path / str(i)
        ended = interrupted(name, folder, rng.choice((0.4, 1.0, 2.0, 5.0)) * (0.4 + rng.random()), gaps)
        if ended is None:
            over += 1
            continue
        code, seconds, told = ended
        if (code == -signal.SIGINT and not told) or ("Traceback" in told and " in run\n" not in told):
            before += 1  # Python itself was still starting
            continue
        require_clean_end(name, code, told, folder)
        spent.append((seconds, name))
    assert max(spent)[0] < 5.0, max(spent)
    assert before < 0.1 * count
    with capsys.disabled():
        slow = sum(seconds > 2.0 for seconds, _ in spent)
        print(f"\ninterrupts: {len(spent)}, the longest {max(spent)}, {slow} over 2 s")
        print(f"before Python had started: {before}; after the command was over: {over}")
