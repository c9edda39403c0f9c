"""``chuteflow relax``: a disturbed flow followed in time, to the steady flow that it comes to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress
from chuteflow.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.io.dataset import Dataset
    from chuteflow.stability.relaxation import Outcome, RelaxationState
    from chuteflow.steady.flow import Flow
    from chuteflow.steady.quantities import Scales

#: Rows of the table that is printed; nearness that counts as arrival, if it shrinks, and as rest.
_ROWS, _ARRIVED, _SETTLED = 12, 0.01, 1e-6
_COLUMNS = {
    "t": "time",
    "Q": "mass_flux",
    "h": "centre_of_mass",
    "T_surface": "surface_temperature",
    "T_base": "base_temperature",
}
_SAVED = (".csv", ".json")


_EPILOG = (
    "The flow stays uniform along the chute and keeps its hold-up M: waves along and across the slope are left "
    "out. Only the free surface is supported.\n\n"
    "Example: chuteflow relax --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3 --heat 1.2"
)


@click.command("relax", help=COMMANDS["relax"], epilog=_EPILOG)
@options.chute_options
@options.condition_options
@options.flow_option
@options.option(
    "--heat", type=options.Number(), help="Factor on the granular temperature; 1.1 by default, or 1 with --push."
)
@options.option("--push", type=options.Number(), help="Factor on the velocity; 1 by default.")
@options.option("--duration", type=options.NumberInUnits(), help="Time in sqrt(d/(g cos theta)); 2000 by default.")
@options.output_options(_SAVED)
def command(**given: Any) -> None:
    """Solve, disturb, follow and tell."""
    from chuteflow.stability.disturbed import DURATION, LONGEST, relax

    options.require_outputs(given, _SAVED)
    chute = options.chute(given)
    scales = options.scales(given)
    asked = options.own(given, "duration", "time", chute.slope, scales)
    duration = DURATION if asked is None else asked
    if not 0.0 < duration <= LONGEST:
        raise InputError(f"--duration {duration:g}: must be above 0 and at most {LONGEST:g}")
    condition: dict[str, Any] = options.condition(given, chute, scales)
    flow = options.solve_one(given, chute, condition, scales, {"flows": []})
    if flow is None:
        return
    with Progress(seconds=1.0) as progress:
        followed = relax(
            flow,
            temperature=given["heat"],
            velocity=given["push"],
            duration=duration,
            progress=lambda time: progress.show(f"t = {time:.6g} of {duration:.6g}"),
        )
    moments, end = followed.moments, followed.outcome
    from chuteflow.io.datasets import dataset

    table = dataset(followed, scales)

    def plotted() -> Figure:
        from chuteflow.plotting.relaxation_plot import plot_relaxation

        return plot_relaxation(flow, moments, end, scales=scales)

    options.deliver_object(
        given,
        _content(flow, table, end, scales),
        _describe(flow, moments, end, scales),
        lambda: table.rows(_COLUMNS),
        plotted,
    )


def _content(flow: Flow, table: Dataset, end: Outcome, scales: Scales | None) -> dict[str, Any]:
    from chuteflow.io.contract import chute_object, factor, flow_object, units_object
    from chuteflow.steady.quantities import NUMBERS

    rate = factor("growth", flow.chute, scales)
    return {
        "chute": chute_object(flow.chute),
        "from": flow_object(flow, scales),
        **{symbol: table.lists(name) for symbol, name in _COLUMNS.items()},
        "steady": [flow_object(candidate, scales) for candidate in end.steady],
        "nearest": end.nearest,
        "distance": end.distance if end.nearest is not None else None,
        "rate": rate * end.rate,
        "leading": None if end.leading is None else rate * end.leading,
        "arrested": end.arrested,
        **units_object(scales, (*NUMBERS, "time", "growth")),
    }


def _describe(flow: Flow, moments: Sequence[RelaxationState], end: Outcome, scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import words
    from chuteflow.io.contract import factor
    from chuteflow.io.tables import number, table
    from chuteflow.steady.quantities import SCALED

    wanted = {round(i * (len(moments) - 1) / (_ROWS - 1)) for i in range(_ROWS)}
    by = {name: factor(name, flow.chute, scales) for name in _COLUMNS.values()}
    rows = [[number(by[name] * getattr(moments[i], name)) for name in by] for i in sorted(wanted)]
    units = [] if scales is None else [[f"[{SCALED[name].unit}]" for name in by]]
    yield from words.introduction(flow.chute, scales)
    yield ""
    yield table([list(_COLUMNS), *units, *rows])
    yield ""
    yield _verdict(flow, moments[-1], end, scales)


def _verdict(flow: Flow, last: RelaxationState, end: Outcome, scales: Scales | None) -> str:
    from chuteflow.io.words import amount

    def show(name: str, value: float) -> str:
        return amount(name, value, flow.chute, scales)

    ended = show("time", last.time)
    if end.arrested:
        return f"it comes to rest at t = {ended}: collisions take more energy than the slope gives"
    if end.nearest is None:
        return f"no steady flow has this hold-up within the range searched, M = {show('mass_holdup', flow.mass_holdup)}"
    target = end.steady[end.nearest]
    same = abs(target.surface_temperature / flow.surface_temperature - 1.0) < 1e-6
    name = (
        "the flow it came from"
        if same
        else f"another flow of the same hold-up, Q = {show('mass_flux', target.mass_flux)}"
    )
    away = f"{100.0 * end.distance:.2g} % away"
    if end.distance < _SETTLED:
        return f"it has come to {name}: {away} at t = {ended}"
    rate = f"the distance changed at the rate {show('growth', end.rate)} in the last fifth of the time"
    if end.leading is not None:
        rate += (
            f" (the leading discrete mode of that flow has the rate {show('growth', end.leading)}; what is slower "
            "belongs to the continuous spectrum and depends on the grid)"
        )
    if end.distance < _ARRIVED and end.rate < 0.0:
        return f"it comes to {name}: {away} at t = {ended}, and {rate}"
    return f"not settled at t = {ended}: the nearest is {name}, {away}, and {rate}; give a longer --duration"
