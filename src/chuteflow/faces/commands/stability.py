"""``chuteflow stability``: which flows are stable, and the disturbance that grows fastest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from chuteflow.errors import InputError, SolveError
from chuteflow.faces import options
from chuteflow.faces.commands import COMMANDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.analysis.results import FlowSet
    from chuteflow.faces.stability_records import Answer
    from chuteflow.stability.modes import Mode
    from chuteflow.steady.flow import Flow

_EPILOG = (
    "A flow is stable if no discrete mode with a wavenumber from 1e-3/h to 10/h grows. Rates are in "
    "sqrt(g cos(theta)/d), wavenumbers in 1/d, speeds in sqrt(g d cos(theta)). Where stability cannot be posed or "
    "told, that is said of the flow, and its numbers are null.\n\n"
    "Example: chuteflow stability --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3"
)
_SAVED = (".csv", ".json")
_MOST = 20


@click.command("stability", help=COMMANDS["stability"], epilog=_EPILOG)
@options.chute_options
@options.condition_options
@options.option("--kx", type=options.Number(), help="Wavenumber along the slope, in 1/d; searched if not given.")
@options.option("--ky", type=options.Number(), help="Wavenumber across the slope, in 1/d; searched if not given.")
@options.option(
    "--modes", "count", type=click.INT, help="Leading modes to tell, at the wavenumbers found; 1 by default."
)
@options.search_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@options.option("--plot", metavar="FILE", help="Draw the modes into FILE: .png, .pdf or .svg.")
@options.option("--save", metavar="FILE", help="Write everything to FILE: .csv, or .json with the fields of the modes.")
def command(as_json: bool, **given: Any) -> None:
    """Solve, search, print, save and draw."""
    chute = options.chute(given)
    condition = options.condition(given, chute, None)
    count = 1 if given["count"] is None else given["count"]
    if not 1 <= count <= _MOST:
        raise InputError(f"--modes {count}: must be from 1 to {_MOST}")
    options.require_outputs(given, _SAVED)
    from chuteflow.analysis.enumeration import flows
    from chuteflow.stability.modes import check_wavenumbers

    check_wavenumbers(given["kx"] or 0.0, given["ky"] or 0.0)
    found = flows(chute, **condition, **options.search(given))
    answers = [_answer(flow, given["kx"], given["ky"], count) for flow in found]
    if as_json:
        from chuteflow.faces import contract, stability_records

        answer = contract.text(stability_records.answers_object(found, answers))
    else:
        answer = "\n".join(_report(found, answers))

    def plotted() -> Figure:
        from chuteflow.faces.stability_plot import plot_modes

        return plot_modes(found, answers)

    options.deliver(given, answer, partial(_save, found, answers), plotted)


def _answer(flow: Flow, kx: float | None, ky: float | None, count: int) -> Answer:
    from chuteflow.faces.stability_records import Answer
    from chuteflow.stability.verdict import leading_modes, stability_of

    try:
        stability = stability_of(flow, kx=kx, ky=ky)
        modes = () if stability.mode is None else (stability.mode,)
        if count > 1 and stability.mode is not None:
            modes = leading_modes(flow, stability.mode.kx, stability.mode.ky, count=count)
    except (InputError, SolveError) as error:
        return Answer(flow, None, (), str(error))
    return Answer(flow, stability, tuple(modes), None)


def _save(found: FlowSet, answers: Sequence[Answer], path: str) -> None:
    from chuteflow.faces import contract, stability_records
    from chuteflow.faces.writing import write_whole

    if path.lower().endswith(".json"):
        text = contract.text(stability_records.answers_object(found, answers, fields=True))
    else:
        text = "\n".join(",".join(row) for row in stability_records.csv_rows(answers))
    write_whole(path, text + "\n")


def _report(found: FlowSet, answers: Sequence[Answer]) -> Iterator[str]:
    from chuteflow.faces import contract, tables, words

    yield words.chute(found.chute)
    if not answers:
        yield f"no flow: {found.reason}"
    else:
        columns = [*contract.PLACE]
        head = ["", *tables.heading(columns, None)[0], "", "mode", "kx", "ky", "growth", "speed", "error"]
        rows = [row for i, answer in enumerate(answers, 1) for row in _rows(str(i), answer, columns)]
        yield ""
        yield tables.table([head, *rows], words=(5, 6))
        yield ""
        for i, answer in enumerate(answers, 1):
            yield f"{i}  {words.among(answer.flow, found)}: {_said(answer)}"
    yield words.searched(found.searched, found.chute, None)


def _rows(number: str, answer: Answer, columns: Sequence[str]) -> Iterator[list[str]]:
    from chuteflow.faces import tables

    start = [number, *tables.numbers(answer.flow, columns, answer.flow.chute, None)]
    verdict = "?" if answer.found is None else "stable" if answer.found.stable else "unstable"
    if not answer.modes:
        yield [*start, verdict, *("-" for _ in range(6))]
    for i, mode in enumerate(answer.modes):
        place = [*start, verdict] if i == 0 else [""] * (len(start) + 1)
        speed = "-" if mode.speed is None else tables.number(mode.speed)
        yield [*place, mode.kind, *map(tables.number, (mode.kx, mode.ky, mode.growth)), speed, f"{mode.error:.0e}"]


def _said(answer: Answer) -> str:
    from chuteflow.faces.tables import number

    if answer.found is None:
        return f"not known: {answer.reason}"
    low, high = answer.found.searched
    mode = answer.modes[0] if answer.modes else None
    if answer.found.stable:
        said = "stable: nothing grows"
        if mode is None:
            return f"{said}; the continuous spectrum hides all modes"
        return f"{said} for wavenumbers from {low:.3g} to {high:.3g}; the slowest to decay is {_wave(mode)}"
    assert mode is not None
    return f"unstable: {_wave(mode)} grows by e in a time {number(1.0 / mode.growth)}"


def _wave(mode: Mode) -> str:
    import math

    from chuteflow.faces.tables import number

    if mode.direction == "uniform":
        return "a disturbance that is the same all along the chute"
    length = number(2.0 * math.pi / math.hypot(mode.kx, mode.ky))
    what = {"along": "along the slope", "across": "across the slope", "oblique": "oblique to the slope"}
    moves = "at rest" if mode.speed is None else f"with crests that move at {number(mode.speed)}"
    if mode.speed is None and abs(mode.frequency) > mode.error:
        moves = f"that oscillates with the frequency {number(abs(mode.frequency))}"
    return f"a wave {what[mode.direction]}, {length} grain diameters long, {moves},"
