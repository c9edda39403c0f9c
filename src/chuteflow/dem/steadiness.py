"""Whether a run is steady: drifts over its measured time, each with an error."""

from __future__ import annotations

import math
from dataclasses import dataclass

from chuteflow.dem.correlation import long_run_variance
from chuteflow.dem.output import Array

#: Drifts are given over this time, and steady is below this fraction of the mean.
SPAN, LIMIT = 300.0, 0.01
#: Smallest number of values for a drift.
FEWEST = 10


@dataclass(frozen=True)
class Drift:
    """The change of a number over 300 time units, as a fraction of its mean, with its standard error."""

    value: float
    error: float

    @property
    def steadiness(self) -> str:
        """ "steady", "not steady" or "undecided": the drift, within two errors, compared with 1 %."""
        if not math.isfinite(self.value + self.error):
            return "undecided"
        if abs(self.value) + 2.0 * self.error < LIMIT:
            return "steady"
        return "not steady" if abs(self.value) - 2.0 * self.error > LIMIT else "undecided"


def drift(times: Array, values: Array) -> Drift:
    """The drift of ``values`` (n,) at evenly spaced ``times`` (n,): that of a straight line through them. Its error
    follows from the scatter about the line, with its correlation."""
    if len(values) < FEWEST or not values.mean():
        return Drift(math.nan, math.nan)
    away = times - times.mean()
    squares = float(away @ away)
    slope = float(away @ values) / squares
    left = values - values.mean() - slope * away
    error = math.sqrt(float(long_run_variance(left, fitted=2)) / squares)
    scale = SPAN / abs(float(values.mean()))
    return Drift(slope * scale, error * scale)


def overall_steadiness(drifts: dict[str, Drift]) -> str:
    """Of several drifts: "not steady" if one is, "steady" if all are, else "undecided"."""
    found = {one.steadiness for one in drifts.values()}
    if "not steady" in found:
        return "not steady"
    return "steady" if found == {"steady"} else "undecided"
