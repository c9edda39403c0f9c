"""Figure 14: where flows exist, in the plane of slope and roughness.

Curves are bounds of hot flows by the reduced system; there are hot flows between lambda = 0 and lambda = 3, or, where
the interior is productive, between delta = 0 and lambda = 0. The bound printed in the paper, lambda = 2.284, is drawn
beside the exact one. Points mark flows of the full equations with a hold-up up to 30. Close to lambda = 3 hot flows are
extreme (the centre of mass is 1e24 T_inf at lambda = 2.91), and their hold-up grows without bound, so that at a given
T_inf the points do not follow the curve all the way; nor do they where M has exceeded 30.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow import QUANTITIES, Chute, hot
from chuteflow.maps import exists_at
from chuteflow.paper.data import FigureTable
from chuteflow.plotting import style
from chuteflow.theory.hot import LAMBDA_C, inversion_lambda, slope_at

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TEMPERATURES = (1.0, 10.0, 100.0, 500.0)
#: e and e_w of the panels, and their slopes.
PANELS = {(0.8, 0.8): (0.1, 0.525), (0.9, 0.6): (0.175, 0.6)}
SLOPE_STEP, ROUGHNESS_STEP = 0.0125, 0.02
ROUGHNESS = (0.5, 0.86)
HIGHEST_ROUGHNESS = float(np.sqrt(0.75))
PRINTED_LAMBDA_C = 2.284
#: Values of lambda with their strokes and words.
CURVES = {
    0.0: (style.LineStyle(style.BLACK, style.SOLID), r"$\lambda = 0$"),
    inversion_lambda(): (style.LineStyle(style.GREEN, style.DOTTED), r"$\lambda = 0.660$, onset of inversion"),
    PRINTED_LAMBDA_C: (style.LineStyle(style.BLUE, style.DASHED), r"$\lambda = 2.284$, as printed"),
    LAMBDA_C: (style.LineStyle(style.VERMILION, style.SOLID), r"$\lambda = 3$, exact"),
}
DELTA_STROKE = style.LineStyle(style.PURPLE, style.DASH_DOTTED)
#: Diameters of the rings, from cold to hot.
RINGS = (1.3, 3.4, 5.6, 7.8)


@dataclass(frozen=True, eq=False)
class DomainPanel:
    """One panel: points (slope, roughness) with ``exists`` (points, temperatures), and the curves of lambda.

    A curve is the slope (or nan) over ``roughness``; ``balance`` is the slope where delta = 0.
    """

    slope: Any
    point_roughness: Any
    exists: Any
    roughness: Any
    curves: dict[float, Any]
    balance: float


@dataclass(frozen=True, eq=False)
class Figure14:
    """Both panels, by e and e_w."""

    domains: dict[tuple[float, float], DomainPanel]

    def table(self) -> FigureTable:
        """The points of both panels, then their curves."""
        columns: dict[str, list[Any]] = {name: [] for name in ("e", "e_w", "kind", "slope", "roughness")}
        flags = {f"flow_at_T_inf_{temperature:g}": [] for temperature in TEMPERATURES}
        for (e, e_w), domain in self.domains.items():
            blocks = [("point", domain.slope, domain.point_roughness, domain.exists)]
            nothing = np.full((len(domain.roughness), len(TEMPERATURES)), None)
            for value, slopes in domain.curves.items():
                blocks.append((f"lambda = {value:.4g}", slopes, domain.roughness, nothing))
            blocks.append(("delta = 0", np.full(len(domain.roughness), domain.balance), domain.roughness, nothing))
            for kind, slope, roughness, exists in blocks:
                keep = np.isfinite(slope)
                count = int(keep.sum())
                columns["e"] += [e] * count
                columns["e_w"] += [e_w] * count
                columns["kind"] += [kind] * count
                columns["slope"] += slope[keep].tolist()
                columns["roughness"] += roughness[keep].tolist()
                for flag, values in zip(flags.values(), exists.T, strict=True):
                    flag += ["" if value is None else int(value) for value in values[keep]]
        note = "1 where the full equations have a flow with a hold-up up to 30, 0 where they have none"
        return FigureTable("Figure 14: where flows exist", (note,), columns | flags)


def compute() -> Figure14:
    """Points and curves of both panels."""
    return Figure14({material: domain(*material, *slopes) for material, slopes in PANELS.items()})


def domain(e: float, e_w: float, lowest: float, highest: float) -> DomainPanel:
    """Points and curves for one material, for slopes from ``lowest`` to ``highest``."""
    slopes = np.arange(lowest, highest + 1e-9, SLOPE_STEP)
    levels = np.arange(ROUGHNESS[0], ROUGHNESS[1] + 1e-9, ROUGHNESS_STEP)
    points = [(float(slope), float(r)) for slope in slopes for r in levels]
    exists = exists_at([Chute(slope, e, e_w, r) for slope, r in points], TEMPERATURES)
    roughness = np.linspace(ROUGHNESS[0], HIGHEST_ROUGHNESS, 200)
    limit = hot(Chute(0.3, e, e_w, 0.6)).parameters.dilute
    curves = {value: _slopes([slope_at(limit, e_w, float(r), value) for r in roughness]) for value in CURVES}
    place = np.array(points)
    return DomainPanel(place[:, 0], place[:, 1], exists, roughness, curves, float(np.sqrt(limit.g20 * limit.g52)))


def _slopes(found: list[float | None]) -> Any:
    return np.array([np.nan if slope is None else slope for slope in found])


def draw(data: Figure14) -> Figure:
    """Two panels; at each point one ring for each temperature with a flow, the hotter the wider."""
    figure, axes = style.panels(1, 2, width=6.6, height=8.4)
    for ax, ((e, e_w), found) in zip(axes, data.domains.items(), strict=True):
        _points(ax, found)
        for value, (stroke, words) in CURVES.items():
            ax.plot(found.curves[value], found.roughness, label=words, **stroke.line(1.6), zorder=3)
        ax.axvline(found.balance, label=r"$\delta = 0$", **DELTA_STROKE.line(), zorder=3)
        style.write(ax, *_corner(e, e_w), f"$e = {e}$, $e_w = {e_w}$", va="bottom", ha="left")
        style.name_axes(ax, r"slope $\tan\theta$", "roughness, $r$")
        ax.set_xlim(*PANELS[e, e_w])
        ax.set_ylim(ROUGHNESS[0] - 0.012, HIGHEST_ROUGHNESS + 0.012)
    style.legend(axes[0], loc="upper left", bbox_to_anchor=(0.0, 0.98))
    return figure


def _corner(e: float, e_w: float) -> tuple[float, float]:
    return PANELS[e, e_w][0] + 0.01, ROUGHNESS[1] + 0.006


def _points(ax: Axes, found: DomainPanel) -> None:
    for index, (temperature, size) in enumerate(zip(TEMPERATURES, RINGS, strict=True)):
        there = found.exists[:, index]
        ax.plot(
            found.slope[there],
            found.point_roughness[there],
            linestyle="none",
            marker="o",
            markersize=size,
            markerfacecolor=style.GREY if index == 0 else "none",
            markeredgecolor=style.GREY,
            markeredgewidth=0.6,
            label=rf"flow at ${QUANTITIES['surface_temperature'].latex} = {temperature:g}$",
        )
