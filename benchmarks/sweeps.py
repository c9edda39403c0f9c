"""Speed, memory and overhead of sweeps, beside their targets: python benchmarks/sweeps.py [--points 1000000]

Rates are told by processor time, for two cores, since other work on the machine disturbs wall time. The overhead
of an engine is the processor time of all its processes, scheduler and client too, over that of bare processes that
compute the same chunks and throw them away.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from chuteflow.sweeps.engine import Chunk, solve_chunk
from chuteflow.sweeps.runner import cluster_workers
from chuteflow.sweeps.study import from_canonical, read
from timing import Row, median_time, table

CORES = 2
STUDY = """
[design]
kind = "random"
points = {points}
seed = 1
[parameters]
slope = {{from = 0.15, to = 0.45}}
e = {{from = 0.7, to = 0.95}}
ew = {{from = 0.6, to = 0.95}}
roughness = {{from = 0.5, to = 0.86}}
{condition} = {{from = 0.1, to = 100, scale = "log"}}
"""
#: Points of a chunk, and of the short sweep that has a few of them, with which the memory of a long one is compared.
CHUNK, FEW = 10_000, 40_000


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--points", type=int, default=262_144, help="points of the runs of memory and overhead")
    points = parser.parse_args().points
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = [
            rate(folder, "T_surface", 30_000.0, 5_000.0),
            rate(folder, "Q", 2_500.0, 200.0),
            *overhead(folder, points),
            *memory(folder, points),
        ]
    print(table(rows))


def study(folder: Path, points: int, condition: str) -> Path:
    path = folder / f"{condition}-{points}.toml"
    path.write_text(STUDY.format(points=points, condition=condition))
    return path


def rate(folder: Path, condition: str, target: float, least: float) -> Row:
    """Chutes a second of one chunk of the usual size, all flows to 1e-8."""
    given = read(study(folder, 1 << 20, condition))
    chunks: list[Chunk] = []
    spent = median_time(lambda: chunks.append(solve_chunk(given, 0)), 1).cpu / 1e3
    flows, singly = chunks[0].n_flows.sum(), chunks[0].singly
    note = f"{given.chunk} chutes, {flows} flows, {singly} chutes one by one, {spent:.1f} s of one core"
    return Row(
        f"chutes a second on 2 cores, all flows at given {condition}",
        CORES * given.chunk / spent,
        "1/s",
        None,
        target,
        least,
        best="large",
        note=note,
    )


def overhead(folder: Path, points: int) -> list[Row]:
    given = study(folder, points, "T_surface")
    bare_time = median_time(lambda: bare(given), 1).cpu / 1e3
    rows = []
    for what, run in (
        ("dask.distributed", lambda: on_cluster(folder, given)),
        ("processes of one machine", lambda: sweep(given, folder / "local.zarr", "--workers", str(CORES))),
    ):
        spent = median_time(run, 1).cpu / 1e3
        note = f"{points} points, {read(given).chunks} chunks, {spent:.1f} s over {bare_time:.1f} s of bare processes"
        rows.append(Row(f"overhead of {what}", 100.0 * (spent / bare_time - 1.0), "%", None, 10.0, note=note))
    return rows


def bare(given: Path) -> None:
    """The chunks of a study by processes that keep nothing."""
    whole = read(given)
    with ProcessPoolExecutor(CORES, mp_context=get_context("spawn")) as pool:
        for _ in pool.map(solved, [whole.canonical] * whole.chunks, range(whole.chunks)):
            pass


def solved(canonical: str, chunk: int) -> int:
    return int(solve_chunk(from_canonical(canonical), chunk).n_flows.sum())


def on_cluster(folder: Path, given: Path) -> None:
    """A scheduler, two workers and the command that hands them the chunks, from start to end."""
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    own = ["--host", "127.0.0.1", "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    cli = [sys.executable, "-m"]
    command = [*cli, "distributed.cli.dask_scheduler", "--port", "0", "--scheduler-file", str(file), *own]
    processes = [subprocess.Popen(command, **quiet)]
    while not file.exists():
        time.sleep(0.1)
    address = json.loads(file.read_text())["address"]
    command = [*cli, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny", *own]
    processes += [subprocess.Popen(command, **quiet) for _ in range(CORES)]
    while cluster_workers(address).count < CORES:
        time.sleep(0.5)
    try:
        sweep(given, folder / "cluster.zarr", "--cluster", address)
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait()


def sweep(given: Path, store: Path, *options: str) -> None:
    command = [sys.executable, "-m", "chuteflow", "sweep", str(given), "--out", str(store), *options]
    subprocess.run(command, check=True, capture_output=True)


def memory(folder: Path, points: int) -> list[Row]:
    """Peak memory of the largest process of a sweep with few and with many points."""
    peaks = []
    for many in (FEW, points):
        given = study(folder, many, "T_surface")
        given.write_text(given.read_text() + f"[results]\nchunk = {CHUNK}\n")
        command = [sys.executable, __file__, "--peak-of", str(given), str(folder / f"memory-{many}.zarr")]
        peaks.append(float(subprocess.run(command, check=True, capture_output=True, text=True).stdout))
    note = f"chunks of {CHUNK}; {peaks[0]:.0f} MB with {FEW} points"
    return [
        Row(f"peak memory of a process of a sweep of {points} points", peaks[1], "MB", note=note),
        Row("the same over that of a short sweep", peaks[1] / peaks[0], "times", None, 1.1, note=note),
    ]


def peak_of(given: str, store: str) -> None:
    sweep(Path(given), Path(store), "--workers", "1")
    print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--peak-of"]:
        peak_of(*sys.argv[2:])
    else:
        main()
