"""The laws of Lun et al. (1984), table 1, with the radial distribution of Lun & Savage (1986)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from chuteflow.theory.constitutive import Coefficients, Field, Law

#: Densest packing nu* of the radial distribution function, table 1.
DENSEST = 0.62

_ROOT_PI = float(np.sqrt(np.pi))


def lun(nu: Field, room: Field, e: float, slope: float) -> Coefficients:
    """Table 1 as the paper has it. ``slope`` does not enter."""
    del slope
    return table_1(nu, room ** (-2.5 * DENSEST), 2.5 / room, e)


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


def lun_fourier(nu: Field, room: Field, e: float, slope: float) -> Coefficients:
    """Table 1 with g4 = 0 (the paper's appendix), for which T comes to T_inf as in (A2), and not as in (A1)."""
    full = lun(nu, room, e, slope)
    return replace(full, density_conductivity=np.zeros_like(full.density_conductivity))


LUN = Law(
    name="lun",
    description="kinetic theory of inelastic spheres, heat flux along temperature and density gradients",
    source="Lun et al. 1984; table 1",
    densest=DENSEST,
    coefficients=lun,
)

LUN_FOURIER = Law(
    name="lun-fourier",
    description="the same with Fourier's heat flux alone (g4 = 0)",
    source="the paper's appendix",
    densest=DENSEST,
    coefficients=lun_fourier,
)
