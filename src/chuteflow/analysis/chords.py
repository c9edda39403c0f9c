"""The stretch of a branch between two solved flows, cut by planes across the chord between them.

# notation: sigma runs from 0 to 1 along the chord between two flows in the plane (ln M, ln T_surface).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_M, Collocation
from chuteflow.steady.solver import TOLERANCE, Condition, Solution, alike, solve

#: A chord is searched until sigma is known to this.
_CLOSE = 1e-9


class Chord:
    """The stretch of a family between two solved flows, as a function of sigma."""

    def __init__(self, first: Solution, last: Solution, tolerance: float = TOLERANCE) -> None:
        chord = (last.macroscopic - first.macroscopic)[LOG_M:]
        weights = chord / float(chord @ chord)
        #: d sigma over d (ln M, ln T_surface)
        self.row = (float(weights[0]), float(weights[1]))
        self._begin = float(weights @ first.macroscopic[LOG_M:])
        self._known = [(0.0, first), (1.0, last)]
        self._alike: dict[tuple[float, float], tuple[Collocation, Array, Array]] = {}
        self._tolerance = tolerance

    def at(self, sigma: float) -> Solution:
        """The flow at ``sigma``.

        Raises:
            SolveError: where the solver does not converge.
        """
        solution = solve(*self.start_at(sigma), self.condition_at(sigma), self._tolerance)
        if not solution.converged:
            raise SolveError(f"a family of flows could not be followed: {solution.status.value}")
        self._known.append((sigma, solution))
        return solution

    def condition_at(self, sigma: float) -> Condition:
        """The plane at ``sigma`` normal to the chord."""
        return Condition((0.0, 0.0, *self.row), self._begin + sigma)

    def place(self, solution: Solution) -> float:
        """sigma of a flow."""
        return float(np.array(self.row) @ solution.macroscopic[LOG_M:]) - self._begin

    def start_at(self, sigma: float) -> tuple[Collocation, Array]:
        """Where the solver may start from at ``sigma``: between the nearest flows known."""
        (at, near), (other_at, other) = sorted(self._known, key=lambda known: abs(known[0] - sigma))[:2]
        if (at, other_at) not in self._alike:
            self._alike[at, other_at] = alike(near, other)
        problem, z, other_z = self._alike[at, other_at]
        return problem, z + (sigma - at) / (other_at - at) * (other_z - z)

    def zero(self, function: Callable[[Solution], float], ends: tuple[float, float]) -> Solution:
        """The flow at which ``function`` vanishes, given its values of opposite sign at the ends.

        Regula falsi with the Illinois rule, down to rounding of sigma.
        """
        (low, f_low), (high, f_high) = (0.0, ends[0]), (1.0, ends[1])
        side = 0
        solution = self._known[0][1]
        for _ in range(100):
            sigma = (low * f_high - high * f_low) / (f_high - f_low)
            solution = self.at(sigma)
            f = function(solution)
            if f == 0.0 or high - low < _CLOSE or abs(f) < _CLOSE * abs(ends[1] - ends[0]):
                return solution
            if (f > 0.0) == (f_high > 0.0):
                high, f_high = sigma, f
                f_low = 0.5 * f_low if side == 1 else f_low
                side = 1
            else:
                low, f_low = sigma, f
                f_high = 0.5 * f_high if side == -1 else f_high
                side = -1
        return solution
