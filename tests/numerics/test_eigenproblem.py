"""Eigenproblems by collocation, on problems with known eigenvalues."""

import numpy as np
import pytest

from chuteflow.numerics.chebyshev import grid
from chuteflow.numerics.eigenproblem import Inverse, arnoldi, drift, refine_eigenvalue, spectrum

# Orszag 1971, J. Fluid Mech. 50: plane Poiseuille flow at Re = 10,000, alpha = 1.
ORSZAG = 0.23752649 + 0.00373967j
REYNOLDS = 1e4


def orr_sommerfeld(degree, alpha=1.0):
    """Matrix and weights for the unknowns (phi, omega = phi'' - alpha^2 phi) and the eigenvalue c."""
    g = grid(degree)
    y, d = 2.0 * g.nodes - 1.0, 0.5 * g.derivative
    n = degree + 1
    laplace = d @ d - alpha**2 * np.eye(n)
    u = 1.0 - y**2
    a = np.zeros((2 * n, 2 * n), dtype=complex)
    # U omega - U'' phi - (omega'' - alpha^2 omega)/(i alpha Re) = c omega, and omega = (d^2 - alpha^2) phi.
    a[:n, :n] = 2.0 * np.eye(n)
    a[:n, n:] = np.diag(u) - laplace / (1j * alpha * REYNOLDS)
    a[n:, :n], a[n:, n:] = laplace, -np.eye(n)
    weights = np.concatenate([np.ones(n), np.zeros(n)])
    # Rows belong to the unknown of their time derivative: omega first.
    order = np.concatenate([np.arange(n, 2 * n), np.arange(n)])
    a = a[:, order]
    for row, node in ((0, 0), (n - 1, n - 1)):
        a[row], weights[row] = 0.0, 0.0
        a[row, n:] = d[node]
        a[n + row] = 0.0
        a[n + row, n + node] = 1.0
    return a, weights


@pytest.mark.parametrize("degree", [60, 80, 110])
def test_orr_sommerfeld(degree):
    found = spectrum(*orr_sommerfeld(degree), shift=0.3 + 0.1j)
    leading = found.values[np.argmax(found.values.imag)]
    assert abs(leading - ORSZAG) < 1e-7


def test_a_mode_is_told_from_numerical_ones_by_its_drift():
    coarse = spectrum(*orr_sommerfeld(60), shift=0.3 + 0.1j).values
    fine = spectrum(*orr_sommerfeld(90), shift=0.3 + 0.1j).values
    moved = drift(coarse, fine)
    assert moved[np.argmin(np.abs(coarse - ORSZAG))] < 1e-7
    # The junction of the three branches is not resolved at this degree.
    assert np.median(moved) > 1e-4


def test_nothing_is_near_an_empty_spectrum():
    assert np.isinf(drift(np.array([1.0 + 0.0j]), np.array([], dtype=complex))).all()


def test_arnoldi_finds_the_same_as_the_full_problem():
    a, weights = orr_sommerfeld(70)
    inverse = Inverse.of(a, weights, 0.25 + 0.01j)
    start = np.random.default_rng(1).standard_normal(len(weights)) + 0j
    few = inverse.nearest(start, 3, steps=40)
    assert drift(few.values, inverse.spectrum().values).max() < 1e-9


def test_arnoldi_ends_early_in_an_invariant_space():
    matrix = np.diag([1.0, 2.0, 3.0, 4.0]) + 0j
    mu, _ = arnoldi(matrix, np.array([1.0, 1.0, 0.0, 0.0]) + 0j, 4)
    np.testing.assert_allclose(np.sort(mu.real), [1.0, 2.0], atol=1e-12)


def test_refinement_from_a_neighbour():
    near = spectrum(*orr_sommerfeld(50), shift=0.25 + 0.01j).values[0]
    a, weights = orr_sommerfeld(70)
    value, vector = refine_eigenvalue(a, weights, near)
    assert abs(value - ORSZAG) < 1e-7
    residual = a @ vector - value * weights * vector
    assert np.abs(residual).max() < 1e-8 * np.abs(a).max()
