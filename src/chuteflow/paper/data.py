"""The data of a figure as text: one table, with what it shows in comment lines above it."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from chuteflow import Chute, __version__


@dataclass(frozen=True, eq=False)
class FigureTable:
    """``columns`` of one length by name, under a ``title`` and ``notes``."""

    title: str
    notes: tuple[str, ...]
    columns: Mapping[str, Any]


class FigureData(Protocol):
    """What a figure is drawn from."""

    def table(self) -> FigureTable:
        """All that is drawn."""
        ...


def stack(key: str, groups: Mapping[Any, Mapping[str, Any]]) -> dict[str, Any]:
    """Columns of several groups one below the other, after a column ``key`` with the names of the groups."""
    names = next(iter(groups.values())).keys()
    sizes = {group: len(next(iter(columns.values()))) for group, columns in groups.items()}
    return {
        key: [group for group, size in sizes.items() for _ in range(size)],
        **{name: np.concatenate([columns[name] for columns in groups.values()]).tolist() for name in names},
    }


def chute_note(chute: Chute) -> str:
    """All parameters of a chute as a note."""
    return "chute: " + ", ".join(f"{name} = {value}" for name, value in chute.as_dict().items())


def csv_text(data: FigureData, *notes: str) -> str:
    """The table as CSV, numbers with all their digits; ``notes`` go above it."""
    table = data.table()
    text = io.StringIO()
    text.writelines(
        f"# {line}\n" for line in (table.title, *notes, *table.notes, f"chuteflow {__version__}, dimensionless")
    )
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.columns)
    for row in zip(*table.columns.values(), strict=True):
        writer.writerow([float(cell) if isinstance(cell, np.floating) else cell for cell in row])
    return text.getvalue()
