"""All measurements of speed and memory in one run, beside their targets: python benchmarks/run.py

Times are medians of repeats: of wall time, as the user waits, and of processor time, which other work on the machine
disturbs less, by which targets are compared, and of which the ratios are taken. The table is printed, and written to
benchmarks/results/table.txt; it takes a few minutes. What is not installed is left out, and the table says so.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: ratios are of one core against one core

import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy

import by_scipy
import curves
import sweeps
from chuteflow import Chute, FlowSet, curve, domain, flows
from chuteflow.steady.collocation import LOG_Q
from chuteflow.steady.solver import Condition, resolve
from timing import Row, forget, forget_search, median_time, table

PAPER = Chute(slope=0.3, restitution=0.8, wall_restitution=0.8, roughness=0.6)
FLUX = 3.0
RESULTS = Path(__file__).parent / "results" / "table.txt"
#: The neighbour that a flow is solved from has this flux.
NEIGHBOUR = 3.1
LETTERS = "ABC"
#: Nodes of the neighbour as solve_bvp gets it: first as many as the engine's grids have, then more.
GIVEN, OTHERS = 25, (50, 100, 200, 400)

SOLVE = ["solve", "--slope", "0.3", "--e", "0.8", "--ew", "0.8", "--roughness", "0.6", "--flux", "3"]
# The largest memory of the process itself: ru_maxrss would be that of its parent where this had more.
MEMORY = """
from pathlib import Path
from chuteflow import Chute, curve, flows
chute = Chute(0.3, 0.8, 0.8, 0.6)
flows(chute, Q=3.0)
curve(chute, surface_temperature=(0.01, 500.0), points=200)
status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
print(float(status["VmHWM"].split()[0]) / 1024.0)
"""


def main() -> None:
    parts: dict[str, Callable[[], list[Row]]] = {
        "Speed and memory of the package": of_the_package,
        "One flow, by scipy's solve_bvp": lambda: against_scipy(flows(PAPER, Q=NEIGHBOUR), flows(PAPER, Q=FLUX)),
        "The curve of figure 3 from Q = 6 to 0.7, with both folds": curves.compared,
        "Many chutes": many_chutes,
    }
    blocks = [_machine()]
    print(blocks[0], flush=True)
    for title, measure in parts.items():
        blocks.append(f"{title}\n\n{table(measure())}")
        print(f"\n{blocks[-1]}", flush=True)
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text("\n\n".join(blocks) + "\n", encoding="utf-8")


def of_the_package() -> list[Row]:
    return [*one_flow(flows(PAPER, Q=NEIGHBOUR)), *search(), *whole_curve(), *processes(), memory()]


def _machine() -> str:
    return (
        f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}, "
        f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
    )


def one_flow(near: FlowSet) -> list[Row]:
    condition = Condition.fix(LOG_Q, FLUX)
    rows = []
    for letter, flow in zip(LETTERS, near, strict=True):
        time = median_time(lambda flow=flow: resolve(flow.solution, condition), 200)
        solution = resolve(flow.solution, condition)
        assert solution.converged
        note = f"from Q = {NEIGHBOUR:g} to {FLUX:g}, degree {solution.problem.degree}, error {solution.error:.0e}"
        rows.append(Row(f"one flow from a neighbour: {letter}", time.wall, "ms", time.cpu, 0.15, 2.0, note=note))
    return rows


def search() -> list[Row]:
    cold = median_time(lambda: flows(PAPER, Q=FLUX), 40, before=forget)
    warm = median_time(lambda: flows(PAPER, Q=FLUX), 40, before=forget_search)
    again = median_time(lambda: flows(PAPER, Q=FLUX), 40)
    return [
        Row(
            "three flows at Q = 3, whole search, cold", cold.wall, "ms", cold.cpu, 4.0, 50.0, note="all caches cleared"
        ),
        Row("the same, warm", warm.wall, "ms", warm.cpu, note="closure table and grids at hand"),
        Row("the same chute again", again.wall, "ms", again.cpu, note="its branches at hand: flows at another flux"),
    ]


def against_scipy(near: FlowSet, exact: FlowSet) -> list[Row]:
    """solve_bvp from the same neighbours, given on as many nodes as the engine has; and on those that suit it best."""
    condition = Condition.fix(LOG_Q, FLUX)
    rows = []
    theirs, best, own = [], [], []
    for letter, flow, wanted in zip(LETTERS, near, exact, strict=True):
        start = by_scipy.start_from(flow, GIVEN)
        found = by_scipy.solve(PAPER, FLUX, start)
        off = abs(np.exp(found.p[0]) / wanted.mass_holdup - 1.0)
        assert found.success
        assert off < 1e-6
        theirs.append(_scipy_time(start))
        best.append(min(theirs[-1], *(_scipy_time(by_scipy.start_from(flow, points)) for points in OTHERS)))
        own.append(median_time(lambda flow=flow: resolve(flow.solution, condition), 50).cpu)
        note = f"solve_bvp {theirs[-1]:.0f} ms, from {GIVEN} to {found.x.size} nodes, M off by {off:.0e}"
        rows.append(Row(f"solve_bvp over one flow: {letter}", theirs[-1] / own[-1], "times", best="large", note=note))
    mean = sum(theirs) / len(exact)
    note = f"solve_bvp {mean:.0f} ms"
    rows.append(Row("the mean of these", sum(theirs) / sum(own), "times", None, 100.0, best="large", note=note))
    note = f"solve_bvp {sum(best) / len(exact):.0f} ms, the fastest of {GIVEN} to {OTHERS[-1]} nodes for each flow"
    rows.append(Row("the mean, on the mesh that suits it best", sum(best) / sum(own), "times", best="large", note=note))
    cold = median_time(lambda: flows(PAPER, Q=FLUX), 20, before=forget)
    note = f"a third of the cold search takes {cold.cpu / len(exact):.1f} ms"
    ratio = sum(theirs) / cold.cpu
    rows.append(Row("solve_bvp over one flow of the search", ratio, "times", None, 1.0, best="large", note=note))
    return rows


def _scipy_time(start: by_scipy.Start) -> float:
    return median_time(lambda: by_scipy.solve(PAPER, FLUX, start), 3).cpu


def whole_curve() -> list[Row]:
    def run() -> object:
        return curve(PAPER, surface_temperature=(0.01, 500.0), points=200)

    cold = median_time(run, 7, before=forget)
    warm = median_time(run, 7, before=forget_search)
    note = f"warm {warm.wall:.0f} ms"
    return [
        Row("curve from T_surface 0.01 to 500, 200 points, folds", cold.wall, "ms", cold.cpu, 100.0, 300.0, note=note)
    ]


def processes() -> list[Row]:
    out = []
    for what, arguments, target, repeats in (
        ("chuteflow solve, whole process", SOLVE, 500.0, 9),
        ("chuteflow --help, whole process", ["--help"], 100.0, 9),
    ):
        call = [sys.executable, "-m", "chuteflow", *arguments]
        time = median_time(lambda call=call: subprocess.run(call, capture_output=True, check=True), repeats)
        out.append(Row(what, time.wall, "ms", time.cpu, target))
    return out


def many_chutes() -> list[Row]:
    """Rates of sweeps; their overhead and memory take longer, and are measured by sweeps.py. A domain."""
    with tempfile.TemporaryDirectory() as folder:
        rates = [
            sweeps.rate(Path(folder), "T_surface", 30_000.0, 5_000.0),
            sweeps.rate(Path(folder), "Q", 2_500.0, 200.0),
        ]
    plane = ("slope", 0.1, 0.5), ("roughness", 0.5, 0.866)
    spent = median_time(lambda: domain(PAPER, *plane, size=(400, 400)), 1).cpu / 1e3
    note = f"slope and roughness, all classes; {spent:.1f} s of one core"
    return [*rates, Row("a domain of 400x400, on 2 cores", spent / sweeps.CORES, "s", None, 4.0, 20.0, note=note)]


def memory() -> Row:
    peaks = sorted(
        float(subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, check=True, text=True).stdout)
        for _ in range(3)
    )
    return Row("peak memory of a search and a curve", peaks[1], "MB", None, 220.0)


if __name__ == "__main__":
    main()
