"""Figure 1: the coordinates, as a sketch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow import Profile, flows
from chuteflow.paper.data import FigureTable, chute_note
from chuteflow.paper.materials import dissipative
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MASS_FLUX = 3.0
SLOPE = 0.3
#: Extent of the sketch along the slope and upwards, in grain diameters; grains, and how near two may come.
LENGTH, HEIGHT = 22.0, 6.0
GRAINS, NEAREST = 4000, 1.02
#: Heights of the arrows of the velocity, where they begin, and the length of the longest.
ARROWS = np.linspace(0.25, 4.75, 7)
ARROWS_AT, LONGEST = 9.0, 5.0
#: What a reader sees steeper than it is: the sketch is drawn at this angle, in degrees.
ANGLE = 20.0


@dataclass(frozen=True, eq=False)
class Figure1:
    """Centres of grains (n, 2) along and above the slope, in places drawn at random by the volume fraction of the
    cold flow of figure 2, and its velocity at the heights of the arrows."""

    grains: Any
    profile: Profile

    def table(self) -> FigureTable:
        """Grains and arrows."""
        kind = ["grain"] * len(self.grains) + ["velocity"] * len(ARROWS)
        return FigureTable(
            "Figure 1: sketch of the coordinates; x along the slope, z normal to it",
            (chute_note(dissipative(SLOPE)), "grains are for show; the velocity is that of the cold flow of figure 2"),
            {
                "kind": kind,
                "x": [*self.grains[:, 0].tolist(), *np.full(len(ARROWS), ARROWS_AT).tolist()],
                "z": [*self.grains[:, 1].tolist(), *self.profile.height.tolist()],
                "velocity": [""] * len(self.grains) + self.profile.velocity.tolist(),
            },
        )


def compute() -> Figure1:
    """Grains at random places that do not overlap, as many as the volume fraction asks for."""
    cold = flows(dissipative(SLOPE), Q=MASS_FLUX)[-1]
    random = np.random.default_rng(1)
    candidates = np.column_stack([random.uniform(0.0, LENGTH, GRAINS), random.uniform(0.5, HEIGHT, GRAINS)])
    fraction = cold.profile(candidates[:, 1]).volume_fraction / cold.largest_volume_fraction
    kept: list[Any] = []
    for place in candidates[random.uniform(0.0, 1.0, GRAINS) < fraction**1.5]:
        if not kept or np.hypot(*(np.array(kept) - place).T).min() > NEAREST:
            kept.append(place)
    return Figure1(np.array(kept), cold.profile(ARROWS))


def draw(data: Figure1) -> Figure:
    """The chute at an angle, grains on it, axes, gravity, and the velocity."""
    from matplotlib.patches import Circle

    figure, (ax,) = style.panels(1, width=5.2, height=3.2)
    ax.set_axis_off()
    ax.set_aspect("equal")
    for place in data.grains:
        ax.add_patch(Circle(tuple(_turn(place)), 0.5, facecolor="#f0f0f0", edgecolor="#a8a8a8", linewidth=0.5))
    for place in np.arange(0.5, LENGTH, 1.0):  # the rough base
        ax.add_patch(Circle(tuple(_turn((place, -0.5))), 0.5, facecolor=style.GREY, edgecolor=style.GREY))
    _line(ax, (0.0, -1.0), (LENGTH, -1.0))
    foot = _turn((LENGTH, -1.0))
    ax.plot([foot[0] - 8.5, foot[0]], [foot[1], foot[1]], **style.LineStyle(style.BLACK, style.DASHED).line(0.8))
    sweep = np.radians(np.linspace(180.0 - ANGLE, 180.0, 40))
    ax.plot(foot[0] + 6.0 * np.cos(sweep), foot[1] + 6.0 * np.sin(sweep), **style.LineStyle().line(0.8))
    style.write(ax, foot[0] - 7.4, foot[1] + 0.8, r"$\theta$", fontsize=11)
    _arrow(ax, (0.0, 0.0), (LENGTH + 4.0, 0.0), "$x$", (4.0, -4.0))
    _arrow(ax, (0.0, 0.0), (0.0, 7.5), "$z$", (4.0, -2.0))
    _arrow(ax, (18.0, 9.0), np.array((18.0, 9.0)) + _back((0.0, -3.6)), "$g$", (5.0, 4.0))
    ends = ARROWS_AT + LONGEST * data.profile.velocity / data.profile.velocity.max()
    for height, end in zip(ARROWS, ends, strict=True):
        _arrow(ax, (ARROWS_AT, height), (end, height), "", (0.0, 0.0), style.VERMILION)
    _line(ax, (ARROWS_AT, 0.0), (ARROWS_AT, ARROWS[-1] + 0.4), style.VERMILION)
    x, y = _turn(np.column_stack([ends, ARROWS])).T
    ax.plot(x, y, **style.LineStyle(style.VERMILION).line(1.0))
    x, y = _turn((ends[-1], ARROWS[-1]))
    style.write(ax, x, y, "$u(z)$", xytext=(4.0, 2.0), color=style.VERMILION, fontsize=11)
    ax.set(xlim=(-1.5, LENGTH + 4.0), ylim=(foot[1] - 1.0, 8.0))
    return figure


def _turn(place: Any) -> Any:
    """Places (..., 2) of the chute, as they lie on the page."""
    angle = np.radians(ANGLE)
    return np.asarray(place) @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _back(direction: Any) -> Any:
    angle = np.radians(ANGLE)
    return np.asarray(direction) @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def _line(ax: Axes, start: Any, end: Any, colour: str = style.BLACK) -> None:
    x, y = _turn(np.array([start, end])).T
    ax.plot(x, y, **style.LineStyle(colour).line(1.0))


def _arrow(ax: Axes, start: Any, end: Any, name: str, offset: tuple[float, float], colour: str = style.BLACK) -> None:
    tail, head = _turn(start), _turn(end)
    properties = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.0, "shrinkA": 0.0, "shrinkB": 0.0}
    ax.annotate("", tuple(head), tuple(tail), arrowprops=properties)
    if name:
        style.write(ax, head[0], head[1], name, xytext=offset, fontsize=11)
