import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from chuteflow.numerics.legendre import lobatto


@pytest.mark.parametrize("degree", [2, 5, 16, 41])
def test_derivatives_and_integrals_of_polynomials_are_exact(degree):
    g = lobatto(degree)
    random = np.random.default_rng(degree)
    polynomial = np.polynomial.Polynomial(random.normal(size=degree + 1))
    np.testing.assert_allclose(
        g.derivative @ polynomial(g.nodes), polynomial.deriv()(g.nodes), atol=1e-12 * degree**2 * degree
    )
    steep = np.polynomial.Polynomial(random.normal(size=2 * degree))  # of degree 2 n - 1
    assert g.weights @ steep(g.nodes) == pytest.approx(steep.integ()(1.0), abs=1e-12)


@pytest.mark.parametrize("degree", [3, 24, 60])
def test_integration_by_parts_is_exact_for_any_values(degree):
    g = lobatto(degree)
    f, h = np.random.default_rng(1).normal(size=(2, degree + 1))
    parts = (g.weights * f) @ (g.derivative @ h) + (g.weights * h) @ (g.derivative @ f)
    assert parts == pytest.approx(f[-1] * h[-1] - f[0] * h[0], abs=1e-11)


def test_known_nodes_and_weights():
    # 2 s - 1 = -1, -1/sqrt(5), 1/sqrt(5), 1 and weights 1/12, 5/12, 5/12, 1/12
    g = lobatto(3)
    np.testing.assert_allclose(2.0 * g.nodes - 1.0, [-1.0, -(0.2**0.5), 0.2**0.5, 1.0], atol=1e-15)
    np.testing.assert_allclose(g.weights, np.array([1.0, 5.0, 5.0, 1.0]) / 12.0, atol=1e-15)


def test_the_quadrature_agrees_with_that_of_gauss():
    x, w = leggauss(40)
    g = lobatto(40)
    values = [np.exp(-3.0 * s) * np.cos(5.0 * s) for s in (g.nodes, 0.5 * (1.0 + x))]
    assert g.weights @ values[0] == pytest.approx(0.5 * w @ values[1], abs=1e-14)


def test_a_degree_below_two_is_refused():
    with pytest.raises(ValueError, match="at least 2"):
        lobatto(1)
