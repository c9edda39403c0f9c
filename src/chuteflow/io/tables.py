"""Aligned text tables."""

from __future__ import annotations

from collections.abc import Sequence

from chuteflow.display import number
from chuteflow.io.contract import factor
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import NUMBERS, Scales


def heading(
    names: Sequence[str],
    scales: Scales | None,
    before: Sequence[tuple[str, str]] = (),
    after: Sequence[tuple[str, str]] = (),
) -> list[list[str]]:
    """Symbols of numbers of the registry as a row of cells, and with scales their units as a second; with other cells
    ``before`` and ``after`` them, each with its unit or an empty text."""
    cells = [*before, *((NUMBERS[name].symbol, NUMBERS[name].unit) for name in names), *after]
    symbols = [symbol for symbol, _ in cells]
    return [symbols] if scales is None else [symbols, [f"[{unit}]" if unit else "" for _, unit in cells]]


def numbers(flow: Flow, names: Sequence[str], chute: Chute, scales: Scales | None) -> list[str]:
    """Numbers of the registry as the cells of a row."""
    return [number(getattr(flow, name) * factor(name, chute, scales)) for name in names]


def table(rows: Sequence[Sequence[str]], words: Sequence[int] = ()) -> str:
    """Rows of cells as columns, numbers to the right and the columns ``words`` to the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]

    def align(row: Sequence[str]) -> str:
        cells = [
            cell.ljust(width) if column in words else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        return "  ".join(cells).rstrip()

    return "\n".join(align(row) for row in rows)
