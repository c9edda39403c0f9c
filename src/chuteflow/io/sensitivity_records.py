"""Sensitivities as JSON objects and as rows of CSV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from chuteflow.io import contract
from chuteflow.steady.quantities import NUMBERS

if TYPE_CHECKING:
    from chuteflow.numerics.chebyshev import Array
    from chuteflow.steady.sensitivity import Sensitivity


def sensitivity_object(found: Sensitivity, heights: Array | None = None) -> dict[str, Any]:
    """One flow with its derivatives; profiles at ``heights`` where there are any."""
    along, across = found.numbers_along
    answer: dict[str, Any] = {
        "flow": contract.flow_object(found.flow),
        "parameters": dict(zip(found.keys, found.values.tolist(), strict=True)),
        "fixed": found.at,
        "fold": found.at_fold,
        "derivatives": {NUMBERS[name].symbol: _by_key(found, values) for name, values in found.numbers.items()},
        "logarithmic": {NUMBERS[name].symbol: _by_key(found, values) for name, values in found.logarithmic.items()},
        "along_branch": {NUMBERS[name].symbol: contract.finite(value) for name, value in along.items()},
        "across_branch": {NUMBERS[name].symbol: _by_key(found, values) for name, values in across.items()},
        "paths": {
            key: {name.removeprefix("ln "): value for name, value in found.path(key).items()} for key in found.keys
        },
    }
    if heights is not None:
        profiles = found.profile(heights)
        answer["profiles"] = {
            "z": heights.tolist(),
            **{
                name: {
                    key: [contract.finite(value) for value in row] for key, row in zip(found.keys, rows, strict=True)
                }
                for name, rows in profiles.items()
                if name != "height"
            },
        }
    return answer


def sensitivity_rows(found: Sensitivity) -> Iterator[list[Any]]:
    """The derivatives of every number as rows of a table."""
    yield ["quantity", "value", *(f"d/d{key}" for key in found.keys)]
    for name, values in found.numbers.items():
        yield [NUMBERS[name].symbol, float(getattr(found.flow, name)), *values.tolist()]


def _by_key(found: Sensitivity, values: Array) -> dict[str, float | None]:
    return {key: contract.finite(value) for key, value in zip(found.keys, values.tolist(), strict=True)}
