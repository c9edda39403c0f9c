"""What measurements leave open, in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chuteflow.display import number
from chuteflow.numerics.chebyshev import Array

if TYPE_CHECKING:
    from chuteflow.fitting.calibration import Estimate

#: Parameters are exchangeable where their correlation is at least this.
STRONG = 0.9


def trade_offs(estimates: Sequence[Estimate], correlation: Array) -> list[str]:
    """A sentence for each pair of parameters that can be exchanged for one another."""
    said = []
    for i, one in enumerate(estimates):
        for j in range(i + 1, len(estimates)):
            other, shared = estimates[j], float(correlation[i, j])
            # What errors far beyond the range of a parameter go with says nothing.
            sized = all(p.error < p.interval.high - p.interval.low for p in (one, other))
            if sized and np.isfinite(shared) and abs(shared) >= STRONG:
                step = np.sign(shared) * other.error
                said.append(
                    f"{one.key} and {other.key} trade off: {number(one.error)} more of {one.key} goes with "
                    f"{number(abs(step))} {'more' if step > 0.0 else 'less'} of {other.key} (correlation {shared:.3f})"
                )
    return said
