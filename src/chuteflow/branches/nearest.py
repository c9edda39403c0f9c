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
from chuteflow.branches.enumeration import check_condition, flows_within
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.solution_branches import find_branches, search_range
from chuteflow.errors import ChuteflowError
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import LARGEST_HOLDUP, PARAMETERS, SURFACE_TEMPERATURE, Parameter
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import LOG_Q
from chuteflow.steady.model import model
from chuteflow.steady.solver import TOLERANCE
from chuteflow.threads import on_one_thread

#: Slopes examined: a factor from one to the next, and how many on either side.
_FACTOR, _SLOPES = 1.03, 32
#: Values examined of the other parameters, evenly over their range.
_VALUES = 24
#: Bisections of the edge between a value without and one with flows.
_BISECTIONS = 6
#: Cells of the grids of trajectories at which the values of one parameter are left: half a second or so. Where flows
#: multiply with depth a grid has a hundred times as many as elsewhere.
_CELLS = 500_000


@dataclass(frozen=True)
class Nearest:
    """The nearest that has a flow where ``chute`` has none.

    ``parameters`` has a value by the name of each parameter of the chute, the others as they are, or None where none of
    those examined has a flow; ``examined`` is the smallest and the largest of these, which end early where searches
    take long. ``quantity`` is the name of the condition ("Q", "M", "h" or "T_surface"), or None, and ``value`` the
    nearest value of it that a flow of the chute itself was solved at, or None.
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

    def _repr_html_(self) -> str:
        rows = []
        for name, value in self.parameters.items():
            low, high = self.examined.get(name, (math.nan, math.nan))
            found = "none" if value is None else display.number(value)
            if name == "slope" and value is not None:
                found += f" ({math.degrees(math.atan(value)):.4g} degrees)"
            rows.append([PARAMETERS[name].symbol, found, f"{display.number(low)} to {display.number(high)}"])
        if self.quantity is not None:
            rows.append([self.quantity, "none" if self.value is None else display.number(self.value), ""])
        caption = f"Nearest with a flow to {self.chute.summary}, one number changed at a time"
        return display.html_table(caption, ["", "nearest", "examined"], rows)


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
    within = SearchRange.checked(surface_temperature, largest_holdup, chute.surface)
    looked_for = _Target(within)
    quantity = near = None
    if condition:
        (quantity,) = condition
        which, value = check_condition(given)
        looked_for = _Target(within.restrict(which, value), which, value)
        near = _nearest_value(chute, which, value, within)
    found: dict[str, float | None] = {}
    examined: dict[str, tuple[float, float]] = {}
    for name, parameter in PARAMETERS.items():
        found[name], examined[name] = _first(chute, parameter, looked_for)
    return Nearest(chute, found, examined, quantity, near)


@dataclass(frozen=True)
class _Target:
    """A flow in a range at which the quantity ``which`` has a ``value``, or any where that is None."""

    within: SearchRange
    which: int = LOG_Q
    value: float | None = None

    def on(self, chute: Chute) -> bool:
        """Whether rough flows of ``chute`` meet it."""
        branches = self._rough(chute)
        if self.value is None:
            return bool(branches)
        target = math.log(self.value)
        return any(m[:, self.which].min() <= target <= m[:, self.which].max() for m in branches)

    def surely_on(self, chute: Chute) -> bool:
        """Whether a flow of ``chute`` is solved that meets it."""
        if self.value is None:
            return any(branch.solved(0, TOLERANCE) for branch in find_branches(model(chute), self.within))
        return len(flows_within(chute, self.which, self.value, TOLERANCE, self.within)) > 0

    def cells(self, chute: Chute) -> int:
        """How many cells the search of ``chute`` looked at."""
        try:
            return search_range(model(chute), self.within).cells
        except ChuteflowError:
            return 0

    def _rough(self, chute: Chute) -> list[Array]:
        try:
            return [branch.macroscopic for branch in find_branches(model(chute), self.within)]
        except ChuteflowError:
            return []  # a chute whose law has no meaning there, or that cannot be searched


def _nearest_value(chute: Chute, which: int, value: float, within: SearchRange) -> float | None:
    """The value nearest to ``value`` of the quantity ``which`` at which a flow of the chute itself is solved."""
    target = math.log(value)
    ends = [
        (abs(float(m[i, which]) - target), branch, int(i))
        for branch in find_branches(model(chute), within)
        for m in (branch.macroscopic,)
        for i in (np.abs(m[:, which] - target).argmin(),)
    ]
    for _, branch, i in sorted(ends, key=lambda end: end[0]):
        point = branch.solved(i, TOLERANCE)
        if point is not None:
            return float(np.exp(point.m[which]))
    return None


def _places(parameter: Parameter, start: float) -> list[float]:
    """Values of a parameter to be examined, the nearest first."""
    if parameter.name == "slope":
        places = [start * _FACTOR**k for k in range(-_SLOPES, _SLOPES + 1) if k]
        return sorted(
            (p for p in places if parameter.low <= p <= parameter.high), key=lambda p: abs(math.log(p / start))
        )
    places = np.linspace(parameter.low, parameter.high, _VALUES + 1).tolist()
    return sorted((p for p in places if p != start), key=lambda p: abs(p - start))


def _first(chute: Chute, parameter: Parameter, looked_for: _Target) -> tuple[float | None, tuple[float, float]]:
    """The nearest value of a parameter that has a flow, moved towards the chute as far as it has one, and the smallest
    and largest value examined."""
    examined = [getattr(chute, parameter.name)]
    cells = 0
    for place in _places(parameter, examined[0]):
        examined.append(place)
        for value in _towards(chute, parameter, place, looked_for):
            if looked_for.surely_on(replace(chute, **{parameter.name: value})):
                return value, (min(examined), max(examined))
        cells += looked_for.cells(replace(chute, **{parameter.name: place}))
        if cells > _CELLS:
            break
    return None, (min(examined), max(examined))


def _towards(chute: Chute, parameter: Parameter, place: float, looked_for: _Target) -> Iterator[float]:
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
