"""A branch of a curve as one line: its special points where they lie, its kinds of density apart."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar, overload

from chuteflow import Branch, Flow
from chuteflow.paper.sources import SteadyBranch, SteadyFlow

F = TypeVar("F", bound=SteadyFlow, covariant=True)


@dataclass(frozen=True, eq=False)
class Point(Generic[F]):
    """A flow of a branch; ``special`` is the kind of a special point, or empty."""

    flow: F
    special: str = ""


@overload
def in_order(branch: Branch) -> Iterator[Point[Flow]]: ...
@overload
def in_order(branch: SteadyBranch) -> Iterator[Point[SteadyFlow]]: ...
def in_order(branch: SteadyBranch) -> Iterator[Point[SteadyFlow]]:
    """The flows of ``branch`` with its special points in their places."""
    for i, flow in enumerate(branch.flows):
        yield Point(flow)
        for special in branch.special:
            if special.position == i:
                yield Point(special.flow, special.kind)


@dataclass(frozen=True, eq=False)
class Run:
    """Consecutive flows of one kind of ``density``; neighbouring runs share the flow where they meet."""

    density: str
    flows: tuple[SteadyFlow, ...]


def runs(branch: SteadyBranch) -> list[Run]:
    """``branch`` cut where the density turns from monotonic to inverted or back."""
    kind = branch.flows[0].density
    found: list[Run] = []
    current: list[SteadyFlow] = []
    for point in in_order(branch):
        current.append(point.flow)
        turns = point.special == "density-inversion"
        if turns or (not point.special and point.flow.density != kind):
            found.append(Run(kind, tuple(current)))
            kind = {"inverted": "monotonic", "monotonic": "inverted"}[kind] if turns else point.flow.density
            current = [point.flow]
    return [*found, Run(kind, tuple(current))]
