"""What a flow is called: by fixed limits of its own numbers, so that a flow has one name wherever it is met.

The surface temperature, in g d cos(theta), is the height in grain diameters over which the density falls by e far
above; the height of the centre of mass is in grain diameters as well.
"""

from __future__ import annotations

#: A flow is hot from the larger of these surface temperatures on, cold below the smaller, and warm between them.
HOT, COLD = 5.0, 1.0
#: Dense from this largest volume fraction on, dilute below the smaller, and moderately dense between them.
DENSE, DILUTE = 0.3, 0.1
#: Deep from this height of the centre of mass on, shallow below the smaller, and neither between them.
DEEP, SHALLOW = 5.0, 2.0


def name_of(surface_temperature: float, largest_volume_fraction: float, centre_of_mass: float) -> str:
    """The name of a flow with these (dimensionless) numbers, such as "hot, dilute, deep"."""
    words = (
        _word(surface_temperature, COLD, HOT, ("cold", "warm", "hot")),
        _word(largest_volume_fraction, DILUTE, DENSE, ("dilute", "moderately dense", "dense")),
        _word(centre_of_mass, SHALLOW, DEEP, ("shallow", "", "deep")),
    )
    return ", ".join(word for word in words if word)


def _word(value: float, low: float, high: float, words: tuple[str, str, str]) -> str:
    return words[0] if value < low else words[2] if value >= high else words[1]
