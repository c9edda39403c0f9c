"""Continuation: curves, folds and endings that are known exactly."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise, takewhile
from typing import Literal

import numpy as np
import pytest

from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array, grid, refinement
from chuteflow.numerics.continuation import (
    ContinuationSettings,
    ContinuationStatus,
    CurvePoint,
    Located,
    System,
    Trace,
    closes,
    fold_of,
    locate,
    trace,
)

# Systems


@dataclass
class Equation:
    """F(z) = 0 from two functions; counts its evaluations."""

    f: Callable[[Array], Array]
    jacobian: Callable[[Array], Array]
    weights: Array
    calls: int = 0

    def residual_and_jacobian(self, z: Array) -> tuple[Array, Array]:
        self.calls += 1
        with np.errstate(all="ignore"):
            return self.f(z), self.jacobian(z)


def planar(f, f_x, f_y, weights=(1.0, 1.0)) -> Equation:
    """One equation f(x, y) = 0 and its two derivatives."""
    return Equation(
        lambda z: np.array([f(z[0], z[1])]),
        lambda z: np.array([[f_x(z[0], z[1]), f_y(z[0], z[1])]]),
        np.array(weights),
    )


def circle() -> Equation:
    return planar(lambda x, y: x * x + y * y - 1.0, lambda x, y: 2.0 * x, lambda x, y: 2.0 * y)


def ellipse() -> Equation:
    """Half-axes 2 and 1; a circle to the inner product."""
    return planar(lambda x, y: x * x / 4.0 + y * y - 1.0, lambda x, y: x / 2.0, lambda x, y: 2.0 * y, (0.25, 1.0))


def cubic() -> Equation:
    return planar(lambda x, y: y - x**3 + 3.0 * x, lambda x, y: 3.0 - 3.0 * x * x, lambda x, y: 1.0)


def freudenstein_roth(weights=(1.0, 1.0, 1.0)) -> Equation:
    """The first example of Pitcon."""

    def f(z: Array) -> Array:
        x, y, a = z
        return np.array(
            [
                x - y**3 + 5 * y**2 - 2 * y - 13 + 34 * (a - 1),
                x + y**3 + y**2 - 14 * y - 29 + 10 * (a - 1),
            ]
        )

    def jacobian(z: Array) -> Array:
        y = z[1]
        return np.array([[1.0, -3 * y**2 + 10 * y - 2, 34.0], [1.0, 3 * y**2 + 2 * y - 14, 10.0]])

    return Equation(f, jacobian, np.array(weights))


def freudenstein_roth_at(y: float) -> Array:
    """The point of its curve at a given second component."""
    a = 1.0 + (2 * y**3 - 4 * y**2 - 12 * y - 16) / 24
    return np.array([y**3 - 5 * y**2 + 2 * y + 13 - 34 * (a - 1), y, a])


class Bratu:
    """u'' + lambda exp(u) = 0 on [0, 1], u = 0 at both ends; z is u at the inner nodes, then lambda.

    The inner product is the integral of the product of the two u, plus that of the two lambda.
    """

    def __init__(self, degree: int, *, quadrature: bool = True) -> None:
        g = grid(degree)
        self.degree = degree
        self.weights = np.append(g.weights[1:-1] if quadrature else np.ones(degree - 1), 1.0)
        self.second_derivative = (g.derivative @ g.derivative)[1:-1, 1:-1]
        self.calls = 0

    def residual_and_jacobian(self, z: Array) -> tuple[Array, Array]:
        self.calls += 1
        u, parameter = z[:-1], z[-1]
        e = np.exp(u)
        jacobian = np.column_stack([self.second_derivative + np.diag(parameter * e), e])
        return self.second_derivative @ u + parameter * e, jacobian

    def start(self) -> Array:
        return np.zeros(self.degree)

    def middle(self, z: Array) -> float:
        """The solution at 1/2, a node if the degree is even."""
        return float(z[self.degree // 2 - 1])

    def norm(self, z: Array) -> float:
        return float(np.sqrt(self.weights[:-1] @ z[:-1] ** 2))


#: The degree of the refined grid.
FINE = 32


class RefinedBratu(Bratu):
    """Bratu's problem on a coarse grid, and on a fine one as soon as the solution reaches 2."""

    def adapt(self, z: Array, tangent: Array) -> tuple[RefinedBratu, Array, Array] | None:
        if self.degree == FINE or self.middle(z) < 2.0:
            return None
        return RefinedBratu(FINE), self.carried(z), self.carried(tangent)

    def carried(self, z: Array) -> Array:
        full = np.pad(z[:-1], 1)
        return np.append((refinement(self.degree, FINE) @ full)[1:-1], z[-1])


class Spoilt(RefinedBratu):
    """Carries a point over that is far from the curve."""

    def carried(self, z: Array) -> Array:
        return np.full(FINE, 40.0)


#: The fold of Bratu's problem is at t tanh t = 1, lambda = 8 (t/cosh t)^2, u(1/2) = 2 ln cosh t.
BRATU_T = 1.1996786402577338
BRATU_FOLD = 3.5138307191251625
GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(60)


def bratu_parameter(middle: float) -> float:
    """Exact lambda at given u(1/2)."""
    t = np.arccosh(np.exp(middle / 2))
    return float(8 * (t / np.cosh(t)) ** 2)


def bratu_norm(middle: float) -> float:
    """Exact L2 norm of u at given u(1/2)."""
    t = np.arccosh(np.exp(middle / 2))
    u = middle - 2 * np.log(np.cosh(t * GAUSS_NODES))
    return float(np.sqrt(0.5 * GAUSS_WEIGHTS @ u**2))


def bratu_points(system: Bratu, control: ContinuationSettings) -> list[CurvePoint[Bratu]]:
    """From the trivial solution to well beyond the fold."""
    points = trace(system, system.start(), direction=np.eye(system.degree)[-1], control=control)
    kept = list(takewhile(lambda p: p.system.middle(p.z) < 4.0, points))
    assert points.status is ContinuationStatus.RUNNING, points.status.value
    return kept


# The table of problems


@dataclass(frozen=True)
class Problem:
    """A curve from ``start`` in ``direction`` that ``goes_on``, and its exact ``folds`` by component."""

    make: Callable[[], System]
    start: tuple[float, ...]
    direction: tuple[float, ...]
    goes_on: Callable[[CurvePoint], bool]
    folds: dict[int, list[tuple[float, ...]]] = field(default_factory=dict)

    def follow(self, system: System, control: ContinuationSettings) -> list[CurvePoint]:
        """The points of the trace, and the first beyond its end."""
        return followed(trace(system, np.array(self.start), direction=np.array(self.direction), control=control), self)


def followed(points: Trace, problem: Problem) -> list[CurvePoint]:
    kept = []
    for point in points:
        kept.append(point)
        if not problem.goes_on(point):
            return kept
    raise AssertionError(points.status.value)


def round_trip(radius_x: float) -> dict[int, list[tuple[float, ...]]]:
    return {0: [(-radius_x, 0.0), (radius_x, 0.0)], 1: [(0.0, 1.0), (0.0, -1.0)]}


FR_Y_OF_LAST = [(2 - np.sqrt(22)) / 3, (2 + np.sqrt(22)) / 3]
FR_Y_OF_FIRST = [(4 / 3 - np.sqrt(16 / 9 + 418)) / 11, (4 / 3 + np.sqrt(16 / 9 + 418)) / 11]

PROBLEMS = {
    "circle": Problem(circle, (0.8, 0.6), (-0.6, 0.8), lambda p: p.arclength < 6.28, round_trip(1.0)),
    "ellipse": Problem(ellipse, (1.6, 0.6), (-1.2, 0.8), lambda p: p.arclength < 6.28, round_trip(2.0)),
    "cubic": Problem(cubic, (-3.0, -18.0), (1.0, 0.0), lambda p: p.z[0] < 3.0, {1: [(-1.0, 2.0), (1.0, -2.0)]}),
    "Freudenstein-Roth": Problem(
        freudenstein_roth,
        (15.0, -2.0, 0.0),
        (0.0, 1.0, 0.0),
        lambda p: p.z[1] < 4.0,
        {
            0: [tuple(freudenstein_roth_at(y)) for y in FR_Y_OF_FIRST],
            2: [tuple(freudenstein_roth_at(y)) for y in FR_Y_OF_LAST],
        },
    ),
}
CHOICES: list[Literal["local", "arclength"]] = ["local", "arclength"]


@pytest.fixture(params=PROBLEMS)
def problem(request: pytest.FixtureRequest) -> Problem:
    return PROBLEMS[request.param]


@pytest.fixture(params=CHOICES)
def control(request: pytest.FixtureRequest) -> ContinuationSettings:
    return ContinuationSettings(parametrisation=request.param)


def located_folds(points: list[CurvePoint], component: int, control: ContinuationSettings) -> Iterator[Located]:
    """The folds in a component, each between two points of a trace on one system."""
    for a, b in pairwise(points):
        monitor = fold_of(lambda z, system: np.eye(len(z))[component])
        if a.system is b.system and a.tangent[component] * b.tangent[component] <= 0.0:
            yield locate(a, b, b.system, monitor, control=control)


def inner(system: System, a: Array, b: Array) -> float:
    return float(system.weights @ (a * b))


def distance(system: System, a: Array, b: Array) -> float:
    return float(np.sqrt(inner(system, a - b, a - b)))


# The table itself


def test_jacobians_are_the_derivatives(problem):
    system = problem.make()
    rng = np.random.default_rng(1)
    for _ in range(5):
        z = rng.uniform(-2.0, 2.0, len(problem.start))
        _, jacobian = system.residual_and_jacobian(z)
        for k, unit in enumerate(1e-5 * np.eye(len(z))):
            ahead, behind = (system.residual_and_jacobian(z + e)[0] for e in (unit, -unit))
            np.testing.assert_allclose((ahead - behind) / 2e-5, jacobian[:, k], rtol=1e-7, atol=1e-7)


def test_exact_folds_are_folds(problem):
    system = problem.make()
    for component, folds in problem.folds.items():
        for z in folds:
            f, jacobian = system.residual_and_jacobian(np.array(z))
            np.testing.assert_allclose(f, 0.0, atol=1e-13)
            # The tangent has no such component if the other columns are dependent.
            others = np.delete(jacobian, component, axis=1)
            assert abs(np.linalg.det(others)) < 1e-12
            assert np.linalg.matrix_rank(jacobian) == len(f)


def test_the_exact_fold_of_bratu_is_a_maximum():
    t = BRATU_T
    assert abs(t * np.tanh(t) - 1.0) < 1e-15
    fold = 2 * np.log(np.cosh(t))
    assert abs(bratu_parameter(fold) - BRATU_FOLD) < 1e-14
    assert max(bratu_parameter(fold - 1e-3), bratu_parameter(fold + 1e-3)) < BRATU_FOLD


# Points of a trace


def test_points_solve_the_system_within_their_error(problem, control):
    system = problem.make()
    for point in problem.follow(system, control):
        f, jacobian = system.residual_and_jacobian(point.z)
        correction = np.linalg.lstsq(jacobian, -f)[0]
        round_off = 1e-15 * (1.0 + np.abs(point.z).max())
        assert point.error <= control.tolerance
        assert np.abs(np.sqrt(system.weights) * correction).max() <= point.error + round_off


def test_tangents_are_unit_vectors_along_the_curve(problem, control):
    system = problem.make()
    points = problem.follow(system, control)
    for a, b in pairwise(points):
        _, jacobian = system.residual_and_jacobian(b.z)
        assert np.abs(jacobian @ b.tangent).max() < 2e-5 * np.abs(jacobian).max()
        assert inner(system, b.tangent, b.tangent) == pytest.approx(1.0, abs=1e-14)
        assert inner(system, b.z - a.z, b.tangent) > 0.0


def test_successive_tangents_differ_by_less_than_the_largest_angle(problem):
    system = problem.make()
    for largest in (0.05, 0.2):
        points = problem.follow(system, ContinuationSettings(max_angle=largest))
        cosines = [inner(system, a.tangent, b.tangent) for a, b in pairwise(points)]
        assert min(cosines) > np.cos(largest) - 1e-12
        assert min(cosines) < np.cos(0.5 * largest)


def test_steps_stay_within_their_bounds():
    points = PROBLEMS["cubic"].follow(cubic(), ContinuationSettings(initial_step=0.04, min_step=0.038, max_step=0.05))
    steps = [point.step for point in points[1:]]
    assert points[0].step == 0.0
    assert steps[0] == 0.04
    assert (min(steps), max(steps)) == (0.038, 0.05)
    np.testing.assert_allclose(np.diff([point.arclength for point in points]), steps, rtol=0.03)


def test_the_start_is_corrected_where_the_direction_says():
    direction = np.array([0.0, 1.0])
    point = next(trace(circle(), np.array([0.9, 0.6]), direction=direction))
    np.testing.assert_allclose(point.z, [0.8, 0.6], atol=1e-12)
    np.testing.assert_allclose(point.tangent, [-0.6, 0.8], atol=1e-4)
    back = next(trace(circle(), np.array([0.9, 0.6]), direction=-direction))
    np.testing.assert_array_equal(back.tangent, -point.tangent)


def test_a_trace_is_lazy_and_leaves_its_inputs_alone():
    system = circle()
    start, direction = np.array([0.9, 0.5]), np.array([0.0, 1.0])
    points = trace(system, start, direction=direction)
    assert system.calls == 0
    start[:] = direction[:] = np.nan
    point = next(points)
    assert np.isfinite(next(points).z).all()
    with pytest.raises(ValueError, match="read-only"):
        point.z[0] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        point.tangent[0] = 0.0


def test_few_evaluations_are_needed(control):
    system = Bratu(20)
    points = list(
        takewhile(
            lambda p: p.arclength < 12.0,
            trace(system, system.start(), direction=np.eye(20)[-1], control=control),
        )
    )
    # A tangent predictor takes twice as many points, and 160 to 190 evaluations.
    assert len(points) < 40
    assert system.calls < 90


def recorded(system: Equation) -> list[Array]:
    """Where the system is evaluated from now on."""
    tried = []
    f = system.f

    def recording(z: Array) -> Array:
        tried.append(z)
        return f(z)

    system.f = recording
    return tried


def test_a_component_is_held_that_does_not_near_its_fold():
    system = circle()
    tried = recorded(system)
    held = 0
    control = ContinuationSettings(max_step=0.1, max_points=62)
    for point in trace(system, np.array([1.0, 0.0]), direction=np.array([0.0, 1.0]), control=control):
        quarter, angle = divmod(point.arclength, np.pi / 2)
        # Up to the middle of the first quarter y changes more than x, but ever less.
        if angle > np.pi / 8:
            assert tried[0][int(quarter) % 2] == tried[-1][int(quarter) % 2]
            held += 1
        tried.clear()
    assert held > 40


def test_corrections_are_normal_to_the_tangent_in_the_inner_product():
    system = ellipse()
    tried = recorded(system)
    tangent = None
    control = ContinuationSettings(max_step=0.1, max_points=30, parametrisation="arclength")
    for point in trace(system, np.array([2.0, 0.0]), direction=np.array([0.0, 1.0]), control=control):
        correction = point.z - tried[0]
        if tangent is not None:
            assert abs(inner(system, tangent, correction)) < 1e-5 * np.abs(correction).max() + 1e-15
        tangent = point.tangent
        tried.clear()


# Arclength


def test_arclength_is_exact_on_circles_of_the_inner_product(control):
    for name in ("circle", "ellipse"):
        problem = PROBLEMS[name]
        points = problem.follow(problem.make(), control)
        angles = [np.arctan2(p.z[1], p.z[0] / (2.0 if name == "ellipse" else 1.0)) for p in points]
        lengths = [p.arclength for p in points]
        np.testing.assert_allclose(np.unwrap(angles) - np.arctan2(0.6, 0.8), lengths, atol=1e-8)


def test_arclength_converges_with_the_fourth_power_of_the_step():
    exact = 4.0 * 2.0 * 1.2110560275684595237  # complete elliptic integral E(m = 3/4)
    errors = []
    for step in (0.2, 0.1):
        system = ellipse()
        system.weights = np.ones(2)
        control = ContinuationSettings(initial_step=step, max_step=step, max_angle=1.0)
        points = trace(system, np.array([2.0, 0.0]), direction=np.array([0.0, 1.0]), control=control)
        kept = list(takewhile(lambda p: p.arclength < 10.5, points))
        closing = [located for located in located_folds(kept, 0, control) if located.point.z[0] > 0.0]
        errors.append(abs(closing[-1].point.arclength - exact))
    assert errors[0] < 2e-4
    assert errors[1] < errors[0] / 12.0


def test_neither_the_resolution_nor_the_step_moves_the_path(control):
    lengths = []
    for degree, step, accuracy in [(24, 0.05, 2e-7), (32, 0.05, 1e-9), (24, 0.03, 2e-7)]:
        points = bratu_points(Bratu(degree), replace(control, max_step=step))
        (fold,) = located_folds(points, -1, control)
        lengths.append(fold.point.arclength)
        for point in points[1:]:
            middle = point.system.middle(point.z)
            assert abs(point.z[-1] - bratu_parameter(middle)) < accuracy
            assert abs(point.system.norm(point.z) - bratu_norm(middle)) < accuracy
    coarse, fine, small_steps = lengths
    assert abs(coarse - fine) < 1e-9
    assert abs(coarse - small_steps) < 1e-6


def test_without_quadrature_weights_the_resolution_does_move_the_path():
    lengths = []
    for degree in (16, 24):
        (fold,) = located_folds(
            bratu_points(Bratu(degree, quadrature=False), ContinuationSettings(max_step=0.1)),
            -1,
            ContinuationSettings(),
        )
        lengths.append(fold.point.arclength)
    assert np.ptp(lengths) > 0.1


# Folds


def exact_folds(problem: Problem) -> Iterator[tuple[int, list[Array]]]:
    for component, folds in problem.folds.items():
        yield component, [np.array(z) for z in folds]


def test_folds_are_located_within_their_error(problem, control):
    system = problem.make()
    points = problem.follow(system, control)
    for component, folds in exact_folds(problem):
        before = system.calls
        located = list(located_folds(points, component, control))
        assert len(located) == len(folds)
        assert system.calls - before < 40 * len(folds)
        for found, exact in zip(located, folds, strict=True):
            assert found.status is ContinuationStatus.LOCATED
            assert abs(found.value) < 1e-12
            # Honest, but for the rounding of the exact point, and close to round-off.
            assert distance(system, found.point.z, exact) <= found.error + 4e-16 * np.abs(exact).max()
            assert found.error < 1e-13 * (1.0 + np.abs(exact).max())


def test_the_fold_of_bratu(control):
    (fold,) = located_folds(bratu_points(Bratu(24), control), -1, control)
    assert abs(fold.point.z[-1] - BRATU_FOLD) < 1e-11
    assert abs(fold.point.system.middle(fold.point.z) - 2 * np.log(np.cosh(BRATU_T))) < 1e-11
    assert fold.error < 1e-12


def test_the_parametrisations_agree(problem):
    found = []
    for choice in CHOICES:
        control = ContinuationSettings(parametrisation=choice, max_step=0.5, max_angle=0.1)
        points = problem.follow(problem.make(), control)
        found.append([f.point for component in problem.folds for f in located_folds(points, component, control)])
    for local, arclength in zip(*found, strict=True):
        np.testing.assert_allclose(local.z, arclength.z, rtol=1e-13, atol=1e-13)
        assert local.arclength == pytest.approx(arclength.arclength, rel=1e-5)


def test_the_way_back_has_the_same_folds(problem, control):
    system = problem.make()
    there = problem.follow(system, control)
    last = there[-1]
    back = list(
        takewhile(
            lambda p: p.arclength < last.arclength,
            trace(system, last.z, direction=-last.tangent, control=control),
        )
    )
    for component in problem.folds:
        forward = [found.point.z for found in located_folds(there, component, control)]
        backward = [found.point.z for found in located_folds(back, component, control)]
        np.testing.assert_allclose(backward[::-1], forward, rtol=1e-13, atol=1e-13)


def test_equal_steps_back_pass_through_the_same_points(control):
    equal = replace(control, initial_step=0.05, max_step=0.05)
    problem = PROBLEMS["circle"]
    there = problem.follow(circle(), equal)
    last = there[-1]
    points = trace(circle(), last.z, direction=-last.tangent, control=replace(equal, max_points=len(there)))
    back = list(points)
    assert points.status is ContinuationStatus.MAX_POINTS
    np.testing.assert_allclose([p.z for p in back[::-1]], [p.z for p in there], atol=0.05 * 0.05)


def test_a_functional_has_its_own_folds(control):
    points = PROBLEMS["circle"].follow(circle(), control)
    monitor = fold_of(lambda z, system: np.array([2.0 * z[0], 1.0]))  # of x^2 + y
    changes = [
        locate(a, b, a.system, monitor, control=control)
        for a, b in pairwise(points)
        if monitor(a.z, a.tangent, a.system) * monitor(b.z, b.tangent, b.system) <= 0.0
    ]
    # At an angle a on the circle its derivative is cos a (1 - 2 sin a).
    at = np.array([90.0, 150.0, 270.0, 390.0]) * np.pi / 180.0
    exact = np.column_stack([np.cos(at), np.sin(at)])
    np.testing.assert_allclose([c.point.z for c in changes], exact, atol=1e-14)


def test_a_coarse_tolerance_is_kept_and_saves_work(control):
    work = []
    a, b = fold_of_the_cubic(control)
    for tolerance in (1e-3, 0.0):
        system = cubic()
        monitor = fold_of(lambda z, system: np.array([0.0, 1.0]))
        found = locate(a, b, system, monitor, control=control, tolerance=tolerance)
        assert distance(system, found.point.z, np.array([-1.0, 2.0])) <= found.error <= max(1.01 * tolerance, 1e-14)
        work.append(system.calls)
    assert work[0] < work[1] < 40


def test_locate_says_why_it_stopped(control):
    a, b = fold_of_the_cubic(control)
    hole = planar(lambda x, y: np.nan if a.z[0] < x < b.z[0] else 0.0, lambda x, y: 3.0 - 3.0 * x * x, lambda x, y: 1.0)
    found = locate(a, b, hole, fold_of(lambda z, system: np.array([0.0, 1.0])), control=control)
    assert found.status is ContinuationStatus.LEFT_DOMAIN
    assert found.status.failed
    assert found.point is a or found.point is b
    assert found.error >= b.arclength - a.arclength


def fold_of_the_cubic(control: ContinuationSettings) -> tuple[CurvePoint[Equation], CurvePoint[Equation]]:
    """Two successive points around (-1, 2)."""
    points = PROBLEMS["cubic"].follow(cubic(), control)
    return next((a, b) for a, b in pairwise(points) if a.tangent[1] * b.tangent[1] < 0.0)


def test_the_noise_of_a_monitor_is_in_the_error(control):
    a, b = fold_of_the_cubic(control)
    rng = np.random.default_rng(0)
    before = a.system.calls
    for noise in np.repeat([1e-10, 1e-7, 1e-4], 5):
        found = locate(
            a,
            b,
            a.system,
            lambda z, t, system, noise=noise: float(t[1] + noise * rng.uniform(-1.0, 1.0)),
            control=control,
        )
        assert distance(a.system, found.point.z, np.array([-1.0, 2.0])) <= found.error < 40.0 * noise
    # To shrink the bracket further than the noise allows would take four times as many.
    assert a.system.calls - before < 15 * 30


@pytest.mark.parametrize(
    "function",
    [lambda x: np.expm1(200.0 * x), lambda x: np.expm1(-200.0 * x), lambda x: x**9, np.sign],
    ids=["steep to the right", "steep to the left", "flat", "a jump"],
)
def test_a_monitor_far_from_linear_is_located_as_well(function, control):
    a, b = fold_of_the_cubic(control)
    calls = 0

    def monitor(z: Array, tangent: Array, system: Equation) -> float:
        nonlocal calls
        calls += 1
        return float(function(z[0] + 1.0 + 1e-16))

    found = locate(a, b, a.system, monitor, control=control)
    assert found.status is ContinuationStatus.LOCATED
    assert abs(found.point.z[0] + 1.0) < 1e-14
    # Bisection would take 48.
    assert calls < 52


def test_locations_do_not_hang_on_the_number_of_iterations():
    problem = PROBLEMS["Freudenstein-Roth"]
    few = ContinuationSettings(max_iterations=3)
    for found in located_folds(problem.follow(freudenstein_roth(), few), 2, few):
        assert found.status is ContinuationStatus.LOCATED
        assert found.error < 1e-11


def test_a_monitor_that_is_not_a_number_is_told(control):
    a, b = fold_of_the_cubic(control)
    found = locate(a, b, a.system, lambda z, t, system: t[1] if z is a.z or z is b.z else np.nan, control=control)
    assert found.status is ContinuationStatus.LEFT_DOMAIN
    assert np.isfinite(found.value)


def test_locate_refuses_what_it_cannot_bracket():
    points = PROBLEMS["circle"].follow(circle(), ContinuationSettings())
    a, b, *_, opposite, last = points
    with pytest.raises(InputError, match="change its sign"):
        locate(a, b, a.system, lambda z, t, system: 1.0)
    with pytest.raises(InputError, match="change its sign"):
        locate(a, b, a.system, lambda z, t, system: np.nan)
    with pytest.raises(InputError, match="not two successive points"):
        locate(b, a, a.system, lambda z, t, system: z[0] - 0.7)
    with pytest.raises(InputError, match="not two successive points"):
        locate(a, a, a.system, lambda z, t, system: z[0] - 0.7)
    with pytest.raises(InputError, match="shape"):
        locate(opposite, last, freudenstein_roth(), lambda z, t, system: 0.0)


@pytest.mark.parametrize("end", [0, 1])
def test_a_zero_at_an_end_is_found(end):
    a, b = PROBLEMS["circle"].follow(circle(), ContinuationSettings())[4:6]
    zero = (a, b)[end]
    found = locate(a, b, a.system, lambda z, t, system: float(z[0] - zero.z[0]))
    assert distance(a.system, found.point.z, zero.z) <= found.error < 1e-13


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("offset", [1e-6, 1e-3])
def test_a_fold_just_beyond_an_end_is_found(end, offset, control):
    # The tangent of one end is so rough that its fold seems to be on the other side of it.
    here = np.pi / 2 + np.array([[offset, 0.1], [-0.1, -offset]])[end]
    a, b = (
        CurvePoint(np.array([np.cos(t), np.sin(t)]), np.array([-np.sin(t), np.cos(t)]), t, 0.1, 2, 0.0, circle())
        for t in here
    )
    rough = here[end] + np.array([-2.0, 2.0])[end] * offset
    tangent = np.array([-np.sin(rough), np.cos(rough)])
    a, b = (replace(a, tangent=tangent), b) if end == 0 else (a, replace(b, tangent=tangent))
    found = locate(a, b, a.system, fold_of(lambda z, system: np.array([0.0, 1.0])), control=control)
    assert found.status is ContinuationStatus.LOCATED
    assert distance(a.system, found.point.z, np.array([0.0, 1.0])) <= found.error < 1e-13
    assert found.point.arclength == pytest.approx(np.pi / 2, abs=offset)


# Closed curves


@pytest.mark.parametrize("name", ["circle", "ellipse"])
def test_a_closed_curve_is_seen_to_close_once_around(name, control):
    problem = PROBLEMS[name]
    points = list(
        takewhile(
            lambda p: p.arclength < 20.0,
            trace(
                problem.make(),
                np.array(problem.start),
                direction=np.array(problem.direction),
                control=control,
            ),
        )
    )
    returns = [b.arclength for a, b in pairwise(points) if closes(points[0], a, b)]
    around = 2.0 * np.pi
    assert len(returns) == 3
    for turn, length in enumerate(returns, start=1):
        assert turn * around <= length < turn * around + control.max_angle


def test_a_segment_that_ends_at_the_start_closes():
    equal = 2.0 * np.pi / 60
    control = ContinuationSettings(initial_step=equal, max_step=equal, parametrisation="arclength")
    points = PROBLEMS["circle"].follow(circle(), control)
    before, start = points[58], points[0]
    assert closes(start, before, replace(start, arclength=2.0 * np.pi))


def test_other_passages_do_not_close():
    points = list(
        takewhile(lambda p: p.arclength < 7.0, trace(circle(), np.array([1.0, 0.0]), direction=np.array([0.0, 1.0])))
    )
    start = points[0]

    def seen(as_start: CurvePoint) -> bool:
        return any(closes(as_start, a, b) for a, b in pairwise(points))

    assert seen(start)
    assert not seen(replace(start, tangent=-start.tangent))
    assert not seen(replace(start, tangent=np.array([0.6, 0.8])))
    assert not seen(replace(start, z=np.array([1.02, 0.0])))
    with pytest.raises(InputError, match="start"):
        seen(replace(start, z=np.zeros(3)))


def test_an_open_curve_does_not_close():
    points = PROBLEMS["cubic"].follow(cubic(), ContinuationSettings())
    assert not any(closes(points[0], a, b) for a, b in pairwise(points))


# A change of discretisation


def test_a_change_of_discretisation_does_not_break_the_path(control):
    points = bratu_points(RefinedBratu(12), control)
    (at,) = (k for k, (a, b) in enumerate(pairwise(points)) if a.system is not b.system)
    old, new = points[at : at + 2]
    assert old.system.middle(old.z) >= 2.0 > points[at - 1].system.middle(points[at - 1].z)
    assert (len(old.z), len(new.z)) == (12, FINE)
    assert new.step == 0.0
    assert new.arclength == old.arclength
    assert inner(new.system, new.tangent, RefinedBratu(12).carried(old.tangent)) == pytest.approx(1.0, abs=1e-4)
    # The coarse grid is off by 5e-6 by then; the fine one is not, from its first point on.
    errors = [abs(p.z[-1] - bratu_parameter(p.system.middle(p.z))) for p in points[1:]]
    assert max(errors[at:]) < 1e-9 < errors[at - 1]
    assert all(b.arclength > a.arclength for a, b in pairwise(points[at + 1 :]))
    # As long as on one grid all the way.
    (changed,), (plain,) = (
        [f.point.arclength for f in located_folds(p, -1, control)] for p in (points, bratu_points(Bratu(FINE), control))
    )
    assert changed == pytest.approx(plain, abs=1e-3)


def test_a_system_that_always_asks_for_a_change_gets_one_between_steps():
    class Restless(RefinedBratu):
        def adapt(self, z: Array, tangent: Array) -> tuple[RefinedBratu, Array, Array]:
            return Restless(self.degree), z, tangent

    system = Restless(12)
    points = list(trace(system, system.start(), direction=np.eye(12)[-1], control=ContinuationSettings(max_points=21)))
    assert [point.step > 0.0 for point in points[1:]] == 10 * [False, True]
    assert len({id(point.system) for point in points}) == 11


def test_a_point_carried_over_badly_ends_the_trace():
    system = Spoilt(12)
    points = trace(system, system.start(), direction=np.eye(12)[-1])
    assert Spoilt(12).middle([*points][-1].z) >= 2.0
    assert points.status is ContinuationStatus.ADAPTATION_FAILED


def test_what_is_carried_over_must_fit():
    class Misfit(RefinedBratu):
        def carried(self, z: Array) -> Array:
            return z

    system = Misfit(12)
    with pytest.raises(InputError, match="carried over has the shape"):
        list(trace(system, system.start(), direction=np.eye(12)[-1]))


# Weights of zero


def test_components_without_weight_are_corrected_all_the_same(control):
    system = planar(lambda x, y: y**3 + y - x, lambda x, y: -1.0, lambda x, y: 3.0 * y * y + 1.0, (1.0, 0.0))
    points = trace(system, np.zeros(2), direction=np.array([1.0, 0.0]), control=control)
    kept = list(takewhile(lambda p: p.z[0] < 30.0, points))
    assert len(kept) > 10
    for point in kept:
        x, y = point.z
        assert abs(y**3 + y - x) / (3.0 * y * y + 1.0) <= control.tolerance
        assert point.tangent[0] == 1.0
        assert point.arclength == pytest.approx(x, rel=1e-14, abs=1e-14)


# Endings


def curve(f, derivative) -> Equation:
    """The graph y = f(x)."""
    return planar(lambda x, y: y - f(x), lambda x, y: -derivative(x), lambda x, y: 1.0)


@pytest.mark.parametrize(
    ("f", "derivative", "evaluations"),
    [
        (lambda x: (1.0 - x) ** 1.5, lambda x: -1.5 * (1.0 - x) ** 0.5, 80),
        (lambda x: (1.0 - x) ** 0.5, lambda x: -0.5 / (1.0 - x) ** 0.5, 100),
    ],
    ids=["tangent to the edge", "square root"],
)
def test_a_curve_that_ends_is_followed_to_its_end(f, derivative, evaluations, control):
    system = curve(f, derivative)
    points = trace(system, np.array([0.0, 1.0]), direction=np.array([1.0, 0.0]), control=control)
    last = list(points)[-1]
    assert points.status is ContinuationStatus.LEFT_DOMAIN
    assert points.status.failed
    # The square root makes 1e-5 of the tolerance of 1e-10.
    np.testing.assert_allclose(last.z, [1.0, 0.0], atol=1e-5)
    assert list(points) == []
    assert system.calls < evaluations


def test_a_corner_is_not_turned(control):
    bent = curve(lambda x: max(-0.2 * x, 0.6 * x), lambda x: 0.6 if x > 0.0 else -0.2)
    points = trace(bent, np.array([-1.0, 0.2]), direction=np.array([1.0, 0.0]), control=control)
    last = list(points)[-1]
    assert points.status is ContinuationStatus.SHARP_TURN
    np.testing.assert_allclose(last.z, [0.0, 0.0], atol=1e-7)


def test_a_wrong_jacobian_is_told():
    system = curve(lambda x: x * x, lambda x: -2.0 * x)
    points = trace(system, np.array([1.0, 1.0]), direction=np.array([1.0, 0.0]))
    tried = recorded(system)
    assert len(list(points)) == 1
    assert points.status is ContinuationStatus.NOT_CONVERGED
    assert min(np.linalg.norm(z - tried[0]) for z in tried[1:]) == pytest.approx(1e-8, rel=1e-6)
    # A try is given up as soon as corrections grow; there are 21 from a step of 0.01 to one of 1e-8.
    assert system.calls == 1 + 2 * 21


def test_a_singular_system_is_told(control):
    system = planar(lambda x, y: y, lambda x, y: 0.0, lambda x, y: float(x < 1.0))
    points = trace(system, np.zeros(2), direction=np.array([1.0, 0.0]), control=control)
    assert list(points)[-1].z[0] == pytest.approx(1.0, abs=1e-6)
    assert points.status is ContinuationStatus.SINGULAR


@pytest.mark.parametrize(
    ("system", "start", "direction"),
    [
        (
            planar(lambda x, y: x * x + y * y + 1, lambda x, y: 2 * x, lambda x, y: 2 * y),
            [1.0, 1.0],
            [1.0, 0.0],
        ),
        (circle(), [1.0, 0.0], [1.0, 0.0]),
        (planar(lambda x, y: y, lambda x, y: 0.0, lambda x, y: 1.0, (0.0, 1.0)), [1.0, 0.0], [1.0, 0.0]),
    ],
    ids=["no solution", "direction normal to the curve", "nothing that changes has weight"],
)
def test_a_start_that_leads_nowhere_is_told(system, start, direction):
    points = trace(system, np.array(start), direction=np.array(direction))
    assert list(points) == []
    assert points.status is ContinuationStatus.START_FAILED


def test_max_points_ends_a_trace_that_can_be_taken_up_again():
    first = trace(
        circle(), np.array([1.0, 0.0]), direction=np.array([0.0, 1.0]), control=ContinuationSettings(max_points=5)
    )
    points = list(first)
    assert len(points) == 5
    assert first.status is ContinuationStatus.MAX_POINTS
    assert not first.status.failed
    again = trace(circle(), points[-1].z, direction=points[-1].tangent)
    np.testing.assert_allclose(next(again).z, points[-1].z, atol=1e-12)
    assert inner(circle(), next(again).z - points[-1].z, points[-1].tangent) > 0.0


@pytest.mark.parametrize("status", ContinuationStatus)
def test_every_status_is_a_sentence(status):
    assert status.value[0].isupper()
    assert status.value.endswith(".")


# Inputs


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("min_step", 0.0),
        ("initial_step", 1e-9),
        ("max_step", 1e-9),
        ("max_angle", 1.5),
        ("tolerance", 0.0),
        ("tolerance", np.nan),
        ("max_iterations", 1),
        ("max_points", 0),
        ("parametrisation", "natural"),
    ],
)
def test_a_control_out_of_range_is_refused(name, value):
    with pytest.raises(InputError, match=f"^{name} is {value!r}: it must be "):
        ContinuationSettings(**{name: value})


@pytest.mark.parametrize(
    ("weights", "start", "direction", "message"),
    [
        ([1.0, -1.0], [1.0, 0.0], [0.0, 1.0], "weights"),
        ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], "weights"),
        ([1.0, np.nan], [1.0, 0.0], [0.0, 1.0], "weights"),
        ([1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0], "start"),
        ([1.0, 1.0], [1.0, 0.0], [0.0], "direction"),
        ([1.0, 1.0], [1.0, 0.0], [0.0, 0.0], "direction"),
    ],
)
def test_inputs_that_do_not_fit_are_refused(weights, start, direction, message):
    system = circle()
    system.weights = np.array(weights)
    with pytest.raises(InputError, match=message):
        trace(system, np.array(start), direction=np.array(direction))
