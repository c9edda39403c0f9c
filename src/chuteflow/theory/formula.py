"""Laws with parameters: a frozen dataclass whose fields are the parameters, and which is called for the coefficients.

# notation: nu volume fraction, free_fraction = 1 - nu/nu*, nu* densest packing, e restitution.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from chuteflow.checks import number, shorten
from chuteflow.errors import InputError
from chuteflow.theory.constitutive import CLUSTERED, Coefficients, Field
from chuteflow.theory.friction import FRICTIONS, effective_restitution
from chuteflow.theory.radial import Radial, radial

#: Largest friction coefficient that is allowed.
_MOST_FRICTION = 2.0


@dataclass(frozen=True)
class Formula:
    """What the laws of this package have in common.

    Args:
        radial: name of the radial distribution function, see :data:`chuteflow.theory.radial.RADIALS`.
        packing: volume fraction at which that diverges; by default the function's own.
        friction: friction coefficient mu of the grains, which lowers the restitution in the dissipation.
        friction_model: how it does, see :data:`chuteflow.theory.friction.FRICTIONS`.

    Raises:
        InputError: for a value that is unknown or out of range, naming it.
    """

    radial: str = "lun-savage"
    packing: float | None = None
    friction: float = 0.0
    friction_model: str = "jenkins-zhang"

    def __post_init__(self) -> None:
        if self.packing is not None:
            object.__setattr__(self, "packing", number("packing", self.packing))
        self._radial.choose_packing(self.packing)
        object.__setattr__(self, "friction", number("friction", self.friction, 0.0, _MOST_FRICTION))
        if self.friction_model not in FRICTIONS:
            raise InputError(
                f"unknown friction model {shorten(self.friction_model)}: choose one of {', '.join(FRICTIONS)}"
            )

    @abstractmethod
    def __call__(self, nu: Field, free_fraction: Field, e: float, slope: float) -> Coefficients:
        """The coefficients at ``nu``, see :class:`chuteflow.theory.constitutive.Law`."""

    @property
    def densest(self) -> float:
        """nu*."""
        return self._radial.choose_packing(self.packing)

    def breaks(self, e: float, slope: float) -> tuple[float, ...]:
        """Volume fractions at which a coefficient is not smooth, ascending."""
        del e, slope
        return self._radial.breaks

    @property
    def smooth(self) -> bool:
        """Whether there are no breaks at any e and slope."""
        return not self._radial.breaks

    @property
    def dense_limit(self) -> float:
        """The volume fraction up to which the law is meant: above, grains form clusters and chains."""
        return CLUSTERED

    def radial_at(self, nu: Field, free_fraction: Field) -> tuple[Field, Field]:
        """g0 and g0'/g0."""
        return self._radial.function(nu, free_fraction, self.densest)

    def loss_restitution(self, e: Any) -> Any:
        """The restitution in the dissipation, with friction.

        Raises:
            InputError: where friction leaves none.
        """
        if self.friction == 0.0:
            return e
        return effective_restitution(self.friction_model, e, self.friction)

    @property
    def _radial(self) -> Radial:
        return radial(self.radial)


def crossings(values: Field, places: Field, between) -> list[float]:
    """Zeros of a function between neighbouring ``places`` at which its ``values`` differ in sign, by bisection."""
    found = []
    above = values >= 0.0
    for i in np.flatnonzero(above[1:] != above[:-1]).tolist():
        low, high = float(places[i]), float(places[i + 1])
        while True:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            if (between(middle) >= 0.0) == above[i]:
                low = middle
            else:
                high = middle
        found.append(high)
    return found


def parsed(formula: object, name: str, text: str) -> float | str | bool | None:
    """The value of the parameter ``name`` of ``formula`` that ``text`` spells.

    Raises:
        InputError: for what is no number where one is needed.
    """
    now = getattr(formula, name)
    if isinstance(now, bool):
        if text.lower() not in ("true", "false", "yes", "no", "1", "0"):
            raise InputError(f"{name} = {shorten(text)}: must be true or false")
        return text.lower() in ("true", "yes", "1")
    if isinstance(now, str):
        return text
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{name} = {shorten(text)}: must be a number") from None
    if not math.isfinite(value):
        raise InputError(f"{name} = {shorten(text)}: must be a finite number")
    return value
