"""Functions of one variable, smooth but for known breaks, as piecewise polynomials that are cheap to evaluate with
derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from chuteflow.numerics.compiled import compiled, compiled_in_place

Array = NDArray[np.float64]


#: So many successive positions on one piece are evaluated together.
_TOGETHER = 4


@compiled_in_place
def find_piece(edges: Any, pieces: int, position: float) -> tuple[int, float]:
    """The piece of a ``position`` counted in equal pieces, and the place on it from -1 to 1."""
    i = min(int(position), pieces - 1)
    if len(edges) == 0:
        return i, 2.0 * (position - i) - 1.0
    while position < edges[i]:
        i -= 1
    while i + 1 < pieces and position >= edges[i + 1]:
        i += 1
    return i, 2.0 * (position - edges[i]) / (edges[i + 1] - edges[i]) - 1.0


@compiled
def _evaluate_all(coefficients: Any, edges: Any, positions: Any, used: int) -> Any:
    """The first ``used`` functions of a table at ``positions`` (n,) counted in equal pieces, as rows (used, n)."""
    out = np.empty((used, len(positions)))
    if len(positions) > 0:
        _fill(coefficients, edges, positions, np.empty(len(positions)), out)
    return out


@compiled_in_place
def _fill(coefficients: Any, edges: Any, positions: Any, place: Any, out: Any) -> None:
    """The same into ``out`` (used, n); ``place`` (n,) is space."""
    degree, pieces, _ = coefficients.shape
    used, n = out.shape
    begin = 0
    i, place[0] = find_piece(edges, pieces, positions[0])
    while begin < n:
        end, there = begin + 1, i
        while end < n:
            there, place[end] = find_piece(edges, pieces, positions[end])
            if there != i:
                break
            end += 1
        for q in range(used):
            row, t = out[q, begin:end], place[begin:end]
            if end - begin < _TOGETHER:
                for k in range(end - begin):
                    value = coefficients[degree - 1, i, q]
                    for d in range(degree - 2, -1, -1):
                        value = value * t[k] + coefficients[d, i, q]
                    row[k] = value
            else:
                row[:] = coefficients[degree - 1, i, q]
                for d in range(degree - 2, -1, -1):
                    c = coefficients[d, i, q]
                    for k in range(end - begin):
                        row[k] = row[k] * t[k] + c
        begin, i = end, there


@dataclass(frozen=True, eq=False)
class FunctionTable:
    """m functions on [lower, upper], constant outside.

    ``coefficients`` (degree+1, pieces, 2 m) holds functions and derivatives as powers of t, which runs from
    -1 to 1 on each piece. ``error`` (m,) is the largest deviation seen between the nodes. The pieces are equal
    but for those that meet at ``breaks``, where the functions need not be smooth.
    """

    lower: float
    upper: float
    coefficients: Array
    error: Array
    breaks: tuple[float, ...] = ()

    @cached_property
    def edges(self) -> Array:
        """Ends of the pieces (pieces+1,) in units of equal ones; empty where all are equal."""
        return edges_at(self.breaks, self.lower, self.upper, self.coefficients.shape[1])

    @property
    def compiled(self) -> tuple[Array, Array]:
        """What compiled loops evaluate it from: ``coefficients`` and ``edges``."""
        return self.coefficients, self.edges

    def __call__(self, x: Array, side: Array | None = None) -> tuple[Array, Array]:
        """Values and derivatives, each (m,) + x.shape; a complex ``x`` belongs to the piece of its real part, or to
        that of ``side`` where that is given: at a break there are two."""
        degree, pieces, twice = self.coefficients.shape
        scale = pieces / (self.upper - self.lower)
        position = self._position(x)
        if side is None and not np.iscomplexobj(position) and not np.iscomplexobj(self.coefficients):
            flat = _evaluate_all(self.coefficients, self.edges, np.ravel(position), twice)
            both = flat.reshape(2, twice // 2, *np.shape(position))
            return both[0], both[1]
        index = np.minimum(position.real.astype(np.intp), pieces - 1)
        if self.edges.size:
            told = position.real if side is None else (np.clip(side, self.lower, self.upper) - self.lower) * scale
            index = np.minimum(np.searchsorted(self.edges[1:], told, side="right"), pieces - 1)
            low, high = self.edges[index], self.edges[index + 1]
            t = (2.0 * (position - low) / (high - low) - 1.0)[..., None]
        else:
            t = (2.0 * (position - index) - 1.0)[..., None]
        picked = self.coefficients.take(index, axis=1)
        value = picked[-1]
        for k in range(degree - 2, -1, -1):
            value = value * t
            value += picked[k]
        value = np.moveaxis(value, -1, 0)
        m = len(value) // 2
        return value[:m], value[m:]

    def values(self, x: Array) -> Array:
        """The values alone, (m,) + x.shape."""
        if np.iscomplexobj(x) or np.iscomplexobj(self.coefficients):
            return self(x)[0]
        position = self._position(x)
        m = self.coefficients.shape[2] // 2
        return _evaluate_all(self.coefficients, self.edges, np.ravel(position), m).reshape(m, *np.shape(position))

    def _position(self, x: Array) -> Array:
        """x counted in equal pieces."""
        # fmax and fmin turn a NaN into an end, so that the index exists; whoever made the NaN still has it.
        inside = np.fmin(np.fmax(x, self.lower), self.upper)
        return (inside - self.lower) * (self.coefficients.shape[1] / (self.upper - self.lower))


def edges_at(breaks: Sequence[float], lower: float, upper: float, pieces: int) -> Array:
    """Ends of ``pieces`` on [lower, upper] in units of equal ones, the nearest moved to each of the ascending
    ``breaks``; empty where there are none."""
    if not len(breaks):
        return np.empty(0)
    edges = np.arange(pieces + 1.0)
    last = 0
    for place in breaks:
        position = (place - lower) * pieces / (upper - lower)
        last = max(round(position), last + 1)
        edges[last] = position
    return edges


@dataclass(frozen=True, eq=False)
class PieceNodes:
    """Where functions are evaluated to be tabulated: ``x`` (k,), the Chebyshev points of the pieces and, last, those
    where the interpolants are checked."""

    lower: float
    upper: float
    pieces: int
    degree: int
    breaks: tuple[float, ...]
    x: Array
    width: Any

    def table(self, values: Array) -> FunctionTable:
        """The table of the functions with ``values`` (k, m) at the points."""
        n = self.degree + 1
        values = values.reshape(n + len(_CHECKS), self.pieces, -1)
        _, fit = _chebyshev_fit(self.degree)
        coefficients = _combine(fit, values[:n])
        check = _combine(_CHECKS[:, None] ** np.arange(float(n)), coefficients)
        error = np.abs(check - values[n:]).max(axis=(0, 1))
        return FunctionTable(self.lower, self.upper, _with_slopes(coefficients, self.width), error, self.breaks)


#: Where on a piece, from -1 to 1, an interpolant is checked.
_CHECKS = np.array([-0.97, 0.31])


@lru_cache(maxsize=8)
def piece_nodes(lower: float, upper: float, pieces: int, degree: int, breaks: tuple[float, ...] = ()) -> PieceNodes:
    """The points for interpolants of ``degree`` on each piece; the functions may have kinks or jumps at the ascending
    ``breaks``, where pieces meet."""
    points, _ = _chebyshev_fit(degree)
    edges = edges_at(breaks, lower, upper, pieces)
    width: Any = (upper - lower) / pieces
    middles = lower + width * (np.arange(pieces) + 0.5)
    if edges.size:
        middles = lower + width * 0.5 * (edges[1:] + edges[:-1])
        width = width * np.diff(edges)
    local = np.concatenate([points, _CHECKS])
    x = (middles + 0.5 * width * local[:, None]).ravel()
    x.setflags(write=False)
    return PieceNodes(lower, upper, pieces, degree, breaks, x, width)


def _combine(weights: Array, values: Array) -> Array:
    """Weighted sums over the first axis of ``values`` (j, ...), for ``weights`` (k, j)."""
    return (weights @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])


@lru_cache(maxsize=8)
def _chebyshev_fit(degree: int) -> tuple[Array, Array]:
    """Chebyshev points on [-1, 1] (degree+1,), and the powers of the interpolant for values there, a matrix."""
    points = np.sin(np.pi * np.arange(-degree, degree + 1, 2) / (2 * (degree + 1)))
    to_powers = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        powers = chebyshev.cheb2poly(np.eye(degree + 1)[k])
        to_powers[: len(powers), k] = powers
    return points, to_powers @ np.linalg.inv(chebyshev.chebvander(points, degree))


def antiderivative(table: FunctionTable) -> FunctionTable:
    """The integrals of the functions of ``table`` from its lower end."""
    degree, pieces, twice = table.coefficients.shape
    half: Any = 0.5 * (table.upper - table.lower) / pieces
    if table.edges.size:
        half = half * np.diff(table.edges)
    powers = table.coefficients[:, :, : twice // 2]
    coefficients = np.zeros((degree + 1, pieces, twice // 2), dtype=powers.dtype)
    coefficients[1:] = powers * (np.reshape(half, (-1,)) / np.arange(1, degree + 1)[:, None])[:, :, None]
    start = (coefficients * (-1.0) ** np.arange(degree + 1)[:, None, None]).sum(axis=0)
    gained = coefficients.sum(axis=0) - start
    coefficients[0] = np.cumsum(gained, axis=0) - gained - start
    return FunctionTable(table.lower, table.upper, _with_slopes(coefficients, 2.0 * half), table.error, table.breaks)


def _with_slopes(coefficients: Array, width: Any) -> Array:
    """Coefficients of functions and of their derivatives, for pieces of one ``width`` or of each its own (pieces,)."""
    degree, pieces, m = coefficients.shape
    out = np.zeros((degree, pieces, 2 * m), dtype=coefficients.dtype)
    orders = np.arange(1, degree)
    out[:, :, :m] = coefficients
    out[:-1, :, m:] = coefficients[1:] * (orders[:, None] * 2.0 / np.reshape(width, (1, -1)))[:, :, None]
    return out
