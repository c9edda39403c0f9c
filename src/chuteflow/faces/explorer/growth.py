"""Whether a flow is stable, as far as a modest number of waves tells: for a page that wants an answer in seconds."""

from __future__ import annotations

import math
from dataclasses import dataclass

from chuteflow.errors import InputError, SolveError
from chuteflow.stability.modes import Disturbances, Mode
from chuteflow.steady.flow import Flow

#: Wavenumbers that are tried, times the centre of mass of the flow, and the angles of the waves to the slope.
_WAVENUMBERS = tuple(0.01 * 10.0 ** (i / 4) for i in range(12))
_ANGLES = (0.0, 45.0, 90.0)
#: Steps that close in on the fastest growing wave, each by this factor in wavenumber.
_CLOSER = (1.33, 1.15, 1.07)
#: Grids on which a growing wave is looked for, coarsest first.
_LEVELS = (0, 1)


@dataclass(frozen=True)
class Tried:
    """How many waves were tried, and the shortest and longest of their lengths (in d)."""

    waves: int
    shortest: float
    longest: float


@dataclass(frozen=True)
class Wave:
    """A growing wave: "along" the slope, "across" it or "oblique"; its length in d, rates in sqrt(g cos(theta)/d)."""

    direction: str
    length: float
    growth: float
    error: float


@dataclass(frozen=True)
class Verdict:
    """What is known about the stability of a flow: ``state`` is "stable", "unstable" or "unknown".

    ``fastest`` is the fastest growing wave that was met, if the flow is unstable; ``reason`` says why nothing is
    known.
    """

    state: str
    tried: Tried | None = None
    fastest: Wave | None = None
    reason: str | None = None


def verdict(flow: Flow) -> Verdict:
    """The verdict on ``flow`` by its normal modes at some wavenumbers: a growing wave between them can be missed."""
    wavenumbers = [k / flow.centre_of_mass for k in _WAVENUMBERS]
    waves = [_wave(k, math.radians(angle)) for angle in _ANGLES for k in wavenumbers]
    try:
        disturbances = Disturbances(flow)
        growing = [mode for wave in waves if (mode := _growing(disturbances, *wave)) is not None]
    except InputError as error:
        return Verdict("unknown", reason=str(error))
    tried = Tried(len(waves), 2.0 * math.pi / max(wavenumbers), 2.0 * math.pi / min(wavenumbers))
    if not growing:
        return Verdict("stable", tried)
    fastest = _closer(disturbances, max(growing, key=lambda mode: mode.growth))
    length = 2.0 * math.pi / math.hypot(fastest.kx, fastest.ky)
    return Verdict("unstable", tried, Wave(fastest.direction, length, fastest.growth, fastest.error))


def _wave(k: float, angle: float) -> tuple[float, float]:
    """Wavenumbers along and across; exactly 0 where the cosine is, but for rounding."""
    along, across = math.cos(angle), math.sin(angle)
    return (k * along if along > 1e-12 else 0.0), k * across


def _closer(disturbances: Disturbances, fastest: Mode) -> Mode:
    for step in _CLOSER:
        for factor in (step, 1.0 / step):
            mode = _growing(disturbances, fastest.kx * factor, fastest.ky * factor)
            if mode is not None and mode.growth > fastest.growth:
                fastest = mode
    return fastest


def _growing(disturbances: Disturbances, kx: float, ky: float) -> Mode | None:
    """The fastest growing mode; the continuous spectrum never grows."""
    for level in _LEVELS:
        rising = [complex(value) for value in disturbances.candidates(kx, ky, level) if value.real > 0.0]
        for candidate in rising:
            try:
                mode = disturbances.checked(kx, ky, candidate, level)
            except SolveError:
                continue
            if mode is not None and mode.growth > mode.error:
                return mode
        if not rising:
            return None
    return None
