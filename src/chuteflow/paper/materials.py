"""The chutes that the paper's figures share."""

from __future__ import annotations

from chuteflow import Chute


def dissipative(slope: float, surface: str = "free", closure: str = "lun") -> Chute:
    """Figures 2 to 4 and 7 to 17: e = e_w = 0.8, r = 0.6."""
    return Chute(slope, restitution=0.8, wall_restitution=0.8, roughness=0.6, surface=surface, closure=closure)


def productive(slope: float, surface: str = "free", closure: str = "lun") -> Chute:
    """Figures 5 and 6: e = 0.9, e_w = 0.6, r = 0.8."""
    return Chute(slope, restitution=0.9, wall_restitution=0.6, roughness=0.8, surface=surface, closure=closure)
