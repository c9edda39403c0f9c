"""Options that several commands share, and what they are made into."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import click

from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY, CONDITIONS, LARGEST_HOLDUP, SURFACE_TEMPERATURE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.branches.results import FlowSet
    from chuteflow.steady.chute import Chute
    from chuteflow.steady.flow import Flow
    from chuteflow.steady.quantities import Scales

Command = TypeVar("Command", bound=Callable[..., Any])

#: Endings of the files that --save and --plot write.
SAVED, DRAWN = (".nc", ".csv", ".json"), (".png", ".pdf", ".svg")

#: The conditions by their options.
_CONDITIONS = {condition.option: condition for condition in CONDITIONS.values()}
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


def _opening(text: str) -> str:
    """``text`` as it begins a sentence."""
    return text[:1].upper() + text[1:]


def range_options(slope: str) -> Callable[[Command], Command]:
    """Options of the parameters of a chute where some of them take a range; ``slope`` says which."""
    return _options(
        option("--slope", type=NumberOrInterval(), help=f"Slope tan(theta) of the chute; LO:HI {slope}."),
        option("--angle", type=Number(), help="Inclination theta in degrees, instead of --slope."),
        *(
            option(f"--{key}", type=NumberOrInterval(), help=f"{_opening(parameter.description)}; or LO:HI.")
            for key, parameter in BY_KEY.items()
            if key != "slope"
        ),
    )


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
    *(
        option(f"--{key}", type=Number(), help=f"{_opening(parameter.description)}, {parameter.allowed}.")
        for key, parameter in BY_KEY.items()
        if key != "slope"
    ),
    option("--surface", metavar="NAME", help="Surface condition: free (the half-line, the default) or interface."),
    closure_options,
    option(
        "--base", metavar="NAME", help="Base: richman (the default), or johnson-jackson:specularity=0.5 and the like."
    ),
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
        help=f"Surface temperatures searched; {SURFACE_TEMPERATURE[0]:g}:{SURFACE_TEMPERATURE[1]:.0f} by default.",
    ),
    option("--largest-holdup", type=Number(), help=f"Largest mass hold-up searched; {LARGEST_HOLDUP:g} by default."),
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
    material = [parameter for parameter in BY_KEY.values() if parameter.name != "slope"]
    missing = [
        f"--{parameter.key} ({parameter.allowed}, for example --{parameter.key} {parameter.example})"
        for parameter in material
        if given[parameter.key] is None
    ]
    if given["slope"] is None and given["angle"] is None:
        missing = ["--slope or --angle (tan(theta) above 0, for example --slope 0.3, or degrees)", *missing]
    if missing:
        raise InputError(f"missing {'; '.join(missing)}")
    others: dict[str, Any] = {parameter.name: given[parameter.key] for parameter in material}
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
    found = {name: given[name] for name in ("surface", "closure", "base") if given.get(name) is not None}
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
    from chuteflow.io.units import read_si
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
    from chuteflow.io.units import read_amount

    chosen = _CONDITIONS[named[0]]
    amount = read_amount(_written(chosen.option), given[chosen.option], chosen.quantity, scales, chute.slope)
    return {chosen.key: amount}


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


def deliver_object(
    given: Mapping[str, Any],
    content: Any,
    report: Iterable[str],
    rows: Callable[[], Iterable[Sequence[str]]],
    plot: Callable[[], Figure],
) -> None:
    """Print the object ``content`` with --json, else the lines of ``report``; write it, or ``rows``, to the file that
    --save names; and draw. See :func:`deliver`.

    Raises:
        InputError: once the answer is printed, for files that could not be written.
    """
    from chuteflow.io import contract
    from chuteflow.io.files import write_answer

    answer = contract.text(content) if given["as_json"] else "\n".join(report)
    deliver(given, answer, lambda path: write_answer(path, lambda: content, rows), plot)


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
        from chuteflow.plotting import style
        from chuteflow.plotting.plots import write_figure

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
    from chuteflow.io.writing import require_writable

    for name, suffixes in (("save", saved), ("plot", DRAWN)):
        if given[name] is not None:
            require_writable(given[name], suffixes)
