"""Figures 2, 7, 15 and 16: profiles of the three flows at Q = 3, on one chute or on two that are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chuteflow import Chute, Profile
from chuteflow.branches.lines import SteadyFlow
from chuteflow.paper.data import FigureTable, chute_note, stack
from chuteflow.paper.sources import Source

MASS_FLUX = 3.0
SLOPE = 0.3
FIELDS = ("volume_fraction", "granular_temperature", "velocity")
_POINTS = 401


@dataclass(frozen=True, eq=False)
class FlowProfiles:
    """Flows and profiles by name; where chutes are compared, by name and the word for the chute.

    ``fields`` and ``notes`` are those of the table, whose rows are told apart by the columns ``keys``.
    """

    title: str
    keys: tuple[str, ...]
    fields: tuple[str, ...]
    notes: tuple[str, ...]
    flows: Mapping[Any, SteadyFlow]
    profiles: Mapping[Any, Profile]

    def table(self) -> FigureTable:
        """The profiles, one below the other."""
        columns = stack(
            "flow",
            {
                key: {field: getattr(profile, field) for field in ("height", *self.fields)}
                for key, profile in self.profiles.items()
            },
        )
        rows = [key if isinstance(key, tuple) else (key,) for key in columns.pop("flow")]
        named = {name: [row[i] for row in rows] for i, name in enumerate(self.keys)}
        return FigureTable(self.title, self.notes, named | columns)


def flow_profiles(
    title: str,
    tops: Mapping[str, float],
    chutes: Mapping[str, Chute] | Chute,
    source: Source,
    *,
    compared: str = "",
    fields: Sequence[str] = FIELDS,
    note: Callable[[SteadyFlow], str] | None = None,
) -> FlowProfiles:
    """The three flows, named as in ``tops`` from hot to cold, and their profiles up to these heights.

    Args:
        title: of the table.
        tops: names of the flows, and the highest points of their profiles; these end at an interface.
        chutes: one chute, or several by the words for them.
        source: of the flows.
        compared: name of the column of these words.
        fields: of the table.
        note: what is noted of each flow.
    """
    several = chutes if isinstance(chutes, Mapping) else {"": chutes}
    found = {
        (name, word) if word else name: flow
        for word, chute in several.items()
        for name, flow in zip(tops, source.flows(chute, Q=MASS_FLUX), strict=True)
    }
    profiles = {
        key: flow.profile(np.linspace(0.0, min(flow.interface_height, tops[_name(key)]), _POINTS))
        for key, flow in found.items()
    }
    told = [] if note is None else [f"{_label(key)}: {note(flow)}" for key, flow in found.items()]
    notes = (*map(chute_note, several.values()), *told)
    return FlowProfiles(title, ("flow", compared) if compared else ("flow",), tuple(fields), notes, found, profiles)


def _name(key: str | tuple[str, str]) -> str:
    return key if isinstance(key, str) else key[0]


def _label(key: str | tuple[str, str]) -> str:
    return key if isinstance(key, str) else ", ".join(key)
