"""Figure 3: centre of mass, mass hold-up and mass flux along the branch of flows at tan(theta) = 0.3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.branches.lines import NUMBERS, SteadyBranch, SteadyFlow, in_order
from chuteflow.paper.data import FigureTable, chute_note, stack
from chuteflow.paper.materials import dissipative
from chuteflow.paper.sources import OVERBURDEN, SURFACE_TEMPERATURE, Source, SteadyCurve, reach
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MASS_FLUX = 3.0
SLOPE = 0.3
#: Flows on the curve.
POINTS = 500
#: Abscissa and ordinate of each panel, where the panel ends, and where the flows are named.
PANELS = (
    ("mass_flux", "centre_of_mass", 6.0, 15.0, ("right", "above right", "above left")),
    ("mass_flux", "mass_holdup", 6.0, 1.6, ("below", "above left", "above")),
    ("mass_holdup", "centre_of_mass", 1.6, 15.0, ("right", "above right", "above right")),
)


@dataclass(frozen=True, eq=False)
class Figure3:
    """The curve, and the flows of figure 2 by name."""

    curve: SteadyCurve
    flows: dict[str, SteadyFlow]

    def table(self) -> FigureTable:
        """The branches and then the named flows, one below the other."""
        groups: dict[Any, dict[str, Any]] = {
            f"family {i}": _columns([point.flow for point in in_order(branch)])
            for i, branch in enumerate(self.curve.branches, 1)
        }
        groups |= {name: _columns([flow]) for name, flow in self.flows.items()}
        special = [
            f"{point.kind} at Q = {point.flow.mass_flux}, h = {point.flow.centre_of_mass}"
            for branch in self.curve.branches
            for point in branch.special
        ]
        ends = [f"family {i} ends: {', and '.join(branch.ends)}" for i, branch in enumerate(self.curve.branches, 1)]
        title = "Figure 3: centre of mass, mass hold-up and mass flux of all flows"
        return FigureTable(
            title, (chute_note(self.curve.chute), *reach(self.curve), *ends, *special), stack("flows", groups)
        )


def compute(source: Source = OVERBURDEN) -> Figure3:
    """The branch of flows, and its flows at Q = 3."""
    chute = dissipative(SLOPE)
    (traced,) = source.curves([chute], SURFACE_TEMPERATURE, POINTS)
    return Figure3(traced, dict(zip("ABC", source.flows(chute, Q=MASS_FLUX), strict=True)))


def draw(data: Figure3) -> Figure:
    """Three panels, the flows of figure 2 marked."""
    figure, axes = style.panels(3)
    for ax, (x, y, right, top, sides) in zip(axes, PANELS, strict=True):
        for branch in data.curve.branches:
            ax.plot(*_line(branch, x, y), **style.LineStyle().line())
        for side, (name, flow) in zip(sides, data.flows.items(), strict=True):
            style.name_point(ax, getattr(flow, x), getattr(flow, y), name, side)
        style.name_axes(ax, style.label(x), style.label(y))
        ax.set_xlim(0.0, right)
        ax.set_ylim(0.0, top)
    return figure


def _line(branch: SteadyBranch, x: str, y: str) -> tuple[Any, Any]:
    columns = _columns([point.flow for point in in_order(branch)])
    return columns[x], columns[y]


def _columns(found: list[SteadyFlow]) -> dict[str, Any]:
    return {name: np.array([getattr(flow, name) for flow in found]) for name in NUMBERS}
