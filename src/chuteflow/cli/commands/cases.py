"""``chuteflow cases``: the chutes and materials that --case takes, and how each of their numbers is known."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS

if TYPE_CHECKING:
    from chuteflow.steady.cases import Case, CaseNumber

_EPILOG = (
    "A case replaces the parameters of a chute: chuteflow solve --case paper-dissipative --flux 3. Materials have "
    "no slope: give --slope or --angle too. Replace guessed numbers by your own. A file for --chute "
    "is TOML with the same keys: slope (or angle), e, ew, roughness, surface, closure, base, and for SI units "
    'diameter, density and gravity; case = "NAME" starts from a case.\n\n'
    "Example: chuteflow cases glass-beads"
)


@click.command("cases", help=COMMANDS["cases"], epilog=_EPILOG)
@click.argument("name", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@options.quiet_option
def command(name: str | None, as_json: bool, quiet: bool) -> None:
    """List all, or tell one."""
    from chuteflow.io import contract
    from chuteflow.steady.cases import CASES, case

    chosen = [*CASES.values()] if name is None else [case(name)]
    if as_json:
        click.echo(contract.text({"cases": [_object(one) for one in chosen]}))
    else:
        click.echo("\n".join(_list(chosen) if name is None else _whole(chosen[0])))


def _object(one: Case) -> dict[str, Any]:
    return {
        "name": one.name,
        "description": one.description,
        "chute": {key: _list_known(known) for key, known in one.numbers.items()} | dict(one.names),
        "grains": {key: _list_known(known) for key, known in one.grains.items()},
    }


def _list_known(known: CaseNumber) -> dict[str, Any]:
    return {
        "value": known.value,
        "uncertainty": known.uncertainty,
        "how": known.how,
        "source": known.source or None,
    }


def _list(chosen: list[Case]) -> Iterator[str]:
    from chuteflow.io import tables
    from chuteflow.parameters import BY_KEY

    keys = (*BY_KEY, "diameter", "density")
    rows = [["name", *keys, "what it is"], ["", *[""] * len(BY_KEY), "[m]", "[kg/m^3]", ""]]
    for one in chosen:
        numbers = {**one.numbers, **one.grains}
        rows.append([one.name, *(_cell(numbers[key]) if key in numbers else "-" for key in keys), one.description])
    yield tables.table(rows, words=(0, len(keys) + 1))
    yield ""
    yield "~ typical of such grains, not checked against a source; ? guessed; chuteflow cases NAME shows each number"


def _cell(known: CaseNumber) -> str:
    from chuteflow.steady.cases import GUESSED, TYPICAL

    return f"{known.value:g}{ {TYPICAL: '~', GUESSED: '?'}.get(known.how, '') }"


def _spread(known: CaseNumber) -> str:
    return "" if known.uncertainty is None else f"+- {known.uncertainty:g}"


def _whole(one: Case) -> Iterator[str]:
    from chuteflow.io import tables

    yield f"{one.name}: {one.description}"
    rows = [
        [key, f"{known.value:g}", _spread(known), known.how, known.source]
        for key, known in {**one.numbers, **one.grains}.items()
    ]
    yield tables.table(rows, words=range(5))
