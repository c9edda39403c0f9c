"""Neutral curves: where the growth rate of a mode vanishes, followed by continuation in a plane of two parameters.

# notation: z = (a, b) coordinates of the plane, both of order one; sigma eigenvalue of the mode that is followed.

The plane is that of the wavenumbers of one flow, or that of the wavenumber of waves in one direction and the place
along a branch of flows (:mod:`chuteflow.stability.planes`). The curve is that of Re sigma(z) = 0: one equation in two
unknowns for the general continuation of :mod:`chuteflow.numerics.continuation`, with sigma followed from point to
point. A scan of the plane says where curves are; each is entered from there. What changes between two grids is the
error of a point; where that is large the mode has run into the continuous spectrum, and the curve ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from chuteflow import display
from chuteflow.errors import SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.continuation import ContinuationSettings, ContinuationStatus, CurvePoint, closes, trace
from chuteflow.numerics.eigenproblem import Complex, refine_eigenvalue
from chuteflow.numerics.following import Side, follow_both_sides, follow_side
from chuteflow.result import Compared
from chuteflow.stability.modes import Disturbances

#: Steps of the central differences that give the slope of sigma: Newton's method does with few digits of it.
_STEP = 1e-4
#: The grids on which curves are followed, and on which the errors of their points are estimated.
_LEVEL, _FINEST = 1, 2
#: A mode changes with the coordinates as at the point before, by this fraction of the larger square of both slopes.
_ALIKE = 0.3
#: Error of a point, in the coordinates of the plane, beyond which it is none.
_ASTRAY = 0.02
#: How curves are followed: arclength is measured in the coordinates of the plane.
CONTROL = ContinuationSettings(
    initial_step=0.01, min_step=1e-5, max_step=0.04, max_angle=0.25, tolerance=1e-7, max_points=600
)
#: Curves are one if a point of one lies this near to another.
_SAME = 0.01


class NeutralPlane(Protocol):
    """A rectangle of two coordinates of order one, from (0, 0) to ``size``, each point of it a flow and a wave."""

    @property
    def size(self) -> tuple[float, float]:
        """The upper ends of the coordinates."""
        ...

    def wave(self, z: Array) -> tuple[Disturbances, float, float]:
        """The disturbances, kx and ky at a point; at points a little outside too."""
        ...


@dataclass(frozen=True, eq=False)
class EigenvalueGrid:
    """Leading eigenvalues sigma (m, n) at coordinates ``a`` (m,) and ``b`` (n,).

    NaN where no mode is seen and the continuous spectrum leads, which decays, and where ``unresolved``: there it is not
    known whether something grows. ``grows`` is where growth counts. Both are (m, n), or one False for all points.
    """

    a: Array
    b: Array
    sigma: Complex
    grows: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((), dtype=bool))
    unresolved: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((), dtype=bool))

    @property
    def growth(self) -> Array:
        """Re sigma."""
        return np.array(np.real(self.sigma), dtype=float)

    @property
    def frequency(self) -> Array:
        """-Im sigma."""
        return np.array(-np.imag(self.sigma), dtype=float)


@dataclass(frozen=True, eq=False)
class NeutralCurve(Compared):
    """Points z (n, 2) of a neutral curve with frequencies -Im sigma and errors (n,), in order; why it ends.

    ``error`` is the estimated distance from the true curve, in the coordinates of the plane.
    """

    z: Array
    frequency: Array
    error: Array
    ends: tuple[str, str]

    def __repr__(self) -> str:
        return display.line("NeutralCurve", display.count_of(len(self.z), "point"), f"begins at {self.ends[0]}")


def neutral_curves(
    plane: NeutralPlane, scan: EigenvalueGrid, control: ContinuationSettings = CONTROL
) -> list[NeutralCurve]:
    """All neutral curves that ``scan`` sees in ``plane``."""
    found: list[NeutralCurve] = []
    for line in _lines(scan):
        curve = _enter(plane, scan, line, found, control)
        if curve is not None:
            found.append(curve)
    return found


def _lines(scan: EigenvalueGrid) -> list[Array]:
    """Rough neutral curves, long ones first: contours of the scan, each (k, 2)."""
    growth = np.real(scan.sigma)
    # Where no mode is seen, the continuous spectrum leads, which decays.
    seen = np.isfinite(growth)
    level = growth if seen.all() else np.where(seen, growth, -0.1 * np.nanmax(np.abs(growth), initial=1e-300))
    # Nothing is crossed where it is not known what grows: lines end there, and curves are followed through.
    lines = contour_generator(
        scan.a, scan.b, np.ma.array(level, mask=np.broadcast_to(scan.unresolved, level.shape)).T
    ).lines(0.0)
    return sorted((np.asarray(line) for line in lines), key=len, reverse=True)


def _enter(
    plane: NeutralPlane, scan: EigenvalueGrid, line: Array, found: Sequence[NeutralCurve], control: ContinuationSettings
) -> NeutralCurve | None:
    """The neutral curve near a rough one; None if it is among those found, or cannot be entered."""
    for fraction in (0.5, 0.25, 0.75, 0.1, 0.9):
        i = int(fraction * (len(line) - 1))
        along = line[min(i + 1, len(line) - 1)] - line[max(i - 1, 0)]
        if not along.any():
            continue
        if any(np.hypot(*(curve.z - line[i]).T).min() < _SAME for curve in found):
            return None
        curve = _through(plane, _growing(scan, line[i]), line[i], along, control)
        if curve is not None:
            return curve
    return None


def _through(
    plane: NeutralPlane, begin: tuple[Array, complex], start: Array, along: Array, control: ContinuationSettings
) -> NeutralCurve | None:
    """The neutral curve near ``start``, of the mode that grows at ``begin``; None if it has no second point there."""
    onward = _side(plane, begin, start, along, control)
    if len(onward.points) < 2:
        return None
    found = follow_both_sides(lambda sign: onward if sign > 0.0 else _side(plane, begin, start, -along, control))
    return NeutralCurve(
        z=np.array([point.z for point in found.points]),
        frequency=np.array([-point.sigma.imag for point in found.points]),
        error=np.array([point.error for point in found.points]),
        ends=found.ends,
    )


def _growing(scan: EigenvalueGrid, near: Array) -> tuple[Array, complex]:
    """The growing point of the scan that is nearest to ``near``, and its eigenvalue."""
    away = np.hypot(*np.meshgrid(scan.a - near[0], scan.b - near[1], indexing="ij"))
    away[~(np.real(scan.sigma) > 0.0)] = np.inf
    i, j = np.unravel_index(int(away.argmin()), away.shape)
    return np.array([scan.a[i], scan.b[j]]), complex(scan.sigma[i, j])


@dataclass(frozen=True, eq=False)
class _Neutral:
    """A point of a curve with its eigenvalue and its error."""

    z: Array
    sigma: complex
    error: float


class End(StrEnum):
    """Where a neutral curve ends, as is said of it; one that is lost names the reason beside LOST."""

    EDGE = "the edge of the range"
    CLOSED = "its own start: it is closed"
    CONTINUOUS = "where the mode runs into the continuous spectrum"
    LOST = "a point from which it could not be followed"


def _side(
    plane: NeutralPlane, begin: tuple[Array, complex], start: Array, ahead: Array, control: ContinuationSettings
) -> Side[_Neutral]:
    """The side from ``start`` along ``ahead``, at most to the edge of the plane."""
    system = _GrowthSystem(plane, *begin)
    path = trace(system, start, direction=ahead, control=control)
    points: list[CurvePoint[_GrowthSystem]] = []

    def extend(
        side: Side[_Neutral], previous: CurvePoint[_GrowthSystem] | None, point: CurvePoint[_GrowthSystem]
    ) -> None:
        edge = _find_edge_passed(plane, point.z)
        if edge is not None:
            if previous is not None:
                for last in _at_edge(system, previous.z, point.z, *edge, control):
                    side.add(last)
            side.stop(End.EDGE)
            return
        neutral = system.follow_to(point.z)
        if not np.isfinite(neutral.sigma):
            side.stop(End.LOST)
            return
        if neutral.error > _ASTRAY:
            side.stop(End.CONTINUOUS)
            return
        points.append(point)
        if len(points) > 3 and closes(points[0], points[-2], points[-1]):
            side.stop(End.CLOSED, closed=True)
            return
        side.add(neutral)

    side = follow_side(path, Side(), extend)
    if path.status is not ContinuationStatus.RUNNING:
        side.stop(f"{End.LOST} ({path.status.name.lower().replace('_', ' ')})")
    return side


def _find_edge_passed(plane: NeutralPlane, z: Array) -> tuple[int, float] | None:
    """The coordinate that is outside the plane, and the edge that it has passed."""
    for i, end in enumerate(plane.size):
        if z[i] < 0.0:
            return i, 0.0
        if z[i] > end:
            return i, end
    return None


def _at_edge(
    system: _GrowthSystem, inside: Array, outside: Array, which: int, edge: float, control: ContinuationSettings
) -> Iterator[_Neutral]:
    """The point of the curve where coordinate ``which`` is ``edge``, if there is one."""
    fraction = (edge - inside[which]) / (outside[which] - inside[which])
    direction = np.eye(2)[which]
    for point in trace(system, inside + fraction * (outside - inside), direction=direction, control=control):
        z = np.where(direction > 0.0, edge, point.z)
        neutral = system.follow_to(z)
        if neutral.error <= _ASTRAY:
            yield neutral
        return


@dataclass(frozen=True, eq=False)
class _Eigenvalue:
    """sigma and its derivatives (2,) at a point."""

    z: Array
    sigma: complex
    slope: Complex

    def at(self, z: Array) -> complex:
        """What is expected of sigma at a point near by."""
        return complex(self.sigma + self.slope @ (z - self.z))

    def same_mode(self, other: _Eigenvalue) -> bool:
        """Whether the growth of the other changes in the same way: points of the continuous spectrum stand still."""
        one, two = np.real(self.slope), np.real(other.slope)
        return bool(one @ two > _ALIKE * max(one @ one, two @ two))


class _GrowthSystem:
    """Re sigma(z) = 0 for the mode that is ``sigma`` at ``begin``, followed from one point to the next.

    The mode at z is the one nearest to what is extrapolated from the last accepted point or the last trial of Newton's
    method, whichever is nearer. A real rate that vanishes does so at the end of the continuous spectrum, of which a
    grid has points close below. Trials that lead to these are recognised by their slopes, and not extrapolated from.
    """

    def __init__(self, plane: NeutralPlane, begin: Array, sigma: complex) -> None:
        self._plane = plane
        self._accepted = self._trial = self._with_slope(begin, sigma)

    @property
    def weights(self) -> Array:
        """Both coordinates count alike."""
        return np.ones(2)

    def residual_and_jacobian(self, z: Array) -> tuple[Array, Array]:
        """See chuteflow.numerics.continuation.System."""
        there = self._follow(z)
        if self._accepted.same_mode(there):
            self._trial = there
        return np.array([there.sigma.real]), np.array(np.real(there.slope), dtype=float)[None]

    def follow_to(self, z: Array) -> _Neutral:
        """The point, from which the next ones start, with its error: growth on the finest grid over its slope."""
        self._accepted = self._trial = there = self._follow(z)
        growth = self._sigma(z, there.sigma, _FINEST).real - there.sigma.real
        steepness = float(np.hypot(*np.real(there.slope)))
        return _Neutral(z, there.sigma, abs(growth) / steepness if steepness > 0.0 else np.inf)

    def _follow(self, z: Array) -> _Eigenvalue:
        nearest = min((self._trial, self._accepted), key=lambda known: float(np.abs(known.z - z).max()))
        return self._with_slope(z, nearest.at(z))

    def _with_slope(self, z: Array, near: complex) -> _Eigenvalue:
        sigma = self._sigma(z, near)
        slope = [
            (self._sigma(z + step, sigma) - self._sigma(z - step, sigma)) / (2.0 * _STEP) for step in _STEP * np.eye(2)
        ]
        return _Eigenvalue(z, sigma, np.array(slope))

    def _sigma(self, z: Array, near: complex, level: int = _LEVEL) -> complex:
        """NaN where the flow cannot be solved."""
        if not np.isfinite(near):
            return complex(np.nan, np.nan)
        try:
            disturbances, kx, ky = self._plane.wave(z)
        except SolveError:
            return complex(np.nan, np.nan)
        of = disturbances.coarse_operator(kx, ky, level)
        return refine_eigenvalue(of.matrix(kx, ky), of.weights, near)[0]
