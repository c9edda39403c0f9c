"""Flows between the neighbours of a family."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from chuteflow.branches.paths import solve_between
from chuteflow.steady.flow import Flow


def flow_between(flows: Sequence[Flow], position: float) -> Flow:
    """The flow at a position between two neighbours of a family, or a little beyond its ends, counted in ``flows``."""
    i = int(np.clip(np.floor(position), 0, len(flows) - 2))
    first, last = flows[i], flows[i + 1]
    share = position - i
    if share in (0.0, 1.0):
        return last if share else first
    return Flow(first.chute, solve_between(first.solution, last.solution, share))
