"""How results show themselves at a prompt, on one line, and in a notebook, as a table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

#: Longest list of numbers that is written out on a line, and most rows of a table in a notebook.
_LISTED, _ROWS = 6, 60


def number(value: float) -> str:
    """Five significant digits, or a dash for what is not a finite number."""
    return f"{value:.5g}" if math.isfinite(value) else "-"


def line(kind: str, *parts: str | None, error: float | None = None, **numbers: float) -> str:
    """``<kind: parts; name = number, ..., error = ...>``; a part that is None or empty is left out; an error has one
    digit."""
    said = [part for part in parts if part]
    pairs = [f"{name} = {number(value)}" for name, value in numbers.items()]
    if error is not None:
        pairs.append(f"error = {error:.0e}")
    if pairs:
        said.append(", ".join(pairs))
    return f"<{kind}: {'; '.join(said)}>" if said else f"<{kind}>"


def span(name: str, values: Iterable[float]) -> str:
    """``name`` with its smallest and its largest value."""
    finite = [value for value in values if math.isfinite(value)]
    return f"{name} from {number(min(finite))} to {number(max(finite))}" if finite else f"{name} not known"


def list_numbers(values: Sequence[float]) -> str:
    """Some numbers, or where there are many the first and the last of them."""
    if len(values) <= _LISTED:
        return ", ".join(map(number, values))
    return f"{number(values[0])} to {number(values[-1])}"


def count_of(count: int, one: str, more: str | None = None) -> str:
    """A number of things, such as "1 flow" or "3 flows"."""
    return f"{count} {one if count == 1 else more or f'{one}s'}"


def html_table(caption: str, header: Sequence[str], rows: Sequence[Sequence[str]], note: str | None = None) -> str:
    """A table in HTML; of very many rows the middle ones are left out, and a row in their place says so. Without rows
    it is the caption and the ``note`` alone."""
    below = f"<p>{escape(note)}</p>" if note else ""
    if not rows:
        return f"<p>{escape(caption)}</p>{below}"
    shown = [*rows]
    if len(shown) > _ROWS:
        between = [f"... {len(rows) - _ROWS} more ...", *("" for _ in header[1:])]
        shown = [*rows[: _ROWS // 2], between, *rows[-(_ROWS // 2) :]]
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in shown)
    return (
        f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{below}"
    )
