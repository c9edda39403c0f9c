"""``chuteflow boundary``: folds and other special points, followed through a second parameter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress
from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY
from chuteflow.steady.quantities import NUMBERS, PLACE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.bifurcations.boundary import Boundary, BoundarySet
    from chuteflow.steady.quantities import Scales

#: The numbers that can stand on the vertical axis, by their symbols.
_UPRIGHT = {NUMBERS[name].symbol: name for name in PLACE}
_EPILOG = (
    "Example: chuteflow boundary --of fold-Q --in slope,Q --slope 0.2:0.45 --e 0.8 --ew 0.8 --roughness 0.6"
    " --plot folds.png"
)


class PlaneType(click.ParamType):
    """The second parameter and the number on the vertical axis."""

    name = "parameter,quantity"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, str]:
        """Both names."""
        names = [name.strip() for name in str(value).split(",")]
        if len(names) != 2 or names[0] not in BY_KEY or names[1] not in _UPRIGHT:
            self.fail(
                f"{value!r}: write one of {', '.join(BY_KEY)}, a comma and one of {', '.join(_UPRIGHT)}, "
                "for example slope,Q",
                param,
                ctx,
            )
        return names[0], names[1]


@click.command("boundary", help=COMMANDS["boundary"], epilog=_EPILOG)
@options.option(
    "--of",
    metavar="KIND",
    help="What to follow: fold-Q (the default), fold-M, fold-T, density-inversion or interior-change.",
)
@options.option("--in", "plane", type=PlaneType(), help="Second parameter and vertical axis; slope,Q by default.")
@options.range_options("where it is the second parameter")
@options.option("--samples", type=click.INT, help="Values of the second parameter to start from; 13 by default.")
@options.search_options
@options.output_options()
def command(**given: Any) -> None:
    """Follow, print, save and draw."""
    second, upright = given["plane"] or ("slope", "Q")
    bounds, chute = _chute(given, second)
    scales = options.scales(given)
    slope = None if second == "slope" else chute.slope
    search = options.search(given, slope, scales)
    options.require_outputs(given)
    from chuteflow.bifurcations.boundary import boundary

    chosen = {name: given[option] for name, option in (("of", "of"), ("samples", "samples")) if given[option]}
    with Progress() as progress:
        found = boundary(
            chute,
            second=BY_KEY[second].name,
            bounds=bounds,
            progress=lambda what, fraction: progress.show(f"{what}, {fraction:.0%} of the range"),
            **chosen,
            **search,
        )
    from chuteflow.io.boundary_records import boundaries_object

    def plotted() -> Figure:
        from chuteflow.bifurcations.diagram import diagram
        from chuteflow.plotting.boundary_plot import plot_boundaries, plot_none

        return plot_boundaries(diagram(found, _UPRIGHT[upright]), scales=scales) if len(found) else plot_none(found)

    options.deliver(
        given,
        lambda: boundaries_object(found, scales),
        _report(found, second, scales),
        options.saver(found, scales),
        plotted,
    )


def _chute(given: Mapping[str, Any], second: str) -> tuple[tuple[float, float], Any]:
    """The range of the second parameter, and the chute at its lower end.

    Raises:
        InputError: for a range that is missing, or given for another parameter.
    """
    for name in BY_KEY:
        if name != second and isinstance(given[name], tuple):
            low, high = given[name]
            raise InputError(
                f"--{name} {low:g}:{high:g}: only --{second} takes a range; follow through {name} with --in {name},Q"
            )
    bounds = given[second]
    if not isinstance(bounds, tuple):
        got = "is missing" if bounds is None else f"is {bounds:g}"
        raise InputError(f"--{second} {got}: the second parameter takes a range LO:HI, for example 0.5:0.8")
    return bounds, options.chute({**given, second: bounds[0]})


def _report(found: BoundarySet, second: str, scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import words

    yield f"{found.kind} through {second} from {found.bounds[0]:g} to {found.bounds[1]:g}"
    others = {key: getattr(found.chute, parameter.name) for key, parameter in BY_KEY.items() if key != second}
    said = ", ".join(f"{name} = {value:g}" for name, value in others.items())
    yield f"chute: {said}, surface {found.chute.surface}, {found.chute.laws}"
    if scales is not None:
        yield words.scales(scales)
    for i, boundary in enumerate(found, 1):
        yield ""
        yield f"boundary {i} of {len(found)}, {len(boundary.flows)} points"
        yield _points(boundary, second, scales)
    yield ""
    if found.reason:
        yield f"no boundary: {found.reason}" + (", within the range searched" if found.incomplete else "")
    else:
        largest = max(float(boundary.error.max()) for boundary in found)
        yield f"error: estimated relative error of Q, h, M and {second}, at most {largest:.0e}"
    yield words.in_own_units(words.searched(found.searched, found.chute, None), scales)
    yield (
        f"entered at {len(found.sampled)} values of {second}: a boundary between two of them, which the flows at "
        "neither come near, could be missed"
    )
    if found.incomplete:
        yield f"there may be more: {found.incomplete}"
    if found.skipped:
        yield f"not entered, since branches could not be followed there: {', '.join(f'{v:g}' for v in found.skipped)}"


def _points(boundary: Boundary, second: str, scales: Scales | None) -> str:
    """Both ends and the turning points of a boundary as a table."""
    from chuteflow.bifurcations.tracing import TURNS
    from chuteflow.io import contract, tables

    chosen = [
        ("begins", boundary.flows[0], boundary.ends[0]),
        *((turn.kind, turn.flow, TURNS[turn.kind]) for turn in boundary.special),
        ("ends", boundary.flows[-1], boundary.ends[1]),
    ]
    header = tables.heading(contract.PLACE, scales, before=(("", ""), (second, "1")), after=(("", ""),))
    rows = [
        [
            kind,
            tables.number(getattr(flow.chute, boundary.second)),
            *tables.numbers(flow, contract.PLACE, flow.chute, scales),
            what,
        ]
        for kind, flow, what in chosen
    ]
    return tables.table([*header, *rows], words=(0, len(contract.PLACE) + 2))
