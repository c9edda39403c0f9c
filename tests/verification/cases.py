"""The chutes and conditions that the engine is verified on: named ones, and random ones near where flows exist."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .reference import QUANTITIES, Case, Table1


class Asked(NamedTuple):
    """A chute and a condition: QUANTITIES[``which``] = ``value``."""

    case: Case
    which: int
    value: float


def _asked(quantity: str, value: float, *parameters: float | str) -> Asked:
    return Asked(Case(*parameters), QUANTITIES.index(quantity), value)  # pyright: ignore[reportArgumentType]


#: Name: chute and condition, and the number of flows with T_surface from 1e-3 to 1e5 and M up to 30.
NAMED: dict[str, tuple[Asked, int]] = {
    "the paper's three flows": (_asked("Q", 3.0, 0.3, 0.8, 0.8, 0.6), 3),
    "the same below an interface, Fourier": (_asked("Q", 3.0, 0.3, 0.8, 0.8, 0.6, "interface", "lun-fourier"), 3),
    "two at one T_surface, productive": (_asked("T_surface", 1.0, 0.3, 0.9, 0.6, 0.8), 2),
    "two at one T_surface, rough": (_asked("T_surface", 1.0, 0.36, 0.8, 0.8, 0.85), 2),
    "four at one hold-up, deep": (_asked("M", 20.0, 0.29, 0.9, 0.8, 0.7), 4),
    "deep on a gentle slope": (_asked("M", 5.0, 0.27, 0.9, 0.8, 0.7), 2),
    "deep, surface known to no double": (_asked("M", 29.0, 0.3, 0.9, 0.6, 0.8), 2),
    "productive": (_asked("Q", 3.0, 0.4, 0.9, 0.6, 0.8), 1),
    "hot, steep": (_asked("T_surface", 1e3, 0.39, 0.8, 0.8, 0.6), 1),
    "elastic grains": (_asked("M", 1.0, 0.2, 1.0, 0.5, 0.6), 2),
    "thin and hot": (_asked("T_surface", 2.18, 0.08474, 0.367841, 0.992103, 0.829804, "free", "lun-fourier"), 1),
    "none": (_asked("Q", 3.0, 0.15, 0.8, 0.2, 0.6), 0),
}

RANDOM = 200
CONDITIONS = 2
#: Ranges of Q, h, M and T_surface that are asked for, even in the logarithm.
_WIDE = ((1e-3, 1e4), (1e-2, 1e4), (1e-2, 25.0), (1e-3, 1e5))


def random_asked(seed: int) -> list[Asked]:
    """A random chute with CONDITIONS different conditions."""
    rng = np.random.default_rng([2010, seed])
    e = 1.0 if rng.random() < 0.05 else float(rng.uniform(0.3, 1.0))
    e_w = float(rng.choice([0.0, 1.0])) if rng.random() < 0.05 else float(rng.uniform())
    r = float(rng.choice([0.5, math.sqrt(0.75)])) if rng.random() < 0.05 else float(rng.uniform(0.5, math.sqrt(0.75)))
    low, high = _dilute_balances(e, e_w, r)
    slope = float(rng.uniform(0.85 * low, 1.2 * high))
    surface, closure = str(rng.choice(["free", "interface"])), str(rng.choice(["lun", "lun-fourier"]))
    case = Case(round(slope, 6), round(e, 6), round(e_w, 6), round(r, 6), surface, closure)
    out = []
    for which in rng.permutation(4)[:CONDITIONS]:
        out.append(Asked(case, int(which), float(np.exp(rng.uniform(*np.log(_WIDE[which]))))))
    return out


def _dilute_balances(e: float, e_w: float, r: float) -> tuple[float, float]:
    """The slopes, in order, at which a dilute base and a dilute interior neither gain nor lose energy.

    Hot flows exist between them, on gentle slopes, and colder ones thereabouts.
    """
    dilute = Table1(Case(1.0, e, e_w, r), 1e-12, 1.0)
    friction = float(dilute.bases()[0])  # F_1 at slope 1, to which F_1 is proportional
    loss = math.sqrt(2.0 / math.pi) * 2.0 * (1.0 - e_w) / (1.0 + math.sqrt(1.0 - r**2))
    base = math.sqrt(loss / friction)
    interior = math.sqrt(float(dilute.g2) * 12.0 / math.sqrt(math.pi) * (1.0 - e**2))
    return max(min(base, interior), 0.02), max(base, interior, 0.1)
