"""The laws of Garzo & Dufty (1999): any restitution, in the first Sonine approximation.

# notation: nu volume fraction, g0 radial distribution, X = nu g0, e restitution, c kurtosis of the homogeneous cooling
# state; eta, kappa, gamma, mu over their dilute elastic values (mu* in the source's scale).

V. Garzo and J. W. Dufty, Dense fluid transport for inelastic hard spheres, Phys. Rev. E 59, 5895.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chuteflow.theory.constitutive import Coefficients, Field, Law
from chuteflow.theory.formula import Formula

_ROOT_PI = float(np.sqrt(np.pi))
#: Dilute elastic viscosity and conductivity in the scales of (2.7).
_VISCOSITY, _CONDUCTIVITY = 5.0 * _ROOT_PI / 96.0, 25.0 * _ROOT_PI / 128.0


@dataclass(frozen=True)
class GarzoDufty(Formula):
    """The laws of Garzo & Dufty.

    Args:
        fourier: leave the heat flux along the density gradient away (g4 = 0).
        kurtosis: keep the terms of c.
    """

    fourier: bool = False
    kurtosis: bool = True

    @property
    def smooth(self) -> bool:
        """Whether there are no breaks, nor a flux that grows like 1/nu where dilute."""
        return super().smooth and self.fourier

    def __call__(self, nu: Field, free_fraction: Field, e: float, slope: float) -> Coefficients:
        """The coefficients; ``slope`` does not enter."""
        del slope
        g0, log_slope = self.radial_at(nu, free_fraction)
        x = nu * g0
        x_slope = g0 * (1.0 + nu * log_slope)
        f, lost = 1.0 + e, 1.0 - e
        c = 32.0 * lost * (1.0 - 2.0 * e**2) / (81.0 - 17.0 * e + 30.0 * e**2 * lost) if self.kurtosis else 0.0 * e
        compressibility = 1.0 + 2.0 * f * x
        # Rates, each with its g0.
        zeta = 5.0 / 12.0 * g0 * (1.0 - e**2) * (1.0 + 3.0 * c / 32.0)
        rate_eta = g0 * (1.0 - 0.25 * lost**2) * (1.0 - c / 64.0)
        rate_kappa = g0 * f / 3.0 * (1.0 + 33.0 * lost / 16.0 + (19.0 - 3.0 * e) * c / 1024.0)
        gamma = 128.0 / (5.0 * np.pi) * nu * x * f * (1.0 - c / 32.0)
        kinetic_eta = (1.0 - 0.4 * f * (1.0 - 3.0 * e) * x) / (rate_eta - 0.5 * zeta)
        eta = kinetic_eta * (1.0 + 0.8 * f * x) + 0.6 * gamma
        bracket = 2.0 * e - 1.0 + (0.5 * f - 5.0 / (3.0 * f)) * c
        kinetic_kappa = (
            2.0 / 3.0 * (1.0 + 0.5 * c * (1.0 + compressibility) + 0.6 * f**2 * bracket * x) / (rate_kappa - 2.0 * zeta)
        )
        collisional = 1.0 + 1.2 * f * x
        kappa = kinetic_kappa * collisional + 256.0 / (25.0 * np.pi) * nu * x * f * (1.0 + 7.0 * c / 32.0)
        if self.fourier:
            density_flux, density_conductivity = None, np.zeros_like(kappa)
        else:
            pressure_slope = compressibility + nu * 2.0 * f * x_slope  # d(nu p*)/dnu
            slope_term = nu * log_slope
            mixed = e * lost + 0.25 * c * (4.0 / 3.0 + e * lost)
            kinetic_mu = (
                2.0
                * (
                    (1.0 + slope_term) * zeta * kinetic_kappa
                    + pressure_slope * c / 3.0
                    - 0.8 * x * (1.0 + 0.5 * slope_term) * f * mixed
                )
                / (2.0 * rate_kappa - 3.0 * zeta)
            )
            density_flux = -_CONDUCTIVITY * kinetic_mu * collisional
            # Elastic grains have none; it diverges at nu = 0 otherwise.
            with np.errstate(divide="ignore", invalid="ignore"):
                density_conductivity = np.where(density_flux == 0.0, 0.0, density_flux / nu)
        loss = self.loss_restitution(e)
        return Coefficients(
            radial=g0,
            compressibility=compressibility,
            compressibility_slope=2.0 * f * x_slope,
            viscosity=_VISCOSITY * eta,
            conductivity=_CONDUCTIVITY * kappa,
            density_conductivity=density_conductivity,
            dissipation=12.0 / _ROOT_PI * (1.0 - loss**2) * g0 * (1.0 + 3.0 * c / 32.0),
            bulk_viscosity=_VISCOSITY * gamma,
            density_flux=density_flux,
        )


_SOURCE = "Garzo & Dufty 1999, Phys. Rev. E 59, 5895"

GARZO_DUFTY = Law.of(
    "garzo-dufty",
    "kinetic theory for any restitution, heat flux along temperature and density gradients",
    _SOURCE,
    GarzoDufty(),
    valid="e from about 0.6, where the Sonine expansion holds; nu below 0.49",
)
GARZO_DUFTY_FOURIER = Law.of(
    "garzo-dufty-fourier",
    "the same with Fourier's heat flux alone (g4 = 0)",
    _SOURCE,
    GarzoDufty(fourier=True),
    valid="e from about 0.6, where the Sonine expansion holds; nu below 0.49",
)
