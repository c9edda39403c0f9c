"""A branch of a curve as one line: its special points where they lie, its kinds of density apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar, overload

import numpy as np

from chuteflow.branches.results import Branch
from chuteflow.steady.flow import Flow
from chuteflow.steady.kinds import INVERTED, MONOTONIC

if TYPE_CHECKING:
    from chuteflow.steady.mapped.curve import MappedCurve
    from chuteflow.steady.mapped.solution import MappedSolution

#: Flows and branches by either method, which name their numbers alike.
SteadyFlow: TypeAlias = "Flow | MappedSolution"
SteadyBranch: TypeAlias = "Branch | MappedCurve"

#: The numbers in which a branch is one smooth line, and places on it between two flows that are drawn.
NUMBERS = ("mass_flux", "centre_of_mass", "mass_holdup", "surface_temperature")
_BETWEEN = 10

F = TypeVar("F", bound="SteadyFlow", covariant=True)


@dataclass(frozen=True, eq=False)
class LinePoint(Generic[F]):
    """A flow of a branch; ``special`` is the kind of a special point, or empty."""

    flow: F
    special: str = ""


@overload
def in_order(branch: Branch) -> Iterator[LinePoint[Flow]]: ...
@overload
def in_order(branch: SteadyBranch) -> Iterator[LinePoint[SteadyFlow]]: ...
def in_order(branch: SteadyBranch) -> Iterator[LinePoint[SteadyFlow]]:
    """The flows of ``branch`` with its special points in their places."""
    for i, flow in enumerate(branch.flows):
        yield LinePoint(flow)
        for special in branch.special:
            if special.position == i:
                yield LinePoint(special.flow, special.kind)


@dataclass(frozen=True, eq=False)
class DensityRun:
    """Consecutive flows of one kind of ``density``; neighbouring runs share the flow where they meet."""

    density: str
    flows: tuple[SteadyFlow, ...]


def runs(branch: SteadyBranch) -> list[DensityRun]:
    """``branch`` cut where the density turns from monotonic to inverted or back."""
    kind = branch.flows[0].density
    found: list[DensityRun] = []
    current: list[SteadyFlow] = []
    for point in in_order(branch):
        current.append(point.flow)
        turns = point.special == "density-inversion"
        if turns or (not point.special and point.flow.density != kind):
            found.append(DensityRun(kind, tuple(current)))
            kind = {INVERTED: MONOTONIC, MONOTONIC: INVERTED}[kind] if turns else point.flow.density
            current = [point.flow]
    return [*found, DensityRun(kind, tuple(current))]


def smooth(flows: Sequence[SteadyFlow]) -> dict[str, Any]:
    """Neighbouring flows of a branch as a line to be drawn: each of NUMBERS, with places between the flows.

    The places are those of a cubic spline through the logarithms of all four numbers over the length of their chords,
    which stays smooth where the branch folds in one of them.
    """
    from scipy.interpolate import CubicSpline

    logs = np.log([[getattr(flow, name) for name in NUMBERS] for flow in flows])
    steps = np.linalg.norm(np.diff(logs, axis=0), axis=1)
    kept = np.append(True, steps > 0.0)
    if np.count_nonzero(kept) < 2:
        return dict(zip(NUMBERS, np.exp(logs).T, strict=True))
    way = np.append(0.0, np.cumsum(steps))[kept]
    places = np.interp(np.arange(_BETWEEN * (len(way) - 1) + 1) / _BETWEEN, np.arange(len(way)), way)
    return dict(zip(NUMBERS, np.exp(CubicSpline(way, logs[kept])(places)).T, strict=True))
