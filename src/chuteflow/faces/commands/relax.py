"""``chuteflow relax``: a disturbed flow followed in time, to the steady flow that it comes to."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from chuteflow.errors import InputError
from chuteflow.faces import options
from chuteflow.faces.commands import COMMANDS

if TYPE_CHECKING:
    from chuteflow.stability.relaxation import Layer, Moment, Outcome
    from chuteflow.steady.flow import Flow

#: Rows of the table that is printed, and nearness that counts as arrival.
_ROWS, _ARRIVED = 12, 0.01
_COLUMNS = {
    "t": "time",
    "Q": "mass_flux",
    "h": "centre_of_mass",
    "T_surface": "surface_temperature",
    "T_base": "base_temperature",
}
_SAVED = (".csv", ".json")


@click.command("relax", help=COMMANDS["relax"])
@options.chute_options
@options.condition_options
@options.option("--flow", "which", type=int, help="Which of the flows found, 1 for the hottest (the default).")
@options.option("--heat", type=options.Number(), help="Factor on the granular temperature; 1.1 by default.")
@options.option("--push", type=options.Number(), help="Factor on the velocity; 1 by default.")
@options.option("--duration", type=options.Number(), help="Time in sqrt(d/(g cos theta)); 2000 by default.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@options.option("--plot", metavar="FILE", help="Draw into FILE: .png, .pdf or .svg.")
@options.option("--save", metavar="FILE", help="Write the way to FILE: .csv or .json.")
def command(as_json: bool, **given: Any) -> None:
    """Solve, disturb, follow and tell."""
    from chuteflow.analysis.enumeration import flows
    from chuteflow.faces.writing import require_writable
    from chuteflow.stability.relaxation import Layer, disturbed, outcome

    chute = options.chute(given)
    for name, suffixes in (("save", _SAVED), ("plot", options.DRAWN)):
        if given[name] is not None:
            require_writable(given[name], suffixes)
    duration = 2000.0 if given["duration"] is None else given["duration"]
    if not 0.0 < duration <= 1e8:
        raise InputError(f"--duration {duration:g}: must be above 0 and at most 1e8")
    asked: dict[str, Any] = options.condition(given, chute, None)
    found = flows(chute, **asked)
    if not len(found):
        click.echo(json.dumps({"flows": [], "reason": found.reason}) if as_json else f"no flow: {found.reason}")
        return
    number = 1 if given["which"] is None else given["which"]
    if not 1 <= number <= len(found):
        raise InputError(f"--flow {number}: there are {len(found)}, choose from 1 (hottest) to {len(found)}")
    flow = found[number - 1]
    layer = Layer.of(flow)
    start = disturbed(
        layer,
        layer.steady(flow),
        temperature=1.1 if given["heat"] is None else given["heat"],
        velocity=1.0 if given["push"] is None else given["push"],
    )
    moments = _followed(layer, start, duration)
    end = outcome(layer, moments)
    content = _content(flow, moments, end)
    if given["save"] is not None:
        _save(content, given["save"])
    if given["plot"] is not None:
        _plot(moments, end, given["plot"])
    click.echo(json.dumps(content, allow_nan=False) if as_json else _told(flow, moments, end))


def _followed(layer: Layer, start: Any, duration: float) -> list[Moment]:
    """All moments; how far it is, on a terminal, once a second."""
    from chuteflow.stability.relaxation import relax

    moments: list[Moment] = []
    shown = time.monotonic()
    telling = click.get_text_stream("stderr").isatty()
    for moment in relax(layer, start, duration):
        moments.append(moment)
        if telling and time.monotonic() > shown + 1.0:
            shown = time.monotonic()
            click.echo(f"t = {moment.time:.6g} of {duration:.6g}", err=True)
    return moments


def _content(flow: Flow, moments: Sequence[Moment], end: Outcome) -> dict[str, Any]:
    from chuteflow.faces.contract import chute_object, flow_object

    return {
        "chute": chute_object(flow.chute),
        "from": flow_object(flow),
        **{symbol: [getattr(moment, name) for moment in moments] for symbol, name in _COLUMNS.items()},
        "steady": [flow_object(candidate) for candidate in end.steady],
        "nearest": end.nearest,
        "distance": end.distance if end.nearest is not None else None,
        "rate": end.rate,
    }


def _told(flow: Flow, moments: Sequence[Moment], end: Outcome) -> str:
    from chuteflow.faces.tables import number, table

    wanted = {round(i * (len(moments) - 1) / (_ROWS - 1)) for i in range(_ROWS)}
    rows = [[number(getattr(moments[i], name)) for name in _COLUMNS.values()] for i in sorted(wanted)]
    return f"{table([list(_COLUMNS), *rows])}\n\n{_verdict(flow, moments[-1], end)}"


def _verdict(flow: Flow, last: Moment, end: Outcome) -> str:
    from chuteflow.faces.tables import number

    if end.nearest is None:
        return f"no steady flow has this hold-up within the range searched, M = {number(flow.mass_holdup)}"
    target = end.steady[end.nearest]
    same = abs(target.surface_temperature / flow.surface_temperature - 1.0) < 1e-6
    name = "the flow it came from" if same else f"another flow of the same hold-up, Q = {number(target.mass_flux)}"
    away = f"{100.0 * end.distance:.2g} % away"
    pace = f"the distance changes at the rate {end.rate:.4g}"
    if end.distance < _ARRIVED and end.rate < 0.0:
        return f"it comes to {name}: {away} at t = {number(last.time)}; {pace}"
    return f"not settled at t = {number(last.time)}: the nearest is {name}, {away}; {pace}; give a longer --duration"


def _save(content: dict[str, Any], path: str) -> None:
    from chuteflow.faces.writing import written_beside

    with written_beside(path) as partial:
        if path.lower().endswith(".json"):
            partial.write_text(json.dumps(content, allow_nan=False) + "\n", encoding="utf-8")
        else:
            rows = zip(*(content[symbol] for symbol in _COLUMNS), strict=True)
            lines = [",".join(_COLUMNS), *(",".join(map(repr, row)) for row in rows)]
            partial.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _plot(moments: Sequence[Moment], end: Outcome, path: str) -> None:
    from chuteflow.faces.plots import write_figure
    from chuteflow.paper import style

    figure, axes = style.panels(3, height=3.0)
    for ax, name in zip(axes, ("mass_flux", "centre_of_mass", "base_temperature"), strict=True):
        ax.plot([m.time for m in moments], [getattr(m, name) for m in moments], **style.stroke(0).line())
        for flow in end.steady:
            ax.axhline(getattr(flow, name), linestyle=":", color=style.BLACK, linewidth=0.8)
        style.name_axes(ax, "time $t$", style.label(name))
    write_figure(figure, path)
