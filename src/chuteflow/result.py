"""What every result can do: draw itself, become a table, and be compared.

Tables and pictures are made in layers above those of the results, which are found by their names when they are asked
for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


class Compared:
    """A dataclass whose instances are equal where all that was computed is, to the last bit, arrays too."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self is other or _same(self._comparison_key(), other._comparison_key())  # pyright: ignore[reportAttributeAccessIssue]

    def __hash__(self) -> int:
        return hash((type(self).__name__, self._mark()))

    def _comparison_key(self) -> tuple[Any, ...]:
        """What two results are compared by."""
        return tuple(getattr(self, one.name) for one in fields(self) if one.compare)  # pyright: ignore[reportArgumentType]

    def _mark(self) -> Any:
        """What tells most results of a kind apart, for their hash."""
        return None


class Result(Compared):
    """A result that draws itself, :meth:`plot`, and becomes a table, :meth:`to_dataframe` or :meth:`to_xarray`."""

    def plot(self, *, scales: Any = None, **options: Any) -> Any:
        """Draw the result, in SI units where ``scales`` (:class:`chuteflow.Scales`) are given.

        Args:
            scales: the grains.
            options: ``theme``, "print" (the default) or "slides", and those of its picture.

        Returns matplotlib's axes: one, or an array of them where the picture has several panels. Their figure is
        ``axes.figure``, of which a notebook shows a copy.

        Raises:
            InputError: for a kind of result that has no picture.
        """
        return from_above("plotting.axes", "plot")(self, scales=scales, **options)

    def to_dataframe(self, *, scales: Any = None) -> DataFrame:
        """The result as a table of pandas, with names of the registry and words for kinds; in SI units where
        ``scales`` are given.

        Raises:
            InputError: without pandas.
        """
        return from_above("io.datasets", "dataset")(self, scales).to_dataframe()

    def to_xarray(self, *, scales: Any = None) -> Dataset:
        """The result as a Dataset of xarray with units, descriptions and flags as attributes, as files have them; in
        SI units where ``scales`` are given.

        Raises:
            InputError: without xarray.
        """
        return from_above("io.datasets", "dataset")(self, scales).to_xarray()


def from_above(module: str, name: str) -> Any:
    """A function of a layer above that of the results."""
    return getattr(import_module(f"chuteflow.{module}"), name)


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        a, b = np.asarray(a), np.asarray(b)
        return a.shape == b.shape and np.array_equal(a, b, equal_nan=a.dtype.kind in "fc" and b.dtype.kind in "fc")
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(_same, a, b))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return list(a) == list(b) and all(_same(a[key], b[key]) for key in a)
    return bool(a == b) or (isinstance(a, float) and isinstance(b, float) and a != a and b != b)
