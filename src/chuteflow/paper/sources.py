"""Where the flows of the figures come from: the overburden method, or the paper's own mapped Chebyshev method.

A figure asks its source for flows and curves, and knows nothing of the method. Newton's method needs a start: the
mapped method begins each branch from a flow of the other, solves it again, and follows the branch by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from chuteflow import Chute, Curve, Flow, SolveError, curve, flows
from chuteflow.branches.lines import SteadyFlow
from chuteflow.processes import worker_pool
from chuteflow.steady.collocation import LOG_Q, LOG_T
from chuteflow.steady.mapped.curve import CONTROL, TOLERANCE, MappedCurve, mapped_curve
from chuteflow.steady.mapped.solution import LARGEST_DEGREE, MappedSolution, refine
from chuteflow.steady.solver import Condition

#: Surface temperatures of curves, and flows on the longest branch of the overburden method.
SURFACE_TEMPERATURE, POINTS = (1e-3, 1e4), 400
#: The mapped method begins a branch nearest to this surface temperature, where few coefficients suffice.
_EASY = 1.0
#: Steps that draw as smooth lines; the flows are solved again more closely than the points of the trace.
_SMOOTH = replace(CONTROL, max_step=0.06, tolerance=1e-5)
#: Flows that tell one branch from another.
_FEW = 24


@dataclass(frozen=True)
class UnreachedBranch:
    """A branch that the mapped method does not reach: its surface temperatures, lowest and highest, and why."""

    surface_temperature: tuple[float, float]
    reason: str


@dataclass(frozen=True, eq=False)
class MappedCurves:
    """The branches of a chute in a range of surface temperatures as far as the mapped method reaches, and those that
    it does not."""

    chute: Chute
    surface_temperature: tuple[float, float]
    branches: tuple[MappedCurve, ...]
    unreached: tuple[UnreachedBranch, ...]


#: What figures draw.
SteadyCurve = Curve | MappedCurves


class Source(Protocol):
    """A method of solution."""

    @property
    def words(self) -> str:
        """The method, in a line for the data."""
        ...

    def flows(self, chute: Chute, *, Q: float | None = None, T_surface: float | None = None) -> Sequence[SteadyFlow]:
        """Every flow at one Q or T_surface, from hot to cold.

        Raises:
            SolveError: where the method does not reach one.
        """
        ...

    def curves(
        self,
        chutes: Sequence[Chute],
        surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
        points: int = POINTS,
    ) -> Sequence[SteadyCurve]:
        """The branches of each of ``chutes``, as far as the method reaches, in a range of surface temperatures."""
        ...


@dataclass(frozen=True)
class Overburden:
    """The method of this package: Chebyshev collocation in the overburden."""

    words: str = "overburden: Chebyshev collocation in the overburden, relative error of Q, h and M up to 1e-10"

    def flows(self, chute: Chute, *, Q: float | None = None, T_surface: float | None = None) -> Sequence[Flow]:
        """See :class:`Source`."""
        return flows(chute, Q=Q, T_surface=T_surface).flows

    def curves(
        self,
        chutes: Sequence[Chute],
        surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
        points: int = POINTS,
    ) -> Sequence[SteadyCurve]:
        """See :class:`Source`."""
        return [curve(chute, surface_temperature=surface_temperature, points=points) for chute in chutes]


@dataclass
class Mapped:
    """The paper's method (section 3.4). Curves of several chutes are shared out to ``workers`` processes, and kept
    in memory: several figures ask for the same ones."""

    workers: int = 1
    words: str = (
        "mapped: the mapped Chebyshev series of section 3.4 of the paper, up to "
        f"N = {LARGEST_DEGREE}, relative error of Q, h and M up to {TOLERANCE:g}"
    )
    _known: dict[Any, MappedCurves] = field(default_factory=dict, repr=False, compare=False)

    def flows(
        self, chute: Chute, *, Q: float | None = None, T_surface: float | None = None
    ) -> Sequence[MappedSolution]:
        """See :class:`Source`."""
        found = []
        for start in flows(chute, Q=Q, T_surface=T_surface):
            fixed = (
                Condition.fix(LOG_T, T_surface) if Q is None and T_surface else Condition.fix(LOG_Q, start.mass_flux)
            )
            flow = refine(chute, start, fixed)
            if not flow.converged:
                raise SolveError(
                    f"the mapped method, at a surface temperature of {start.surface_temperature:g}: {flow.status.value}"
                )
            found.append(flow)
        return found

    def curves(
        self,
        chutes: Sequence[Chute],
        surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
        points: int = POINTS,
    ) -> Sequence[MappedCurves]:
        """See :class:`Source`; the length of the steps is that of the method, whatever ``points``."""
        del points
        new = [chute for chute in chutes if (chute, surface_temperature) not in self._known]
        ranges = [surface_temperature] * len(new)
        if self.workers > 1 and len(new) > 1:
            found = _distribute(self.workers, new, ranges)
        else:
            found = map(mapped_branches, new, ranges)
        for chute, branches in zip(new, found, strict=True):
            self._known[chute, surface_temperature] = branches
        return [self._known[chute, surface_temperature] for chute in chutes]


OVERBURDEN = Overburden()


def source(method: str, workers: int = 1) -> Source:
    """The source of one of :data:`chuteflow.paper.figures.METHODS`; ``workers`` processes where that pays."""
    return {"overburden": OVERBURDEN, "mapped": Mapped(workers)}[method]


def mapped_branches(chute: Chute, surface_temperature: tuple[float, float]) -> MappedCurves:
    """Every branch of ``chute``, begun where the mapped method finds it easiest."""
    low, high = surface_temperature
    reached, unreached = [], []
    for branch in curve(chute, surface_temperature=surface_temperature, points=_FEW).branches:
        inside = [flow for flow in branch.flows if low < flow.surface_temperature < high]
        start = min(inside, key=lambda flow: max(flow.surface_temperature / _EASY, _EASY / flow.surface_temperature))
        found = mapped_curve(start, surface_temperature=surface_temperature, control=_SMOOTH)
        if found.flows:
            reached.append(found)
        else:
            ends = float(branch.surface_temperature.min()), float(branch.surface_temperature.max())
            unreached.append(UnreachedBranch(ends, f"the series do not converge with up to N = {LARGEST_DEGREE}"))
    return MappedCurves(chute, surface_temperature, tuple(reached), tuple(unreached))


def _distribute(workers: int, chutes: Sequence[Chute], ranges: Sequence[tuple[float, float]]) -> Sequence[MappedCurves]:
    """:func:`mapped_branches` in processes of their own."""
    with worker_pool(min(workers, len(chutes))) as pool:
        return list(pool.map(mapped_branches, chutes, ranges))


#: How notes begin on flows that a method does not reach.
NOT_REACHED = "not reached"


def reach(found: SteadyCurve) -> list[str]:
    """How far the flows of a chute are known, in lines for the data."""
    if isinstance(found, Curve):
        return ["all flows with surface temperatures from {} to {}".format(*found.searched.surface_temperature)]
    low, high = found.surface_temperature
    cut = [
        f"{NOT_REACHED}: what lies beyond the surface temperature {temperature:g} on a branch: {end}"
        for branch in found.branches
        for temperature, end in zip(branch.surface_temperature[[0, -1]], branch.ends, strict=True)
        if low < temperature < high
    ]
    lost = [
        "{}: a branch with surface temperatures from {:g} to {:g}: {}".format(
            NOT_REACHED, *branch.surface_temperature, branch.reason
        )
        for branch in found.unreached
    ]
    return cut + lost
