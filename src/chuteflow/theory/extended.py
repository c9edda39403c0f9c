"""Extended kinetic theory: the dissipation divided by the length of clusters and chains.

# notation: nu volume fraction, g0 radial distribution, X = nu g0, e restitution, S = |du/dz|/sqrt(T) shear rate,
# J and M of the sources, L correlation length in diameters, s slope tan(theta).

In a fully developed flow S = g1 s/g2, a function of nu and the slope. The other functions are those of Garzo & Dufty
(1999) without their kurtosis and density-gradient flux.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from chuteflow.checks import shorten
from chuteflow.errors import InputError
from chuteflow.theory.constitutive import Coefficients, Field, Law
from chuteflow.theory.formula import Formula, crossings
from chuteflow.theory.radial import FREEZING

_ROOT_PI = float(np.sqrt(np.pi))
#: Correlation lengths, and where they are from.
LENGTHS = {
    "berzi": "Berzi 2014, Acta Mech. 225, 2191",
    "jenkins-berzi": "Jenkins & Berzi 2010, Granular Matter 12, 151",
    "none": "L = 1: no clusters",
}
#: Densities at which the length is compared with 1.
_SCALED = np.geomspace(1e-6, 1e9, 1200)


@dataclass(frozen=True)
class Extended(Formula):
    """Extended kinetic theory.

    Args:
        length: the correlation length, see :data:`LENGTHS`.
    """

    radial: str = "vescovi"
    length: str = "berzi"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.length not in LENGTHS:
            raise InputError(f"unknown length {shorten(self.length)}: choose one of {', '.join(LENGTHS)}")

    def __call__(self, nu: Field, free_fraction: Field, e: float, slope: float) -> Coefficients:
        """The coefficients in a fully developed flow down ``slope``."""
        plain = self._without_length(nu, free_fraction, e)
        return self._shorten(plain, nu, free_fraction, e, slope * plain.compressibility / plain.viscosity)

    def at_shear(self, nu: Field, free_fraction: Field, e: float, rate: Field) -> Coefficients:
        """The coefficients where the shear rate over nu sqrt(T) is ``rate`` = S/nu, whatever the flow."""
        return self._shorten(self._without_length(nu, free_fraction, e), nu, free_fraction, e, rate)

    def breaks(self, e: float, slope: float) -> tuple[float, ...]:
        """Those of the radial function, and where the length becomes 1 or takes another form."""
        points = set(super().breaks(e, slope))
        if self.length == "none" or self.loss_restitution(e) == 1.0:
            return tuple(sorted(points))

        def excess(scaled: Any) -> Any:
            free_fraction = 1.0 / (1.0 + scaled / self.densest)
            nu = scaled * free_fraction
            plain = self._without_length(nu, free_fraction, e)
            return self._length(plain, nu, free_fraction, e, slope * plain.compressibility / plain.viscosity) - 1.0

        at = crossings(excess(_SCALED), _SCALED, excess)
        points |= {x / (1.0 + x / self.densest) for x in at}
        if self.length == "berzi" and excess(FREEZING / (1.0 - FREEZING / self.densest)) > 0.0:
            points.add(FREEZING)
        return tuple(sorted(points))

    @property
    def smooth(self) -> bool:
        """Whether there are no breaks at any e and slope."""
        return super().smooth and self.length == "none"

    @property
    def dense_limit(self) -> float:
        """The length accounts for clusters and chains: up to the densest packing."""
        return super().dense_limit if self.length == "none" else self.densest

    def _without_length(self, nu: Field, free_fraction: Field, e: float) -> Coefficients:
        g0, log_slope = self.radial_at(nu, free_fraction)
        x = nu * g0
        f, lost = 1.0 + e, 1.0 - e
        # J nu X and M nu X are finite at nu = 0.
        j = 0.5 * f * nu * x + np.pi / 32.0 * (5.0 + 2.0 * f * (3.0 * e - 1.0) * x) * (5.0 + 4.0 * f * x) / (
            (24.0 - 6.0 * lost**2 - 5.0 * (1.0 - e**2)) * g0
        )
        m = 0.5 * f * nu * x + 9.0 * np.pi / 144.0 * (5.0 + 3.0 * x * (2.0 * e - 1.0) * f**2) * (5.0 + 6.0 * x * f) / (
            f * (16.0 - 7.0 * lost) * g0
        )
        return Coefficients(
            radial=g0,
            compressibility=1.0 + 2.0 * f * x,
            compressibility_slope=2.0 * f * g0 * (1.0 + nu * log_slope),
            viscosity=8.0 / (5.0 * _ROOT_PI) * j,
            conductivity=4.0 / _ROOT_PI * m,
            density_conductivity=np.zeros_like(m),
            dissipation=12.0 / _ROOT_PI * (1.0 - self.loss_restitution(e) ** 2) * g0,
            bulk_viscosity=4.0 / (3.0 * _ROOT_PI) * f * nu * x,
        )

    def _shorten(self, plain: Coefficients, nu: Field, free_fraction: Field, e: float, rate: Field) -> Coefficients:
        """``plain`` with its dissipation over max(1, L); ``rate`` is S/nu."""
        if self.length == "none":
            return plain
        length = self._length(plain, nu, free_fraction, e, rate)
        return replace(plain, dissipation=plain.dissipation / np.where(np.real(length) > 1.0, length, 1.0))

    def _length(self, plain: Coefficients, nu: Field, free_fraction: Field, e: float, rate: Field) -> Field:
        """L without its lower bound 1."""
        if self.length == "jenkins-berzi":
            # No cube root of zero, whose derivative is infinite: the length is 0 there.
            return (
                0.25
                * np.where(nu == 0.0, 0.0, np.where(nu == 0.0, 1.0, nu) ** (4.0 / 3.0))
                * (plain.radial ** (1.0 / 3.0) * rate)
            )
        # J = (5 sqrt(pi)/8) g2/(nu^2 g0), so that sqrt(J) S is finite at nu = 0.
        j = 5.0 * _ROOT_PI / 8.0 * plain.viscosity / plain.radial
        lost = 1.0 - self.loss_restitution(e) ** 2
        left = self.densest * free_fraction
        beyond = np.where(np.real(nu) > FREEZING, (nu - FREEZING) / left, 0.0)
        # Elastic grains lose nothing over whatever length.
        with np.errstate(divide="ignore"):
            return np.sqrt(2.0 * j / (15.0 * lost)) * rate * (1.0 + 26.0 / 15.0 * lost * beyond) ** 1.5


EXTENDED = Law.of(
    "extended",
    "extended kinetic theory with the correlation length of Berzi",
    "Berzi 2014; radial function of Vescovi et al. 2014",
    Extended(),
    valid="e from about 0.7; above nu = 0.49 for sheared grains",
)
JENKINS_BERZI = Law.of(
    "jenkins-berzi",
    "extended kinetic theory with the correlation length of Jenkins & Berzi",
    "Jenkins & Berzi 2010; radial function of Torquato 1995",
    Extended(radial="torquato", length="jenkins-berzi"),
    valid="e from about 0.7; above nu = 0.49 for sheared grains",
)
