"""Confidence intervals by profile likelihood: how far one parameter can go while all others make the best of it.

# notation: x unknowns, chi2(x) the sum of squares, q the rise of it that ends an interval.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
#: The root of the rise is found to this; fits with a fixed parameter on one side at most.
_CLOSE, _STEPS = 0.02, 30
#: A fit whose rise has a root this many times that allowed is on a flow that was lost: the step was too long. Where the
#: steps come to be this part of the way, or of the first one, no flow goes on.
_FAR, _SHORTEST, _NOTHING = 5.0, 0.02, 1e-4
#: A step is this many times the last one at most where one was too long before, and else.
_CAREFUL, _BOLD = 2.0, 5.0
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

    def leaves_out(self, value: float) -> bool:
        """Whether a value is outside by more than the ends are found to."""
        margin = _CLOSE * (self.high - self.low)
        return not self.low - margin <= value <= self.high + margin

    @property
    def open(self) -> bool:
        """Whether the data end it at neither side."""
        return "crossed" not in self.ends


class BetterFit(Exception):
    """A better fit than the one whose intervals were requested."""

    def __init__(self, found: Minimum) -> None:
        super().__init__()
        self.found = found


def interval(
    objective: Objective,
    best: Minimum,
    covariance: Array,
    which: int,
    rise: float,
    known: list[Minimum],
    *,
    onward: bool = False,
) -> Interval:
    """The interval of unknown number ``which`` in which chi2 rises by no more than ``rise`` above ``best``.

    Fits within the rise that are found on the way are added to those that are ``known``; ``onward`` from these it is
    followed where it was found once, and known fits for other unknowns are outside of it.

    Raises:
        BetterFit: where chi2 falls below it on the way.
    """
    low, low_end = _IntervalSide(objective, best, covariance, which, rise, -1.0, known, onward).end()
    high, high_end = _IntervalSide(objective, best, covariance, which, rise, 1.0, known, onward).end()
    return Interval(low, high, (low_end, high_end))


@dataclass(eq=False)
class _IntervalSide:
    """One side of an interval, which fits with a fixed parameter follow outward step by step."""

    objective: Objective
    best: Minimum
    covariance: Array
    which: int
    rise: float
    sign: float
    known: list[Minimum]
    onward: bool

    def end(self) -> tuple[float, str]:
        """Where the interval ends, and how."""
        place, how = self._end()
        return float(place), how

    def _end(self) -> tuple[float, str]:
        bound = float(self.objective.bounds()[int(self.sign > 0.0)][self.which])
        goal = float(np.sqrt(self.rise))
        inside, before = self.best, None
        first = step = self._first_step()
        if self.onward:
            inside = max([self.best, *self.known], key=lambda one: self.sign * one.x[self.which])
            before = self.best if inside is not self.best else None
            step = max(first - abs(inside.x[self.which] - self.best.x[self.which]), 0.1 * first)
        outside: tuple[float, float] | None = None
        careful, closer = False, 0
        for _ in range(_STEPS):
            at = float(inside.x[self.which])
            place = at + self.sign * step
            if outside is not None:
                fraction = (goal - self._root(inside)) / (outside[1] - self._root(inside))
                # Where one end alone comes nearer, the middle.
                fraction = 0.5 if closer > 1 else float(np.clip(fraction, 0.05, 0.95))
                place = at + fraction * (outside[0] - at)
            at_bound = self.sign * (place - bound) >= 0.0
            place = bound if at_bound else place
            if place == at:
                return bound, "bound"
            found = self._fit_at(place, inside, before)
            root = np.inf if found is None else self._root(found)
            if found is None or root > _FAR * goal:
                careful = True
                step = abs(place - at) * float(np.clip(goal / root, 0.1, 0.5))
                if step < max(_SHORTEST * abs(at - float(self.best.x[self.which])), _NOTHING * first):
                    return at, "no flow"
                continue
            if root <= goal:
                self.known.append(found)
                if at_bound:
                    return bound, "bound"
                before, inside = inside, found
                closer += 1
                rate = (root - self._root(before)) / abs(place - at)
                longest = (_CAREFUL if careful else _BOLD) * abs(place - at)
                step = min(longest, (1.02 * goal - root) / rate) if rate > 0.0 else longest
            else:
                outside, closer = (place, root), 0
            if abs(root - goal) < _CLOSE * goal:
                return place, "crossed"
        # What is outside of it is known, or nothing: then it goes as far as it was followed.
        return (outside[0], "crossed") if outside else (float(inside.x[self.which]), "no flow")

    def _first_step(self) -> float:
        """As far as the interval reaches by the covariance."""
        widest = self.objective.scale()[self.which] * 4.0
        step = min(np.sqrt(self.rise * max(self.covariance[self.which, self.which], 0.0)), widest)
        return float(step) if np.isfinite(step) and step > 0.0 else 0.1 * widest

    def _root(self, one: Minimum) -> float:
        """The root of the rise of chi2, which is almost linear in the parameter."""
        return float(np.sqrt(max(one.chi2 - self.best.chi2, 0.0)))

    def _fit_at(self, value: float, inside: Minimum, before: Minimum | None) -> Minimum | None:
        """The best fit with the unknown at ``value``, from the one inside: the others go on as they went, or as the
        covariance says, or stay."""
        found: Minimum | None = None
        for start in self._starts(value, inside, before):
            start[self.which] = value
            places: Sequence[TrialFlow] = inside.places
            found = self.objective.minimise(start, places, most=_MOST, fixed=self.which, tolerance=_TOLERANCE)
            if found is not None and found.chi2 < self.best.chi2 - _BETTER * self.rise:
                raise BetterFit(found)
            if found is not None and self._root(found) <= _FAR * np.sqrt(self.rise):
                return found
        return found

    def _starts(self, value: float, inside: Minimum, before: Minimum | None) -> Iterator[Array]:
        away = value - inside.x[self.which]
        if before is not None:
            yield inside.x + (inside.x - before.x) * away / (inside.x[self.which] - before.x[self.which])
        spread = self.covariance[self.which, self.which]
        if spread > 0.0:
            moved = self.covariance[:, self.which] / spread * away
            yield inside.x + np.where(np.isfinite(moved), moved, 0.0)
        yield inside.x.copy()
