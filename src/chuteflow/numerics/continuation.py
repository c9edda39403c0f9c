"""Continuation of the solution curve of F(z) = 0, F: R^(n+1) -> R^n, through folds in any component.

# notation: z unknowns (n+1,), t unit tangent, w weights, <a, b> = sum_i w_i a_i b_i, h step in arclength.

A step extrapolates the curve, then brings the extrapolation back by Newton's method with one more equation.
That equation either holds the component of z that changes most ("local": W. C. Rheinboldt 1986, Numerical
Analysis of Parametrized Nonlinear Equations, the method of his code Pitcon), or keeps the correction in the
hyperplane normal to the tangent ("arclength": H. B. Keller 1977, in Applications of Bifurcation Theory, ed.
P. H. Rabinowitz, 359-384). Arclength and angles are those of the inner product that the system states, so
that with quadrature weights the path does not depend on the resolution.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, Protocol, Self, TypeVar, cast, runtime_checkable

import numpy as np

from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.roots import itp_trial

#: The second largest component of the tangent may replace the largest, near a fold in that one, if it is at
#: least this part of it (as in Pitcon).
SECOND = 0.1
#: A step grows at most by this factor, and aims at this part of the largest angle.
GROWTH, AIM = 2.0, 0.8
#: A correction longer than this part of the step may have landed on another stretch of the curve.
ASTRAY = 0.5
#: The error of a point is stated as so many times what quadratic convergence makes of it.
SAFETY = 2.0
#: The error of a location counts the noise of the monitor so many times, having but two samples of it.
CAUTION = 4.0
#: A bracket wider than this part of the first one tells the slope of a monitor from its noise.
WIDE = 1e-3
#: How far a trial of the ITP method is pushed across the zero of the secant, in units of the first bracket.
PUSH = 0.02
#: How far beyond the end of a segment a change of sign is searched for, as a fraction of the chord.
FARTHEST = 0.1
#: A curve is closed by a segment that passes its start within this part of its length, at up to this angle,
#: and may miss its ends by this fraction.
CLOSE, PARALLEL, SLACK = 0.02, 0.1, 1e-6
EPSILON = float(np.finfo(float).eps)


class System(Protocol):
    """The equations F(z) = 0, F: R^(n+1) -> R^n, and the inner product that measures their solution curve."""

    @property
    def weights(self) -> Array:
        """The w_i >= 0 of <a, b> = sum_i w_i a_i b_i, (n+1,); at least one must be positive."""
        ...

    def residual_and_jacobian(self, z: Array, /) -> tuple[Array, Array]:
        """F (n,) and its exact Jacobian (n, n+1) at ``z`` (n+1,); not finite where z is out of the domain."""
        ...


@runtime_checkable
class AdaptiveSystem(System, Protocol):
    """A system that may ask for another discretisation between two steps."""

    def adapt(self, z: Array, tangent: Array, /) -> tuple[Self, Array, Array] | None:
        """Another system with the point and its tangent carried over, or None to go on as before.

        The point and the tangent need to satisfy the new system only roughly: they are corrected first.
        """
        ...


S = TypeVar("S", bound=System)
#: A scalar function of (z, unit tangent, system) that is followed along a curve.
Monitor = Callable[[Array, Array, S], float]


class ContinuationStatus(enum.Enum):
    """What became of a computation, and what to try next."""

    RUNNING = "The curve goes on: ask for the next point."
    LOCATED = "The point was located as closely as round-off or the tolerance allows."
    MAX_POINTS = "All of max_points were computed: raise it, or start again from the last point and tangent."
    START_FAILED = (
        "No point of the curve was found near the start: start closer to the curve, or give a direction "
        "that is not normal to it."
    )
    ADAPTATION_FAILED = (
        "No point of the curve was found near the point carried over to another discretisation: "
        "refine in smaller steps, or interpolate better."
    )
    LEFT_DOMAIN = (
        "The equations have no finite value a little further on: the curve ends at the edge of their domain, "
        "unless a smaller min_step leads on."
    )
    SINGULAR = (
        "The equations do not determine the direction of the curve here: look for a branch point or a "
        "redundant equation, or give weight to a component that changes."
    )
    NOT_CONVERGED = (
        "Newton's method does not converge, be the step ever so small: check the Jacobian, raise the "
        "tolerance or the resolution, lower min_step, or give weight to a component that changes."
    )
    SHARP_TURN = (
        "The curve turns by more than max_angle within the smallest step: look for a corner or a branch "
        "point, or lower min_step, or raise max_angle."
    )

    @property
    def failed(self) -> bool:
        """Whether the computation ended before it had done what was asked."""
        return self not in (ContinuationStatus.RUNNING, ContinuationStatus.LOCATED, ContinuationStatus.MAX_POINTS)


@dataclass(frozen=True)
class ContinuationSettings:
    """How a curve is followed.

    ``initial_step``, ``min_step`` and ``max_step`` are lengths in the inner product of the system (the first
    step is no longer than max_step); ``max_angle`` (radians) bounds the angle between the tangents of
    successive points; ``tolerance`` bounds the estimated error of a point in the weighted max norm,
    max_i sqrt(w_i) |z_i|, in which a component of weight zero counts with weight one; ``max_iterations``
    bounds the Newton corrections of a step; ``max_points`` the points of a trace, its start among them.

    Raises:
        InputError: for a value out of range.
    """

    initial_step: float = 0.01
    min_step: float = 1e-8
    max_step: float = math.inf
    max_angle: float = 0.3
    tolerance: float = 1e-10
    max_iterations: int = 6
    max_points: int = 10_000
    parametrisation: Literal["local", "arclength"] = "local"

    def __post_init__(self) -> None:
        ranges = {
            "min_step": (0.0 < self.min_step < math.inf, "above 0"),
            "initial_step": (self.min_step <= self.initial_step < math.inf, "at least min_step"),
            "max_step": (self.min_step <= self.max_step, "at least min_step"),
            "max_angle": (0.0 < self.max_angle <= 1.0, "above 0 and at most 1"),
            "tolerance": (0.0 < self.tolerance < math.inf, "above 0"),
            "max_iterations": (self.max_iterations >= 2, "at least 2"),
            "max_points": (self.max_points >= 1, "at least 1"),
            "parametrisation": (self.parametrisation in ("local", "arclength"), '"local" or "arclength"'),
        }
        for name, (allowed, meaning) in ranges.items():
            if not allowed:
                raise InputError(f"{name} is {getattr(self, name)!r}: it must be {meaning}.")


DEFAULT = ContinuationSettings()


@dataclass(frozen=True, eq=False, slots=True)
class CurvePoint(Generic[S]):
    """A point of a solution curve; its arrays are read-only.

    ``z`` (n+1,) solves ``system``; ``tangent`` (n+1,) has <t, t> = 1 and points onward. It belongs to the
    last Jacobian and is less exact than z: mostly to 1e-7, at worst to 1e-5 or so, for the default tolerance;
    at a located point to round-off. ``arclength`` is measured from the start of the trace; ``step`` is the
    length asked for on the way here, 0 at the start and where the discretisation changed; ``iterations`` is
    the number of Newton corrections; ``error`` is the estimated size of the next one, in the norm of
    ContinuationSettings, without what the rounding of the residual adds.
    """

    z: Array
    tangent: Array
    arclength: float
    step: float
    iterations: int
    error: float
    system: S


class _Metric:
    """The inner product of weights (n+1,), and what is measured by it."""

    def __init__(self, weights: Array) -> None:
        self.weights = weights = np.array(weights, dtype=float)
        if weights.ndim != 1 or not (np.isfinite(weights).all() and weights.min() >= 0.0 < weights.max()):
            raise InputError(f"The weights are {weights}: they must be finite, >= 0 and not all zero.")
        self.root = np.sqrt(weights)
        self._scale = np.where(weights > 0.0, self.root, 1.0)

    def vector(self, name: str, values: Array) -> Array:
        """A copy of ``values``, called ``name`` in messages, that is sure to be of the weights' shape."""
        copy = np.array(values, dtype=float)
        if copy.shape != self.weights.shape:
            raise InputError(
                f"The {name} has the shape {copy.shape}: it must have that of the weights, {self.weights.shape}."
            )
        return copy

    def inner(self, a: Array, b: Array) -> float:
        return float((self.weights * a) @ b)

    def norm(self, a: Array) -> float:
        return math.sqrt(self.inner(a, a))

    def size(self, a: Array) -> float:
        """The weighted max norm of ContinuationSettings."""
        return float(np.abs(self._scale * a).max())

    def angle(self, t: Array, u: Array) -> float:
        """Angle between unit vectors, accurate for small ones."""
        return 2.0 * math.asin(min(1.0, 0.5 * self.norm(u - t)))

    def along(self, tangent: Array, ahead: Array) -> Array:
        """``tangent``, or its opposite, whichever points along ``ahead``."""
        return tangent if self.inner(tangent, ahead) >= 0.0 else -tangent

    def arc(self, a: Array, b: Array, angle: float) -> float:
        """Length of the curve from ``a`` to ``b`` if its tangent turns by ``angle``; exact for circles."""
        half = 0.5 * angle
        return self.norm(b - a) * (half / math.sin(half) if half > 0.0 else 1.0)


class _Corrected(NamedTuple):
    """A corrected point, its unit tangent, and the sizes of its first two corrections (second 0 if none)."""

    z: Array
    tangent: Array
    iterations: int
    error: float
    first: float
    second: float


def _next_correction(last: float, before: float) -> float:
    """Size of the next of Newton's corrections: the ratio of two, squared, is that of the two that follow."""
    return SAFETY * last * (last / before) ** 2


def _hook(system: S) -> Callable[[Array, Array], tuple[S, Array, Array] | None]:
    """The system's ``adapted``; looked up once, since that takes as long as a factorisation."""
    return system.adapt if isinstance(system, AdaptiveSystem) else lambda z, tangent: None


class _Corrector(Generic[S]):
    """Newton's method for a system and one more equation, and the choice of that equation."""

    def __init__(self, system: S, control: ContinuationSettings) -> None:
        self.system = system
        self.metric = metric = _Metric(system.weights)
        self.adapt = _hook(system)
        self._control = control
        n = len(metric.weights)
        self._matrix = np.empty((n, n))
        self._sides = np.zeros((n, 2))
        self._sides[-1, 1] = 1.0

    def border(self, tangent: Array, before: Array | None = None) -> Array:
        """The row (n+1,) whose product with corrections has to vanish, given this tangent and the last."""
        if self._control.parametrisation == "arclength":
            return self.metric.weights * tangent
        row = np.zeros_like(tangent)
        row[self._choose_held(tangent, before)] = 1.0
        return row

    def _choose_held(self, tangent: Array, before: Array | None) -> int:
        """The component that changes most, or the second if that rises while the first nears a fold."""
        fraction = self.metric.root * np.abs(tangent)
        first = int(fraction.argmax())
        if before is None:
            return first
        share_before = self.metric.root * np.sign(tangent) * before
        largest = fraction[first]
        if largest >= share_before[first]:
            return first
        fraction[first] = 0.0
        second = int(fraction.argmax())
        return second if fraction[second] >= max(SECOND * largest, share_before[second]) else first

    def correct(self, z: Array, row: Array, *, sharp: bool = False) -> _Corrected | ContinuationStatus:
        """The solution of F(z) = 0 in the hyperplane of ``row`` through ``z``, and its tangent, row t > 0.

        The factorisation that gives a correction gives the tangent too. The iteration ends when the next
        correction would be below the tolerance; if ``sharp``, when corrections cease to halve at round-off,
        which makes the tangent as good as the point.
        """
        matrix, sides, tolerance = self._matrix, self._sides, self._control.tolerance
        matrix[-1] = row
        sizes: list[float] = []
        for remaining in reversed(range(self._control.max_iterations)):
            sides[:-1, 0], matrix[:-1] = self.system.residual_and_jacobian(z)
            try:
                solution = cast(Array, np.linalg.solve(matrix, sides))
            except np.linalg.LinAlgError:
                return ContinuationStatus.SINGULAR
            step = solution[:, 0]
            size = self.metric.size(step)
            if not size < math.inf:
                return ContinuationStatus.LEFT_DOMAIN
            z = z - step
            before = sizes[-1] if sizes else math.inf
            error = _next_correction(size, before) if sizes else size
            sizes.append(size)
            if sharp:
                done = size <= tolerance and (size == 0.0 or size > 0.5 * before or remaining == 0)
            else:
                done = error <= tolerance
            if done:
                return self._with_tangent(z, solution[:, 1], sizes, error)
            if size >= before:
                break
        return ContinuationStatus.NOT_CONVERGED

    def _with_tangent(self, z: Array, t: Array, sizes: list[float], error: float) -> _Corrected | ContinuationStatus:
        length = self.metric.norm(t)
        if not 0.0 < length < math.inf:
            return ContinuationStatus.SINGULAR
        return _Corrected(z, t / length, len(sizes), error, sizes[0], sizes[1] if len(sizes) > 1 else 0.0)

    def point(self, corrected: _Corrected, tangent: Array, arclength: float, step: float) -> CurvePoint[S]:
        z = corrected.z
        z.setflags(write=False)
        tangent.setflags(write=False)
        return CurvePoint(z, tangent, arclength, step, corrected.iterations, corrected.error, self.system)


class Trace(Iterator[CurvePoint[S]]):
    """The points of a solution curve, one after the other; made by :func:`trace`.

    When the iteration ends, ``status`` says why, in a sentence that says what to try next.
    """

    def __init__(self, corrector: _Corrector[S], control: ContinuationSettings, start: Array, direction: Array) -> None:
        self.status = ContinuationStatus.RUNNING
        self._corrector = corrector
        self._control = control
        self._start, self._direction = start, direction
        self._count = 0
        self._step = min(control.initial_step, control.max_step)
        self._curvature = 0.0
        self._previous: CurvePoint[S] | None = None
        self._point: CurvePoint[S] | None = None
        self._just_adapted = False

    def __next__(self) -> CurvePoint[S]:
        if self.status is ContinuationStatus.RUNNING:
            following = self._following()
            if not isinstance(following, ContinuationStatus):
                self._point = following
                self._count += 1
                return following
            self.status = following
        raise StopIteration

    def _following(self) -> CurvePoint[S] | ContinuationStatus:
        if self._count == self._control.max_points:
            return ContinuationStatus.MAX_POINTS
        if self._point is None:
            return self._begin()
        adapted = None if self._just_adapted else self._adapt(self._point)
        self._just_adapted = adapted is not None
        return self._advance(self._point) if adapted is None else adapted

    def _begin(self) -> CurvePoint[S] | ContinuationStatus:
        corrected = self._corrector.correct(self._start, self._direction)
        if isinstance(corrected, ContinuationStatus):
            return ContinuationStatus.START_FAILED
        return self._corrector.point(corrected, corrected.tangent, 0.0, 0.0)

    def _adapt(self, point: CurvePoint[S]) -> CurvePoint[S] | ContinuationStatus | None:
        """The point on the discretisation that the system asks for, if it does."""
        changed = self._corrector.adapt(point.z, point.tangent)
        if changed is None:
            return None
        system, z, tangent = changed
        self._corrector = corrector = _Corrector(system, self._control)
        self._previous = None
        ahead = corrector.metric.vector("tangent carried over", tangent)
        near = corrector.metric.vector("point carried over", z)
        corrected = corrector.correct(near, corrector.border(ahead))
        if isinstance(corrected, ContinuationStatus):
            return ContinuationStatus.ADAPTATION_FAILED
        tangent = corrector.metric.along(corrected.tangent, ahead)
        return corrector.point(corrected, tangent, point.arclength, 0.0)

    def _advance(self, point: CurvePoint[S]) -> CurvePoint[S] | ContinuationStatus:
        """The next point; the step is halved until it succeeds, and then not allowed to grow at once."""
        control = self._control
        largest_growth = GROWTH
        while isinstance(tried := self._try(point, self._step), ContinuationStatus):
            if self._step <= control.min_step:
                return tried
            self._step = max(0.5 * self._step, control.min_step)
            largest_growth = 1.0
        following, growth = tried
        growth = min(growth, largest_growth)
        self._step = min(max(self._step * growth, control.min_step), control.max_step)
        self._previous = point
        return following

    def _try(self, point: CurvePoint[S], step: float) -> tuple[CurvePoint[S], float] | ContinuationStatus:
        """The point one ``step`` further, and the factor by which the next step may differ."""
        corrector, metric, control = self._corrector, self._corrector.metric, self._control
        predicted = _extrapolate(self._previous, point, step)
        before = None if self._previous is None else self._previous.tangent
        corrected = corrector.correct(predicted, corrector.border(point.tangent, before))
        if isinstance(corrected, ContinuationStatus):
            return corrected
        tangent = metric.along(corrected.tangent, point.tangent)
        angle = metric.angle(point.tangent, tangent)
        arc = metric.arc(point.z, corrected.z, angle)
        astray = arc < ASTRAY * step or metric.norm(corrected.z - predicted) > ASTRAY * step
        if astray or angle > control.max_angle:
            return ContinuationStatus.SHARP_TURN
        growth = _growth_by_convergence(corrected, control.tolerance)
        if angle > 0.0:
            growth = min(growth, self._growth_by_curvature(angle, arc))
        return corrector.point(corrected, tangent, point.arclength + arc, step), growth

    def _growth_by_curvature(self, angle: float, arc: float) -> float:
        """The factor that leads to the angle aimed at, if a curvature that rises goes on to do so."""
        before, self._curvature = self._curvature, angle / arc
        rise = max(1.0, self._curvature / before) if before > 0.0 else 1.0
        return max(1.0 / GROWTH, AIM * self._control.max_angle / (angle * rise))


def trace(system: S, start: Array, *, direction: Array, control: ContinuationSettings = DEFAULT) -> Trace[S]:
    """Follow the solution curve of ``system`` from the point near ``start`` (n+1,), lazily.

    ``direction`` (n+1,) is a row c: the start is corrected with c.z held, and the curve is followed to where
    c.z grows. A unit vector corrects at a given value of one component, and leads to larger ones; to
    go on from a point, give its z and its tangent.

    The iteration ends, and does not raise, when the curve cannot be followed; :attr:`Trace.status` says why.
    Where the system changes its discretisation, the point is yielded a second time, with step 0 and on
    the new system: two successive points that differ in arclength always belong to the same system.

    Raises:
        InputError: if ``start``, ``direction``, the weights or what ``adapted`` returns has a wrong shape, if
            the direction is zero, or if the weights are negative, not finite or all zero.
    """
    corrector = _Corrector(system, control)
    row = corrector.metric.vector("direction", direction)
    if not row.any():
        raise InputError("The direction is zero: it must have a component along the curve.")
    return Trace(corrector, control, corrector.metric.vector("start", start), row)


def _cubic(a: Array, slope_a: Array, b: Array, slope_b: Array, x: float) -> Array:
    """Hermite's cubic at ``x`` through ``a`` at 0 and ``b`` at 1."""
    u = x - 1.0
    square, cube = u * u, u * u * x
    return b + (u + square + cube) * slope_b + cube * slope_a - (square + 2.0 * cube) * (b - a)


def _extrapolate(previous: CurvePoint[S] | None, point: CurvePoint[S], step: float) -> Array:
    """The curve one ``step`` beyond ``point``: the cubic through the last two points, or the tangent."""
    if previous is None:
        return point.z + step * point.tangent
    length = point.arclength - previous.arclength
    slope_a, slope_b = length * previous.tangent, length * point.tangent
    return _cubic(previous.z, slope_a, point.z, slope_b, 1.0 + step / length)


def _growth_by_convergence(corrected: _Corrected, tolerance: float) -> float:
    """The factor by which a step may differ if two corrections are to be just enough.

    The third correction goes with the fourth power of the predictor's error, and that with the fourth power
    of the step (in the spirit of C. den Heijer and W. C. Rheinboldt 1981, SIAM J. Numer. Anal. 18, 925-948).
    """
    third = _next_correction(corrected.second, corrected.first) if corrected.second > 0.0 else 0.0
    return min(GROWTH, max(1.0 / GROWTH, (tolerance / third) ** 0.0625)) if third > 0.0 else GROWTH


# Special points


def fold_of(gradient: Callable[[Array, S], Array]) -> Monitor[S]:
    """The monitor that vanishes at the folds of a functional g(z): its derivative along the curve.

    ``gradient(z, system)`` is dg/dz (n+1,); the constant unit vector of a component gives the folds in it.
    """

    def derivative(z: Array, tangent: Array, system: S) -> float:
        return float(gradient(z, system) @ tangent)

    return derivative


@dataclass(frozen=True, eq=False)
class Located(Generic[S]):
    """The ``point`` where a monitor changes sign, at a ``step`` from the first, and the ``value`` there.

    ``error`` estimates how far along the curve, in arclength, the change of sign may be: it covers the
    bracket and the noise of the monitor. Where ``status`` is a failure, the bracket is the last one before.
    """

    point: CurvePoint[S]
    value: float
    error: float
    status: ContinuationStatus


class _Trial(NamedTuple, Generic[S]):
    """A point of the curve, its fraction of the chord that it projects to, and the monitor's value there."""

    fraction: float
    value: float
    point: CurvePoint[S]


class _Bracket(NamedTuple, Generic[S]):
    """Two trials around a change of sign, the monitor's slope over the fraction of the chord, and a status."""

    left: _Trial[S]
    right: _Trial[S]
    slope: float
    status: ContinuationStatus


def locate(
    point_a: CurvePoint[S],
    point_b: CurvePoint[S],
    system: S,
    monitor: Monitor[S],
    *,
    control: ContinuationSettings = DEFAULT,
    tolerance: float = 0.0,
) -> Located[S]:
    """The point between two successive points of a trace where ``monitor(z, tangent, system)`` changes sign.

    The bracket shrinks, by the ITP method (:func:`chuteflow.numerics.roots.itp_trial`), to ``tolerance`` in
    arclength or to round-off, whichever is wider. Each trial is corrected in a hyperplane across the chord
    between the points until its corrections no longer shrink, so that its tangent is exact to round-off too.

    Raises:
        InputError: if the points do not belong to the system or are not successive, or if the sign does not
            change.
    """
    segment = _Segment(point_a, point_b, system, monitor, control)
    left, right = segment.end(0.0, point_a), segment.end(1.0, point_b)
    if not left.value * right.value <= 0.0 or left.value == right.value:
        raise InputError(f"The monitor is {left.value} and {right.value} at the two points: it must change its sign.")
    fine = segment.finest(tolerance)
    bracket = _shrink(segment, left, right, fine)
    if bracket.status is ContinuationStatus.LOCATED and (bracket.left is left) != (bracket.right is right):
        bracket = _beyond_the_end(segment, bracket, fine)
    left, right = bracket.left, bracket.right
    best = min(left, right, key=lambda trial: abs(trial.value))
    width = max(right.fraction - left.fraction, 2.0 * fine)
    # What the slope leaves unexplained is noise.
    noise = max(0.0, (abs(left.value) + abs(right.value)) / abs(bracket.slope) - 2.0 * width)
    error = (width + CAUTION * noise) * segment.speed(best.point)
    return Located(best.point, best.value, error, bracket.status)


def _shrink(segment: _Segment[S], left: _Trial[S], right: _Trial[S], fine: float) -> _Bracket[S]:
    """The bracket of a change of sign, shrunk to twice a ``fine`` fraction of the chord, or to the noise."""
    start = right.fraction - left.fraction
    slope = (right.value - left.value) / start
    for remaining in range(1 + max(0, math.ceil(math.log2(0.5 * start / fine))), 0, -1):
        width = right.fraction - left.fraction
        if width <= 2.0 * fine:
            break
        if width > WIDE * start:
            slope = (right.value - left.value) / width
        fraction = itp_trial(
            (left.fraction, right.fraction),
            (left.value, right.value),
            PUSH / start,
            fine * 2.0**remaining - 0.5 * width,
        )
        trial = segment.trial(min(max(fraction, left.fraction + fine), right.fraction - fine))
        if isinstance(trial, ContinuationStatus):
            return _Bracket(left, right, slope, trial)
        outlying = not min(left.value, right.value) <= trial.value <= max(left.value, right.value)
        left, right = _narrow(left, trial, right)
        if outlying and width <= WIDE * start:
            break  # So near the zero, only noise makes a monitor go up and down.
    return _Bracket(left, right, slope, ContinuationStatus.LOCATED)


def _beyond_the_end(segment: _Segment[S], bracket: _Bracket[S], fine: float) -> _Bracket[S]:
    """The bracket of a change of sign just beyond the end to which another bracket has shrunk.

    The tangents of a trace are less exact than those of the trials: where the monitor is nearly zero at an
    end, it may have the wrong sign there, and change it outside.
    """
    outward, end, inside = (-1.0, 0.0, bracket.right) if bracket.left.fraction == 0.0 else (1.0, 1.0, bracket.left)
    reach = fine + 2.0 * abs(inside.value / bracket.slope)
    while reach < FARTHEST:
        outside = segment.trial(end + outward * reach)
        if isinstance(outside, ContinuationStatus):
            break
        if outside.value * inside.value <= 0.0:
            left, right = (outside, inside) if outward < 0.0 else (inside, outside)
            return _shrink(segment, left, right, fine)
        reach *= 4.0
    return bracket


def _narrow(left: _Trial[S], trial: _Trial[S], right: _Trial[S]) -> tuple[_Trial[S], _Trial[S]]:
    """The part of a bracket on the one or the other side of a trial that holds the change of sign."""
    if trial.value == 0.0:
        return trial, trial
    return (trial, right) if trial.value * left.value > 0.0 else (left, trial)


class _Segment(Generic[S]):
    """The stretch of a curve between two points, cut by hyperplanes across the chord between them."""

    def __init__(
        self, a: CurvePoint[S], b: CurvePoint[S], system: S, monitor: Monitor[S], control: ContinuationSettings
    ) -> None:
        self._corrector = corrector = _Corrector(system, control)
        self._metric = metric = corrector.metric
        self._monitor = monitor
        self._a, self._b = a, b
        self._chord = metric.vector("second point", b.z) - metric.vector("first point", a.z)
        self._row = metric.weights * self._chord
        if min(self._row @ a.tangent, self._row @ b.tangent) <= 0.0:
            raise InputError("The points are not two successive points of a trace: their tangents lead elsewhere.")

    def finest(self, tolerance: float) -> float:
        """Half the fraction of the chord that is as long as ``tolerance``, or that round-off allows."""
        metric, a, b = self._metric, self._a, self._b
        length = metric.arc(a.z, b.z, metric.angle(a.tangent, b.tangent))
        round_off = EPSILON * (1.0 + metric.size(a.z) / metric.size(self._chord))
        return max(0.5 * tolerance / length, 4.0 * round_off)

    def speed(self, point: CurvePoint[S]) -> float:
        """Arclength per fraction of the chord."""
        return float(self._row @ self._chord / (self._row @ point.tangent))

    def end(self, fraction: float, point: CurvePoint[S]) -> _Trial[S]:
        return _Trial(fraction, self._monitor(point.z, point.tangent, self._corrector.system), point)

    def trial(self, fraction: float) -> _Trial[S] | ContinuationStatus:
        metric, a = self._metric, self._a
        near = _across(self._row, a, self._b, fraction)
        corrected = self._corrector.correct(near, self._row, sharp=True)
        if isinstance(corrected, ContinuationStatus):
            return corrected
        arc = metric.arc(a.z, corrected.z, metric.angle(a.tangent, corrected.tangent))
        step = math.copysign(arc, fraction)
        point = self._corrector.point(corrected, corrected.tangent, a.arclength + step, step)
        trial = self.end(fraction, point)
        return trial if math.isfinite(trial.value) else ContinuationStatus.LEFT_DOMAIN


def _across(row: Array, a: CurvePoint[S], b: CurvePoint[S], x: float) -> Array:
    """The cubic through two points, where the product with ``row`` has made the fraction ``x`` of its way."""
    length = row @ (b.z - a.z)
    return _cubic(a.z, length / (row @ a.tangent) * a.tangent, b.z, length / (row @ b.tangent) * b.tangent, x)


def closes(start: CurvePoint[S], previous: CurvePoint[S], current: CurvePoint[S]) -> bool:
    """Whether the curve returned to ``start``, with its tangent, between ``previous`` and ``current``.

    Of a trace from ``start`` on, the answer is True for the first pair of successive points that has the
    start between them or at its end. A crossing of the start at an angle is not a return.

    Raises:
        InputError: if the start is not of the size of the other points: carry it over to their system first.
    """
    if not start.arclength < previous.arclength < current.arclength:
        return False
    metric = _Metric(current.system.weights)
    chord = current.z - previous.z
    row = metric.weights * chord
    x = float(row @ (metric.vector("start", start.z) - previous.z) / (row @ chord))
    if not -SLACK <= x <= 1.0 + SLACK:
        return False
    gap = metric.size(start.z - _across(row, previous, current, x))
    blend = (1.0 - x) * previous.tangent + x * current.tangent
    return gap <= CLOSE * metric.size(chord) and metric.angle(blend / metric.norm(blend), start.tangent) <= PARALLEL
