"""What becomes of a point of a study, as flags, and why a point has no flow."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from chuteflow.sweeps.batch import Batch

Flags = NDArray[np.int8]


class PointStatus(IntEnum):
    """How a point ended."""

    NOT_COMPUTED = -1
    COMPLETE = 0
    MORE_FLOWS_THAN_KEPT = 1
    INVALID = 2
    FAILED = 3


class Reason(IntEnum):
    """Why a point has no flow; proofs first, then what was only searched."""

    HAS_FLOWS = 0
    BASE_AND_INTERIOR_LOSE_ENERGY = 1
    BASE_AND_INTERIOR_GAIN_ENERGY = 2
    TOO_STEEP_FOR_HOT_FLOWS_NO_OTHER_FOUND = 3
    HOT_FLOWS_LOSE_ENERGY_NO_OTHER_FOUND = 4
    HOT_FLOWS_GAIN_ENERGY_NO_OTHER_FOUND = 5
    NONE_FOUND_IN_THE_RANGE_SEARCHED = 6
    NO_ANSWER = 7


def reasons(batch: Batch) -> Flags:
    """Why the chutes of ``batch`` (n,) have no flow, as :func:`chuteflow.branches.existence.explain_imbalance` has
    it."""
    x = np.append(0.0, np.logspace(-6.0, 9.0, 61))
    lowest, highest = np.full(len(batch), np.inf), np.full(len(batch), -np.inf)
    least, most = lowest.copy(), highest.copy()
    for one in x:
        _, net, base, _ = batch.at_density(np.full(len(batch), one))
        lowest, highest = np.minimum(lowest, net), np.maximum(highest, net)
        least, most = np.minimum(least, base), np.maximum(most, base)
    conduction, net, base, _ = batch.at_density(np.zeros(len(batch)))
    out = np.full(len(batch), int(Reason.NONE_FOUND_IN_THE_RANGE_SEARCHED), dtype=np.int8)
    # lambda = 3 F21^2/(2 g30 delta), which is 3 where the base's flux is the largest that can be lost (4.14).
    steep = (net > 0.0) & (base > np.sqrt(2.0 * np.maximum(net, 0.0) * conduction))
    # Without a temperature far above there are no hot flows of this kind.
    limited = batch.has_limit
    free = batch.surface_stress == 0.0
    for reason, where in (
        (Reason.TOO_STEEP_FOR_HOT_FLOWS_NO_OTHER_FOUND, limited & steep),
        (Reason.HOT_FLOWS_LOSE_ENERGY_NO_OTHER_FOUND, limited & (net > 0.0) & (base <= 0.0)),
        (Reason.HOT_FLOWS_GAIN_ENERGY_NO_OTHER_FOUND, limited & (net < 0.0) & (base >= 0.0)),
        (Reason.BASE_AND_INTERIOR_GAIN_ENERGY, (highest <= 0.0) & (least >= 0.0)),
        (Reason.BASE_AND_INTERIOR_LOSE_ENERGY, free & (lowest >= 0.0) & (most <= 0.0)),
    ):
        out[where] = reason
    return out


def meanings(flags: type[IntEnum]) -> tuple[Flags, str]:
    """Values and names of flags, as CF has them."""
    return np.array([f.value for f in flags], dtype=np.int8), " ".join(f.name.lower() for f in flags)
