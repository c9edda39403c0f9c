"""Running a study: chunks handed out to workers, one machine's or a cluster's, until all are done.

Workers write their chunks themselves, so that nothing but the marker of a chunk comes back, and memory is bounded
by the chunks at work. Chunks are handed out in a window that moves on, so that neither is the study itself ever
held as a list of tasks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any

from chuteflow.errors import InputError
from chuteflow.extras import require
from chuteflow.processes import WorkerPool, death, worker_pool
from chuteflow.sweeps.store import Marker, Store, StoreError
from chuteflow.sweeps.work import work

#: Chunks handed out for each worker: one at work and one waiting.
_AHEAD = 2
#: Workers at most.
_MOST_WORKERS = 1024
#: A chunk that ends this many workers is given up.
_MOST_DEATHS = 3


@dataclass(frozen=True)
class Workers:
    """``count`` workers, how to ``start`` them, also where some died, and what is raised when one has: ``deaths``."""

    count: int
    start: Callable[[], AbstractContextManager[Executor]]
    deaths: tuple[type[BaseException], ...] = (BrokenExecutor,)


def local_workers(count: int) -> Workers:
    """Processes of this machine.

    Raises:
        InputError: for a count below 1 or above 1024.
    """
    require_count(count)
    return Workers(count, lambda: worker_pool(count))


def require_count(count: int) -> None:
    """Check a number of workers.

    Raises:
        InputError: where it is below 1 or above 1024.
    """
    if count < 1:
        raise InputError(f"--workers {count}: must be 1 or more")
    if count > _MOST_WORKERS:
        raise InputError(f"--workers {count}: must be {_MOST_WORKERS} or less")


def cluster_workers(address: str) -> Workers:
    """The workers of the dask.distributed scheduler at ``address``, which must see the store under its path.

    Raises:
        InputError: where dask.distributed is not installed, or nothing answers at the address.
    """
    import logging
    from concurrent.futures import CancelledError

    require("distributed", "cluster", "--cluster")
    from distributed import Client, KilledWorker
    from distributed.client import FutureCancelledError

    # What is lost on the way is told here, in a line.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)

    def connected() -> Any:
        return Client(address, timeout=10, set_as_default=False)

    try:
        with connected() as client:
            count = max(sum(client.nthreads().values()), 1)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"--cluster {address}: no scheduler answers there ({error or 'timed out'})") from None

    @contextmanager
    def start() -> Iterator[Executor]:
        try:
            client = connected()
        except OSError:
            raise StoreError(
                f"the scheduler at {address} does not answer any more; what is done is kept, and the same command goes "
                "on from there"
            ) from None
        with client:
            # Keyed by itself, a chunk that another client handed out before would not run.
            executor = client.get_executor(pure=False, retries=_MOST_DEATHS)
            try:
                yield executor
            finally:
                executor.shutdown(wait=False)

    return Workers(count, start, (BrokenExecutor, KilledWorker, FutureCancelledError, CancelledError))


def run(store: Store, chunks: Iterable[int], workers: Workers) -> Iterator[Marker]:
    """Compute the ``chunks`` that are not done, and yield the marker of each as it is.

    Raises:
        StoreError: where a chunk cannot be written, or ends its worker again and again.
        WorkerError: where workers cannot start.
    """
    deaths: Counter[int] = Counter()
    left = _RemainingChunks(iter(chunks), store)
    while True:
        with workers.start() as executor:
            broken = yield from _until_broken(store, left, executor, workers, deaths)
        if not broken:
            return


class _RemainingChunks:
    """The chunks that are still to be handed out, those that came back first."""

    def __init__(self, chunks: Iterator[int], store: Store) -> None:
        self._chunks, self._store = chunks, store
        self._again: list[int] = []

    def back(self, chunk: int) -> None:
        self._again.append(chunk)

    def next(self) -> int | None:
        if self._again:
            return self._again.pop()
        for chunk in self._chunks:
            if not self._store.is_done(chunk):
                return chunk
        return None


def _until_broken(
    store: Store, left: _RemainingChunks, executor: Executor, workers: Workers, deaths: Counter[int]
) -> Iterator[Marker]:
    """Hand out chunks until none is left, which returns False, or the workers have died, which returns True."""
    out: dict[Future[Marker], int] = {}
    path = str(store.path.resolve())
    broken = False
    while True:
        while not broken and len(out) < _AHEAD * workers.count:
            chunk = left.next()
            if chunk is None:
                break
            try:
                out[executor.submit(work, path, chunk)] = chunk
            except workers.deaths:
                left.back(chunk)
                broken = True
        if not out:
            return broken
        for future in wait(out, return_when=FIRST_COMPLETED).done:
            chunk = out.pop(future)
            try:
                marker = future.result()
            except workers.deaths:
                broken = True
                if isinstance(executor, WorkerPool) and executor.cannot_start:
                    raise death(executor) from None
                deaths[chunk] += 1
                if deaths[chunk] > _MOST_DEATHS * workers.count:
                    raise StoreError(
                        f"chunk {chunk} ended its worker {deaths[chunk]} times: give the study a smaller chunk, or the "
                        "workers more memory"
                    ) from None
                left.back(chunk)
            except MemoryError:
                raise StoreError(f"chunk {chunk} found too little memory: give the study a smaller chunk") from None
            except OSError as error:
                raise StoreError(
                    f"chunk {chunk} could not be written: {error.strerror or error}; what is done is kept, and the "
                    "same command goes on from there"
                ) from None
            else:
                yield marker
