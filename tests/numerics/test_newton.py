import numpy as np

from chuteflow.numerics.newton import newton


def circle_and_line(z):
    x, y = z
    return np.array([x**2 + y**2 - 4.0, x - y]), np.array([[2.0 * x, 2.0 * y], [1.0, -1.0]])


def arctangent(z):
    return np.arctan(z), np.array([[1.0 / (1.0 + z[0] ** 2)]])


def test_converges_quadratically_to_rounding():
    result = newton(circle_and_line, np.array([3.0, 0.5]), tolerance=1e-7)
    assert result.converged
    assert result.iterations <= 6
    np.testing.assert_allclose(result.z, np.sqrt(2.0), rtol=1e-14)


def test_damping_saves_a_start_from_which_full_steps_diverge():
    assert newton(arctangent, np.array([8.0]), tolerance=1e-9).converged


def test_steps_are_cut():
    start = np.array([100.0, 100.0])
    result = newton(circle_and_line, start, tolerance=1e-9, longest_step=1.0, max_iterations=5)
    assert not result.converged
    assert np.abs(result.z - start).max() <= 5.0


def test_a_singular_system_is_reported_and_the_start_kept():
    start = np.array([1.0, 2.0])
    result = newton(lambda z: (np.ones(2), np.zeros((2, 2))), start, tolerance=1e-9)
    assert not result.converged
    np.testing.assert_array_equal(start, [1.0, 2.0])


def test_no_solution_is_reported():
    assert not newton(lambda z: (z**2 + 1.0, np.diag(2.0 * z)), np.array([0.7]), tolerance=1e-9).converged
