"""``chuteflow fit``: the parameters of a chute from measurements, with their uncertainties."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress
from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.fitting.calibration import Fit
    from chuteflow.fitting.comparison import LawComparison
    from chuteflow.steady.chute import Chute
    from chuteflow.steady.quantities import Scales

_EPILOG = (
    "Columns of the file: z, nu, T, u, numbers of the flow such as Q, M, h, depth, and errors such as nu_error or "
    "'nu_error [%]'; slope or angle, and experiment where there are several. Units as in 'z [mm]' need --diameter and "
    "--density.\n\n"
    "Example: chuteflow fit profile.csv --slope 0.3 --free e,ew,roughness --plot fit.png"
)
#: What is told of the flow of each experiment.
_PLACE = ("mass_flux", "centre_of_mass", "mass_holdup")
#: What free parameters of a chute are tried at first, where nothing is said.
_FIRST = {"slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6}
#: Parts of the depth for which residuals are summed up.
_BANDS = 4


class NamedRangeType(click.ParamType):
    """A name and two numbers as NAME=LO:HI."""

    name = "name=lo:hi"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, tuple[float, float]]:
        """The name and both ends."""
        name, equals, text = str(value).partition("=")
        if not (equals and name.strip()):
            self.fail(f"{value!r} is not a range: write NAME=LO:HI, for example e=0.7:0.95", param, ctx)
        ends: Any = options.IntervalType().convert(text, param, ctx)
        return name.strip(), ends


@click.command("fit", help=COMMANDS["fit"], epilog=_EPILOG)
@click.argument("data", metavar="DATA.csv")
@options.option("--free", metavar="NAMES", help="Parameters to be found, separated by commas, such as e,ew,roughness.")
@options.chute_options
@click.option("--base-height", is_flag=True, help="The height of the base is unknown too.")
@click.option(
    "--range",
    "ranges",
    type=NamedRangeType(),
    multiple=True,
    help="Range of a free parameter in which the search starts.",
)
@click.option("--trust", type=NamedRangeType(), multiple=True, help="Use only values of z, nu, T or u in this range.")
@options.option("--loss", metavar="NAME", help="linear (the default), or soft_l1, huber, cauchy for outliers.")
@options.option("--confidence", type=options.Number(), help="Confidence of the intervals; 0.95 by default.")
@options.option("--trials", type=click.INT, help="Trial chutes that the search starts from; 64 for one experiment.")
@options.output_options((), "measurements, fit and residuals")
@options.option(
    "--direct", metavar="FILE", help="Draw g1 and g2 as measured without a model, beside the law, into FILE."
)
@options.option("--out", "--save", "save", metavar="FILE", help="Write the fit to FILE: .nc or .json, for predictions.")
def command(**given: Any) -> None:
    """Read, fit, print, save and draw."""
    options.require_outputs(given, (".nc", ".json"))
    options.require_outputs({"plot": given["direct"], "theme": None})
    free = _names(given["free"])
    closures = _closures(given)
    # The slope may come with the file.
    chute = chute_with(given, [*free, "slope"], closure=closures[0], settings=())
    scales = options.scales(given)
    from chuteflow.fitting.comparison import compare
    from chuteflow.io.fit_records import comparison_object, save_fit
    from chuteflow.io.measurements_file import read_measurements

    slope = None if given["slope"] is None and given["angle"] is None else chute.slope
    measured = read_measurements(given["data"], slope=slope, scales=scales, trust=dict(given["trust"]))
    if slope is None and "slope" not in free and any("slope" not in one.given for one in measured.experiments):
        raise InputError("missing --slope or --angle, or a column of the file: what is the slope of the chute?")
    settings: dict[str, Any] = {"base_height": given["base_height"], "ranges": dict(given["ranges"])}
    settings |= {name: given[name] for name in ("loss", "confidence", "trials") if given[name] is not None}
    with Progress(seconds=0.5) as progress:
        settings["progress"] = lambda fraction: progress.show(f"{fraction:.0%} of the trial chutes")
        found = compare(measured, chute, free, closures, **settings)

    def plotted() -> Figure:
        from chuteflow.plotting.fit_plot import plot_fit

        return plot_fit(found.fits[0])

    def drawn() -> Figure:
        from chuteflow.plotting.direct_plot import plot_direct

        measured_directly = found.fits[0].direct
        if not measured_directly:
            raise InputError("--direct: no experiment has profiles of nu and T at five common heights")
        return plot_direct(measured_directly)

    options.deliver(
        given,
        lambda: comparison_object(found.fits, found.failed),
        _report(found, scales),
        lambda path: save_fit(found.fits[0], path),
        plotted,
        direct=drawn,
    )


def _names(text: str | None) -> list[str]:
    names = [name.strip() for name in (text or "").split(",") if name.strip()]
    if not names:
        raise InputError("missing --free: which parameters are to be found, for example --free e,ew,roughness?")
    return names


def _closures(given: Mapping[str, Any]) -> list[str]:
    """The closures that are compared: several separated by commas, where none has parameters of its own."""
    text = given["closure"] or "lun"
    if given["settings"]:
        from chuteflow.theory.laws import add_settings

        return [add_settings(text, given["settings"])]
    return [text] if "=" in text else [name.strip() for name in text.split(",") if name.strip()]


def chute_with(given: Mapping[str, Any], free: list[str], **changes: Any) -> Chute:
    """The chute of the options with ``changes`` of them; what is ``free`` need not be given.

    Raises:
        InputError: as :func:`chuteflow.cli.options.chute`.
    """
    filled = dict(given) | changes
    names = {parameter.name: key for key, parameter in BY_KEY.items()}
    asked = {names.get(name, name) for name in free}
    for key, value in _FIRST.items():
        unknown = given[key] is None and (key != "slope" or given["angle"] is None)
        if unknown and (key in asked or (key == "roughness" and _without_roughness(given))):
            filled[key] = value
    return options.chute(filled)


def _without_roughness(given: Mapping[str, Any]) -> bool:
    return str(given["base"] or "").startswith("johnson-jackson")


def _report(found: LawComparison, scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import tables, words
    from chuteflow.steady.quantities import NUMBERS

    best = found.fits[0]
    if len(found.fits) + len(found.failed) > 1:
        rows = [["closure", "chi2", "values", "unknowns", "AICc", "above best"]]
        for one, delta in zip(found.fits, found.deltas, strict=True):
            cells = (f"{one.chi2:.4g}", str(one.count), str(one.unknowns), f"{one.aicc:.4g}", f"{delta:.3g}")
            rows.append([str(one.chute.closure), *cells])
        yield tables.table(rows, words=(0,))
        for reason in found.failed:
            yield f"no fit: {reason}"
        yield ""
    yield words.chute(best.chute)
    yield ""
    yield from _estimates(best)
    yield ""
    yield from _goodness(best)
    for one in best.experiments:
        flow = one.flow
        place = [
            f"{NUMBERS[name].symbol} = {words.amount(name, getattr(flow, name), flow.chute, scales)}" for name in _PLACE
        ]
        if one.base is not None:
            base, error = (words.amount("height", at or 0.0, flow.chute, scales) for at in (one.base, one.base_error))
            place.append(f"base at {base} +- {error}")
        yield f"experiment {one.name}: flow {one.rank} of {one.flows} ({flow.name}), {', '.join(place)}"
    for other in best.alternatives:
        if not other.fits_as_well:
            at = ", ".join(f"{p.key} = {tables.number(v)}" for p, v in zip(best.free, other.values, strict=True))
            yield f"another fit is worse: chi2 = {other.chi2:.4g} at {at}"
    yield ""
    yield from _residuals(best)
    if best.direct:
        yield ""
        yield "measured without a model, by the weight of the grains above; and how many errors the law is above it:"
        yield from _direct(best)
    if best.warnings:
        yield ""
        yield from best.warnings


def _estimates(best: Fit) -> Iterator[str]:
    from chuteflow.io import tables

    rows = [["", "estimate", "error", f"{best.confidence:.3g} interval", "", *("corr" for _ in best.free)]]
    rows[0][5:] = [f"corr {p.key}" for p in best.free]
    for one, shared in zip(best.estimates, best.correlation, strict=True):
        value = "not determined" if one.interval.open else tables.number(one.value)
        error = tables.number(one.error) if one.determined else "-"
        ends = [tables.number(one.interval.low), tables.number(one.interval.high)]
        rows.append([one.key, value, error, *ends, *(f"{c:.3f}" if np.isfinite(c) else "-" for c in shared)])
    yield tables.table(rows, words=(0,))


def _goodness(best: Fit) -> Iterator[str]:
    known = best.measured.errors_known
    line = f"chi2 = {best.chi2:.4g} for {best.count} values and {best.unknowns} unknowns"
    if known and best.probability is not None:
        yield f"{line}: so large by chance with probability {best.probability:.2g}; AICc = {best.aicc:.4g}"
    elif known:
        yield line
    else:
        from chuteflow.fitting.measurements import ASSUMED

        said = f"errors were not given: the residuals imply {100.0 * ASSUMED * best.error_scale:.2g} % of every value"
        yield f"{said}; AICc = {best.aicc:.4g}"


def _residuals(best: Fit) -> Iterator[str]:
    """Mean residuals by height: runs of one sign show where the theory fails."""
    from chuteflow.io import tables

    bands = _BANDS if any(one.profiles for one in best.experiments) else 0
    heights = [f"height {i + 1} of {_BANDS}" for i in range(bands)]
    rows = [["residuals in errors", *heights, "rms"] if bands else ["residuals in errors", ""]]
    for one in best.experiments:
        for series, residual in one.profiles:
            parts = np.array_split(residual, _BANDS)
            cells = [f"{part.mean():+.2f}" if len(part) else "-" for part in parts]
            rows.append([f"{one.name}: {series.symbol}", *cells, f"{np.sqrt(np.mean(residual**2)):.2f}"])
        scalars = best.measured.experiments[best.experiments.index(one)].scalars
        values = one.residuals[len(one.residuals) - len(scalars) :]
        for scalar, value in zip(scalars, values, strict=True):
            rows.append([f"{one.name}: {scalar.symbol}", f"{value:+.2f}", *[""] * bands])
    yield tables.table(rows, words=(0,))


def _direct(best: Fit) -> Iterator[str]:
    """Where g1, g2 and the slip were measured: the lowest height, the middle and the highest."""
    from chuteflow.io import tables

    rows = [["", "z", "nu", "g1", "+-", "law", "g2", "+-", "law", "slip", "+-", "law"]]
    for one in best.direct:
        for i in sorted({0, len(one.height) // 4, len(one.height) // 2, 3 * len(one.height) // 4}):
            row = [one.name, tables.number(float(one.height[i])), tables.number(float(one.nu[i]))]
            for measured in (one.g1, one.g2, one.slip if i == 0 else None):
                if measured is None:
                    row += ["", "", ""]
                else:
                    row += [tables.number(float(measured.value[i])), f"{measured.error[i]:.2g}"]
                    row.append(f"{measured.deviation[i]:+.1f}")
            rows.append(row)
    yield tables.table(rows, words=(0,))
