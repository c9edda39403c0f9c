"""The explorer's workers and turns: bounded computations, refusals that are remembered, and who waits for whom."""

import asyncio
import json
import os
import time

import pytest

from chuteflow.explorer import scheduler as scheduling
from chuteflow.explorer.scheduler import Scheduler, Stage
from chuteflow.explorer.worker import Limits, NoAnswer, Worker

ONE, OTHER = ("127.0.0.1", 1), ("127.0.0.2", 2)


@pytest.fixture
def stages(monkeypatch):
    """Limits that are short."""
    short = {"curve": (Stage("quick", Limits(0.1, 20.0)), Stage("slow", Limits(0.3, 20.0)))}
    monkeypatch.setattr(scheduling, "STAGES", {**scheduling.STAGES, **short})


@pytest.fixture
def played(compute):
    """What a play with a scheduler returns."""

    def played(play):
        async def scene():
            scheduler = Scheduler(compute)
            try:
                return await play(scheduler)
            finally:
                scheduler.close()

        return asyncio.run(scene())

    return played


def does(what, **more):
    return {"do": what, **{name: str(value) for name, value in more.items()}}


def said(answer):
    return json.loads(answer.body)


def test_a_question_that_takes_too_long_is_refused_and_that_is_remembered(played, stages, tmp_path):
    query = does("loop", log=tmp_path / "log", name="a")

    async def play(scheduler):
        return [await scheduler.ask("curve", query, ONE) for _ in range(3)]

    answers = played(play)
    assert {answer.status for answer in answers} == {422}
    assert said(answers[0])["error"] == (
        "the curve of all flows is left out: not done within 0.4 seconds of computing; "
        "the command line has no such limit"
    )
    # Once as a quick question, once as a slow one, and never again.
    assert (tmp_path / "log").read_text().splitlines() == ["a curve", "a curve"]


def test_a_slow_question_holds_up_no_other_client(played, tmp_path):
    async def play(scheduler):
        slow = [asyncio.ensure_future(scheduler.ask("curve", does("loop", name=i), ONE)) for i in range(4)]
        # Each was tried as a quick question.
        await asyncio.sleep(0.5)
        while scheduler._pools["quick"].waiting:
            await asyncio.sleep(0.05)
        times = []
        for i in range(10):
            began = time.monotonic()
            answer = await scheduler.ask("curve", does("nap", seconds=0.01, name=i), OTHER)
            times.append(time.monotonic() - began)
            assert answer.status == 200
        assert not all(one.done() for one in slow)
        return times

    # One of the slow questions may be under way as a quick one.
    assert sorted(played(play))[5] < 0.5


def test_clients_take_turns(played, tmp_path):
    log = tmp_path / "log"

    async def play(scheduler):
        many = [scheduler.ask("map", does("nap", seconds=0.02, log=log, name=f"one-{i}"), ONE) for i in range(40)]
        under_way = asyncio.gather(*many)
        await asyncio.sleep(0)
        await scheduler.ask("map", does("nap", seconds=0, log=log, name="other"), OTHER)
        before = len(log.read_text().splitlines())
        await under_way
        return before

    # The questions in work go before, and those that were given out while the answer was on its way.
    assert played(play) < 10


def test_connections_of_one_address_take_turns(played, tmp_path):
    log = tmp_path / "log"

    async def play(scheduler):
        many = [scheduler.ask("map", does("nap", seconds=0.02, log=log, name=f"one-{i}"), ONE) for i in range(40)]
        under_way = asyncio.gather(*many)
        await asyncio.sleep(0)
        await scheduler.ask("map", does("nap", seconds=0, log=log, name="other"), (ONE[0], 2))
        before = len(log.read_text().splitlines())
        await under_way
        return before

    assert played(play) < 10


def test_equal_questions_are_computed_once(played, tmp_path):
    query = does("nap", seconds=0.2, log=tmp_path / "log", name="a")

    async def play(scheduler):
        return await asyncio.gather(*(scheduler.ask("map", query, (f"127.0.0.{i}", i)) for i in range(20)))

    assert {answer.status for answer in played(play)} == {200}
    assert (tmp_path / "log").read_text().splitlines() == ["a map"]


def test_a_flooding_client_is_refused_and_no_other(played, monkeypatch):
    monkeypatch.setattr(scheduling, "_OF_ONE_ADDRESS", 5)

    async def play(scheduler):
        flood = [scheduler.ask("map", does("nap", seconds=0.05, name=i), ONE) for i in range(12)]
        *flooding, other = await asyncio.gather(*flood, scheduler.ask("map", does("nap", seconds=0), OTHER))
        return flooding, other

    flooding, other = played(play)
    assert sorted(answer.status for answer in flooding) == 5 * [200] + 7 * [503]
    assert said(flooding[-1])["error"] == "5 questions of 127.0.0.1 wait already: ask again in a moment"
    assert other.status == 200


def test_who_waits_too_long_for_a_worker_is_told(played, monkeypatch):
    def naps(scheduler, seconds, client, name):
        return scheduler.ask("map", does("nap", seconds=seconds, name=name), client)

    async def play(scheduler):
        slow = [asyncio.ensure_future(naps(scheduler, 60.0, ONE, f"slow-{i}")) for i in range(2)]
        while sum(job.worker is not None for job in scheduler._running.values()) < 2:
            await asyncio.sleep(0.05)
        monkeypatch.setattr(scheduling, "_LONGEST_WAIT", 0.3)
        told = await naps(scheduler, 0.0, OTHER, "a")
        for one in slow:
            one.cancel()
        monkeypatch.setattr(scheduling, "_LONGEST_WAIT", 20.0)
        return told, await naps(scheduler, 0.0, OTHER, "a")

    told, again = played(play)
    assert (told.status, said(told)["error"]) == (
        422,
        "this column of the map is left out: this machine is too busy now, ask again later",
    )
    # That is not remembered.
    assert again.status == 200


@pytest.fixture
def starts(monkeypatch):
    """When each worker began to start and was ready; that takes as if there was something to compile."""
    spans = []

    class Slow(Worker):
        def start(self):
            if self.pid is None:
                began = time.monotonic()
                super().start()
                time.sleep(0.5)
                spans.append((began, time.monotonic()))

    monkeypatch.setattr(scheduling, "Worker", Slow)
    return spans


def test_the_first_worker_starts_alone(played, starts):
    async def play(scheduler):
        questions = ("curve", "map", "stability")
        return await asyncio.gather(*(scheduler.ask(question, does("nap", seconds=0), ONE) for question in questions))

    assert {answer.status for answer in played(play)} == {200}
    assert len(starts) >= 3
    assert all(began >= starts[0][1] for began, _ in starts[1:])


@pytest.mark.usefixtures("starts")
def test_waiting_for_the_first_worker_counts_for_no_question(played, monkeypatch):
    monkeypatch.setattr(scheduling, "_LONGEST_WAIT", 0.3)
    monkeypatch.setattr(scheduling, "_POLL", 0.05)
    assert played(lambda scheduler: scheduler.ask("map", does("nap", seconds=0), ONE)).status == 200


def test_every_worker_of_the_explorer_is_warmed_up_before_it_answers():
    scheduler = Scheduler()
    try:
        warm_up = [worker._warm_up for pool in scheduler._pools.values() for worker in pool.workers]
        assert all([question for question, _ in questions] == ["flows", "curve"] for questions in warm_up)
    finally:
        scheduler.close()


def test_what_nobody_waits_for_is_ended_or_not_begun(played, tmp_path):
    async def disconnected():
        return True

    async def play(scheduler):
        stages = [
            scheduler.ask("stability", does("loop", log=tmp_path / "log", name=i), ONE, disconnected) for i in range(8)
        ]
        left = await asyncio.gather(*stages)
        process = said(await scheduler.ask("stability", does("tell"), ONE))["process"]
        # The process that was ended goes on with the next question.
        assert process in [worker.pid for worker in scheduler._pools["stability"].workers]
        return {answer.status for answer in left}

    began = time.monotonic()
    assert played(play) == {499}
    assert time.monotonic() - began < 10.0
    assert not (tmp_path / "log").exists() or len((tmp_path / "log").read_text().splitlines()) <= 2


def test_a_question_that_is_asked_again_while_it_is_ended_is_answered(played):
    async def play(scheduler):
        query, leaves = does("nap", seconds=1.0), asyncio.Event()

        async def disconnected():
            return leaves.is_set()

        first = asyncio.ensure_future(scheduler.ask("stability", query, ONE, disconnected))
        while not any(job.worker for job in scheduler._running.values()):
            await asyncio.sleep(0.05)
        leaves.set()
        assert (await first).status == 499
        return await scheduler.ask("stability", query, OTHER)

    assert played(play).status == 200


def test_a_process_that_dies_is_replaced_and_the_question_tried_once_more(played, tmp_path):
    log = tmp_path / "log"

    async def play(scheduler):
        died = await scheduler.ask("map", does("die", log=log, name="a"), ONE)
        after = await scheduler.ask("map", does("nap", seconds=0), ONE)
        return died, after

    died, after = played(play)
    assert (died.status, said(died)["error"]) == (500, "the computation broke off twice: ask again")
    assert after.status == 200
    assert len(log.read_text().splitlines()) == 2


@pytest.fixture
def worker(compute):
    worker = Worker(compute=compute)
    yield worker
    worker.close()


def test_a_worker_ends_computations_by_the_processor_and_by_the_clock(worker):
    assert worker.put(object(), "map", does("loop"), Limits(0.2, 60.0)) is NoAnswer.TOO_LONG
    began, process = time.monotonic(), worker.pid
    assert worker.put(object(), "map", does("nap", seconds=60), Limits(60.0, 0.2)) is NoAnswer.BUSY
    assert time.monotonic() - began < 5.0
    # The same process goes on.
    assert said(worker.put(object(), "map", does("tell"), Limits(1.0, 10.0)))["process"] == process


def test_a_computation_that_cannot_be_interrupted_costs_the_process(worker):
    process = said(worker.put(object(), "map", does("tell"), Limits(1.0, 10.0)))["process"]
    assert worker.put(object(), "map", does("hold on"), Limits(0.1, 0.2)) is NoAnswer.TOO_LONG
    assert said(worker.put(object(), "map", does("tell"), Limits(1.0, 10.0)))["process"] != process


def test_an_interrupt_that_compiled_code_turns_into_another_error_is_still_one(worker):
    process = said(worker.put(object(), "map", does("tell"), Limits(1.0, 10.0)))["process"]
    assert worker.put(object(), "map", does("other error"), Limits(0.1, 10.0)) is NoAnswer.TOO_LONG
    assert said(worker.put(object(), "map", does("tell"), Limits(1.0, 10.0)))["process"] == process


def test_workers_do_without_what_other_systems_lack(compute, monkeypatch):
    monkeypatch.setenv("WITHOUT_POSIX", "1")
    worker = Worker(nice=5, compute=compute)
    try:
        assert worker.put(object(), "map", does("loop"), Limits(0.1, 60.0)) is NoAnswer.TOO_LONG
        assert said(worker.put(object(), "map", does("nap", seconds=0), Limits(1.0, 10.0))) == "done"
    finally:
        worker.close()
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    assert scheduling.pool_settings()["quick"].workers >= 2


def test_linear_algebra_has_one_thread_in_workers_whatever_the_environment_says(worker, monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    assert said(worker.put(object(), "map", does("tell"), Limits(1.0, 10.0)))["threads"] == "1"
    assert os.environ["OPENBLAS_NUM_THREADS"] == "4"


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="this system has no affinity")
def test_there_are_as_many_quick_workers_as_the_process_may_use_processors(monkeypatch):
    counts = {}
    for processors in (1, 3, 64):
        monkeypatch.setattr(os, "sched_getaffinity", lambda pid, n=processors: set(range(n)))
        counts[processors] = scheduling.pool_settings()["quick"].workers
    assert counts == {1: 2, 3: 3, 64: 4}


def test_limits_by_the_clock_leave_time_for_what_else_the_machine_does():
    for stages in scheduling.STAGES.values():
        assert all(stage.limits.clock >= 5.0 * stage.limits.processor for stage in stages)
    # Flows and curves: an answer, or a refusal, for two seconds of computing.
    for question in ("flows", "curve"):
        assert sum(stage.limits.processor for stage in scheduling.STAGES[question]) <= 2.0
