"""Friction of the grains as an effective restitution in the dissipation.

# notation: mu friction coefficient, e restitution, beta_0 tangential restitution of grains that stick.
"""

from __future__ import annotations

import numpy as np

from chuteflow.errors import InputError
from chuteflow.theory.radial import Field

#: Ways to let friction lower the restitution, and where each is from.
FRICTIONS = {
    "chialvo-sundaresan": "Chialvo & Sundaresan 2013",
    "jenkins-zhang": "Jenkins & Zhang 2002, in full",
}
#: Tangential restitution at which grains that stick leave without tangential relative velocity.
_STICKING = 0.0


def effective_restitution(model: str, e: Field, friction: float) -> Field:
    """The restitution that the dissipation sees: ``e`` where there is no friction.

    Raises:
        InputError: for an unknown model.
    """
    if model == "chialvo-sundaresan":
        return e - 1.5 * friction * np.exp(-3.0 * friction)
    if model == "jenkins-zhang":
        return _jenkins_zhang(e, friction)
    raise InputError(f"unknown friction model {model!r}: choose one of {', '.join(FRICTIONS)}")


def _jenkins_zhang(e: Field, friction: float) -> Field:
    """e - a1/2 + a2 b1/(2 b2), with the rotation in balance.

    With m = (7/2) mu (1 + e)/(1 + beta_0), the ratio of tangential to normal velocity up to which grains stick, and
    mu/m finite as mu -> 0. To second order in mu this is e - pi mu/2 + 9 mu^2/2.
    """
    if friction == 0.0:
        return e
    ratio = 2.0 * (1.0 + _STICKING) / (7.0 * (1.0 + e))  # mu/m
    m = friction / ratio
    square = m * m
    sliding = m * (np.pi - 2.0 * np.arctan(m))  # pi m (1 - (2/pi) arctan m)
    a1 = ratio * (sliding + 2.0 * square / (1.0 + square) * (1.0 - 2.0 * ratio))
    a2 = 2.5 * ratio * (0.5 * sliding + (square - square**2) / (1.0 + square) ** 2)
    b1 = ratio**2 * square / (1.0 + square)
    b2 = 0.5 * ratio * (0.5 * sliding + square / (1.0 + square))
    return e - 0.5 * a1 + 0.5 * a2 * b1 / b2
