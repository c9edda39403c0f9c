"""``chuteflow compare-closures``: the flows of one chute under several constitutive laws, side by side."""

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
    help="A closure to compare, with parameters as in extended:packing=0.64; give it several times, or names without "
    "parameters with commas between. All of the list by default.",
)
@options.condition_options
@options.search_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@options.option("--plot", metavar="FILE", help="Draw Q-h curves and profiles into FILE: .png, .pdf or .svg.")
def command(**given: Any) -> None:
    """Solve the chute with each, print and draw."""
    if given["closure"] is not None or given["settings"]:
        raise InputError("compare-closures takes the closures by --with, such as --with lun --with extended")
    chute = options.chute(given)
    condition = options.condition(given, chute, None)
    options.require_outputs({"save": None, **given})
    from dataclasses import replace

    from chuteflow.branches.enumeration import flows

    # Every chute is checked before anything is computed.
    chutes = [replace(chute, closure=name) for name in options.closure_names(given["closures"])]
    search = options.search(given)
    found = [flows(one, **condition, **search) for one in chutes]
    if given["as_json"]:
        from chuteflow.io import contract

        sets = [contract.flow_set_object(flow_set) for flow_set in found]
        answer = contract.text({"chute": _without_closure(sets[0]["chute"]), "closures": sets})
    else:
        answer = "\n".join(_report(found))

    def plotted() -> Figure:
        from chuteflow.branches.curve import curve
        from chuteflow.plotting.closure_plot import plot_comparison

        return plot_comparison(found, [curve(one, **search) for one in chutes])

    options.deliver({"save": None, **given}, answer, lambda _: None, plotted)


def _without_closure(chute: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in chute.items() if name != "closure"}


def _report(found: Sequence[FlowSet]) -> Iterator[str]:
    from chuteflow.io import tables, words

    yield words.chute(found[0].chute).rpartition(", closure")[0]
    yield ""
    header = ["closure", *tables.heading(("mass_flux", *_COLUMNS), None)[0], "error", "validity"]
    rows: list[list[str]] = []
    for flow_set in found:
        name = str(flow_set.chute.closure)
        if not len(flow_set):
            rows.append([name, *[""] * (len(header) - 2), "no flow"])
        for flow in flow_set:
            cells = tables.numbers(flow, ("mass_flux", *_COLUMNS), flow.chute, None)
            rows.append([name, *cells, f"{flow.error:.0e}", flow.validity.summary])
    yield tables.table([header, *rows], words=(0, len(header) - 1))
    yield ""
    for flow_set in found:
        if flow_set.reason:
            yield f"{flow_set.chute.closure}: no flow: {flow_set.reason}"
        if flow_set.incomplete:
            yield f"{flow_set.chute.closure}: there may be more: {flow_set.incomplete}"
