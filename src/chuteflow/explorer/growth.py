"""The linear stability of a flow, in the few numbers that the page shows."""

from __future__ import annotations

import math
from dataclasses import dataclass

from chuteflow.errors import InputError, SolveError
from chuteflow.stability.result import stability_of
from chuteflow.steady.flow import Flow


@dataclass(frozen=True)
class Wave:
    """A growing wave: "along" the slope, "across" it, "oblique" or, without length, "uniform".

    The length is in d, rates in sqrt(g cos(theta)/d).
    """

    direction: str
    length: float | None
    growth: float
    error: float


@dataclass(frozen=True)
class FlowStability:
    """The stability of a flow as far as examined: ``state`` is "stable", "unstable" or "unknown".

    ``searched`` are the shortest and the longest wavelength examined (in d), ``fastest`` is the fastest growing wave
    of an unstable flow; ``reason`` says why the stability is unknown.
    """

    state: str
    searched: tuple[float, float] | None = None
    fastest: Wave | None = None
    reason: str | None = None


def examine_stability(flow: Flow) -> FlowStability:
    """Examine the linear stability of ``flow``."""
    try:
        found = stability_of(flow)
    except (InputError, SolveError) as error:
        return FlowStability("unknown", reason=str(error))
    smallest, largest = found.searched
    searched = 2.0 * math.pi / largest, 2.0 * math.pi / smallest
    mode = found.mode
    if found.stable is None:
        return FlowStability("unknown", searched, reason=f"{len(found.unresolved)} wavenumbers are not resolved")
    if found.stable or mode is None:
        return FlowStability("stable", searched)
    k = math.hypot(mode.kx, mode.ky)
    return FlowStability(
        "unstable", searched, Wave(mode.direction, 2.0 * math.pi / k if k else None, mode.growth, mode.error)
    )
