"""Figures 12 and 13: a hot flow of the full equations, and what the reduced system of section 4 gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow import Profile, hot
from chuteflow.branches.lines import SteadyFlow
from chuteflow.paper.data import FigureTable, chute_note
from chuteflow.paper.sources import Source
from chuteflow.plotting import style
from chuteflow.theory.hot import HotParameters

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow import Chute

FIELDS = ("volume_fraction", "granular_temperature", "velocity")
FULL = style.LineStyle(style.BLUE, style.SOLID)
REDUCED = style.LineStyle(style.VERMILION, style.DASHED)


@dataclass(frozen=True, eq=False)
class HotProfiles:
    """A flow with its profile, and the same fields as the reduced system has them, at the same heights."""

    title: str
    flow: SteadyFlow
    lambda_: float
    profile: Profile
    reduced: dict[str, Any]

    def table(self) -> FigureTable:
        """Both profiles side by side."""
        columns = {"height": self.profile.height.tolist()}
        for name in FIELDS:
            columns[name] = getattr(self.profile, name).tolist()
            columns[f"{name}_reduced"] = self.reduced[name].tolist()
        notes = (chute_note(self.flow.chute), f"T_inf = {self.flow.surface_temperature}, lambda = {self.lambda_}")
        return FigureTable(self.title, notes, columns)

    def largest_distance(self, field: str) -> float:
        """Largest difference of the two over the largest value of the full equations."""
        full = getattr(self.profile, field)
        return float(np.abs(self.reduced[field] - full).max() / np.abs(full).max())


def hot_profiles(
    title: str, chute: Chute, temperature: float, z: Any, fields: tuple[Any, Any, Any], source: Source
) -> HotProfiles:
    """The hot flow at T_inf = ``temperature`` against the ``fields`` psi, tau and U of the reduced system at ``z``."""
    parameters = hot(chute).parameters
    flow = source.flows(chute, T_surface=temperature)[0]
    return HotProfiles(title, flow, parameters.lambda_, flow.profile(z), _scale(parameters, temperature, *fields))


def _scale(parameters: HotParameters, temperature: float, psi: Any, tau: Any, U: Any) -> dict[str, Any]:
    return {
        "volume_fraction": parameters.alpha / temperature * psi,
        "granular_temperature": temperature * tau,
        "velocity": parameters.F10 * np.sqrt(temperature) * U,
    }


def draw_profiles(data: HotProfiles, words: str, limits: tuple[tuple[float, float], ...], top: float) -> Figure:
    """Three panels, height upwards."""
    figure, axes = style.panels(3, shared_y=True)
    for ax, field, ends in zip(axes, FIELDS, limits, strict=True):
        ax.plot(getattr(data.profile, field), data.profile.height, label="full equations", **FULL.line())
        ax.plot(data.reduced[field], data.profile.height, label=words, **REDUCED.line())
        style.name_axes(ax, style.label(field), style.label("height") if ax is axes[0] else None)
        ax.set_xlim(*ends)
        ax.set_ylim(0.0, top)
    style.legend(axes[0], loc="upper right")
    return figure
