"""The fastest wave of a flow: a scan of all wavenumbers and directions, and ascents from its peaks.

# notation: k = |(kx, ky)| wavenumber, a angle of the wave to the slope (0 along, pi/2 across), sigma eigenvalue.

Growth rates are even in kx and in ky, so that a quarter of the plane of wavenumbers holds all. It is scanned at
points even in ln k, and at angles that are closer near pi/2, where ridges are narrow. From each local maximum of the
leading eigenvalue and of the second one, whatever its sign, the rate is followed uphill with its exact derivatives
in ln k and a. Waves along and across the slope are stationary in a by symmetry, so that an ascent from there looks
aside too.

The scan is made on a coarse grid. The maxima are computed as modes, on as many grids as it takes, and so is every
point of the scan where something seems to grow faster than the best of them: it is faster, or an artefact of the
coarse grid, or remains unresolved, which is reported.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.eigenproblem import Complex, Eigenpair, refine_eigenpair
from chuteflow.stability.linear import Operator
from chuteflow.stability.modes import (
    DEGREES,
    TOLERANCE,
    Disturbances,
    Mode,
    UnresolvedError,
    check_wavenumbers,
    leading,
)

#: Points of the scan: wavenumbers, and angles in degrees.
SCAN, ANGLES = 14, (0.0, 15.0, 30.0, 60.0, 75.0, 82.5, 86.25, 90.0)
#: Eigenvalues that are kept at each point, and ascents at most.
_SHEETS, _CLIMBS = 2, 16
#: Longest step in ln k and a in which a mode is followed.
_STEP = 0.15
#: Shortest step after which the mode is given up, and the likeness of its vectors from one to the next.
_SHORTEST, _LIKENESS = 5e-3, 0.5
#: A unit of an ascent is this angle: ridges are narrow in it.
_UNIT = 0.25
#: Slopes at which ascents end, over their rates; and evaluations of an ascent.
_ROUGH, _EXACT = 1e-4, 1e-7
_EVALUATIONS = 30
#: Angles aside of a wave along or across at which it is seen whether it is a maximum; below the last it is one.
_ASIDE, _ALIGNED = np.radians((1.5, 4.0)), np.radians(0.2)
#: Maxima are one if they are this near in ln k and a, and an ascent that gains more than this fraction is gone on with.
_SAME, _GAIN, _ANEW = 0.05, 1e-4, 3
#: Unresolved points after which further ones are not tried: each costs the finest grids.
_MOST_UNRESOLVED = 12


@dataclass(frozen=True, eq=False)
class FastestMode:
    """What a search found: the ``mode`` of largest growth, and wavenumbers (kx, ky) where it could not be resolved.

    ``examined`` is the number of wavenumbers of the scan.
    """

    mode: Mode | None
    unresolved: tuple[tuple[float, float], ...]
    examined: int


@dataclass(frozen=True, eq=False)
class _SearchPoint:
    """A point of the plane of ln k and the angle with an eigenvalue; its vectors and derivatives (2,) once computed."""

    log_k: float
    angle: float
    sigma: complex
    pair: Eigenpair | None = None
    slope: Complex | None = None

    def distance(self, log_k: float, angle: float) -> float:
        return float(np.hypot(self.log_k - log_k, self.angle - angle))

    def is_same(self, other: _SearchPoint) -> bool:
        """Whether both are one maximum."""
        near = self.distance(other.log_k, other.angle) < _SAME
        return near and abs(self.sigma - other.sigma) < _SAME * abs(self.sigma)

    def predicted(self, log_k: float, angle: float) -> complex:
        if self.slope is None:
            return self.sigma
        return complex(self.sigma + self.slope @ np.array([log_k - self.log_k, angle - self.angle]))


def find_fastest(
    disturbances: Disturbances, searched: tuple[float, float], kx: float | None = None, ky: float | None = None
) -> FastestMode:
    """The mode of largest growth with k in ``searched``; a wavenumber that is given is held, and the other searched.

    Raises:
        InputError: for wavenumbers out of range, and where stability cannot be posed.
    """
    check_wavenumbers(*(0.0 if k is None else k for k in (kx, ky)))
    return _ModeSearch(disturbances, searched, (kx, ky)).run()


class _ModeSearch:
    """One search: the best mode so far, and what stayed unresolved."""

    def __init__(
        self, disturbances: Disturbances, searched: tuple[float, float], fixed: tuple[float | None, float | None]
    ) -> None:
        self.disturbances = disturbances
        self.fixed = fixed
        self.free = fixed == (None, None)
        self.bounds = (float(np.log(searched[0])), float(np.log(searched[1])))
        self.best: Mode | None = None
        self.unresolved: list[tuple[float, float]] = []

    def run(self) -> FastestMode:
        """Scan, ascend, and settle what seems to grow faster than the best maximum."""
        logs = np.linspace(*self.bounds, SCAN)
        angles = np.radians(ANGLES) if self.free else np.zeros(1)
        sheets = self._scan(logs, angles)
        if self.free:
            self._take_uniform()
        self._take_best(self._maxima(_starts(logs, angles, sheets)))
        self._settle(logs, angles, np.real(sheets[0]))
        if self.best is None or self.best.growth < 0.0:
            self._take_longest()
        self._polish()
        return FastestMode(self.best, tuple(dict.fromkeys(self.unresolved)), sheets[0].size)

    def _scan(self, logs: Array, angles: Array) -> Complex:
        """The leading eigenvalues of the coarsest grid, (_SHEETS, m, n); NaN where there are fewer."""
        sheets = np.full((_SHEETS, len(logs), len(angles)), complex(np.nan, np.nan))
        cold = self.disturbances.is_cold
        seen = self.disturbances.candidates if cold else self.disturbances.screen
        for i, log_k in enumerate(logs):
            for j, angle in enumerate(angles):
                values = seen(*self.wave(log_k, angle))[:_SHEETS]
                sheets[: len(values), i, j] = values
        return sheets

    def wave(self, log_k: float, angle: float) -> tuple[float, float]:
        """kx and ky; exactly 0 along and across, and as fixed."""
        k = float(np.exp(log_k))
        kx, ky = self.fixed
        if kx is not None:
            return kx, k
        if ky is not None:
            return k, ky
        along = 0.0 if angle >= 0.5 * np.pi - _ALIGNED else k * float(np.cos(angle))
        return along, 0.0 if angle <= _ALIGNED else k * float(np.sin(angle))

    def directions(self, kx: float, ky: float) -> Array:
        """d(kx, ky)/d ln k and d(kx, ky)/d angle, (2, 2), of what is free."""
        if self.free:
            return np.array([[kx, ky], [-ky, kx]])
        return np.array(
            [[0.0 if self.fixed[0] is not None else kx, ky if self.fixed[0] is not None else 0.0], [0.0, 0.0]]
        )

    def _take_uniform(self) -> None:
        """The leading disturbance that is the same all along the chute, but for the mass mode."""
        try:
            found = leading(self.disturbances, 0.0, 0.0, count=2)
        except UnresolvedError:
            self.unresolved.append((0.0, 0.0))
            return
        self._take(next((mode for mode in found if mode.kind != "mass"), None))

    def _take_longest(self) -> None:
        """The longest waves: where nothing grows, they are often the slowest to decay, too near to 0 for the scan."""
        for angle in (0.0, 0.5 * np.pi) if self.free else (0.0,):
            self._take(self._find_known(_SearchPoint(self.bounds[0], angle, 0j)))

    def _take(self, mode: Mode | None) -> None:
        if mode is not None and (self.best is None or mode.growth > self.best.growth):
            self.best = mode

    def _maxima(self, starts: list[_SearchPoint]) -> list[_SearchPoint]:
        """Where the ascents end, highest first, each once."""
        out: list[_SearchPoint] = []
        ends = chain.from_iterable(map(self._ascend, starts))
        for maximum in sorted(ends, key=lambda place: -place.sigma.real):
            if not any(maximum.is_same(other) for other in out):
                out.append(maximum)
        return out

    def _take_best(self, maxima: list[_SearchPoint]) -> None:
        """The best of the maxima, which are certified from the highest down until one is a mode."""
        for maximum in maxima:
            if self.best is not None and maximum.sigma.real <= self.best.growth:
                return
            self._certify(maximum)

    def _certify(self, maximum: _SearchPoint) -> None:
        """Take the leading mode at a maximum; where another one leads there, go on by that."""
        for _ in range(_ANEW):
            mode = self._find_known(maximum)
            self._take(mode)
            if mode is None or mode.growth < maximum.sigma.real + _GAIN * abs(maximum.sigma.real):
                return
            maximum = self._ascend(_SearchPoint(maximum.log_k, maximum.angle, mode.sigma))[-1]

    def _find_known(self, place: _SearchPoint) -> Mode | None:
        """The leading mode at a place; where that is not told, the one of the place, if it is a mode."""
        kx, ky = self.wave(place.log_k, place.angle)
        try:
            found = leading(self.disturbances, kx, ky, tolerance=TOLERANCE)
            return found[0] if found else None
        except UnresolvedError:
            self.unresolved.append((kx, ky))
        levels = (self.disturbances.followed(kx, ky, place.sigma, level) for level in range(len(DEGREES)))
        return next((mode for mode in levels if mode is not None), None)

    def _settle(self, logs: Array, angles: Array, growth: Array) -> None:
        """Look at the points of the scan where something seems to grow faster than the best."""
        order = np.argsort(-np.where(np.isfinite(growth), growth, -np.inf), axis=None)
        for flat in order:
            i, j = np.unravel_index(int(flat), growth.shape)
            least = self.disturbances.smallest_rate
            if not growth[i, j] > max(least, least if self.best is None else self.best.growth):
                return
            wave = self.wave(logs[i], angles[j])
            if len(self.unresolved) >= _MOST_UNRESOLVED:
                self.unresolved.append(wave)
                continue
            try:
                found = leading(self.disturbances, *wave)
            except UnresolvedError:
                self.unresolved.append(wave)
                continue
            if found and (self.best is None or found[0].growth > self.best.growth):
                for maximum in self._ascend(_SearchPoint(float(logs[i]), float(angles[j]), found[0].sigma)):
                    self._certify(maximum)

    def _polish(self) -> None:
        """Maximise again to rounding, on the grid that the best mode was computed on."""
        mode = self.best
        if mode is None or mode.direction == "uniform":
            return
        k, angle = float(np.hypot(mode.kx, mode.ky)), float(np.arctan2(mode.ky, mode.kx))
        if not self.free:
            k, angle = mode.ky if self.fixed[1] is None else mode.kx, 0.0
        start = _SearchPoint(float(np.log(k)), angle, mode.sigma)
        turning = self.free and min(angle, 0.5 * np.pi - angle) > _ALIGNED
        maximum = _GrowthMaximisation(self, start, mode.operator).maximum(start, turning=turning, accuracy=_EXACT)
        polished = self._find_known(maximum)
        # Near the maximum rates differ by less than their errors: the maximum is where the slope vanishes.
        if polished is not None and polished.growth > mode.growth - max(mode.error, polished.error):
            self.best = polished

    def _ascend(self, start: _SearchPoint) -> list[_SearchPoint]:
        """The maxima that a mode leads to: from an axis that along it, and one aside if it is higher there."""
        ascent = _GrowthMaximisation(self, start)
        if not self.free or min(start.angle, 0.5 * np.pi - start.angle) > _ALIGNED:
            return [ascent.maximum(start, turning=self.free)]
        ridge = ascent.maximum(start, turning=False)
        sign = 1.0 if ridge.angle < 0.25 * np.pi else -1.0
        for aside in _ASIDE:
            beside = ascent.at(ridge.log_k, ridge.angle + sign * float(aside))
            if beside is not None and beside.sigma.real > ridge.sigma.real:
                return [ridge, ascent.maximum(beside, turning=True)]
        return [ridge]


class _LostError(Exception):
    """A mode could not be followed."""


class _GrowthMaximisation:
    """The rate of one mode as a function of ln k and the angle, on one grid, followed in small steps."""

    def __init__(self, search: _ModeSearch, start: _SearchPoint, of: Operator | None = None) -> None:
        self.search = search
        self.of = of or search.disturbances.coarse_operator(*search.wave(start.log_k, start.angle))
        self.known = [self._follow(start.log_k, start.angle, start)]

    def at(self, log_k: float, angle: float) -> _SearchPoint | None:
        """The mode at a place; None where it is lost on the way."""
        here = min(self.known, key=lambda place: place.distance(log_k, angle))
        step = _STEP
        while (left := here.distance(log_k, angle)) > 0.0:
            fraction = min(1.0, step / left)
            ahead = here.log_k + fraction * (log_k - here.log_k), here.angle + fraction * (angle - here.angle)
            there = self._follow(*((log_k, angle) if fraction == 1.0 else ahead), here)
            if self._alike(here, there):
                self.known.append(there)
                here, step = there, min(2.0 * step, _STEP)
            else:
                step *= 0.5
                if step < _SHORTEST:
                    return None
        return here

    def _alike(self, one: _SearchPoint, other: _SearchPoint) -> bool:
        assert one.pair is not None
        assert other.pair is not None
        return one.pair.likeness(other.pair, self.of.weights) > _LIKENESS

    def _follow(self, log_k: float, angle: float, origin: _SearchPoint) -> _SearchPoint:
        of = self.of
        kx, ky = self.search.wave(log_k, angle)
        start = None if origin.pair is None else origin.pair.right
        near = origin.predicted(log_k, angle)
        pair = refine_eigenpair(of.matrix(kx, ky), of.weights, near, start=start)
        by_k = of.slopes(pair.left, pair.right, kx, ky) / pair.size(of.weights)
        return _SearchPoint(log_k, angle, pair.value, pair, self.search.directions(kx, ky) @ by_k)

    def maximum(self, start: _SearchPoint, *, turning: bool, accuracy: float = _ROUGH) -> _SearchPoint:
        """The local maximum of the rate uphill from ``start``, at its angle unless ``turning``.

        Its slope, over the rate at the start, is below ``accuracy``.
        """
        from scipy.optimize import minimize

        scale = max(abs(start.sigma.real), self.search.disturbances.smallest_rate)
        units = np.array([1.0, _UNIT])[: 2 if turning else 1]
        best = self.at(start.log_k, start.angle) or start

        def fall(x: Array) -> tuple[float, Any]:
            nonlocal best
            there = self.at(float(x[0]), float(x[1] * _UNIT) if turning else start.angle)
            if there is None or there.slope is None:
                raise _LostError
            if there.sigma.real >= best.sigma.real:
                best = there
            return -there.sigma.real / scale, -np.real(there.slope[: len(x)]) * units / scale

        limits = [self.search.bounds, (0.0, 0.5 * np.pi / _UNIT)][: len(units)]
        begin = np.array([start.log_k, start.angle / _UNIT])[: len(units)]
        options: Any = {"maxfun": _EVALUATIONS, "ftol": accuracy**2, "gtol": accuracy}
        with suppress(_LostError):  # a mode that ends on the way was highest at its best place so far
            minimize(fall, begin, jac=True, method="L-BFGS-B", bounds=limits, options=options)
        return best


def _starts(logs: Array, angles: Array, sheets: Complex) -> list[_SearchPoint]:
    """The local maxima of each sheet of the scan, and those of waves along and across among themselves, highest first.

    Waves along and across are stationary in the angle by symmetry, and another mode can lead right beside them.
    """
    found: list[_SearchPoint] = []
    for sheet in sheets:
        growth = np.where(np.isfinite(np.real(sheet)), np.real(sheet), -np.inf)
        padded = np.pad(growth, 1, constant_values=-np.inf)
        along_k, along_angle = (
            growth >= np.max([np.roll(padded, step, axis)[1:-1, 1:-1] for step in (-1, 1)], axis=0) for axis in (0, 1)
        )
        along_angle[:, [0, -1]] = True
        for i, j in np.argwhere(along_k & along_angle & np.isfinite(growth)):
            found.append(_SearchPoint(float(logs[i]), float(angles[j]), complex(sheet[i, j])))
    return sorted(found, key=lambda place: -place.sigma.real)[:_CLIMBS]
