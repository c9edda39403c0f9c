"""Chebyshev grids on [0, 1]: nodes, differentiation, quadrature, coefficients, interpolation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Intervals that halve towards a singular end.
_HALVED = 120


@dataclass(frozen=True)
class Grid:
    """Chebyshev extrema on [0, 1], ascending.

    ``nodes`` (n+1,); ``derivative`` (n+1, n+1), the exact derivative of the interpolant; ``integral``
    (n+1, n+1), its exact integral from 0;
    ``weights`` (n+1,) of Clenshaw-Curtis quadrature; ``to_coefficients`` (n+1, n+1), values to Chebyshev
    coefficients in 2 s - 1; ``barycentric`` (n+1,) weights.
    """

    nodes: Array
    derivative: Array
    integral: Array
    weights: Array
    to_coefficients: Array
    barycentric: Array

    @property
    def degree(self) -> int:
        """Degree n of the interpolant."""
        return len(self.nodes) - 1

    def differentiate(self, values: Array) -> Array:
        """Derivatives at the nodes of the interpolants of ``values`` (..., n+1)."""
        return values @ self.derivative.T

    def integrate(self, values: Array) -> Array:
        """Integrals from 0 to the nodes of the interpolants of ``values`` (..., n+1)."""
        return values @ self.integral.T

    def interpolate(self, values: Array, points: Array) -> Array:
        """The interpolants of ``values`` (..., n+1) at ``points`` (m,), (..., m)."""
        return values @ interpolation_matrix(self, points).T


@dataclass(frozen=True)
class PiecewiseGrid:
    """The grid of one degree d on each of the pieces between ``breaks`` (N+1,), from 0 to 1; pieces share their ends.

    ``nodes`` (N d + 1,) and ``weights`` as in :class:`Grid`, of the piecewise polynomial. At a break the derivative is
    that of the piece to the left. The methods take a time that rises with the number of nodes, the matrices with its
    square.
    """

    breaks: Array
    piece: Grid
    nodes: Array
    weights: Array

    @property
    def degree(self) -> int:
        """Number of nodes less one."""
        return len(self.nodes) - 1

    @cached_property
    def derivative(self) -> Array:
        """Matrix (N d + 1, N d + 1) of :meth:`differentiate`."""
        return _of_method(self.differentiate, len(self.nodes))

    @cached_property
    def integral(self) -> Array:
        """Matrix (N d + 1, N d + 1) of :meth:`integrate`."""
        matrix, whole_pieces = np.zeros((len(self.nodes),) * 2), np.zeros(len(self.nodes))
        for columns, block in zip(self.columns, self._widths[..., None] * self.piece.integral, strict=True):
            rows = columns[1:]
            matrix[rows] = whole_pieces
            matrix[np.ix_(rows, columns)] += block[1:]
            whole_pieces[columns] += block[-1]
        matrix.setflags(write=False)
        return matrix

    def differentiate(self, values: Array) -> Array:
        """Derivatives at the nodes of the piecewise polynomials through ``values`` (..., N d + 1)."""
        return self._join(self.piece.differentiate(values[..., self.columns]) / self._widths)

    def integrate(self, values: Array) -> Array:
        """Integrals from 0 to the nodes of the piecewise polynomials through ``values`` (..., N d + 1)."""
        parts = self.piece.integrate(values[..., self.columns]) * self._widths
        parts[..., 1:, :] += np.cumsum(parts[..., :-1, -1:], axis=-2)
        return self._join(parts)

    def interpolate(self, values: Array, points: Array) -> Array:
        """The piecewise polynomials through ``values`` (..., N d + 1) at ``points`` (m,), (..., m)."""
        piece, matrix = self.places(points)
        return np.einsum("...md,md->...m", values[..., self.columns[piece]], matrix)

    def places(self, points: Array) -> tuple[NDArray[np.intp], Array]:
        """The piece (m,) in which each of ``points`` (m,) lies, and the matrix (m, d+1) of interpolation there."""
        piece = np.clip(np.searchsorted(self.breaks, points, side="left") - 1, 0, len(self.breaks) - 2)
        local = (points - self.breaks[piece]) / np.diff(self.breaks)[piece]
        return piece, interpolation_matrix(self.piece, local)

    @cached_property
    def columns(self) -> NDArray[np.intp]:
        """The nodes of each piece, (N, d+1)."""
        return np.arange(len(self.breaks) - 1)[:, None] * self.piece.degree + np.arange(self.piece.degree + 1)

    @property
    def _widths(self) -> Array:
        return np.diff(self.breaks)[:, None]

    @staticmethod
    def _join(parts: Array) -> Array:
        """Values (..., N, d+1) on the pieces as values at the nodes: at a break those of the piece to the left."""
        rest = parts[..., 1:].reshape(*parts.shape[:-2], -1)
        return np.concatenate([parts[..., 0, :1], rest], axis=-1)


@dataclass(frozen=True)
class SplitGrid:
    """Grids of several degrees, the ``pieces`` between ``breaks`` (N+1,), from 0 to 1: functions may jump at a break,
    where the two pieces have a node each.

    ``nodes`` (n,), ``derivative`` (n, n) and ``weights`` (n,) as in :class:`Grid`, of the polynomials on the pieces.
    """

    breaks: Array
    pieces: tuple[Grid, ...]
    nodes: Array
    derivative: Array
    weights: Array

    @cached_property
    def firsts(self) -> NDArray[np.intp]:
        """The first node of each piece, (N,)."""
        return np.cumsum([0, *(len(piece.nodes) for piece in self.pieces[:-1])])

    @property
    def nodes_of_pieces(self) -> list[slice]:
        """The nodes of each piece."""
        return [
            slice(int(first), int(first) + len(piece.nodes))
            for first, piece in zip(self.firsts, self.pieces, strict=True)
        ]

    def interpolation(self, points: Array) -> Array:
        """Matrix (m, n) that takes values at the nodes to values at ``points`` (m,) in [0, 1]."""
        matrix = np.zeros((len(points), len(self.nodes)))
        index = np.clip(np.searchsorted(self.breaks, points, side="left") - 1, 0, len(self.pieces) - 1)
        for i, (piece, at) in enumerate(zip(self.pieces, self.nodes_of_pieces, strict=True)):
            here = np.flatnonzero(index == i)
            local = (points[here] - self.breaks[i]) / (self.breaks[i + 1] - self.breaks[i])
            matrix[here, at] = interpolation_matrix(piece, local)
        return matrix


def split_grid(breaks: Array, degrees: tuple[int, ...]) -> SplitGrid:
    """The grids of ``degrees`` (N,) on the pieces between ``breaks`` (N+1,), which rise from 0 to 1."""
    pieces = tuple(grid(degree) for degree in degrees)
    widths = np.diff(breaks)
    nodes = [low + width * piece.nodes for piece, low, width in zip(pieces, breaks, widths, strict=False)]
    derivative = np.zeros((sum(map(len, nodes)),) * 2)
    weights = np.concatenate([width * piece.weights for piece, width in zip(pieces, widths, strict=True)])
    found = SplitGrid(breaks, pieces, np.concatenate(nodes), derivative, weights)
    for piece, at, width in zip(pieces, found.nodes_of_pieces, widths, strict=True):
        derivative[at, at] = piece.derivative / width
    return found


AnyGrid = Grid | PiecewiseGrid


@lru_cache(maxsize=8)
def piecewise_grid(breaks: tuple[float, ...], degree: int) -> PiecewiseGrid:
    """The grid of ``degree`` on each piece between ``breaks``, which rise from 0 to 1."""
    piece = grid(degree)
    b = np.array(breaks)
    size = (len(b) - 1) * degree + 1
    nodes, weights = np.empty(size), np.zeros(size)
    for e in range(len(b) - 1):
        here = slice(e * degree, (e + 1) * degree + 1)
        width = b[e + 1] - b[e]
        nodes[here] = b[e] + width * piece.nodes
        nodes[here.stop - 1] = b[e + 1]
        weights[here] += width * piece.weights
    for array in (b, nodes, weights):
        array.setflags(write=False)
    return PiecewiseGrid(b, piece, nodes, weights)


def _of_method(method: Callable[[Array], Array], size: int) -> Array:
    """The matrix of a linear ``method`` on (..., ``size``)."""
    matrix = np.ascontiguousarray(method(np.eye(size)).T)
    matrix.setflags(write=False)
    return matrix


@lru_cache(maxsize=64)
def grid(degree: int) -> Grid:
    """The grid of ``degree`` + 1 Chebyshev extrema on [0, 1] (Trefethen 2000, Spectral Methods in MATLAB).

    Raises:
        ValueError: for a degree below 2.
    """
    if degree < 2:
        raise ValueError(f"degree {degree}: at least 2 is needed")
    n = degree
    j = np.arange(n + 1)
    # sin^2 keeps the spacing at s = 0 exact to the last digit, where cold flows have their thin layer.
    nodes = np.sin(0.5 * np.pi * j / n) ** 2
    sign = np.where(j % 2 == 0, 1.0, -1.0)
    barycentric = sign.copy()
    barycentric[[0, -1]] *= 0.5
    angle = np.pi * j / n
    # s_i - s_k = sin((a_i + a_k)/2) sin((a_i - a_k)/2): no cancellation.
    gap = np.sin(0.5 * (angle[:, None] + angle)) * np.sin(0.5 * (angle[:, None] - angle))
    np.fill_diagonal(gap, 1.0)
    derivative = barycentric / barycentric[:, None] / gap
    np.fill_diagonal(derivative, 0.0)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    # x_j = 2 s_j - 1 = -cos(angle_j)
    basis = np.cos(np.outer(j, np.pi - angle))
    halves = np.ones(n + 1)
    halves[[0, -1]] = 0.5
    to_coefficients = 2.0 / n * halves[:, None] * basis * halves
    integral = _integrals_of_basis(angle) @ to_coefficients
    integral[0] = 0.0
    weights = integral[-1].copy()
    for array in (nodes, derivative, integral, weights, to_coefficients, barycentric):
        array.setflags(write=False)
    return Grid(nodes, derivative, integral, weights, to_coefficients, barycentric)


def _integrals_of_basis(angle: Array) -> Array:
    """Integrals of T_k(2 s - 1) from 0 to the nodes, column k; T_k = cos(k acos x), x = -cos(angle)."""
    n = len(angle) - 1
    k = np.arange(n + 1)
    t = np.cos(np.outer(np.pi - angle, np.arange(n + 2)))  # T_0 ... T_{n+1} at the nodes
    end = (-1.0) ** np.arange(n + 2)
    out = np.empty((n + 1, n + 1))
    out[:, 0] = 0.5 * (t[:, 1] - end[1])
    out[:, 1] = 0.125 * (t[:, 2] - end[2])
    up, down = k[2:] + 1, k[2:] - 1
    out[:, 2:] = 0.25 * ((t[:, up] - end[up]) / up - (t[:, down] - end[down]) / down)
    return out


def interpolation_matrix(g: AnyGrid, points: Array) -> Array:
    """Matrix (m, n+1) that takes values at the nodes to values at ``points`` (m,) in [0, 1]."""
    if isinstance(g, PiecewiseGrid):
        piece, local = g.places(points)
        matrix = np.zeros((len(points), len(g.nodes)))
        np.put_along_axis(matrix, g.columns[piece], local, axis=1)
        return matrix
    gap = points[:, None] - g.nodes
    hit = gap == 0.0
    gap[hit] = 1.0
    matrix = g.barycentric / gap
    rows = hit.any(axis=1)
    matrix[rows] = hit[rows]
    return cast(Array, matrix / matrix.sum(axis=1, keepdims=True))


@lru_cache(maxsize=64)
def singular_weights(degree: int, beta: complex) -> Array:
    """Weights (n+1,), for values f at the nodes of :func:`grid`, of the integral of f over [0, 1], where f is a
    polynomial times s^(-beta), 0 <= beta < 1: exact for the polynomial through s^beta f; a complex ``beta``
    differentiates them."""
    g = grid(degree)
    nodes, weights = np.polynomial.legendre.leggauss(degree + 1)
    # The polynomial times s^(-beta) on intervals that halve towards 0, and on what is left a constant times it.
    ends = 0.5 ** np.arange(_HALVED + 1.0)
    points = ends[1:, None] + 0.25 * ends[:-1, None] * (nodes + 1.0)
    measure = 0.25 * ends[:-1, None] * weights * points**-beta
    product = measure.ravel() @ interpolation_matrix(g, points.ravel())
    product[0] += ends[-1] ** (1.0 - beta) / (1.0 - beta)
    out = product * g.nodes**beta
    # f is infinite at 0, s^beta f is not: its limit is that of the polynomial through the other nodes.
    out[1:] += product[0] * _at_zero(g) * g.nodes[1:] ** beta
    out[0] = 0.0
    out.setflags(write=False)
    return cast(Array, out)


def _at_zero(g: Grid) -> Array:
    """What the polynomial through the values at all nodes but the first has at 0, (n,)."""
    return -g.barycentric[1:] / g.barycentric[0]


@lru_cache(maxsize=256)
def refinement(coarse: int, fine: int) -> Array:
    """Matrix (fine+1, coarse+1) from the grid of degree ``coarse`` to that of degree ``fine``."""
    matrix = interpolation_matrix(grid(coarse), grid(fine).nodes)
    matrix.setflags(write=False)
    return matrix


def tail(g: AnyGrid, values: Array) -> float:
    """Relative size of the last coefficients of ``values`` (..., n+1): how far the series has decayed."""
    if isinstance(g, PiecewiseGrid):
        return tail(g.piece, values[..., g.columns])
    coefficients = np.abs(values @ g.to_coefficients.T)
    last = max(2, g.degree // 8)
    return float(coefficients[..., -last:].max() / (coefficients.max() + 1e-300))
