"""Many measured flows together: functions, base and flux over those of the theory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.dem.comparison import COMPARED, FUNCTIONS
from chuteflow.dem.results import StudyResult
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_RATIOS = {"g1": r"$P_{zz}/(g_1 T)$", "g2": r"$-P_{xz}/(g_2\sqrt{T}\,u')$", "g5": r"$\gamma/(g_5 T^{3/2})$"}
_PAIRS = {
    "slip": (r"$F_1$ of the theory", r"$u_b/\sqrt{T_b}$ of the particles"),
    "base heat": (r"$F_2/g_1$ of the theory", r"$q/(M\sqrt{T_b})$ of the particles"),
}
#: Filled for the roughness by area, open for that by spacing; flows that are not shown to be steady are pale.
_MARKERS = {"area": "o", "spacing": "s"}
_PALE = 0.35


@style.own_settings()
def plot_results(results: Sequence[StudyResult]) -> Figure:
    """Six panels: the functions of the first law over nu, slip and heat at the base, and the flux over T."""
    figure, axes = style.panels(3, 2, height=5.4)
    values = sorted({one.measured.restitution for one in results})
    colours = {e: style.stroke(i).colour for i, e in enumerate(values)}
    for one in results:
        look = _look(one, colours)
        if one.is_slow:
            _functions(axes[:3], one, look)
            _base(axes[3:5], one, look)
        if one.state != "at rest":
            _fluxes(axes[5], one, look)
    for ax, name in zip(axes[:3], FUNCTIONS, strict=True):
        ax.axhline(1.0, color=style.GREY, linewidth=0.6)
        ax.set_xlim(left=0.0)
        style.name_axes(ax, r"volume fraction, $\nu$", _RATIOS[name])
        ax.set_ylim(0.5, 1.2 if name == "g1" else 1.5)
    for ax, (x, y) in zip(axes[3:5], _PAIRS.values(), strict=True):
        low, high = (f(f(ax.get_xlim()), f(ax.get_ylim())) for f in (min, max))
        ax.plot([low, high], [low, high], color=style.GREY, linewidth=0.6)
        style.name_axes(ax, x, y)
    axes[5].axhline(1.0, color=style.GREY, linewidth=0.6)
    style.logarithmic(axes[5], "x")
    style.logarithmic(axes[5], "y")
    style.name_axes(axes[5], "mean temperature, $T$", "$Q$ of the theory over $Q$ of the particles")
    _key(figure, results, colours)
    return figure


def _look(one: StudyResult, colours: dict[float, str]) -> dict[str, Any]:
    colour = colours[one.measured.restitution]
    return {"color": colour, "markersize": 3.0, "linestyle": "none", "alpha": 1.0 if one.state == "steady" else _PALE}


def _functions(axes: Sequence[Axes], one: StudyResult, look: dict[str, Any]) -> None:
    law = one.comparison.functions[0]
    nu = one.measured.tenths["volume_fraction"][COMPARED]
    for ax, name in zip(axes, FUNCTIONS, strict=True):
        if name in law.ratios:
            ax.plot(nu, law.ratios[name], marker="o", **look)


def _base(axes: Sequence[Axes], one: StudyResult, look: dict[str, Any]) -> None:
    for found in one.comparison.functions[0].differences:
        kind, _, by = found.name.partition(", r by ")
        if kind in _PAIRS:
            ax = axes[list(_PAIRS).index(kind)]
            ax.plot([found.theory], [found.measured], marker=_MARKERS[by], fillstyle=_fill(by), **look)


def _fluxes(ax: Axes, one: StudyResult, look: dict[str, Any]) -> None:
    closure = one.comparison.functions[0].closure
    temperature = one.measured.numbers.get("mean_temperature", np.nan)
    for by, marker in _MARKERS.items():
        for ratio in one.flux_ratios(closure, by)[:1]:
            ax.plot([temperature], [ratio], marker=marker, fillstyle=_fill(by), **look)


def _fill(by: str) -> Any:
    return "full" if by == "area" else "none"


def _key(figure: Figure, results: Sequence[StudyResult], colours: dict[float, str]) -> None:
    from matplotlib.lines import Line2D

    plain: dict[str, Any] = {"linestyle": "none", "markersize": 4.0}
    key = [Line2D([], [], color=colour, marker="o", label=f"$e = {e:g}$", **plain) for e, colour in colours.items()]
    key += [
        Line2D([], [], color=style.BLACK, marker=marker, fillstyle=_fill(by), label=f"r by {by}", **plain)
        for by, marker in _MARKERS.items()
    ]
    key.append(Line2D([], [], color=style.BLACK, marker="o", alpha=_PALE, label="not shown to be steady", **plain))
    closure = results[0].comparison.functions[0].closure
    still = sum(one.state == "at rest" for one in results)
    style.caption(
        figure, f"{len(results)} simulations over closure {closure}, {still} at rest; above: $p/M$ from 0.1 to 0.8"
    )
    style.legend(figure, handles=key, loc="outside lower center", ncols=4)
