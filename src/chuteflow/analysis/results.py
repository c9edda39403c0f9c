"""What the analyses return: sets of flows, branches of a curve, special points, the range searched."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import overload

import numpy as np

from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow


@dataclass(frozen=True)
class Searched:
    """The range in which nothing was missed: surface temperatures (low, high) and largest hold-up."""

    surface_temperature: tuple[float, float]
    largest_holdup: float


@dataclass(frozen=True, eq=False)
class FlowSet(Sequence[Flow]):
    """Every flow that was asked for, from hot to cold (by surface temperature, then by hold-up).

    ``tolerance`` is the relative error that was allowed in Q, h and M; each flow has its own estimate.
    ``reason`` is one sentence on why there is none, or None where there are flows. ``incomplete`` is one where a branch
    leaves the range searched towards what was asked for, so that there may be more, and None where none does.
    """

    chute: Chute
    flows: tuple[Flow, ...]
    searched: Searched
    tolerance: float
    reason: str | None
    incomplete: str | None = None

    def __len__(self) -> int:
        return len(self.flows)

    @overload
    def __getitem__(self, index: int) -> Flow: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Flow]: ...
    def __getitem__(self, index: int | slice) -> Flow | Sequence[Flow]:
        return self.flows[index]

    def __iter__(self) -> Iterator[Flow]:
        return iter(self.flows)


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A located point of a branch: ``kind`` is one of KINDS, ``position`` the index just before it."""

    kind: str
    flow: Flow
    position: int


#: Kinds of special points, and what they are.
KINDS = {
    "fold-Q": "two flows of one mass flux meet",
    "fold-M": "two flows of one hold-up meet",
    "fold-T": "two flows of one surface temperature meet",
    "density-inversion": "onset of a volume fraction that rises with height",
    "interior-change": "the interior changes between dissipative, mixed and productive",
    "stability-change": "small disturbances begin to grow, or cease to",
}


@dataclass(frozen=True, eq=False)
class Branch:
    """One family of flows in order along its curve; ``ends`` says in words why it ends at either side."""

    flows: tuple[Flow, ...]
    special: tuple[SpecialPoint, ...]
    ends: tuple[str, str]

    @cached_property
    def mass_flux(self) -> Array:
        """Q along the branch."""
        return np.array([flow.mass_flux for flow in self.flows])

    @cached_property
    def centre_of_mass(self) -> Array:
        """h along the branch."""
        return np.array([flow.centre_of_mass for flow in self.flows])

    @cached_property
    def mass_holdup(self) -> Array:
        """M along the branch."""
        return np.array([flow.mass_holdup for flow in self.flows])

    @cached_property
    def surface_temperature(self) -> Array:
        """T_surface along the branch."""
        return np.array([flow.surface_temperature for flow in self.flows])


@dataclass(frozen=True, eq=False)
class Curve:
    """All families of flows of one chute, in the range searched; ``reason`` where there is none."""

    chute: Chute
    branches: tuple[Branch, ...]
    searched: Searched
    tolerance: float
    reason: str | None
