"""``chuteflow solve``: every steady flow of a chute at a flux, hold-up, centre of mass or temperature."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.branches.results import FlowSet
    from chuteflow.steady.quantities import Scales

_EPILOG = (
    "Numbers are dimensionless, in grain diameters d and sqrt(g d cos theta). With --diameter and --density "
    'results are in SI units; an AMOUNT may then carry a unit too, such as --flux "0.7 kg/m/s", and is '
    "dimensionless without one.\n\n"
    "Example: chuteflow solve --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3"
)
#: Columns of the table; the height of the interface is left out on the half-line.
_COLUMNS = (
    "mass_flux",
    "centre_of_mass",
    "mass_holdup",
    "surface_temperature",
    "base_temperature",
    "base_volume_fraction",
    "largest_volume_fraction",
    "slip_velocity",
    "depth",
    "interface_height",
)
_SPEEDS = ("mean_velocity", "surface_velocity", "froude_number", "mean_volume_fraction")


@click.command("solve", help=COMMANDS["solve"], epilog=_EPILOG)
@options.chute_options
@options.condition_options
@options.search_options
@options.output_options()
def command(**given: Any) -> None:
    """Solve, print, save and draw."""
    chute = options.chute(given)
    scales = options.scales(given)
    condition = options.condition(given, chute, scales)
    options.require_outputs(given)
    from chuteflow.branches.enumeration import flows

    found = flows(chute, **condition, **options.search(given, chute.slope, scales))
    near, lines = ({}, []) if len(found) else options.nearest(given, chute, condition, scales)
    from chuteflow.io.contract import flow_set_object

    def plotted() -> Figure:
        from chuteflow.plotting.plots import plot_flows

        return plot_flows(found, scales=scales)

    options.deliver(
        given,
        lambda: flow_set_object(found, scales) | near,
        _report(found, lines, scales),
        options.saver(found, scales),
        plotted,
    )


def _report(found: FlowSet, near: Sequence[str], scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import words

    yield from words.introduction(found.chute, scales)
    if found.flows:
        columns = [n for n in _COLUMNS if n != "interface_height" or found.chute.surface == "interface"]
        ends = [[f"{flow.error:.0e}", flow.validity.summary] for flow in found]
        yield ""
        yield _table(found, columns, (("error", "1"), ("validity", "")), ends, scales)
        yield ""
        yield _table(found, _SPEEDS, (), [[] for _ in found], scales)
        yield ""
        for i, flow in enumerate(found, 1):
            yield f"{i}  {words.among(flow, found)}: {words.kinds(flow)}"
        yield ""
        yield from words.notes(found)
        largest = max(flow.error for flow in found)
        yield f"error: estimated relative error of Q, h and M, at most {largest:.0e}"
    yield from words.search_outcome(found, scales, near)


def _table(
    found: FlowSet,
    columns: Sequence[str],
    after: Sequence[tuple[str, str]],
    ends: Sequence[list[str]],
    scales: Scales | None,
) -> str:
    """Numbers of the flows, one in a row, with other cells under ``after`` at their ends."""
    from chuteflow.io import tables

    header = tables.heading(columns, scales, before=(("", ""),), after=after)
    rows = [
        [str(i), *tables.numbers(flow, columns, found.chute, scales), *end]
        for i, (flow, end) in enumerate(zip(found, ends, strict=True), 1)
    ]
    return tables.table([*header, *rows], words=(len(columns) + 2,))
