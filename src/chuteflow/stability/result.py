"""Is a flow stable, and which disturbance grows fastest?

# notation: k = |(kx, ky)| wavenumber, h centre of mass.

Stability is decided only after the whole range of wavenumbers was searched, see :mod:`chuteflow.stability.search`.
What was asked of single wavenumbers says what these waves do, and no more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chuteflow import display
from chuteflow.numerics.chebyshev import Array
from chuteflow.result import Result
from chuteflow.stability.modes import (
    TOLERANCE,
    Disturbances,
    Mode,
    UnresolvedError,
    check_wavenumbers,
    leading,
)
from chuteflow.stability.search import FastestMode, find_fastest
from chuteflow.steady.flow import Flow
from chuteflow.threads import on_one_thread

__all__ = [
    "RANGE",
    "GrowthMap",
    "Stability",
    "growth_map",
    "leading",
    "leading_modes",
    "stability_of",
    "wavenumbers",
]

#: Range of k h that is searched; the shortest waves are two grains long, or as long as the flow is deep.
RANGE, _SHORTEST = (1e-3, 10.0), np.pi


@dataclass(frozen=True, eq=False)
class Stability(Result):
    """Whether ``flow`` is stable, and its ``mode`` of largest growth among those that were examined.

    ``stable`` is True or False only if ``complete``: if all directions and all k in ``searched`` (1/d) were searched,
    and disturbances that are the same all along the chute. It is True if no discrete mode of them grows faster than
    ``smallest_rate``, False if one does, and None if none is known to and some are ``unresolved``: wavenumbers
    (kx, ky) at which the grids do not resolve it. If wavenumbers were given, ``stable`` is None and ``grows`` says what
    the wave does. The mass mode at k = 0, which leads to the neighbouring steady flow, is set apart. ``mode`` is None
    where the continuous spectrum, which decays, hides all modes, and where nothing is told. ``examined`` counts the
    wavenumbers of the scan, from whose peaks the maxima are sought.
    """

    flow: Flow
    mode: Mode | None
    searched: tuple[float, float]
    smallest_rate: float
    complete: bool
    unresolved: tuple[tuple[float, float], ...]
    examined: int

    @property
    def grows(self) -> bool:
        """Whether ``mode`` grows faster than ``smallest_rate`` and its own error."""
        return self.mode is not None and self.mode.growth > max(self.smallest_rate, self.mode.error)

    @property
    def stable(self) -> bool | None:
        """Whether the flow is stable; None where that is not known."""
        if not self.complete or (self.unresolved and not self.grows):
            return None
        return not self.grows

    def __repr__(self) -> str:
        known = "not known" if self.stable is None else "stable" if self.stable else "unstable"
        return display.line("Stability", known, None if self.mode is None else repr(self.mode)[1:-1])

    def _repr_html_(self) -> str:
        mode = self.mode
        header = ["", "mode", "kx", "ky", "growth", "frequency", "error"]
        numbers = [] if mode is None else [mode.kx, mode.ky, mode.growth, mode.frequency, mode.error]
        cells = ["none"] if mode is None else [mode.kind, *map(display.number, numbers)]
        known = repr(self)[1:-1].split(": ")[1].split("; ")[0]
        return display.html_table(f"Stability of {self.flow.name}", header, [[known, *cells]])


@on_one_thread
@np.errstate(under="ignore")
def stability_of(flow: Flow, *, kx: float | None = None, ky: float | None = None) -> Stability:
    """Whether ``flow`` is stable, from a search over wavenumbers; with wavenumbers given, what these waves do.

    Args:
        flow: the steady flow.
        kx: wavenumber along the slope in 1/d; all of the range if None.
        ky: the same across the slope.

    Raises:
        InputError: for wavenumbers out of range, and where stability cannot be posed: with the interface, whose
            conditions know steady flows alone, and for laws that do.
    """
    disturbances = Disturbances(flow)
    searched = wavenumbers(flow)
    if kx is not None and ky is not None:
        check_wavenumbers(kx, ky)
        k = float(np.hypot(kx, ky))
        searched, found = (k, k), _single(disturbances, kx, ky)
    else:
        found = find_fastest(disturbances, searched, kx, ky)
    return Stability(
        flow=flow,
        mode=found.mode,
        searched=searched,
        smallest_rate=disturbances.smallest_rate,
        complete=kx is None and ky is None,
        unresolved=found.unresolved,
        examined=found.examined,
    )


def _single(disturbances: Disturbances, kx: float, ky: float) -> FastestMode:
    try:
        found = leading(disturbances, kx, ky, count=2, tolerance=TOLERANCE)
    except UnresolvedError:
        return FastestMode(None, ((kx, ky),), 1)
    # At k = 0 the mass mode says nothing of stability.
    return FastestMode(next((mode for mode in found if mode.kind != "mass"), None), (), 1)


def wavenumbers(flow: Flow) -> tuple[float, float]:
    """Smallest and largest wavenumber searched, in 1/d: from 1e-3/h to 10/h, and no waves shorter than two grains."""
    h = flow.centre_of_mass
    return RANGE[0] / h, min(RANGE[1], max(_SHORTEST * h, 1.0)) / h


@on_one_thread
@np.errstate(under="ignore")
def leading_modes(flow: Flow, kx: float, ky: float, *, count: int = 1) -> list[Mode]:
    """Up to ``count`` modes at these wavenumbers, fastest growing first, the first to six digits if possible.

    Raises:
        InputError: for wavenumbers out of range, and where stability cannot be posed.
        SolveError: where an eigenvalue that seems to grow cannot be decided on the finest grids.
    """
    check_wavenumbers(kx, ky)
    return leading(Disturbances(flow), kx, ky, count=count, tolerance=TOLERANCE)


@dataclass(frozen=True, eq=False)
class GrowthMap:
    """Growth rates, frequencies and errors of the leading modes over ``kx`` (m,) and ``ky`` (n,), arrays (m, n).

    They are NaN where no mode is distinguished from the continuous spectrum, which decays, and where ``unresolved`` (m,
    n): there the grids do not resolve whether a disturbance grows.
    """

    flow: Flow
    kx: Array
    ky: Array
    growth: Array
    frequency: Array
    error: Array
    unresolved: NDArray[np.bool_]


@on_one_thread
@np.errstate(under="ignore")
def growth_map(disturbances: Disturbances, kx: Array, ky: Array) -> GrowthMap:
    """The leading mode at each pair of wavenumbers, about 15 ms for each."""
    out = np.full((3, len(kx), len(ky)), np.nan)
    unresolved = np.zeros(out.shape[1:], dtype=bool)
    for i, along in enumerate(kx):
        for j, across in enumerate(ky):
            try:
                found = leading(disturbances, float(along), float(across))
            except UnresolvedError:
                unresolved[i, j] = True
                continue
            if found:
                out[:, i, j] = found[0].growth, found[0].frequency, found[0].error
    growth, frequency, error = out
    return GrowthMap(disturbances.flow, kx, ky, growth, frequency, error, unresolved)
