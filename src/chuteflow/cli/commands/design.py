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
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@options.quiet_option
def command(**given: Any) -> None:
    """Search and print."""
    unknown = [name.strip() for name in (given["unknown"] or "").split(",") if name.strip()]
    if not unknown:
        raise InputError("missing --unknown: which parameters are to be found, for example --unknown slope?")
    chute = chute_with(given, unknown)
    wanted = _wanted(given)
    from chuteflow.fitting.design import design
    from chuteflow.io import contract
    from chuteflow.io.fit_records import design_object

    found = design(chute, unknown, ranges=dict(given["ranges"]), **wanted)
    click.echo(contract.text(design_object(found)) if given["as_json"] else "\n".join(_report(found)))


def _wanted(given: dict[str, Any]) -> dict[str, float]:
    from chuteflow.checks import number_in

    found = {}
    for condition in CONDITIONS.values():
        if given[condition.option] is not None:
            option = f"--{condition.option.replace('_', '-')}"
            found[condition.key] = number_in(option, given[condition.option], condition.low, condition.high)
    for text in given["want"]:
        name, equals, value = text.partition("=")
        if not equals or name.strip() in found:
            raise InputError(f"--want {text!r}: must be NAME=VALUE, such as depth=10, each name once")
        found[name.strip()] = number_in(name.strip(), value)
    return found


def _report(found: Design) -> Iterator[str]:
    from chuteflow.io import tables

    if found.reason:
        yield f"no solution: {found.reason}"
        return
    before = [("", ""), *((parameter.key, "") for parameter in found.unknown)]
    rows = tables.heading(_COLUMNS, None, before=before, after=(("validity", ""),))
    for i, one in enumerate(found.solutions, 1):
        cells = tables.numbers(one.flow, _COLUMNS, one.flow.chute, None)
        rows.append([str(i), *map(tables.number, one.values.tolist()), *cells, one.flow.validity.summary])
    yield tables.table(rows, words=(len(rows[0]) - 1,))
    yield ""
    yield f"found from {found.starts} flows of trial chutes; there may be others"
