"""What files say of themselves: the paper, what they hold, and what their numbers are."""

from __future__ import annotations

from chuteflow.steady.quantities import Scales

#: The paper whose theory is solved.
PAPER = (
    "Woodhouse, M. J., Hogg, A. J. & Sellar, A. A. 2010 Rapid granular flows down inclined planar chutes. "
    "Part 1. Steady flows, multiple solutions and existence domains. J. Fluid Mech."
)
#: What each kind of result is.
TITLES = {
    "flow": "one steady, fully developed flow of grains down a chute",
    "flows": "every steady, fully developed flow of grains down a chute, under one condition",
    "curve": "the branches of steady, fully developed flows of grains down a chute",
}


def numbers_are(scales: Scales | None) -> str:
    """What the numbers in a file are scaled with."""
    if scales is None:
        return (
            "dimensionless: lengths in grain diameters d, times in sqrt(d/(g cos theta)), densities in that of a grain"
        )
    return (
        f"SI units, for grains of diameter {scales.diameter} m and density {scales.density} kg/m^3 "
        f"under gravity {scales.gravity} m/s^2"
    )
