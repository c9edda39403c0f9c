"""``chuteflow hot``: the hot, dilute flow of a chute by the reduced model of section 4."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.steady.chute import Chute
    from chuteflow.steady.hot import HotModel
    from chuteflow.steady.quantities import Scales

_EPILOG = (
    "T_inf is the granular temperature far above the base. The surface is the "
    "half-line (--surface free).\n\n"
    "Example: chuteflow hot --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6"
)
_SAVED = (".csv", ".json")


@dataclass(frozen=True)
class _Scale:
    """The quantity ``name`` over ``power`` of a granular temperature, and its SI unit."""

    name: str
    power: float
    unit: str

    def factor(self, chute: Chute, scales: Scales | None) -> float:
        """What it is multiplied with."""
        from chuteflow.io.contract import factor

        return factor(self.name, chute, scales) / factor("surface_temperature", chute, scales) ** self.power


#: What has a scale, by its name in the JSON object.
_SCALED = {
    "M": _Scale("mass_holdup", 0.0, "kg/m^2"),
    "Q_over_sqrt_T": _Scale("mass_flux", 0.5, "kg/m^2"),
    "h_over_T": _Scale("centre_of_mass", 1.0, "s^2/m"),
    "nu_max_times_T": _Scale("volume_fraction", -1.0, "m^2/s^2"),
}
#: Parameters of the model: their names in the JSON object and what they are.
_PARAMETERS = {
    "lambda": "the one parameter of the reduced system, below 3 (4.14)",
    "delta": "dissipation minus production in the interior (4.9)",
    "F21": "energy given by the base, less what it takes (4.3)",
    "alpha": "scale of nu T_inf (4.10)",
}
_DENSITIES = {
    False: "density falls with height everywhere (monotonic)",
    True: "densest above the base (inverted)",
}


@click.command("hot", help=COMMANDS["hot"], epilog=_EPILOG)
@options.chute_options
@options.output_options(_SAVED, "the fields of the hot flow")
def command(**given: Any) -> None:
    """Solve the reduced model and print."""
    chute = options.chute(given)
    scales = options.scales(given)
    options.require_outputs(given, _SAVED)
    from chuteflow.steady.hot import hot

    found = hot(chute)
    content = _content(found, scales)

    def plotted() -> Figure:
        from chuteflow.plotting.hot_plot import plot_hot

        return plot_hot(found)

    options.deliver_object(given, content, _report(found, scales), lambda: _rows(content), plotted)


def _content(found: HotModel, scales: Scales | None) -> dict[str, Any]:
    from chuteflow.io import contract

    content = {"chute": contract.chute_object(found.chute), **found.as_dict()}
    if scales is None:
        return content
    by = {symbol: scale.factor(found.chute, scales) for symbol, scale in _SCALED.items()}
    for symbol, scale in by.items():
        content[symbol] = None if content[symbol] is None else contract.finite(content[symbol] * scale)
        logarithm = f"log_{symbol}"
        if content.get(logarithm) is not None:
            content[logarithm] += math.log(scale)
    units = {symbol: scale.unit for symbol, scale in _SCALED.items()}
    return content | contract.units_object(scales, ()) | {"units": units}


def _rows(content: dict[str, Any]) -> Iterator[list[Any]]:
    """Names and numbers, one in a row."""
    yield ["name", "value"]
    for name, value in content.items():
        if isinstance(value, bool | int | float) or value is None:
            yield [name, value]


def _report(found: HotModel, scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import tables, words

    numbers = found.as_dict()
    yield from words.introduction(found.chute, scales)
    yield ""
    values = {name: math.inf if numbers[name] is None else numbers[name] for name in _PARAMETERS}
    rows = [[name, tables.number(values[name]), what] for name, what in _PARAMETERS.items()]
    yield tables.table(rows, words=(0, 2))
    yield ""
    laws = list(_laws(found, scales))
    if laws:
        yield f"hot flow: interior {found.interior}; {_DENSITIES[bool(found.inverted)]}"
        yield "as T_inf grows, with a relative error of the order of 1/T_inf:"
        yield tables.table(laws, words=(0, 1, 2))
    else:
        yield f"no hot flow: {found.reason}"
    yield ""
    yield _slopes(found)


def _laws(found: HotModel, scales: Scales | None) -> Iterator[list[str]]:
    """The scaling laws (4.18)-(4.20), with their factors."""
    flux, height, holdup = found.log_flux, found.log_centre_of_mass, found.mass_holdup
    if flux is None or height is None or holdup is None or found.largest_volume_fraction is None:
        return
    by = {symbol: scale.factor(found.chute, scales) for symbol, scale in _SCALED.items()}
    units = {symbol: "" if scales is None else f" [{scale.unit}]" for symbol, scale in _SCALED.items()}
    flux, height = flux + math.log(by["Q_over_sqrt_T"]), height + math.log(by["h_over_T"])
    densest = found.largest_volume_fraction * by["nu_max_times_T"]
    steep = "" if scales is None else " [m^3 s^2/kg^2]"
    yield ["mass flux", "Q ~ sqrt(T_inf)", f"Q = {_power_of_ten(flux)} sqrt(T_inf){units['Q_over_sqrt_T']}"]
    yield ["centre of mass", "h ~ T_inf", f"h = {_power_of_ten(height)} T_inf{units['h_over_T']}"]
    yield ["hold-up", "M -> constant", f"M = {holdup * by['M']:.5g}{units['M']}"]
    yield ["centre of mass and flux", "h ~ Q^2", f"h = {_power_of_ten(height - 2.0 * flux)} Q^2{steep}"]
    yield ["largest density", "nu ~ 1/T_inf", f"nu = {densest:.5g} / T_inf{units['nu_max_times_T']}"]


def _power_of_ten(log: float) -> str:
    """exp(log) in five digits, also where it is too large for a number."""
    exponent = math.floor(log / math.log(10.0))
    if abs(exponent) < 300:
        return f"{math.exp(log):.5g}"
    return f"{math.exp(log - exponent * math.log(10.0)):.3f}e{exponent:+d}"


def _slopes(found: HotModel) -> str:
    bounds = found.slope_bounds
    if bounds is None:
        return "no slope has hot flows with these grains and this base"
    low, high = (math.degrees(math.atan(slope)) for slope in (bounds.lowest, bounds.highest))
    return (
        f"slopes with hot flows: tan(theta) from {bounds.lowest:.5g} to {bounds.highest:.5g} "
        f"({low:.4g} to {high:.4g} degrees), interior {bounds.interior}"
    )
