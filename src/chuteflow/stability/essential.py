"""The continuous spectrum of a disturbed flow.

# notation: as in chuteflow.theory.transport; lambda = 4 eta/3 + xi, the viscosity of compression.

Density is only carried along, and waves that are short in z relax by viscosity and conduction. Conduction, the
faster the shorter they are, leaves no heat flux (2.5): T'/T = (g4/g3) nu' = (g4/g3) nu n. Then lambda w' balances
the disturbance of the pressure p = g1 T, and (2.1) leaves at each height

    sigma_c(z) = -i kx u(z) - nu T (dg1/dnu + g1 g4/g3) / (4 eta/3 + xi).

Far above the curve ends at -i kx u(infinity). It is not part of what a grid resolves: a grid shows some points
of it, and no more of them are modes than there are unresolved densities.
"""

from __future__ import annotations

import numpy as np

from chuteflow.numerics.chebyshev import Array, grid
from chuteflow.numerics.eigenproblem import Complex
from chuteflow.stability.base import BaseState, Resolution, overburden_fractions
from chuteflow.steady.flow import Flow

#: Points of the curve for each node of a grid.
_FINENESS = 6


def relaxation(flow_base: BaseState) -> tuple[Array, Array]:
    """u and -Re sigma_c on a grid several times as fine as that of ``flow_base``."""
    resolution = flow_base.resolution
    fine = Resolution(_FINENESS * resolution.degree, resolution.reach, resolution.beta)
    return relaxation_at(flow_base.flow, overburden_fractions(grid(fine.degree).nodes, fine)[0])


def relaxation_at(flow: Flow, fraction: Array) -> tuple[Array, Array]:
    """u and -Re sigma_c where ``fraction`` of the mass lies above."""
    profile = flow.at_overburden(fraction)
    nu, T = profile.volume_fraction, profile.granular_temperature
    chute, chosen = flow.chute, flow.law
    g = chosen.of_density(nu, chute.restitution, chute.slope)
    warming = g.density_conductivity / g.conductivity
    # dp/dnu where no heat flows
    stiffness = (g.compressibility + nu * (g.compressibility_slope + g.compressibility * warming)) * T
    viscosity = (4.0 / 3.0 * g.viscosity + g.bulk_viscosity) * np.sqrt(T)
    return profile.velocity, nu * stiffness / viscosity


def distance(values: Complex, curve: Complex) -> Array:
    """Distance of each of ``values`` (m,) to the polygon through the points of ``curve``."""
    start, step = curve[:-1], np.diff(curve)
    length = np.maximum(np.abs(step) ** 2, 1e-300)
    off = values[:, None] - start
    fraction = np.clip((off * step.conj()).real / length, 0.0, 1.0)
    return np.abs(off - fraction * step).min(axis=1)
