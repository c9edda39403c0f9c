"""A sweep on a dask.distributed scheduler with two workers, one of which is killed."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from chuteflow.errors import InputError
from chuteflow.sweeps.runner import cluster_workers, run
from chuteflow.sweeps.store import Store, StoreError
from chuteflow.sweeps.study import from_dict


@contextmanager
def process(*arguments, folder):
    started = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield started
    finally:
        started.kill()
        started.wait()


def waited_for(true, seconds=120.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


@contextmanager
def cluster(folder):
    """Address, scheduler and two workers, processes of their own."""
    file = folder / "scheduler.json"
    own = ["--host", "127.0.0.1", "--no-dashboard"]
    with process("dask_scheduler", "--port", "0", "--scheduler-file", str(file), *own, folder=folder) as scheduler:
        waited_for(file.exists)
        address = json.loads(file.read_text())["address"]
        worker = ["dask_worker", address, "--nthreads", "1", "--no-nanny", *own]
        with process(*worker, folder=folder) as one, process(*worker, folder=folder) as two:
            waited_for(lambda: cluster_workers(address).count == 2)
            yield address, scheduler, (one, two)


@pytest.mark.slow
def test_a_cluster_computes_the_same_and_survives_the_loss_of_a_worker(tmp_path, table, whole, fingerprint):
    store = Store.made(tmp_path / "cluster.zarr", from_dict(table(), Path()))
    with cluster(tmp_path) as (address, scheduler, (one, _)):
        markers = []
        for marker in run(store, range(store.study.chunks), cluster_workers(address)):
            if not markers:
                os.kill(one.pid, signal.SIGKILL)
            markers.append(marker.chunk)
        assert sorted(markers) == list(range(store.study.chunks))
        assert fingerprint(store.path) == fingerprint(whole.path)

        # A scheduler that dies is told, and what is done is kept.
        other = Store.made(tmp_path / "other.zarr", from_dict(table(points=480), Path()))
        left = run(other, range(other.study.chunks), cluster_workers(address))
        next(left)
        scheduler.kill()
        with pytest.raises(StoreError, match="does not answer any more; what is done is kept"):
            list(left)
        assert 0 < len(other.done()) < other.study.chunks


@pytest.mark.slow
def test_an_address_where_nothing_answers_is_told():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(InputError, match="no scheduler answers there"):
        cluster_workers(address)
