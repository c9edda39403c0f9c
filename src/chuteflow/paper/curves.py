"""Q-h curves of several chutes: the data and the lines of figures 4, 6, 8, 9, 10 and 17."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow import Chute
from chuteflow.branches.counting import flows_at_flux
from chuteflow.branches.lines import NUMBERS, SteadyBranch, in_order, runs, smooth
from chuteflow.paper.data import FigureTable, chute_note, stack
from chuteflow.paper.sources import Source, SteadyCurve, reach
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Curves:
    """Curves by ``names``, which are the values of ``key``, a parameter in which the chutes differ."""

    title: str
    key: str
    curves: dict[Any, SteadyCurve]

    def table(self) -> FigureTable:
        """The branches of all curves, special points in their places, one below the other."""
        groups = {
            (name, number): _columns(branch, number)
            for name, found in self.curves.items()
            for number, branch in enumerate(found.branches, 1)
        }
        columns = stack(self.key, groups)
        columns[self.key] = [name for name, _ in columns[self.key]]
        notes = [note for found in self.curves.values() for note in (chute_note(found.chute), *reach(found))]
        return FigureTable(self.title, tuple(notes), columns)

    def flows_at(self, name: Any, mass_flux: float) -> int:
        """How many flows of a curve have this mass flux."""
        return flows_at_flux(self.curves[name].branches, mass_flux)


def _columns(branch: SteadyBranch, number: int) -> dict[str, list[Any]]:
    points = list(in_order(branch))
    status = ["converged"] * len(points)
    for i, end in zip((0, -1), branch.ends, strict=True):
        status[i] = f"converged; here the curve ends: {end}"
    return {
        "branch": [number] * len(points),
        **{name: [getattr(point.flow, name) for point in points] for name in NUMBERS},
        "density": [point.flow.density for point in points],
        "special": [point.special for point in points],
        "status": status,
    }


def trace(title: str, key: str, chutes: Iterable[Chute], source: Source) -> Curves:
    """The curves of ``chutes``, which differ in ``key``."""
    return Curves(title, key, {getattr(found.chute, key): found for found in source.curves(list(chutes))})


def draw_densities(ax: Axes, found: SteadyCurve, **settings: Any) -> None:
    """Centre of mass against mass flux: solid where the density is inverted, dashed where it is monotonic."""
    for branch in found.branches:
        for run in runs(branch):
            stroke = style.LineStyle(style.BLACK, style.OF_DENSITY[run.density])
            line = smooth(run.flows)
            ax.plot(line["mass_flux"], line["centre_of_mass"], **stroke.line() | settings)


def draw_plain(ax: Axes, found: SteadyCurve, stroke: style.LineStyle, name: str | None = None) -> None:
    """Centre of mass against mass flux in one stroke."""
    for i, branch in enumerate(found.branches):
        line = smooth([point.flow for point in in_order(branch)])
        ax.plot(line["mass_flux"], line["centre_of_mass"], label=name if i == 0 else None, **stroke.line())


def hot_end(branch: SteadyBranch, centre_of_mass: float) -> float:
    """Mass flux where the hot end of ``branch`` passes through ``centre_of_mass``, of the plotted line."""
    h, q = branch.centre_of_mass, branch.mass_flux
    below = int(np.argmax(h < centre_of_mass))
    return float(np.interp(centre_of_mass, h[[below, below - 1]], q[[below, below - 1]]))


def name_slopes(ax: Axes, found: Curves, names: Iterable[float], right: float, top: float) -> None:
    """The slopes at the hot ends of their curves, where these leave the panel at ``top``, and a heading in the
    widest gap between them."""
    places = sorted((hot_end(found.curves[name].branches[0], top), name) for name in names)
    labels: list[float] = []
    for place, name in places:
        labels.append(max(place, labels[-1] + 0.043 * right) if labels else place)
        style.write(
            ax, labels[-1], top, f"{name:.2f}", xytext=(1.0, 2.0), rotation=60, rotation_mode="anchor", ha="left"
        )
    width, begin = max((after - before, before) for before, after in pairwise([*labels, right]))
    # The labels lean to the right.
    style.write(ax, begin + 0.54 * width, top, r"slope $\tan\theta$", xytext=(0.0, 13.0), ha="center")
    # The letter of the panel stands clear of them.
    ax.set_title(ax.get_title(loc="left"), loc="left", x=-0.12, **style.title())


def draw_two(data: Curves, lines: Mapping[str, tuple[style.LineStyle, str]], right: float, top: float) -> Figure:
    """One panel with the curves of two chutes, ``lines`` their style and name."""
    figure, (ax,) = style.panels(1, width=3.8, height=3.2)
    for name, found in data.curves.items():
        draw_plain(ax, found, *lines[name])
    frame(ax, right, top)
    style.legend(ax, loc="center right")
    return figure


def frame(ax: Axes, right: float, top: float, *, ordinate: bool = True) -> None:
    """Axes from zero with the labels of mass flux and centre of mass."""
    style.name_axes(ax, style.label("mass_flux"), style.label("centre_of_mass") if ordinate else None)
    ax.set_xlim(0.0, right)
    ax.set_ylim(0.0, top)
