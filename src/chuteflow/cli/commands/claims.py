"""``chuteflow claims``: every statement of the paper that can be tested, computed, with a verdict."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress
from chuteflow.errors import InputError

if TYPE_CHECKING:
    from chuteflow.paper.claims import ClaimResult

_EPILOG = (
    'Verdicts: "confirmed" as printed; "corrected" where something else holds, which is computed and backed by an '
    'argument of its own; "not confirmed". Example: chuteflow claims --section 4.3'
)
#: Endings of the files that --out writes.
_WRITTEN = (".json", ".txt")
#: Fractions of the width of the columns claim, printed and computed; the verdict takes what it needs.
_SHARES = (0.5, 0.2, 0.3)
_VERDICT_WIDTH, _GAP, _NARROWEST, _WIDEST = 13, 2, 72, 140


@click.command("claims", help=COMMANDS["claims"], epilog=_EPILOG)
@options.option("--only", metavar="ID,ID", help="Claims with these ids, or parts of ids; all by default.")
@options.option("--section", metavar="NUMBER", help='Claims of this section of the paper, such as 4.3 or "appendix".')
@click.option("--list", "listed", is_flag=True, help="List ids and statements, and compute nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON list.")
@options.option("--out", metavar="FILE", help="Write to FILE, .json or .txt, what would be printed.")
@options.quiet_option
def command(only: str | None, section: str | None, listed: bool, as_json: bool, out: str | None, quiet: bool) -> None:
    """Choose, compute, and print or write."""
    from chuteflow.paper.claims import CLAIMS, check

    ids = _choose(only, section)
    if out is not None:
        from chuteflow.io.writing import require_writable

        as_json = require_writable(out, _WRITTEN) == ".json"
    if listed and as_json:
        lines: Iterable[str] = [_list_as_json(ids)]
    elif listed:
        lines = (f"{id:32}  {CLAIMS[id].source}: {CLAIMS[id].statement}" for id in ids)
    elif as_json:
        lines = [_json(list(_watch(check(ids), len(ids))))]
    else:
        lines = _report(_watch(check(ids), len(ids)), _width() if out is None else _WIDEST)
    if out is None:
        for line in lines:
            click.echo(line)
    else:
        _write(out, "\n".join(lines) + "\n")


def _choose(only: str | None, section: str | None) -> list[str]:
    from chuteflow.paper.claims import CLAIMS, matching

    ids = list(CLAIMS) if only is None else matching(word.strip() for word in only.split(","))
    if section is None:
        return ids
    known = sorted({name for id in ids for name in CLAIMS[id].sections})
    # A section holds its own; asked for 4, so do all parts of it.
    wanted = {name for name in known if name == section or name.startswith(f"{section}.")}
    if not wanted:
        raise InputError(f"no claim of section {section!r} among those chosen: they are of {', '.join(known)}")
    return [id for id in ids if wanted.intersection(CLAIMS[id].sections)]


def _watch(verdicts: Iterable[ClaimResult], total: int) -> Iterator[ClaimResult]:
    """The same, with the progress on standard error if that is a terminal."""
    with Progress() as progress:
        for number, verdict in enumerate(verdicts, 1):
            progress.clear()
            yield verdict
            if number < total:
                progress.show(f"{number} of {total} claims")


def _json(verdicts: Sequence[ClaimResult]) -> str:
    from chuteflow.io import contract

    return contract.text([{field.name: _plain(getattr(v, field.name)) for field in fields(v)} for v in verdicts])


def _plain(value: Any) -> Any:
    """What JSON can hold."""
    from chuteflow.io import contract

    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    return contract.finite(value) if isinstance(value, float) else value


def _list_as_json(ids: Sequence[str]) -> str:
    """What is claimed and where, as a JSON list; what was not computed is null."""
    from chuteflow.io import contract
    from chuteflow.paper.claims import CLAIMS

    unknown = dict.fromkeys(("printed", "computed", "verdict"))
    return contract.text(
        [{"id": id, "source": CLAIMS[id].source, "statement": CLAIMS[id].statement, **unknown} for id in ids]
    )


def _write(out: str, text: str) -> None:
    """Write ``text`` to ``out``; where that fails, print it, so that it is not lost."""
    from chuteflow.io.writing import write_whole

    try:
        write_whole(out, text)
    except InputError:
        click.echo(text, nl=False)
        raise


def _width() -> int:
    return min(max(shutil.get_terminal_size((100, 24)).columns, _NARROWEST), _WIDEST)


def _report(verdicts: Iterable[ClaimResult], width: int) -> Iterator[str]:
    from chuteflow.paper.claims import VERDICTS, shown

    free = width - _VERDICT_WIDTH - 3 * _GAP
    widths = [_VERDICT_WIDTH, *(int(fraction * free) for fraction in _SHARES)]
    yield from _row(["verdict", "claim", "printed", "computed"], widths)
    yield from _row(["-" * width for width in widths], widths)
    numbers: dict[str, int] = dict.fromkeys(VERDICTS, 0)
    for v in verdicts:
        numbers[v.verdict] += 1
        yield from _row([v.verdict, v.statement, shown(v.printed), shown(v.computed)], widths)
        note = f"[{v.id}] {v.source}. {v.reason}"
        indent = " " * (_VERDICT_WIDTH + _GAP)
        yield textwrap.fill(note, width, initial_indent=indent, subsequent_indent=indent)
        yield ""
    parts = ", ".join(f"{number} {verdict}" for verdict, number in numbers.items())
    total = sum(numbers.values())
    yield f"{total} {'claim' if total == 1 else 'claims'}: {parts}"


def _row(cells: Sequence[str], widths: Sequence[int]) -> Iterator[str]:
    """Cells side by side, each wrapped within its width."""
    wrapped = [textwrap.wrap(cell, width) for cell, width in zip(cells, widths, strict=True)]
    for line in zip_longest(*wrapped, fillvalue=""):
        yield (" " * _GAP).join(part.ljust(width) for part, width in zip(line, widths, strict=True)).rstrip()
