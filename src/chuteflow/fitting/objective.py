"""The sum of squares of a fit as a function of all its unknowns, with exact derivatives, and its minimisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from chuteflow.fitting.residuals import MOST_OFFSET, Linear, TrialChute, TrialFlow
from chuteflow.numerics.chebyshev import Array

#: Loss functions of :func:`scipy.optimize.least_squares`, by choice.
LOSSES = ("linear", "soft_l1", "huber", "cauchy")
#: The place on the branch, a sum of logarithms, changes about so much in a step.
_PLACE_SCALE, _BASE_SCALE = 0.3, 0.3
#: A residual beyond this is that of a flow where there is none.
_LARGEST = 1e6
#: A fit is on its way to another where its derivatives put it there with a sum of squares larger by this part, and its
#: flow within this distance in ln Q, ln h, ln M and ln T.
_WORSE, _ELSEWHERE = 0.25, 0.3


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where a minimisation ended: unknowns ``x``, the sum of squares ``chi2``, the residuals (n,), their ``jacobian``
    (n, p) (of their loss), the flow of each experiment, and whether it ``converged``."""

    x: Array
    chi2: float
    residual: Array
    jacobian: Array
    places: tuple[TrialFlow, ...]
    converged: bool


@dataclass(frozen=True, eq=False)
class Objective:
    """Residuals of all ``cases`` as a function of the unknowns x (p,): free parameters, places of flows without an
    exact number, and heights of the bases where they are unknown."""

    cases: tuple[TrialChute, ...]
    base_unknown: bool
    loss: str

    @property
    def parameters(self) -> int:
        """How many parameters of the chute are free."""
        return len(self.cases[0].free)

    @property
    def labelled(self) -> list[int]:
        """The cases whose place on the branch is unknown."""
        return [i for i, case in enumerate(self.cases) if case.exact is None]

    @property
    def unknowns(self) -> int:
        """How many unknowns there are."""
        return self.parameters + len(self.labelled) + len(self.cases) * self.base_unknown

    @property
    def count(self) -> int:
        """How many residuals there are."""
        return sum(case.experiment.count for case in self.cases)

    def label_column(self, case: int) -> int | None:
        """The column of the place of a case."""
        return self.parameters + self.labelled.index(case) if case in self.labelled else None

    def base_column(self, case: int) -> int | None:
        """The column of the height of the base of a case."""
        return self.parameters + len(self.labelled) + case if self.base_unknown else None

    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the unknowns."""
        low, high = np.full(self.unknowns, -np.inf), np.full(self.unknowns, np.inf)
        for j, parameter in enumerate(self.cases[0].free):
            low[j], high[j] = parameter.low, parameter.high
        if self.base_unknown:
            low[-len(self.cases) :], high[-len(self.cases) :] = -MOST_OFFSET, MOST_OFFSET
        return low, high

    def scale(self) -> Array:
        """The size of changes of the unknowns that matter."""
        widths = [parameter.likely[1] - parameter.likely[0] for parameter in self.cases[0].free]
        bases = [_BASE_SCALE] * (len(self.cases) * self.base_unknown)
        return np.array([*widths, *[_PLACE_SCALE] * len(self.labelled), *bases])

    def start(self, places: Sequence[TrialFlow]) -> Array:
        """The unknowns at which the flows are these."""
        x = np.zeros(self.unknowns)
        x[: self.parameters] = places[0].values
        for i in self.labelled:
            x[self.label_column(i)] = places[i].label
        return x

    def minimise(
        self,
        x: Array,
        places: Sequence[TrialFlow],
        *,
        most: int,
        fixed: int | None = None,
        tolerance: float = 1e-9,
        known: Sequence[Minimum] = (),
    ) -> Minimum | None:
        """The least sum of squares near ``x``, with the unknown number ``fixed`` kept, by ``most`` evaluations; None
        where the flows at ``x`` cannot be reached from ``places``, or as soon as it is on its way to a minimum that is
        ``known``."""
        from scipy.optimize import least_squares

        moving = [j for j in range(self.unknowns) if j != fixed]
        run = _Minimisation(self, tuple(places), x.copy(), moving, tuple(known))
        low, high = self.bounds()
        x[moving] = np.clip(x[moving], low[moving], high[moving])
        first = run.residual(x[moving])
        if not np.isfinite(first).all():
            return None
        if not moving:
            return Minimum(x, float(first @ first), first, np.empty((len(first), 0)), run.places, True)
        # Flows far from the measurements have derivatives that no longer mean anything.
        try:
            with np.errstate(all="ignore"):
                found: Any = least_squares(
                    run.residual, x[moving], run.jacobian, bounds=(low[moving], high[moving]), method="dogbox",
                    x_scale=self.scale()[moving], loss=cast(Any, self.loss), max_nfev=most,
                    ftol=tolerance, xtol=tolerance, gtol=1e-12,
                )  # fmt: skip
        except _OnTheWayError:
            return None
        whole = x.copy()
        whole[moving] = found.x
        residual = run.residual(found.x)
        jacobian = np.zeros((len(first), self.unknowns))
        jacobian[:, moving] = found.jac
        converged = found.status > 0
        return Minimum(whole, 2.0 * float(found.cost), residual, jacobian, run.accepted(found.x), converged)

    def leads_to(self, one: Minimum, best: Minimum) -> bool:
        """Whether a fit that has not ended is on its way to ``best``: by its derivatives, that is where its flows go
        and how well they fit there."""
        predicted = one.residual + one.jacobian @ (best.x - one.x)
        if float(predicted @ predicted) > best.chi2 + _WORSE * (best.chi2 + self.count):
            return False
        for i, (place, there) in enumerate(zip(one.places, best.places, strict=True)):
            column = self.label_column(i)
            label = place.label if column is None else float(best.x[column])
            if column is not None and place.weights != there.weights:
                label = float(np.array(place.weights) @ there.flow.solution.macroscopic)
            off = place.estimate_place(best.x[: self.parameters], label) - there.flow.solution.macroscopic
            if float(np.abs(off).max()) > _ELSEWHERE:
                return False
        return True


class _OnTheWayError(Exception):
    """A minimisation is on its way to a minimum that is known."""


@dataclass(eq=False)
class _Minimisation:
    """One minimisation: where the flows were last accepted, and where they were tried; what is ``known`` ends it."""

    objective: Objective
    places: tuple[TrialFlow, ...]
    x: Array
    moving: list[int]
    known: tuple[Minimum, ...] = ()
    _tried: tuple[Array, tuple[TrialFlow, ...]] | None = None

    def residual(self, part: Array) -> Array:
        """All residuals (n,); infinite where a flow is not found."""
        places = self.accepted(part)
        if not places:
            return np.full(self.objective.count, np.inf)
        parts = []
        for i, (case, place) in enumerate(zip(self.objective.cases, places, strict=True)):
            parts.append(case.residual(place.flow, self._base(i)))
        found = np.concatenate(parts)
        return np.where(np.abs(found) < _LARGEST, found, np.inf)

    def jacobian(self, part: Array) -> Array:
        """Their derivatives (n, moving unknowns); the flows are followed from here on."""
        self.places = self.accepted(part)
        objective = self.objective
        out = np.zeros((objective.count, objective.unknowns))
        row = 0
        for i, (case, place) in enumerate(zip(objective.cases, self.places, strict=True)):
            linear: Linear = case.linear(place, self._base(i))
            rows = slice(row, row + len(linear.residual))
            out[rows, : objective.parameters] = linear.by_parameters
            for column, values in (
                (objective.label_column(i), linear.by_place),
                (objective.base_column(i), linear.by_base),
            ):
                if column is not None:
                    out[rows, column] = values
            row = rows.stop
        out = np.where(np.isfinite(out), out, 0.0)
        if self.known:
            residual = self.residual(part)
            here = Minimum(self.x.copy(), float(residual @ residual), residual, out, self.places, False)
            if any(objective.leads_to(here, other) for other in self.known):
                raise _OnTheWayError
        return out[:, self.moving]

    def accepted(self, part: Array) -> tuple[TrialFlow, ...]:
        """The flows at these unknowns, followed from where they were accepted; none where one is not found."""
        self.x[self.moving] = part
        if self._tried is not None and np.array_equal(self._tried[0], part):
            return self._tried[1]
        found: list[TrialFlow] = []
        values = self.x[: self.objective.parameters].copy()
        for i, (case, place) in enumerate(zip(self.objective.cases, self.places, strict=True)):
            column = self.objective.label_column(i)
            label = place.label if column is None else float(self.x[column])
            if np.array_equal(values, place.values) and label == place.label:
                found.append(place)
                continue
            flow = case.followed(place, values, label)
            if flow is None:
                found = []
                break
            found.append(place.moved(flow, values, label))
        self._tried = part.copy(), tuple(found)
        return tuple(found)

    def _base(self, case: int) -> float:
        column = self.objective.base_column(case)
        return 0.0 if column is None else float(self.x[column])
