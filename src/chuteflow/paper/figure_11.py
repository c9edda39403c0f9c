"""Figure 11: the parameters lambda and delta of high temperature flows as functions of the slope."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow import hot
from chuteflow.paper.data import FigureTable, chute_note
from chuteflow.paper.materials import dissipative
from chuteflow.plotting import style
from chuteflow.theory.hot import LAMBDA_C, inversion_lambda, slope_at

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SLOPES = np.linspace(0.15, 0.7, 551)
#: Ordinates of the panels.
LAMBDA, DELTA = (-30.0, 15.0), (-3.0, 2.5)

#: Where marked values of lambda are written, if not above to the left.
SIDES = {0.0: "above right", 1.0: "below right"}


@dataclass(frozen=True, eq=False)
class Figure11:
    """lambda and delta over slopes, the slope where delta vanishes, and those where lambda has a name."""

    slope: Any
    lambda_: Any
    delta: Any
    slope_of_divergence: float
    marks: dict[float, float]

    def table(self) -> FigureTable:
        """Both curves."""
        notes = [f"lambda = {value} at slope {slope}" for value, slope in self.marks.items()]
        return FigureTable(
            "Figure 11: lambda and delta against slope",
            (chute_note(dissipative(0.3)), f"delta = 0 at slope {self.slope_of_divergence}", *notes),
            {"slope": self.slope.tolist(), "lambda": self.lambda_.tolist(), "delta": self.delta.tolist()},
        )


def compute() -> Figure11:
    """From the reduced model of each slope."""
    parameters = [hot(dissipative(slope)).parameters for slope in SLOPES]
    chute, limit = dissipative(0.3), parameters[0].dilute
    marks = {}
    for value in (0.0, inversion_lambda(), 1.0, LAMBDA_C):
        slope = slope_at(limit, chute.wall_restitution, chute.roughness, value)
        if slope is not None:
            marks[value] = slope
    return Figure11(
        slope=SLOPES,
        lambda_=np.array([p.lambda_ for p in parameters]),
        delta=np.array([p.delta for p in parameters]),
        slope_of_divergence=float(np.sqrt(limit.g20 * limit.g52)),
        marks=marks,
    )


def draw(data: Figure11) -> Figure:
    """Two panels; lambda in two pieces, either side of where delta vanishes."""
    figure, axes = style.panels(2, height=3.0)
    stroke, guide = style.LineStyle(), style.LineStyle(style.GREY, style.DOTTED)
    for part in (data.delta > 0.0, data.delta < 0.0):
        axes[0].plot(data.slope[part], data.lambda_[part], **stroke.line())
    axes[1].plot(data.slope, data.delta, **stroke.line())
    for ax, name, limits in zip(axes, (r"$\lambda$", r"$\delta$"), (LAMBDA, DELTA), strict=True):
        ax.axhline(0.0, color=style.GREY, linewidth=0.6)
        ax.axvline(data.slope_of_divergence, **guide.line(0.8))
        style.name_axes(ax, r"slope $\tan\theta$", name)
        ax.set_xlim(data.slope[0], data.slope[-1])
        ax.set_ylim(*limits)
    for value, slope in data.marks.items():
        text = f"{value:.3g}"
        style.name_point(axes[0], slope, value, text, SIDES.get(value, "above left"))
    where = data.slope_of_divergence
    style.write(axes[0], where, LAMBDA[1], r"$\delta = 0$", xytext=(5.0, -2.0), va="top")
    style.write(axes[1], where, DELTA[1], "dissipative", xytext=(-6.0, -2.0), ha="right", va="top")
    style.write(axes[1], where, DELTA[1], "productive", xytext=(6.0, -2.0), va="top")
    return figure
