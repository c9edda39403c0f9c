"""Where ln Q, ln h, ln M and ln T_surface turn along a branch of flows.

# notation: F(z) = 0 the steady problem, m one of the four quantities, sigma runs from 0 to 1 along the chord between
# two flows in the space of these, w the gradient of sigma in z.

Between two solved flows nothing is taken to be monotonic. At either end the derivatives along the branch are exact:

    [F_z; w] z' = [0; 1],    [F_z; w] z'' = -[F_zz; w_z] z' z',    m' = m_z z',    m'' = m_z z'' + m_zz z' z'.

The four numbers m', m'' at both ends give a cubic for m' between them; its integral must be the difference of m.
What is missing there is added as a bump, and tells how far the model can be trusted: where it leaves open whether m'
has a zero, or a pair of them, as two folds just past a cusp are, the stretch is halved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from chuteflow.analysis.chords import Chord
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.newton import solve_each
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T, Collocation
from chuteflow.steady.model import IMAGINARY_STEP
from chuteflow.steady.solver import TOLERANCE, Solution, in_parts

#: All quantities, by their places in the macroscopic ones.
EVERY = (LOG_Q, LOG_H, LOG_M, LOG_T)
#: The row of derivatives is chosen anew where the branch runs off it by more than this, at most so often.
_OFF_ROW, _ROWS_TRIED = 2.0, 3
#: Step along the branch of the central difference of exact first derivatives.
_DIFFERENCE = 1e-5
#: A chord is halved where the branch runs to it at an angle whose cosine is smaller.
_ALONG = 0.6
#: The bump counts so many times, and may be this part of the largest m', or of the chord; flows have errors, and it
#: is not known better than so many times them.
_SAFETY, _SMALL, _NOISE = 4.0, 0.1, 8.0
#: A chord shorter than this is not halved any more: its model is taken as it is.
_SHORTEST = 1e-4
#: An m' below this tells nothing of a turn; and turns are none whose values differ by less, or by their errors.
_FLAT, _LEAST = 1e-8, 1e-11
#: A place is known after a step of Newton's below this, in sigma, and before one below the second; a bracket ends when
#: it is shorter than the third.
_CLOSE, _LOST, _SMALLEST, _MOST_STEPS = 1e-6, 1e-9, 1e-12, 60


@dataclass(frozen=True, eq=False)
class Expansion:
    """A solved flow with the ``first`` and ``second`` derivatives (4,) of ln Q, ln h, ln M and ln T_surface along its
    branch, with respect to any one parameter that grows along it."""

    solution: Solution
    first: Array
    second: Array


@dataclass(frozen=True, eq=False)
class Stop:
    """A flow of a branch at a ``place`` that counts along a path, such as 2.5 between its flows 2 and 3; the quantity
    ``which`` turns there, if that is not None."""

    place: float
    solution: Solution
    which: int | None = None


def expansions(solutions: Sequence[Solution], ahead: Array) -> list[Expansion]:
    """The expansions of flows of one chute, where their branch goes about ``ahead`` (k, 4), a direction in the space
    of the quantities."""
    out: dict[int, Expansion] = {}
    for members in _alike(solutions):
        local = _Local([solutions[i] for i in members], ahead[members])
        first, second = local.first, local.second
        out |= {i: Expansion(solutions[i], first[row], second[row]) for row, i in enumerate(members)}
    return [out[i] for i in range(len(solutions))]


def _alike(solutions: Sequence[Solution]) -> Iterator[list[int]]:
    """The places of flows on grids of one degree, as many at a time as are treated side by side."""
    by_degree: dict[int, list[int]] = {}
    for i, solution in enumerate(solutions):
        by_degree.setdefault(solution.problem.degree, []).append(i)
    for members in by_degree.values():
        yield from in_parts(members)


class _Local:
    """Derivatives (k, 4) of the quantities of flows on grids of one degree."""

    def __init__(self, solutions: Sequence[Solution], ahead: Array) -> None:
        one = solutions[0].problem
        stretch = np.array([[float(np.reshape(s.problem.stretch, ()))] for s in solutions])
        self._problem = Collocation(one.model, one.degree, stretch)
        self._z = np.array([s.z for s in solutions])
        self._side = np.zeros((*self._z.shape, 1))
        self._side[:, -1] = 1.0
        self._row = np.asarray(ahead, dtype=float)
        with np.errstate(all="ignore"):
            state = self._problem.state(self._z)
            self._jacobian, self._gradient = state.jacobian(), state.macroscopic_gradient()
            for _ in range(_ROWS_TRIED):
                self._along = solve_each(self._bordered(), self._side)[..., 0]
                self.first = np.einsum("kqn,kn->kq", self._gradient, self._along)
                length = np.linalg.norm(self.first, axis=1)
                off = length > _OFF_ROW
                if not off.any():
                    break
                self._row = np.where(off[:, None], self.first / length[:, None], self._row)

    @property
    def second(self) -> Array:
        """Second derivatives, with respect to the parameter of the ``first`` ones."""
        with np.errstate(all="ignore"):
            bent, turned = _second_along(self._problem, self._z, self._along)
            self._side[:, :-1, 0] = -bent
            self._side[:, -1, 0] = -(self._row * turned).sum(axis=-1)
            bend = solve_each(self._bordered(), self._side)[..., 0]
        return np.einsum("kqn,kn->kq", self._gradient, bend) + turned

    def _bordered(self) -> Array:
        last = np.einsum("kq,kqn->kn", self._row, self._gradient)
        return np.concatenate([self._jacobian, last[:, None]], axis=1)


def _second_along(problem: Collocation, z: Array, along: Array) -> tuple[Array, Array]:
    """Second derivatives of the residual (k, n+2) and of the quantities (k, 4) along a direction (k, n+3).

    The first ones are exact, by an imaginary step; of these a central difference is taken.
    """
    sides = []
    for step in (_DIFFERENCE, -_DIFFERENCE):
        state = problem.state(cast(Array, z + (step + 1j * IMAGINARY_STEP) * along))
        sides.append(np.concatenate([state.residual().imag, state.macroscopic().imag], axis=-1))
    both = (sides[0] - sides[1]) / (2.0 * _DIFFERENCE * IMAGINARY_STEP)
    return both[:, :-4], both[:, -4:]


def directions(path: Array) -> Array:
    """Unit vectors along a path of points, an array (k, d), by the points to either side of each."""
    ahead = np.gradient(path, axis=0)
    length = np.linalg.norm(ahead, axis=1, keepdims=True)
    return np.where(length > 0.0, ahead / np.where(length > 0.0, length, 1.0), np.eye(path.shape[1])[-1])


def turns(path: Sequence[Solution], which: Sequence[int], tolerance: float = TOLERANCE) -> list[Stop]:
    """Every flow between the first and the last of ``path``, successive flows of one branch, at which one of the
    quantities ``which`` turns, in order along it; but turns that differ by rounding alone.

    Raises:
        SolveError: where the branch could not be followed to one.
    """
    stops = followed(path, which, tolerance)
    told = [turn for quantity in which for turn in _told([s for s in stops if s.which == quantity], path)]
    return sorted(told, key=lambda turn: turn.place)


def followed(path: Sequence[Solution], which: Sequence[int], tolerance: float = TOLERANCE) -> list[Stop]:
    """The flows of ``path`` and between them those at which one of the quantities ``which`` turns, and as many others
    as it takes to find these, in order: from one to the next, the quantities are monotonic and the branch runs along
    the chord.

    Raises:
        SolveError: where the branch could not be followed.
    """
    stops = [Stop(float(i), solution) for i, solution in enumerate(path)]
    if len(path) < 2:
        return stops
    at = expansions(path, directions(np.array([s.macroscopic for s in path])))
    for i in np.flatnonzero(Models.between(at[:-1], at[1:]).open(which)).tolist():
        stops += _between(at[i], at[i + 1], which, tolerance, (float(i), i + 1.0))
    return sorted(stops, key=lambda stop: stop.place)


def _told(turns: list[Stop], path: Sequence[Solution]) -> list[Stop]:
    """The turns of one quantity without those that its errors may have made."""
    if not turns:
        return []
    which = turns[0].which
    stops = [path[0], *(turn.solution for turn in turns), path[-1]]
    errors = [0.0, *(turn.solution.error for turn in turns), 0.0]
    values = [float(stop.macroscopic[which]) for stop in stops]
    kept = distinct(values, [max(_LEAST, one + other) for one, other in pairwise(errors)])
    return [turns[i - 1] for i in kept[1:-1]]


def distinct(values: Sequence[float], least: Sequence[float]) -> list[int]:
    """Of ``values`` (k,) of a quantity at the ends of a path and at its turns, the places of the ends, and of those
    turns that are told from their neighbours: by more than ``least`` (k-1,), from each to the next."""
    kept, gaps = list(range(len(values))), list(least)
    while len(kept) > 2:
        apart = [abs(values[j] - values[i]) - gap for i, j, gap in zip(kept[:-1], kept[1:], gaps, strict=True)]
        nearest = int(np.argmin(apart))
        if apart[nearest] > 0.0:
            break
        # Two turns that are one value are none; at an end of the path the one next to it is none.
        first, last = max(nearest, 1), min(nearest + 2, len(kept) - 1)
        del kept[first:last]
        gaps[first - 1 : last] = [max(gaps[first - 1 : last])]
    return kept


@dataclass(frozen=True, eq=False)
class Models:
    """Models of m' over sigma in stretches between flows: ``slope`` (k, 4, 5) the coefficients of a quartic in
    Bernstein's basis, ``bump`` (k, 4) what of it is not known by its ends, ``length`` (k,) of the chords; ``sure``
    (k,) where the chords can be relied on."""

    slope: Array
    bump: Array
    length: Array
    sure: NDArray[np.bool_]

    @classmethod
    def between(cls, first: Sequence[Expansion], last: Sequence[Expansion]) -> Models:
        """The models between flows ``first`` (k) and ``last`` (k)."""
        ends = [np.array([e.solution.macroscopic for e in part]) for part in (first, last)]
        gain = ends[1] - ends[0]
        length = np.linalg.norm(gain, axis=1)
        row = gain / np.where(length > 0.0, length, 1.0)[:, None] ** 2
        with np.errstate(all="ignore"):
            # Which way along the branch the parameters of the expansions grow does not matter.
            begin, end = _over_sigma(first, row), _over_sigma(last, row)
            # Cosine of the angle to the chord: d sigma per arclength, times the chord.
            cosines = [length / np.linalg.norm(part[0], axis=1) for part in (begin, end)]
            whole = 0.5 * (begin[0] + end[0]) + (begin[1] - end[1]) / 12.0
            bump = 5.0 * (gain - whole)  # in the middle coefficient; 3/8 of it in m'
            errors = np.array([a.solution.error + b.solution.error for a, b in zip(first, last, strict=True)])
            bump[np.abs(bump) <= 5.0 * _NOISE * errors[:, None]] = 0.0
            slope = np.stack(
                [
                    begin[0],
                    begin[0] + 0.25 * begin[1],
                    0.5 * (begin[0] + end[0]) + (begin[1] - end[1]) / 6.0 + bump,
                    end[0] - 0.25 * end[1],
                    end[0],
                ],
                axis=-1,
            )
            size = np.maximum(np.abs(slope).max(axis=-1), length[:, None])
            sure = (np.abs(bump) < _SMALL * size).all(axis=1) & (np.minimum(*cosines) > _ALONG)
        return cls(slope, np.abs(bump), length, sure)

    def open(self, which: Sequence[int]) -> NDArray[np.bool_]:
        """Whether one of the quantities may turn (k,)."""
        low, high = self.slope[:, which].copy(), self.slope[:, which].copy()
        low[..., 2] -= _SAFETY * self.bump[:, which]
        high[..., 2] += _SAFETY * self.bump[:, which]
        monotonic = (low.min(axis=-1) > 0.0) | (high.max(axis=-1) < 0.0)
        monotonic |= np.maximum(-low.min(axis=-1), high.max(axis=-1)) < _FLAT
        return (self.length > 0.0) & ~(self.sure & monotonic.all(axis=1))


def _over_sigma(at: Sequence[Expansion], row: Array) -> tuple[Array, Array]:
    """First and second derivatives (k, 4) with respect to sigma, which ``row`` (k, 4) gives."""
    first, second = np.array([e.first for e in at]), np.array([e.second for e in at])
    pace = (row * first).sum(axis=1)
    bend = (row * second).sum(axis=1)
    slope = first / pace[:, None]
    return slope, (second - slope * bend[:, None]) / pace[:, None] ** 2


def _between(
    first: Expansion, last: Expansion, which: Sequence[int], tolerance: float, ends: tuple[float, float]
) -> Iterator[Stop]:
    """The turns in a stretch with these ``ends``, and the flows at which it was halved."""
    models = Models.between([first], [last])
    if not models.open(which)[0]:
        return
    begin, end = ends
    chord = Chord(first.solution, last.solution, tolerance, in_space=True)
    brackets = {quantity: _brackets(models, quantity) for quantity in which if models.open((quantity,))[0]}
    short = float(models.length[0]) < _SHORTEST
    if short or (models.sure[0] and all(found is not None for found in brackets.values())):
        located = [
            (quantity, _located(chord, quantity, bracket))
            for quantity, found in brackets.items()
            for bracket in found or ()
        ]
        if short or all(turn is not None for _, turn in located):
            for quantity, turn in located:
                if turn is not None:
                    yield Stop(begin + (end - begin) * turn[0], turn[1], quantity)
            return
    middle, halfway = _middle(chord, first.solution, last.solution, tolerance), 0.5 * (begin + end)
    yield Stop(halfway, middle)
    (between,) = expansions([middle], _unit(chord))
    yield from _between(first, between, which, tolerance, (begin, halfway))
    yield from _between(between, last, which, tolerance, (halfway, end))


def _middle(chord: Chord, first: Solution, last: Solution, tolerance: float) -> Solution:
    """The flow half-way along a chord; along the one in the plane of ln M and ln T_surface where that is not found."""
    try:
        return chord.at(0.5)
    except SolveError:
        return Chord(first, last, tolerance).at(0.5)


@dataclass(frozen=True)
class Bracket:
    """Where a function changes sign: between ``low`` and ``high`` in sigma, about at ``start``; its value ``before``
    at ``low``, or another one of that sign."""

    low: float
    high: float
    start: float
    before: float


def _brackets(models: Models, which: int) -> list[Bracket] | None:
    """Where the one stretch has turns of a quantity; None where its model does not tell."""
    b = models.slope[0, which]
    quartic = _FROM_BERNSTEIN @ b
    roots = np.roots(np.polyder(quartic))
    inside = np.sort(roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0) & (roots.real < 1.0)])
    stops = np.array([0.0, *inside, 1.0])
    values = np.polyval(quartic, stops)
    values[0], values[-1] = b[0], b[-1]
    unknown = _SAFETY * models.bump[0, which] * 6.0 * (stops * (1.0 - stops)) ** 2
    if (np.abs(values) < unknown).any():
        return None
    told = (np.abs(values) > _FLAT) | (stops == 0.0) | (stops == 1.0)
    stops, values = stops[told], values[told]
    changes = np.flatnonzero((values[1:] > 0.0) != (values[:-1] > 0.0))
    zeros = np.roots(quartic).real
    out = []
    for i in changes.tolist():
        low, high = float(stops[i]), float(stops[i + 1])
        between = zeros[(zeros > low) & (zeros < high)]
        start = float(between[0]) if len(between) == 1 else 0.5 * (low + high)
        out.append(Bracket(low, high, start, float(values[i])))
    return out


#: Powers, highest first, of a quartic from its coefficients in Bernstein's basis.
_FROM_BERNSTEIN = np.array(
    [
        [1.0, -4.0, 6.0, -4.0, 1.0],
        [-4.0, 12.0, -12.0, 4.0, 0.0],
        [6.0, -12.0, 6.0, 0.0, 0.0],
        [-4.0, 4.0, 0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0, 0.0, 0.0],
    ]
)


def _located(chord: Chord, which: int, bracket: Bracket) -> tuple[float, Solution] | None:
    """The turn in a bracket of a chord; None where it is not there."""

    def slope(solution: Solution) -> tuple[float, float]:
        first, second = along(chord, solution)
        return float(first[which]), float(second[which])

    return find_zero(chord, slope, bracket)


def along(chord: Chord, solution: Solution) -> tuple[Array, Array]:
    """First and second derivatives (4,) of the quantities with respect to sigma at a flow of the stretch."""
    first, second = _over_sigma(expansions([solution], _unit(chord)), chord.row[None])
    return first[0], second[0]


def _unit(chord: Chord) -> Array:
    return chord.row[None] / np.linalg.norm(chord.row)


def find_zero(
    chord: Chord, function: Callable[[Solution], tuple[float, float]], bracket: Bracket
) -> tuple[float, Solution] | None:
    """Where ``function``, which gives a value and its derivative with respect to sigma, vanishes in a bracket: the
    place and the flow; None where it keeps its sign.

    Newton's method, and where it leaves the bracket, bisection.
    """
    low, high, sigma = bracket.low, bracket.high, bracket.start
    # What a model says of a place inside is known when a flow has been seen beyond it.
    low_known, high_known = low == 0.0, high == 1.0
    for _ in range(_MOST_STEPS):
        solution = chord.at(sigma)
        value, slope = function(solution)
        step = -value / slope if slope else np.inf
        there = sigma + step
        if abs(step) < _CLOSE and low - _CLOSE <= there <= high + _CLOSE:
            return there, solution if abs(step) < _LOST else chord.at(there)
        if (value > 0.0) == (bracket.before > 0.0):
            low, low_known = sigma, True
        else:
            high, high_known = sigma, True
        if high - low < _SMALLEST:
            return (sigma, solution) if low_known and high_known else None
        sigma = there if low < there < high else 0.5 * (low + high)
    return None


def may_turn(slope: Array, noise: Array | float = 0.0) -> NDArray[np.bool_]:
    """Whether a quantity may turn in the steps of a rough path, given its ``slope`` (k, ...) in each by differences,
    which are known to ``noise``; NaN where a step is missing.

    So it may where the slope changes as much from step to step as it is large: then it, or within the step its own
    turn, may have reached zero. A step without neighbours tells nothing, and it may turn there.
    """
    change = np.abs(np.diff(slope, axis=0))
    none = np.full_like(slope[:1], np.nan)
    beside = np.fmax(np.concatenate([none, change]), np.concatenate([change, none]))
    with np.errstate(invalid="ignore"):
        return ~(np.abs(slope) > beside + noise) & np.isfinite(slope)


@dataclass(frozen=True, eq=False)
class Dip:
    """A step of a path between two values of one sign: the cubic with slopes by differences comes nearest to zero, or
    passes it furthest, at the ``share`` of the step, where it has the ``value``, with ``zeros`` to either side if it
    passes it."""

    step: int
    share: float
    value: float
    zeros: tuple[float, ...]


def dips(values: Array, at: Array) -> list[Dip]:
    """The steps between the places ``at`` (k,) of a path in which ``values`` (k,) turn towards zero, and away again."""
    if len(values) < 3:
        return []
    slope = np.gradient(values, at)
    length = np.diff(at)
    d0, d1 = slope[:-1] * length * np.sign(values[:-1]), slope[1:] * length * np.sign(values[:-1])
    out = []
    for i in np.flatnonzero((values[1:] * values[:-1] > 0.0) & (d0 < 0.0) & (d1 > 0.0)).tolist():
        (f0, f1), sign = np.abs(values[i : i + 2]), np.sign(values[i])
        cubic = np.array([2.0 * (f0 - f1) + d0[i] + d1[i], 3.0 * (f1 - f0) - 2.0 * d0[i] - d1[i], d0[i], f0])
        turning, zeros = np.roots(np.polyder(cubic)).real, np.roots(cubic)
        share = min(turning[(turning > 0.0) & (turning < 1.0)], key=lambda x: np.polyval(cubic, x), default=0.5)
        lowest = float(np.polyval(cubic, share))
        inside = zeros.real[(zeros.imag == 0.0) & (zeros.real > 0.0) & (zeros.real < 1.0)] if lowest < 0.0 else ()
        out.append(Dip(i, float(share), sign * lowest, tuple(sorted(map(float, inside)))))
    return out
