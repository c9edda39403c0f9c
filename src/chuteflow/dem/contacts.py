"""Contacts of grains: a linear spring and dashpot with a given restitution, and sliding friction on request.

# notation: k stiffness, m_eff effective mass, t_c duration of a contact, e restitution, v_n normal relative velocity.

Lengths are in grain diameters d, masses in rho_p d^3 (a grain has pi/6), times in sqrt(d/(g cos theta)). The force of a
contact with overlap delta is k delta - gamma v_n, v_n > 0 where the grains part, and ends with the overlap. A contact
lasts t_c = pi/sqrt(k/m_eff (1 - zeta^2)), whatever the speed, with the damping ratio zeta = -ln e/sqrt(pi^2 + ln^2 e).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chuteflow.checks import number

#: Mass of a grain.
MASS = math.pi / 6.0
#: Effective mass of two grains; one of them held fast, it is the mass of the other.
PAIR_MASS = 0.5 * MASS
#: Time steps in a contact of two grains at least, and for a bound of 1 on the restitution: the energy of elastic grains
#: then changes by less than 1e-4 in 10^5 steps where the bound is 1e-3.
FEWEST_STEPS, STEPS_FOR_ENERGY = 30, 0.08
#: A collision this many times as fast as sqrt(T) is the one whose overlap is bounded.
FAST = 4.0
#: Fraction of critical damping of the tangential dashpot, which friction limits.
TANGENTIAL_RATIO = 0.5


def damping_ratio(restitution: float) -> float:
    """zeta, the damping of a linear contact over the critical one; 0 where e = 1."""
    log = math.log(restitution)
    return -log / math.hypot(math.pi, log)


@dataclass(frozen=True)
class Bounds:
    """Bounds on contacts, which give the stiffness.

    Args:
        overlap: largest overlap in grain diameters of a collision with the normal speed 4 sqrt(T).
        contact_share: largest t_c over the mean time between collisions of a grain.
        restitution: largest error of the restitution in one collision, from which the time step follows. The
            duration of a contact is random by one step; over many collisions the errors cancel.
    """

    overlap: float = 0.02
    contact_share: float = 0.05
    restitution: float = 1e-3

    def __post_init__(self) -> None:
        for name, high in (("overlap", 0.2), ("contact_share", 0.5), ("restitution", 0.1)):
            object.__setattr__(self, name, number(name, getattr(self, name), 1e-5, high))


@dataclass(frozen=True)
class Contacts:
    """The forces between grains, and between a grain and the base.

    ``stiffness`` k is the same for both; the restitutions give the dashpots, and the time step is short enough for
    their errors in one collision to be at most ``restitution_error``. With ``friction`` mu > 0 the tangential force is
    that of a dashpot with half the critical damping, at most mu times the normal force.
    """

    stiffness: float
    restitution: float
    wall_restitution: float
    friction: float = 0.0
    restitution_error: float = 1e-3

    @property
    def duration(self) -> float:
        """t_c of two grains."""
        zeta = damping_ratio(self.restitution)
        return math.pi / math.sqrt(self.stiffness / PAIR_MASS * (1.0 - zeta**2))

    @property
    def time_step(self) -> float:
        """t_c over the number of steps that the bounds ask for: the impulse of the dashpot in one step, at the end of a
        contact, is 2 pi zeta e/steps of the momentum."""
        impulse = max(2.0 * math.pi * damping_ratio(e) * e for e in (self.restitution, self.wall_restitution))
        steps = max(impulse, STEPS_FOR_ENERGY) / self.restitution_error
        return self.duration / max(FEWEST_STEPS, math.ceil(steps))

    def damping(self, restitution: float, effective_mass: float) -> float:
        """gamma of the dashpot of a contact with this restitution."""
        return 2.0 * damping_ratio(restitution) * math.sqrt(self.stiffness * effective_mass)

    def tangential_ratio(self, restitution: float) -> float:
        """The tangential damping over the normal one; 0 without friction."""
        zeta = damping_ratio(restitution)
        return TANGENTIAL_RATIO / zeta if self.friction > 0.0 and zeta > 0.0 else 0.0


def contacts_for(
    bounds: Bounds,
    *,
    temperature: float,
    collision_rate: float,
    restitution: float,
    wall_restitution: float,
    friction: float = 0.0,
) -> Contacts:
    """The softest contacts within the bounds at a granular temperature and a collision rate of a grain."""
    speed = FAST * math.sqrt(temperature)
    # An undamped contact at speed v overlaps by v t_c/pi.
    shortest = min(bounds.overlap * math.pi / speed, bounds.contact_share / collision_rate)
    stiffness = PAIR_MASS * (math.pi / shortest) ** 2
    return Contacts(stiffness, restitution, wall_restitution, friction, bounds.restitution)
