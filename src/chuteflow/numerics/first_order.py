"""Numbers that carry a value and a first-order coefficient: arithmetic that linearises what is computed with it.

A :class:`FirstOrder` is a field at m points, f = f0 + sum_j c_j x_j + ..., with its value f0 (m,) and its
coefficients c (m, n) for n small unknowns x_j. Sums, products and functions follow the rules of differentiation,
so that an expression written once gives its value at a state and the matrix of its linearisation there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.complex_step import derivative, stepped

Field = NDArray[Any]


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """A value (m,) and its first-order coefficients (m, n)."""

    value: Field
    slope: Field

    #: Lets arrays on the left hand over to the rules below.
    __array_ufunc__ = None

    def __neg__(self) -> FirstOrder:
        return FirstOrder(-self.value, -self.slope)

    def __add__(self, other: Number) -> FirstOrder:
        if isinstance(other, FirstOrder):
            return FirstOrder(self.value + other.value, self.slope + other.slope)
        return FirstOrder(self.value + other, self.slope)

    __radd__ = __add__

    def __sub__(self, other: Number) -> FirstOrder:
        return self + (-other)

    def __rsub__(self, other: Number) -> FirstOrder:
        return -self + other

    def __mul__(self, other: Number) -> FirstOrder:
        if isinstance(other, FirstOrder):
            slope = self.value[..., None] * other.slope + other.value[..., None] * self.slope
            return FirstOrder(self.value * other.value, slope)
        return FirstOrder(self.value * other, self.slope * np.asarray(other)[..., None])

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> FirstOrder:
        return self * (1.0 / other)

    def __rtruediv__(self, other: Number) -> FirstOrder:
        inverse = 1.0 / self.value
        return FirstOrder(inverse, (-(inverse**2))[..., None] * self.slope) * other

    def __getitem__(self, where: Any) -> FirstOrder:
        """The number at some of its points."""
        return FirstOrder(self.value[where], self.slope[where])


#: What expressions are written for: plain fields, or fields with first-order coefficients.
Number = FirstOrder | Field | float


def variables(values: Field) -> list[FirstOrder]:
    """Fields whose nodal values are all the unknowns: ``values`` (k, m) as k numbers with k m coefficients."""
    fields, points = values.shape
    identity = np.eye(fields * points)
    return [FirstOrder(values[i], identity[i * points : (i + 1) * points]) for i in range(fields)]


def apply(function: Callable[[Field], Field], number: Any) -> list[Any]:
    """An analytic ``function`` (m,) -> (k, m) of a number, as k numbers; derivatives by a complex step."""
    if not isinstance(number, FirstOrder):
        return list(function(number))
    values = function(number.value)
    slopes = derivative(function(stepped(number.value)))
    return [FirstOrder(v, s[..., None] * number.slope) for v, s in zip(values, slopes, strict=True)]


def apply_two(function: Callable[[Field, Field], Field], one: Any, other: Any) -> list[Any]:
    """An analytic ``function`` of two numbers of one kind, each (m,), as k numbers: see :func:`apply`."""
    if not isinstance(one, FirstOrder):
        return list(function(one, other))
    values = function(one.value, other.value)
    by_one = derivative(function(stepped(one.value), other.value))
    by_other = derivative(function(one.value, stepped(other.value)))
    return [
        FirstOrder(v, a[..., None] * one.slope + b[..., None] * other.slope)
        for v, a, b in zip(values, by_one, by_other, strict=True)
    ]


def exp(number: Any) -> Any:
    """The exponential."""
    if not isinstance(number, FirstOrder):
        return np.exp(number)
    value = np.exp(number.value)
    return FirstOrder(value, value[..., None] * number.slope)
