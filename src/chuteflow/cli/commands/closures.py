"""``chuteflow closures``: the constitutive laws that there are, and what one of them is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.theory.constitutive import Law

_EPILOG = (
    "NAME is a name of the list, with parameters as in extended:packing=0.64, or FILE.py:NAME.\n\n"
    "Example: chuteflow closures extended --plot extended.png"
)
#: Restitution and slope at which the functions of a law are shown unless others are given.
_E, _SLOPE = 0.8, 0.3
_SAVED = (".csv", ".json")
#: Volume fractions of the table.
_DENSITIES = (0.01, 0.1, 0.2, 0.3, 0.4, 0.49, 0.55, 0.6)


@click.command("closures", help=COMMANDS["closures"], epilog=_EPILOG)
@click.argument("name", required=False)
@click.option("--set", "settings", metavar="KEY=VALUE", multiple=True, help="A parameter of the closure.")
@options.option("--e", type=options.Number(), help="Restitution at which its functions are shown; 0.8 by default.")
@options.option("--slope", type=options.Number(), help="Slope tan(theta) for laws that depend on it; 0.3 by default.")
@options.output_options(_SAVED, "g0 to g6 beside Lun's")
def command(name: str | None, **given: Any) -> None:
    """List the laws, or print and draw one."""
    from chuteflow.io import contract

    if name is None:
        for option in ("plot", "save", "e", "slope", "settings"):
            if given[option]:
                raise InputError(f"--{'set' if option == 'settings' else option} needs the NAME of a closure")
        click.echo(contract.text(_everything()) if given["as_json"] else "\n".join(_list()))
        return
    from chuteflow.theory.constitutive import require_positive
    from chuteflow.theory.laws import add_settings, law

    chosen = law(add_settings(name, given["settings"]))
    e, slope = given["e"] or _E, given["slope"] or _SLOPE
    require_positive(chosen, e, slope)
    options.require_ratio(slope)
    options.require_outputs(given, _SAVED)
    whole = _whole(chosen, e, slope)

    def plotted() -> Figure:
        from chuteflow.plotting.closure_plot import plot_laws

        return plot_laws([law("lun"), chosen] if str(chosen) != "lun" else [chosen], e, slope)

    options.deliver_object(given, whole, _report(chosen, e, slope), lambda: _rows(whole), plotted)


def _rows(whole: dict[str, Any]) -> Iterator[Sequence[Any]]:
    """The functions at each volume fraction as rows."""
    yield ["nu", *whole["functions"]]
    yield from zip(whole["nu"], *whole["functions"].values(), strict=True)


def _everything() -> dict[str, Any]:
    from chuteflow.theory.friction import FRICTIONS
    from chuteflow.theory.laws import known_laws
    from chuteflow.theory.radial import RADIALS

    return {
        "closures": [_describe(law) for law in known_laws().values()],
        "radial_functions": [
            {
                "name": r.name, "description": r.description, "source": r.source, "packing": r.packing,
                "breaks": list(r.breaks), "valid": r.valid,
            }
            for r in RADIALS.values()
        ],
        "frictions": [{"name": name, "source": source} for name, source in FRICTIONS.items()],
    }  # fmt: skip


def _describe(law: Law) -> dict[str, Any]:
    return {
        "name": law.name, "description": law.description, "source": law.source, "parameters": law.parameters,
        "densest": law.densest, "valid": law.valid, "smooth": law.smooth, "knows_shear_rate": law.knows_slope,
    }  # fmt: skip


def _list() -> Iterator[str]:
    from chuteflow.io import tables
    from chuteflow.theory.friction import FRICTIONS
    from chuteflow.theory.laws import known_laws
    from chuteflow.theory.radial import RADIALS

    rows = [[law.name, law.description, law.source, law.valid] for law in known_laws().values()]
    yield "closures (--closure):"
    yield tables.table([["name", "what it is", "source", "meant for"], *rows], words=range(4))
    yield ""
    yield "their parameters (--set KEY=VALUE, or --closure NAME:KEY=VALUE,...) with their defaults:"
    for law in known_laws().values():
        if law.parameters:
            yield f"  {law.name}: " + ", ".join(f"{key} = {_value(value)}" for key, value in law.parameters.items())
    yield ""
    rows = [[r.name, r.description, f"{r.packing:g}", r.source] for r in RADIALS.values()]
    yield "radial functions (radial):"
    yield tables.table([["name", "g0", "packing", "source"], *rows], words=(0, 1, 3))
    yield ""
    yield "friction of the grains (friction_model): " + "; ".join(f"{name}, {of}" for name, of in FRICTIONS.items())


def _value(value: Any) -> str:
    return "that of the radial function" if value is None else str(value)


def _whole(law: Law, e: float, slope: float) -> dict[str, Any]:
    import numpy as np

    from chuteflow.io.contract import finite
    from chuteflow.plotting.closure_plot import functions
    from chuteflow.theory.constitutive import digest

    nu = np.array([value for value in _DENSITIES if value < law.densest])
    values = functions(law, nu, e, slope)
    return {
        **_describe(law),
        "e": e,
        "slope": slope,
        "breaks": list(law.breaks_at(e, slope)),
        "digest": digest(law, e, slope),
        "nu": nu.tolist(),
        "functions": {name: [finite(value) for value in column] for name, column in values.items()},
    }


def _report(law: Law, e: float, slope: float) -> Iterator[str]:
    from chuteflow.io import tables
    from chuteflow.theory.constitutive import FUNCTIONS

    whole = _whole(law, e, slope)
    yield f"{law}: {law.description}"
    yield f"source: {law.source}"
    if law.valid:
        yield f"meant for: {law.valid}"
    if law.parameters:
        yield "parameters: " + ", ".join(f"{key} = {_value(value)}" for key, value in law.parameters.items())
    yield f"densest packing: {law.densest:g}"
    breaks = ", ".join(f"{nu:.6g}" for nu in whole["breaks"])
    yield f"not smooth at nu = {breaks}" if breaks else "smooth at every density"
    yield ""
    yield f"at e = {e:g}" + (f" and slope {slope:g}:" if law.knows_slope else ":")
    shown = [name for name in FUNCTIONS if name != "compressibility_slope"]
    rows = [
        [tables.number(nu), *(tables.number(whole["functions"][name][i]) for name in shown)]
        for i, nu in enumerate(whole["nu"])
    ]
    yield tables.table([["nu", *(FUNCTIONS[name][0] for name in shown)], *rows])
