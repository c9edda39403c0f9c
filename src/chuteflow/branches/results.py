"""What the analyses return: sets of flows, branches of a curve, special points, the range searched."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from chuteflow import display
from chuteflow.result import Compared, Result
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.line import LineOfFlows
from chuteflow.steady.quantities import NUMBERS, PLACE


@dataclass(frozen=True)
class Cells:
    """What the grid of trajectories looked at: neighbours are at most ``delta`` apart; of ``number`` cells between them
    so many are ``undecided``: they may hide flows."""

    delta: float
    number: int
    undecided: int


@dataclass(frozen=True)
class Searched:
    """The range searched: surface temperatures (low, high) and largest hold-up; and the ``cells`` examined, where they
    were counted."""

    surface_temperature: tuple[float, float]
    largest_holdup: float
    cells: Cells | None = None


@dataclass(frozen=True, eq=False)
class FlowSet(Result, Sequence[Flow]):
    """The flows found in the range searched, from hot to cold (by surface temperature, then by hold-up).

    ``tolerance`` is the relative error that was allowed in Q, h and M; each flow has its own estimate.
    ``reason`` is one sentence on why there is none, or None where there are flows. ``incomplete`` is one where there
    may be more: where a branch leaves the range searched towards what was requested, a flow that was seen could not be
    solved, or the search leaves it open; None otherwise.
    """

    chute: Chute
    flows: tuple[Flow, ...]
    searched: Searched
    tolerance: float
    reason: str | None
    incomplete: str | None = None

    def __repr__(self) -> str:
        temperatures = display.list_numbers([flow.surface_temperature for flow in self.flows])
        found = f"T_surface = {temperatures}" if self.flows else self.reason
        return display.line("FlowSet", display.count_of(len(self), "flow"), found)

    def _repr_html_(self) -> str:
        header = ["", "name", *(NUMBERS[name].symbol for name in PLACE), "density", "interior", "validity", "error"]
        rows = [
            [
                *(str(i), flow.name, *_place(flow), flow.density, flow.interior),
                *(flow.validity.summary, f"{flow.error:.0e}"),
            ]
            for i, flow in enumerate(self, 1)
        ]
        caption = f"{display.count_of(len(self), 'flow')} on {self.chute.summary}"
        return display.html_table(caption, header, rows, _advice(self.reason))

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
class FlowSets(Result, Sequence[FlowSet]):
    """The flows of one chute at each of several ``values`` of a ``quantity`` ("Q", "M", "h" or "T_surface")."""

    chute: Chute
    quantity: str
    values: tuple[float, ...]
    sets: tuple[FlowSet, ...]

    def __repr__(self) -> str:
        values = f"{self.quantity} = {display.list_numbers(self.values)}"
        numbers = ", ".join(str(len(one)) for one in self.sets[:20]) + (", ..." if len(self.sets) > 20 else "")
        return display.line("FlowSets", values, f"{numbers} flows")

    def _repr_html_(self) -> str:
        header = [self.quantity, "name", *(NUMBERS[name].symbol for name in PLACE), "density", "interior", "error"]
        rows = [
            [display.number(value), flow.name, *_place(flow), flow.density, flow.interior, f"{flow.error:.0e}"]
            for value, one in zip(self.values, self.sets, strict=True)
            for flow in one
        ]
        return display.html_table(repr(self)[1:-1], header, rows)

    def __len__(self) -> int:
        return len(self.sets)

    @overload
    def __getitem__(self, index: int) -> FlowSet: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[FlowSet]: ...
    def __getitem__(self, index: int | slice) -> FlowSet | Sequence[FlowSet]:
        return self.sets[index]


@dataclass(frozen=True, eq=False)
class SpecialPoint(Compared):
    """A located point of a branch: ``kind`` is one of KINDS, ``position`` the index just before it."""

    kind: str
    flow: Flow
    position: int

    def __repr__(self) -> str:
        numbers = {NUMBERS[name].symbol: getattr(self.flow, name) for name in PLACE}
        return display.line("SpecialPoint", self.kind, **numbers)


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
class Branch(Result, LineOfFlows):
    """One branch of flows in order along its curve; ``ends`` says in words why it ends at either side."""

    flows: tuple[Flow, ...]
    special: tuple[SpecialPoint, ...]
    ends: tuple[str, str]

    def __repr__(self) -> str:
        found = display.count_of(len(self.special), "special point")
        reach = (display.span("Q", self.mass_flux), display.span("T_surface", self.surface_temperature))
        return display.line("Branch", f"{display.count_of(len(self.flows), 'flow')}, {found}", *reach)

    def _repr_html_(self) -> str:
        return display.html_table(repr(self)[1:-1], ["", *(NUMBERS[name].symbol for name in PLACE)], _stations(self))


@dataclass(frozen=True, eq=False)
class Curve(Result):
    """All branches of flows of one chute, in the range searched; ``reason`` where there is none, and ``incomplete``
    where there may be more: where a branch was seen and not solved, or the search leaves it open."""

    chute: Chute
    branches: tuple[Branch, ...]
    searched: Searched
    tolerance: float
    reason: str | None
    incomplete: str | None = None

    def at(
        self,
        *,
        Q: float | None = None,
        M: float | None = None,
        h: float | None = None,
        T_surface: float | None = None,
    ) -> FlowSet:
        """Every flow of the chute with one given quantity, as :func:`chuteflow.flows` finds them in the range and to
        the tolerance of this curve.

        Raises:
            InputError: for none or several of Q, M, h and T_surface, or a value out of range.
        """
        from chuteflow.branches.enumeration import flows

        return flows(
            self.chute,
            Q=Q,
            M=M,
            h=h,
            T_surface=T_surface,
            tolerance=self.tolerance,
            surface_temperature=self.searched.surface_temperature,
            largest_holdup=self.searched.largest_holdup,
        )

    def __repr__(self) -> str:
        branches = display.count_of(len(self.branches), "branch", "branches")
        total = display.count_of(sum(len(branch.flows) for branch in self.branches), "flow")
        reach = [
            display.span(NUMBERS[name].symbol, np.concatenate([getattr(branch, name) for branch in self.branches]))
            for name in ("mass_flux", "surface_temperature")
            if self.branches
        ]
        return display.line("Curve", f"{branches}, {total}", *reach, self.reason)

    def _repr_html_(self) -> str:
        header = ["branch", "", *(NUMBERS[name].symbol for name in PLACE)]
        rows = [[str(i), *row] for i, branch in enumerate(self.branches, 1) for row in _stations(branch)]
        branches = display.count_of(len(self.branches), "branch", "branches")
        return display.html_table(f"{branches} of flows on {self.chute.summary}", header, rows, _advice(self.reason))


def _advice(reason: str | None) -> str | None:
    """Why there is no flow, and what tells where there is one."""
    return None if reason is None else f"No flow: {reason}. chuteflow.nearest says what is nearest that has one."


def _place(flow: Flow) -> list[str]:
    return [display.number(getattr(flow, name)) for name in PLACE]


def _stations(branch: Branch) -> list[list[str]]:
    """Where a branch begins and ends, and its special points, as rows of cells."""
    between = [[point.kind, *_place(point.flow)] for point in branch.special]
    return [["begins", *_place(branch.flows[0])], *between, ["ends", *_place(branch.flows[-1])]]
