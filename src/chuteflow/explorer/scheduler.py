"""Which question is computed next and by which process: no client waits for the slow questions of others."""

from __future__ import annotations

import asyncio
import itertools
from collections import Counter, OrderedDict, deque
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import ParamSpec, TypeVar

from chuteflow.explorer import queries
from chuteflow.explorer.answers import Answer, answer, leave_out, problem
from chuteflow.explorer.worker import Compute, Limits, NoAnswer, Worker
from chuteflow.processes import available_cores

#: Whether the client has disconnected.
Disconnected = Callable[[], Awaitable[bool]]
#: A client: an address and a port, so that one address may have several clients.
Client = tuple[str, int]
_Key = tuple[str, frozenset[tuple[str, str]]]
P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class PoolSettings:
    """Processes for one class of questions: their largest number, niceness, and whether they run from the start."""

    workers: int
    nice: int
    early: bool = False


@dataclass(frozen=True)
class Stage:
    """The pool that computes a question, and the time limits; the limit by the clock allows for other processes."""

    pool: str
    limits: Limits


def pool_settings() -> dict[str, PoolSettings]:
    """The worker pools of this machine. Each has two processes or more: one slow question leaves another free."""
    quick = max(2, min(4, available_cores()))
    return {
        "quick": PoolSettings(quick, 0, early=True),
        "slow": PoolSettings(2, 10, early=True),
        "drawing": PoolSettings(2, 8),
        "stability": PoolSettings(2, 12),
    }


#: The pools that try to compute each question, in order, the next where the time limit was too short.
STAGES: Mapping[str, tuple[Stage, ...]] = {
    "flows": (Stage("quick", Limits(0.3, 1.5)), Stage("slow", Limits(1.6, 16.0))),
    "curve": (Stage("quick", Limits(0.3, 1.5)), Stage("slow", Limits(1.6, 16.0))),
    "limits": (Stage("slow", Limits(2.0, 20.0)),),
    "map": (Stage("drawing", Limits(2.0, 20.0)),),
    "export": (Stage("drawing", Limits(20.0, 100.0)),),
    "data": (Stage("drawing", Limits(5.0, 30.0)),),
    "stability": (Stage("stability", Limits(20.0, 100.0)),),
}
#: Answers in the cache, questions of one address that are computed or wait, and clients whose turn is known: at most.
_CACHED, _OF_ONE_ADDRESS, _KNOWN = 512, 256, 4096
#: Seconds between two checks whether the client is still connected, and that a question may wait for a worker.
_POLL, _LONGEST_WAIT = 0.25, 20.0
#: Why there is no answer although there might be one.
_TOO_BUSY = "this machine is too busy now, ask again later"


@dataclass(eq=False)
class _Job:
    """A question of one client or several that has no answer yet."""

    key: _Key
    query: Mapping[str, str]
    client: Client
    number: int
    given: asyncio.Future[Answer] = field(default_factory=lambda: asyncio.get_running_loop().create_future())
    stage: int = 0
    since: float = 0.0
    waits: int = 0
    broken: bool = False
    worker: Worker | None = None

    @property
    def question(self) -> str:
        return self.key[0]

    @property
    def at(self) -> Stage:
        return STAGES[self.question][self.stage]


class _Pool:
    """The workers of a pool, and the questions that wait for them."""

    def __init__(self, settings: PoolSettings, compute: Compute) -> None:
        warm_up = _first_questions() if compute is answer else ()
        self.workers = [Worker(nice=settings.nice, warm_up=warm_up, compute=compute) for _ in range(settings.workers)]
        # The worker used last is used next, so that others start only when needed.
        self.idle: list[Worker] = []
        self.not_started = deque(self.workers)
        # One starts at a time, so that the first is ready as early as possible.
        self.starting = False
        self.waiting: list[_Job] = []
        self.early = settings.early


def _first_questions() -> tuple[tuple[str, Mapping[str, str]], ...]:
    """What the page asks as it opens."""
    first = {name: str(value) for name, value in queries.PRESETS[0].state.items()}
    return ("flows", first), ("curve", {name: value for name, value in first.items() if name != "Q"})


class Scheduler:
    """Hands questions to workers: clients take turns, equal questions are computed once, answers are cached.

    A question that takes too long in the pool for quick ones goes to the pool for slow ones, of lower priority.
    """

    def __init__(self, compute: Compute = answer) -> None:
        self._pools = {name: _Pool(settings, compute) for name, settings in pool_settings().items()}
        self._threads = ThreadPoolExecutor(sum(len(pool.workers) for pool in self._pools.values()))
        self._running: dict[_Key, _Job] = {}
        self._cache: OrderedDict[_Key, Answer] = OrderedDict()
        self._per_address: Counter[str] = Counter()
        # When an address, and a client of it, was last given a worker.
        self._turns: OrderedDict[str | Client, int] = OrderedDict()
        self._count = itertools.count(1)
        self._tasks: set[asyncio.Task[None]] = set()
        self._closed = False
        # The first worker starts alone: where the search has to be compiled, the others load what it has compiled.
        self._first_starts = False
        # Since when questions wait for a worker, and no longer for the first one to be ready.
        self._ready: float | None = None

    def start(self) -> None:
        """Start the processes that run from the beginning, and compute what the page asks as it opens."""
        for pool in self._pools.values():
            self._start_next(pool)
        for question, query in _first_questions():
            self._spawn(self._prefetch(question, query))

    async def ask(
        self, question: str, query: Mapping[str, str], client: Client, disconnected: Disconnected | None = None
    ) -> Answer:
        """The answer, from the cache or computed, or one that says what is left out and why."""
        key = question, frozenset(query.items())
        known = self._cache.get(key)
        if known is not None:
            self._cache.move_to_end(key)
            return known
        if self._closed:
            return problem(503, "the explorer is ending")
        address = client[0]
        if self._per_address[address] >= _OF_ONE_ADDRESS:
            return problem(503, f"{_OF_ONE_ADDRESS} questions of {address} wait already: ask again in a moment")
        self._per_address[address] += 1
        try:
            return await self._wait_for(self._job(key, query, client), disconnected)
        finally:
            self._per_address[address] -= 1
            if not self._per_address[address]:
                del self._per_address[address]

    def close(self) -> None:
        """End the processes, and answer waiting clients that the explorer ends."""
        self._closed = True
        for pool in self._pools.values():
            for worker in pool.workers:
                worker.close()
        for job in list(self._running.values()):
            self._finish(job, problem(503, "the explorer is ending"))
        self._threads.shutdown(wait=False, cancel_futures=True)

    # --- one question ---------------------------------------------------------------------------------------------

    def _job(self, key: _Key, query: Mapping[str, str], client: Client) -> _Job:
        job = self._running.get(key)
        if job is None:
            job = self._running[key] = _Job(key, dict(query), client, next(self._count))
            self._queue(job)
        return job

    async def _wait_for(self, job: _Job, disconnected: Disconnected | None) -> Answer:
        job.waits += 1
        try:
            while not (await asyncio.wait({job.given}, timeout=_POLL))[0]:
                if disconnected is not None and await disconnected():
                    return problem(499, "the request was cancelled")
                self._time_out(job)
            return job.given.result()
        finally:
            job.waits -= 1
            if not job.waits and not job.given.done():
                self._cancel(job)

    def _time_out(self, job: _Job) -> None:
        waiting = self._pools[job.at.pool].waiting
        if self._ready is None or job not in waiting:
            return
        if asyncio.get_running_loop().time() - max(job.since, self._ready) > _LONGEST_WAIT:
            waiting.remove(job)
            self._finish(job, leave_out(job.question, job.query, _TOO_BUSY))

    def _cancel(self, job: _Job) -> None:
        waiting = self._pools[job.at.pool].waiting
        if job in waiting:
            waiting.remove(job)
            del self._running[job.key]
        elif job.worker is not None:
            job.worker.cancel(job)

    def _finish(self, job: _Job, given: Answer, *, cache: bool = False) -> None:
        self._running.pop(job.key, None)
        if not job.given.done():
            job.given.set_result(given)
        # Neither files to download nor those that were sent are worth the space.
        if cache and given.name is None and job.question != "data":
            self._cache[job.key] = given
            if len(self._cache) > _CACHED:
                self._cache.popitem(last=False)

    # --- turns ------------------------------------------------------------------------------------------------------

    def _queue(self, job: _Job) -> None:
        pool = self._pools[job.at.pool]
        job.since = asyncio.get_running_loop().time()
        pool.waiting.append(job)
        self._dispatch(pool)

    def _dispatch(self, pool: _Pool) -> None:
        """Assign waiting questions to idle workers, and start more workers where none is idle."""
        while pool.waiting and pool.idle and not self._closed:
            job = min(pool.waiting, key=self._turn)
            pool.waiting.remove(job)
            address = job.client[0]
            for who in (address, job.client):
                self._turns[who] = next(self._count)
                self._turns.move_to_end(who)
            while len(self._turns) > _KNOWN:
                self._turns.popitem(last=False)
            self._spawn(self._work(pool, pool.idle.pop(), job))
        self._start_next(pool)

    def _start_next(self, pool: _Pool) -> None:
        """Start one more worker where questions wait, or where all workers run from the start."""
        if self._first_starts or self._closed:
            return
        if pool.not_started and (pool.waiting or pool.early) and not pool.starting:
            pool.starting = True
            self._first_starts = self._ready is None
            self._spawn(self._start_worker(pool, pool.not_started.popleft()))

    async def _start_worker(self, pool: _Pool, worker: Worker) -> None:
        if self._closed:
            return
        await self._run(worker.start)
        pool.starting = False
        pool.idle.append(worker)
        if self._ready is None:
            self._first_starts, self._ready = False, asyncio.get_running_loop().time()
            for other in self._pools.values():
                self._dispatch(other)
        else:
            self._dispatch(pool)

    def _turn(self, job: _Job) -> tuple[int, int, int]:
        """Next is the address that was served longest ago, then its client, then the question that came first."""
        return self._turns.get(job.client[0], 0), self._turns.get(job.client, 0), job.number

    async def _work(self, pool: _Pool, worker: Worker, job: _Job) -> None:
        if self._closed:
            return
        job.worker = worker
        try:
            outcome = await self._run(worker.put, job, job.question, job.query, job.at.limits)
        finally:
            job.worker = None
        if self._closed:  # all who wait have an answer
            return
        self._handle(job, outcome)
        if outcome in (NoAnswer.CRASHED, NoAnswer.TOO_LONG):
            await self._run(worker.start)  # unless it still runs
        pool.idle.append(worker)
        self._dispatch(pool)

    async def _run(self, work: Callable[P, R], *arguments: P.args, **named: P.kwargs) -> R:
        """Run blocking ``work`` in a thread."""
        return await asyncio.get_running_loop().run_in_executor(self._threads, partial(work, *arguments, **named))

    def _handle(self, job: _Job, outcome: Answer | NoAnswer) -> None:
        stages = STAGES[job.question]
        last = job.stage + 1 == len(stages)
        if isinstance(outcome, Answer):
            self._finish(job, outcome, cache=True)
        elif not job.waits:
            self._running.pop(job.key, None)
        elif outcome in (NoAnswer.TOO_LONG, NoAnswer.BUSY) and not last:
            job.stage += 1
            self._queue(job)
        elif outcome is NoAnswer.TOO_LONG:
            limit = sum(stage.limits.processor for stage in stages)
            why = f"not done within {limit:.2g} seconds of computing; the command line has no such limit"
            self._finish(job, leave_out(job.question, job.query, why), cache=True)
        elif outcome is NoAnswer.BUSY:
            self._finish(job, leave_out(job.question, job.query, _TOO_BUSY))
        elif outcome is NoAnswer.CANCELLED or not job.broken:
            job.broken = outcome is NoAnswer.CRASHED
            self._queue(job)
        else:
            self._finish(job, problem(500, "the computation broke off twice: ask again"))

    async def _prefetch(self, question: str, query: Mapping[str, str]) -> None:
        await self.ask(question, query, ("", 0))

    def _spawn(self, work: Awaitable[None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
