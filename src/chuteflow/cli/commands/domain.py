"""``chuteflow domain``: where flows exist, how many and of which kind, over two parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress
from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY
from chuteflow.processes import available_cores

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.maps import Domain
    from chuteflow.steady.chute import Chute
    from chuteflow.steady.quantities import Scales

#: Processes at most, by default.
_MOST_PROCESSES = 8
_EPILOG = (
    "Example: chuteflow domain --slope 0.1:0.5 --roughness 0.5:0.866 --e 0.8 --ew 0.8 --temperature 1,10,100"
    " --plot domain.pdf"
)


class NumbersInUnits(click.ParamType):
    """Numbers separated by commas; with a unit after them as typed."""

    name = "numbers"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...] | options.NumbersWithUnit:
        """The numbers."""
        numbers, unit = options.without_unit(str(value))
        texts = numbers.split(",")
        found = tuple(options.Number().convert(one, param, ctx) for one in texts)
        return options.NumbersWithUnit(tuple(texts), unit, ",") if unit else found


@click.command("domain", help=COMMANDS["domain"], epilog=_EPILOG)
@options.range_options("puts it on an axis")
@options.option("--size", type=options.Size("NXxNY", "400x400"), help="Cells along x and y; 400x400 by default.")
@options.option(
    "--temperature", type=NumbersInUnits(), help="Surface temperatures at which to look for flows, as 1,10,100."
)
@options.option(
    "--tolerance", type=options.Number(), help="Fraction of an axis to locate boundaries to; 0.002 by default."
)
@options.search_range_options
@options.option("--processes", type=click.INT, help="Processes to compute in; by default one for each core, up to 8.")
@options.output_options()
def command(**given: Any) -> None:
    """Map, print, save and draw."""
    x, y, chute = _plane(given)
    scales = options.scales(given)
    slope = None if "slope" in (x[0], y[0]) else chute.slope
    temperatures = options.own(given, "temperature", "surface_temperature", slope, scales)
    search = options.search(given, slope, scales)
    options.require_outputs(given)
    from chuteflow.maps import domain

    asked = {"size": given["size"], "temperatures": temperatures}
    chosen = {name: value for name, value in asked.items() if value is not None}
    workers = given["processes"]
    if workers is None:
        workers = min(available_cores(), _MOST_PROCESSES)
    with Progress() as progress:
        found = domain(
            chute,
            x,
            y,
            workers=workers,
            progress=lambda done, known: progress.show(f"{done} of {known} columns, as far as is known"),
            **chosen,
            **search,
        )
    from chuteflow.io.domain_records import domain_object, in_si

    def plotted() -> Figure:
        from chuteflow.plotting.domain_plot import plot_domain

        return plot_domain(found)

    options.deliver(
        given,
        lambda: domain_object(found) | in_si(found, scales),
        _report(found, scales),
        options.saver(found),
        plotted,
    )


def _plane(given: Mapping[str, Any]) -> tuple[Any, Any, Chute]:
    """Both axes, the first given on x, and the chute at the lower ends of both.

    Raises:
        InputError: for more or fewer than two ranges.
    """
    # Options come in the order in which they are written.
    ranges = {name: value for name, value in given.items() if name in BY_KEY and isinstance(value, tuple)}
    if len(ranges) != 2:
        got = ", ".join(f"--{name} {low:g}:{high:g}" for name, (low, high) in ranges.items()) or "none"
        raise InputError(
            f"{len(ranges)} ranges ({got}): give two of --slope, --e, --ew and --roughness as LO:HI, "
            "for example --slope 0.1:0.5 --roughness 0.5:0.866"
        )
    axes = [(BY_KEY[name].name, *bounds) for name, bounds in ranges.items()]
    return axes[0], axes[1], options.chute({**given, **{name: low for name, (low, _) in ranges.items()}})


def _report(found: Domain, scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import tables, words
    from chuteflow.io.contract import SHORT
    from chuteflow.io.datasets import BITS, CLASSES
    from chuteflow.io.domain_records import shares

    plane = found.plane
    x, y = plane.x, plane.y
    yield (
        f"domain: {SHORT[x.name]} from {x.low:g} to {x.high:g}, {SHORT[y.name]} from {y.low:g} to {y.high:g}, "
        f"{len(found.x)} x {len(found.y)} cells"
    )
    others = [
        f"{key} = {getattr(plane.chute, parameter.name):g}"
        for key, parameter in BY_KEY.items()
        if parameter.name not in (x.name, y.name)
    ]
    yield f"chute: {', '.join(others)}, surface {plane.chute.surface}, {plane.chute.laws}"
    yield ""
    rows = [["", "value", "fraction of the plane"]]
    parts = shares(found)
    for name, (_, values) in CLASSES.items():
        for value, fraction in parts[name].items():
            rows.append([name, _name(int(value), values, name in BITS), f"{fraction:.2%}"])
    of = None if "slope" in (x.name, y.name) else scales
    for temperature, part in zip(plane.temperatures, parts["exists_at"], strict=True):
        at = words.amount("surface_temperature", temperature, plane.chute, of) if of else f"{temperature:g}"
        rows.append([f"a flow at T = {at}", "flow", f"{part.get('1', 0.0):.2%}"])
    yield tables.table(rows, words=(0, 1))
    yield ""
    kinds = [one.kind for one in found.boundaries]
    said = ", ".join(f"{kind} {kinds.count(kind)}" for kind in dict.fromkeys(kinds))
    yield f"boundaries (lines of each kind): {said or 'none'}"
    yield f"boundaries are located to {found.tolerance:g} of each axis, and narrower bands may be left out"
    yield words.searched(found.searched, plane.chute, of)
    if scales is not None and of is None:
        yield "temperatures and hold-ups are dimensionless: their scales change with the slope"


def _name(value: int, values: Mapping[int, str], bits: bool) -> str:
    if bits:
        return " and ".join(name for bit, name in values.items() if value & bit) or "no flow"
    return values.get(value, str(value)).replace("_", " ")
