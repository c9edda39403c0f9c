"""Boundary conditions of the fully developed flow: Richman's bumpy base and the two surfaces.

# notation: r roughness, e_w wall restitution, s slope tan(theta), y = q/(p sqrt(T)).

All parameters may be complex, so that a step along the imaginary axis gives exact derivatives.
"""

from __future__ import annotations

import math

from chuteflow.parameters import PARAMETERS
from chuteflow.theory.constitutive import Field

#: Normal stress at the interface of Jenkins & Hanes (1993), (3.31) with its misprint corrected.
INTERFACE_STRESS = math.sqrt(math.pi) / 48.0

#: Range of the roughness for wall grains of the size of the flowing ones, section 2.2.
ROUGHNESS_RANGE = (PARAMETERS["roughness"].low, PARAMETERS["roughness"].high)


def kappa(roughness: float) -> float:
    """Geometry of the bumpy base, (2.11)."""
    lid = (1.0 - roughness**2) ** 0.5
    return 2.0 / 3.0 * (2.0 / (1.0 + lid) - lid)


def slip_coefficient(shear: Field, wall_shear: Field, roughness: float, slope: float) -> Field:
    """F1 of (3.16), slip velocity over sqrt(T); ``shear`` = g1/g2 and ``wall_shear`` = A g1/g2 at the base.

    It follows from the balance of momentum (3.11)-(3.14), with A in (3.13), where the paper has it not.
    """
    k = kappa(roughness)
    return slope / k * (math.sqrt(math.pi / 2.0) + k * shear - 0.5 * roughness**2 * wall_shear)


def base_loss(wall_restitution: float, roughness: float) -> float:
    """Energy lost in collisions with the base over p sqrt(T), (2.15)."""
    return math.sqrt(2.0 / math.pi) * 2.0 * (1.0 - wall_restitution) / (1.0 + (1.0 - roughness**2) ** 0.5)


def surface_flux(surface: str, slope: float) -> float:
    """Heat flux y at the surface: 0 on the half-line (2.16), -s^2 at the interface (3.32)."""
    return -(slope**2) if surface == "interface" else 0.0


def surface_stress(surface: str) -> float:
    """Normal stress at the surface: 0 on the half-line, (3.31) at the interface."""
    return INTERFACE_STRESS if surface == "interface" else 0.0
