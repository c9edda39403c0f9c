"""``chuteflow compare-closures``: the flows of one chute under several constitutive laws, compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.branches.results import FlowSet
    from chuteflow.steady.quantities import Scales

_EPILOG = (
    "Example: chuteflow compare-closures --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3 "
    "--with lun,extended --plot laws.png"
)
_COLUMNS = ("centre_of_mass", "mass_holdup", "surface_temperature", "base_volume_fraction", "largest_volume_fraction")


@click.command("compare-closures", help=COMMANDS["compare-closures"], epilog=_EPILOG)
@options.chute_options
@click.option(
    "--with",
    "closures",
    metavar="NAME",
    multiple=True,
    help="A closure to compare, with parameters as in extended:packing=0.64; repeat the option, or separate names "
    "without parameters by commas. All of the list by default.",
)
@options.condition_options
@options.search_options
@options.output_options((".csv", ".json"), "Q-h curves and profiles")
def command(**given: Any) -> None:
    """Solve the chute with each, print and draw."""
    if click.get_current_context().params["closure"] is not None or given["settings"]:
        raise InputError("compare-closures takes the closures by --with, such as --with lun --with extended")
    chute = options.chute(given)
    scales = options.scales(given)
    condition = options.condition(given, chute, scales)
    options.require_outputs(given, (".csv", ".json"))
    from dataclasses import replace

    from chuteflow.branches.enumeration import flows

    # Every chute is checked before anything is computed.
    chutes = [replace(chute, closure=name) for name in options.closure_names(given["closures"])]
    search = options.search(given, chute.slope, scales)
    found = [flows(one, **condition, **search) for one in chutes]

    def plotted() -> Figure:
        from chuteflow.branches.curve import curve
        from chuteflow.plotting.closure_plot import plot_comparison

        return plot_comparison(found, [curve(one, **search) for one in chutes], scales=scales)

    content = _content(found, scales)
    options.deliver_object(given, content, _report(found, scales), lambda: _rows(content), plotted)


def _content(found: Sequence[FlowSet], scales: Scales | None) -> dict[str, Any]:
    from chuteflow.io import contract

    sets = [contract.flow_set_object(flow_set, scales) for flow_set in found]
    return {"chute": _without_closure(sets[0]["chute"]), "closures": sets}


def _rows(content: dict[str, Any]) -> Iterator[list[Any]]:
    """Every flow under every law as a row."""
    from chuteflow.steady.quantities import NUMBERS

    symbols = [quantity.symbol for quantity in NUMBERS.values()]
    yield ["closure", *symbols, "error"]
    for one in content["closures"]:
        for flow in one["flows"]:
            yield [one["chute"]["closure"], *(flow[symbol] for symbol in (*symbols, "error"))]


def _without_closure(chute: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in chute.items() if name != "closure"}


def _report(found: Sequence[FlowSet], scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import tables, words

    first, *rest = words.introduction(found[0].chute, scales)
    yield from (first.rpartition(", closure")[0], *rest)
    yield ""
    after = (("error", "1"), ("validity", ""))
    header = tables.heading(("mass_flux", *_COLUMNS), scales, before=(("closure", ""),), after=after)
    rows: list[list[str]] = []
    for flow_set in found:
        name = str(flow_set.chute.closure)
        if not len(flow_set):
            rows.append([name, *[""] * (len(header[0]) - 2), "no flow"])
        for flow in flow_set:
            cells = tables.numbers(flow, ("mass_flux", *_COLUMNS), flow.chute, scales)
            rows.append([name, *cells, f"{flow.error:.0e}", flow.validity.summary])
    yield tables.table([*header, *rows], words=(0, len(header[0]) - 1))
    yield ""
    for flow_set in found:
        if flow_set.reason:
            yield f"{flow_set.chute.closure}: {words.in_own_units(f'no flow: {flow_set.reason}', scales)}"
        if flow_set.incomplete:
            yield f"{flow_set.chute.closure}: {words.in_own_units(f'there may be more: {flow_set.incomplete}', scales)}"
