"""Named arrays with units, descriptions and flags: what files, xarray and pandas are given of a result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.extras import require

if TYPE_CHECKING:
    import h5netcdf
    import pandas
    import xarray


@dataclass(frozen=True, eq=False)
class Variable:
    """An array with the names of its dimensions and its attributes, those of the CF conventions."""

    dimensions: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def words(self) -> NDArray[Any]:
        """The values; for flags, what they mean, with " and " between those of masks."""
        attributes = self.attributes
        if "flag_meanings" not in attributes:
            return self.values
        meanings = attributes["flag_meanings"].split()
        if "flag_masks" in attributes:
            masks = [*zip(np.asarray(attributes["flag_masks"]).tolist(), meanings, strict=True)]

            def said(value: int) -> str:
                return " and ".join(meaning for mask, meaning in masks if value & mask)
        else:
            by_value = dict(zip(np.asarray(attributes["flag_values"]).tolist(), meanings, strict=True))

            def said(value: int) -> str:
                return by_value[value]

        words = [said(value) for value in self.values.ravel().tolist()]
        return np.array(words, dtype=object).reshape(self.values.shape)


@dataclass(frozen=True, eq=False)
class Dataset:
    """Variables by name, and the attributes of them all.

    ``index`` are the variables by which one finds a value, such as those along the axes of a map.
    """

    variables: Mapping[str, Variable]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    index: tuple[str, ...] = ()

    @property
    def sizes(self) -> dict[str, int]:
        """The dimensions in the order in which variables have them."""
        found: dict[str, int] = {}
        for one in self.variables.values():
            found |= dict(zip(one.dimensions, one.values.shape, strict=True))
        return found

    def to_xarray(self) -> xarray.Dataset:
        """The same of xarray.

        Raises:
            InputError: where xarray is not installed.
        """
        xr = require("xarray", "tables", "to_xarray")
        variables = {name: (one.dimensions, one.values, dict(one.attributes)) for name, one in self.variables.items()}
        coordinates = {name: variables.pop(name) for name in self.index}
        return xr.Dataset(variables, coordinates, dict(self.attributes))

    def to_dataframe(self) -> pandas.DataFrame:
        """A table with one row for each point of all dimensions, and ``index`` as its index; flags as words.

        Raises:
            InputError: where pandas is not installed.
        """
        pd = require("pandas", "tables", "to_dataframe")
        columns = self.columns()
        table = pd.DataFrame(columns)
        return table.set_index([name for name in self.index if name in columns]) if self.index else table

    def columns(self, order: Sequence[str] = ()) -> dict[str, NDArray[Any]]:
        """Every variable as a column with one row for each point of all dimensions, the last of ``order``, by default
        of :attr:`sizes`, changing fastest; flags as words."""
        sizes = {name: self.sizes[name] for name in order or self.sizes}
        return {name: _spread(one.words, one.dimensions, sizes) for name, one in self.variables.items()}

    def rows(self, headings: Mapping[str, str], order: Sequence[str] = ()) -> Iterator[Sequence[Any]]:
        """Headings and rows of a table of the variables by the ``headings`` of their columns, see :meth:`columns`."""
        yield list(headings)
        columns = self.columns(order)
        yield from zip(*(columns[name].tolist() for name in headings.values()), strict=True)

    def lists(self, name: str) -> Any:
        """The values of a variable as nested lists, None for those that are not finite, which JSON cannot hold."""
        values = self.variables[name].values
        found = values.astype(object)
        found[~np.isfinite(values)] = None
        return found.tolist()

    def write(self, group: h5netcdf.Group, inherited: Sequence[str] = ()) -> None:
        """Write all into a group of a NetCDF file, which has the dimensions ``inherited`` from that which it is in."""
        group.dimensions = {name: size for name, size in self.sizes.items() if name not in inherited}
        group.attrs.update(self.attributes)
        for name, one in self.variables.items():
            variable = group.create_variable(name, one.dimensions, one.values.dtype, data=one.values)
            variable.attrs.update(one.attributes)


def variable(dimensions: tuple[str, ...], values: Any, long_name: str, unit: str = "1") -> Variable:
    """A variable that has a description and a unit."""
    return Variable(dimensions, np.asarray(values), {"long_name": long_name, "units": unit})


def flags(
    dimensions: tuple[str, ...], values: Sequence[str], meanings: Sequence[str], long_name: str, comment: str = ""
) -> Variable:
    """Words ``values`` along one dimension as numbers, with what these mean beside them."""
    attributes = {
        "long_name": long_name,
        "flag_values": np.arange(len(meanings), dtype="i1"),
        "flag_meanings": " ".join(meanings),
        **({"comment": comment} if comment else {}),
    }
    return Variable(dimensions, np.array([meanings.index(value) for value in values], dtype="i1"), attributes)


def _spread(values: NDArray[Any], dimensions: tuple[str, ...], sizes: Mapping[str, int]) -> NDArray[Any]:
    """Values along some dimensions, at each point of all."""
    order = [name for name in sizes if name in dimensions]
    values = values.transpose([dimensions.index(name) for name in order])
    shape = [sizes[name] if name in dimensions else 1 for name in sizes]
    return np.broadcast_to(values.reshape(shape), tuple(sizes.values())).ravel()
