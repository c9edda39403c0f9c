"""The stretch of a branch between two solved flows, cut across the chord between them.

# notation: sigma runs from 0 to 1 along the chord.
"""

from __future__ import annotations

from collections.abc import Callable

from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_M, Collocation
from chuteflow.steady.solver import TOLERANCE, Condition, Solution, Status, alike, solve

#: A chord is searched until sigma is known to this.
_CLOSE = 1e-9
#: Where the solver does not converge it starts from nearer flows, found so many times half-way.
_NEARER = 3
#: Tolerance of flows that the finest grid does not resolve further.
_LOOSE = 1e-5


class Chord:
    """The stretch of a family between two solved flows, as a function of sigma.

    The chord lies in the plane (ln M, ln T_surface); in the space of all four quantities if ``in_space``, for families
    that hardly move in the plane where deep flows change near the base alone. There a flow that the finest grid does
    not resolve to the tolerance is taken with the error that it has.
    """

    def __init__(
        self, first: Solution, last: Solution, tolerance: float = TOLERANCE, *, in_space: bool = False
    ) -> None:
        chord = last.macroscopic - first.macroscopic
        if not in_space:
            chord[:LOG_M] = 0.0
        #: d sigma over d (ln Q, ln h, ln M, ln T_surface), (4,)
        self.row: Array = chord / float(chord @ chord)
        self._begin = float(self.row @ first.macroscopic)
        self._known = [(0.0, first), (1.0, last)]
        self._alike: dict[tuple[float, float], tuple[Collocation, Array, Array]] = {}
        self._tolerance, self._in_space = tolerance, in_space

    def at(self, sigma: float) -> Solution:
        """The flow at ``sigma``.

        Raises:
            SolveError: where the solver does not converge.
        """
        return self._at(sigma, _NEARER)

    def _at(self, sigma: float, nearer: int) -> Solution:
        solution = solve(*self.start_at(sigma), self.condition_at(sigma), self._tolerance)
        if solution.status is Status.NO_CONVERGENCE and nearer:
            nearest = min((known for known, _ in self._known), key=lambda known: abs(known - sigma))
            self._at(0.5 * (nearest + sigma), nearer - 1)
            return self._at(sigma, nearer - 1)
        if solution.status is Status.UNRESOLVED and self._in_space:
            solution = solve(*self.start_at(sigma), self.condition_at(sigma), max(self._tolerance, _LOOSE))
        if not solution.converged:
            raise SolveError(f"a family of flows could not be followed: {solution.status.value}")
        self._known.append((sigma, solution))
        return solution

    def condition_at(self, sigma: float) -> Condition:
        """What holds at ``sigma``, in the plane or space normal to the chord."""
        flux, height, mass, temperature = self.row.tolist()
        return Condition((flux, height, mass, temperature), self._begin + sigma)

    def place(self, solution: Solution) -> float:
        """sigma of a flow."""
        return float(self.row @ solution.macroscopic) - self._begin

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
