"""The laws of Lun et al. (1984), table 1, with the radial distribution of Lun & Savage (1986)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from chuteflow.theory.constitutive import Coefficients, Field, Law
from chuteflow.theory.formula import Formula

#: Densest packing nu* of the radial distribution function, table 1.
DENSEST = 0.62

_ROOT_PI = float(np.sqrt(np.pi))


@dataclass(frozen=True)
class Lun(Formula):
    """The laws of table 1.

    Args:
        fourier: leave the heat flux along the density gradient away (g4 = 0, the paper's appendix), for which T
            comes to T_inf as in (A2), and not as in (A1).
    """

    fourier: bool = False

    def __call__(self, nu: Field, free_fraction: Field, e: float, slope: float) -> Coefficients:
        """Table 1 as the paper has it; ``slope`` does not enter."""
        del slope
        full = table_1(nu, *self.radial_at(nu, free_fraction), e)
        if self.friction:
            full = replace(full, dissipation=12.0 / _ROOT_PI * (1.0 - self.loss_restitution(e) ** 2) * full.radial)
        if self.fourier:
            full = replace(full, density_conductivity=np.zeros_like(full.density_conductivity))
        return full


def table_1(nu: Field, g0: Field, log_slope: Field, e: float) -> Coefficients:
    """Table 1 for any radial distribution function ``g0``, with ``log_slope`` = g0'/g0.

    In terms of x = nu g0, with every 0/0 at nu = 0 divided out.
    """
    x = nu * g0
    x_slope = g0 * (1.0 + nu * log_slope)
    f = 1.0 + e
    return Coefficients(
        radial=g0,
        compressibility=1.0 + 2.0 * f * x,
        compressibility_slope=2.0 * f * x_slope,
        viscosity=_ROOT_PI * (5.0 + 4.0 * f * x) * (5.0 + 2.0 * f * (3.0 * e - 1.0) * x) / (120.0 * (3.0 - e) * f * g0)
        + 4.0 / (5.0 * _ROOT_PI) * f * nu * x,
        conductivity=_ROOT_PI
        * (5.0 + 6.0 * f * x)
        * (5.0 + 3.0 * f**2 * (2.0 * e - 1.0) * x)
        / (4.0 * f * (49.0 - 33.0 * e) * g0)
        + 2.0 / _ROOT_PI * f * nu * x,
        density_conductivity=3.0
        * _ROOT_PI
        * (5.0 + 6.0 * f * x)
        / (4.0 * (49.0 - 33.0 * e))
        * e
        * (1.0 - e)
        * (2.0 + nu * log_slope),  # d(nu^2 g0)/dnu / (nu g0)
        dissipation=12.0 / _ROOT_PI * (1.0 - e**2) * g0,
        bulk_viscosity=4.0 / (3.0 * _ROOT_PI) * f * nu * x,
    )


_VALID = "nearly elastic grains; nu below 0.49"

LUN = Law.of(
    "lun",
    "kinetic theory of inelastic spheres, heat flux along temperature and density gradients",
    "Lun et al. 1984; table 1",
    Lun(),
    valid=_VALID,
)

LUN_FOURIER = Law.of(
    "lun-fourier",
    "the same with Fourier's heat flux alone (g4 = 0)",
    "the paper's appendix",
    Lun(fourier=True),
    valid=_VALID,
)
