"""The limit of the coldest, densest flows: between which slopes it exists.

# notation: y = q/(p sqrt(T)) heat flux, N = loss - s^2 work dissipation minus production, a conduction, k coupling.

Where the volume fraction tends to nu* the closures of the overburden form tend to constants, and the energy balance is
that of uniform grains: p y' + y + y (p T'/T)/2 = p N with p T'/T = p theta' + k (1 - p theta') and y = a theta'. Far
below the surface y tends to sqrt(2 a N/(1 - k)), which no flow of this density exceeds. So there is a flow where the
base gives less than that, and more than nothing.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from chuteflow import Chute
from chuteflow.numerics.roots import bisect
from chuteflow.theory import boundary
from chuteflow.theory.constitutive import reduce
from chuteflow.theory.laws import law

#: nu/(1 - nu/nu*) at which the limit is taken.
_DENSE = 1e10


@cache
def cold_slope_bounds(chute: Chute) -> tuple[float, float]:
    """Slopes between which ``chute`` has flows at vanishing temperature and near nu*; its own slope is not used."""
    r = reduce(law(chute.closure), np.array([_DENSE]), chute.restitution, chute.slope)
    nu = law(chute.closure).densest
    k = float(r.coupling[0] * nu / (r.stiffness[0] + r.coupling[0] * nu))

    def given(slope: float) -> float:
        slip = boundary.slip_coefficient(r.shear, r.wall_shear, chute.roughness, slope)
        return slope * float(slip[0]) - boundary.base_loss(chute.wall_restitution, chute.roughness)

    def surplus(slope: float) -> float:
        net = max(float(r.loss[0] - slope**2 * r.work[0]), 0.0)
        return given(slope) - math.sqrt(2.0 * float(r.conduction[0]) * net / (1.0 - k))

    return bisect(given, 0.0, 10.0), bisect(surplus, 0.0, 10.0)
