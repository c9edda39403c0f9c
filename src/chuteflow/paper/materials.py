"""The chutes that the paper's figures share: those of its cases, at other slopes."""

from __future__ import annotations

from chuteflow import Chute
from chuteflow.steady.cases import case


def dissipative(slope: float, surface: str = "free", closure: str = "lun") -> Chute:
    """Figures 2 to 4 and 7 to 17: e = e_w = 0.8, r = 0.6."""
    return case("paper-dissipative").chute(slope=slope, surface=surface, closure=closure)


def productive(slope: float, surface: str = "free", closure: str = "lun") -> Chute:
    """Figures 5 and 6: e = 0.9, e_w = 0.6, r = 0.8."""
    return case("paper-productive").chute(slope=slope, surface=surface, closure=closure)
