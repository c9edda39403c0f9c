"""Predictions with uncertainty from calibrated parameters, by exact derivatives: flows, profiles, curves and folds.

# notation: C covariance of the parameters, m = (ln Q, ln h, ln M, ln T_surface), t unit tangent of a branch.

A curve moves normal to itself: its band is finite at folds, where flows at a fixed flux have infinite derivatives. The
flux of a fold itself changes by what the flow there changes across the branch, since along it ln Q is stationary.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from chuteflow import display
from chuteflow.branches.curve import curve
from chuteflow.branches.enumeration import flows
from chuteflow.branches.results import Curve, FlowSet
from chuteflow.checks import number
from chuteflow.fitting.calibration import CONFIDENCE, Calibration
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import FIELDS
from chuteflow.steady.sensitivity import Sensitivity, sensitivity

#: What turns at each kind of fold, and what it is called.
_TURNING = {"fold-Q": (LOG_Q, "Q"), "fold-M": (LOG_M, "M"), "fold-T": (LOG_T, "T_surface")}
#: Heights of profiles.
_HEIGHTS = 121
#: Points of the curve, through which bands are drawn.
_POINTS = 200


@dataclass(frozen=True, eq=False)
class PredictedFlow:
    """A flow with the standard errors of its ``numbers``, by name, infinite at a fold; ``profiles`` holds a height (m,)
    and, by name, each field with its standard error there, (2, m)."""

    flow: Flow
    numbers: dict[str, tuple[float, float]]
    height: Array
    profiles: dict[str, Array]


@dataclass(frozen=True, eq=False)
class Band:
    """A branch in the plane of ln Q and ln h: points (m, 2), unit normals (m, 2), standard errors along them (m,)."""

    points: Array
    normals: Array
    errors: Array

    def edge(self, widths: float) -> Array:
        """Q and h (m, 2) at so many standard errors to one side, or where negative to the other."""
        return np.exp(self.points + widths * self.errors[:, None] * self.normals)


@dataclass(frozen=True, eq=False)
class PredictedFold:
    """A fold: its kind, its flow, and the standard error of the logarithm of the quantity that turns there."""

    kind: str
    flow: Flow
    error: float

    @property
    def value(self) -> float:
        """Q, M or T_surface at the fold."""
        return float(np.exp(self.flow.solution.macroscopic[_TURNING[self.kind][0]]))

    @property
    def turns(self) -> str:
        """What turns there: Q, M or T_surface."""
        return _TURNING[self.kind][1]


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a calibration says of a chute: its flows with errors; its curve with bands and folds, where requested.

    ``widths`` standard errors are the requested confidence. ``warnings`` are sentences.
    """

    calibration: Calibration
    flow_set: FlowSet
    flows: tuple[PredictedFlow, ...]
    asked: tuple[str, float]
    confidence: float

    def __repr__(self) -> str:
        return display.line("Prediction", display.count_of(len(self.flows), "flow"), self.flow_set.reason)

    @property
    def widths(self) -> float:
        """Standard errors of the normal distribution that the confidence is."""
        from scipy.special import ndtri

        return float(ndtri(0.5 * (1.0 + self.confidence)))

    @cached_property
    def curve(self) -> Curve:
        """The branches of flows."""
        return curve(self.calibration.chute, points=_POINTS)

    @cached_property
    def bands(self) -> tuple[Band, ...]:
        """A band for each branch of the curve."""
        return tuple(_band(branch.flows, self.calibration) for branch in self.curve.branches)

    @cached_property
    def folds(self) -> tuple[PredictedFold, ...]:
        """The folds of the curve with their errors."""
        found = []
        for branch in self.curve.branches:
            for point in branch.special:
                if point.kind in _TURNING:
                    across = sensitivity(point.flow, self.calibration.keys).across[_TURNING[point.kind][0]]
                    found.append(PredictedFold(point.kind, point.flow, _error(across, self.calibration.covariance)))
        return tuple(found)

    @cached_property
    def warnings(self) -> list[str]:
        """What to know before believing the bands."""
        said = [
            f"{key} was not determined by the measurements: bands that depend on it mean little"
            for key in self.calibration.undetermined
        ]
        key, value = self.asked
        for fold in self.folds:
            if key == fold.turns:
                off = abs(float(np.log(fold.value / value)))
                if off < self.widths * fold.error:
                    said.append(
                        f"within the errors there may be two flows more or fewer: the fold at {key} = "
                        f"{display.number(fold.value)} is known to {100.0 * self.widths * fold.error:.2g} %"
                    )
        return said


def predict(calibration: Calibration, *, confidence: float = CONFIDENCE, **asked: float) -> Prediction:
    """The flows of a calibrated chute with their errors.

    Args:
        calibration: ``Fit.calibration``, or that with other parameters of the chute by ``varied``.
        confidence: of bands.
        asked: one of Q, M, h and T_surface, as for :func:`chuteflow.flows`.

    Raises:
        InputError: for none or several of them, or a value out of range.
    """
    confidence = number("confidence", confidence, 0.5, 0.9999)
    given: dict[str, Any] = dict(asked)
    found = flows(calibration.chute, **given)
    ((key, value),) = asked.items()
    predicted = tuple(_predict(flow, calibration, key) for flow in found)
    return Prediction(calibration, found, predicted, (key, float(value)), confidence)


def _predict(flow: Flow, calibration: Calibration, at: str) -> PredictedFlow:
    answer: Sensitivity = sensitivity(flow, calibration.keys, at=at)
    numbers = {
        name: (float(getattr(flow, name)), _error(rates, calibration.covariance))
        for name, rates in answer.numbers.items()
    }
    height = np.linspace(0.0, flow.depth, _HEIGHTS)
    profile, rates = flow.profile(height), answer.profile(height)
    profiles = {
        name: np.stack([getattr(profile, name), _errors(rates[name], calibration.covariance)])
        for name in FIELDS
        if name != "height"
    }
    return PredictedFlow(flow, numbers, height, profiles)


def _band(branch: Sequence[Flow], calibration: Calibration) -> Band:
    points, normals, errors = [], [], []
    for flow in branch:
        answer = sensitivity(flow, calibration.keys)
        plane = [LOG_Q, LOG_H]
        tangent = answer.tangent[plane]
        tangent = tangent / max(float(np.linalg.norm(tangent)), 1e-300)
        normal = np.array([-tangent[1], tangent[0]])
        points.append(flow.solution.macroscopic[plane])
        normals.append(normal)
        errors.append(_error(normal @ answer.across[plane], calibration.covariance))
    return Band(np.array(points), np.array(normals), np.array(errors))


def _error(rates: Array, covariance: Array) -> float:
    """The standard error of a number with these derivatives (k,): infinite where one is."""
    if not np.isfinite(rates).all():
        return float("nan") if np.isnan(rates).any() else float("inf")
    return float(np.sqrt(max(rates @ covariance @ rates, 0.0)))


def _errors(rates: Array, covariance: Array) -> Array:
    """Standard errors (m,) of numbers with derivatives (k, m)."""
    return np.array([_error(column, covariance) for column in rates.T]) if len(rates) else np.zeros(rates.shape[1])
