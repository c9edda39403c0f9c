"""Pictures of results, in the style of the paper's figures; matplotlib is imported when one is drawn."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from io import BytesIO
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.branches.lines import in_order, runs, smooth
from chuteflow.branches.results import KINDS, Branch, Curve, FlowSet
from chuteflow.io import words
from chuteflow.io.contract import PLACE, factor
from chuteflow.io.tables import number
from chuteflow.io.writing import require_writable, write_whole
from chuteflow.parameters import PARAMETERS
from chuteflow.plotting import style
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow, Profile
from chuteflow.steady.quantities import NUMBERS, Scales

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Endings that figures are written with.
SUFFIXES = (".png", ".pdf", ".svg")
_FIELDS = ("volume_fraction", "granular_temperature", "velocity")
_PANELS = (("mass_flux", "centre_of_mass"), ("mass_flux", "mass_holdup"), ("mass_holdup", "centre_of_mass"))
_POINTS = 401
#: Profiles are drawn up to so many times the largest centre of mass.
_TOP = 2.5
#: Markers and names of the kinds of special points; a kind without is a star.
_MARKERS = {
    "fold-Q": ("o", "fold in $Q$"),
    "fold-M": ("s", "fold in $M$"),
    "fold-T": ("^", f"fold in ${NUMBERS['surface_temperature'].latex}$"),
    "density-inversion": ("D", "onset of density inversion"),
    "interior-change": ("v", "change of interior"),
    "stability-change": ("P", "change of stability"),
}
#: What lies beneath the stretches of a curve whose flows pass these limits of the theory.
_HALOS = {"packed: beyond the theory": "#adadad", "dense: beyond the theory": "#d6d6d6", "layered": "#f6cf97"}
_RESOLUTION = 300


@style.own_settings()
def plot_flows(flow_set: FlowSet, *, scales: Scales | None = None) -> Figure:
    """Profiles of volume fraction, temperature and velocity, each flow with its own colour and dashes.

    Heights and fields are dimensionless, or in SI units where ``scales`` are given.
    """
    chute = flow_set.chute
    if not len(flow_set):
        return _none(chute, flow_set.reason)
    figure, axes = style.panels(3, height=2.9 + 0.17 * len(flow_set), shared_y=True)
    top = _TOP * max(flow.centre_of_mass for flow in flow_set)
    for i, flow in enumerate(flow_set):
        profile = flow.sampled(_POINTS, min(top, flow.interface_height))
        for ax, field in zip(axes, _FIELDS, strict=True):
            ax.plot(
                getattr(profile, field) * factor(field, chute, scales),
                profile.height * factor("height", chute, scales),
                label=f"{words.among(flow, flow_set)}: {_numbers_of(flow, chute, scales)}; {flow.validity.summary}",
                **style.stroke(i).line(),
            )
    for ax, field in zip(axes, _FIELDS, strict=True):
        style.name_axes(ax, style.label(field, scales), style.label("height", scales) if ax is axes[0] else None)
        ax.set_xlim(left=0.0)
        ax.set_ylim(0.0, top * factor("height", chute, scales))
    style.caption(figure, parameters(chute))
    style.legend(figure, handles=axes[0].get_lines(), loc="outside lower center")
    return figure


@style.own_settings()
def plot_profile(profile: Profile) -> Figure:
    """Volume fraction, temperature and velocity of one profile against height."""
    figure, axes = style.panels(3, height=2.7, shared_y=True)
    height = np.ravel(profile.height)
    for ax, field in zip(axes, _FIELDS, strict=True):
        ax.plot(np.ravel(getattr(profile, field)), height, **style.stroke(0).line())
        style.name_axes(ax, style.label(field), style.label("height") if ax is axes[0] else None)
        ax.set_xlim(left=0.0)
    return figure


@style.own_settings()
def plot_curve(curve: Curve, *, scales: Scales | None = None) -> Figure:
    """Centre of mass, hold-up and flux against one another along every branch, special points marked.

    Solid where the density is inverted, dashed where it is monotonic. Axes are logarithmic where the branches
    span much.
    """
    if not curve.branches:
        return _none(curve.chute, curve.reason)
    figure, axes = style.panels(3, height=3.2)
    for ax, pair in zip(axes, _PANELS, strict=True):
        shade_beyond(ax, curve, pair, scales)
        for i, branch in enumerate(curve.branches):
            colour = _colour(i, curve)
            for run in runs(branch):
                ax.plot(
                    *line(run.flows, pair, curve, scales),
                    **style.LineStyle(colour, style.OF_DENSITY[run.density]).line(),
                )
        frame(ax, curve, pair, scales)
    style.caption(figure, parameters(curve.chute))
    style.legend(figure, handles=[*_key(curve), *key_of_beyond(curve)], loc="outside lower center", ncols=4)
    return figure


def frame(ax: Axes, curve: Curve, pair: tuple[str, str], scales: Scales | None) -> None:
    """Mark the special points of a curve against a ``pair`` of numbers, and scale and name the axes."""
    mark(ax, curve, pair, scales)
    for axis, name in zip("xy", pair, strict=True):
        style.spread_scale(ax, axis, [getattr(branch, name) for branch in curve.branches])
    style.name_axes(ax, *(style.label(name, scales) for name in pair))


def write_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write ``figure`` to ``path``: .png, .pdf or .svg, whole or not at all.

    Raises:
        InputError: for another ending, or a file that cannot be written.
    """
    suffix = require_writable(path, SUFFIXES)
    # Pictures of one result are the same bytes, whenever they are drawn.
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(suffix, {})
    stream = BytesIO()
    with style.own_settings():
        figure.savefig(stream, format=suffix[1:], dpi=_RESOLUTION, metadata=undated)
    write_whole(path, stream.getvalue())


def _none(chute: Chute, reason: str | None) -> Figure:
    figure = style.sentence(f"No flow: {reason}.")
    style.caption(figure, parameters(chute))
    return figure


def parameters(chute: Chute, *left_out: str) -> str:
    """The parameters of ``chute`` for a caption, but for those ``left_out``, which stand on the axes."""
    numbers = [
        f"${parameter.latex} = {getattr(chute, name):.5g}$"
        for name, parameter in PARAMETERS.items()
        if name not in left_out
    ]
    surface = {"free": "free surface", "interface": "interface"}[chute.surface]
    return ", ".join([*numbers, surface, chute.laws])


def _numbers_of(flow: Flow, chute: Chute, scales: Scales | None) -> str:
    units = {name: "" if scales is None else f" {style.format_unit(NUMBERS[name].unit)}" for name in PLACE}
    return ", ".join(
        f"${NUMBERS[name].latex} = {style.in_formula(number(value))}${units[name]}"
        for name in PLACE
        for value in [getattr(flow, name) * factor(name, chute, scales)]
    )


def values(flows: Sequence[Any], name: str, curve: Curve, scales: Scales | None) -> Any:
    """A number of the registry of each flow, scaled."""
    return np.array([getattr(flow, name) for flow in flows]) * factor(name, curve.chute, scales)


def line(flows: Sequence[Any], pair: tuple[str, str], curve: Curve, scales: Scales | None) -> list[Any]:
    """Two numbers of neighbouring flows of a branch as a smooth line, scaled."""
    drawn = smooth(flows)
    return [drawn[name] * factor(name, curve.chute, scales) for name in pair]


def shade_beyond(ax: Axes, curve: Curve, pair: tuple[str, str], scales: Scales | None) -> None:
    """Underlay the stretches whose flows are too dense for the theory, or whose density turns more than once."""
    for branch in curve.branches:
        for word, flows in _beyond(branch):
            ax.plot(*line(flows, pair, curve, scales), **_halo(word))


def key_of_beyond(curve: Curve) -> Iterator[Any]:
    """Entries of the legend for what :func:`shade_beyond` underlays."""
    from matplotlib.lines import Line2D

    found = {word for branch in curve.branches for word, _ in _beyond(branch)}
    for word in _HALOS:
        if word in found:
            yield Line2D([], [], label=word, **_halo(word))


def _beyond(branch: Branch) -> Iterator[tuple[str, list[Flow]]]:
    flows = [point.flow for point in in_order(branch)]
    passed = [set(flow.validity.words) for flow in flows]
    for word in _HALOS:
        for holds, indices in groupby(range(len(flows)), key=lambda i, word=word: word in passed[i]):
            stretch = [flows[i] for i in indices]
            if holds:
                yield word, stretch


def _halo(word: str) -> dict[str, Any]:
    return {"color": _HALOS[word], "linewidth": 5.0, "solid_capstyle": "butt", "zorder": 0.5}


def mark(ax: Axes, curve: Curve, pair: tuple[str, str], scales: Scales | None) -> None:
    """Put a marker at each special point of the curve."""
    for branch in curve.branches:
        for point in branch.special:
            x, y = (values([point.flow], name, curve, scales) for name in pair)
            ax.plot(x, y, **marker(point.kind))


def _colour(index: int, curve: Curve) -> str:
    return style.BLACK if len(curve.branches) == 1 else style.stroke(index).colour


def marker(kind: str) -> dict[str, Any]:
    """Settings of the marker of a kind of special point."""
    return {
        "marker": _MARKERS.get(kind, ("*", kind))[0],
        "markersize": 4.5,
        "markerfacecolor": "white",
        "markeredgecolor": style.BLACK,
        "markeredgewidth": 0.9,
        "linestyle": "none",
        "zorder": 3,
    }


def _key(curve: Curve) -> Iterator[Any]:
    """Entries of the legend: branches if there are several, the kinds of density and of special points."""
    from matplotlib.lines import Line2D

    if len(curve.branches) > 1:
        for i in range(len(curve.branches)):
            yield Line2D([], [], label=f"branch {i + 1}", **style.LineStyle(_colour(i, curve)).line())
    densities = {run.density for branch in curve.branches for run in runs(branch)}
    for density, dashes in style.OF_DENSITY.items():
        if density in densities:
            yield Line2D([], [], label=f"density {density}", **style.LineStyle(style.BLACK, dashes).line())
    yield from key_of_kinds(curve)


def key_of_kinds(curve: Curve) -> Iterator[Any]:
    """Entries of the legend for the kinds of special points that there are."""
    from matplotlib.lines import Line2D

    found = {point.kind for branch in curve.branches for point in branch.special}
    for kind in KINDS:
        if kind in found:
            yield Line2D([], [], label=_MARKERS.get(kind, ("*", kind))[1], **marker(kind))
