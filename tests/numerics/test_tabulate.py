import numpy as np

from chuteflow.numerics.tabulate import antiderivative, piece_nodes


def tabulated(pieces, degree):
    nodes = piece_nodes(0.0, 5.0, pieces, degree)
    return nodes.table(both(nodes.x))


def both(x):
    return np.stack([np.sin(x), 1.0 / (1.0 + x**2)], axis=-1)


def test_values_and_derivatives():
    table = tabulated(60, 8)
    x = np.random.default_rng(1).uniform(0.0, 5.0, (7, 31))
    (sine, bell), (cosine, slope) = table(x)
    np.testing.assert_allclose(sine, np.sin(x), atol=1e-14)
    np.testing.assert_allclose(bell, 1.0 / (1.0 + x**2), atol=1e-13)
    np.testing.assert_allclose(cosine, np.cos(x), atol=1e-12)
    np.testing.assert_allclose(slope, -2.0 * x / (1.0 + x**2) ** 2, atol=1e-11)


def test_the_error_seen_is_not_below_the_true_one_by_much():
    table = tabulated(4, 5)
    x = np.linspace(0.0, 5.0, 5001)
    values, _ = table(x)
    true = np.abs(values - both(x).T).max(axis=1)
    assert (table.error > 0.2 * true).all()


def test_constant_beyond_the_ends():
    table = tabulated(60, 8)
    values, _ = table(np.array([-3.0, 9.0]))
    np.testing.assert_allclose(values, both(np.array([0.0, 5.0])).T, atol=1e-14)


def test_antiderivative():
    table = antiderivative(tabulated(60, 8))
    x = np.linspace(0.0, 5.0, 301)
    (area, angle), (sine, _) = table(x)
    np.testing.assert_allclose(area, 1.0 - np.cos(x), atol=1e-13)
    np.testing.assert_allclose(angle, np.arctan(x), atol=1e-13)
    np.testing.assert_allclose(sine, np.sin(x), atol=1e-12)
