"""``chuteflow neutral``: growth of waves in one direction along a branch of flows, and the neutral curves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.commands.growth import SAVED, describe_unknown_points
from chuteflow.cli.progress import Progress
from chuteflow.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.stability.planes import FamilyMap
    from chuteflow.steady.flow import Flow
    from chuteflow.steady.quantities import Scales

#: Columns of a table of a neutral curve.
_ALONG = ("mass_flux", "centre_of_mass", "surface_temperature")
_ANGLES = {"along": 0.0, "across": 90.0}
_EPILOG = (
    "k h is the wavenumber times the height of the centre of mass. The branch is that of the hottest flows in the "
    "range searched.\n\n"
    "Example: chuteflow neutral --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --waves across --size 16x16"
    " --plot neutral.png"
)


@click.command("neutral", help=COMMANDS["neutral"], epilog=_EPILOG)
@options.chute_options
@options.option("--waves", metavar="DIRECTION", help="along (the default), across, or an angle from 0 to 90 degrees.")
@options.option("--kh", type=options.IntervalType(), help="Range of k h; 0.001:1 by default.")
@options.option("--size", type=options.Size("MxN", "24x24"), help="Points along k h and the branch; 24x24 by default.")
@options.option(
    "--search-temperature", type=options.IntervalType(units=True), help="Surface temperatures; 0.05:50 by default."
)
@options.option("--largest-holdup", type=options.NumberInUnits(), help="Largest mass hold-up searched; 30 by default.")
@options.output_options(SAVED)
def command(**given: Any) -> None:
    """Trace, map, print, save and draw."""
    options.require_outputs(given, SAVED)
    chute = options.chute(given)
    angle = _angle(given["waves"])
    scales = options.scales(given)
    from chuteflow.stability.disturbed import FLOWS, TEMPERATURES

    within: dict[str, Any] = {"surface_temperature": TEMPERATURES, **options.search(given, chute.slope, scales)}
    from chuteflow.branches.curve import curve

    traced = curve(chute, points=FLOWS, **within)
    if not traced.branches:
        options.deliver_without_flow(given, traced, {}, scales, {"flows": None})
        return
    from chuteflow.io.growth_records import family_object, family_rows
    from chuteflow.stability.planes import family_map

    asked = {name: given[option] for name, option in (("depth_wavenumber", "kh"), ("size", "size")) if given[option]}
    with Progress() as progress:
        mapped = family_map(
            traced.branches[0].flows,
            angle=angle,
            progress=lambda fraction: progress.show(f"{fraction:.0%} of the map"),
            **asked,
        )

    def plotted() -> Figure:
        from chuteflow.plotting.growth_plot import plot_family_map

        return plot_family_map(mapped, scales=scales)

    options.deliver_object(
        given, family_object(mapped, scales), _report(mapped, scales), lambda: family_rows(mapped, scales), plotted
    )


def _angle(waves: str | None) -> float:
    if waves is None or waves in _ANGLES:
        return _ANGLES[waves or "along"]
    try:
        return float(waves)
    except ValueError:
        raise InputError(f"--waves {waves}: must be along, across or an angle from 0 to 90 degrees") from None


def _report(found: FamilyMap, scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import tables, words

    first, last = found.flows[0], found.flows[-1]
    low, high = (tables.number(float(found.depth_wavenumber[end])) for end in (0, -1))
    yield from words.introduction(found.flows[0].chute, scales)
    yield (
        f"branch: {_place(first, scales)} to {_place(last, scales)}; waves at {found.angle:g} degrees to the slope, "
        f"k h from {low} to {high}"
    )
    yield ""
    yield f"growing: {int(found.grows.sum())} of {found.growth.size} points"
    yield from describe_unknown_points(found.growth, found.unresolved)
    if not found.neutral:
        yield f"no neutral curve: {_without(found)}"
        return
    yield ""
    for number, (curve, flows) in enumerate(zip(found.neutral, found.neutral_flows, strict=True), 1):
        yield f"neutral curve {number}, {len(flows)} points, error of ln(k h) at most {curve.error.max():.0e}"
        yield f"it begins at {curve.ends[0]}, and ends at {curve.ends[1]}"
        header = tables.heading(_ALONG, scales, before=(("k h", "1"),))
        yield tables.table([*header, *_rows(curve.z[:, 0].tolist(), flows, scales)])
        yield ""


def _without(found: FamilyMap) -> str:
    """What the waves of the map do, as far as it is known."""
    known = "all waves of this range" if not found.unresolved.any() else "all waves of this range that are known"
    if found.grows.all(where=~found.unresolved):
        return f"{known} grow"
    return (
        f"none is followed between the {int(found.grows.sum())} points that grow and the others"
        if (found.grows.any())
        else f"{known} decay"
    )


def _place(flow: Flow, scales: Scales | None) -> str:
    from chuteflow.io.words import amount

    temperature = amount("surface_temperature", flow.surface_temperature, flow.chute, scales)
    return f"T_surface = {temperature}, Q = {amount('mass_flux', flow.mass_flux, flow.chute, scales)}"


def _rows(depth_wavenumber: Sequence[float], flows: Sequence[Flow], scales: Scales | None) -> Iterator[list[str]]:
    from chuteflow.io.tables import number, numbers

    count = min(len(flows), 9)
    for i in sorted({round(j * (len(flows) - 1) / max(count - 1, 1)) for j in range(count)}):
        flow = flows[i]
        yield [number(depth_wavenumber[i]), *numbers(flow, _ALONG, flow.chute, scales)]
