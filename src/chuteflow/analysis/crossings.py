"""Where a quantity takes a value along a family of flows: brackets, turns, and the flows themselves.

# notation: sigma runs from 0 to 1 along the chord between two flows in the plane (ln M, ln T_surface).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_M, Collocation
from chuteflow.steady.solver import DEGREES, TOLERANCE, Condition, Solution, Status, between, resolve, solve, solve_many

#: Where a rough quantity turns this near to the value sought, in the logarithm, the turn is located.
NEAR = 0.02
#: Knots to either side of a rough turn among which the turn is looked for.
_ASIDE = 3
#: A flow found from a bracket lies within this many of its lengths, and a little.
_BESIDE, _ROUGH = 1.0, 0.1
#: Flows whose ln M and ln T_surface differ by less are one flow.
_SAME = 1e-7
#: Degrees on which a knot is tried in turn.
_STARTS = (DEGREES[0], DEGREES[3], DEGREES[5])
#: A chord is searched until sigma is known to this.
_CLOSE = 1e-9
#: Share of the slopes at the ends of a chord that is left at a turn.
_FLAT = 1e-3


@dataclass(frozen=True, eq=False)
class Knot:
    """A rough flow of a family: ``macroscopic`` (4,), and where the solver may ``start`` from on a grid of
    at least a degree; ``exact`` where it is a solved flow."""

    macroscopic: Array
    start: Callable[[int], tuple[Collocation, Array]]
    exact: Solution | None = None

    def solved(self, condition: Condition, tolerance: float = TOLERANCE) -> Solution:
        """The flow near the knot that meets ``condition``.

        A profile too winding for one grid gets a finer one: on a coarse grid Newton's method may fail, or run to
        another flow far away. One far away is returned only where no grid leads to a nearer one.
        """
        first: Solution | None = None
        for degree in _STARTS:
            solution = solve(*self.start(degree), condition, tolerance)
            if solution.status is Status.NO_CONVERGENCE:
                first = first or solution
                continue
            apart = float(np.hypot(*(solution.macroscopic - self.macroscopic)[LOG_M:]))
            if apart <= _ROUGH or self.exact is not None:
                return solution
            if first is None or not first.converged:
                first = solution
        assert first is not None
        return first

    @classmethod
    def at(cls, solution: Solution) -> Knot:
        """The knot of a solved flow."""
        return cls(solution.macroscopic, lambda degree: (solution.problem, solution.z), solution)


def crossings(knots: Sequence[Knot], which: int, value: float, tolerance: float) -> Iterator[Solution]:
    """Flows of the family through ``knots`` at which the quantity ``which`` equals ``value``.

    Raises:
        SolveError: where a flow that is bracketed could not be solved.
    """
    target = float(np.log(value))
    condition = Condition.fix(which, value)
    knots = _with_turns(knots, which, target)
    off = np.array([knot.macroscopic[which] for knot in knots]) - target
    brackets = [(knots[i], knots[i + 1]) for i in np.flatnonzero((off[1:] >= 0.0) != (off[:-1] >= 0.0))]
    nearer = [min(pair, key=lambda knot: abs(knot.macroscopic[which] - target)) for pair in brackets]
    direct = solve_many([knot.start(_STARTS[0]) for knot in nearer], [condition] * len(nearer), tolerance)
    for i, (pair, knot, found) in enumerate(zip(brackets, nearer, direct, strict=True)):
        solution = found if found.converged else knot.solved(condition, tolerance)
        # Beside a turn, which is exact, either of two flows may be found: only the bracket tells them apart.
        turning = pair[0].exact is not None and pair[1].exact is not None
        contested = any(_same(found, other) for j, other in enumerate(direct) if j != i)
        if turning or contested or not _is_between(*pair, solution):
            solution = _bracketed(*pair, which, target, condition, solution, tolerance)
        if solution is not None:
            yield solution


def _with_turns(knots: Sequence[Knot], which: int, target: float) -> list[Knot]:
    """The knots, with those near a turn near the target solved, and the turn itself put in between."""
    off = np.array([knot.macroscopic[which] for knot in knots]) - target
    if len(knots) < 3:
        return list(knots)
    turns = (off[1:-1] - off[:-2]) * (off[2:] - off[1:-1]) <= 0.0
    bend = np.abs(off[:-2] - 2.0 * off[1:-1] + off[2:])
    near = np.zeros(len(knots), dtype=bool)
    for i in np.flatnonzero(turns & (np.abs(off[1:-1]) < NEAR + bend)).tolist():
        # The roughness of the knots may put the turn a few of them beside its place.
        near[max(i + 1 - _ASIDE, 0) : i + 2 + _ASIDE] = True
    solved = [_solved(knots, i) if flag else None for i, flag in enumerate(near)]
    out: list[Knot] = []
    for i, knot in enumerate(knots):
        here = solved[i]
        out.append(knot if here is None else Knot.at(here))
        after = solved[i + 1] if i + 1 < len(knots) else None
        if here is not None and after is not None:
            turn = turning_point(here, after, which)
            if turn is not None:
                out.append(Knot.at(turn))
    return out


def solved(knots: Sequence[Knot], i: int) -> tuple[Solution, Array]:
    """Knot i solved in the plane through it normal to the chord of its neighbours, and that chord's direction
    (d ln M, d ln T_surface)."""
    chord = (knots[min(i + 1, len(knots) - 1)].macroscopic - knots[max(i - 1, 0)].macroscopic)[LOG_M:]
    length = float(np.hypot(*chord))
    ahead = chord / length if length > 0.0 else np.array([1.0, 0.0])
    return knots[i].solved(Condition.plane(ahead, knots[i].macroscopic)), ahead


def _solved(knots: Sequence[Knot], i: int) -> Solution | None:
    exact = knots[i].exact
    if exact is not None:
        return exact
    solution, _ = solved(knots, i)
    return solution if solution.converged else None


class Chord:
    """The stretch of a family between two solved flows, as a function of sigma."""

    def __init__(self, first: Solution, last: Solution, tolerance: float = TOLERANCE) -> None:
        chord = (last.macroscopic - first.macroscopic)[LOG_M:]
        weights = chord / float(chord @ chord)
        self._weights = (0.0, 0.0, float(weights[0]), float(weights[1]))
        self._begin = float(weights @ first.macroscopic[LOG_M:])
        self._known = [(0.0, first), (1.0, last)]
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
        return Condition(self._weights, self._begin + sigma)

    def start_at(self, sigma: float) -> tuple[Collocation, Array]:
        """Where the solver may start from at ``sigma``: between the nearest flows known."""
        (at, near), (other_at, other) = sorted(self._known, key=lambda known: abs(known[0] - sigma))[:2]
        return between(near, other, (sigma - at) / (other_at - at))

    def slope(self, solution: Solution, which: int) -> float:
        """Derivative of the logarithm ``which`` with respect to sigma at a flow of the stretch."""
        gradient = solution.state.macroscopic_gradient()
        matrix = np.vstack([solution.state.jacobian(), np.array(self._weights) @ gradient])
        side = np.zeros(len(matrix))
        side[-1] = 1.0
        return float(gradient[which] @ np.linalg.solve(matrix, side))

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


def turning_point(first: Solution, last: Solution, which: int, tolerance: float = TOLERANCE) -> Solution | None:
    """The flow between two at which the quantity ``which`` turns, or None where it does not."""
    chord = Chord(first, last, tolerance)
    slopes = chord.slope(first, which), chord.slope(last, which)
    if (slopes[0] > 0.0) == (slopes[1] > 0.0):
        return None
    turn = chord.zero(lambda solution: chord.slope(solution, which), slopes)
    # Where the family runs across the chord the slope changes sign through infinity, or in a jump: that is no turn.
    return turn if abs(chord.slope(turn, which)) <= _FLAT * max(map(abs, slopes)) else None


def _same(one: Solution, other: Solution) -> bool:
    """Whether two solutions are one flow: of those of two brackets, one at least has strayed."""
    apart = np.abs(one.macroscopic - other.macroscopic)[LOG_M:].max()
    return one.converged and other.converged and bool(apart < _SAME)


def _is_between(a: Knot, b: Knot, solution: Solution) -> bool:
    """Whether a solution lies between two knots, give or take their length and roughness."""
    if not solution.converged:
        return False
    length = float(np.hypot(*(b.macroscopic - a.macroscopic)[LOG_M:]))
    middle = 0.5 * (a.macroscopic + b.macroscopic)
    beside = float(np.hypot(*(solution.macroscopic - middle)[LOG_M:]))
    return beside <= (0.5 + _BESIDE) * length + _ROUGH


def _bracketed(
    a: Knot, b: Knot, which: int, target: float, condition: Condition, direct: Solution, tolerance: float
) -> Solution | None:
    """The flow between two knots, by bracketing; where only the roughness of the knots put one there, the
    solution ``direct``, if it is one."""
    first, last = _solved([a, b], 0), _solved([a, b], 1)
    if first is None or last is None:
        raise SolveError("a flow seen in the search could not be solved: ask for a larger tolerance")
    ends = (float(first.macroscopic[which]) - target, float(last.macroscopic[which]) - target)
    if (ends[0] >= 0.0) == (ends[1] >= 0.0):
        return direct if direct.converged else None
    near = Chord(first, last).zero(lambda s: float(s.macroscopic[which]) - target, ends)
    solution = resolve(near, condition, tolerance)
    if not solution.converged:
        raise SolveError(f"a flow was bracketed but not solved: {solution.status.value}")
    return solution
