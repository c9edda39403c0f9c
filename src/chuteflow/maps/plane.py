"""A plane of two parameters of a chute, and what a point of it is classified by.

Along one axis, ``inner``, points are cheap: where it is a parameter of the base, all points of a column share
one grid of trajectories.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from chuteflow.branches.ranges import SearchRange
from chuteflow.checks import number
from chuteflow.errors import InputError
from chuteflow.maps.kinds import DENSITIES, INTERIORS, FlowClasses, classify_flows
from chuteflow.maps.zeros import bound_extremes
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import LARGEST_HOLDUP, PARAMETERS, SURFACE_TEMPERATURE
from chuteflow.steady.chute import Chute
from chuteflow.steady.model import model
from chuteflow.theory.bases import base
from chuteflow.theory.constitutive import Law, dilute_drift, require_height
from chuteflow.theory.hot import LAMBDA_C, Dilute, dilute, hot_parameters, inversion_lambda
from chuteflow.trajectories.refining import TrajectoryGrid, integrate_trajectories_from, starting_temperatures
from chuteflow.trajectories.tables import ENTRIES, envelope

#: What the flows of a point are classified by, in the order of its code; after these come the temperatures asked
#: for. All but the first two are 1 where there are such flows, else 0.
CODES = ("most", "families", *INTERIORS, *DENSITIES)
#: The same in few numbers: whether there are hot flows (1, 0, or -1 where the theory does not say), the numbers of
#: flows that share one flux and of branches, and the bits of the kinds of interior and of density.
SUMMARY = ("hot", "most", "families", "interior", "density")
#: What is known of hot flows in closed form, in the order of its code: whether there are any, and on which side of
#: each bound a point is.
HOT_CODES = ("hot", "base", "inside", "steep", "inversion")
#: Bases along an axis, which bound those that a grid has to serve.
_BETWEEN = 9
#: Surface temperatures whose logarithms are nearer are one.
_SAME = 1e-6

#: The class of a point: integers in the order of CODES, then 0 or 1 for each temperature; or that of HOT_CODES.
Code = tuple[int, ...]


@dataclass(frozen=True)
class ParameterAxis:
    """A parameter from ``low`` to ``high``.

    Raises:
        InputError: for an unknown parameter or an empty range.
    """

    name: str
    low: float
    high: float

    def __post_init__(self) -> None:
        if self.name not in PARAMETERS:
            raise InputError(f"unknown parameter {self.name!r}: choose one of {', '.join(PARAMETERS)}")
        for end in ("low", "high"):
            object.__setattr__(self, end, number(self.name, getattr(self, end)))
        object.__setattr__(self, "high", PARAMETERS[self.name].rounded(self.high))
        if not self.low < self.high:
            raise InputError(f"{self.name} from {self.low:g} to {self.high:g}: must rise")

    def at(self, fraction: Any) -> Any:
        """The value (or values) at a fraction of the range, 0 to 1."""
        return self.low + (self.high - self.low) * fraction


@dataclass(frozen=True)
class ParameterPlane:
    """Two axes, and the values of all else.

    ``chute`` has the fixed parameters, those of the axes at a value that does not matter; ``temperatures`` are
    those at which flows are searched for; ``within`` is the range searched.

    Raises:
        InputError: for twice the same axis, or for a corner that is no chute.
    """

    x: ParameterAxis
    y: ParameterAxis
    chute: Chute
    temperatures: tuple[float, ...]
    within: SearchRange = field(default_factory=lambda: SearchRange.checked(SURFACE_TEMPERATURE, LARGEST_HOLDUP))

    def __post_init__(self) -> None:
        if self.x.name == self.y.name:
            raise InputError(f"both axes are {self.x.name}: give two parameters")
        for corner in self._corners:
            if corner.surface == "free":
                require_height(corner.law, corner.restitution, corner.slope)

    def at(self, x: float, y: float) -> Chute:
        """The chute at values of the two parameters."""
        changed: dict[str, Any] = {self.x.name: float(x), self.y.name: float(y)}
        return replace(self.chute, **changed)

    @property
    def _corners(self) -> list[Chute]:
        return [self.at(x, y) for x in (self.x.low, self.x.high) for y in (self.y.low, self.y.high)]

    @cached_property
    def hot_known(self) -> bool:
        """Whether hot flows are known in closed form: on the half-line, under laws with a temperature far above."""
        return all(c.surface == "free" and dilute_drift(c.law, c.e, c.slope) == 0.0 for c in self._corners)

    @property
    def transposed(self) -> bool:
        """Whether the inner axis is ``x``: the first that is of the base, else ``y``."""
        return PARAMETERS[self.x.name].of_base and not PARAMETERS[self.y.name].of_base

    @property
    def outer(self) -> ParameterAxis:
        """The axis along which columns are placed."""
        return self.y if self.transposed else self.x

    @property
    def inner(self) -> ParameterAxis:
        """The axis along a column."""
        return self.x if self.transposed else self.y

    def chute_at(self, outer: float, inner: float) -> Chute:
        """The chute at fractions 0 to 1 of the outer and inner axis."""
        u, v = float(self.outer.at(outer)), float(self.inner.at(inner))
        return self.at(v, u) if self.transposed else self.at(u, v)


def classify(plane: ParameterPlane, outer: float, inner: float) -> Code:
    """The class of the point at fractions of the outer and inner axis of ``plane``, by CODES."""
    found = _kinds(plane, plane.chute_at(outer, inner))
    return (
        found.most,
        found.families,
        *(int(found.interior & bit > 0) for bit in INTERIORS.values()),
        *(int(found.density & bit > 0) for bit in DENSITIES.values()),
        *map(int, found.at),
    )


def summarise(plane: ParameterPlane, outer: float, inner: float) -> Code:
    """The class of the point at fractions of the outer and inner axis of ``plane`` in few numbers, by SUMMARY."""
    found = _kinds(plane, plane.chute_at(outer, inner))
    hot = classify_hot(plane, outer, inner)[0] if plane.hot_known else -1
    return (hot, found.most, found.families, found.interior, found.density)


def _kinds(plane: ParameterPlane, chute: Chute) -> FlowClasses:
    grid, extremes = _grid(plane, chute.slope, chute.restitution, chute.law)
    return classify_flows(grid.of_base(model(chute)), extremes, plane.temperatures, plane.within)


def classify_hot(plane: ParameterPlane, outer: float, inner: float) -> Code:
    """What is known in closed form of the point at fractions of the outer and inner axis, by HOT_CODES.

    All are 1 or 0: hot flows; energy from the base (F21 > 0); lost in the interior (delta > 0); more from the base
    than hot flows can lose (lambda >= 3); the volume fraction of hot flows rising with height (lambda > 0.660).
    """
    chute = plane.chute_at(outer, inner)
    closure = chute.law
    limit = _dilute(closure, chute.restitution, chute.slope if closure.knows_slope else 0.0)
    found = hot_parameters(limit, chute.wall_restitution, chute.roughness, chute.slope, base(chute.base))
    gained, lost = found.F21 > 0.0, found.delta > 0.0
    strong = gained and lost
    return (
        int(found.obstacle is None),
        int(gained),
        int(lost),
        int(strong and found.lambda_ >= LAMBDA_C),
        int(strong and found.lambda_ > inversion_lambda()),
    )


def _neutral(plane: ParameterPlane) -> dict[str, Any]:
    """Values in the middle of those parameters that one grid serves all values of."""
    return {axis.name: float(axis.at(0.5)) for axis in (plane.x, plane.y) if PARAMETERS[axis.name].of_base}


@lru_cache(maxsize=4)
def _grid(plane: ParameterPlane, slope: float, restitution: float, registered: Law) -> tuple[TrajectoryGrid, Array]:
    """The grid of trajectories of all points of ``plane`` with one slope and restitution, and its extremes."""
    del registered  # known here to tell what is remembered of one law from that of another
    chute = replace(plane.chute, slope=slope, restitution=restitution, **_neutral(plane))
    served = [chute]
    for axis in (plane.x, plane.y):
        if PARAMETERS[axis.name].of_base:
            fractions = np.linspace(0.0, 1.0, _BETWEEN)
            served = [replace(one, **{axis.name: float(axis.at(s))}) for one in served for s in fractions]
    within = plane.within
    temperature = starting_temperatures(within.coldest, within.hottest)
    if plane.temperatures:
        apart = np.abs(np.log(temperature[:, None] / np.array(plane.temperatures))).min(axis=1)
        temperature = np.unique(np.concatenate([temperature[apart > _SAME], plane.temperatures]))
    others = envelope([model(one) for one in served]) if len(served) > 1 else np.empty((ENTRIES, 0))
    grid = integrate_trajectories_from(model(chute), others, temperature, within.deepest)
    return grid, bound_extremes(grid)


@lru_cache(maxsize=64)
def _dilute(closure: Law, e: float, slope: float) -> Dilute:
    return dilute(closure, e, slope)
