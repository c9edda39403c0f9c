"""Options that several commands share, and what they are made into."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, wraps
from typing import TYPE_CHECKING, Any, TypeVar

import click

from chuteflow.errors import InputError
from chuteflow.parameters import BY_KEY, CONDITIONS, LARGEST_HOLDUP, SURFACE_TEMPERATURE, Parameter

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from chuteflow.branches.results import Curve, FlowSet
    from chuteflow.steady.cases import Case
    from chuteflow.steady.chute import Chute
    from chuteflow.steady.flow import Flow
    from chuteflow.steady.quantities import Scales

Command = TypeVar("Command", bound=Callable[..., Any])

#: Endings of the files that --save and --plot write.
SAVED, DRAWN = (".nc", ".csv", ".json"), (".png", ".pdf", ".svg")

_SEVERAL = re.compile(r"(.+)\.((?:png|pdf|svg)(?:,(?:png|pdf|svg))+)", re.IGNORECASE)

#: The conditions by their options.
_CONDITIONS = {condition.option: condition for condition in CONDITIONS.values()}
#: The case, or file of a chute, that holds where neither --chute nor --case is given.
CASE_VARIABLE = "CHUTEFLOW_CASE"
#: Numbers with colons or commas between, and the unit after them.
_NUMBER = r"(?>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_BEFORE_UNIT = re.compile(rf"\s*({_NUMBER}(?:[:,]{_NUMBER})*)\s*((?:1\s*/\s*)?[^\W\d_].*?)\s*")
#: Slopes from here on, and angles below, are taken for a mistake: tan(theta) and degrees were confused.
_STEEPEST, _FLATTEST = 3.0, 1.0


@dataclass(frozen=True)
class NumbersWithUnit:
    """Numbers with a ``unit`` after them, as they were typed."""

    texts: tuple[str, ...]
    unit: str
    separator: str = ":"

    def __str__(self) -> str:
        return f"{self.separator.join(self.texts)} {self.unit}"


class Number(click.ParamType):
    """A plain number."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number."""
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is not a number", param, ctx)


class IntervalType(click.ParamType):
    """Two numbers as LO:HI; with a unit after them where ``units`` are taken, then as typed."""

    name = "lo:hi"

    def __init__(self, *, units: bool = False) -> None:
        self._units = units

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float] | NumbersWithUnit:
        """Both ends."""
        ends, unit = without_unit(value) if self._units else (value, "")
        try:
            low, high = map(float, ends.split(":"))
        except ValueError:
            self.fail(f"{value!r} is not a range: write two numbers as LO:HI, for example 0.01:500", param, ctx)
        return NumbersWithUnit(tuple(ends.split(":")), unit) if unit else (low, high)


class Size(click.ParamType):
    """Two whole numbers with an x between, written as ``pattern``, for ``example`` 400x400."""

    def __init__(self, pattern: str, example: str) -> None:
        self.name = pattern.lower()
        self._pattern, self._example = pattern, example

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Both numbers."""
        try:
            first, second = map(int, str(value).lower().split("x"))
        except ValueError:
            self.fail(
                f"{value!r} is not a size: write two whole numbers as {self._pattern}, for example {self._example}",
                param,
                ctx,
            )
        return first, second


class NumberInUnits(click.ParamType):
    """A number; with a unit after it as typed."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | NumbersWithUnit:
        """The number."""
        text, unit = without_unit(str(value))
        number = Number().convert(text if unit else value, param, ctx)
        return NumbersWithUnit((text,), unit) if unit else number


def without_unit(text: str) -> tuple[str, str]:
    """Numbers and the unit after them, which may be empty."""
    parts = _BEFORE_UNIT.fullmatch(text)
    return (parts[1], parts[2]) if parts else (text, "")


class NumberOrInterval(click.ParamType):
    """A plain number, or two as LO:HI."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number, or both ends."""
        kind = IntervalType() if ":" in str(value) else Number()
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


def _names(key: str) -> tuple[str, ...]:
    """The option of a parameter, by its key and by its name in Python."""
    return tuple(dict.fromkeys(f"--{name.replace('_', '-')}" for name in (key, BY_KEY[key].name)))


def _described(command: Command) -> Command:
    """``command`` with what the chute's file or case says in the place of options that are not given."""

    @wraps(command)
    def described(**given: Any) -> Any:
        return command(**_fill_in(given))

    return described  # pyright: ignore[reportReturnType]


def _fill_in(given: dict[str, Any]) -> dict[str, Any]:
    found = _case(given["chute_file"], given["case"])
    if isinstance(given["angle"], tuple):
        given = _with_slopes(given)
    given["grains"] = {}
    if found is None:
        return given
    values: dict[str, Any] = {key: known.value for key, known in found.numbers.items()} | dict(found.names)
    if given["angle"] is not None:
        values.pop("slope", None)
    # In the order of the options, in which those that are given were typed.
    for name in [one for one in given if given[one] is None and one in values]:
        given[name] = values[name]
    given["grains"] = {name: known.value for name, known in found.grains.items()}
    return given


def _with_slopes(given: Mapping[str, Any]) -> dict[str, Any]:
    """The options with a range of slopes in the place of one of angles, where it was typed."""
    from chuteflow.steady.chute import slope_of

    low, high = given["angle"]
    if given["slope"] is not None:
        raise InputError(f"--slope and --angle {low:g}:{high:g}: give one of them, not both")
    _require_degrees(low)
    ends = slope_of(low), slope_of(high)
    places = {"angle": "slope", "slope": "angle"}
    return {places.get(name, name): ends if name == "angle" else value for name, value in given.items()}


def _case(path: str | None, name: str | None) -> Case | None:
    """The case of --chute, --case or the environment.

    Raises:
        InputError: for two of them, an unknown case or a file that cannot be read.
    """
    from chuteflow.io.chute_file import read_chute
    from chuteflow.steady.cases import case

    if path is not None and name is not None:
        raise InputError(f"--chute {path} and --case {name}: give one of them; a file may name a case itself")
    if path is not None:
        return read_chute(path)
    if name is not None:
        try:
            return case(name)
        except InputError as error:
            hint = f" (a file is given by --chute {name})" if name.endswith(".toml") else ""
            raise InputError(f"--case: {error}{hint}") from None
    variable = os.environ.get(CASE_VARIABLE)
    if not variable:
        return None
    try:
        return read_chute(variable) if variable.endswith(".toml") else case(variable)
    except InputError as error:
        raise InputError(f"{CASE_VARIABLE}: {error}") from None


def _complete_case(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    from chuteflow.steady.cases import CASES

    return [name for name in CASES if name.startswith(incomplete)]


case_options = _options(
    option("--chute", "chute_file", metavar="FILE", help="A TOML file that describes the chute; options override it."),
    option(
        "--case",
        metavar="NAME",
        shell_complete=_complete_case,
        help="A chute or material of `chuteflow cases`; options override it. "
        f"Where neither is given, ${CASE_VARIABLE} may name one.",
    ),
)
#: The grains, with which results take SI units.
grains_options = _options(
    option("--diameter", metavar="LENGTH", help='Grain diameter, such as 0.001 (m) or "1 mm", for SI units.'),
    option("--density", metavar="DENSITY", help='Grain density, such as 2500 (kg/m^3) or "2.5 g/cm^3".'),
    option("--gravity", metavar="ACCELERATION", help="Gravity; 9.81 m/s^2 by default."),
)
scale_options = _options(
    click.option("--si", is_flag=True, help="Results in SI units, with the grains of the chute's file or case."),
    grains_options,
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
_model_options = _options(
    option("--surface", metavar="NAME", help="Surface condition: free (the half-line, the default) or interface."),
    closure_options,
    option(
        "--base", metavar="NAME", help="Base: richman (the default), or johnson-jackson:specularity=0.5 and the like."
    ),
)


def _parameter_options(
    kind: click.ParamType, slope: str, angle: str, said: Callable[[Parameter], str]
) -> Callable[[Command], Command]:
    """Options of the parameters, numbers of a ``kind``; ``said`` is what the help says after their descriptions."""
    return _options(
        option("--slope", type=kind, help=f"Slope tan(theta) of the chute; {slope}."),
        option("--angle", type=kind, help=f"Inclination theta in degrees{angle}."),
        *(
            option(*_names(key), type=kind, help=f"{_opening(parameter.description)}{said(parameter)}.")
            for key, parameter in BY_KEY.items()
            if key != "slope"
        ),
    )


#: The parameters of a chute alone.
parameter_options = _parameter_options(Number(), "or give --angle", "", lambda parameter: f", {parameter.allowed}")
#: Those where no law and no base of the theory is asked for, and numbers are dimensionless.
grain_options = _options(_described, case_options, parameter_options)
#: All that says which chute, with or without SI units.
chute_options = _options(_described, case_options, parameter_options, _model_options, scale_options)


def range_options(slope: str) -> Callable[[Command], Command]:
    """The same where some parameters take a range; ``slope`` says which."""
    parameters = _parameter_options(
        NumberOrInterval(), f"LO:HI {slope}", ", also LO:HI, instead of --slope", lambda _: "; or LO:HI"
    )
    return _options(_described, case_options, parameters, _model_options, scale_options)


condition_options = _options(
    option("--flux", "--mass-flux", metavar="AMOUNT", help="Mass flux Q per unit width."),
    option("--holdup", "--mass-holdup", metavar="AMOUNT", help="Mass hold-up M, mass per unit area of the base."),
    option("--centre-of-mass", "--depth", metavar="AMOUNT", help="Height h of the centre of mass."),
    option(
        "--temperature",
        "--surface-temperature",
        metavar="AMOUNT",
        help="Granular temperature far above, or at the interface.",
    ),
)
search_range_options = _options(
    option(
        "--search-temperature",
        type=IntervalType(units=True),
        help=f"Surface temperatures searched; {SURFACE_TEMPERATURE[0]:g}:{SURFACE_TEMPERATURE[1]:.0f} by default.",
    ),
    option(
        "--largest-holdup", type=NumberInUnits(), help=f"Largest mass hold-up searched; {LARGEST_HOLDUP:g} by default."
    ),
)
search_options = _options(
    option("--tolerance", type=Number(), help="Relative error allowed in Q, h and M; 1e-10 by default."),
    search_range_options,
)
quiet_option = click.option("--quiet", is_flag=True, help="No progress and no notes on standard error.")
flow_option = option(
    "--flow", "which", type=click.INT, help="Which of the flows found, 1 for the hottest (the default)."
)


def output_options(saved: Sequence[str] = SAVED, plotted: str | None = "") -> Callable[[Command], Command]:
    """Options of the answer, whose files have endings of ``saved``; ``plotted`` says what is drawn, None nothing."""
    endings = f"{', '.join(saved[:-1])} or {saved[-1]}" if saved else ""
    return _options(
        click.option("--json", "as_json", is_flag=True, help="Print one JSON object."),
        *([] if plotted is None else [plot_options(plotted)]),
        *([option("--save", metavar="FILE", help=f"Write everything to FILE: {endings}.")] if saved else []),
        quiet_option,
    )


def plot_options(what: str) -> Callable[[Command], Command]:
    """Options of a picture; ``what`` says what is drawn."""
    return _options(
        option(
            "--plot",
            metavar="FILE",
            help=f"Draw {what}{' ' if what else ''}into FILE: .png, .pdf or .svg, or several as in flows.png,pdf.",
        ),
        option(
            "--theme", metavar="NAME", help="Style of the picture: print (the default) or slides, with larger text."
        ),
    )


def picture_files(path: str) -> list[str]:
    """The files that --plot names: one, or as in "flows.png,pdf" one for each ending."""
    several = _SEVERAL.fullmatch(path)
    if several is None:
        return [path]
    return [f"{several[1]}.{ending}" for ending in dict.fromkeys(several[2].split(","))]


def directory(name: str) -> Path:
    """The directory of a name, made if need be.

    Raises:
        InputError: where it cannot be made.
    """
    from pathlib import Path

    folder = Path(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the directory {name}: {error.strerror or error}") from None
    return folder


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
        _require_degrees(given["angle"])
        return Chute.at_angle(given["angle"], **others)
    slope: Any = given["slope"]
    require_ratio(slope)
    others["slope"] = slope
    return Chute(**others)


def require_ratio(slope: float) -> None:
    """Check that a slope is not an angle in degrees.

    Raises:
        InputError: asking for the angle that may be meant.
    """
    import math

    if _STEEPEST <= slope < 90.0:
        real = math.degrees(math.atan(slope))
        raise InputError(
            f"slope {slope:g}: did you mean --angle {slope:g}? A slope is tan(theta); for this one, of "
            f"{real:.4g} degrees, write --angle {real:.8g}"
        )


def _require_degrees(angle: float) -> None:
    import math

    if 0.0 < angle < _FLATTEST:
        slope = math.tan(math.radians(angle))
        raise InputError(
            f"angle {angle:g}: did you mean --slope {angle:g}? An angle is in degrees; for this one, of slope "
            f"{slope:.4g}, write --slope {slope:.8g}"
        )


def words(given: Mapping[str, Any]) -> dict[str, str]:
    """Surface, closure and base of the options, as far as they are given, as arguments of a Chute.

    Raises:
        InputError: for parameters of the closure that are not KEY=VALUE.
    """
    found = {name: given[name] for name in ("surface", "closure", "base") if given.get(name) is not None}
    if given["settings"]:
        from chuteflow.theory.laws import add_settings

        found["closure"] = add_settings(found.get("closure", "lun"), given["settings"])
    return found


def closure_names(given: Sequence[str]) -> list[str]:
    """The closures of several --with, each once; all that there are where none is given.

    Raises:
        InputError: for a closure of another package that cannot be loaded.
    """
    from chuteflow.theory.laws import known_laws

    if not given:
        return list(known_laws())
    # A comma also parts the parameters of one.
    names = [name for text in given for name in (text.split(",") if "=" not in text else [text])]
    return list(dict.fromkeys(name.strip() for name in names))


def scales(given: Mapping[str, Any]) -> Scales | None:
    """The scales of the options, or None where dimensionless results are requested: those of the chute's file or case
    with --si, or where one of them is given.

    Raises:
        InputError: for scales that are incomplete, no such units or not positive.
    """
    from chuteflow.steady.quantities import GRAINS

    texts = {name: given[name] for name in GRAINS if given[name] is not None}
    if not texts and not given["si"]:
        return None
    known = given["grains"]
    for name in ("diameter", "density"):
        if name not in texts and name not in known:
            also = "; a --chute file or a --case of `chuteflow cases` may give them too" if given["si"] else ""
            raise InputError(f"SI units need --diameter and --density: --{name} is missing{also}")
    from chuteflow.amounts import read_si
    from chuteflow.steady.quantities import Scales

    return Scales(**{**known, **{name: read_si(f"--{name}", text, GRAINS[name]) for name, text in texts.items()}})


def condition(given: Mapping[str, Any], chute: Chute, scales: Scales | None) -> dict[str, float]:
    """The one condition of the options as an argument of :func:`chuteflow.flows`. A number without a unit is
    dimensionless; beside SI units that is said.

    Raises:
        InputError: for none or several, or for what is not an amount.
    """
    named = [name for name in _CONDITIONS if given[name] is not None]
    if not named:
        raise InputError("missing one of --flux, --holdup, --centre-of-mass and --temperature, for example --flux 3")
    if len(named) > 1:
        both = " and ".join(f"{_spell(name)} {given[name]}" for name in named)
        raise InputError(f"{both}: give one of --flux, --holdup, --centre-of-mass and --temperature, and no other")
    chosen = _CONDITIONS[named[0]]
    return {chosen.key: amount(given, chosen.option, chosen.quantity, chute.slope, scales)}


def amount(given: Mapping[str, Any], name: str, quantity: str, slope: float, scales: Scales | None) -> float:
    """The option ``name`` as the dimensionless ``quantity``; where a bare number stands beside SI units, a note says
    how it is taken.

    Raises:
        InputError: for text that is no amount, or a unit without grains.
    """
    from chuteflow.amounts import bare
    from chuteflow.io.units import read_amount
    from chuteflow.steady.quantities import SCALED

    text = str(given[name])
    value = read_amount(_spell(name), text, quantity, scales, slope)
    if scales is not None and bare(text):
        unit = SCALED[quantity].unit
        note(
            f"{_spell(name)} {text} is taken as dimensionless, {value * scales.factor(quantity, slope):.5g} {unit} "
            f'here; in SI units write {_spell(name)} "{text} {unit}"'
        )
    return value


def own(given: Mapping[str, Any], name: str, quantity: str, slope: float | None, scales: Scales | None) -> Any:
    """The option ``name``, numbers of ``quantity``, dimensionless; None where it is not given. ``slope`` is None where
    that of the chute is a range.

    Raises:
        InputError: for a unit without grains, of another kind, or where there is not one slope.
    """
    typed = given[name]
    if not isinstance(typed, NumbersWithUnit):
        return typed
    if slope is None:
        raise InputError(f"{_spell(name)} {typed}: a unit needs one slope, and --slope is a range: omit the unit")
    from chuteflow.io.units import read_amount

    values = [read_amount(_spell(name), f"{one} {typed.unit}", quantity, scales, slope) for one in typed.texts]
    return values[0] if len(values) == 1 else tuple(values)


def note(text: str) -> None:
    """Say something on standard error that the answer does not depend on, unless --quiet is given."""
    if not is_quiet():
        click.echo(f"chuteflow: {' '.join(text.split())}", err=True)


def is_quiet() -> bool:
    """Whether the running command was given --quiet."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.params.get("quiet"))


def _spell(name: str) -> str:
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


def search(given: Mapping[str, Any], slope: float | None, scales: Scales | None = None) -> dict[str, Any]:
    """Tolerance and range of the options, as far as a command has them and they are given, as arguments of the
    analyses; a unit counts by ``scales`` on a chute of ``slope``.

    Raises:
        InputError: for a unit without grains, or of another kind.
    """
    arguments = {"tolerance": given.get("tolerance")}
    if "search_temperature" in given:
        arguments["surface_temperature"] = own(given, "search_temperature", "surface_temperature", slope, scales)
        arguments["largest_holdup"] = own(given, "largest_holdup", "mass_holdup", slope, scales)
    return {name: value for name, value in arguments.items() if value is not None}


def nearest(
    given: Mapping[str, Any], chute: Chute, condition: Mapping[str, float], scales: Scales | None
) -> tuple[dict[str, Any], list[str]]:
    """The nearest that has a flow in the requested range where ``chute`` has none: what JSON has of it, and lines."""
    from chuteflow.branches.nearest import nearest as look
    from chuteflow.io import contract, words

    within = {name: value for name, value in search(given, chute.slope, scales).items() if name != "tolerance"}
    found = look(chute, **condition, **within)
    return {"nearest_with_flow": contract.nearest_object(found, scales)}, list(words.nearest(found, scales))


def deliver_without_flow(
    given: Mapping[str, Any],
    found: FlowSet | Curve,
    condition: Mapping[str, float],
    scales: Scales | None,
    empty: Mapping[str, Any],
) -> None:
    """Print that there is no flow, and what is nearest; the object is ``empty`` with the chute and the reason."""
    from chuteflow.io import contract, words

    near, lines = nearest(given, found.chute, condition, scales)
    content = {"chute": contract.chute_object(found.chute), **empty, "reason": found.reason, **near}
    text = [words.in_own_units(f"no flow: {found.reason}", scales), *lines]
    click.echo(contract.text(content) if given["as_json"] else "\n".join(text))


def solve_one(
    given: Mapping[str, Any],
    chute: Chute,
    condition: Mapping[str, Any],
    scales: Scales | None,
    empty: Mapping[str, Any],
) -> Flow | None:
    """The flow that --flow names of those under the condition; None where there is none, once that is printed, see
    :func:`deliver_without_flow`.

    Raises:
        InputError: for a number that no flow has.
    """
    from chuteflow.branches.enumeration import flows

    found = flows(chute, **condition)
    if len(found):
        return chosen(found, given["which"])
    deliver_without_flow(given, found, condition, scales, empty)
    return None


def saver(result: Any, scales: Scales | None = None) -> Callable[[str], None]:
    """What writes a result to a path, see :func:`chuteflow.save`."""

    def save(path: str) -> None:
        from chuteflow.io import files

        files.save(result, path, scales=scales)

    return save


def deliver_object(
    given: Mapping[str, Any],
    content: Any,
    report: Iterable[str],
    rows: Callable[[], Iterable[Sequence[Any]]],
    plot: Callable[[], Figure] | None,
) -> None:
    """Print the object ``content`` with --json, else the lines of ``report``; write it, or ``rows``, to the file that
    --save names; and draw. See :func:`deliver`.

    Raises:
        InputError: once the answer is printed, for files that could not be written.
    """
    from chuteflow.io.files import write_answer

    deliver(given, lambda: content, report, lambda path: write_answer(path, lambda: content, rows), plot)


def deliver(
    given: Mapping[str, Any],
    content: Callable[[], Any],
    report: Iterable[str],
    save: Callable[[str], None] | None,
    plot: Callable[[], Figure] | None,
    **pictures: Callable[[], Figure],
) -> None:
    """Write the files that --save and --plot, where the command has them, and options of ``pictures`` name, and print
    the object ``content`` with --json, else the lines of ``report``.

    No full disk is to cost the answer.

    Raises:
        InputError: once the answer is printed, for files that could not be written.
    """

    def draw(figure: Callable[[], Figure], path: str) -> None:
        from chuteflow.plotting import style
        from chuteflow.plotting.plots import write_figure

        with style.own_settings():
            drawn = style.apply_theme(figure(), given.get("theme") or "print")
            for one in picture_files(path):
                write_figure(drawn, one)

    from chuteflow.io import contract

    answer = contract.text(content()) if given["as_json"] else "\n".join(report)
    failures = []
    if plot is not None:
        pictures = {"plot": plot, **pictures}
    writers = {name: partial(draw, figure) for name, figure in pictures.items()}
    if save is not None:
        writers = {"save": save, **writers}
    for name, write in writers.items():
        if given.get(name) is not None:
            try:
                write(given[name])
            except InputError as error:
                failures.append(str(error))
    click.echo(answer)
    if failures:
        raise InputError("; ".join(failures))


def require_outputs(given: Mapping[str, Any], saved: Sequence[str] = SAVED) -> None:
    """Check before anything is computed that --save, with an ending of ``saved``, and --plot can be written, as far as
    the command has them.

    Raises:
        InputError: for a file that cannot.
    """
    from chuteflow.io.writing import require_writable

    if given.get("save") is not None:
        require_writable(given["save"], saved)
    if given.get("plot") is not None:
        for path in picture_files(given["plot"]):
            require_writable(path, DRAWN)
    if given.get("theme") is not None:
        from chuteflow.plotting.style import require_theme

        require_theme(given["theme"])
        if given["plot"] is None:
            raise InputError(f"--theme {given['theme']}: there is no picture, give --plot too")
