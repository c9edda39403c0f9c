"""Kinds of flows, by one definition for whatever samples a flow: of its density, and of its interior."""

from __future__ import annotations

from typing import Final

#: Whether the volume fraction falls with height everywhere.
MONOTONIC: Final = "monotonic"
INVERTED: Final = "inverted"
DENSITIES: Final = (MONOTONIC, INVERTED)

#: Whether collisions take more energy than shear work gives: everywhere, in some places, or nowhere.
DISSIPATIVE: Final = "dissipative"
MIXED: Final = "mixed"
PRODUCTIVE: Final = "productive"
INTERIORS: Final = (DISSIPATIVE, MIXED, PRODUCTIVE)


def density_kind(steepest_rise: float) -> str:
    """One of DENSITIES, by the largest rise of the volume fraction with height, per any positive scale."""
    return INVERTED if steepest_rise > 0.0 else MONOTONIC


def interior_kind(smallest: float, largest: float, rounding: float = 0.0) -> str:
    """One of INTERIORS, by the smallest and largest net loss of fluctuation energy, dissipation minus production;
    a loss or gain within ``rounding`` of zero decides nothing."""
    if smallest >= -rounding:
        return DISSIPATIVE
    return PRODUCTIVE if largest <= rounding else MIXED
