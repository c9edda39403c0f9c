"""``chuteflow predict``: flows of a calibrated chute with bands, also at another slope."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY, CONDITIONS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.fitting.prediction import Prediction
    from chuteflow.steady.quantities import Scales

_EPILOG = (
    "Parameters given by an option are taken as known; all others are those of the fit, with their uncertainty.\n\n"
    "Example: chuteflow predict fit.nc --slope 0.32 --flux 3 --plot prediction.png"
)
_COLUMNS = (
    "centre_of_mass",
    "mass_holdup",
    "surface_temperature",
    "base_volume_fraction",
    "slip_velocity",
    "depth",
)


@click.command("predict", help=COMMANDS["predict"], epilog=_EPILOG)
@click.argument("fitted", metavar="FIT")
@options.option("--slope", type=options.Number(), help="Slope tan(theta); that of the fit by default.")
@options.option("--angle", type=options.Number(), help="Inclination theta in degrees.")
@options.option("--e", type=options.Number(), help="Another coefficient of restitution of two grains.")
@options.option("--ew", type=options.Number(), help="Another coefficient of restitution of a grain and the base.")
@options.option("--roughness", type=options.Number(), help="Another roughness of the base.")
@options.condition_options
@options.grains_options
@options.option("--confidence", type=options.Number(), help="Confidence of the bands; 0.95 by default.")
@options.output_options((".csv", ".json"), "curve and profiles with bands")
def command(**given: Any) -> None:
    """Load, predict, print, save and draw."""
    options.require_outputs(given, (".csv", ".json"))
    from chuteflow.fitting.prediction import predict
    from chuteflow.io.fit_records import load_calibration, prediction_object, prediction_rows

    calibration = load_calibration(given["fitted"])
    if given["slope"] is not None and given["angle"] is not None:
        raise InputError(f"--slope {given['slope']:g} and --angle {given['angle']:g}: give one of them, not both")
    changes: dict[str, Any] = {p.name: given[key] for key, p in BY_KEY.items() if given[key] is not None}
    if given["angle"] is not None:
        changes["slope"] = _slope(given["angle"])
    calibration = calibration.varied(**changes)
    scales = options.scales({**given, "si": False, "grains": {}})
    condition = options.condition(given, calibration.chute, scales)
    settings = {} if given["confidence"] is None else {"confidence": given["confidence"]}
    found = predict(calibration, **settings, **condition)

    def plotted() -> Figure:
        from chuteflow.plotting.prediction_plot import plot_prediction

        return plot_prediction(found, scales)

    content = prediction_object(found, scales) if given["as_json"] or str(given["save"]).endswith(".json") else None
    options.deliver_object(given, content, _report(found, scales), lambda: prediction_rows(found, scales), plotted)


def _slope(degrees: float) -> float:
    import math

    from chuteflow.checks import number

    return math.tan(math.radians(number("angle", degrees, 1e-6, 89.9999)))


def _report(found: Prediction, scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import tables, words
    from chuteflow.io.contract import factor

    chute = found.calibration.chute
    yield words.chute(chute)
    if scales is not None:
        yield words.scales(scales)
    yield f"uncertain: {', '.join(found.calibration.keys) or 'nothing'}; +- is {found.widths:.3g} standard errors"
    yield ""
    if found.flows:
        rows = [
            ["", first, *(cell for name in others for cell in (name, beside))]
            for beside, (first, *others) in zip(
                ("+-", ""), tables.heading(("mass_flux", *_COLUMNS), scales), strict=False
            )
        ]
        for i, one in enumerate(found.flows, 1):
            cells = [tables.number(one.flow.mass_flux * factor("mass_flux", chute, scales))]
            for name in _COLUMNS:
                value, error = (factor(name, chute, scales) * number for number in one.numbers[name])
                cells += [tables.number(value), f"{found.widths * error:.2g}"]
            rows.append([str(i), *cells])
        yield tables.table(rows)
    else:
        yield words.in_own_units(f"no flow: {found.flow_set.reason}", scales)
    yield ""
    for fold in found.folds:
        name = CONDITIONS[fold.turns].quantity
        value, unit = fold.value * factor(name, chute, scales), words.unit_after(name, scales)
        yield f"{fold.kind}: {fold.turns} = {tables.number(value)} +- {value * found.widths * fold.error:.2g}{unit}"
    yield from found.warnings
