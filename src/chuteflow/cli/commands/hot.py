"""``chuteflow hot``: the hot, dilute flow of a chute by the reduced model of section 4."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS

if TYPE_CHECKING:
    from chuteflow.steady.hot import HotModel

_EPILOG = (
    "T_inf is the granular temperature far above the base; numbers are dimensionless. The surface is the "
    "half-line (--surface free).\n\n"
    "Example: chuteflow hot --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6"
)
#: Parameters of the model: their names in the JSON object and what they are.
_PARAMETERS = {
    "lambda": "the one parameter of the reduced system, below 3 (4.14)",
    "delta": "dissipation less production in the interior (4.9)",
    "F21": "energy given by the base, less what it takes (4.3)",
    "alpha": "scale of nu T_inf (4.10)",
}
_DENSITIES = {
    False: "density falls with height everywhere (monotonic)",
    True: "densest above the base (inverted)",
}


@click.command("hot", help=COMMANDS["hot"], epilog=_EPILOG)
@options.chute_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(**given: Any) -> None:
    """Solve the reduced model and print."""
    chute = options.chute(given)
    from chuteflow.steady.hot import hot

    found = hot(chute)
    if given["as_json"]:
        from chuteflow.io import contract

        click.echo(contract.text({"chute": contract.chute_object(chute), **found.as_dict()}))
    else:
        click.echo("\n".join(_report(found)))


def _report(found: HotModel) -> Iterator[str]:
    from chuteflow.io import tables, words

    numbers = found.as_dict()
    yield words.chute(found.chute)
    yield ""
    values = {name: math.inf if numbers[name] is None else numbers[name] for name in _PARAMETERS}
    rows = [[name, tables.number(values[name]), what] for name, what in _PARAMETERS.items()]
    yield tables.table(rows, words=(0, 2))
    yield ""
    laws = list(_laws(found))
    if laws:
        yield f"hot flow: interior {found.interior}; {_DENSITIES[bool(found.inverted)]}"
        yield "as T_inf grows, with a relative error of the order of 1/T_inf:"
        yield tables.table(laws, words=(0, 1, 2))
    else:
        yield f"no hot flow: {found.reason}"
    yield ""
    yield _slopes(found)


def _laws(found: HotModel) -> Iterator[list[str]]:
    """The scaling laws (4.18)-(4.20), with their factors."""
    flux, height, holdup = found.log_flux, found.log_centre_of_mass, found.mass_holdup
    if flux is None or height is None or holdup is None or found.largest_volume_fraction is None:
        return
    yield ["mass flux", "Q ~ sqrt(T_inf)", f"Q = {_power_of_ten(flux)} sqrt(T_inf)"]
    yield ["centre of mass", "h ~ T_inf", f"h = {_power_of_ten(height)} T_inf"]
    yield ["hold-up", "M -> constant", f"M = {holdup:.5g}"]
    yield ["centre of mass and flux", "h ~ Q^2", f"h = {_power_of_ten(height - 2.0 * flux)} Q^2"]
    yield ["largest density", "nu ~ 1/T_inf", f"nu = {found.largest_volume_fraction:.5g} / T_inf"]


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
