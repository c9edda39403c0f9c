import numpy as np
import pytest

from chuteflow.numerics.chebyshev import grid, interpolation_matrix, piecewise_grid, refinement, tail


@pytest.mark.parametrize("degree", [2, 5, 16, 37])
def test_polynomials_up_to_the_degree_are_exact(degree):
    g = grid(degree)
    polynomial = np.polynomial.Polynomial(np.random.default_rng(degree).normal(size=degree + 1))
    values = polynomial(g.nodes)
    size = np.abs(values).max() * degree**2
    np.testing.assert_allclose(g.derivative @ values, polynomial.deriv()(g.nodes), atol=1e-13 * size)
    np.testing.assert_allclose(g.integral @ values, polynomial.integ()(g.nodes), atol=1e-15 * size)
    np.testing.assert_allclose(g.weights @ values, polynomial.integ()(1.0), atol=1e-15 * size)
    points = np.array([0.0, 0.123, g.nodes[1], 0.987, 1.0])
    np.testing.assert_allclose(interpolation_matrix(g, points) @ values, polynomial(points), atol=1e-14 * size)


def test_a_smooth_function_converges_exponentially():
    errors = []
    for degree in (8, 16, 32):
        g = grid(degree)
        errors.append(np.abs(g.derivative @ np.exp(-3.0 * g.nodes) + 3.0 * np.exp(-3.0 * g.nodes)).max())
    assert errors[1] < 1e-6 * errors[0]
    assert errors[2] < 1e-11


def test_the_smallest_spacing_keeps_its_digits():
    n = 200
    assert grid(n).nodes[1] == pytest.approx(np.sin(np.pi / (2 * n)) ** 2, rel=1e-15)


def test_refinement_and_tail():
    coarse, fine = grid(16), grid(24)
    values = 1.0 / (1.2 + coarse.nodes)
    np.testing.assert_allclose(refinement(16, 24) @ values, 1.0 / (1.2 + fine.nodes), atol=1e-11)
    assert tail(coarse, values) < 1e-9
    assert tail(coarse, np.abs(coarse.nodes - 0.4)) > 1e-4


def test_a_degree_below_two_is_refused():
    with pytest.raises(ValueError, match="at least 2"):
        grid(1)


def test_a_grid_in_pieces_is_exact_for_a_function_with_a_kink():
    g = piecewise_grid((0.0, 0.25, 0.7, 1.0), 6)
    rise, fall = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0]), np.polynomial.Polynomial([0.3, 1.0, 0.0, 0.0, -2.0])
    fall = fall - fall(0.7) + rise(0.7)

    def joined(left, right, s):
        return np.where(s <= 0.7, left(s), right(s))

    values = np.stack([joined(rise, fall, g.nodes), g.nodes])
    whole = rise.integ(), fall.integ() - fall.integ()(0.7) + rise.integ()(0.7)
    points = np.array([0.0, 0.1, 0.25, 0.69, 0.7, 0.71, 1.0])
    np.testing.assert_allclose(g.interpolate(values, points), [joined(rise, fall, points), points], atol=1e-14)
    np.testing.assert_allclose(g.integrate(values), [joined(*whole, g.nodes), 0.5 * g.nodes**2], atol=1e-14)
    np.testing.assert_allclose(
        g.differentiate(values), [joined(rise.deriv(), fall.deriv(), g.nodes), np.ones(g.degree + 1)], atol=1e-12
    )
    np.testing.assert_allclose(g.weights @ values[0], whole[1](1.0), atol=1e-14)
    for matrix, method in ((g.integral, g.integrate), (g.derivative, g.differentiate)):
        np.testing.assert_allclose(values @ matrix.T, method(values), atol=1e-12)
    np.testing.assert_allclose(values @ interpolation_matrix(g, points).T, g.interpolate(values, points), atol=1e-14)
