"""``chuteflow curve``: every family of flows of a chute, with its special points."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from chuteflow.faces import options
from chuteflow.faces.commands import COMMANDS

if TYPE_CHECKING:
    from chuteflow.analysis.results import Branch, Curve
    from chuteflow.steady.quantities import Scales

_EPILOG = "Example: chuteflow curve --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --search-temperature 0.01:500"


@click.command("curve", help=COMMANDS["curve"], epilog=_EPILOG)
@options.chute_options
@options.option("--points", type=click.INT, help="Flows on the longest branch; 200 by default.")
@options.search_options
@options.output_options
@options.scale_options
def command(**given: Any) -> None:
    """Trace, print, save and draw."""
    chute = options.chute(given)
    scales = options.scales(given)
    options.require_outputs(given)
    from chuteflow.analysis.curve import curve

    points = {} if given["points"] is None else {"points": given["points"]}
    found = curve(chute, **points, **options.search(given))
    if given["save"]:
        from chuteflow.faces.files import save

        save(found, given["save"], scales=scales)
    if given["plot"]:
        from chuteflow.faces.plots import plot_curve, write_figure

        write_figure(plot_curve(found, scales=scales), given["plot"])
    if given["as_json"]:
        from chuteflow.faces import contract

        click.echo(contract.text(contract.curve_object(found, scales)))
    else:
        click.echo("\n".join(_report(found, scales)))


def _report(found: Curve, scales: Scales | None) -> Iterator[str]:
    from chuteflow.faces import words

    yield words.chute(found.chute)
    if scales is not None:
        yield words.scales(scales)
    for i, branch in enumerate(found.branches, 1):
        yield ""
        yield f"family {i} of {len(found.branches)}, {len(branch.flows)} flows"
        yield _points(branch, found, scales)
    yield ""
    if found.branches:
        yield words.multiplicity(found, scales)
    else:
        yield words.in_own_units(f"no flow: {found.reason}", scales)
    yield words.searched(found.searched, found.chute, scales)


def _points(branch: Branch, found: Curve, scales: Scales | None) -> str:
    from chuteflow.analysis.results import KINDS
    from chuteflow.faces import contract, tables, words

    chosen = [
        ("begins", branch.flows[0], words.in_own_units(branch.ends[0], scales)),
        *((point.kind, point.flow, KINDS[point.kind]) for point in branch.special),
        ("ends", branch.flows[-1], words.in_own_units(branch.ends[1], scales)),
    ]
    header = [["", *cells, ""] for cells in tables.heading(contract.PLACE, scales)]
    rows = [[kind, *tables.numbers(flow, contract.PLACE, found.chute, scales), what] for kind, flow, what in chosen]
    return tables.table([*header, *rows], words=(0, len(contract.PLACE) + 1))
