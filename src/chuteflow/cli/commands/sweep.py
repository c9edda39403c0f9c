"""``chuteflow sweep``: every flow of very many chutes, as a study says, into a Zarr store."""

from __future__ import annotations

import os
import shlex
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from itertools import islice
from typing import TYPE_CHECKING, Any

import click

from chuteflow import __version__
from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress
from chuteflow.errors import InputError
from chuteflow.processes import available_cores

if TYPE_CHECKING:
    from chuteflow.sweeps.runner import Workers
    from chuteflow.sweeps.store import Marker, Store
    from chuteflow.sweeps.study import Study

_EPILOG = (
    "A study is a TOML file with the tables [design], [parameters], [search] and [results]. The same command "
    "continues a study that was interrupted or killed.\n\n"
    "Example: chuteflow sweep study.toml --out study.zarr"
)
#: Seconds between two lines of progress where they are not written over each other, and else.
_SELDOM, _OFTEN = 10.0, 0.2
#: Chunks at most where they are given by several slices.
_MOST_IN_SLICES = 10_000_000
#: Chunks that are damaged that are named; the others are counted.
_MOST_LINES = 20
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
@options.option("--out", metavar="STORE", help="Zarr store to create or continue, such as study.zarr.")
@options.option("--workers", type=click.INT, help="Processes on this machine; one for each core by default.")
@options.option("--cluster", metavar="ADDRESS", help="Use the dask.distributed scheduler at ADDRESS instead.")
@options.option("--chunks", type=Chunks(), help="Compute only these chunks: N, A:B or A:B:STEP, separated by commas.")
@click.option(
    "--dry-run", is_flag=True, help="Print the points, the chunks and an estimate of the time; write nothing."
)
@click.option("--status", is_flag=True, help="Check the store; print how much is done and which points failed.")
@options.quiet_option
@click.option("--no-check", is_flag=True, help="Trust the markers of the store; do not check its arrays.")
def command(study: str, **given: Any) -> None:
    """Read the study, compute the rest of it and print the results."""
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
            raise InputError(f"there is no store {given['out']} yet: omit --status to create it")
        click.echo("\n".join(_status(Store.made(given["out"], read_study), check=not given["no_check"])))
        return
    chosen = _choose_chunks(read_study, given["chunks"])
    workers = _workers(given["workers"], given["cluster"])
    store = Store.made(given["out"], read_study)
    _run(store, chosen, workers, alone=given["chunks"] is None, check=not given["no_check"])


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


def _choose_chunks(study: Study, slices: Sequence[slice] | None) -> Sequence[int]:
    every = range(study.chunks)
    if slices is None:
        return every
    # One slice of very many chunks is never laid out.
    parts = [every[part] for part in slices]
    if len(parts) > 1 and sum(map(len, parts)) > _MOST_IN_SLICES:
        raise InputError(f"--chunks: several slices may have {_MOST_IN_SLICES} chunks, not more: give one slice")
    chosen = parts[0] if len(parts) == 1 else sorted({chunk for part in parts for chunk in part})
    if not chosen:
        raise InputError(f"--chunks: the study has chunks 0 to {study.chunks - 1}, none of those asked for")
    return chosen


def _run(store: Store, chunks: Sequence[int], workers: Workers, *, alone: bool, check: bool) -> None:
    from chuteflow.sweeps.runner import run

    try:
        with store.held(alone=alone):
            found = _CheckedChunks(store, chunks, check=check)
            for line in found.damage_lines():
                click.echo(f"{line}: computed again", err=True)
            _begin(store, found, computing=len(found.sound) < len(chunks))
            progress = SweepProgress(len(chunks), len(found.sound))
            for marker in run(store, (chunk for chunk in chunks if chunk not in found.sound), workers):
                progress.add(marker)
                found.add(marker)
            progress.end()
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped; to go on: chuteflow {shlex.join(sys.argv[1:])}") from None
    # Of the chunks that were not asked for, the markers have to do.
    others = _CheckedChunks(store, [chunk for chunk in store.done() if chunk not in found.sound], check=False)
    click.echo("\n".join(_totals(store, found.totals + others.totals)))


def _begin(store: Store, found: _CheckedChunks, *, computing: bool) -> None:
    """Put the metadata in order, and say what has to be known of the store before chunks are added."""
    from chuteflow.sweeps.store import StoreError

    for name in store.find_damaged_metadata():
        click.echo(f"the metadata of {name or 'the store'} are damaged: written again", err=True)
    others = [version for version in found.totals.versions if version != __version__]
    if others and computing:
        click.echo(
            f"the store has chunks of chuteflow {', '.join(others)}; those computed now are of chuteflow {__version__}",
            err=True,
        )
    try:
        store.mend(*([__version__] if computing else []))
    except OSError as error:
        raise StoreError(f"cannot write the metadata of {store.path}: {error.strerror or error}") from None


@dataclass
class ChunkTotals:
    """Sums over chunks, and how many chunks each version of the program computed."""

    chunks: int = 0
    points: int = 0
    flows: int = 0
    failed: int = 0
    singly: int = 0
    versions: Counter[str] = field(default_factory=Counter)

    def add(self, marker: Marker) -> None:
        """Count one more chunk."""
        self.chunks += 1
        self.points += marker.points
        self.flows += marker.flows
        self.failed += len(marker.failures)
        self.singly += marker.singly
        self.versions[marker.version] += 1

    def __add__(self, other: ChunkTotals) -> ChunkTotals:
        sums = {one.name: getattr(self, one.name) + getattr(other, one.name) for one in fields(self)}
        return ChunkTotals(**sums)


class _CheckedChunks:
    """What is found in a store of some chunks: which are sound, and what is wrong with the others."""

    def __init__(self, store: Store, chunks: Sequence[int], *, check: bool) -> None:
        from chuteflow.sweeps.store import DamageError

        self.sound: set[int] = set()
        self.damage: dict[int, str] = {}
        self.failures: list[tuple[int, str]] = []
        self.unchecked = 0
        self.totals = ChunkTotals()
        wanted = chunks if isinstance(chunks, range) else frozenset(chunks)
        for chunk in sorted(store.done()):
            if chunk in wanted:
                try:
                    self.add(store.checked(chunk) if check else store.marker(chunk))
                except DamageError as error:
                    self.damage[chunk] = str(error)

    def add(self, marker: Marker) -> None:
        """Count a chunk that is sound."""
        self.sound.add(marker.chunk)
        self.totals.add(marker)
        self.failures += marker.failures.items()
        self.unchecked += not marker.sums

    def damage_lines(self) -> Iterator[str]:
        """What is damaged, in lines."""
        for chunk, why in islice(self.damage.items(), _MOST_LINES):
            yield f"chunk {chunk} is damaged: {why}"
        if len(self.damage) > _MOST_LINES:
            yield f"{len(self.damage) - _MOST_LINES} more chunks are damaged"


class SweepProgress:
    """Lines on standard error: what is done and how long the rest will take."""

    def __init__(self, whole: int, done: int) -> None:
        self._whole, self._done = whole, done
        self._begin, self._first, self._told = time.monotonic(), self._done, float("-inf")
        self._points = self._flows = self._failed = 0
        self._line = Progress()
        if self._done and not options.is_quiet():
            click.echo(f"{self._done} of {self._whole} chunks are done already", err=True)

    def add(self, marker: Marker) -> None:
        """Count one more chunk."""
        self._done += 1
        self._points += marker.points
        self._flows += marker.flows
        self._failed += len(marker.failures)
        now = time.monotonic()
        if now - self._told >= (_OFTEN if self._line.is_shown else _SELDOM):
            self._told = now
            self._tell(now - self._begin)

    def end(self) -> None:
        """Tell where it ended."""
        if self._points:
            self._tell(time.monotonic() - self._begin)
            if self._line.is_shown:
                click.echo(err=True)

    def _tell(self, spent: float) -> None:
        left = spent / (self._done - self._first) * (self._whole - self._done)
        text = (
            f"chunk {self._done} of {self._whole}: {self._points / max(spent, 1e-9):.0f} points a second, "
            f"{self._flows} flows, {self._failed} points failed, {_time(left)} left"
        )
        if self._line.is_shown:
            self._line.show(text)
        elif not options.is_quiet():
            click.echo(text, err=True)


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


def _status(store: Store, *, check: bool) -> Iterator[str]:
    found = _CheckedChunks(store, range(store.study.chunks), check=check)
    yield from _totals(store, found.totals)
    if not check:
        yield "the arrays have not been checked"
    elif found.unchecked:
        yield f"{found.unchecked} chunks have no checksums: their counts and parameters have been checked alone"
    again = "the same command without --status"
    for name in store.find_damaged_metadata():
        yield f"the metadata of {name or 'the store'} are damaged: {again} writes them again"
    for line in found.damage_lines():
        yield f"{line}: {again} computes it again"
    for point, why in found.failures:
        yield f"point {point}: {why}"


def _totals(store: Store, totals: ChunkTotals) -> Iterator[str]:
    yield (
        f"{store.path}: {totals.chunks} of {store.study.chunks} chunks, {totals.points} points, "
        f"{totals.flows} flows, {totals.failed} points failed, {totals.singly} points solved one by one"
    )
    if set(totals.versions) - {__version__}:
        versions = (f"{count} by chuteflow {version}" for version, count in sorted(totals.versions.items()))
        yield f"chunks computed: {', '.join(versions)}"
