"""Where there is no flow: the nearest value of each parameter, one at a time, and of the quantity asked for.

Values are examined outwards in steps; what lies between two of them is not, but for the edge, which is bisected. A
value that is told is one at which a flow was solved.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from chuteflow import display
from chuteflow.branches.enumeration import asked, flows
from chuteflow.branches.families import families
from chuteflow.branches.ranges import Range
from chuteflow.errors import ChuteflowError
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import LARGEST_HOLDUP, PARAMETERS, SURFACE_TEMPERATURE, Parameter
from chuteflow.steady.chute import Chute
from chuteflow.steady.model import model
from chuteflow.steady.solver import TOLERANCE
from chuteflow.threads import on_one_thread

#: Slopes examined: a factor from one to the next, and how many on either side.
_FACTOR, _SLOPES = 1.03, 32
#: Values examined of the other parameters, evenly over their range.
_VALUES = 24
#: Bisections of the edge between a value without and one with flows.
_BISECTIONS = 6


@dataclass(frozen=True)
class Nearest:
    """The nearest that has a flow where ``chute`` has none.

    ``parameters`` has a value by the name of each parameter of the chute, the others as they are, or None where none of
    those examined has a flow; ``examined`` is the smallest and the largest of these. ``quantity`` is the name of the
    condition ("Q", "M", "h" or "T_surface"), or None, and ``value`` the nearest value of it that a flow of the chute
    itself was solved at, or None.
    """

    chute: Chute
    parameters: Mapping[str, float | None]
    examined: Mapping[str, tuple[float, float]]
    quantity: str | None = None
    value: float | None = None

    def __repr__(self) -> str:
        numbers = {PARAMETERS[name].key: value for name, value in self.parameters.items() if value is not None}
        if self.quantity is not None and self.value is not None:
            numbers[self.quantity] = self.value
        return display.line("Nearest", None if numbers else "none among those examined", **numbers)


@on_one_thread
@np.errstate(under="ignore")
def nearest(
    chute: Chute,
    *,
    Q: float | None = None,
    M: float | None = None,
    h: float | None = None,
    T_surface: float | None = None,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
) -> Nearest:
    """The nearest slope, restitution, wall restitution, roughness and value of the condition that have a flow.

    Args:
        chute: a chute without a flow.
        Q: the condition that no flow met, as in :func:`chuteflow.flows`; without one, any flow counts.
        M: the same for the hold-up.
        h: the same for the centre of mass.
        T_surface: the same for the surface temperature.
        surface_temperature: range searched.
        largest_holdup: range searched.

    Raises:
        InputError: for a value or a range out of bounds, or several conditions.
    """
    given = {"Q": Q, "M": M, "h": h, "T_surface": T_surface}
    condition = {name: value for name, value in given.items() if value is not None}
    within = Range.checked(surface_temperature, largest_holdup, chute.surface)
    looked_for = _LookedFor(condition, within)
    if condition:
        which, value = asked(given)
        looked_for = replace(looked_for, which=which, value=value)
    found: dict[str, float | None] = {}
    examined: dict[str, tuple[float, float]] = {}
    for parameter in PARAMETERS.values():
        places = _places(parameter, getattr(chute, parameter.name))
        found[parameter.name] = _first(chute, parameter, places, looked_for)
        examined[parameter.name] = (min(places), max(places))
    quantity = next(iter(condition), None)
    return Nearest(chute, found, examined, quantity, looked_for.nearest_value(chute) if quantity else None)


@dataclass(frozen=True)
class _LookedFor:
    """A flow under a ``condition``, or any, in a range."""

    condition: Mapping[str, float]
    within: Range
    which: int = 0
    value: float = 0.0

    def on(self, chute: Chute) -> bool:
        """Whether rough flows of ``chute`` meet it."""
        branches = self._rough(chute)
        if not self.condition:
            return bool(branches)
        target = math.log(self.value)
        return any(m[:, self.which].min() <= target <= m[:, self.which].max() for m in branches)

    def surely_on(self, chute: Chute) -> bool:
        """Whether a flow of ``chute`` is solved that meets it."""
        if not self.condition:
            return any(family.solved(0, TOLERANCE) for family in families(model(chute), self.within))
        search = (self.within.coldest, self.within.hottest)
        return len(flows(chute, **self.condition, surface_temperature=search, largest_holdup=self.within.deepest)) > 0

    def nearest_value(self, chute: Chute) -> float | None:
        """The nearest value of the condition at which a flow of the chute itself is solved."""
        target = math.log(self.value)
        ends = [
            (abs(float(m[i, self.which]) - target), family, int(i))
            for family in families(model(chute), self.within)
            for m in (family.macroscopic,)
            for i in (np.abs(m[:, self.which] - target).argmin(),)
        ]
        for _, family, i in sorted(ends, key=lambda end: end[0]):
            point = family.solved(i, TOLERANCE)
            if point is not None:
                return float(np.exp(point.m[self.which]))
        return None

    def _rough(self, chute: Chute) -> list[Array]:
        try:
            return [family.macroscopic for family in families(model(chute), self.within)]
        except ChuteflowError:
            return []  # a chute whose law has no meaning there, or that cannot be searched


def _places(parameter: Parameter, start: float) -> list[float]:
    """Values of a parameter to be examined, the nearest first."""
    if parameter.name == "slope":
        places = [start * _FACTOR**k for k in range(-_SLOPES, _SLOPES + 1) if k]
        return sorted(
            (p for p in places if parameter.low <= p <= parameter.high), key=lambda p: abs(math.log(p / start))
        )
    places = np.linspace(parameter.low, parameter.high, _VALUES + 1).tolist()
    return sorted((p for p in places if p != start), key=lambda p: abs(p - start))


def _first(chute: Chute, parameter: Parameter, places: list[float], looked_for: _LookedFor) -> float | None:
    """The nearest of ``places`` that has a flow, moved towards the chute as far as it has one."""
    for place in places:
        for value in _towards(chute, parameter, place, looked_for):
            if looked_for.surely_on(replace(chute, **{parameter.name: value})):
                return value
    return None


def _towards(chute: Chute, parameter: Parameter, place: float, looked_for: _LookedFor) -> Iterator[float]:
    """Where rough flows meet the condition between the chute and ``place``, the nearest first; nothing where not even
    those at ``place`` do."""
    if not looked_for.on(replace(chute, **{parameter.name: place})):
        return
    outer, inner = place, getattr(chute, parameter.name)
    if parameter.name == "slope":
        inner = max(inner, place / _FACTOR) if place > inner else min(inner, place * _FACTOR)
    met = [place]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (outer + inner)
        if looked_for.on(replace(chute, **{parameter.name: middle})):
            outer = middle
            met.append(middle)
        else:
            inner = middle
    yield from reversed(met)
