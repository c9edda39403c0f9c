"""Families of flows: the zero set of the base condition on a grid of trajectories.

# notation: B = y - base(nu), the heat flux of a trajectory less that which a base there would give.

All flows of a chute in a range of surface temperatures and hold-ups are the zeros of the one function
B(T_surface, p). Its zero set on the structured grid of :mod:`chuteflow.analysis.trajectories` is traced cell
by cell (marching squares). Where neighbouring trajectories tear apart (one turns hot, one cold), the zero set
between them runs to large hold-ups, closer to the dividing trajectory than any grid: a chain is cut there,
and its family is followed by continuation instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from chuteflow.analysis.crossings import Knot, solved
from chuteflow.analysis.ranges import Range
from chuteflow.analysis.tracing import TracedFamily, solved_together, traced
from chuteflow.analysis.trajectories import LOG_EMPTY, STEP, Trajectories, integrate, scan_table, surface_potential
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_M, Collocation
from chuteflow.steady.model import CONDUCTION, Model
from chuteflow.steady.solver import default_stretch

#: Columns per decade of surface temperature, and the fewest.
COLUMNS_PER_DECADE, FEWEST_COLUMNS = 12, 25
#: Neighbouring columns are torn apart where ln x differs by more than this times ln T_surface.
TORN = 5.0
#: Families traced at most: in a narrow window of slopes their number grows with the hold-up without bound.
MOST_TRACED = 16
#: Columns put into a gap between columns that are torn apart, and how often the gap of a dividing trajectory is parted.
_COLUMNS_IN_GAP, _PARTINGS = 8, 3
#: Searches whose result is remembered.
_REMEMBERED = 4


@dataclass(frozen=True, eq=False)
class Family:
    """A family of flows as ``knots`` in order: rough flows, or solved ones where it was ``traced``."""

    knots: tuple[Knot, ...]
    traced: bool

    @cached_property
    def macroscopic(self) -> Array:
        """ln Q, ln h, ln M, ln T_surface of the knots, (k, 4)."""
        return np.array([knot.macroscopic for knot in self.knots])


@lru_cache(maxsize=_REMEMBERED)
def families(model: Model, within: Range, resolved_to: float = 0.0) -> tuple[Family, ...]:
    """Every family of flows in the range: as chains of rough flows, or traced where a chain is torn.

    Those of the last few chutes are remembered: one asks for other flows of the same chute next.

    Raises:
        SolveError: where the finest grid does not resolve one up to the hold-up ``resolved_to``, or one could not be
            entered, or too many would have to be traced.
    """
    whole: list[Family] = []
    torn: list[TracedFamily] = []
    for scene, chain in chains(model, within):
        knots = scene.knots(chain)
        if chain.torn:
            _add_solved(knots, within, torn, whole=False)
            lost = float(np.exp(min((family.lost for family in torn), default=np.inf)))
            if lost < resolved_to:
                raise SolveError(
                    f"a family of deep flows is too sharp for the finest grid beyond a hold-up of {lost:.4g}: "
                    "ask for a smaller one"
                )
        else:
            whole.append(Family(tuple(knots), False))
    return (*whole, *(Family(tuple(map(Knot.at, t.solutions)), True) for t in torn))


def traced_families(model: Model, within: Range) -> list[TracedFamily]:
    """Every family of flows in the range, solved from end to end."""
    found: list[TracedFamily] = []
    for scene, chain in chains(model, within):
        _add_solved(scene.knots(chain), within, found, whole=not chain.torn)
    return found


def _add_solved(knots: list[Knot], within: Range, found: list[TracedFamily], *, whole: bool) -> None:
    """Add the family of the rough flows ``knots`` to ``found``, unless it is there already: solved side by side where
    they are the ``whole`` of it, else followed from one of them."""
    if len(found) == MOST_TRACED:
        raise SolveError(
            f"this chute has more than {MOST_TRACED} families of deep flows up to a hold-up of {within.deepest:g}: "
            "search to a smaller one"
        )
    together = solved_together(knots, within) if whole else None
    if together is not None:
        if not any(family.holds(together.solutions[len(together.solutions) // 2]) for family in found):
            found.append(together)
        return
    for i in _from_middle(len(knots)):
        solution, ahead = solved(knots, i)
        if solution.converged:
            if not any(family.holds(solution) for family in found):
                family = traced(solution, ahead, within)
                # Of a family that only touches the range there is one flow, at its edge.
                if len(family.solutions) > 1:
                    found.append(family)
            return
    # Of a family that is known, a piece torn off may be too rough to lead back to it.
    if not any(family.passes(knots) for family in found):
        raise SolveError("a family seen in the search could not be entered: narrow the range searched")


def _from_middle(count: int) -> list[int]:
    return sorted(range(count), key=lambda i: abs(i - count // 2))


@dataclass(frozen=True, eq=False)
class Chain:
    """Rough flows in order along a family: ``column`` and ``row`` (fractional) on the grid of trajectories,
    and ``macroscopic`` (k, 4), ln Q, ln h, ln M, ln T_surface. ``torn`` tells whether an end was cut."""

    column: Array
    row: Array
    macroscopic: Array
    torn: bool

    def __len__(self) -> int:
        return len(self.column)


@dataclass(frozen=True, eq=False)
class Landscape:
    """A grid of trajectories with the integrals of the flows that would end at each point of it.

    ``excess`` (K, C) is B; ``macroscopic`` (K, C, 4) would hold if the base were there.
    """

    trajectories: Trajectories
    excess: Array
    macroscopic: Array

    @property
    def model(self) -> Model:
        """The problem whose trajectories these are."""
        return self.trajectories.model

    def knots(self, chain: Chain) -> list[Knot]:
        """The rough flows of a chain."""
        return [
            Knot(m, partial(self.start, float(c), float(r), float(m[LOG_M])))
            for c, r, m in zip(chain.column, chain.row, chain.macroscopic, strict=True)
        ]

    def start(self, column: float, row: float, log_mass: float, degree: int) -> tuple[Collocation, Array]:
        """A starting point for the solver: the nearest trajectory, ended at ``log_mass``."""
        t, model = self.trajectories, self.model
        c = round(column)
        stop = int(min(t.last[c], np.ceil(row) + 1)) + 1
        p, big_l, y = t.p[:stop, c], t.big_l[:stop, c], t.y[:stop, c]
        fine = np.isfinite(y)
        p, big_l, y = p[fine], big_l[fine], y[fine]
        mass = float(np.exp(log_mass))
        problem = Collocation(model, degree, default_stretch(model, mass, float(t.temperature[c])))
        at = model.surface_stress + mass * problem.share[0]
        tau, knots = t.tau(np.maximum(at, p[0])), t.tau(p)
        log_x = np.interp(tau, knots, big_l) + np.minimum(np.log(np.maximum(at, 1e-300) / p[0]), 0.0)
        flux = np.interp(tau, knots, y / p) * at
        f, _ = model.closures(np.exp(log_x))
        potential = surface_potential(model, t.temperature[c : c + 1])[0]
        return problem, np.concatenate([mass * flux / f[CONDUCTION], [potential, log_mass]])


@lru_cache(maxsize=_REMEMBERED)
def chains(model: Model, within: Range) -> tuple[tuple[Landscape, Chain], ...]:
    """The zero set of the excess in a range as chains of rough flows, longest first, each with its landscape.

    A family may live between two columns alone that are torn apart. Zeros of the excess tell where they are, and so do
    neighbouring trajectories that end in different ways: deep families lie close to the one that divides them. Such a
    gap gets a landscape of its own, of which the lines within it are new; those that reach its sides are known.
    """
    scene = landscape(model, temperatures(within.coldest, within.hottest), within.deepest)
    lines = _lines(scene)
    found = [(scene, chain) for line in lines for chain in _cut(scene, line)]
    torn = {int(column) for line in lines for column in line[_torn(scene, line), 0]}
    t = scene.trajectories
    for part in _within_gaps(t, sorted(torn | _dividing(t)), within.deepest):
        sides = 0, len(part.trajectories.temperature) - 1
        for line in _lines(part):
            if sides[0] < line[:, 0].min() and line[:, 0].max() < sides[1]:
                found += [(part, chain) for chain in _cut(part, line)]
    return tuple(sorted(found, key=lambda pair: len(pair[1]), reverse=True))


def _within_gaps(t: Trajectories, gaps: Sequence[int], mass: float) -> list[Landscape]:
    """The landscape of each gap after a column, with more columns beside trajectories that divide."""
    parts = _integrated(t.model, [_spread(t.temperature, gap) for gap in gaps], mass)
    for _ in range(1, _PARTINGS):
        dividing = [sorted(_dividing(part)) for part in parts]
        wanted = [
            np.concatenate([_spread(part.temperature, i)[1:-1] for i in inside]) if inside else np.zeros(0)
            for part, inside in zip(parts, dividing, strict=True)
        ]
        finer = _integrated(t.model, wanted, mass)
        if not finer:
            break
        parts = [part.joined(more) if len(more.temperature) else part for part, more in zip(parts, finer, strict=True)]
    return [_landscape(part) for part in parts]


def _integrated(model: Model, wanted: Sequence[Array], mass: float) -> list[Trajectories]:
    """Trajectories at each set of surface temperatures, integrated side by side at little more than the cost of one."""
    if not sum(map(len, wanted)):
        return []
    every = integrate(model, np.concatenate(wanted), mass)
    ends = np.cumsum([len(part) for part in wanted]).tolist()
    return [every.columns(slice(end - len(part), end)) for part, end in zip(wanted, ends, strict=True)]


def _spread(temperature: Array, gap: int) -> Array:
    """Columns across a gap, its sides among them."""
    return np.geomspace(temperature[gap], temperature[gap + 1], _COLUMNS_IN_GAP + 2)


def _dividing(t: Trajectories) -> set[int]:
    """The gaps between neighbouring trajectories that end in different ways (cold, hot, or at the largest hold-up)
    and are torn apart."""
    columns = np.arange(len(t.temperature))
    cold = np.isneginf(t.y[t.last, columns])
    hot = ~cold & (t.big_l[t.last, columns] < LOG_EMPTY)
    differ = (cold[1:] != cold[:-1]) | (hot[1:] != hot[:-1])
    row = np.minimum(t.last[1:], t.last[:-1])
    apart = np.abs(t.big_l[row, columns[1:]] - t.big_l[row, columns[:-1]]) > TORN * np.diff(np.log(t.temperature))
    return set(np.flatnonzero(differ & (apart | cold[1:] | cold[:-1])).tolist())


def landscape(model: Model, temperature: Array, mass: float) -> Landscape:
    """The landscape of ``model`` over surface temperatures (C,) ascending and hold-ups up to ``mass``."""
    return _landscape(integrate(model, temperature, mass))


def _landscape(t: Trajectories) -> Landscape:
    base, *fields = scan_table(t.model).at(t.big_l)
    return Landscape(t, t.y - base, _integrals(t, *fields))


def temperatures(low: float, high: float) -> Array:
    """Columns from ``low`` to ``high``, evenly in the logarithm."""
    decades = np.log10(high / low)
    return np.geomspace(low, high, max(FEWEST_COLUMNS, int(np.ceil(COLUMNS_PER_DECADE * decades)) + 1))


def _integrals(t: Trajectories, work: Array, density: Array, gamma: Array, slip: Array) -> Array:
    """ln Q, ln h, ln M, ln T_surface on the grid."""
    model = t.model
    over = t.p - model.surface_stress
    root_t = np.sqrt(t.p * np.exp(gamma - t.big_l))
    pace = t.p / (1.0 + t.p / t.p1)  # dp/dtau
    lever = over * np.exp(-t.big_l - density)
    shear = over * work * model.slope * root_t
    # Close to the surface T is uniform, and nu uniform at an interface or proportional to p on the half-line.
    heights = lever * over * (0.5 if model.surface_stress else 1.0)
    glide = 0.5 * shear * over
    below = t.thin
    heights[below:] = heights[below] + _running((lever * pace)[below:])
    glide[below:] = glide[below] + _running((shear * pace)[below:])
    tiny = np.finfo(float).tiny
    flux = np.maximum(slip * root_t * over + glide, tiny)
    log_m = np.log(over)
    log_t = np.broadcast_to(np.log(t.temperature), over.shape)
    return np.stack([np.log(flux), np.log(np.maximum(heights, tiny)) - log_m, log_m, log_t], axis=-1)


def _running(rate: Array) -> Array:
    """Integrals over tau from the first row: of cubics through four rows, at the ends of lines."""
    steps = 0.5 * (rate[1:] + rate[:-1])
    steps[1:-1] += (rate[1:-2] + rate[2:-1] - rate[:-3] - rate[3:]) / 24.0
    total = np.zeros_like(rate)
    np.cumsum(STEP * steps, axis=0, out=total[1:])
    return total


def _lines(scene: Landscape) -> list[Array]:
    """The zero set of the excess, each line (k, 2) of columns and rows."""
    size = float(np.abs(scan_table(scene.model).fields[0]).max()) + 1e-3
    excess = np.maximum(scene.excess, -1e6 * size)
    last = np.array(excess.shape[::-1]) - 1.0
    lines = contour_generator(z=excess / (size + np.abs(excess))).lines(0.0)
    return [np.minimum(np.asarray(line), last) for line in lines]


def _torn(scene: Landscape, line: Array) -> NDArray[np.bool_]:
    """Where a line runs between trajectories that are torn apart."""
    t = scene.trajectories
    left, row = np.floor(line[:, 0]).astype(np.intp), np.floor(line[:, 1]).astype(np.intp)
    right = np.ceil(line[:, 0]).astype(np.intp)
    spacing = TORN * np.log(t.temperature[right] / t.temperature[left])
    apart = np.abs(t.big_l[row, left] - t.big_l[row, right]) > spacing
    cold = np.isfinite(t.y[row, left]) != np.isfinite(t.y[row, right])
    return (left != right) & (apart | cold)


def _cut(scene: Landscape, line: Array) -> list[Chain]:
    """Split a line where it runs between trajectories that are torn apart, or beyond their end."""
    t = scene.trajectories
    column, row = line.T
    last = np.minimum(t.last[np.floor(column).astype(np.intp)], t.last[np.ceil(column).astype(np.intp)])
    good = ~_torn(scene, line) & (row <= last)
    if not good.all() and np.all(line[0] == line[-1]):
        # A loop is opened where it is cut.
        shift = int(np.argmin(good))
        order = np.roll(np.arange(len(line) - 1), -shift)
        column, row, good = column[order], row[order], good[order]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    out = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        part = slice(first, last)
        out.append(
            Chain(
                column[part],
                row[part],
                _at(scene, column[part], row[part]),
                bool(first > 0 or last < len(good)),
            )
        )
    return out


def _at(scene: Landscape, column: Array, row: Array) -> Array:
    """Macroscopic quantities at fractional grid positions, linear along the one fractional direction."""
    m = scene.macroscopic
    left, upper = np.floor(column).astype(int), np.floor(row).astype(int)
    right, lower = np.ceil(column).astype(int), np.ceil(row).astype(int)
    share_c, share_r = (column - left)[:, None], (row - upper)[:, None]
    across = (1.0 - share_c) * m[upper, left] + share_c * m[upper, right]
    return across + share_r * (m[lower, left] - m[upper, left])
