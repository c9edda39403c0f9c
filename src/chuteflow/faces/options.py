"""Options that several commands share, and what they are made into."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import click

from chuteflow.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.analysis.results import FlowSet
    from chuteflow.steady.chute import Chute
    from chuteflow.steady.flow import Flow
    from chuteflow.steady.quantities import Scales

Command = TypeVar("Command", bound=Callable[..., Any])

#: Endings of the files that --save and --plot write.
SAVED, DRAWN = (".nc", ".csv", ".json"), (".png", ".pdf", ".svg")

#: Options of the material parameters: their names in Chute and what is allowed.
_MATERIAL = {
    "e": ("restitution", "above 0 and at most 1, for example --e 0.8"),
    "ew": ("wall_restitution", "from 0 to 1, for example --ew 0.8"),
    "roughness": ("roughness", "from 1/2 to sqrt(3)/2, for example --roughness 0.6"),
}
#: Options of the condition, and the number of the registry that each gives.
_CONDITIONS = {
    "flux": ("Q", "mass_flux"),
    "holdup": ("M", "mass_holdup"),
    "centre_of_mass": ("h", "centre_of_mass"),
    "temperature": ("T_surface", "surface_temperature"),
}
_SCALES = {"diameter": "m", "density": "kg/m^3", "gravity": "m/s^2"}


class Number(click.ParamType):
    """A plain number."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number."""
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is not a number", param, ctx)


class Interval(click.ParamType):
    """Two numbers as LO:HI."""

    name = "lo:hi"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, float]:
        """Both ends."""
        try:
            low, high = map(float, value.split(":"))
        except ValueError:
            self.fail(f"{value!r} is not a range: write two numbers as LO:HI, for example 0.01:500", param, ctx)
        return low, high


class NumberOrInterval(click.ParamType):
    """A plain number, or two as LO:HI."""

    name = "number"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | tuple[float, float]:
        """The number, or both ends."""
        kind = Interval() if ":" in str(value) else Number()
        return kind.convert(value, param, ctx)


def option(*names: str, **settings: Any) -> Callable[[Command], Command]:
    """An option that may be given once."""

    def once(ctx: click.Context, param: click.Parameter, values: tuple[Any, ...]) -> Any:
        if len(values) > 1:
            raise click.UsageError(f"{param.opts[0]} is given {len(values)} times: give it once", ctx)
        return values[0] if values else None

    return click.option(*names, multiple=True, callback=once, **settings)


def _options(*decorators: Callable[[Command], Command]) -> Callable[[Command], Command]:
    def add(command: Command) -> Command:
        for decorate in reversed(decorators):
            command = decorate(command)
        return command

    return add


closure_options = _options(
    option(
        "--closure",
        metavar="NAME",
        help="Constitutive law: lun (the default), another of `chuteflow closures`, or FILE.py:NAME.",
    ),
    click.option(
        "--set",
        "settings",
        metavar="KEY=VALUE",
        multiple=True,
        help="A parameter of the closure, such as --set packing=0.64; as often as there are any. "
        "Or as part of its name: --closure extended:packing=0.64,radial=torquato.",
    ),
)
chute_options = _options(
    option("--slope", type=Number(), help="Slope tan(theta) of the chute; or give --angle."),
    option("--angle", type=Number(), help="Inclination theta in degrees."),
    option("--e", type=Number(), help="Restitution e of two grains, above 0 and at most 1."),
    option("--ew", type=Number(), help="Restitution e_w of a grain and the base, from 0 to 1."),
    option("--roughness", type=Number(), help="Roughness r of the base, from 1/2 to sqrt(3)/2."),
    option("--surface", metavar="NAME", help="Surface condition: free (the half-line, the default) or interface."),
    closure_options,
)
condition_options = _options(
    option("--flux", metavar="AMOUNT", help="Mass flux Q per unit width."),
    option("--holdup", metavar="AMOUNT", help="Mass hold-up M, mass per unit area of the base."),
    option("--centre-of-mass", "--depth", metavar="AMOUNT", help="Height h of the centre of mass."),
    option("--temperature", metavar="AMOUNT", help="Granular temperature far above, or at the interface."),
)
search_range_options = _options(
    option(
        "--search-temperature",
        type=Interval(),
        help="Surface temperatures searched; 0.001:100000 by default.",
    ),
    option("--largest-holdup", type=Number(), help="Largest mass hold-up searched; 30 by default."),
)
search_options = _options(
    option("--tolerance", type=Number(), help="Relative error allowed in Q, h and M; 1e-10 by default."),
    search_range_options,
)
output_options = _options(
    click.option("--json", "as_json", is_flag=True, help="Print one JSON object."),
    option("--plot", metavar="FILE", help="Draw into FILE: .png, .pdf or .svg."),
    option("--save", metavar="FILE", help="Write everything to FILE: .nc, .csv or .json."),
)
scale_options = _options(
    option("--diameter", metavar="LENGTH", help='Grain diameter, such as 0.001 (m) or "1 mm", for SI units.'),
    option("--density", metavar="DENSITY", help='Grain density, such as 2500 (kg/m^3) or "2.5 g/cm^3".'),
    option("--gravity", metavar="ACCELERATION", help="Gravity; 9.81 m/s^2 by default."),
)


def chute(given: Mapping[str, Any]) -> Chute:
    """The chute of the options.

    Raises:
        InputError: for parameters that are missing, contradictory or out of range.
    """
    from chuteflow.steady.chute import Chute

    if given["slope"] is not None and given["angle"] is not None:
        raise InputError(f"--slope {given['slope']:g} and --angle {given['angle']:g}: give one of them, not both")
    allowed = {f"--{name}": range_ for name, (_, range_) in _MATERIAL.items() if given[name] is None}
    if given["slope"] is None and given["angle"] is None:
        allowed = {"--slope or --angle": "tan(theta) above 0, for example --slope 0.3, or degrees"} | allowed
    if allowed:
        what = "; ".join(f"{name} ({range_})" for name, range_ in allowed.items())
        raise InputError(f"missing {what}")
    others: dict[str, Any] = {name: given[option] for option, (name, _) in _MATERIAL.items()}
    others |= words(given)
    if given["angle"] is not None:
        return Chute.at_angle(given["angle"], **others)
    others["slope"] = given["slope"]
    return Chute(**others)


def words(given: Mapping[str, Any]) -> dict[str, str]:
    """Surface and closure of the options, as far as they are given, as arguments of a Chute.

    Raises:
        InputError: for parameters of the closure that are not KEY=VALUE.
    """
    found = {name: given[name] for name in ("surface", "closure") if given[name] is not None}
    if given["settings"]:
        from chuteflow.theory.laws import settings_added

        found["closure"] = settings_added(found.get("closure", "lun"), given["settings"])
    return found


def scales(given: Mapping[str, Any]) -> Scales | None:
    """The scales of the options, or None where dimensionless results are asked for.

    Raises:
        InputError: for scales that are incomplete, no such units or not positive.
    """
    texts = {name: given[name] for name in _SCALES if given[name] is not None}
    if not texts:
        return None
    for name in ("diameter", "density"):
        if name not in texts:
            raise InputError(f"SI units need --diameter and --density: --{name} is missing")
    from chuteflow.faces.units import read_si
    from chuteflow.steady.quantities import Scales

    return Scales(**{name: read_si(f"--{name}", text, _SCALES[name]) for name, text in texts.items()})


def condition(given: Mapping[str, Any], chute: Chute, scales: Scales | None) -> dict[str, float]:
    """The one condition of the options as an argument of :func:`chuteflow.flows`.

    Raises:
        InputError: for none or several, or for what is not an amount.
    """
    named = [name for name in _CONDITIONS if given[name] is not None]
    if not named:
        raise InputError("missing one of --flux, --holdup, --centre-of-mass and --temperature, for example --flux 3")
    if len(named) > 1:
        both = " and ".join(f"{_written(name)} {given[name]}" for name in named)
        raise InputError(f"{both}: give one of --flux, --holdup, --centre-of-mass and --temperature, and no other")
    from chuteflow.faces.units import read_amount

    argument, quantity = _CONDITIONS[named[0]]
    return {argument: read_amount(_written(named[0]), given[named[0]], quantity, scales, chute.slope)}


def _written(name: str) -> str:
    """A parameter of a command as it is typed."""
    return f"--{name.replace('_', '-')}"


def chosen(found: FlowSet, which: int | None) -> Flow:
    """Flow number ``which`` of those found, 1 for the hottest, which is meant where none is given.

    Raises:
        InputError: for a number that none has.
    """
    number = 1 if which is None else which
    if not 1 <= number <= len(found):
        allowed = "there is one flow, number 1" if len(found) == 1 else f"choose from 1 (hottest) to {len(found)}"
        raise InputError(f"--flow {number}: {allowed}")
    return found[number - 1]


def search(given: Mapping[str, Any]) -> dict[str, Any]:
    """Tolerance and range of the options, as far as they are given, as arguments of the analyses."""
    arguments = {
        "tolerance": given["tolerance"],
        "surface_temperature": given["search_temperature"],
        "largest_holdup": given["largest_holdup"],
    }
    return {name: value for name, value in arguments.items() if value is not None}


def deliver(
    given: Mapping[str, Any],
    answer: str,
    save: Callable[[str], None],
    plot: Callable[[], Figure],
    **pictures: Callable[[], Figure],
) -> None:
    """Write the files that --save, --plot and options of ``pictures`` name, and print the answer.

    No full disk is to cost the answer.

    Raises:
        InputError: once the answer is printed, for files that could not be written.
    """

    def draw(figure: Callable[[], Figure], path: str) -> None:
        from chuteflow.faces.plots import write_figure
        from chuteflow.paper import style

        with style.own_settings():
            write_figure(figure(), path)

    failures = []
    writers = {"save": save} | {name: partial(draw, figure) for name, figure in {"plot": plot, **pictures}.items()}
    for name, write in writers.items():
        if given[name] is not None:
            try:
                write(given[name])
            except InputError as error:
                failures.append(str(error))
    click.echo(answer)
    if failures:
        raise InputError("; ".join(failures))


def require_outputs(given: Mapping[str, Any], saved: Sequence[str] = SAVED) -> None:
    """Check before anything is computed that --save, with an ending of ``saved``, and --plot can be written.

    Raises:
        InputError: for a file that cannot.
    """
    from chuteflow.faces.writing import require_writable

    for name, suffixes in (("save", saved), ("plot", DRAWN)):
        if given[name] is not None:
            require_writable(given[name], suffixes)
