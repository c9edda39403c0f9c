"""How a flow answers to small changes of its parameters: exact derivatives by the implicit function theorem.

# notation: z unknowns of a flow (n+3,), F(z, lambda) = 0 (n+2,) the discretised steady problem, m(z, lambda) = (ln Q,
# ln h, ln M, ln T_surface), t unit tangent of the branch in the space of m, P/M fraction of the overburden.

The flows of one chute are a branch. Beside a flow, F_z dz + F_lambda dlambda = 0 has one solution along the branch, and
one for each parameter, once that is made unique. It is taken across the branch, t . dm = 0: this is finite everywhere,
also where a quantity turns. At a fixed quantity c,

    dm/dlambda = across - t across_c / t_c

which is infinite where t_c = 0, at a fold of c. What follows from the flow, such as a profile, is differentiated along
each of these directions by a step along the imaginary axis through the code that computes it
(:mod:`chuteflow.numerics.complex_step`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chuteflow import display
from chuteflow.checks import real_array
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array, interpolation_matrix
from chuteflow.numerics.complex_step import derivative, stepped
from chuteflow.parameters import CONDITIONS
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T, stretch_position
from chuteflow.steady.flow import Flow
from chuteflow.steady.free import FreeParameter, all_free, free_parameter
from chuteflow.steady.linearised import rates_along_branch, solve_bordered
from chuteflow.steady.model import Model, step_model
from chuteflow.steady.quantities import FIELDS, NUMBERS
from chuteflow.steady.solver import Solution
from chuteflow.threads import on_one_thread

#: A quantity turns where its logarithm changes by less than this per arclength of the branch.
_TURNS = 1e-6
#: The place of the largest density is found by secants, the first one to a place so far aside.
_SECANTS, _ASIDE = 3, 1e-3
#: Positions of the conditions in m.
WHICH = {"Q": LOG_Q, "h": LOG_H, "M": LOG_M, "T_surface": LOG_T}
#: What profiles are differentiated at: a fixed height above the base, or a fixed fraction of the mass above.
COORDINATES = ("height", "overburden")


class _PerturbedFlow(Flow):
    """A flow an imaginary step along a direction of its unknowns and parameters."""

    @classmethod
    def along(cls, start: Flow, beyond: Model, direction: Array) -> _PerturbedFlow:
        """``start`` with the problem ``beyond`` and its unknowns a step along ``direction``."""
        problem = replace(start.solution.problem, model=beyond)
        z: Any = stepped(start.solution.z, direction)
        macroscopic = problem.state(z).macroscopic()
        return cls(start.chute, Solution(macroscopic, start.error, start.solution.status, (problem, z)))

    @cached_property
    def place(self) -> Array:
        """Derivatives of ln Q, ln h, ln M and ln T_surface (4,)."""
        return derivative(self.solution.macroscopic)

    def fields(self, fraction: Array) -> dict[str, Array]:
        """Derivatives of the height and of all fields at fractions (m,)."""
        rates = {name: derivative(values) for name, values in self._fields(fraction).items()}
        return {"height": derivative(self._heights(fraction)), **rates}

    def numbers(self, start: _ReferenceFlow) -> dict[str, float]:
        """Derivatives of the numbers of the registry."""
        flow = start.flow
        log_q, log_h, log_m, log_t = self.place.tolist()
        largest = float(derivative(self._at_share(start.densest)[0]["nu"][0]))
        depth, above = self._depth(start, largest / flow.largest_volume_fraction)
        found = {
            "mass_flux": flow.mass_flux * log_q,
            "centre_of_mass": flow.centre_of_mass * log_h,
            "mass_holdup": flow.mass_holdup * log_m,
            "surface_temperature": flow.surface_temperature * log_t,
            "base_temperature": flow.base_temperature * float(derivative(self._state.log_t[-1])),
            "base_volume_fraction": float(derivative(self._at_share(np.ones(1))[0]["nu"][0])),
            "largest_volume_fraction": largest,
            "slip_velocity": float(derivative(self._slip)),
            "depth": depth,
            "interface_height": float(derivative(self._heights(np.zeros(1))[0])) if start.bounded else np.nan,
            "mean_velocity": flow.mass_flux / flow.mass_holdup * (log_q - log_m),
            "surface_velocity": float(derivative(self._velocities(np.zeros(1))[0])),
            "mean_volume_fraction": (
                (flow.mass_holdup * log_m * (1.0 - start.above) - flow.mass_holdup * above) / flow.depth
                - flow.mass_holdup * (1.0 - start.above) * depth / flow.depth**2
            ),
            "froude_number": (
                flow.mass_flux / flow.mass_holdup / np.sqrt(flow.depth) * (log_q - log_m - 0.5 * depth / flow.depth)
            ),
        }
        found["angle"] = float(derivative(np.arctan(np.complex128(self._model.slope)))) * 180.0 / np.pi
        return {name: float(found[name]) for name in NUMBERS}

    def _depth(self, start: _ReferenceFlow, log_largest: float) -> tuple[float, float]:
        """Derivatives of the depth, and of the fraction of the mass above it."""
        fraction = np.array([start.above])
        height = float(derivative(self._heights(fraction)[0]))
        if start.above == 0.0:
            return height, 0.0
        moved = float(derivative(np.log(self._at_share(fraction)[0]["nu"][0])))
        log_slope = float(start.steepness(fraction)["volume_fraction"][0]) / float(
            start.fields(fraction)["volume_fraction"][0]
        )
        above = (log_largest - moved) / log_slope
        return height + float(start.steepness(fraction)["height"][0]) * above, above


@dataclass(frozen=True, eq=False)
class _ReferenceFlow:
    """The flow itself, and how it changes with the fraction of the overburden."""

    flow: Flow

    @property
    def bounded(self) -> bool:
        """Whether it has an interface."""
        return self.flow.chute.surface == "interface"

    @property
    def above(self) -> float:
        """Fraction of the mass above the depth."""
        return self.flow._share_above_depth

    @cached_property
    def densest(self) -> Array:
        """Fraction of the mass above the largest volume fraction (1,), to all digits.

        The density is flat there, and what it answers to a parameter is not.
        """
        fraction = self.flow._share_of_largest
        if not 0.0 < fraction[0] < 1.0:
            return fraction
        places = [float(fraction[0]) * (1.0 - _ASIDE), float(fraction[0])]
        values = [self._rise(place) for place in places]
        for _ in range(_SECANTS):
            if values[1] == values[0]:
                break
            place = places[1] - values[1] * (places[1] - places[0]) / (values[1] - values[0])
            if not 0.0 < place < 1.0:
                return fraction
            places, values = [places[1], place], [values[1], self._rise(place)]
        return np.array([places[1]])

    def _rise(self, place: float) -> float:
        """d ln nu/d ln p but for its sign and a positive factor."""
        return float(self.flow._at_share(np.array([place]))[0]["rise"][0]) - 1.0

    def fields(self, fraction: Array) -> dict[str, Array]:
        """All fields at fractions (m,)."""
        return self.flow._fields(fraction)

    def shares_at(self, z: Array) -> Array:
        """Shares (m,) at heights."""
        return self.flow._shares_at(z)

    def steepness(self, fraction: Array) -> dict[str, Array]:
        """Derivatives of the height and of all fields with respect to the fraction, at fractions (m,)."""
        flow = self.flow
        state, problem = flow._state, flow.solution.problem
        matrix = interpolation_matrix(problem.grid, stretch_position(fraction, problem.stretch))
        theta, g = matrix @ state.theta, matrix @ state.g
        bend = matrix @ (problem.grid.derivative @ state.g / problem.fraction[1])
        mass = state.mass[0]
        p = mass * fraction + flow._model.surface_stress
        local = flow._local(*flow._pointwise(stepped(p, mass), stepped(theta, g), stepped(g, bend)))
        height_slope = -mass / np.real(local["volume_fraction"])  # dz/dshare
        rates = {name: derivative(values) for name, values in local.items()}
        return rates | {"height": height_slope, "velocity": np.real(local["shear_rate"]) * height_slope}


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of a ``flow`` with respect to ``parameters`` (k) of its chute at the fixed quantity ``at``.

    ``tangent`` (4,) is that of the branch, the derivatives of ln Q, ln h, ln M and ln T_surface along its arclength;
    ``across`` (4, k) their derivatives with respect to each parameter normal to it, which are finite at folds too.
    """

    flow: Flow
    parameters: tuple[FreeParameter, ...]
    at: str
    tangent: Array
    across: Array
    _moved: tuple[_PerturbedFlow, ...]

    def __repr__(self) -> str:
        said = ", ".join(self.keys)
        return display.line("Sensitivity", f"{len(NUMBERS)} quantities to {said} at fixed {self.at}", self.at_fold)

    @property
    def keys(self) -> tuple[str, ...]:
        """What the parameters are called."""
        return tuple(parameter.key for parameter in self.parameters)

    @property
    def values(self) -> Array:
        """The parameters (k,)."""
        return np.array([parameter.of(self.flow.chute) for parameter in self.parameters])

    @property
    def at_fold(self) -> str | None:
        """One sentence where the fixed quantity turns along the branch, so that derivatives at it are infinite."""
        if abs(self.tangent[WHICH[self.at]]) >= _TURNS:
            return None
        return (
            f"the flow is at a fold of {self.at}: derivatives at fixed {self.at} are infinite; those along the branch, "
            "and at another fixed quantity, are finite"
        )

    def held(self, at: str) -> Sensitivity:
        """The same at another fixed quantity, one of Q, M, h and T_surface.

        Raises:
            InputError: for another.
        """
        return replace(self, at=_condition(at))

    @cached_property
    def numbers(self) -> dict[str, Array]:
        """Derivatives (k,) of every number of the registry at the fixed quantity; infinite at its fold, NaN for the
        height of an interface that is not there."""
        along, across = self.numbers_along
        found = {name: self._combine(along[name], across[name]) for name in NUMBERS}
        return found | {CONDITIONS[self.at].quantity: np.zeros(len(self.parameters))}

    @cached_property
    def numbers_along(self) -> tuple[dict[str, float], dict[str, Array]]:
        """Derivatives of every number of the registry with respect to arclength along the branch, and with respect to
        each parameter (k,) across it: finite at folds."""
        start = _ReferenceFlow(self.flow)
        with np.errstate(under="ignore"):
            along, *across = (moved.numbers(start) for moved in self._moved)
        return along, {name: np.array([one[name] for one in across]) for name in NUMBERS}

    @property
    def logarithmic(self) -> dict[str, Array]:
        """Derivatives (k,) of the logarithms of every number."""
        return {name: values / getattr(self.flow, name) for name, values in self.numbers.items()}

    def ranked(self, name: str) -> list[tuple[str, float]]:
        """The parameters by how much ``name`` changes where they change by 1 %, the largest first: (key, d ln name/d ln
        parameter).

        Raises:
            InputError: for an unknown quantity.
        """
        if name not in NUMBERS:
            raise InputError(f"unknown quantity {name!r}: choose one of {', '.join(NUMBERS)}")
        elasticity = self.logarithmic[name] * self.values
        pairs = list(zip(self.keys, elasticity.tolist(), strict=True))
        return sorted(pairs, key=lambda pair: -abs(pair[1]))

    def profile(self, z: ArrayLike, coordinate: str = "height") -> dict[str, Array]:
        """Derivatives (k, m) of all fields of the registry at the fixed quantity.

        Args:
            z: heights above the base (m,); with the coordinate "overburden" fractions of the mass above, up to 1.
            coordinate: what stays fixed at each point: "height", or "overburden", where the height itself changes.

        Raises:
            InputError: for heights that are not in the flow, or an unknown coordinate.
        """
        along, across = self.profile_along(z, coordinate)
        count = len(self.parameters)
        return {
            name: np.stack([self._combine(along[name], across[name][j], j) for j in range(count)])
            if count
            else np.empty((0, len(along[name])))
            for name in FIELDS
        }

    def profile_along(self, z: ArrayLike, coordinate: str = "height") -> tuple[dict[str, Array], dict[str, Array]]:
        """Derivatives of all fields with respect to arclength along the branch (m,), and with respect to each parameter
        across it (k, m); as :meth:`profile`, and finite at folds.

        Raises:
            InputError: as :meth:`profile`.
        """
        if coordinate not in COORDINATES:
            raise InputError(f"coordinate {coordinate!r}: choose one of {', '.join(COORDINATES)}")
        at = real_array("z", z).ravel()
        by_height = coordinate == "height"
        self.flow.profile(at) if by_height else self.flow.at_overburden(at)  # raise where there is no flow
        start = _ReferenceFlow(self.flow)
        with np.errstate(under="ignore"):
            fraction = start.shares_at(at) if by_height else at
            found = [moved.fields(fraction) for moved in self._moved]
            if by_height:
                found = [_at_height(rates, start.steepness(fraction)) for rates in found]
        along, *across = found
        stacked = {name: np.array([rates[name] for rates in across]).reshape(-1, len(at)) for name in FIELDS}
        return along, stacked

    def path(self, parameter: str) -> dict[str, float]:
        """The flows at the fixed quantity as ``parameter`` varies are a curve too, through folds: its unit tangent in
        the space of ln Q, ln h, ln M, ln T_surface and the parameter, which does not fall along it.

        Raises:
            InputError: for a parameter that is not among those of the sensitivity.
        """
        key = free_parameter(self.flow.chute, parameter).key
        if key not in self.keys:
            raise InputError(f"parameter {parameter!r}: choose from {', '.join(self.keys)}")
        j, c = self.keys.index(key), WHICH[self.at]
        by_parameter, by_arc = float(self.tangent[c]), -float(self.across[c, j])
        moved = self.across[:, j] * by_parameter + self.tangent * by_arc
        length = float(np.hypot(np.linalg.norm(moved), by_parameter)) * (-1.0 if by_parameter < 0.0 else 1.0)
        names = (f"ln {name}" for name in WHICH)
        return dict(zip(names, (moved[list(WHICH.values())] / length).tolist(), strict=True)) | {
            key: by_parameter / length
        }

    def _combine(self, along: Any, across: Any, j: int | slice = slice(None)) -> Array:
        """Derivatives at the fixed quantity of what changes ``along`` the branch and ``across`` it."""
        c = WHICH[self.at]
        if self.at_fold:
            return np.where(np.isnan(across), np.nan, np.inf)
        return np.asarray(across - along * self.across[c, j] / self.tangent[c])


def _at_height(rates: dict[str, Array], steep: dict[str, Array]) -> dict[str, Array]:
    """Derivatives at fixed heights of what has ``rates`` at fixed fractions: a height keeps its place as the fraction
    there changes."""
    fraction = -rates["height"] / steep["height"]
    return {
        name: rates[name] + steep[name] * fraction if name != "height" else np.zeros_like(fraction) for name in FIELDS
    }


def slopes_in_height(flow: Flow, z: Array) -> dict[str, Array]:
    """Derivatives of all fields of ``flow`` with respect to height, at heights ``z`` (m,) that are in the flow."""
    start = _ReferenceFlow(flow)
    with np.errstate(under="ignore"):
        steep = start.steepness(start.shares_at(z))
    return {name: values / steep["height"] for name, values in steep.items()}


@on_one_thread
def sensitivity(flow: Flow, parameters: Sequence[str | FreeParameter] | None = None, *, at: str = "Q") -> Sensitivity:
    """Exact derivatives of ``flow`` with respect to ``parameters`` of its chute, all that can be varied by default.

    Args:
        flow: a solved flow.
        parameters: by the names of :mod:`chuteflow.steady.free`, such as slope, e, ew, roughness, closure.packing.
        at: what is kept while a parameter changes: Q, M, h or T_surface.

    Raises:
        InputError: for an unknown name, or a flow whose law is not registered.
    """
    chute = flow.chute
    asked = all_free(chute) if parameters is None else parameters
    free = tuple(one if isinstance(one, FreeParameter) else free_parameter(chute, one) for one in asked)
    condition = _condition(at)
    problem, z, state = flow.solution.problem, flow.solution.z, flow.solution.state
    gradient = state.macroscopic_gradient()
    weights = _transversal(flow, gradient)
    beyond = [step_model(chute, parameter.model_name) for parameter in free]
    states = [replace(problem, model=one).state(z) for one in beyond]
    sides = np.zeros((len(z), 1 + len(free)))
    sides[-1, 0] = 1.0
    for j, one in enumerate(states):
        sides[:-1, 1 + j] = -derivative(one.residual())
        sides[-1, 1 + j] = -weights @ derivative(one.macroscopic())
    found = solve_bordered(state, weights @ gradient, sides)
    length = float(np.linalg.norm(gradient @ found[:, 0]))
    ahead: Array = found[:, 0] / length
    tangent = gradient @ ahead
    across = np.empty((4, len(free)))
    moved = [_PerturbedFlow.along(flow, problem.model, ahead)]
    for j, one in enumerate(beyond):
        rate = derivative(states[j].macroscopic()) + gradient @ found[:, 1 + j]
        direction: Array = found[:, 1 + j] - ahead * float(tangent @ rate)
        moved.append(_PerturbedFlow.along(flow, one, direction))
        across[:, j] = moved[-1].place
    return Sensitivity(flow, free, condition, tangent, across, tuple(moved))


def _transversal(flow: Flow, gradient: Array) -> Array:
    """Weights (4,) of the quantities such that their sum changes along the branch."""
    rates = flow.solution.rates
    if rates is None:  # a flow that was loaded
        rates = rates_along_branch(flow.solution.state, gradient)
    return rates / np.linalg.norm(rates)


def _condition(at: str) -> str:
    if at not in CONDITIONS:
        raise InputError(f"fixed quantity {at!r}: choose one of {', '.join(CONDITIONS)}")
    return at
