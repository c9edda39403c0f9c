"""``chuteflow sweep``: every flow of very many chutes, as a study says, into a Zarr store."""

from __future__ import annotations

import os
import shlex
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from chuteflow.errors import InputError
from chuteflow.faces import options
from chuteflow.faces.commands import COMMANDS
from chuteflow.processes import available_cores

if TYPE_CHECKING:
    from chuteflow.sweeps.runner import Workers
    from chuteflow.sweeps.store import Marker, Store
    from chuteflow.sweeps.study import Study

_EPILOG = (
    "A study is a TOML file with the tables [design], [parameters], [search] and [results]. What is interrupted or "
    "killed goes on where it was with the same command.\n\n"
    "Example: chuteflow sweep study.toml --out study.zarr"
)
#: Seconds between two lines of progress where they are not written over each other, and else.
_SELDOM, _OFTEN = 10.0, 0.2
#: Points that the time is estimated from: by a few, and by more.
_SAMPLES = (128, 1024)


class Chunks(click.ParamType):
    """Numbers of chunks: N, A:B without B, or A:B:STEP, several separated by commas."""

    name = "chunks"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> list[slice]:
        """Slices of all chunks."""
        out = []
        for part in value.split(","):
            try:
                ends = [int(text) if text else None for text in part.split(":")]
                if len(ends) > 3 or any(end is not None and end < 0 for end in ends) or ends == [None]:
                    raise ValueError
                first = ends[0] or 0
                out.append(slice(*ends) if len(ends) > 1 else slice(first, first + 1))
                range(0)[out[-1]]
            except ValueError:
                self.fail(f"{part!r}: write N, A:B or A:B:STEP, for example 0:100", param, ctx)
        return out


@click.command("sweep", help=COMMANDS["sweep"], epilog=_EPILOG)
@click.argument("study", metavar="STUDY")
@options.option("--out", metavar="STORE", help="Zarr store to make or go on with, such as study.zarr.")
@options.option("--workers", type=click.INT, help="Processes on this machine; one for each core by default.")
@options.option("--cluster", metavar="ADDRESS", help="Use the dask.distributed scheduler at ADDRESS instead.")
@options.option("--chunks", type=Chunks(), help="Compute these chunks alone: N, A:B or A:B:STEP, with commas between.")
@click.option("--dry-run", is_flag=True, help="Tell points, chunks and an estimate of the time, and write nothing.")
@click.option("--status", is_flag=True, help="Tell what of the store is done and which points failed.")
def command(study: str, **given: Any) -> None:
    """Read the study, compute what is left of it and tell what came out."""
    from chuteflow.sweeps.study import read

    read_study = read(study)
    if given["dry_run"]:
        click.echo(_estimate(read_study, _count(given["workers"])))
        return
    if given["out"] is None:
        raise InputError("missing --out STORE, for example --out study.zarr")
    from chuteflow.sweeps.store import Store

    if given["status"]:
        if not os.path.exists(given["out"]):
            raise InputError(f"there is no store {given['out']} as yet: leave --status away to make it")
        click.echo(_status(Store.made(given["out"], read_study)))
        return
    chosen = _chosen(read_study, given["chunks"])
    workers = _workers(given["workers"], given["cluster"])
    _run(Store.made(given["out"], read_study), chosen, workers, alone=given["chunks"] is None)


def _workers(count: int | None, cluster: str | None) -> Workers:
    from chuteflow.sweeps.runner import cluster_workers, local_workers

    if cluster is None:
        return local_workers(_count(count))
    if count is not None:
        raise InputError(f"--workers {count} and --cluster {cluster}: give one of them, not both")
    return cluster_workers(cluster)


def _count(given: int | None) -> int:
    from chuteflow.sweeps.runner import require_count

    if given is None:
        return available_cores()
    require_count(given)
    return given


def _chosen(study: Study, slices: Sequence[slice] | None) -> Sequence[int]:
    every = range(study.chunks)
    if slices is None:
        return every
    chosen = sorted({chunk for part in slices for chunk in every[part]})
    if not chosen:
        raise InputError(f"--chunks: the study has chunks 0 to {study.chunks - 1}, none of those asked for")
    return chosen


def _run(store: Store, chunks: Sequence[int], workers: Workers, *, alone: bool) -> None:
    from chuteflow.sweeps.runner import run

    try:
        with store.held(alone=alone):
            progress = Progress(store, chunks)
            for marker in run(store, chunks, workers):
                progress.add(marker)
            progress.end()
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped; to go on: chuteflow {shlex.join(sys.argv[1:])}") from None
    click.echo(_summary(store))


class Progress:
    """Lines on standard error: what is done and how long the rest will take."""

    def __init__(self, store: Store, chunks: Sequence[int]) -> None:
        done = store.done()
        self._whole, self._done = len(chunks), sum(chunk in done for chunk in chunks)
        self._begin, self._first, self._told = time.monotonic(), self._done, float("-inf")
        self._points = self._flows = self._failed = 0
        self._over = sys.stderr.isatty()
        if self._done:
            click.echo(f"{self._done} of {self._whole} chunks are done already", err=True)

    def add(self, marker: Marker) -> None:
        """Count one more chunk."""
        self._done += 1
        self._points += marker.points
        self._flows += marker.flows
        self._failed += len(marker.failures)
        now = time.monotonic()
        if now - self._told >= (_OFTEN if self._over else _SELDOM):
            self._told = now
            self._tell(now - self._begin)

    def end(self) -> None:
        """Tell where it ended."""
        if self._points:
            self._tell(time.monotonic() - self._begin)
            if self._over:
                click.echo(err=True)

    def _tell(self, spent: float) -> None:
        left = spent / (self._done - self._first) * (self._whole - self._done)
        text = (
            f"chunk {self._done} of {self._whole}: {self._points / max(spent, 1e-9):.0f} points a second, "
            f"{self._flows} flows, {self._failed} points failed, {_time(left)} left"
        )
        click.echo(f"\r{text}\033[K" if self._over else text, err=True, nl=not self._over)


def _time(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _estimate(study: Study, workers: int) -> str:
    few, many = (max(min(study.chunk, study.points, size), 1) for size in _SAMPLES)
    short, long = _seconds(study, few), _seconds(study, many)
    # A chunk costs so much for each point, and as much again whatever their number.
    each = max(long - short, 0.0) / max(many - few, 1)
    whole = each * study.points + max(long - each * many, 0.0) * study.chunks
    return (
        f"{study.points} points in {study.chunks} chunks of {study.chunk}; about {_time(whole / workers)} with "
        f"{workers} workers, by the first {many} points"
    )


def _seconds(study: Study, points: int) -> float:
    """Time that the first points of a study take."""
    from dataclasses import replace

    from chuteflow.sweeps.engine import solve_chunk

    begin = time.perf_counter()
    solve_chunk(replace(study, chunk=points), 0)
    return time.perf_counter() - begin


def _status(store: Store) -> str:
    markers = [store.marker(chunk) for chunk in sorted(store.done())]
    lines = [_totals(store, markers)]
    for marker in markers:
        lines += [f"point {point}: {why}" for point, why in marker.failures.items()]
    return "\n".join(lines)


def _summary(store: Store) -> str:
    return _totals(store, [store.marker(chunk) for chunk in sorted(store.done())])


def _totals(store: Store, markers: Sequence[Marker]) -> str:
    failed = sum(len(marker.failures) for marker in markers)
    return (
        f"{store.path}: {len(markers)} of {store.study.chunks} chunks, {sum(m.points for m in markers)} points, "
        f"{sum(m.flows for m in markers)} flows, {failed} points failed, "
        f"{sum(m.singly for m in markers)} points solved one by one"
    )
