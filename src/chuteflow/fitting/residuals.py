"""What a flow says to measurements: residuals, with exact derivatives, as parameters and flow move together.

# notation: x unknowns of a fit: free parameters of the chute (k), for each experiment without an exact number the place
# of its flow on the branch, and for each, where asked, the height of its base; m = (ln Q, ln h, ln M, ln T_surface).

A flow is followed from one set of parameters to the next. Where a number is known exactly, it picks the flow; else its
place on the branch is an unknown of its own, w . m with fixed weights w along the tangent of the branch where the fit
began, so that a fold of Q or M between the start and the end does no harm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from chuteflow.branches.enumeration import flows
from chuteflow.errors import InputError
from chuteflow.fitting.measurements import Experiment, Scalar, Series
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import BY_KEY
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.free import FreeParameter, vary
from chuteflow.steady.model import Model, model, model_along
from chuteflow.steady.sensitivity import WHICH, Sensitivity, sensitivity, slopes_in_height
from chuteflow.steady.solver import Condition, resolve

#: Relative errors of flows in a fit, and of those that it may start from.
_TOLERANCE, _ROUGH = 1e-9, 1e-6
#: A step of the parameters is halved so often until the flow is found at its end.
_HALVINGS = 4
#: A flow is taken for the one before where it has moved by no more than this beyond twice what was expected.
_STRAYED = 0.1
#: Hold-ups at which flows are searched for where no measurement tells one.
_HOLDUPS = (0.3, 0.6, 1.2, 2.5, 5.0)
#: A base is searched for within this many diameters of where the heights put it.
MOST_OFFSET = 3.0


@dataclass(frozen=True, eq=False)
class Linear:
    """Residuals (n,) of an experiment, and their derivatives with respect to the free parameters (n, k), to the place
    on the branch (n,), and to the height of the base (n,)."""

    residual: Array
    by_parameters: Array
    by_place: Array
    by_base: Array


@dataclass(frozen=True, eq=False)
class TrialChute:
    """An experiment on its chute, of which some parameters are ``free``."""

    experiment: Experiment
    chute: Chute
    free: tuple[FreeParameter, ...]

    @classmethod
    def of(cls, experiment: Experiment, chute: Chute, free: Sequence[FreeParameter]) -> TrialChute:
        """The case of an experiment; what is known of its own chute replaces what is said for all.

        Raises:
            InputError: for a parameter that is free and known.
        """
        for key in experiment.given:
            if any(parameter.key == key for parameter in free):
                raise InputError(f"{key} is free, and experiment {experiment.name} gives it: leave one of them out")
        own = {BY_KEY[key].name: value for key, value in experiment.given.items()}
        return cls(experiment, replace(chute, **own), tuple(free))

    def relaxed(self, error: float) -> TrialChute:
        """The same with the number that is known exactly known to a relative ``error``."""
        experiment = self.experiment
        more = tuple(Scalar(key, value, error, True) for key, value in experiment.exact.items())
        return replace(self, experiment=replace(experiment, scalars=(*more, *experiment.scalars), exact={}))

    @cached_property
    def exact(self) -> Condition | None:
        """The condition that picks the flow, where a number is known exactly."""
        for key, value in self.experiment.exact.items():
            return Condition.fix(WHICH[key], value)
        return None

    @cached_property
    def _by_heights(self) -> list[tuple[Array, list[Series]]]:
        """The profiles, those together that follow one another at the same heights."""
        found: list[tuple[Array, list[Series]]] = []
        for series in self.experiment.profiles:
            if found and np.array_equal(found[-1][0], series.height):
                found[-1][1].append(series)
            else:
                found.append((series.height, [series]))
        return found

    def at(self, values: Array) -> Chute:
        """Its chute with other values of the free parameters.

        Raises:
            InputError: for values out of range.
        """
        return vary(self.chute, self.free, values.tolist())

    def candidates(self, values: Array) -> list[Flow]:
        """All flows that could be meant where the free parameters have these values."""
        try:
            chute = self.at(values)
            return [flow for asked in self._asked for flow in flows(chute, tolerance=_ROUGH, **cast(Any, asked))]
        except InputError:
            return []

    @cached_property
    def _asked(self) -> list[dict[str, float]]:
        """What flows are searched for by: an exact number, else a measured one, else hold-ups."""
        experiment = self.experiment
        if experiment.exact:
            return [dict(experiment.exact)]
        measured = {scalar.symbol: scalar.value for scalar in experiment.scalars}
        for key in ("Q", "M", "h", "T_surface"):
            if key in measured:
                return [{key: measured[key]}]
        nu = experiment.profile("nu")
        if nu is not None:
            within = float(np.sum(0.5 * np.diff(nu.height) * (nu.value[1:] + nu.value[:-1])))
            return [{"M": within + float(nu.value[0] * max(nu.height[0], 0.0))}]
        return [{"M": holdup} for holdup in _HOLDUPS]

    def followed(self, start: TrialFlow, values: Array, label: float) -> Flow | None:
        """The flow at other values of the free parameters and another place on the branch, or None where there is none
        nearby."""
        return self._follow(start, values, label, _HALVINGS)

    def _follow(self, start: TrialFlow, values: Array, label: float, halvings: int) -> Flow | None:
        try:
            chute = self.at(values)
            problem = self._model(chute)
        except InputError:
            return None
        condition = self.exact or Condition(start.weights, label)
        with np.errstate(all="ignore"):
            solution = resolve(start.flow.solution, condition, _TOLERANCE, problem)
        if solution.converged:
            moved = np.linalg.norm(solution.macroscopic - start.flow.solution.macroscopic)
            if moved <= 2.0 * start.expected(values, label) + _STRAYED:
                return Flow(chute, solution)
        if halvings == 0:
            return None
        middle, between = 0.5 * (start.values + values), 0.5 * (start.label + label)
        half = self._follow(start, middle, between, halvings - 1)
        if half is None:
            return None
        return self._follow(TrialFlow(half, middle, start.weights, between), values, label, halvings - 1)

    def _model(self, chute: Chute) -> Model:
        """The model of a chute, in a way that leaves the tables of its derivatives at hand: they are asked for next."""
        for parameter in self.free:
            if parameter.model_name == "restitution" or (parameter.model_name == "slope" and chute.law.knows_slope):
                return model_along(chute, parameter.model_name, parameter.of(chute))[0]
        return model(chute)

    def residual(self, flow: Flow, base: float = 0.0) -> Array:
        """Measured against computed: (computed - measured)/error, of the logarithms where errors are relative.

        ``base`` is the height of the base where the heights of the measurements begin.
        """
        parts = []
        for z, group in self._by_heights:
            at = z - base
            inside = _inside(flow, at)
            profile = flow.profile(inside)
            steep = slopes_in_height(flow, inside) if np.any(at != inside) else None
            for series in group:
                computed = getattr(profile, series.field)
                if steep is not None:
                    computed = computed + steep[series.field] * (at - inside)
                parts.append(_residual(computed, series.value, series.error, series.relative))
        for scalar in self.experiment.scalars:
            computed = np.array([getattr(flow, scalar.name)])
            parts.append(_residual(computed, np.array([scalar.value]), np.array([scalar.error]), scalar.relative))
        return np.concatenate([np.empty(0), *parts])

    def linear(self, place: TrialFlow, base: float = 0.0) -> Linear:
        """The residual and its derivatives at the flow of ``place``."""
        answer = place.answer
        parts, by_parameters, by_place, by_base = [], [], [], []
        for z, group in self._by_heights:
            at = z - base
            inside = _inside(place.flow, at)
            steep = slopes_in_height(place.flow, inside)
            along, across = answer.profile_along(inside)
            profile = place.flow.profile(inside)
            for series in group:
                computed = getattr(profile, series.field) + steep[series.field] * (at - inside)
                scale = 1.0 / (series.error * (computed if series.relative else 1.0))
                parts.append(_residual(computed, series.value, series.error, series.relative))
                to_parameters, to_place = place.held(along[series.field], across[series.field])
                by_parameters.append((to_parameters * scale).T)
                by_place.append(to_place * scale)
                by_base.append(-steep[series.field] * scale)
        along_all, across_all = answer.numbers_along if self.experiment.scalars else ({}, {})
        for scalar in self.experiment.scalars:
            computed = np.array([getattr(place.flow, scalar.name)])
            scale = 1.0 / (scalar.error * (computed if scalar.relative else 1.0))
            parts.append(_residual(computed, np.array([scalar.value]), np.array([scalar.error]), scalar.relative))
            along = np.array([along_all[scalar.name]])
            to_parameters, to_place = place.held(along, across_all[scalar.name][:, None])
            by_parameters.append((to_parameters * scale).T)
            by_place.append(to_place * scale)
            by_base.append(np.zeros(1))
        return Linear(
            np.concatenate([np.empty(0), *parts]),
            np.concatenate([np.empty((0, len(self.free))), *by_parameters]),
            np.concatenate([np.empty(0), *by_place]),
            np.concatenate([np.empty(0), *by_base]),
        )


@dataclass(frozen=True, eq=False)
class TrialFlow:
    """The flow of an experiment at ``values`` of the free parameters; ``label`` = weights . m is its place on the
    branch, which a free one keeps by its ``weights``."""

    flow: Flow
    values: Array
    weights: tuple[float, float, float, float]
    label: float
    free: tuple[FreeParameter, ...] = ()

    @classmethod
    def of(cls, case: TrialChute, flow: Flow, values: Array) -> TrialFlow:
        """The place of a flow that was found, with weights along its branch, or those of the exact number."""
        if case.exact is not None:
            return cls(flow, values, case.exact.weights, case.exact.value, case.free)
        rates = flow.solution.rates
        tangent = sensitivity(flow, ()).tangent if rates is None else rates / np.linalg.norm(rates)
        a, b, c, d = tangent.tolist()
        return cls(flow, values, (a, b, c, d), float(tangent @ flow.solution.macroscopic), case.free)

    def moved(self, flow: Flow, values: Array, label: float) -> TrialFlow:
        """The place of the flow that was followed from here."""
        return replace(self, flow=flow, values=values, label=label)

    @cached_property
    def answer(self) -> Sensitivity:
        """Its derivatives."""
        return sensitivity(self.flow, self.free)

    def held(self, along: Array, across: Array) -> tuple[Array, Array]:
        """Derivatives with respect to the parameters (k, m) at a fixed label, and to the label (m,), of what changes
        ``along`` the branch (m,) and ``across`` it (k, m)."""
        weights = np.array(self.weights)
        label_rate = float(weights @ self.answer.tangent)
        return across - (weights @ self.answer.across)[:, None] * along / label_rate, along / label_rate

    def expected(self, values: Array, label: float) -> float:
        """How far the flow moves in m, as far as is known."""
        if "answer" not in self.__dict__:
            return 0.5
        return float(np.linalg.norm(self.estimate_place(values, label) - self.flow.solution.macroscopic))

    def estimate_place(self, values: Array, label: float) -> Array:
        """ln Q, ln h, ln M and ln T_surface (4,) at other values and another label, by the derivatives here."""
        by_parameters, by_label = self.held(self.answer.tangent, self.answer.across.T)
        moved = (values - self.values) @ by_parameters + by_label * (label - self.label)
        return self.flow.solution.macroscopic + moved


def _inside(flow: Flow, z: Array) -> Array:
    """The heights that are nearest to ``z`` in the flow."""
    return np.clip(z, 0.0, flow.interface_height)


def _residual(computed: Array, value: Array, error: Array, relative: bool) -> Array:
    if relative:
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.log(computed / value) / error
    return (computed - value) / error
