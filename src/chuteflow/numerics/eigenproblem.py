"""Generalised eigenproblems A v = sigma B v of collocation, with a B that is singular or badly scaled.

Boundary conditions are rows of A with zero rows of B. All is done with the inverse C = (A - shift B)^-1 B,
whose eigenvalues are 1/(sigma - shift): the conditions become zeros there instead of spurious large numbers,
and the eigenvalues near the shift keep all their digits, however large the norm of A.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from chuteflow.numerics.chebyshev import Array

Complex = NDArray[np.complexfloating[Any, Any]]

#: Eigenvalues of the inverse below this fraction of its norm belong to the conditions.
_VANISHING = 1e-13


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenvalues (m,) and their vectors, the columns of (n, m)."""

    values: Complex
    vectors: Complex

    def chosen(self, which: Any) -> Spectrum:
        """Some of them, by index, slice or mask."""
        return Spectrum(self.values[which], self.vectors[:, which])


@dataclass(frozen=True, eq=False)
class Inverse:
    """C = (A - shift B)^-1 B for a diagonal B, given as ``weights`` (n,), on the unknowns that B sees."""

    shift: complex
    live: NDArray[np.bool_]
    columns: Complex

    @classmethod
    def of(cls, matrix: Complex, weights: Array, shift: complex) -> Inverse:
        """The inverse about ``shift``.

        Raises:
            numpy.linalg.LinAlgError: where the shift is an eigenvalue.
        """
        shifted = matrix.astype(complex)
        shifted[np.diag_indices_from(shifted)] -= shift * weights
        # Rows of very different size are no better or worse than others.
        size = np.abs(shifted).max(axis=1)
        live = weights != 0.0
        right = np.zeros((len(weights), int(live.sum())), dtype=complex)
        right[live, np.arange(right.shape[1])] = weights[live] / size[live]
        return cls(shift, live, np.linalg.solve(shifted / size[:, None], right))

    def spectrum(self) -> Spectrum:
        """All eigenvalues, nearest to the shift first."""
        mu, inner = np.linalg.eig(self.columns[self.live])
        size = np.abs(mu)
        kept = np.argsort(-size)[: int((size > _VANISHING * size.max()).sum())]
        return self._outer(mu[kept], inner[:, kept])

    def nearest(self, start: Complex, count: int, steps: int) -> Spectrum:
        """About ``count`` eigenvalues near the shift, by ``steps`` of Arnoldi's iteration from ``start`` (n,)."""
        mu, inner = arnoldi(self.columns[self.live], start[self.live], steps)
        kept = np.argsort(-np.abs(mu))[:count]
        return self._outer(mu[kept], inner[:, kept])

    def _outer(self, mu: Complex, inner: Complex) -> Spectrum:
        """Eigenvalues sigma = shift + 1/mu, with vectors on all unknowns."""
        vectors = self.columns @ inner
        return Spectrum(self.shift + 1.0 / mu, vectors / np.abs(vectors).max(axis=0))


def spectrum(matrix: Complex, weights: Array, shift: complex) -> Spectrum:
    """All finite eigenvalues of ``matrix`` v = sigma diag(``weights``) v, nearest to ``shift`` first."""
    return Inverse.of(matrix, weights, shift).spectrum()


def arnoldi(matrix: Complex, start: Complex, steps: int) -> tuple[Complex, Complex]:
    """Ritz values and vectors of a Krylov space of ``steps`` vectors, orthogonalised twice."""
    basis = np.zeros((len(start), steps + 1), dtype=complex)
    hessenberg = np.zeros((steps + 1, steps), dtype=complex)
    basis[:, 0] = start / np.linalg.norm(start)
    for j in range(steps):
        v = matrix @ basis[:, j]
        size = np.linalg.norm(v)
        for _ in range(2):
            overlap = basis[:, : j + 1].conj().T @ v
            v = v - basis[:, : j + 1] @ overlap
            hessenberg[: j + 1, j] += overlap
        left = np.linalg.norm(v)
        if left <= 1e-14 * size:
            steps = j + 1
            break
        hessenberg[j + 1, j] = left
        basis[:, j + 1] = v / left
    mu, small = np.linalg.eig(hessenberg[:steps, :steps])
    return mu, basis[:, :steps] @ small


@dataclass(frozen=True, eq=False)
class Eigenpair:
    """An eigenvalue with its right and left vectors (n,): A v = sigma B v and y* A = sigma y* B."""

    value: complex
    right: Complex
    left: Complex

    def size(self, weights: Array) -> complex:
        """left* B right with B = diag(``weights``): sigma changes by left* dA right over it."""
        return complex(self.left.conj() @ (weights * self.right))

    def likeness(self, other: Eigenpair, weights: Array) -> float:
        """1 for the pair itself, 0 for another one of the same problem, near 1 for the same of a problem close by."""
        own, others = (abs(self.left.conj() @ (weights * of.right)) / np.linalg.norm(of.right) for of in (self, other))
        return float(others / own)


def refine_eigenvalue(matrix: Complex, weights: Array, near: complex, steps: int = 5) -> tuple[complex, Complex]:
    """The eigenvalue closest to ``near`` and its vector, by inverse iteration with one factorisation.

    ``near`` is to be much closer to it than to all others, such as its value in another discretisation.
    """
    return _Factors.of(matrix, weights, near).iterate(steps)


def refine_eigenpair(
    matrix: Complex, weights: Array, near: complex, steps: int = 5, start: Complex | None = None
) -> Eigenpair:
    """The same with the left vector, from the same factors; ``start`` is a vector that is close to the right one."""
    factors = _Factors.of(matrix, weights, near)
    value, right = factors.iterate(steps, start)
    return Eigenpair(value, right, factors.left(right))


@dataclass(frozen=True, eq=False)
class _Factors:
    """Factors of A - shift B, its rows divided by their ``size``, for inverse iteration."""

    shift: complex
    weights: Array
    size: Array
    factors: tuple[Any, Any]

    @classmethod
    def of(cls, matrix: Complex, weights: Array, near: complex) -> _Factors:
        shifted = matrix.astype(complex)
        # Off the eigenvalue by more than rounding, so that the factors are regular.
        shift = near + 1e-9 * (1.0 + abs(near))
        shifted[np.diag_indices_from(shifted)] -= shift * weights
        size = np.abs(shifted).max(axis=1)
        return cls(shift, weights, size, lu_factor(shifted / size[:, None], check_finite=False))

    def iterate(self, steps: int, start: Complex | None = None) -> tuple[complex, Complex]:
        right = self.weights / self.size
        live = self.weights != 0.0
        vector = np.exp(1j * np.arange(len(self.weights))) if start is None else start
        mu = 0j
        for _ in range(steps):
            image = lu_solve(self.factors, right * vector, check_finite=False)
            before, mu = mu, (vector[live].conj() @ image[live]) / (vector[live].conj() @ vector[live])
            vector = image / np.abs(image).max()
            if abs(mu - before) < 1e-11 * abs(mu):
                break
        return complex(self.shift + 1.0 / mu), vector

    def left(self, right: Complex, steps: int = 4) -> Complex:
        """The left vector, by as many solutions with the conjugate transpose as its direction needs."""
        vector = right / np.linalg.norm(right)
        for _ in range(steps):
            image = lu_solve(self.factors, self.weights * vector, trans=2, check_finite=False) / self.size
            vector, before = image / np.linalg.norm(image), vector
            if abs(vector.conj() @ before) > 1.0 - 1e-12:
                break
        return vector


def drift(values: Complex, others: Complex) -> Array:
    """Distance of each of ``values`` to the nearest of ``others``: the change from one discretisation to another."""
    if not len(others):
        return np.full(len(values), np.inf)
    return np.abs(values[:, None] - others).min(axis=1)
