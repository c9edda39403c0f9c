"""``chuteflow growth``: growth rates of one flow over wavenumbers along and across the slope, and neutral curves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.stability.planes import WaveMap
    from chuteflow.steady.quantities import Scales

#: Endings of the files that --save writes.
SAVED = (".csv", ".json")
_EPILOG = (
    "Rates are in sqrt(g cos(theta)/d), wavenumbers in 1/d. A map of 40x40 takes about half a minute.\n\n"
    "Example: chuteflow growth --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3 --size 12x12"
)


@click.command("growth", help=COMMANDS["growth"], epilog=_EPILOG)
@options.chute_options
@options.condition_options
@options.flow_option
@options.option(
    "--kx",
    type=options.IntervalType(units=True),
    help="Wavenumbers along the slope; by default to three times that of the maximum.",
)
@options.option("--ky", type=options.IntervalType(units=True), help="Wavenumbers across the slope.")
@options.option("--size", type=options.Size("MxN", "40x40"), help="Points along kx and ky; 40x40 by default.")
@options.output_options(SAVED)
def command(**given: Any) -> None:
    """Solve, map, print, save and draw."""
    options.require_outputs(given, SAVED)
    chute = options.chute(given)
    scales = options.scales(given)
    condition: dict[str, Any] = options.condition(given, chute, scales)
    kx, ky = (options.own(given, name, "wavenumber", chute.slope, scales) for name in ("kx", "ky"))
    flow = options.solve_one(given, chute, condition, scales, {"flow": None})
    if flow is None:
        return
    from chuteflow.io.growth_records import wave_object, wave_rows
    from chuteflow.stability.planes import wave_map

    size = {} if given["size"] is None else {"size": given["size"]}
    with Progress() as progress:
        mapped = wave_map(
            flow,
            kx=kx,
            ky=ky,
            progress=lambda fraction: progress.show(f"{fraction:.0%} of the map"),
            **size,
        )

    def plotted() -> Figure:
        from chuteflow.plotting.growth_plot import plot_wave_map

        return plot_wave_map(mapped, scales=scales)

    options.deliver_object(
        given, wave_object(mapped, scales), _report(mapped, scales), lambda: wave_rows(mapped, scales), plotted
    )


def describe_unknown_points(growth: Any, unresolved: Any) -> Iterator[str]:
    """At how many points of a map no mode is resolved, and at how many it is not known whether something grows."""
    hidden = int((np.isnan(growth) & ~unresolved).sum())
    if hidden:
        yield f"no mode is distinguished from the continuous spectrum, which decays, at {hidden} points"
    if unresolved.any():
        yield (
            f"not known at {int(unresolved.sum())} points: the finest grids do not resolve whether a disturbance grows"
            " there"
        )


def _report(found: WaveMap, scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import contract, tables, words

    flow = found.flow
    yield from words.introduction(flow.chute, scales)

    def show(name: str, value: float) -> str:
        return words.amount(name, value, flow.chute, scales)

    yield (f"flow: Q = {show('mass_flux', flow.mass_flux)}, h = {show('centre_of_mass', flow.centre_of_mass)}")
    yield ""
    growth = np.where(np.isfinite(found.growth), found.growth, -np.inf)
    i, j = np.unravel_index(int(growth.argmax()), growth.shape)
    if np.isfinite(growth[i, j]):
        yield (
            f"largest growth on the map: {show('growth', float(growth[i, j]))} at kx = "
            f"{show('wavenumber', float(found.kx[i]))}, ky = {show('wavenumber', float(found.ky[j]))}"
        )
    yield (
        f"growing: {int(found.grows.sum())} of {growth.size} points; growth below {_least(found, scales)} or below "
        "its error counts as none"
    )
    yield from describe_unknown_points(found.growth, found.unresolved)
    yield ""
    if not found.neutral:
        yield "no neutral curve in this range"
        return
    rows = [["neutral curve", "points", "from kx", "ky", "to kx", "ky", "error", "ends at"]]
    wave = contract.factor("wavenumber", flow.chute, scales)
    if scales is not None:
        rows.append(["", "", *["[1/m]"] * 5, ""])
    for number, curve in enumerate(found.neutral, 1):
        ends = [tables.number(wave * float(value)) for z in (curve.z[0], curve.z[-1]) for value in z]
        where = curve.ends[1] if curve.ends[0] == curve.ends[1] else "; ".join(curve.ends)
        rows.append([str(number), str(len(curve.z)), *ends, f"{wave * curve.error.max():.0e}", where])
    yield tables.table(rows, words=(7,))


def _least(found: WaveMap, scales: Scales | None) -> str:
    from chuteflow.io.contract import factor

    rate = found.smallest_rate * factor("growth", found.flow.chute, scales)
    return f"{rate:.2g}" + ("" if scales is None else " 1/s")
