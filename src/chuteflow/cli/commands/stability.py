"""``chuteflow stability``: which flows are stable, and the disturbance that grows fastest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.errors import InputError, SolveError
from chuteflow.steady.quantities import SCALED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.branches.results import FlowSet
    from chuteflow.stability.answers import StabilityAnswer
    from chuteflow.stability.budget import ModeBudget
    from chuteflow.stability.modes import Mode
    from chuteflow.stability.result import Stability
    from chuteflow.steady.chute import Chute
    from chuteflow.steady.flow import Flow
    from chuteflow.steady.quantities import Scales

_EPILOG = (
    "A flow is stable if no discrete mode with a wavenumber from 1e-3/h to 10/h grows faster than 1e-6 "
    "sqrt(g cos(theta)/h). With --kx and --ky one wave is examined, which says nothing of the others. Rates are in "
    "sqrt(g cos(theta)/d), wavenumbers in 1/d, speeds in sqrt(g d cos(theta)). Where stability is not resolved, the "
    "output says so, and its numbers are null.\n\n"
    "Example: chuteflow stability --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3"
)
_SAVED = (".csv", ".json")
_MOST = 20
#: Symbols of the columns of modes, and their units.
_HEADING = (("mode", ""), ("kx", "1/m"), ("ky", "1/m"), ("growth", "1/s"), ("speed", "m/s"), ("error", "1/s"))
_STATES = {True: "stable", False: "unstable", None: "?"}


@click.command("stability", help=COMMANDS["stability"], epilog=_EPILOG)
@options.chute_options
@options.condition_options
@options.option("--kx", type=options.NumberInUnits(), help="Wavenumber along the slope, in 1/d; searched if not given.")
@options.option(
    "--ky", type=options.NumberInUnits(), help="Wavenumber across the slope, in 1/d; searched if not given."
)
@options.option(
    "--modes", "count", type=click.INT, help="Leading modes to print, at the wavenumbers found; 1 by default."
)
@options.search_options
@options.option("--budget", metavar="FILE", help="Draw the energy budgets of the modes into FILE: .png, .pdf or .svg.")
@options.output_options(_SAVED, "the modes")
def command(**given: Any) -> None:
    """Solve, search, print, save and draw."""
    chute = options.chute(given)
    scales = options.scales(given)
    condition = options.condition(given, chute, scales)
    kx, ky = (options.own(given, name, "wavenumber", chute.slope, scales) for name in ("kx", "ky"))
    search = options.search(given, chute.slope, scales)
    count = 1 if given["count"] is None else given["count"]
    if not 1 <= count <= _MOST:
        raise InputError(f"--modes {count}: must be from 1 to {_MOST}")
    options.require_outputs(given, _SAVED)
    if given["budget"] is not None:
        from chuteflow.io.writing import require_writable

        for path in options.picture_files(given["budget"]):
            require_writable(path, options.DRAWN)
    from chuteflow.branches.enumeration import flows
    from chuteflow.stability.linear import grains
    from chuteflow.stability.modes import check_wavenumbers

    # What could be said of no flow of the chute is refused before any is solved.
    grains(chute, chute.law)
    check_wavenumbers(*(0.0 if k is None else k for k in (kx, ky)))
    found = flows(chute, **condition, **search)
    near, lines = ({}, []) if len(found) else options.nearest(given, chute, condition, scales)
    answers = [_answer(flow, kx, ky, count) for flow in found]
    from chuteflow.io.stability_records import answers_object

    def plotted() -> Figure:
        from chuteflow.plotting.stability_plot import plot_modes

        return plot_modes(found, answers, scales=scales)

    def drawn() -> Figure:
        from chuteflow.plotting.stability_plot import plot_budgets

        return plot_budgets(found, answers, scales=scales)

    options.deliver(
        given,
        lambda: answers_object(found, answers, scales=scales) | near,
        _report(found, answers, lines, scales),
        partial(_save, found, answers, scales),
        plotted,
        budget=drawn,
    )


def _answer(flow: Flow, kx: float | None, ky: float | None, count: int) -> StabilityAnswer:
    from chuteflow.stability.answers import StabilityAnswer
    from chuteflow.stability.result import leading_modes, stability_of

    stability = stability_of(flow, kx=kx, ky=ky)
    modes = () if stability.mode is None else (stability.mode,)
    if count > 1 and stability.mode is not None:
        # What leads at these wavenumbers may be unresolved, though this mode is known.
        with suppress(SolveError):
            modes = leading_modes(flow, stability.mode.kx, stability.mode.ky, count=count)
    return StabilityAnswer(flow, stability, tuple(modes))


def _save(found: FlowSet, answers: Sequence[StabilityAnswer], scales: Scales | None, path: str) -> None:
    from chuteflow.io import stability_records
    from chuteflow.io.files import write_answer

    write_answer(
        path,
        lambda: stability_records.answers_object(found, answers, fields=True, scales=scales),
        lambda: stability_records.csv_rows(answers, scales),
    )


def _report(
    found: FlowSet, answers: Sequence[StabilityAnswer], near: Sequence[str], scales: Scales | None
) -> Iterator[str]:
    from chuteflow.io import contract, tables, words

    yield from words.introduction(found.chute, scales)
    if answers:
        columns = [*contract.PLACE]
        head = tables.heading(columns, scales, before=(("", ""),), after=(("", ""), *_HEADING))
        rows = [row for i, answer in enumerate(answers, 1) for row in _rows(str(i), answer, columns, scales)]
        yield ""
        yield tables.table([*head, *rows], words=(5, 6))
        yield ""
        for i, answer in enumerate(answers, 1):
            yield f"{i}  {words.among(answer.flow, found)}: {_describe(answer, scales)}"
            if answer.budget is not None:
                yield f"   {_describe_budget(answer.budget, _DisturbanceFormat(found.chute, scales))}"
    yield from words.search_outcome(found, scales, near)


@dataclass(frozen=True)
class _DisturbanceFormat:
    """Numbers of disturbances on a chute in words, with units where there are scales."""

    chute: Chute
    scales: Scales | None

    def __call__(self, name: str, value: float) -> str:
        from chuteflow.io.words import amount

        return amount(name, value, self.chute, self.scales)

    def rounded(self, name: str, value: float, digits: int) -> str:
        """The same with so many ``digits``."""
        from chuteflow.io.contract import factor

        unit = "" if self.scales is None else f" {SCALED[name].unit}"
        return f"{value * factor(name, self.chute, self.scales):.{digits}g}{unit}"


def _rows(number: str, answer: StabilityAnswer, columns: Sequence[str], scales: Scales | None) -> Iterator[list[str]]:
    from chuteflow.io import tables
    from chuteflow.io.contract import factor

    chute = answer.flow.chute
    wave, rate, speed_unit = (factor(name, chute, scales) for name in ("wavenumber", "growth", "wave_speed"))
    start = [number, *tables.numbers(answer.flow, columns, chute, scales)]
    state = _STATES[answer.found.stable]
    if not answer.modes:
        yield [*start, state, *("-" for _ in range(6))]
    for i, mode in enumerate(answer.modes):
        place = [*start, state] if i == 0 else [""] * (len(start) + 1)
        speed = "-" if mode.speed is None else tables.number(speed_unit * mode.speed)
        numbers = map(tables.number, (wave * mode.kx, wave * mode.ky, rate * mode.growth))
        yield [*place, mode.kind, *numbers, speed, f"{rate * mode.error:.0e}"]


def _describe(answer: StabilityAnswer, scales: Scales | None) -> str:
    found, said = answer.found, _DisturbanceFormat(answer.flow.chute, scales)
    return _of_all(found, said) if found.complete else _of_some(found, said)


def _describe_budget(budget: ModeBudget, said: _DisturbanceFormat) -> str:
    """What feeds a mode and what it loses most by, of its energy budget."""
    terms = sorted(budget.terms, key=lambda term: -term.total)
    formatted = ", ".join(f"{term.name} {said('growth', term.total)}" for term in (*terms[:2], *terms[-2:]))
    growth = said("growth", budget.mode.growth)
    return f"energy of the mode: {formatted}, of a growth rate of {growth}; closes to {abs(budget.closure):.0e}"


def _of_all(found: Stability, formatted: _DisturbanceFormat) -> str:
    """The result after all of the range was searched, and what stayed unresolved."""
    from chuteflow.io.stability_records import why_unknown

    (low, high), mode = found.searched, found.mode
    if found.grows and mode is not None:
        said = f"unstable: {_wave(mode, formatted)} grows by e in a time {formatted('time', 1.0 / mode.growth)}"
        if found.unresolved:
            said += f"; others may grow faster at {_places(found, formatted)}, where the grids do not resolve it"
        return said
    slowest = "the continuous spectrum hides all modes"
    if mode is not None:
        slowest = f"the slowest to decay is {_wave(mode, formatted)}"
    if found.stable is None:
        return f"not known: {why_unknown(found)}, at {_places(found, formatted)}; elsewhere {slowest}"
    rate, least, most = (
        formatted.rounded("growth", found.smallest_rate, 2),
        *(formatted.rounded("wavenumber", k, 3) for k in (low, high)),
    )
    return f"stable: nothing grows faster than {rate} for wavenumbers from {least} to {most}; {slowest}"


def _of_some(found: Stability, formatted: _DisturbanceFormat) -> str:
    """What the wave does that was asked about, or the fastest of those that were."""
    rest = "; whether the flow is stable is not known from this: give neither --kx nor --ky"
    mode = found.mode
    if mode is None:
        unknown = "the grids do not resolve what it does" if found.unresolved else "it decays: no mode is resolved"
        return f"the wave at {_places(found, formatted)}: {unknown}{rest}" if found.unresolved else f"{unknown}{rest}"
    if found.grows:
        time = formatted("time", 1.0 / mode.growth)
        return f"{_wave(mode, formatted)} grows by e in a time {time}: this wave makes the flow unstable"
    if mode.growth < -found.smallest_rate:
        return f"{_wave(mode, formatted)} decays by e in a time {formatted('time', -1.0 / mode.growth)}{rest}"
    rate = formatted.rounded("growth", found.smallest_rate, 2)
    return f"{_wave(mode, formatted)} neither grows nor decays faster than {rate}{rest}"


def _places(found: Stability, formatted: _DisturbanceFormat) -> str:
    """The unresolved wavenumbers, the first few of them."""
    some = ", ".join(
        " and ".join(f"{name} = {formatted.rounded('wavenumber', k, 3)}" for name, k in (("kx", kx), ("ky", ky)))
        for kx, ky in found.unresolved[:3]
    )
    more = len(found.unresolved) - 3
    return f"{some} and {more} more" if more > 0 else some


def _wave(mode: Mode, formatted: _DisturbanceFormat) -> str:
    import math

    if mode.direction == "uniform":
        return "a disturbance that is the same all along the chute"
    length = formatted("height", 2.0 * math.pi / math.hypot(mode.kx, mode.ky))
    long = f"{length} grain diameters long" if formatted.scales is None else f"{length} long"
    what = {"along": "along the slope", "across": "across the slope", "oblique": "oblique to the slope"}
    moves = "at rest" if mode.speed is None else f"with crests that move at {formatted('wave_speed', mode.speed)}"
    if mode.speed is None and abs(mode.frequency) > mode.error:
        moves = f"that oscillates with the frequency {formatted('frequency', abs(mode.frequency))}"
    return f"a wave {what[mode.direction]}, {long}, {moves},"
