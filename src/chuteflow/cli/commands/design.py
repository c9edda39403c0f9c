"""``chuteflow design``: the chutes that have a flow with given numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.commands.fit import NamedRangeType, chute_with
from chuteflow.errors import InputError
from chuteflow.parameters import CONDITIONS

if TYPE_CHECKING:
    from chuteflow.fitting.design import Design
    from chuteflow.steady.quantities import Scales

_EPILOG = (
    "Give one condition more than there are unknown parameters: the flow on each chute is unknown too.\n\n"
    "Example: chuteflow design --unknown slope --e 0.8 --ew 0.8 --roughness 0.6 --flux 3 --holdup 1"
)
_COLUMNS = ("mass_flux", "centre_of_mass", "mass_holdup", "surface_temperature", "depth")


@click.command("design", help=COMMANDS["design"], epilog=_EPILOG)
@options.option("--unknown", metavar="NAMES", help="Parameters to be found, separated by commas, such as slope,e.")
@options.chute_options
@options.condition_options
@click.option("--want", metavar="NAME=VALUE", multiple=True, help="Another number of the flow, such as depth=10.")
@click.option("--range", "ranges", type=NamedRangeType(), multiple=True, help="Where an unknown parameter is tried.")
@options.output_options((".csv", ".json"), None)
def command(**given: Any) -> None:
    """Search, print and save."""
    options.require_outputs(given, (".csv", ".json"))
    unknown = [name.strip() for name in (given["unknown"] or "").split(",") if name.strip()]
    if not unknown:
        raise InputError("missing --unknown: which parameters are to be found, for example --unknown slope?")
    chute = chute_with(given, unknown)
    scales = options.scales(given)
    wanted = _read_conditions(given, None if "slope" in unknown else chute.slope, scales)
    from chuteflow.fitting.design import design
    from chuteflow.io.fit_records import design_object, design_rows

    found = design(chute, unknown, ranges=dict(given["ranges"]), **wanted)
    content = design_object(found, scales)
    options.deliver_object(given, content, _report(found, scales), lambda: design_rows(found, scales), None)


def _read_conditions(given: dict[str, Any], slope: float | None, scales: Scales | None) -> dict[str, float]:
    """The numbers that the flow is to have, dimensionless; ``slope`` is None where it is unknown."""
    from chuteflow.checks import number_in

    found = {}
    for condition in CONDITIONS.values():
        if given[condition.option] is not None:
            option = f"--{condition.option.replace('_', '-')}"
            value: Any = given[condition.option]
            if slope is not None:
                value = options.amount(given, condition.option, condition.quantity, slope, scales)
            elif options.without_unit(value)[1]:
                raise InputError(
                    f"{option} {value}: the scales of a unit need the slope, which is unknown: omit the unit"
                )
            found[condition.key] = number_in(option, value, condition.low, condition.high)
    for text in given["want"]:
        name, equals, value = text.partition("=")
        if not equals or name.strip() in found:
            raise InputError(f"--want {text!r}: must be NAME=VALUE, such as depth=10, each name once")
        found[name.strip()] = number_in(name.strip(), value)
    return found


def _report(found: Design, scales: Scales | None) -> Iterator[str]:
    from chuteflow.io import tables, words

    if found.reason:
        yield f"no solution: {found.reason}"
        return
    before = [("", ""), *((parameter.key, "") for parameter in found.unknown)]
    rows = tables.heading(_COLUMNS, scales, before=before, after=(("validity", ""),))
    for i, one in enumerate(found.solutions, 1):
        cells = tables.numbers(one.flow, _COLUMNS, one.flow.chute, scales)
        rows.append([str(i), *map(tables.number, one.values.tolist()), *cells, one.flow.validity.summary])
    yield tables.table(rows, words=(len(rows[0]) - 1,))
    yield ""
    if scales is not None:
        yield words.scales(scales)
    yield f"found from {found.starts} flows of trial chutes; there may be others"
