"""Queries of the page, parsed and checked: the chute, the flux, the grains and the axes of the map."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from chuteflow.checks import number_in, shorten
from chuteflow.errors import InputError
from chuteflow.io.contract import PARAMETERS
from chuteflow.parameters import BY_KEY
from chuteflow.steady.cases import CASES, GUESSED, TYPICAL, Case
from chuteflow.steady.chute import SURFACES, Chute
from chuteflow.steady.quantities import Scales
from chuteflow.theory.laws import LAWS, runs_code

Query = Mapping[str, str]

#: Fluxes that the page offers.
FLUX_RANGE = (1e-3, 1e5)
#: Names of the grains in a query: SI units are wanted where both are given.
GRAINS = ("diameter", "density")


@dataclass(frozen=True)
class Control:
    """A slider, its range and its meaning. The number field beside it accepts the whole range of a chute."""

    label: str
    symbol: str
    low: float
    high: float
    logarithmic: bool
    meaning: str


CONTROLS = {
    "slope": Control("Slope", "tan θ", 0.05, 0.7, False, "Slope of the chute; gravity along it drives the flow."),
    "e": Control("Restitution", "e", 0.5, 1.0, False, "Of two colliding grains; 1 is elastic."),
    "ew": Control("Base restitution", "e_w", 0.0, 1.0, False, "Of a grain that collides with the base; 1 is elastic."),
    "roughness": Control(
        "Roughness",
        "r",
        BY_KEY["roughness"].low,
        BY_KEY["roughness"].high,
        False,
        "How deep a grain sinks between the grains fixed to the base.",
    ),
    "Q": Control("Mass flux", "Q", *FLUX_RANGE, True, "Mass per unit width and time; if not in SI, in ρd√(gd cos θ)."),
}


@dataclass(frozen=True)
class Choice:
    """A list of options: the names of a chute's setting, and their meanings."""

    label: str
    options: Mapping[str, str]
    meaning: str


_SURFACES = {"free": "free, dilute at large heights", "interface": "interface, ballistic grains above"}
_CLOSURES = {
    "lun": "Lun et al. 1984",
    "lun-fourier": "Lun, heat by Fourier's law alone",
    "garzo-dufty": "Garzó & Dufty 1999",
    "garzo-dufty-fourier": "Garzó & Dufty, heat by Fourier's law alone",
    "extended": "Extended, Berzi 2014",
    "jenkins-berzi": "Extended, Jenkins & Berzi 2010",
}
CHOICES = {
    "surface": Choice(
        "Surface", {name: _SURFACES.get(name, name) for name in SURFACES}, "The condition at the upper surface."
    ),
    "closure": Choice(
        "Closure", {name: _CLOSURES.get(name, name) for name in LAWS}, "The constitutive law of stress and heat flux."
    ),
}


@dataclass(frozen=True)
class Preset:
    """A case: the part of the page's state that it sets, and ``words`` on the sources of its numbers."""

    title: str
    state: Mapping[str, float | str]
    words: str = ""


_BASE = {"slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6, "surface": "free", "closure": "lun", "Q": 3.0}
_PRODUCTIVE = _BASE | {"e": 0.9, "ew": 0.6, "roughness": 0.8}
PRESETS = (
    Preset("Three flows at one flux (figures 2, 3)", _BASE),
    Preset("Gentle slope: no density inversion (figure 4)", _BASE | {"slope": 0.28}),
    Preset("Steep: every density inverted (figure 4)", _BASE | {"slope": 0.34, "Q": 10.0}),
    Preset("Productive, hottest inside (figure 5)", _PRODUCTIVE | {"slope": 0.4}),
    Preset("Productive, one flow a flux (figure 6)", _PRODUCTIVE | {"slope": 0.42}),
    Preset("Beneath an interface (figures 7 to 9)", _BASE | {"surface": "interface"}),
    Preset("Hot, beside its reduced model (figure 12)", _BASE | {"Q": 6.42}),
    Preset("Hot and inverted, beside the exact solution (figure 13)", _BASE | {"slope": 0.354, "Q": 56.7}),
    Preset("Heat by Fourier's law alone (figures 15 to 17)", _BASE | {"closure": "lun-fourier"}),
    Preset("Too steep for hot flows (figure 14)", _BASE | {"slope": 0.45}),
)


def cases() -> list[Preset]:
    """The chutes and materials of ``chuteflow cases``, with their grains."""
    return [Preset(one.name, _state(one), _describe_known(one)) for one in CASES.values()]


def _state(one: Case) -> dict[str, float | str]:
    """The values of a case, by the names of the page's state; its grains have a diameter in mm."""
    said: dict[str, float | str] = {key: known.value for key, known in one.numbers.items()} | dict(one.names)
    grains = one.scales
    return said if grains is None else said | {"d": round(1e3 * grains.diameter, 12), "rho": grains.density}


def _describe_known(one: Case) -> str:
    numbers = {**one.numbers, **one.grains}
    kinds = {how: [key for key, known in numbers.items() if known.how == how] for how in (TYPICAL, GUESSED)}
    said = "; ".join(f"{how}: {', '.join(keys)}" for how, keys in kinds.items() if keys)
    told = f" {said[:1].upper()}{said[1:]}; replace them by your own values." if said else ""
    return f"{one.name}: {one.description}.{told}"


_DEFAULTS = {"surface": SURFACES[0], "closure": next(iter(LAWS))}


def read(query: Query, *, other: tuple[str, ...] = (), optional: tuple[str, ...] = ()) -> tuple[Chute, dict[str, str]]:
    """The chute that a query names, and its values of ``other``, and of ``optional`` as far as they are given.

    Raises:
        InputError: for parameters that are missing, unknown or out of range.
    """
    needed = (*PARAMETERS, *other)
    allowed = (*needed, *optional)
    unknown = [name for name in query if name not in allowed]
    if unknown:
        raise InputError(f"unknown parameter {unknown[0][:40]!r}: choose from {', '.join(allowed)}")
    given = {**_DEFAULTS, **query}
    missing = [name for name in needed if name not in given]
    if missing:
        raise InputError(f"missing {', '.join(missing)}: for example {missing[0]}={_BASE.get(missing[0], 'slope')}")
    if runs_code(given["closure"]):
        raise InputError("closure: a page runs no files: give the name of a law, with parameters as name:key=value")
    chute: dict[str, Any] = {
        long: given[short] if short in _DEFAULTS else number_in(short, given[short])
        for short, long in PARAMETERS.items()
    }
    return Chute(**chute), {name: given[name] for name in (*other, *optional) if name in given}


def flux(text: str) -> float:
    """The flux of a query.

    Raises:
        InputError: for what is no number, or out of range.
    """
    return number_in("Q", text, *FLUX_RANGE)


def place(name: str, given: Query, count: int) -> int:
    """The place of a query among so many, counted from 0.

    Raises:
        InputError: for one that there is not.
    """
    if given[name] not in map(str, range(count)):
        raise InputError(f"{name} = {given[name][:40]!r}: there are {count}, counted from 0")
    return int(given[name])


#: Characters of the name of a file that is sent, at most.
_LONGEST_NAME = 200


def file_name(given: Query) -> str:
    """The name of a file that was sent, without folders.

    Raises:
        InputError: for a query with other names, or a file of another kind.
    """
    unknown = next((name for name in given if name not in ("name", "content", "slope", *GRAINS)), None)
    if unknown is not None:
        raise InputError(f"unknown parameter {unknown[:40]!r}")
    name = re.split(r"[/\\]", given.get("name", ""))[-1]
    if not name.lower().endswith((".csv", ".nc")) or not name.isprintable() or len(name) > _LONGEST_NAME:
        raise InputError(f"{shorten(name)}: must be a file .csv or .nc")
    return name


def scales(given: Query) -> Scales | None:
    """The scales of the grains of a query, or None where it names none.

    Raises:
        InputError: for one without the other, what is no number, or out of range.
    """
    named = [name for name in GRAINS if name in given]
    if not named:
        return None
    if len(named) == 1:
        raise InputError(f"SI units need {' and '.join(GRAINS)}: only {named[0]} is given")
    return Scales(
        number_in("diameter", given["diameter"], 1e-9, 1e3), number_in("density", given["density"], 1e-3, 1e6)
    )


@dataclass(frozen=True)
class ColumnAsked:
    """A column of the map: the chute, the two parameters across and up, the place (fraction of the outer axis), and
    values of the inner parameter (``near``) at which the classes of the columns beside it change.

    A ``coarse`` column is a preview while sliders move. The chute has the axes' own parameters at the low ends of
    their ranges.
    """

    chute: Chute
    x: str
    y: str
    place: float
    near: tuple[float, ...]
    coarse: bool = False


#: Largest number of values near which a column is classified on a finer grid.
MOST_NEAR = 32


def map_column(query: Query) -> ColumnAsked:
    """The column of the map that a query asks for.

    Raises:
        InputError: for parameters that are missing, unknown, the same or out of range.
    """
    axes = list(BY_KEY)
    given = [query.get(which, "") for which in ("x", "y")]
    for which, name in zip("xy", given, strict=True):
        if name not in axes:
            raise InputError(f"{which} = {name[:40]!r}: choose one of {', '.join(axes)}")
    x, y = given
    if x == y:
        raise InputError(f"x and y are both {x}: give two parameters")
    held = dict(query) | {name: str(CONTROLS[name].low) for name in (x, y)}
    chute, other = read(held, other=("x", "y", "place"), optional=("near", "coarse"))
    near = [text for text in other.get("near", "").split(",") if text]
    if len(near) > MOST_NEAR:
        raise InputError(f"near has {len(near)} values: give at most {MOST_NEAR}")
    values = tuple(number_in("near", text, -1.0, 2.0) for text in near)
    if other.get("coarse", "1") != "1":
        raise InputError(f"coarse = {other['coarse'][:40]!r}: must be 1, or left away")
    return ColumnAsked(chute, x, y, number_in("place", other["place"], 0.0, 1.0), values, "coarse" in other)
