"""Whether a flow is stable, in the few numbers and words that the page has room for."""

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
class Verdict:
    """What is known about the stability of a flow: ``state`` is "stable", "unstable" or "unknown".

    ``searched`` are the shortest and the longest wave that were looked at (in d), ``fastest`` is the fastest
    growing one if the flow is unstable; ``reason`` says why nothing is known.
    """

    state: str
    searched: tuple[float, float] | None = None
    fastest: Wave | None = None
    reason: str | None = None


def verdict(flow: Flow) -> Verdict:
    """What is known about the stability of ``flow``."""
    try:
        found = stability_of(flow)
    except (InputError, SolveError) as error:
        return Verdict("unknown", reason=str(error))
    smallest, largest = found.searched
    searched = 2.0 * math.pi / largest, 2.0 * math.pi / smallest
    mode = found.mode
    if found.stable is None:
        return Verdict("unknown", searched, reason=f"{len(found.unresolved)} wavenumbers are not resolved")
    if found.stable or mode is None:
        return Verdict("stable", searched)
    k = math.hypot(mode.kx, mode.ky)
    return Verdict(
        "unstable", searched, Wave(mode.direction, 2.0 * math.pi / k if k else None, mode.growth, mode.error)
    )
