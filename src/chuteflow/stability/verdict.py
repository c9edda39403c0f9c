"""Is a flow stable, and which disturbance grows fastest?

# notation: k = |(kx, ky)| wavenumber, a angle of the wave to the slope (0 along, pi/2 across), h centre of mass.

Growth rates are even in kx and in ky, so that a quarter of the plane of wavenumbers holds all. It is scanned at
points even in ln k and a; from the best of them the rate is followed uphill as a function of ln k and a. Waves
along and across the slope are ridges by symmetry, and are climbed as such.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from chuteflow import display
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.eigenproblem import refined
from chuteflow.stability.modes import DEGREES, TOLERANCE, Disturbances, Mode, check_wavenumbers
from chuteflow.steady.flow import Flow
from chuteflow.threads import on_one_thread

#: Range of k h that is searched; the shortest waves are two grains long, or as long as the flow is deep.
RANGE, _SHORTEST = (1e-3, 10.0), np.pi
#: Points of the scan: wavenumbers, and angles in degrees.
_SCAN, _ANGLES = 14, (0.0, 30.0, 60.0, 90.0)
#: Other peaks of the scan are climbed too if they reach this share of the highest.
_RIVAL = 0.5
#: A climb is begun anew at most so often, and only while it gains more than this share.
_ANEW, _GAIN = 4, 1e-3
#: Accuracy of ln k and a at a peak: rates are flat there.
_PRECISION = 1e-3
#: Longest step in ln k and the angle in which a mode is followed.
_STEP = 0.1
#: Angle by which it is seen whether a ridge is one, and below which a wave is along or across.
_ASIDE, _ALIGNED = np.radians(4.0), np.radians(0.2)


@dataclass(frozen=True, eq=False)
class Stability:
    """Whether ``flow`` is stable, and its ``mode`` of largest growth.

    ``stable`` says: of the disturbances with k in ``searched`` (1/d), and of those that are the same all along the
    chute, no discrete mode grows faster than ``smallest_rate``. The mass mode at k = 0, which leads to the
    neighbouring steady flow, is set apart. ``mode`` is None where the continuous spectrum hides all modes.
    """

    flow: Flow
    stable: bool
    mode: Mode | None
    searched: tuple[float, float]
    smallest_rate: float

    def __repr__(self) -> str:
        verdict = {True: "stable", False: "unstable"}.get(self.stable, "not known")
        return display.line("Stability", verdict, None if self.mode is None else repr(self.mode)[1:-1])

    def _repr_html_(self) -> str:
        mode = self.mode
        header = ["", "mode", "kx", "ky", "growth", "frequency", "error"]
        numbers = [] if mode is None else [mode.kx, mode.ky, mode.growth, mode.frequency, mode.error]
        cells = ["none"] if mode is None else [mode.kind, *map(display.number, numbers)]
        verdict = repr(self)[1:-1].split(": ")[1].split("; ")[0]
        return display.html_table(f"Stability of {self.flow.name}", header, [[verdict, *cells]])


@on_one_thread
@np.errstate(under="ignore")
def stability_of(flow: Flow, *, kx: float | None = None, ky: float | None = None) -> Stability:
    """Whether ``flow`` is stable, from a search over wavenumbers.

    Args:
        flow: the steady flow.
        kx: wavenumber along the slope in 1/d; all of the range if None.
        ky: the same across the slope.

    Raises:
        InputError: for wavenumbers out of range, and where stability cannot be posed: with the interface, whose
            conditions know steady flows alone, and for laws that do.
        SolveError: where an eigenvalue that seems to grow cannot be told on the finest grids.
    """
    disturbances = Disturbances(flow)
    searched = wavenumbers(flow)
    if kx is not None and ky is not None:
        check_wavenumbers(kx, ky)
        found = leading(disturbances, kx, ky, count=2, tolerance=TOLERANCE)
        # At k = 0 the mass mode says nothing of stability.
        mode = next((mode for mode in found if mode.kind != "mass"), None)
    else:
        mode = _Search(disturbances, searched, kx, ky).most_unstable()
    rate = disturbances.smallest_rate
    grows = mode is not None and mode.growth > max(rate, mode.error)
    return Stability(flow, not grows, mode, searched, rate)


def wavenumbers(flow: Flow) -> tuple[float, float]:
    """Smallest and largest wavenumber searched, in 1/d: from 1e-3/h to 10/h, and no waves shorter than two grains."""
    h = flow.centre_of_mass
    return RANGE[0] / h, min(RANGE[1], max(_SHORTEST * h, 1.0)) / h


@on_one_thread
@np.errstate(under="ignore")
def leading_modes(flow: Flow, kx: float, ky: float, *, count: int = 1) -> list[Mode]:
    """Up to ``count`` modes at these wavenumbers, fastest growing first, the first to six digits if it can be had.

    Raises:
        InputError: for wavenumbers out of range, and where stability cannot be posed.
        SolveError: where an eigenvalue that seems to grow cannot be told on the finest grids.
    """
    check_wavenumbers(kx, ky)
    return leading(Disturbances(flow), kx, ky, count=count, tolerance=TOLERANCE)


@dataclass(frozen=True, eq=False)
class _Peak:
    """A point of the plane of wavenumbers with the rate of its leading mode."""

    log_k: float
    angle: float
    sigma: complex


class _Search:
    """The scan of one flow, and the climbs from its peaks."""

    def __init__(
        self, disturbances: Disturbances, searched: tuple[float, float], kx: float | None, ky: float | None
    ) -> None:
        self.disturbances = disturbances
        self.fixed = (kx, ky)
        check_wavenumbers(kx or 0.0, ky or 0.0)
        self.bounds = (float(np.log(searched[0])), float(np.log(searched[1])))

    def most_unstable(self) -> Mode | None:
        """The mode of largest growth."""
        found = [self._summit(peak) for peak in self._peaks()]
        modes = [mode for mode in (*found, self._uniform()) if mode is not None]
        return max(modes, key=lambda mode: mode.growth, default=None)

    def _uniform(self) -> Mode | None:
        """The leading disturbance that is the same all along the chute, but for the mass mode."""
        if any(self.fixed):
            return None
        found = leading(self.disturbances, 0.0, 0.0, count=2)
        return next((mode for mode in found if mode.kind != "mass"), None)

    def _place(self, log_k: float, angle: float) -> tuple[float, float]:
        """kx and ky; exactly 0 along and across, and as fixed."""
        k = float(np.exp(log_k))
        kx, ky = self.fixed
        if kx is not None:
            return kx, k
        if ky is not None:
            return k, ky
        along = 0.0 if angle >= 0.5 * np.pi - _ALIGNED else k * float(np.cos(angle))
        return along, 0.0 if angle <= _ALIGNED else k * float(np.sin(angle))

    def _peaks(self) -> Iterator[_Peak]:
        """The highest points of the scan among their neighbours."""
        logs = np.linspace(*self.bounds, _SCAN)
        angles = np.radians(_ANGLES) if self.fixed == (None, None) else np.zeros(1)
        sigma = np.full((len(logs), len(angles)), -np.inf + 0j)
        for i, log_k in enumerate(logs):
            for j, angle in enumerate(angles):
                found = leading(self.disturbances, *self._place(log_k, angle))
                if found:
                    sigma[i, j] = found[0].sigma
        growth = np.real(sigma)
        best = growth.max()
        if not np.isfinite(best):
            return
        padded = np.pad(growth, 1, constant_values=-np.inf)
        around = np.max([np.roll(padded, s, axis)[1:-1, 1:-1] for s in (-1, 1) for axis in (0, 1)], axis=0)
        for i, j in np.argwhere((growth == best) | ((growth >= around) & (growth > max(0.0, _RIVAL * best)))):
            yield _Peak(float(logs[i]), float(angles[j]), complex(sigma[i, j]))

    def _summit(self, peak: _Peak) -> Mode | None:
        """The mode at the summit that ``peak`` leads to.

        A climb in the plane may end on the way: from there it is begun anew, until it gains no more.
        """
        mode = self._ascended(peak)
        for _ in range(_ANEW):
            if mode is None or mode.growth <= 0.0 or self.fixed != (None, None) or 0.0 in (mode.kx, mode.ky):
                break
            here = float(np.log(np.hypot(mode.kx, mode.ky))), float(np.arctan2(mode.ky, mode.kx))
            higher = self._ascended(_Peak(*here, mode.sigma))
            if higher is None or higher.growth < (1.0 + _GAIN) * mode.growth:
                break
            mode = higher
        return mode

    def _ascended(self, peak: _Peak) -> Mode | None:
        """The mode at the end of one climb from ``peak``."""
        mode = self._exact(*self._climbed(peak, self._along_the_mode(peak)))
        if mode is None or mode.growth < peak.sigma.real - mode.error:
            # Another mode was taken for the one followed: climb by that which leads at each place.
            mode = self._exact(*self._climbed(peak, self._leading_rate))
        return mode

    def _along_the_mode(self, peak: _Peak) -> Callable[[float, float], float]:
        """The growth rate of the mode of ``peak`` as a function of ln k and the angle, followed in small steps."""
        of = self.disturbances.coarse_operator(*self._place(peak.log_k, peak.angle))
        known = [peak]

        def rate(log_k: float, angle: float) -> float:
            start = min(known, key=lambda at: np.hypot(at.log_k - log_k, at.angle - angle))
            steps = max(1, int(np.ceil(np.hypot(start.log_k - log_k, start.angle - angle) / _STEP)))
            at = start
            for share in np.arange(1, steps + 1) / steps:
                here = start.log_k + share * (log_k - start.log_k), start.angle + share * (angle - start.angle)
                (before, _), (kx, ky) = self._place(at.log_k, at.angle), self._place(*here)
                # Waves are carried along: their frequency is about proportional to kx.
                near = complex(at.sigma.real, at.sigma.imag * (kx / before if before else 1.0))
                at = _Peak(*here, refined(of.matrix(kx, ky), of.weights, near)[0])
                known.append(at)
            return at.sigma.real

        return rate

    def _leading_rate(self, log_k: float, angle: float) -> float:
        """The growth rate of the leading mode; without one, that of what does not grow."""
        found = leading(self.disturbances, *self._place(log_k, angle))
        return found[0].growth if found else 0.0

    def _climbed(self, peak: _Peak, rate: Callable[[float, float], float]) -> tuple[float, float]:
        """kx and ky of the summit of ``rate``, a function of ln k and the angle, that ``peak`` leads to."""
        from scipy.optimize import minimize, minimize_scalar

        step = (self.bounds[1] - self.bounds[0]) / (_SCAN - 1)

        def fall(log_k: float, angle: float) -> float:
            return -rate(log_k, angle)

        def along_ridge(start: float, angle: float) -> float:
            low, high = max(start - step, self.bounds[0]), min(start + step, self.bounds[1])
            return float(
                minimize_scalar(
                    lambda x: fall(x, angle), bounds=(low, high), method="bounded", options={"xatol": _PRECISION}
                ).x
            )

        log_k, angle = peak.log_k, peak.angle
        ridge = self.fixed != (None, None) or min(angle, 0.5 * np.pi - angle) <= _ALIGNED
        if ridge:
            log_k = along_ridge(log_k, angle)
            height = fall(log_k, angle)
            aside = angle + (_ASIDE if angle <= _ALIGNED else -_ASIDE)
            if self.fixed != (None, None) or fall(log_k, aside) >= height:
                return self._place(log_k, angle)
            angle = aside
        simplex = np.array([[log_k, angle], [log_k + 0.3, angle], [log_k, angle + 0.2 * (1 if angle < 0.8 else -1)]])
        summit = minimize(
            lambda x: fall(float(np.clip(x[0], *self.bounds)), float(np.clip(x[1], 0.0, 0.5 * np.pi))),
            simplex[0],
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "xatol": _PRECISION, "fatol": 1e-12, "maxfev": 200},
        ).x
        return self._place(float(np.clip(summit[0], *self.bounds)), float(np.clip(summit[1], 0.0, 0.5 * np.pi)))

    def _exact(self, kx: float, ky: float) -> Mode | None:
        """The leading mode there, to the tolerance where it can be had."""
        found = leading(self.disturbances, kx, ky, tolerance=TOLERANCE)
        return found[0] if found else None


def leading(
    disturbances: Disturbances, kx: float, ky: float, *, count: int = 1, tolerance: float = np.inf
) -> list[Mode]:
    """The leading modes on the first grids that tell what grows and know it to ``tolerance``, or on the finest.

    Raises:
        SolveError: where the finest grids do not tell.
    """
    found: list[Mode] = []
    doubtful = True
    for level in range(len(DEGREES)):
        found, doubtful = disturbances.accepted(kx, ky, level, count)
        if not doubtful and (not found or found[0].error <= tolerance * max(1.0, abs(found[0].sigma))):
            break
    if doubtful:
        raise SolveError(
            f"something seems to grow at kx = {kx:g}, ky = {ky:g} that the finest grids do not resolve, as happens "
            f"in flows as cold as M/T = {_coldness(disturbances.flow):.2g}: take a warmer flow or other wavenumbers"
        )
    return found


def _coldness(flow: Flow) -> float:
    return flow.mass_holdup / flow.surface_temperature


@dataclass(frozen=True, eq=False)
class GrowthMap:
    """Growth rates, frequencies and errors of the leading modes over ``kx`` (m,) and ``ky`` (n,), arrays (m, n).

    They are NaN where no mode is told from the continuous spectrum, which decays.
    """

    flow: Flow
    kx: Array
    ky: Array
    growth: Array
    frequency: Array
    error: Array


@on_one_thread
@np.errstate(under="ignore")
def growth_map(disturbances: Disturbances, kx: Array, ky: Array) -> GrowthMap:
    """The leading mode at each pair of wavenumbers, about 40 ms for each.

    Raises:
        SolveError: where the finest grids do not tell whether something grows.
    """
    out = np.full((3, len(kx), len(ky)), np.nan)
    for i, along in enumerate(kx):
        for j, across in enumerate(ky):
            found = leading(disturbances, float(along), float(across))
            if found:
                out[:, i, j] = found[0].growth, found[0].frequency, found[0].error
    return GrowthMap(disturbances.flow, kx, ky, *out)
