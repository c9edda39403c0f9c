"""Confidence intervals by profile likelihood: how far one parameter can go while all others make the best of it.

# notation: x unknowns, chi2(x) the sum of squares, q the rise of it that ends an interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chuteflow.fitting.objective import Minimum, Objective
from chuteflow.fitting.residuals import TrialFlow
from chuteflow.numerics.chebyshev import Array

#: How an interval can end, and what that means.
ENDS = {
    "crossed": "the fit becomes worse than the confidence allows",
    "bound": "the parameter can take no further value, and still fits",
    "no flow": "no flow goes on, and the last one still fits",
}
#: The root of the rise is found to this; steps and bisections at most.
_CLOSE, _STEPS, _BISECTIONS = 0.02, 9, 4
#: Evaluations in each fit with a fixed parameter, and its tolerance.
_MOST, _TOLERANCE = 25, 1e-4
#: A sum of squares that is lower by this part of the rise is a better fit.
_BETTER = 0.03


@dataclass(frozen=True)
class Interval:
    """A confidence interval from ``low`` to ``high``; ``ends`` are keys of :data:`ENDS`."""

    low: float
    high: float
    ends: tuple[str, str]

    @property
    def bounded(self) -> bool:
        """Whether the data end it at both sides."""
        return self.ends == ("crossed", "crossed")

    def continued(self, other: Interval) -> Interval:
        """This one, with the ends of ``other`` where its own is that no flow goes on."""
        low, low_end = (other.low, other.ends[0]) if self.ends[0] == "no flow" else (self.low, self.ends[0])
        high, high_end = (other.high, other.ends[1]) if self.ends[1] == "no flow" else (self.high, self.ends[1])
        return Interval(min(low, self.low), max(high, self.high), (low_end, high_end))

    @property
    def open(self) -> bool:
        """Whether the data end it at neither side."""
        return "crossed" not in self.ends


class BetterFit(Exception):
    """A better fit than the one whose intervals were asked for."""

    def __init__(self, found: Minimum) -> None:
        super().__init__()
        self.found = found


def interval(objective: Objective, best: Minimum, covariance: Array, which: int, rise: float) -> Interval:
    """The interval of unknown number ``which`` in which chi2 rises by no more than ``rise`` above ``best``.

    Raises:
        BetterFit: where chi2 falls below it on the way.
    """
    low, low_end = _IntervalSide(objective, best, covariance, which, rise, -1.0).end()
    high, high_end = _IntervalSide(objective, best, covariance, which, rise, 1.0).end()
    return Interval(low, high, (low_end, high_end))


@dataclass(eq=False)
class _IntervalSide:
    """One side of an interval."""

    objective: Objective
    best: Minimum
    covariance: Array
    which: int
    rise: float
    sign: float

    def end(self) -> tuple[float, str]:
        """Where the interval ends, and how."""
        place, how = self._end()
        return float(place), how

    def _end(self) -> tuple[float, str]:
        here = float(self.best.x[self.which])
        bound = float(self.objective.bounds()[int(self.sign > 0.0)][self.which])
        widest = self.objective.scale()[self.which] * 4.0
        step = min(np.sqrt(self.rise * max(self.covariance[self.which, self.which], 0.0)), widest)
        step = step if np.isfinite(step) and step > 0.0 else 0.1 * widest
        inside, inside_root, nearest = here, 0.0, self.best
        outside, outside_root = None, np.inf
        goal = np.sqrt(self.rise)
        place = here + self.sign * step
        failures = 0
        for _ in range(_STEPS):
            at_bound = self.sign * (place - bound) >= 0.0
            place = bound if at_bound else place
            found = self._fitted(place, nearest)
            if found is None:
                failures += 1
                if failures > _BISECTIONS:
                    return inside, "no flow"
                outside, outside_root = place, np.inf
                place = 0.5 * (inside + place)
                continue
            root = float(np.sqrt(max(found.chi2 - self.best.chi2, 0.0)))
            if root <= goal:
                if at_bound:
                    return bound, "bound"
                inside, inside_root, nearest = place, root, found
            else:
                outside, outside_root = place, root
            if abs(root - goal) < _CLOSE * goal:
                return place, "crossed"
            place = self._next(inside, inside_root, outside, outside_root, goal, here, bound)
        if outside is None or not np.isfinite(outside_root):
            return inside, "no flow" if failures else "bound"
        return place, "crossed"

    def _next(
        self,
        inside: float,
        inside_root: float,
        outside: float | None,
        outside_root: float,
        goal: float,
        here: float,
        bound: float,
    ) -> float:
        """Where to look next: the root of chi2 is almost linear in the parameter."""
        if outside is None:
            grown = goal / max(inside_root, 0.2 * goal) * 1.02
            return here + (inside - here) * min(grown, 5.0)
        if not np.isfinite(outside_root):
            return 0.5 * (inside + outside)
        fraction = (goal - inside_root) / (outside_root - inside_root)
        return inside + float(np.clip(fraction, 0.05, 0.95)) * (outside - inside)

    def _fitted(self, value: float, nearest: Minimum) -> Minimum | None:
        """The best fit with the unknown at ``value``: from the nearest known one, the others moved as they go along."""
        for start, fraction in ((nearest, 1.0), (nearest, 0.0), (self.best, 1.0)):
            x = start.x.copy()
            spread = self.covariance[self.which, self.which]
            if fraction and spread > 0.0:
                moved = self.covariance[:, self.which] / spread * (value - x[self.which])
                x = x + np.where(np.isfinite(moved), moved, 0.0)
            x[self.which] = value
            places: Sequence[TrialFlow] = start.places
            found = self.objective.minimise(x, places, most=_MOST, fixed=self.which, tolerance=_TOLERANCE)
            if found is not None:
                if found.chi2 < self.best.chi2 - _BETTER * self.rise:
                    raise BetterFit(found)
                return found
        return None
