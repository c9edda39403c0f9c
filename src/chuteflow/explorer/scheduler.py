"""Which question is computed next and by which process, so that no client waits for the slow questions of others."""

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
from chuteflow.explorer.answers import Answer, answer, left_out, problem
from chuteflow.explorer.worker import Compute, Ended, Limits, Worker
from chuteflow.processes import available_cores

#: Tells whether who asked is gone.
Gone = Callable[[], Awaitable[bool]]
#: Who asks: an address and a port of it, so that one address may be several clients.
Client = tuple[str, int]
_Key = tuple[str, frozenset[tuple[str, str]]]
P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Lane:
    """Processes for one class of questions: how many at most, by how much they give way, and whether they run from
    the start."""

    workers: int
    nice: int
    early: bool = False


@dataclass(frozen=True)
class Stage:
    """Where a question is computed, and within which limits; by the clock there is time for what else runs."""

    lane: str
    limits: Limits


def lanes() -> dict[str, Lane]:
    """The lanes of this machine. Each has two processes or more, so that one slow question leaves another free."""
    quick = max(2, min(4, available_cores()))
    return {
        "quick": Lane(quick, 0, early=True),
        "slow": Lane(2, 10, early=True),
        "drawing": Lane(2, 8),
        "stability": Lane(2, 12),
    }


#: Where each question is computed first, and where again if that was too short.
STAGES: Mapping[str, tuple[Stage, ...]] = {
    "flows": (Stage("quick", Limits(0.3, 1.5)), Stage("slow", Limits(1.6, 16.0))),
    "curve": (Stage("quick", Limits(0.3, 1.5)), Stage("slow", Limits(1.6, 16.0))),
    "limits": (Stage("slow", Limits(2.0, 20.0)),),
    "map": (Stage("drawing", Limits(2.0, 20.0)),),
    "export": (Stage("drawing", Limits(20.0, 100.0)),),
    "stability": (Stage("stability", Limits(20.0, 100.0)),),
}
#: Answers that are remembered, questions of one address that are in work or wait, and clients whose turn is known.
_REMEMBERED, _OF_ONE_ADDRESS, _KNOWN = 512, 256, 4096
#: Seconds after which it is looked again whether anybody still waits for an answer, and that a question may wait for
#: a worker.
_PATIENCE, _LONGEST_WAIT = 0.25, 20.0
#: Why there is no answer although there might be one.
_TOO_BUSY = "this machine is too busy now, ask again later"


@dataclass(eq=False)
class _Job:
    """A question, asked by one client or several, on its way to its answer."""

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


class _Crew:
    """The workers of a lane, and the questions that wait for them."""

    def __init__(self, lane: Lane, compute: Compute) -> None:
        warm = _first_questions() if compute is answer else ()
        self.workers = [Worker(nice=lane.nice, warm=warm, compute=compute) for _ in range(lane.workers)]
        # The one used last is used next, so that others start only where it does not suffice.
        self.free: list[Worker] = []
        self.cold = deque(self.workers)
        # One at a time starts, so that the first is ready as soon as can be.
        self.starting = False
        self.waiting: list[_Job] = []
        self.early = lane.early


def _first_questions() -> tuple[tuple[str, Mapping[str, str]], ...]:
    """What the page asks as it opens."""
    first = {name: str(value) for name, value in queries.PRESETS[0].state.items()}
    return ("flows", first), ("curve", {name: value for name, value in first.items() if name != "Q"})


class Scheduler:
    """Hands questions to workers: clients take turns, equal questions are computed once, answers are remembered.

    A question that takes too long in the lane for quick ones goes to the one for slow ones, which gives way.
    """

    def __init__(self, compute: Compute = answer) -> None:
        self._crews = {name: _Crew(lane, compute) for name, lane in lanes().items()}
        self._threads = ThreadPoolExecutor(sum(len(crew.workers) for crew in self._crews.values()))
        self._under_way: dict[_Key, _Job] = {}
        self._remembered: OrderedDict[_Key, Answer] = OrderedDict()
        self._of_address: Counter[str] = Counter()
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
        """Start the processes that are to run early, and ask them what the page asks as it opens."""
        for crew in self._crews.values():
            self._start_next(crew)
        for question, query in _first_questions():
            self._spawn(self._asked_ahead(question, query))

    async def ask(self, question: str, query: Mapping[str, str], client: Client, gone: Gone | None = None) -> Answer:
        """The answer, remembered or computed, or one that says what is left out and why."""
        key = question, frozenset(query.items())
        known = self._remembered.get(key)
        if known is not None:
            self._remembered.move_to_end(key)
            return known
        if self._closed:
            return problem(503, "the explorer is ending")
        address = client[0]
        if self._of_address[address] >= _OF_ONE_ADDRESS:
            return problem(503, f"{_OF_ONE_ADDRESS} questions of {address} wait already: ask again in a moment")
        self._of_address[address] += 1
        try:
            return await self._waited_for(self._job(key, query, client), gone)
        finally:
            self._of_address[address] -= 1
            if not self._of_address[address]:
                del self._of_address[address]

    def close(self) -> None:
        """End the processes; whoever waits is told so."""
        self._closed = True
        for crew in self._crews.values():
            for worker in crew.workers:
                worker.close()
        for job in list(self._under_way.values()):
            self._finish(job, problem(503, "the explorer is ending"))
        self._threads.shutdown(wait=False, cancel_futures=True)

    # --- one question ---------------------------------------------------------------------------------------------

    def _job(self, key: _Key, query: Mapping[str, str], client: Client) -> _Job:
        job = self._under_way.get(key)
        if job is None:
            job = self._under_way[key] = _Job(key, dict(query), client, next(self._count))
            self._queue(job)
        return job

    async def _waited_for(self, job: _Job, gone: Gone | None) -> Answer:
        job.waits += 1
        try:
            while not (await asyncio.wait({job.given}, timeout=_PATIENCE))[0]:
                if gone is not None and await gone():
                    return problem(499, "nobody waits for this answer")
                self._give_up_waiting(job)
            return job.given.result()
        finally:
            job.waits -= 1
            if not job.waits and not job.given.done():
                self._take_back(job)

    def _give_up_waiting(self, job: _Job) -> None:
        waiting = self._crews[job.at.lane].waiting
        if self._ready is None or job not in waiting:
            return
        if asyncio.get_running_loop().time() - max(job.since, self._ready) > _LONGEST_WAIT:
            waiting.remove(job)
            self._finish(job, left_out(job.question, job.query, _TOO_BUSY))

    def _take_back(self, job: _Job) -> None:
        waiting = self._crews[job.at.lane].waiting
        if job in waiting:
            waiting.remove(job)
            del self._under_way[job.key]
        elif job.worker is not None:
            job.worker.take_back(job)

    def _finish(self, job: _Job, given: Answer, *, remember: bool = False) -> None:
        self._under_way.pop(job.key, None)
        if not job.given.done():
            job.given.set_result(given)
        if remember and given.name is None:
            self._remembered[job.key] = given
            if len(self._remembered) > _REMEMBERED:
                self._remembered.popitem(last=False)

    # --- turns ------------------------------------------------------------------------------------------------------

    def _queue(self, job: _Job) -> None:
        crew = self._crews[job.at.lane]
        job.since = asyncio.get_running_loop().time()
        crew.waiting.append(job)
        self._dispatch(crew)

    def _dispatch(self, crew: _Crew) -> None:
        """Give free workers to those who wait, and start more where none is free."""
        while crew.waiting and crew.free and not self._closed:
            job = min(crew.waiting, key=self._turn)
            crew.waiting.remove(job)
            address = job.client[0]
            for who in (address, job.client):
                self._turns[who] = next(self._count)
                self._turns.move_to_end(who)
            while len(self._turns) > _KNOWN:
                self._turns.popitem(last=False)
            self._spawn(self._work(crew, crew.free.pop(), job))
        self._start_next(crew)

    def _start_next(self, crew: _Crew) -> None:
        """Start one more worker where some wait, or where all are to run from the start."""
        if self._first_starts or self._closed:
            return
        if crew.cold and (crew.waiting or crew.early) and not crew.starting:
            crew.starting = True
            self._first_starts = self._ready is None
            self._spawn(self._started(crew, crew.cold.popleft()))

    async def _started(self, crew: _Crew, worker: Worker) -> None:
        if self._closed:
            return
        await self._run(worker.start)
        crew.starting = False
        crew.free.append(worker)
        if self._ready is None:
            self._first_starts, self._ready = False, asyncio.get_running_loop().time()
            for other in self._crews.values():
                self._dispatch(other)
        else:
            self._dispatch(crew)

    def _turn(self, job: _Job) -> tuple[int, int, int]:
        """Next is the address that was served longest ago, then its client, then the question that came first."""
        return self._turns.get(job.client[0], 0), self._turns.get(job.client, 0), job.number

    async def _work(self, crew: _Crew, worker: Worker, job: _Job) -> None:
        if self._closed:
            return
        job.worker = worker
        try:
            outcome = await self._run(worker.put, job, job.question, job.query, job.at.limits)
        finally:
            job.worker = None
        if self._closed:  # all who wait have been told
            return
        self._settle(job, outcome)
        if outcome in (Ended.BROKEN, Ended.TOO_LONG):
            await self._run(worker.start)  # unless it has gone on
        crew.free.append(worker)
        self._dispatch(crew)

    async def _run(self, work: Callable[P, R], *arguments: P.args, **named: P.kwargs) -> R:
        """Do in a thread what waits for a process."""
        return await asyncio.get_running_loop().run_in_executor(self._threads, partial(work, *arguments, **named))

    def _settle(self, job: _Job, outcome: Answer | Ended) -> None:
        stages = STAGES[job.question]
        last = job.stage + 1 == len(stages)
        if isinstance(outcome, Answer):
            self._finish(job, outcome, remember=True)
        elif not job.waits:
            self._under_way.pop(job.key, None)
        elif outcome in (Ended.TOO_LONG, Ended.BUSY) and not last:
            job.stage += 1
            self._queue(job)
        elif outcome is Ended.TOO_LONG:
            limit = sum(stage.limits.processor for stage in stages)
            why = f"not done within {limit:.2g} seconds of computing; the command line has no such limit"
            self._finish(job, left_out(job.question, job.query, why), remember=True)
        elif outcome is Ended.BUSY:
            self._finish(job, left_out(job.question, job.query, _TOO_BUSY))
        elif outcome is Ended.TAKEN_BACK or not job.broken:
            job.broken = outcome is Ended.BROKEN
            self._queue(job)
        else:
            self._finish(job, problem(500, "the computation broke off twice: ask again"))

    async def _asked_ahead(self, question: str, query: Mapping[str, str]) -> None:
        await self.ask(question, query, ("", 0))

    def _spawn(self, work: Awaitable[None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
