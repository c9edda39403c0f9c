"""What a flow is called: by fixed limits of its own numbers, so that a flow has one name wherever it is met.

The surface temperature, in g d cos(theta), is the height in grain diameters over which the density falls by e far
above; the height of the centre of mass is in grain diameters as well.
"""

from __future__ import annotations

from bisect import bisect_right

#: Numbers of a flow with two limits each, and what it is called below them, between them, and from the larger one on.
LIMITS = {
    "surface_temperature": ((1.0, 5.0), ("cold", "warm", "hot")),
    "largest_volume_fraction": ((0.1, 0.3), ("dilute", "moderately dense", "dense")),
    "centre_of_mass": ((2.0, 5.0), ("shallow", "", "deep")),
}


def name_of(surface_temperature: float, largest_volume_fraction: float, centre_of_mass: float) -> str:
    """The name of a flow with these (dimensionless) numbers, such as "hot, dilute, deep"."""
    values = (surface_temperature, largest_volume_fraction, centre_of_mass)
    said = [words[bisect_right(limits, value)] for value, (limits, words) in zip(values, LIMITS.values(), strict=True)]
    return ", ".join(word for word in said if word)
