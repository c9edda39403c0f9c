"""``chuteflow curve``: every branch of flows of a chute, with its special points."""

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

    from chuteflow.branches.results import Branch, Curve
    from chuteflow.stability.along import MarkedBranch, MarkedCurve
    from chuteflow.steady.quantities import Scales

_EPILOG = "Example: chuteflow curve --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --search-temperature 0.01:500"


@click.command("curve", help=COMMANDS["curve"], epilog=_EPILOG)
@options.chute_options
@options.option("--points", type=click.INT, help="Flows on the longest branch; 200 by default.")
@click.option(
    "--stability", is_flag=True, help="Compute the stability of flows along each branch; mark where it changes."
)
@options.option("--samples", type=click.INT, help="Flows on each branch to examine with --stability; 24 by default.")
@options.search_options
@options.output_options()
def command(**given: Any) -> None:
    """Trace, print, save and draw."""
    chute = options.chute(given)
    scales = options.scales(given)
    options.require_outputs(given)
    if given["samples"] is not None and not given["stability"]:
        raise InputError("--samples is the number of flows for --stability: give both")
    from chuteflow.branches.curve import curve

    points = {} if given["points"] is None else {"points": given["points"]}
    found = curve(chute, **points, **options.search(given, chute.slope, scales))
    near, lines = ({}, []) if found.branches else options.nearest(given, chute, {}, scales)
    stability = _mark_stability(found, given["samples"]) if given["stability"] else None
    if stability is not None:
        found = stability.curve

    def plotted() -> Figure:
        from chuteflow.plotting.plots import plot_curve
        from chuteflow.plotting.stability_curve import plot_marked

        return plot_curve(found, scales=scales) if stability is None else plot_marked(stability, scales=scales)

    options.deliver(
        given,
        lambda: _content(found, stability, scales) | near,
        _report(found, stability, lines, scales),
        options.saver(found, scales),
        plotted,
    )


def _content(found: Curve, stability: MarkedCurve | None, scales: Scales | None) -> dict[str, Any]:
    from chuteflow.io.contract import curve_object

    content = curve_object(found, scales)
    if stability is not None:
        from chuteflow.io.stability_curve import changes_objects, samples_objects

        objects = samples_objects(stability, scales), changes_objects(stability, scales)
        for branch, samples, changes in zip(content["branches"], *objects, strict=True):
            branch["stability"], branch["stability_changes"] = samples, changes
    return content


def _mark_stability(found: Curve, samples: int | None) -> MarkedCurve:
    from chuteflow.stability.along import mark_stability

    chosen = {} if samples is None else {"samples": samples}
    with Progress() as progress:
        return mark_stability(
            found, progress=lambda fraction: progress.show(f"{fraction:.0%} of the flows examined"), **chosen
        )


def _report(found: Curve, stability: MarkedCurve | None, near: Sequence[str], scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import words

    yield from words.introduction(found.chute, scales)
    for i, branch in enumerate(found.branches, 1):
        yield ""
        yield f"branch {i} of {len(found.branches)}, {len(branch.flows)} flows"
        yield _points(branch, found, scales)
        yield from words.validity(branch.flows, found.chute, scales)
        if stability is not None:
            yield _stretches(stability.branches[i - 1], found, scales)
    yield ""
    if found.branches:
        yield words.multiplicity(found, scales)
    yield from words.search_outcome(found, scales, near)


def _stretches(branch: MarkedBranch, found: Curve, scales: Scales | None) -> str:
    """Stable and unstable stretches of a branch in words."""
    from chuteflow.io.stability_curve import change_words, stretch

    said = [stretch(run, found.chute, scales) for run in branch.runs]
    ends = [change_words(change, found.chute, scales) for change in branch.changes]
    lines = [f"stability, by {len(branch.samples)} flows: " + "; ".join(said)]
    return "\n".join([*lines, *(["ends of stable ranges: " + "; ".join(ends)] if ends else [])])


def _points(branch: Branch, found: Curve, scales: Scales | None) -> str:
    from chuteflow.branches.results import KINDS
    from chuteflow.io import contract, tables, words

    chosen = [
        ("begins", branch.flows[0], words.in_own_units(branch.ends[0], scales)),
        *((point.kind, point.flow, KINDS[point.kind]) for point in branch.special),
        ("ends", branch.flows[-1], words.in_own_units(branch.ends[1], scales)),
    ]
    header = tables.heading(contract.PLACE, scales, before=(("", ""),), after=(("", ""),))
    rows = [[kind, *tables.numbers(flow, contract.PLACE, found.chute, scales), what] for kind, flow, what in chosen]
    return tables.table([*header, *rows], words=(0, len(contract.PLACE) + 1))
