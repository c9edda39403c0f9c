"""Branches of flows in a range: found by the grid of trajectories, and solved where they are asked for.

# notation: m the macroscopic quantities (ln Q, ln h, ln M, ln T_surface).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from chuteflow.branches.paths import (
    Chord,
    PathPoint,
    TurningPoint,
    find_value,
    locate_turning_points,
    refine_path,
    solve_point,
)
from chuteflow.branches.ranges import BranchEnd, SearchRange
from chuteflow.branches.results import Cells, Searched
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_M
from chuteflow.steady.model import Model
from chuteflow.steady.solver import TOLERANCE, Condition, Solution, resolve
from chuteflow.trajectories.refining import RoughBranch, TrajectoryGrid, integrate_trajectories

#: Where a first or last rough flow leads nowhere, those so many places further are tried.
_OTHERS = (0, 1, 2, 4, 8, 16)
#: Rough flows closer than this tell no direction; flows are solved at the second spacing, or where the branch has
#: turned by an angle of the cosine.
_TOO_NEAR, _SPACING, _TURNED = 0.015, 0.3, 0.95
#: The same at larger hold-ups: there flows wind, and one between two others is a start only where these are near.
_DEEP, _SPACING_DEEP = 5.0, 0.12
#: Reaches over which the direction of a rough branch is searched for.
_REACHES = (_TOO_NEAR, 0.06, 0.2, 0.5)
#: No flow is solved where a rough branch turns by an angle of a smaller cosine within that distance: its direction
#: there is not known.
_SHARP = 0.8
#: A solved flow lies within this of the rough one, and this fraction of the spacing.
_ROUGH, _ASTRAY = 0.03, 0.3
#: Where a rough quantity comes as near to the requested value, the branch is solved there; and this part of the
#: spacing.
NEAR, _PER_SPACING = 0.005, 0.15
#: So near where the rough quantity turns, since a fold is not known as well; it turns where it is nearest to the value
#: within the second length along the branch, and further away by the third to both sides.
_NEAR_TURN, _AROUND, _RISE = 0.08, 0.15, 0.01
#: A rough branch that is not longer, and as near to another, may be a piece of that one: where the residual is near to
#: zero all along, its signs are not known well enough to join them.
_SHORT, _BESIDE = 0.15, 0.15
#: One flow is solved at once where the quantity changes along the branch by more than the first per length, over at
#: least the second; and there by more than this many times what the rough flow was wrong by.
_STEEP, _OVER, _SURELY = 0.04, 0.1, 8.0
#: Where the flows among rough ones are not found, they are searched for between rough ones so much further away.
_FURTHER = 0.1
#: Where a quantity takes a value is found to this part of its change before it is solved for, where it fixes the flow:
#: where it changes by more than the second along the branch, per length.
_NEARLY, _FIXES = 0.01, 1e-3
#: A rough end is at an edge of the range if it is as near to it in the logarithm.
_AT_EDGE = 1e-6
#: An undecided cell may hide a flow with a value that is as near to its own, in the logarithm.
_HIDDEN = 0.05
#: Points that differ by less are one.
_SAME = 1e-8
#: A point is on a branch that passes it so closely, between points or so far beyond them, in parts of their distance.
_ONE, _BEYOND = 1e-6, 0.01
#: A logarithm that differs by less is at its value.
_ROUNDING = 1e-14
#: Searches whose result is remembered.
_REMEMBERED = 4


@dataclass(frozen=True, eq=False)
class SolutionBranch:
    """A branch of flows in a range: rough flows in order, of which any are solved on request.

    ``macroscopic`` (k, 4) are the rough quantities, to about 1e-3. ``pieces`` are short branches near to this one which
    may belong to it: the place of the nearest rough flow here, and their rough quantities. Such a piece is not
    ``separate``.
    """

    rough: RoughBranch
    within: SearchRange
    pieces: tuple[tuple[int, Array], ...] = ()
    separate: bool = True

    @property
    def macroscopic(self) -> Array:
        """ln Q, ln h, ln M, ln T_surface of the rough flows, (k, 4)."""
        return self.rough.macroscopic

    @cached_property
    def arclength(self) -> Array:
        """Along the rough flows, (k,)."""
        return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(self.macroscopic, axis=0), axis=1)))

    def _direction(self, i: int) -> Array | None:
        """Unit vector (4,) along the branch at rough flow ``i``: over the shortest reach to both sides in which it
        does not turn sharply, since rough flows scatter; None where it does in all."""
        length, m = self.arclength, self.macroscopic
        for reach in _REACHES:
            before = max(int(np.searchsorted(length, length[i] - reach, side="right")) - 1, 0)
            after = min(int(np.searchsorted(length, length[i] + reach, side="left")), len(m) - 1)
            sides = m[i] - m[before], m[after] - m[i]
            sizes = [float(np.linalg.norm(side)) for side in sides]
            chord = sides[0] + sides[1]
            size = float(np.linalg.norm(chord))
            if size > 0.0 and float(sides[0] @ sides[1]) >= _SHARP * sizes[0] * sizes[1]:
                return chord / size
        return None

    def _bend(self, i: int) -> float:
        """How far the rough flow lies beside the chord of its neighbours."""
        m = self.macroscopic
        return float(np.linalg.norm(m[i] - 0.5 * (m[max(i - 1, 0)] + m[min(i + 1, len(m) - 1)])))

    def solved(self, i: int, tolerance: float) -> PathPoint | None:
        """The flow at rough flow ``i``: in the plane normal to the branch, or at the edge of the range. None where it
        is not found near there."""
        weights = self._direction(i)
        if weights is None:
            return None
        value = float(weights @ self.macroscopic[i])
        if i in (0, len(self.macroscopic) - 1) and not self.rough.closed:
            edge = self.within.at_edge(self.macroscopic[i], _AT_EDGE)
            if edge is not None:
                sign = 1.0 if weights[edge[0]] >= 0.0 else -1.0
                weights = np.zeros(4)
                weights[edge[0]], value = sign, sign * edge[1]
        point = solve_point(self.rough.start(i), weights, value, tolerance)
        if point is None or np.linalg.norm(
            point.m - self.macroscopic[i]
        ) > _ROUGH + _ASTRAY * _SPACING_DEEP + self._bend(i):
            return None
        return point

    def _solve_near(self, places: list[int], tolerance: float) -> list[PathPoint]:
        """The flows at some rough ones in order, without those that lead nowhere."""
        found: list[PathPoint] = []
        for i in places:
            # Where one rough flow leads nowhere its neighbour may.
            tries = (self.solved(k, tolerance) for k in (i, i + 1, i - 1) if 0 <= k < len(self.macroscopic))
            point = next((point for point in tries if point is not None), None)
            if point is not None and not (found and _is_behind(point, found[-1])):
                found.append(point)
        return found

    def points(self, begin: int, end: int, which: int, target: float, tolerance: float) -> list[PathPoint]:
        """Points from rough flow ``begin`` to ``end``, or from beyond, as many as it takes to know the branch between
        them. At the first and the last the quantity ``which`` is on the side of ``target`` on which the rough flow has
        it, and goes away from it beyond, so that a fold near to the target lies between; or they are ends of the
        branch, where the rough flow may be on the wrong side.

        Raises:
            SolveError: where the branch could not be followed.
        """

        def tried(places: list[int], outward: float) -> tuple[int, PathPoint]:
            """The first that is on its side, where the quantity goes away from the target outwards; or an end of the
            branch that is on the other side; or one that is on its side at least."""
            second = None
            for i in places:
                point, off = self.solved(i, tolerance), float(self.macroscopic[i, which]) - target
                if point is None:
                    continue
                if (point.m[which] >= target) != (off >= 0.0):
                    if i in (0, whole):
                        return i, point
                    continue
                if outward * point.tangent[which] * (1.0 if off >= 0.0 else -1.0) > 0.0:
                    return i, point
                second = second or (i, point)
            if second is None:
                raise SolveError("a flow seen in the search could not be solved: ask for a larger tolerance")
            return second

        # Outwards, and from an end of the branch inwards.
        whole, middle = len(self.macroscopic) - 1, (begin + end) // 2
        sign = -1 if begin > 0 else 1
        begin, first = tried([i for k in _OTHERS if 0 <= (i := begin + sign * k) <= middle], -1.0)
        sign = 1 if end < whole else -1
        end, last = tried([i for k in _OTHERS if middle < (i := end + sign * k) <= whole], 1.0)
        inner = [
            p for p in self._solve_near(self._choose_spaced(begin, end)[1:-1], tolerance) if not _is_behind(p, first)
        ]
        while inner and _is_behind(last, inner[-1]):
            inner.pop()
        return refine_path([first, *inner, last], tolerance)

    def solved_between(self, begin: int, end: int, tolerance: float) -> list[PathPoint]:
        """Points from about rough flow ``begin`` to ``end``, as many as it takes to know the branch between them.

        Raises:
            SolveError: where the branch could not be followed.
        """
        found = self._solve_near(self._choose_spaced(begin, end), tolerance)
        if len(found) < 2:
            raise SolveError("a branch seen in the search could not be solved: ask for a larger tolerance")
        return refine_path(found, tolerance)

    def traced(self, tolerance: float) -> list[TracedBranch]:
        """The branch in the range solved from end to end: in one piece, or in several where it is lost in between."""
        inside = np.flatnonzero([self.within.contains(m) for m in self.macroscopic])
        if len(inside) < 2:
            return []
        found = self._solve_near(self._choose_spaced(int(inside[0]), int(inside[-1])), tolerance)
        if self.rough.closed and len(inside) == len(self.macroscopic) and found:
            while len(found) > 1 and _is_behind(found[0], found[-1]):
                found.pop()
            found = [*found, found[0]] if len(found) > 2 else []
        pieces: list[list[PathPoint]] = [found[:1]]
        for other in found[1:]:
            try:
                pieces[-1] += refine_path([pieces[-1][-1], other], tolerance)[1:]
            except SolveError:
                pieces.append([other])
        ends: list[str] = [BranchEnd.LOST] * (2 * len(pieces))
        if len(found) > 1 and len(pieces) == 1 and found[0] is found[-1]:
            ends = [BranchEnd.CLOSED, BranchEnd.CLOSED]
        elif found:
            ends[0], ends[-1] = self.within.end_words(found[0].m), self.within.end_words(found[-1].m)
        return [
            TracedBranch(tuple(piece), (begin, end))
            for piece, begin, end in zip(pieces, ends[::2], ends[1::2], strict=True)
            if len(piece) > 1
        ]

    def _choose_spaced(self, begin: int, end: int) -> list[int]:
        """Rough flows from ``begin`` to ``end`` at some distance from each other, closer where the branch turns."""
        length = self.arclength
        spacing = np.where(self.macroscopic[:, LOG_M] > np.log(_DEEP), _SPACING_DEEP, _SPACING)
        least, most = _TOO_NEAR, np.inf
        if self.rough.closed:
            least, most = min(least, length[-1] / 16.0), length[-1] / 8.0
        kept, ahead = [begin], self._direction(begin)
        for i in range(begin + 1, end):
            step = length[i] - length[kept[-1]]
            if step < least:
                continue
            here = self._direction(i)
            if here is not None and (step > min(most, spacing[i]) or ahead is None or float(here @ ahead) < _TURNED):
                kept.append(i)
                ahead = here
        return [*kept, end] if end > begin else kept


@lru_cache(maxsize=_REMEMBERED)
def find_branches(model: Model, within: SearchRange) -> tuple[SolutionBranch, ...]:
    """Every branch of flows in the range, as far as the refinement of the search resolves them."""
    found = [SolutionBranch(branch, within) for branch in search_range(model, within).branches if len(branch) > 1]
    pieces: list[list[tuple[int, Array]]] = [[] for _ in found]
    separate = [True] * len(found)
    for i, short in enumerate(found):
        if short.arclength[-1] > _SHORT:
            continue
        nearest = [
            (float(apart.min()), k, int(apart.min(axis=0).argmin()))
            for k, other in enumerate(found)
            if other.arclength[-1] > _SHORT
            for apart in [np.linalg.norm(short.macroscopic[:, None] - other.macroscopic, axis=-1)]
        ]
        distance, k, place = min(nearest, default=(np.inf, 0, 0))
        if distance < _BESIDE:
            pieces[k].append((place, short.macroscopic))
            separate[i] = False
    return tuple(
        replace(f, pieces=tuple(p), separate=alone) for f, p, alone in zip(found, pieces, separate, strict=True)
    )


def search_range(model: Model, within: SearchRange) -> TrajectoryGrid:
    """The grid of trajectories over the range."""
    return integrate_trajectories(
        model, within.coldest, within.hottest, within.deepest, largest_flux=within.largest_flux
    )


def describe_search(within: SearchRange, grid: TrajectoryGrid) -> Searched:
    """The range searched, and the cells that the search examined."""
    cells = Cells(grid.refinement.delta, grid.cells, len(grid.undecided))
    return Searched((within.coldest, within.hottest), min(within.deepest, grid.deepest), cells)


def explain_incompleteness(
    grid: TrajectoryGrid,
    within: SearchRange,
    lost: list[Array],
    names: tuple[str, str],
    which: int = 0,
    value: float | None = None,
    unsure: Sequence[Array] = (),
) -> str | None:
    """What the search leaves open in the range, in words: what was seen and not solved, with rough quantities ``lost``
    and the ``names`` of one and of several; depths not reached; cells that may hide flows, where a value is given
    only those near it; branches that come as near to the value as they are known, and could not be solved there, with
    rough quantities ``unsure``."""
    if lost:
        one, several = names
        many = f"{len(lost)} {several} were" if len(lost) > 1 else f"{one} was"
        return f"{many} seen and not solved, near {_place(lost[0])}"
    if grid.deepest < within.deepest * (1.0 - 1e-9):
        return f"beyond a hold-up of {grid.deepest:.4g} there are too many flows to search"
    hidden = [m for m in grid.hidden if within.contains(m) and np.isfinite(m).all()]
    if value is not None:
        hidden = [m for m in hidden if abs(m[which] - np.log(value)) < _HIDDEN]
    if hidden:
        return f"the search does not tell flows apart near {_place(hidden[0])}"
    return f"a branch could not be followed near {_place(unsure[0])}, where it may have some" if unsure else None


def _place(macroscopic: Array) -> str:
    mass, temperature = np.exp(macroscopic[LOG_M:])
    return f"M = {mass:.4g} and T_surface = {temperature:.4g}"


def solve_crossings(
    branch: SolutionBranch, which: int, value: float, tolerance: float = TOLERANCE
) -> tuple[list[Solution], list[Array], list[Array]]:
    """The flows of a branch at which the quantity ``which`` equals ``value``; the rough quantities (4,) of those that
    were seen and could not be solved; and those of places that come near to the value where the branch could not be
    solved to tell."""
    target = float(np.log(value))
    m = branch.macroscopic
    off = m[:, which] - target
    near = np.abs(off) < _doubt_of(off, branch.arclength)
    changes = np.flatnonzero((off[1:] >= 0.0) != (off[:-1] >= 0.0))
    near[changes] = near[changes + 1] = True
    near[_turns_near(off, branch.arclength)] = True
    crossed: list[tuple[int, Array]] = []
    for place, piece in branch.pieces:
        there = piece[:, which] - target
        if np.abs(there).min() < _NEAR_TURN or (there >= 0.0).any() != (off[place] >= 0.0):
            near[place] = True
        if (there >= 0.0).any() and (there < 0.0).any():
            crossed.append((place, piece))
    found: list[Solution] = []
    lost: list[Array] = []
    unsure: list[Array] = []
    for begin, end in _runs(near, branch.arclength):
        single = _solve_single(branch, which, target, off, begin, end, tolerance)
        solved = [single] if single is not None else _solve_among(branch, which, target, begin, end, tolerance)
        if solved is None:
            if branch.separate:
                lost += [m[i] for i in changes.tolist() if begin <= i < end]
                unsure.append(m[begin + int(np.abs(off[begin : end + 1]).argmin())])
            lost += [piece[len(piece) // 2] for place, piece in crossed if begin <= place <= end]
        found += solved or []
    return found, lost, unsure


def _doubt_of(off: Array, arclength: Array) -> Array:
    """By how much a rough quantity (k,) may be wrong at its places, and reach further between them: most where it
    turns before it is zero, since the fold lies between two places."""
    steps, lengths = np.diff(off), np.maximum(np.diff(arclength), 1e-300)
    spacing = np.maximum(np.append(0.0, lengths), np.append(lengths, 0.0))
    bend = np.abs(np.diff(off, 2, prepend=off[0], append=off[-1]))
    slope = np.concatenate([[0.0, 0.0], np.abs(steps) / lengths, [0.0, 0.0]])
    steepest = np.max([slope[i : i + len(off)] for i in range(4)], axis=0)
    away = np.diff(np.abs(off)) >= 0.0
    turns = np.concatenate([[False], away[1:] & ~away[:-1], [False]])
    bends = np.maximum(np.maximum(bend, np.roll(bend, 1)), np.roll(bend, -1))
    return NEAR + _PER_SPACING * spacing + bends + np.where(turns, steepest * spacing, 0.0)


def _turns_near(off: Array, arclength: Array) -> list[int]:
    """Rough flows at which a quantity comes nearest to its value without passing it, and turns."""
    away = np.abs(off)
    found = []
    for i in (np.flatnonzero(away[1:-1] < _NEAR_TURN) + 1).tolist():
        first = int(np.searchsorted(arclength, arclength[i] - _AROUND))
        last = int(np.searchsorted(arclength, arclength[i] + _AROUND, side="right"))
        before, after = away[first:i], away[i + 1 : last]
        least = min(before.min(initial=np.inf), after.min(initial=np.inf))
        crossed = (off[i - 1] >= 0.0) != (off[i] >= 0.0) or (off[i] >= 0.0) != (off[i + 1] >= 0.0)
        if not crossed and least >= away[i] and min(before.max(initial=0.0), after.max(initial=0.0)) > away[i] + _RISE:
            found.append(i)
    return found


def _is_behind(point: PathPoint, last: PathPoint) -> bool:
    """Whether a point is the last one, or so close that the roughness of the search put it behind."""
    step = point.m - last.m
    length = float(np.linalg.norm(step))
    ahead, alike = float(step @ last.tangent), float(point.tangent @ last.tangent)
    if length < 0.5 * _TOO_NEAR:
        return length < _SAME or ahead < 0.5 * length
    # On the same side of the branch, and further back on it.
    return length < _SPACING_DEEP and ahead < 0.0 and alike > _SHARP


def _runs(marked: NDArray[np.bool_], arclength: Array) -> list[tuple[int, int]]:
    """First and last places of the runs of marked ones, each with neighbours to either side."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(int)))
    runs: list[tuple[int, int]] = []
    for first, last in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
        begin = max(int(np.searchsorted(arclength, arclength[first] - _TOO_NEAR, side="right")) - 1, 0)
        end = min(int(np.searchsorted(arclength, arclength[last] + _TOO_NEAR, side="left")), len(marked) - 1)
        if runs and begin <= runs[-1][1]:
            runs[-1] = (runs[-1][0], end)
        else:
            runs.append((begin, end))
    return runs


def _solve_single(
    branch: SolutionBranch, which: int, target: float, off: Array, begin: int, end: int, tolerance: float
) -> Solution | None:
    """The one flow among rough flows along which the quantity rises or falls steeply; None where it may turn."""
    change = np.flatnonzero((off[begin:end] >= 0.0) != (off[begin + 1 : end + 1] >= 0.0))
    slopes = _slopes(off, branch.arclength, begin, end)
    if len(change) != 1 or not (np.abs(slopes) > _STEEP).all() or not ((slopes > 0.0).all() or (slopes < 0.0).all()):
        return None
    i = begin + int(change[0])
    nearer = i if abs(off[i]) < abs(off[i + 1]) else i + 1
    weights = np.zeros(4)
    weights[which] = 1.0
    point = solve_point(branch.rough.start(nearer), weights, target, tolerance)
    if point is None or abs(point.tangent[which]) < 0.5 * np.abs(slopes).min():
        return None
    fraction = off[i] / (off[i] - off[i + 1])
    there = branch.macroscopic[i] + fraction * (branch.macroscopic[i + 1] - branch.macroscopic[i])
    spacing = branch.arclength[i + 1] - branch.arclength[i]
    wrong = float(np.linalg.norm(point.m - there))
    sure = wrong < _ROUGH + _ASTRAY * spacing and np.abs(slopes).min() * max(_OVER, spacing) > _SURELY * abs(
        float((point.m - there)[which] - point.tangent[which] * ((point.m - there) @ point.tangent))
    )
    return point.solution if sure else None


def _slopes(off: Array, arclength: Array, begin: int, end: int) -> Array:
    """Of a quantity along the branch at places from ``begin`` to ``end``, between neighbours that are not too near."""
    places = np.arange(begin, end + 1)
    before = np.maximum(np.searchsorted(arclength, arclength[places] - 0.5 * _OVER, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(arclength, arclength[places] + 0.5 * _OVER), len(off) - 1)
    return (off[after] - off[before]) / np.maximum(arclength[after] - arclength[before], 1e-300)


def _solve_among(
    branch: SolutionBranch, which: int, target: float, begin: int, end: int, tolerance: float
) -> list[Solution] | None:
    """The flows among rough ones, by solving the branch between them: its turning points part it into monotonic
    pieces. None where they are not found."""
    length = branch.arclength
    for _ in range(2):
        try:
            points = branch.points(begin, end, which, target, tolerance)
            return _on_path(points, which, target, tolerance)
        except SolveError:
            begin = max(int(np.searchsorted(length, length[begin] - _FURTHER)) - 1, 0)
            end = min(int(np.searchsorted(length, length[end] + _FURTHER)), len(length) - 1)
    return None


def _on_path(points: list[PathPoint], which: int, target: float, tolerance: float) -> list[Solution]:
    """The flows on a path of solved points at which a quantity takes a value."""
    placed = [(float(i), point) for i, point in enumerate(points)]
    turning = locate_turning_points(points, which, tolerance)
    placed += [(turn.place, turn.point) for turn in turning]
    placed.sort(key=lambda pair: pair[0])
    along = [point for _, point in placed]
    off = np.array([float(point.m[which]) - target for point in along])
    crossed = np.flatnonzero((off[1:] >= 0.0) != (off[:-1] >= 0.0)).tolist()
    found = []
    for first, last in _level(along, off):
        # The flow is anywhere on this piece.
        there = [i for i in crossed if first <= i < last]
        if not there and np.abs(off[first : last + 1]).min() > _ROUNDING:
            continue
        crossed = [i for i in crossed if i not in there]
        chords = [Chord(along[i], along[i + 1], tolerance) for i in there[:1]]
        solution = _between(chords[0], which, target) if chords else along[(first + last) // 2].solution
        reach = max(float(np.linalg.norm(along[k].m - solution.macroscopic)) for k in (first, last))
        found.append(replace(solution, error=max(solution.error, reach)))
    found += [_between(Chord(along[i], along[i + 1], tolerance), which, target) for i in crossed]
    for turn in turning:
        # A fold that is at the value to its error is one flow, unless two were found beside it.
        near = turn.point.solution
        close = abs(float(turn.point.m[which]) - target) <= near.error
        reach = 2.0 * float(np.sqrt(near.error))
        if close and not any(np.linalg.norm(s.macroscopic - near.macroscopic) < reach for s in found):
            found.append(_at_fold(near))
    return found


def _level(along: list[PathPoint], off: Array) -> list[tuple[int, int]]:
    """The first and last points of the pieces on which a quantity, given how far it is ``off`` its value, is at that
    value to the error of the flows at more than one point."""
    at_value = np.abs(off) <= max(point.solution.error for point in along)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_value, [False]]).astype(int)))
    return [
        (max(first - 1, 0), min(end, len(along) - 1))
        for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
        if end - first > 1
    ]


def _at_fold(near: Solution) -> Solution:
    """A flow at a fold in the requested quantity: there the others are known to the root of the error."""
    return Solution(near.macroscopic, float(np.sqrt(near.error)), near.status, near.source, near.rates)


def _between(chord: Chord, which: int, target: float) -> Solution:
    """The flow on a chord at which a quantity takes a value: at the value itself, where that fixes it, else in the
    plane across the branch, with an error that says what the difference may do to the other quantities."""
    _, point = find_value(chord, which, target, _NEARLY)
    if abs(point.tangent[which]) > _FIXES:
        fixed = resolve(point.solution, Condition.fix(which, float(np.exp(target))), chord.tolerance)
        moved = float(np.linalg.norm(fixed.macroscopic - point.m))
        if fixed.converged and moved < chord.length and 0.0 <= chord.place(fixed.macroscopic) <= 1.0:
            return fixed
    _, point = find_value(chord, which, target, 0.0)
    near, tangent = point.solution, abs(float(point.tangent[which]))
    error = near.error / max(tangent, float(np.sqrt(near.error)))
    return Solution(near.macroscopic, error, near.status, near.source, near.rates)


@dataclass(frozen=True, eq=False)
class TracedBranch:
    """A branch as far as it goes within a range: solved ``points`` in order, which suffice to know it between them.

    ``ends`` says in words why it ends at either side; a loop ends with its first flow.
    """

    points: tuple[PathPoint, ...]
    ends: tuple[str, str]

    @property
    def solutions(self) -> tuple[Solution, ...]:
        """The flows of the points."""
        return tuple(point.solution for point in self.points)

    @cached_property
    def macroscopic(self) -> Array:
        """ln Q, ln h, ln M, ln T_surface of the flows, (k, 4)."""
        return np.array([point.m for point in self.points])

    @cached_property
    def arclength(self) -> Array:
        """In the space of the macroscopic quantities from the first flow, by chords, (k,)."""
        return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(self.macroscopic, axis=0), axis=1)))

    def turns(self, which: int, tolerance: float) -> list[TurningPoint]:
        """The points at which a quantity turns."""
        return locate_turning_points(self.points, which, tolerance)

    def passes(self, piece: TracedBranch, tolerance: float) -> bool:
        """Whether the middle point of a short piece lies on the branch."""
        m = piece.points[len(piece.points) // 2].m
        for first, last in pairwise(self.points):
            chord = Chord(first, last, tolerance)
            sigma = chord.place(m)
            if -_BEYOND < sigma < 1.0 + _BEYOND and np.linalg.norm(chord.first.m - m) < 2.0 * chord.length:
                point = chord.at(sigma)
                if point is not None and np.linalg.norm(point.m - m) < _ONE:
                    return True
        return False

    def at(self, places: Array, tolerance: float) -> list[PathPoint]:
        """Points at ``places`` of the arclength, or the nearest that are known where there none could be solved."""
        index = np.clip(np.searchsorted(self.arclength, places, side="right") - 1, 0, len(self.points) - 2)
        out = []
        for i, place in zip(index.tolist(), places.tolist(), strict=True):
            chord = Chord(self.points[i], self.points[i + 1], tolerance)
            sigma = (place - float(self.arclength[i])) / chord.length
            point = chord.at(sigma)
            if point is None:
                # The nearer of the points that are known is as good to draw.
                point = chord.first if sigma < 0.5 else chord.last
            out.append(point if point.tangent @ chord.direction > 0.0 else point.reversed())
        return out


def trace_branches(model: Model, within: SearchRange, tolerance: float = 1e-8) -> list[TracedBranch]:
    """Every branch of flows in the range, solved from end to end."""
    return trace_all(model, within, tolerance)[0]


def trace_all(model: Model, within: SearchRange, tolerance: float) -> tuple[list[TracedBranch], list[Array]]:
    """The same, and rough quantities (4,) on those branches that were seen and could not be solved."""
    found: list[TracedBranch] = []
    lost: list[Array] = []
    # Short pieces beside other branches come last: what is traced from them may be a part of these.
    for branch in sorted(find_branches(model, within), key=lambda branch: not branch.separate):
        pieces = branch.traced(tolerance)
        if not branch.separate:
            pieces = [piece for piece in pieces if not any(other.passes(piece, tolerance) for other in found)]
        found += pieces
        inside = [m for m in branch.macroscopic if within.contains(m)]
        if len(inside) > 1 and not pieces and branch.separate:
            lost.append(inside[len(inside) // 2])
    return found, lost
