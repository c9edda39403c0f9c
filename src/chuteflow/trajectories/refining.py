"""The grid of trajectories that refines itself, and the rough branches of flows that it shows.

# notation: P overburden, L = ln x, y heat flux over p sqrt(T), B the residual of the base condition.

All flows of a chute in a range of surface temperatures and hold-ups are the zeros of one function B(T_surface, P). At
each depth the states (L, y) of all trajectories form a curve, labelled by the surface temperature. It is integrated
downwards. Where it stretches, trajectories are inserted at that depth, so that flows whose surface temperatures differ
by less than rounding are still resolved. A part of the curve is dropped only where it lies in a region that no
trajectory leaves, and in which B has one sign (:func:`chuteflow.trajectories.kernel.find_region`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import stretch_map, stretch_position
from chuteflow.steady.elements import Elements
from chuteflow.steady.model import GAMMA, Model
from chuteflow.steady.solver import default_stretch
from chuteflow.trajectories import kernel
from chuteflow.trajectories.kernel import S_G, S_H, S_L, S_T
from chuteflow.trajectories.surface import surface_potential
from chuteflow.trajectories.tables import BASE, ENTRIES, base_table, bounds_for, tables

Index = NDArray[np.int64]


@dataclass(frozen=True)
class Refinement:
    """How finely trajectories are followed.

    Attributes:
        delta: largest distance of neighbours in the plane of ln x and heat flux (in units of its scale); a larger
            one misses flows that lie closer together.
        finest: smallest distance at which a neighbour is inserted where the residual of the base condition turns
            towards zero between two; a larger one misses pairs of flows beside a fold.
        per_decade: trajectories per decade of surface temperature at the surface.
        step: step in tau = ln P + P/p_1; larger ones are less accurate.
        lengths: largest step in P, as a multiple of the shortest length scale of the equations.
        most: largest number of states kept, 48 bytes each. Where more are needed, the search ends at the depth reached,
            and says so.
    """

    delta: float = 0.2
    finest: float = 0.0125
    per_decade: float = 12.0
    step: float = 0.25
    lengths: float = 0.3
    most: int = 1_200_000


#: The refinement of every search by default.
REFINEMENT = Refinement()
#: The least overburden: of all, and at the interface.
_LEAST, _LEAST_AT_INTERFACE = 1e-14, 5e-10
#: The layer below a free surface in which the states are expanded in P reaches to this fraction of the shortest length
#: of the equations. Above it a rough flow is known at overburdens from this fraction of T, at this step in ln P.
_LAYER, _SURFACE, _SURFACE_STEP = 0.2, 0.05, 0.5


@dataclass(frozen=True, eq=False)
class RoughBranch:
    """The zeros of B along one branch of flows: their places (k,) among those of ``grid``, and their ``macroscopic``
    quantities ln Q, ln h, ln M, ln T_surface (k, 4), to about 1e-3. Where it is ``closed`` the last is the first."""

    grid: TrajectoryGrid
    zeros: Index
    macroscopic: Array
    closed: bool

    def __len__(self) -> int:
        return len(self.zeros)

    def start(self, i: int) -> Elements:
        """Where Newton's method may start from for the flow at place ``i``."""
        return self.grid.start(int(self.zeros[i]))


@dataclass(frozen=True, eq=False)
class TrajectoryGrid:
    """The trajectories of one chute at depths ``overburden`` (R,), and the zeros of B on them.

    ``states`` (N, 5) hold L, y, ln T_surface and the integrals of P dz and P du, one depth step after the other in the
    order of the curve; ``first`` (R + 1,) are the first of each step; ``came_from`` (N,) the place of the same
    trajectory in the step before, between two states where it was inserted; ``goes_on`` (N,) is whether the curve
    goes on to the next state. ``values`` (entries, 7) are the functions of L in their equations, ``bounds`` (entries,
    12) their extrema, ``layer`` (entries, 7) the expansion near a free surface, and ``scale`` the size of heat fluxes.
    They hold for every base between those for which parts were kept: :meth:`of_base` has the zeros of another.
    ``zeros`` (Z, 3) are the two states between which B vanishes, and the fraction of the way; ``links`` (Z, 2)
    are their neighbours along the branches. Of the ``cells`` between neighbours that were examined, ``undecided`` (U,)
    are the first states of those that may hide zeros: they are shorter than ``finest`` and B turns towards zero in
    them, or they are too long. ``complete`` is whether the curve was integrated to the last depth.
    """

    model: Model
    refinement: Refinement
    overburden: Array
    states: Array
    came_from: Array
    goes_on: NDArray[np.bool_]
    first: Index
    values: Array
    bounds: Array
    layer: Array
    scale: float
    zeros: Array
    links: Index
    cells: int
    undecided: Index
    complete: bool

    def of_base(self, problem: Model) -> TrajectoryGrid:
        """The same trajectories with the zeros of B for the base of ``problem``."""
        zeros, links = kernel.find_zeros(base_table(problem), 0, self.states, self.came_from, self.goes_on, self.first)
        return replace(self, model=problem, zeros=zeros, links=links)

    @property
    def deepest(self) -> float:
        """The overburden down to which the curve was integrated."""
        if self.complete:
            return float(self.overburden[-1])
        return float(self.overburden[max(int(np.searchsorted(self.first, len(self.states), side="left")) - 1, 0)])

    def steps_of(self, places: Index) -> Index:
        """The depth steps that states belong to."""
        return np.searchsorted(self.first, places, side="right") - 1

    @cached_property
    def macroscopic(self) -> Array:
        """ln Q, ln h, ln M, ln T_surface at the zeros, (Z, 4)."""
        values = self.quantities(self.zeros[:, :2].astype(np.int64))
        return values[:, 0] + self.zeros[:, 2:] * (values[:, 1] - values[:, 0])

    @cached_property
    def hidden(self) -> Array:
        """ln Q, ln h, ln M, ln T_surface of the flows that undecided cells may hide, roughly, (U, 4)."""
        return self.quantities(self.undecided)

    def quantities(self, places: Index) -> Array:
        """ln Q, ln h, ln M, ln T_surface of flows that had their base at states, (..., 4)."""
        model, state = self.model, self.states[places]
        over = self.overburden[self.steps_of(places)]
        f, _ = model.closures(np.exp(state[..., S_L]))
        root_t = np.exp(0.5 * (np.log(over + model.surface_stress) + f[GAMMA] - state[..., S_L]))
        flux = model.slip(f) * root_t * over + state[..., S_G]
        return np.stack([np.log(flux), np.log(state[..., S_H] / over), np.log(over), state[..., S_T]], axis=-1)

    @cached_property
    def branches(self) -> tuple[RoughBranch, ...]:
        """The branches of flows, the longest first."""
        return tuple(RoughBranch(self, zeros, self.macroscopic[zeros], closed) for zeros, closed in self.lines)

    @cached_property
    def lines(self) -> tuple[tuple[Index, bool], ...]:
        """The zeros in order along each branch of flows, the longest first, and whether it is closed: then the last is
        the first."""
        order, starts = kernel.order_zeros(self.links)
        found = []
        for begin, end in pairwise(starts.tolist()):
            zeros = order[begin:end]
            closed = bool(len(zeros) > 2 and self.links[zeros[0], 1] >= 0)
            found.append((np.append(zeros, zeros[0]) if closed else zeros, closed))
        return tuple(sorted(found, key=lambda line: len(line[0]), reverse=True))

    def start(self, zero: int) -> Elements:
        """The rough flow at a zero, on elements."""
        model = self.model
        one, other, fraction = int(self.zeros[zero, 0]), int(self.zeros[zero, 1]), float(self.zeros[zero, 2])
        steps = self.steps_of(np.array([one, other]))
        place = one + fraction if steps[0] == steps[1] else float(other)
        back = kernel.trace_back(self.states, self.came_from, place, int(steps[1]))
        log_mass, log_t = self.macroscopic[zero, 2:]
        mass, temperature = float(np.exp(log_mass)), float(np.exp(log_t))
        over = self.overburden[: len(back)]
        surface = float(surface_potential(model, np.array([temperature]))[0])
        if model.surface_stress == 0.0:
            above = _above(float(over[0]), temperature ** (1.0 / (1.0 + model.beta)))
            back = np.concatenate([kernel.states_in_layer(self.values, self.layer, above, surface), back])
            over = np.concatenate([above, over])
        theta = (1.0 + model.beta) * np.log(over + model.surface_stress) - back[:, 0]
        per_mass = (back[:, 1] - model.surface_flux) / over
        log_over = np.log(over)
        stretch = default_stretch(model, mass, temperature)

        def values(s: Array) -> Array:
            m, _ = stretch_map(s, stretch)
            at = np.log(np.maximum(mass * m, 1e-300))
            flux = np.interp(at, log_over, per_mass) * mass * m + model.surface_flux
            return np.stack([np.interp(at, log_over, theta, left=surface), flux], axis=1)

        s = np.clip(stretch_position(over / mass, stretch), 0.0, 1.0)
        inside = s < 1.0
        return Elements.sample(model, stretch, float(log_mass), np.concatenate([[0.0], s[inside], [1.0]]), values)


def _above(first: float, temperature: float) -> Array:
    """Overburdens above the first, down to which nothing happens but the change of density in the surface layer."""
    many = int(np.ceil(np.log(max(first / (_SURFACE * temperature), 1.0)) / _SURFACE_STEP))
    return first * np.exp(-_SURFACE_STEP * np.arange(many, 0, -1))


@lru_cache(maxsize=4)
def integrate_trajectories(
    model: Model,
    coldest: float,
    hottest: float,
    deepest: float,
    refinement: Refinement = REFINEMENT,
    largest_flux: float = np.inf,
) -> TrajectoryGrid:
    """The grid of trajectories of ``model`` from surface temperatures ``coldest`` to ``hottest`` down to the hold-up
    ``deepest``; it may miss flows with a flux above ``largest_flux``. The grids of the last few chutes are
    cached, since other flows of the same chute are often wanted next."""
    start = starting_temperatures(coldest, hottest, refinement)
    return integrate_trajectories_from(model, np.empty((ENTRIES, 0)), start, deepest, refinement, largest_flux)


def starting_temperatures(coldest: float, hottest: float, refinement: Refinement = REFINEMENT) -> Array:
    """The surface temperatures that trajectories start with, ascending."""
    decades = np.log10(hottest / coldest)
    return np.geomspace(coldest, hottest, max(3, int(np.ceil(refinement.per_decade * decades)) + 1))


def integrate_trajectories_from(
    model: Model,
    others: Array,
    temperature: Array,
    deepest: float,
    refinement: Refinement = REFINEMENT,
    largest_flux: float = np.inf,
) -> TrajectoryGrid:
    """The grid of trajectories from surface temperatures (C,), two or more, down to the hold-up ``deepest``, which
    serves the base of ``model``, ``others`` (entries, K) by their heat fluxes, and all between these; its zeros are of
    the first. Trajectories are followed to where their flux by shear is above ``largest_flux``."""
    t = tables(model)
    bounds, scale, steepest = t.bounds, t.scale, t.steepest
    low = high = np.ascontiguousarray(t.values[:, BASE])
    if others.shape[1]:
        fluxes = np.concatenate([t.values[:, BASE, None], others], axis=1)
        low, high = fluxes.min(axis=1), fluxes.max(axis=1)
        bounds = bounds_for(model, fluxes)
        scale = max(scale, float(np.abs(others).max()))
    theta = surface_potential(model, temperature)
    first, layer_depth, layer = _LEAST_AT_INTERFACE, 0.0, np.empty((0, 7))
    if model.surface_stress == 0.0:
        layer_depth = min(_LAYER / max(t.rate, 1.0), 0.5 * deepest)
        layer, nearest = kernel.expand_in_layer(t.values, low, high, float(theta[0]), layer_depth)
        first = min(max(nearest, _LEAST), layer_depth)
    p_1 = refinement.lengths / (refinement.step * max(t.rate, 1e-3))
    overburden = kernel.space_depths(first, deepest, p_1, refinement.step)
    states, came_from, goes_on, places, undecided, cells, status = kernel.integrate(
        t.values, bounds, float(model.slope), model.surface_stress, model.surface_flux, p_1,
        layer, layer_depth, steepest, overburden, np.log(temperature), theta,
        refinement.delta, 1.0 / scale, refinement.finest, refinement.most, largest_flux,
    )  # fmt: skip
    zeros, links = kernel.find_zeros(t.values, BASE, states, came_from, goes_on, places)
    return TrajectoryGrid(
        model, refinement, overburden, states, came_from, goes_on, places, t.values, bounds, layer, scale, zeros,
        links, cells, undecided, status == kernel.DONE,
    )  # fmt: skip
