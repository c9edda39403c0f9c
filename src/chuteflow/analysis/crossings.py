"""Where a quantity takes a value along a family of flows: brackets, turns, and the flows themselves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from chuteflow.analysis.chords import Chord
from chuteflow.analysis.turns import Bracket, along, directions, find_zero, followed, may_turn
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_M, LOG_T, Collocation
from chuteflow.steady.solver import DEGREES, TOLERANCE, Condition, Solution, Status, resolve, solve, solve_many

#: Where a rough quantity may turn this near to the value sought, in the logarithm, its turns are located.
NEAR = 0.02
#: Rough flows nearer than this tell no slope; a logarithm of theirs is known to this.
_TOO_NEAR, _BLUR = 0.08, 2e-3
#: A flow found from a bracket lies within this many of its lengths, and a little.
_BESIDE, _ROUGH = 1.0, 0.1
#: The temperature is held at the end of a family where it changes by more than this along it.
_STEEP = 0.2
#: Flows whose ln M and ln T_surface differ by less are one flow.
_SAME = 1e-7
#: A flow solved at a fixed quantity is that of its bracket if it is so near to the one found along the branch.
_AS_FOUND = 1e-6
#: Least error of a logarithm ever claimed.
_FLOOR = 1e-12
#: Degrees on which a knot is tried in turn.
_STARTS = (DEGREES[0], DEGREES[3], DEGREES[5])


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


@dataclass(frozen=True, eq=False)
class _Path:
    """Knots in order along a family and their ``macroscopic`` (k, 4); ``turns`` are those at which the quantity asked
    for turns."""

    knots: Sequence[Knot]
    macroscopic: Array
    turns: Sequence[Knot]


def crossings(
    knots: Sequence[Knot], macroscopic: Array, which: int, value: float, tolerance: float
) -> Iterator[Solution]:
    """Flows of the family through ``knots``, with quantities ``macroscopic`` (k, 4), at which the quantity ``which``
    equals ``value``.

    So near to a turn that rounding hides on which side of it the value lies, the flow at the turn is one of them, with
    an error that says so.

    Raises:
        SolveError: where a flow that is bracketed could not be solved.
    """
    target = float(np.log(value))
    path = _with_turns(_Path(knots, macroscopic, ()), which, target)
    above = path.macroscopic[:, which] >= target
    brackets = [(path.knots[i], path.knots[i + 1]) for i in np.flatnonzero(above[1:] != above[:-1]).tolist()]
    exact = [pair for pair in brackets if pair[0].exact is not None and pair[1].exact is not None]
    rough = [pair for pair in brackets if pair[0].exact is None or pair[1].exact is None]
    for turn in path.turns:
        off = abs(float(turn.macroscopic[which]) - target)
        assert turn.exact is not None
        if off <= max(turn.exact.error, _FLOOR) and not any(turn in pair for pair in brackets):
            yield _at_turn(turn.exact, path.knots, which, off)
    yield from _from_rough(rough, which, value, tolerance)
    for one, other in exact:
        assert one.exact is not None
        assert other.exact is not None
        yield _on_stretch(one.exact, other.exact, which, value, tolerance)


def _from_rough(
    brackets: Sequence[tuple[Knot, Knot]], which: int, value: float, tolerance: float
) -> Iterator[Solution]:
    """The flows between rough knots: solved directly, where that surely gives the one and only flow of a bracket."""
    target, condition = float(np.log(value)), Condition.fix(which, value)
    nearer = [min(pair, key=lambda knot: abs(knot.macroscopic[which] - target)) for pair in brackets]
    direct = solve_many([knot.start(_STARTS[0]) for knot in nearer], [condition] * len(nearer), tolerance)
    solutions = [
        found if found.converged else knot.solved(condition, tolerance)
        for knot, found in zip(nearer, direct, strict=True)
    ]
    for i, (pair, solution) in enumerate(zip(brackets, solutions, strict=True)):
        # Of the flows of two brackets that are one flow, one at least has strayed.
        contested = any(_same(solution, other) for j, other in enumerate(solutions) if j != i)
        if contested or not _is_between(*pair, solution) or not _passes(*pair, which, solution):
            yield from _bracketed(*pair, which, value, solution, tolerance)
        else:
            yield solution


def _with_turns(path: _Path, which: int, target: float) -> _Path:
    """The path with its knots solved where a quantity may turn near the target, and with the turns there."""
    knots = path.knots
    kept = _kept(path)
    wanted = _near_turns(path.macroscopic[kept], which, target)
    if not wanted.any():
        return path
    out: list[Knot] = []
    found: list[Knot] = []
    begin = 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(int))).tolist()
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        # Steps first to last-1 lie between the knots first to last.
        out += knots[begin : kept[first]]
        stretch = solved_path([knots[i] for i in kept[first : last + 1]], (first == 0, last == len(kept) - 1))
        stops = followed(stretch, (which,))
        exact = [Knot.at(stop.solution) for stop in stops]
        found += [knot for stop, knot in zip(stops, exact, strict=True) if stop.which is not None]
        out += exact
        begin = kept[last] + 1
    out += knots[begin:]
    return _Path(out, np.array([knot.macroscopic for knot in out]), found)


def _kept(path: _Path) -> NDArray[np.intp]:
    """Knots with both ends, of rough ones that are near to each other only the first."""
    lengths = np.linalg.norm(np.diff(path.macroscopic, axis=0), axis=1)
    place = np.floor(np.append(0.0, np.cumsum(lengths)) / _TOO_NEAR)
    kept = np.append(True, place[1:] != place[:-1])
    kept |= np.array([knot.exact is not None for knot in path.knots])
    kept[-1] = True
    return np.flatnonzero(kept)


def _near_turns(macroscopic: Array, which: int, target: float) -> NDArray[np.bool_]:
    """The steps between knots (k, 4) in which a quantity may turn near the target, and those beside them."""
    off = macroscopic[:, which] - target
    if len(off) < 2:
        return np.zeros(0, dtype=bool)
    gain, length = np.diff(off), np.maximum(np.linalg.norm(np.diff(macroscopic, axis=0), axis=1), 1e-12)
    bend = np.concatenate([[0.0], np.abs(np.diff(gain)), [0.0]])
    reach = NEAR + np.maximum(bend[1:], bend[:-1])
    near = (np.minimum(off[1:], off[:-1]) < reach) & (np.maximum(off[1:], off[:-1]) > -reach)
    wanted = near & may_turn(gain / length, _BLUR / length)
    beside = np.concatenate([[False], wanted, [False]])
    return wanted | beside[2:] | beside[:-2]


def solved_path(knots: Sequence[Knot], at_edge: tuple[bool, bool] = (False, False)) -> list[Solution]:
    """The knots solved, each in the plane through it across the path; those that cannot be are left out.

    A family begins and ends with the first and last temperature searched: there (``at_edge``) that is held, so that
    nothing is lost beside an end that is rough.
    """
    plane = np.array([knot.macroscopic[LOG_M:] for knot in knots])
    ahead = directions(plane) if len(knots) > 1 else np.array([[1.0, 0.0]])
    conditions = [Condition.plane(along, knot.macroscopic) for along, knot in zip(ahead, knots, strict=True)]
    for i, edge in zip((0, -1), at_edge, strict=True):
        if edge and abs(ahead[i, 1]) > _STEEP:
            conditions[i] = Condition.fix(LOG_T, float(np.exp(knots[i].macroscopic[LOG_T])))
    rough = [i for i, knot in enumerate(knots) if knot.exact is None]
    together = solve_many([knots[i].start(_STARTS[0]) for i in rough], [conditions[i] for i in rough])
    out: list[Solution] = []
    found = dict(zip(rough, together, strict=True))
    for i, knot in enumerate(knots):
        solution = knot.exact or found[i]
        if knot.exact is None and not (solution.converged and _apart(solution, knot) <= _ROUGH):
            solution = knot.solved(conditions[i])
        if solution.converged:
            out.append(solution)
    return out


def _apart(solution: Solution, knot: Knot) -> float:
    return float(np.hypot(*(solution.macroscopic - knot.macroscopic)[LOG_M:]))


def solved(knots: Sequence[Knot], i: int) -> tuple[Solution, Array]:
    """Knot i solved in the plane through it normal to the chord of its neighbours, and that chord's direction
    (d ln M, d ln T_surface)."""
    chord = (knots[min(i + 1, len(knots) - 1)].macroscopic - knots[max(i - 1, 0)].macroscopic)[LOG_M:]
    length = float(np.hypot(*chord))
    ahead = chord / length if length > 0.0 else np.array([1.0, 0.0])
    return knots[i].solved(Condition.plane(ahead, knots[i].macroscopic)), ahead


def _same(one: Solution, other: Solution) -> bool:
    """Whether two solutions are one flow."""
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


def _passes(a: Knot, b: Knot, which: int, solution: Solution) -> bool:
    """Whether the quantity, at the value of which a flow was solved, changes along the branch there as it does from one
    knot to the other. Where it does not, there are three flows or more between them."""
    if solution.response is None:
        return False
    gain = b.macroscopic - a.macroscopic
    return bool(float(solution.response[LOG_M:] @ gain[LOG_M:]) * float(gain[which]) > 0.0)


def _bracketed(a: Knot, b: Knot, which: int, value: float, direct: Solution, tolerance: float) -> Iterator[Solution]:
    """The flows between two knots, by their exact turns; where only the roughness of the knots put one there, the
    solution ``direct``, if it is one."""
    ends = solved_path([a, b])
    if len(ends) < 2:
        raise SolveError("a flow seen in the search could not be solved: ask for a larger tolerance")
    target = float(np.log(value))
    found = [
        _on_stretch(*pair, which, value, tolerance)
        for pair in pairwise([stop.solution for stop in followed(ends, (which,))])
        if (pair[0].macroscopic[which] >= target) != (pair[1].macroscopic[which] >= target)
    ]
    if not found and direct.converged:
        found = [direct]
    yield from found


def _on_stretch(first: Solution, last: Solution, which: int, value: float, tolerance: float) -> Solution:
    """The one flow between two, between which a quantity does not turn, at which it has a value.

    It is sought along the branch, and then solved at the given quantity. That fails next to a turn, where the flow
    found along the branch is as good: its error counts what the quantity is off, or may be, by how far the flow moves.
    """
    target = float(np.log(value))
    chord = Chord(first, last, in_space=True)
    off = float(first.macroscopic[which]) - target, float(last.macroscopic[which]) - target

    def excess(solution: Solution) -> tuple[float, float]:
        assert solution.response is not None
        return float(solution.macroscopic[which]) - target, float(solution.response[which])

    found = find_zero(chord, excess, Bracket(0.0, 1.0, off[0] / (off[0] - off[1]), off[0]))
    if found is None:
        raise SolveError("a flow was bracketed but not solved: ask for a larger tolerance")
    near = found[1]
    solution = resolve(near, Condition.fix(which, value), tolerance)
    if solution.converged and np.abs(solution.macroscopic - near.macroscopic)[LOG_M:].max() < _AS_FOUND:
        return solution
    return _with_error_of(near, chord, which, abs(float(near.macroscopic[which]) - target))


def _at_turn(turn: Solution, knots: Sequence[Knot], which: int, off: float) -> Solution:
    """The flow at a turn as one whose quantity is ``off`` by no more than rounding."""
    i = next(i for i, knot in enumerate(knots) if knot.exact is turn)
    before, after = knots[i - 1].exact, knots[i + 1].exact
    assert before is not None
    assert after is not None
    return _with_error_of(turn, Chord(before, after, in_space=True), which, off)


def _with_error_of(solution: Solution, chord: Chord, which: int, off: float) -> Solution:
    """A flow of a chord, with the error that it has as one at a value of a quantity that is ``off``."""
    first, second = along(chord, solution)
    off = off + max(solution.error, _FLOOR)
    slope, bend = np.abs([first[which], second[which]])
    with np.errstate(divide="ignore", invalid="ignore"):
        # Where m = m' d + m'' d^2/2 is off, so far is the flow at most.
        far = float(np.fmin(2.0 * off / slope, slope / bend + np.sqrt(2.0 * off / bend)))
    moved = float(np.abs(first[:LOG_T]).max()) * far + 0.5 * float(np.abs(second[:LOG_T]).max()) * far**2
    return replace(solution, error=solution.error + moved, status=Status.CONVERGED)
