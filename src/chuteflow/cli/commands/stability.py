"""``chuteflow stability``: which flows are stable, and the disturbance that grows fastest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.errors import InputError, SolveError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.branches.results import FlowSet
    from chuteflow.stability.answers import Answer
    from chuteflow.stability.budget import Budget
    from chuteflow.stability.modes import Mode
    from chuteflow.stability.verdict import Stability
    from chuteflow.steady.flow import Flow

_EPILOG = (
    "A flow is stable if no discrete mode with a wavenumber from 1e-3/h to 10/h grows faster than 1e-6 "
    "sqrt(g cos(theta)/h). With --kx and --ky one wave is examined, which says nothing of the others. Rates are in "
    "sqrt(g cos(theta)/d), wavenumbers in 1/d, speeds in sqrt(g d cos(theta)). Where stability cannot be posed or "
    "told, that is said of the flow, and its numbers are null.\n\n"
    "Example: chuteflow stability --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3"
)
_SAVED = (".csv", ".json")
_MOST = 20
_VERDICTS = {True: "stable", False: "unstable", None: "?"}


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
@options.option("--budget", metavar="FILE", help="Draw the energy budgets of the modes into FILE: .png, .pdf or .svg.")
@options.option("--save", metavar="FILE", help="Write everything to FILE: .csv, or .json with the fields of the modes.")
def command(as_json: bool, **given: Any) -> None:
    """Solve, search, print, save and draw."""
    chute = options.chute(given)
    condition = options.condition(given, chute, None)
    count = 1 if given["count"] is None else given["count"]
    if not 1 <= count <= _MOST:
        raise InputError(f"--modes {count}: must be from 1 to {_MOST}")
    options.require_outputs(given, _SAVED)
    if given["budget"] is not None:
        from chuteflow.io.writing import require_writable

        require_writable(given["budget"], options.DRAWN)
    from chuteflow.branches.enumeration import flows
    from chuteflow.stability.modes import check_wavenumbers

    check_wavenumbers(*(0.0 if given[name] is None else given[name] for name in ("kx", "ky")))
    found = flows(chute, **condition, **options.search(given))
    answers = [_answer(flow, given["kx"], given["ky"], count) for flow in found]
    if as_json:
        from chuteflow.io import contract, stability_records

        answer = contract.text(stability_records.answers_object(found, answers))
    else:
        answer = "\n".join(_report(found, answers))

    def plotted() -> Figure:
        from chuteflow.plotting.stability_plot import plot_modes

        return plot_modes(found, answers)

    def drawn() -> Figure:
        from chuteflow.plotting.stability_plot import plot_budgets

        return plot_budgets(found, answers)

    options.deliver(given, answer, partial(_save, found, answers), plotted, budget=drawn)


def _answer(flow: Flow, kx: float | None, ky: float | None, count: int) -> Answer:
    from chuteflow.stability.answers import Answer
    from chuteflow.stability.verdict import leading_modes, stability_of

    try:
        stability = stability_of(flow, kx=kx, ky=ky)
    except InputError as error:
        return Answer(flow, None, (), str(error))
    modes = () if stability.mode is None else (stability.mode,)
    if count > 1 and stability.mode is not None:
        # What leads at these wavenumbers may be unresolved, though this mode is known.
        with suppress(SolveError):
            modes = leading_modes(flow, stability.mode.kx, stability.mode.ky, count=count)
    return Answer(flow, stability, tuple(modes), None)


def _save(found: FlowSet, answers: Sequence[Answer], path: str) -> None:
    from chuteflow.io import stability_records
    from chuteflow.io.files import write_answer

    write_answer(
        path,
        lambda: stability_records.answers_object(found, answers, fields=True),
        lambda: stability_records.csv_rows(answers),
    )


def _report(found: FlowSet, answers: Sequence[Answer]) -> Iterator[str]:
    from chuteflow.io import contract, tables, words

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
            if answer.budget is not None:
                yield f"   {_fed(answer.budget)}"
    yield words.searched(found.searched, found.chute, None)


def _rows(number: str, answer: Answer, columns: Sequence[str]) -> Iterator[list[str]]:
    from chuteflow.io import tables

    start = [number, *tables.numbers(answer.flow, columns, answer.flow.chute, None)]
    verdict = _VERDICTS[None if answer.found is None else answer.found.stable]
    if not answer.modes:
        yield [*start, verdict, *("-" for _ in range(6))]
    for i, mode in enumerate(answer.modes):
        place = [*start, verdict] if i == 0 else [""] * (len(start) + 1)
        speed = "-" if mode.speed is None else tables.number(mode.speed)
        yield [*place, mode.kind, *map(tables.number, (mode.kx, mode.ky, mode.growth)), speed, f"{mode.error:.0e}"]


def _said(answer: Answer) -> str:
    if answer.found is None:
        return f"not known: {answer.reason}"
    found = answer.found
    return _of_all(found) if found.complete else _of_some(found)


def _fed(budget: Budget) -> str:
    """What feeds a mode and what it loses most by, of its energy budget."""
    from chuteflow.io.tables import number

    terms = sorted(budget.terms, key=lambda term: -term.total)
    told = ", ".join(f"{term.name} {number(term.total)}" for term in (*terms[:2], *terms[-2:]))
    growth = number(budget.mode.growth)
    return f"energy of the mode: {told}, of a growth rate of {growth}; closes to {abs(budget.closure):.0e}"


def _of_all(found: Stability) -> str:
    """The verdict after all of the range was searched, and what stayed unresolved."""
    from chuteflow.io.stability_records import why_unknown
    from chuteflow.io.tables import number

    (low, high), mode = found.searched, found.mode
    if found.grows and mode is not None:
        said = f"unstable: {_wave(mode)} grows by e in a time {number(1.0 / mode.growth)}"
        if found.unresolved:
            said += f"; others may grow faster at {_places(found)}, where the grids do not tell"
        return said
    told = "the continuous spectrum hides all modes" if mode is None else f"the slowest to decay is {_wave(mode)}"
    if found.stable is None:
        return f"not known: {why_unknown(found)}, at {_places(found)}; elsewhere {told}"
    return (
        f"stable: nothing grows faster than {found.smallest_rate:.2g} for wavenumbers from {low:.3g} to {high:.3g}; "
        f"{told}"
    )


def _of_some(found: Stability) -> str:
    """What the wave does that was asked about, or the fastest of those that were."""
    from chuteflow.io.tables import number

    rest = "; whether the flow is stable is not known from this: give neither --kx nor --ky"
    mode = found.mode
    if mode is None:
        unknown = "the grids do not tell what it does" if found.unresolved else "it decays: no mode is told"
        return f"the wave at {_places(found)}: {unknown}{rest}" if found.unresolved else f"{unknown}{rest}"
    if found.grows:
        return f"{_wave(mode)} grows by e in a time {number(1.0 / mode.growth)}: this wave makes the flow unstable"
    if mode.growth < -found.smallest_rate:
        return f"{_wave(mode)} decays by e in a time {number(-1.0 / mode.growth)}{rest}"
    return f"{_wave(mode)} neither grows nor decays faster than {found.smallest_rate:.2g}{rest}"


def _places(found: Stability) -> str:
    """The unresolved wavenumbers, the first few of them."""
    some = ", ".join(f"kx = {kx:.3g} and ky = {ky:.3g}" for kx, ky in found.unresolved[:3])
    more = len(found.unresolved) - 3
    return f"{some} and {more} more" if more > 0 else some


def _wave(mode: Mode) -> str:
    import math

    from chuteflow.io.tables import number

    if mode.direction == "uniform":
        return "a disturbance that is the same all along the chute"
    length = number(2.0 * math.pi / math.hypot(mode.kx, mode.ky))
    what = {"along": "along the slope", "across": "across the slope", "oblique": "oblique to the slope"}
    moves = "at rest" if mode.speed is None else f"with crests that move at {number(mode.speed)}"
    if mode.speed is None and abs(mode.frequency) > mode.error:
        moves = f"that oscillates with the frequency {number(abs(mode.frequency))}"
    return f"a wave {what[mode.direction]}, {length} grain diameters long, {moves},"
