"""Pictures of modes: how large each field is at each height, and a section through one wave."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chuteflow.branches.results import FlowSet
from chuteflow.io import words
from chuteflow.io.contract import factor
from chuteflow.plotting import style
from chuteflow.plotting.plots import parameters
from chuteflow.stability.answers import StabilityAnswer
from chuteflow.steady.quantities import Scales

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chuteflow.stability.modes import Mode

#: Names of the disturbed fields on the axes, each relative to its largest size.
_NAMES = (r"$\nu'$", "$u'$", "$v'$", "$w'$", "$T'$")
#: Phases of a section, arrows along and up, and shades of the density.
_PHASES, _ARROWS, _SHADES = 97, (17, 13), 13
#: Where the axis of the moduli ends, which are at most 1: the legend is beyond.
_ROOM = 1.62
#: Sizes below this fraction of the largest velocity are none.
_NOTHING = 1e-9


@style.own_settings()
def plot_modes(flows: FlowSet, answers: Sequence[StabilityAnswer], *, scales: Scales | None = None) -> Figure:
    """The leading mode of each flow, one row each: moduli of its fields against height, and a section."""
    drawn = [answer for answer in answers if answer.modes]
    if not drawn:
        return _without_modes(flows)
    unit = style.unit("growth", scales)
    length, rate = (factor(name, flows.chute, scales) for name in ("height", "growth"))
    figure, axes = style.panels(2, len(drawn), width=7.2, height=0.5 + 2.7 * len(drawn))
    for row, answer in enumerate(drawn):
        mode = answer.modes[0]
        left, right = axes[2 * row], axes[2 * row + 1]
        top = min(1.4 * answer.flow.depth, float(mode.height[0]))
        _profiles(left, mode, top, length, scales)
        if mode.direction == "uniform":
            right.set_axis_off()
        else:
            _section(right, mode, top, length, scales)
        left.set_title(
            f"{words.among(answer.flow, flows)}: {mode.kind}, growth {rate * mode.growth:.3g}{unit}",
            loc="right",
            **style.title(),
        )
    style.caption(figure, parameters(flows.chute))
    return figure


def plot_budgets(flows: FlowSet, answers: Sequence[StabilityAnswer], *, scales: Scales | None = None) -> Figure:
    """The energy budget of the leading mode of each flow: bars of the terms, that add up to the growth rate."""
    from chuteflow.stability.budget import TERMS

    drawn = [answer for answer in answers if answer.modes]
    if not drawn:
        return _without_modes(flows)
    figure, axes = style.panels(1, len(drawn), width=7.2, height=0.6 + 2.9 * len(drawn))
    names = list(TERMS)
    rate = factor("growth", flows.chute, scales)
    places = np.arange(len(names), 0, -1)
    for ax, answer in zip(axes, drawn, strict=True):
        budget = answer.budget
        assert budget is not None  # as there are modes
        rates = rate * np.array([[term.kinetic, term.density, term.thermal] for term in budget.terms])
        # Parts of one sign are put end to end, on their side of zero.
        for sign in (1.0, -1.0):
            parts = np.where(sign * rates > 0.0, rates, 0.0)
            left = np.cumsum(parts, axis=1) - parts
            for i, part in enumerate(("kinetic", "density", "thermal")):
                label = part if sign > 0.0 else None
                ax.barh(places, parts[:, i], left=left[:, i], height=0.6, color=style.stroke(i + 1).colour, label=label)
        ax.plot(
            rates.sum(axis=1), places, linestyle="none", marker="|", markersize=11.0, color=style.BLACK, label="total"
        )
        ax.axvline(0.0, color=style.BLACK, linewidth=0.6)
        ax.axvline(
            rate * budget.mode.growth, label="growth rate", **style.LineStyle(style.BLACK, style.DOTTED).line(0.9)
        )
        ax.set_yticks(places, names)
        style.name_axes(ax, f"rate of the energy of the mode, over twice the energy{style.unit('growth', scales)}", "")
        title = f"{words.among(answer.flow, flows)}: {budget.mode.kind}, growth {rate * budget.mode.growth:.3g}"
        ax.set_title(title, loc="right", **style.title())
    style.caption(figure, parameters(flows.chute))
    handles, labels = axes[0].get_legend_handles_labels()
    style.legend(figure, handles=handles, labels=labels, loc="outside lower center", ncols=5)
    return figure


def _without_modes(flows: FlowSet) -> Figure:
    return style.sentence(f"No mode: {flows.reason or 'none is resolved'}.")


def _profiles(ax: Axes, mode: Mode, top: float, length: float, scales: Scales | None) -> None:
    height, disturbed = mode.sampled()
    fields = np.abs(disturbed)
    velocity = fields[1:4].max()
    shown = height <= top
    for i, (name, values) in enumerate(zip(_NAMES, fields, strict=True)):
        size = values[shown].max()
        if size > _NOTHING * velocity:
            ax.plot(values[shown] / size, length * height[shown], label=f"{name}, {size:.3g}", **style.stroke(i).line())
    ax.set_ylim(0.0, length * top)
    style.name_axes(ax, "modulus over its largest, as listed", style.label("height", scales))
    # Beside the curves, which it would hide.
    ax.set_xlim(-0.03, _ROOM)
    ax.set_xticks(np.linspace(0.0, 1.0, 5))
    style.legend(ax, loc="center right", handlelength=1.8, handletextpad=0.5)


def _section(ax: Axes, mode: Mode, top: float, length: float, scales: Scales | None) -> None:
    """Density (shaded where it is higher) and velocity in the plane of the wave, over one wavelength."""
    phase = np.linspace(0.0, 2.0 * np.pi, _PHASES)
    height, (nu, u, v, w, _) = mode.sampled()
    k = float(np.hypot(mode.kx, mode.ky))
    forward = (mode.kx * u + mode.ky * v) / k
    levels = np.linspace(0.0, top, 121)
    density = np.real(_at(levels, height, nu)[:, None] * np.exp(1j * phase))
    largest = np.abs(density).max() or 1.0
    ax.contourf(
        length * phase / k,
        length * levels,
        density / largest,
        levels=np.linspace(-1.0, 1.0, _SHADES),
        cmap="RdBu_r",
        alpha=0.75,
    )
    across, up = np.linspace(0.0, 2.0 * np.pi, _ARROWS[0] + 2)[1:-1], np.linspace(0.0, top, _ARROWS[1] + 2)[1:-1]
    waves = np.exp(1j * across)
    along, rising = (np.real(_at(up, height, f)[:, None] * waves) for f in (forward, w))
    # On the page a wavelength and the depth are of one size, whatever they are in grain diameters.
    stretch = (2.0 * np.pi / k) / top
    ax.quiver(length * across / k, length * up, along / stretch, rising, color=style.BLACK, width=0.0035, pivot="mid")
    which = {"along": "$x$", "across": "$y$", "oblique": "the wave"}[mode.direction]
    ax.set_ylim(0.0, length * top)
    style.name_axes(ax, f"distance along {which}{style.unit('height', scales)}", style.label("height", scales))
    title = "density disturbance (red more) and motion"
    ax.set_title(title, loc="right", **style.title())


def _at(levels: np.ndarray, height: np.ndarray, field: np.ndarray) -> np.ndarray:
    return np.interp(levels, height, np.real(field)) + 1j * np.interp(levels, height, np.imag(field))
