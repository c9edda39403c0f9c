"""Running a study: workers that die, and that the result is the same whatever happens."""

import os
import signal
from pathlib import Path

import pytest

from chuteflow.errors import InputError
from chuteflow.sweeps import runner
from chuteflow.sweeps.runner import Workers, local_workers, run
from chuteflow.sweeps.store import Store, StoreError
from chuteflow.sweeps.study import from_dict


@pytest.fixture
def fresh(tmp_path, table):
    return Store.made(tmp_path / "fresh.zarr", from_dict(table(), Path()))


def test_a_worker_that_is_killed_loses_nothing(fresh, whole, fingerprint):
    from multiprocessing import active_children

    markers = []
    for marker in run(fresh, range(fresh.study.chunks), local_workers(2)):
        if not markers:
            for child in active_children():
                assert child.pid is not None
                os.kill(child.pid, signal.SIGKILL)
        markers.append(marker.chunk)
    assert sorted(markers) == [0, 1, 2, 3]
    assert fingerprint(fresh.path) == fingerprint(whole.path)
    assert not active_children()


class Pool:
    """Workers in this process, with what each chunk ends with."""

    def __init__(self, ends):
        self.ends, self.started = ends, 0

    def workers(self):
        from concurrent.futures import ThreadPoolExecutor

        def start():
            self.started += 1
            return ThreadPoolExecutor(2)

        return Workers(2, start)

    def work(self, path, chunk):
        end = self.ends(chunk)
        if end is not None:
            raise end
        return runner.work(path, chunk)


def test_a_chunk_that_kills_every_worker_is_given_up(monkeypatch, fresh):
    from concurrent.futures import BrokenExecutor

    pool = Pool(lambda _: BrokenExecutor("gone"))
    monkeypatch.setattr(runner, "work", pool.work)
    with pytest.raises(StoreError, match=r"chunk \d ended its worker 7 times: give the study a smaller chunk"):
        list(run(fresh, range(4), pool.workers()))
    assert pool.started > 3


@pytest.mark.parametrize(
    ("end", "message"),
    [
        (OSError(28, "No space left on device"), "could not be written: No space left on device; what is done is kept"),
        (MemoryError(), "chunk 0 found too little memory: give the study a smaller chunk"),
    ],
)
def test_what_stops_a_study_is_told(monkeypatch, fresh, end, message):
    pool = Pool(lambda _: end)
    monkeypatch.setattr(runner, "work", pool.work)
    with pytest.raises(StoreError, match=message):
        list(run(fresh, [0], pool.workers()))


def test_chunks_are_handed_out_in_a_window_that_moves_on(monkeypatch, fresh):
    handed = []

    def asked():
        for chunk in range(4):
            handed.append(chunk)
            yield chunk

    for count, _ in enumerate(run(fresh, asked(), Pool(lambda _: None).workers()), 1):
        # Two workers: no more than two chunks at work and two waiting, besides those that came back.
        assert len(handed) <= count + 4
    assert handed == [0, 1, 2, 3]


def test_workers_are_at_least_one():
    with pytest.raises(InputError, match="--workers 0: must be 1 or more"):
        local_workers(0)
