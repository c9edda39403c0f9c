"""Radial distribution functions at contact, g0(nu), a choice in every law.

# notation: nu volume fraction, nu_c = ``packing`` where g0 diverges, free_fraction = 1 - nu/nu_c.

Each takes (nu, free_fraction, packing) and returns g0 and g0'/g0, in plain arithmetic that also holds for complex
arguments, whose real part decides on which side of a break they are. All have g0(0) = 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from chuteflow.errors import InputError

Field = Any


@dataclass(frozen=True)
class Radial:
    """A radial distribution function.

    ``packing`` is the volume fraction at which it diverges unless another is chosen; ``fixed`` where none can be.
    ``breaks`` are the volume fractions at which it is not smooth, and ``valid`` is where it was fitted, in words.
    """

    name: str
    description: str
    source: str
    packing: float
    function: Callable[[Field, Field, float], tuple[Field, Field]]
    breaks: tuple[float, ...] = ()
    fixed: bool = False
    valid: str = ""

    def choose_packing(self, packing: float | None) -> float:
        """The packing that is meant where ``packing`` is given, or None.

        Raises:
            InputError: for one at which the function is not defined.
        """
        if packing is None:
            return self.packing
        if self.fixed and packing != self.packing:
            raise InputError(
                f"packing = {packing:g}: the radial function {self.name!r} diverges at {self.packing:g} and nowhere "
                "else: leave packing away, or take another radial function"
            )
        low = max((*self.breaks, 0.5))
        if not (self.fixed or low < np.real(packing) <= 0.74048):
            raise InputError(f"packing = {packing:g}: must be above {low:g} and at most 0.74048 (spheres in a lattice)")
        return packing


def lun_savage(nu: Field, free_fraction: Field, packing: float) -> tuple[Field, Field]:
    """(1 - nu/nu_c)^(-5 nu_c/2), table 1."""
    del nu
    return free_fraction ** (-2.5 * packing), 2.5 / free_fraction


def carnahan_starling(nu: Field, free_fraction: Field, packing: float) -> tuple[Field, Field]:
    """(1 - nu/2)/(1 - nu)^3."""
    # 1 - nu is the free fraction where nu_c = 1, and keeps its digits where nu_c is less.
    empty = free_fraction if packing == 1.0 else 1.0 - nu
    return (1.0 - 0.5 * nu) / empty**3, (2.5 - nu) / ((1.0 - 0.5 * nu) * empty)


def torquato(nu: Field, free_fraction: Field, packing: float) -> tuple[Field, Field]:
    """Carnahan & Starling up to 0.49; beyond, their value there times (nu_c - 0.49)/(nu_c - nu)."""
    low, low_slope = carnahan_starling(nu, free_fraction, packing)
    frozen, _ = carnahan_starling(FREEZING, 1.0, packing)
    dense = np.real(nu) > FREEZING
    left = packing * free_fraction
    return np.where(dense, frozen * (packing - FREEZING) / left, low), np.where(dense, 1.0 / left, low_slope)


def ma_ahmadi(nu: Field, free_fraction: Field, packing: float) -> tuple[Field, Field]:
    """(1 + 2.5 nu + 4.5904 nu^2 + 4.515439 nu^3)/(1 - (nu/nu_c)^3)^0.67802."""
    fraction = nu / packing
    top = 1.0 + nu * (2.5 + nu * (4.5904 + nu * 4.515439))
    top_slope = 2.5 + nu * (2.0 * 4.5904 + nu * 3.0 * 4.515439)
    # 1 - share^3, without cancellation near the packing
    left = free_fraction * (1.0 + fraction * (1.0 + fraction))
    return top * left**-0.67802, top_slope / top + 0.67802 * 3.0 * fraction**2 / (packing * left)


def vescovi(nu: Field, free_fraction: Field, packing: float) -> tuple[Field, Field]:
    """f CS + (1 - f) 2/(nu_c - nu); f = 1 below 0.4, and (nu_c - nu)(nu + nu_c - 0.8)/(nu_c - 0.4)^2 above."""
    low, low_slope = carnahan_starling(nu, free_fraction, packing)
    span = packing - MODERATE
    dense = np.real(nu) > MODERATE
    beyond = np.where(dense, (nu - MODERATE) / span, 0.0)  # 1 - f = beyond^2
    left = packing * free_fraction
    f = np.where(dense, left * (nu + packing - 2.0 * MODERATE) / span**2, 1.0)
    g0 = f * low + beyond**2 * 2.0 / left
    slope = f * low * low_slope - 2.0 * beyond / span * low + 4.0 * beyond / (span * left) + 2.0 * (beyond / left) ** 2
    return g0, slope / g0


def chialvo_sundaresan(nu: Field, free_fraction: Field, packing: float) -> tuple[Field, Field]:
    """CS + 0.58 nu^2/(nu_c - nu)^(3/2)."""
    low, low_slope = carnahan_starling(nu, free_fraction, packing)
    left = packing * free_fraction
    more = 0.58 * nu**2 * left**-1.5
    g0 = low + more
    return g0, (low * low_slope + 0.58 * nu * (2.0 + 1.5 * nu / left) * left**-1.5) / g0


#: Where hard spheres freeze, and where the function of Vescovi et al. leaves that of Carnahan & Starling.
FREEZING, MODERATE = 0.49, 0.4

RADIALS: dict[str, Radial] = {
    r.name: r
    for r in (
        Radial(
            "lun-savage", "(1 - nu/nu_c)^(-5 nu_c/2)", "Lun & Savage 1986; table 1 of the paper", 0.62, lun_savage
        ),
        Radial(
            "carnahan-starling", "hard spheres below freezing, knows nothing of packing",
            "Carnahan & Starling 1969", 1.0, carnahan_starling, fixed=True, valid="nu below 0.49",
        ),
        Radial(
            "torquato", "Carnahan-Starling to 0.49, then their value there times (nu_c - 0.49)/(nu_c - nu)",
            "Torquato 1995", 0.636, torquato, (FREEZING,),
        ),
        Radial(
            "ma-ahmadi", "virial series over (1 - (nu/nu_c)^3)^0.67802", "Ma & Ahmadi 1986", 0.64356, ma_ahmadi
        ),
        Radial(
            "vescovi", "Carnahan-Starling to 0.4, from there over to 2/(nu_c - nu)",
            "Vescovi et al. 2014", 0.636, vescovi, (MODERATE,),
        ),
        Radial(
            "chialvo-sundaresan", "Carnahan-Starling + 0.58 nu^2/(nu_c - nu)^(3/2)",
            "Chialvo & Sundaresan 2013", 0.636, chialvo_sundaresan,
        ),
    )
}  # fmt: skip


def radial(name: str) -> Radial:
    """The radial distribution function called ``name``.

    Raises:
        InputError: for an unknown name.
    """
    try:
        return RADIALS[name]
    except (KeyError, TypeError):
        raise InputError(f"unknown radial function {name!r}: choose one of {', '.join(RADIALS)}") from None
