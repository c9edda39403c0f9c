"""``chuteflow sensitivities``: how every quantity of a flow answers to each parameter of its chute."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.steady.sensitivity import Sensitivity

_EPILOG = (
    "Derivatives are exact. By default the mass flux is held fixed while a parameter changes. At a fold of the fixed "
    "quantity derivatives are infinite; those along and across the branch, in the JSON object, are finite.\n\n"
    "Example: chuteflow sensitivities --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3 --flow 2"
)
#: Heights of profiles in the JSON object, up to the depth.
_HEIGHTS = 21


@click.command("sensitivities", help=COMMANDS["sensitivities"], epilog=_EPILOG)
@options.chute_options
@options.condition_options
@options.option("--flow", "which", type=click.INT, help="Which of the flows found, 1 for the hottest; all by default.")
@options.option("--fixed", metavar="NAME", help="Quantity held fixed: Q (the default), M, h or T_surface.")
@options.option("--parameters", metavar="NAMES", help="Parameters, separated by commas; all by default.")
@options.output_options((".csv", ".json"), "them, ranked,")
def command(**given: Any) -> None:
    """Solve, differentiate, print, save and draw."""
    options.require_outputs(given, (".csv", ".json"))
    chute = options.chute(given)
    scales = options.scales(given)
    condition: dict[str, Any] = options.condition(given, chute, scales)
    from chuteflow.branches.enumeration import flows
    from chuteflow.io import contract
    from chuteflow.io.sensitivity_records import sensitivity_object, sensitivity_rows
    from chuteflow.steady.sensitivity import sensitivity

    names = None if given["parameters"] is None else [n.strip() for n in given["parameters"].split(",")]
    found = flows(chute, **condition)
    chosen = list(found) if given["which"] is None and given["save"] is None else None
    if chosen is None and len(found):
        chosen = [options.chosen(found, given["which"])]
    answers = [sensitivity(flow, names, at=given["fixed"] or "Q") for flow in chosen or []]
    content = {
        "chute": contract.chute_object(chute),
        "flows": [sensitivity_object(one, _heights(one)) for one in answers],
        "reason": found.reason,
    }
    if not answers and given["plot"]:
        raise InputError(f"nothing to draw: {found.reason}")

    def plotted() -> Figure:
        from chuteflow.plotting.sensitivity_plot import plot_sensitivities

        return plot_sensitivities(answers)

    options.deliver_object(
        given,
        content,
        _report(answers, found.reason, in_own_units=scales is not None),
        lambda: (row for one in answers for row in sensitivity_rows(one)),
        plotted,
    )


def _heights(found: Sensitivity) -> Any:
    import numpy as np

    return np.linspace(0.0, found.flow.depth, _HEIGHTS)


def _report(answers: list[Sensitivity], reason: str | None, *, in_own_units: bool) -> Iterator[str]:
    from chuteflow.io import tables, words
    from chuteflow.steady.quantities import NUMBERS

    if not answers:
        yield f"no flow: {reason}"
        return
    yield words.chute(answers[0].flow.chute)
    if in_own_units:
        yield "numbers are dimensionless: the scales of SI units change with the slope, one of the parameters"
    for number, found in enumerate(answers, 1):
        flow = found.flow
        yield ""
        yield f"flow {number}: {flow.name}, Q = {tables.number(flow.mass_flux)}, M = {tables.number(flow.mass_holdup)}"
        if found.at_fold:
            yield found.at_fold
        yield f"derivatives at fixed {found.at}:"
        rows = [["", "value", *(f"d/d{key}" for key in found.keys)]]
        for name, values in found.numbers.items():
            value = float(getattr(flow, name))
            # The height of an interface that is not there.
            if value < float("inf"):
                rows.append([NUMBERS[name].symbol, tables.number(value), *map(tables.number, values.tolist())])
        yield tables.table(rows, words=(0,))
