"""How far a flow keeps to what the theory takes for granted: numbers of it, and words where a limit is passed.

The limits are those of the assumptions, not of the program: a flow beyond one still solves the equations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chuteflow.theory.constitutive import CLUSTERED

#: Fraction of the densest packing of the law above which contacts last.
PACKED = 0.95
#: Slip velocity over sqrt(T) at the base above which slip is large: Richman (1988) takes it to be small.
SLIP = 1.0
#: Knudsen number above which grains meet too rarely for a continuum (G. A. Bird 1994).
RAREFIED = 0.1
#: Turns of the density with height from which on they are told.
TURNS = 2
#: Mean free path of spheres of diameter 1, times nu g0: 1/(6 sqrt(2)).
MEAN_FREE_PATH = 1.0 / (6.0 * math.sqrt(2.0))

#: The words, and what each means.
WORDS = {
    "packed: beyond the theory": f"nu_max above {PACKED:g} of the densest packing, where contacts last",
    "dense: beyond the theory": f"nu_max above {CLUSTERED:g}, where grains form clusters and chains",
    "large slip": "u_base above sqrt(T_base), where the condition at the base takes it to be small",
    "rarefied": f"mean free path above {RAREFIED:g} h: few collisions for a continuum",
    "layered": f"the density turns {TURNS} times or more with height",
}
#: What is said of a flow that passes no limit.
WITHIN = "within the theory"


@dataclass(frozen=True)
class Validity:
    """What a flow is held against; all numbers are dimensionless.

    ``largest_volume_fraction`` is nu_max and ``packing`` its fraction of the densest packing nu* of the law;
    ``slip_ratio`` is the slip velocity over sqrt(T) at the base; ``knudsen_number`` the mean free path over the
    height of the centre of mass, the path being d/(6 sqrt(2) nu g0) with the mean of nu g0 over all grains;
    ``density_turns`` counts how often the density turns between rising and falling with height; ``dense_limit`` is the
    volume fraction up to which the law is meant.
    """

    largest_volume_fraction: float
    packing: float
    slip_ratio: float
    knudsen_number: float
    density_turns: int
    dense_limit: float = CLUSTERED

    @property
    def words(self) -> tuple[str, ...]:
        """Of :data:`WORDS` those that hold."""
        packed = self.packing > PACKED
        passed = (
            packed,
            self.largest_volume_fraction > self.dense_limit and not packed,
            self.slip_ratio > SLIP,
            self.knudsen_number > RAREFIED,
            self.density_turns >= TURNS,
        )
        return tuple(word for word, holds in zip(WORDS, passed, strict=True) if holds)

    @property
    def summary(self) -> str:
        """The words on one line, or :data:`WITHIN`."""
        return ", ".join(self.words) or WITHIN
