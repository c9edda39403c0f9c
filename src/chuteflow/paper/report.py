"""The report: one page of HTML that needs nothing else, with figures, claims and what made them.

The page loads nothing: pictures and style are inside, there is no script, and its policy forbids requests.
"""

from __future__ import annotations

import base64
import importlib.metadata
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape
from importlib.resources import files
from io import BytesIO
from typing import TYPE_CHECKING

from chuteflow import __version__
from chuteflow.paper.claims import VERDICTS, ClaimResult, shown
from chuteflow.paper.facts import TextTable
from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Packages whose versions matter to the numbers and pictures.
_PACKAGES = ("numpy", "scipy", "contourpy", "matplotlib")
_PAPER = (
    "M. J. Woodhouse, A. J. Hogg and A. A. Sellar, Rapid granular flows down inclined planar chutes. Part 1. "
    "J. Fluid Mech. (2010)"
)


@dataclass(frozen=True)
class ShownFigure:
    """A figure on the page: ``picture`` is a data address, ``notes`` are the lines above the data in the files."""

    number: int
    title: str
    caption: str
    picture: str
    facts: TextTable
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Report:
    """All that is on the page; ``seconds`` is the time it took."""

    figures: Sequence[ShownFigure]
    verdicts: Sequence[ClaimResult]
    method: str
    started: datetime
    seconds: float


@style.own_settings()
def picture(figure: Figure) -> str:
    """A figure as a data address that holds it as SVG."""
    buffer = BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def versions() -> dict[str, str]:
    """What the numbers were computed with."""
    found = {"chuteflow": __version__, **{name: importlib.metadata.version(name) for name in _PACKAGES}}
    return found | {"Python": platform.python_version(), "platform": platform.platform()}


def page(report: Report) -> str:
    """The page."""
    style = (files("chuteflow.paper") / "report.css").read_text(encoding="utf-8")
    sections = [_summary(report)]
    if report.verdicts:
        sections.append(_claims(report.verdicts))
    sections += [_figures(report.figures), _describe_versions(report)]
    return "\n".join(
        [
            "<!doctype html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            '<meta http-equiv="Content-Security-Policy" '
            "content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\">",
            "<title>Rapid granular flows down chutes, recomputed</title>",
            f"<style>\n{style}</style>",
            "</head>",
            "<body>",
            '<a class="skip" href="#content">To the content</a>',
            "<header><h1>Rapid granular flows down chutes, recomputed</h1>",
            f"<p>Every figure and every testable claim of {escape(_PAPER)}, by chuteflow {escape(__version__)}.</p>",
            f"{_contents(report)}</header>",
            '<main id="content">',
            *sections,
            "</main>",
            "</body>",
            "</html>",
            "",
        ]
    )


def _contents(report: Report) -> str:
    links = [("summary", "Summary"), ("figures", "Figures"), ("made-with", "Made with")]
    if report.verdicts:
        links.insert(1, ("claims", "Claims"))
    return '<nav aria-label="Contents">' + " ".join(f'<a href="#{to}">{name}</a>' for to, name in links) + "</nav>"


def _summary(report: Report) -> str:
    counts = {verdict: sum(found.verdict == verdict for found in report.verdicts) for verdict in VERDICTS}
    tiles = "".join(
        f'<li class="{_class(verdict)}"><strong>{count}</strong> {escape(verdict)}</li>'
        for verdict, count in counts.items()
    )
    figures = ", ".join(str(found.number) for found in report.figures)
    lines = [f"<p>Figures drawn: {figures}. Flows by the method {escape(report.method)}.</p>"]
    if report.verdicts:
        lines.append(f'<p>Of {len(report.verdicts)} claims:</p><ul class="tiles">{tiles}</ul>')
    return _section("summary", "Summary", "".join(lines))


def _claims(verdicts: Sequence[ClaimResult]) -> str:
    """The table, with buttons above that show the rows of one verdict: by style alone."""
    buttons = "".join(
        f'<input type="radio" name="shown" id="show-{_class(name)}"{" checked" if name == "all" else ""}>'
        f'<label for="show-{_class(name)}">{escape(name)} ({count})</label>'
        for name, count in (
            ("all", len(verdicts)),
            *((name, sum(found.verdict == name for found in verdicts)) for name in VERDICTS),
        )
    )
    header = ("Claim", "Where", "Printed", "Computed", "Verdict", "Reason")
    rows = "".join(_claim(found, header) for found in verdicts)
    table = (
        '<table class="claims"><caption>Claims of the paper, and what was found</caption><thead><tr>'
        + "".join(f'<th scope="col">{name}</th>' for name in header)
        + f"</tr></thead><tbody>{rows}</tbody></table>"
    )
    chooser = f"<fieldset><legend>Show</legend>{buttons}</fieldset>{_scrolling(table, 'Claims')}"
    return _section("claims", "Claims", f'<div class="filtered">{chooser}</div>')


def _claim(found: ClaimResult, header: Sequence[str]) -> str:
    texts = (found.source, shown(found.printed), shown(found.computed), found.verdict, found.reason)
    cells = "".join(
        f'<td data-label="{name}">{f"<span>{escape(text)}</span>" if name == "Verdict" else escape(text)}</td>'
        for name, text in zip(header[1:], texts, strict=True)
    )
    statement = (
        f'<th scope="row" data-label="{header[0]}">{escape(found.statement)} <code>{escape(found.id)}</code></th>'
    )
    return f'<tr class="{_class(found.verdict)}">{statement}{cells}</tr>'


def _figures(shown_figures: Iterable[ShownFigure]) -> str:
    return _section("figures", "Figures", "".join(map(_figure, shown_figures)))


def _figure(found: ShownFigure) -> str:
    name = f"Figure {found.number}"
    title = f"{name}. {found.title}"
    image = f'<img src="{found.picture}" alt="{escape(f"{name}: {found.caption}")}">'
    table = _table(f"Measured in figure {found.number}", found.facts.header, found.facts.rows)
    notes = "".join(f"<li>{escape(note)}</li>" for note in found.notes)
    return (
        f'<article id="figure-{found.number}"><h3>{escape(title)}</h3><div class="beside">'
        f"<figure>{image}</figure><div><p>{escape(found.caption)}</p>"
        f"<details><summary>Method and parameters</summary><ul>{notes}</ul></details></div></div>"
        f"{_scrolling(table, f'Measured in figure {found.number}')}</article>"
    )


def _describe_versions(report: Report) -> str:
    rows = [*versions().items()]
    rows += [
        ("date", report.started.strftime("%Y-%m-%d %H:%M:%S %Z")),
        ("time taken", f"{report.seconds:.1f} s"),
        ("method", report.method),
    ]
    return _section("made-with", "Made with", _pairs(dict(rows)))


def _pairs(pairs: Mapping[str, str]) -> str:
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>' for name, value in pairs.items()
    )
    return f'<table class="pairs"><caption>Versions, date and time taken</caption><tbody>{rows}</tbody></table>'


def _table(caption: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in header)
    body = "".join(
        f'<tr><th scope="row">{escape(first)}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in rest)}</tr>'
        for first, *rest in rows
    )
    return f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _scrolling(table: str, name: str) -> str:
    """A table that scrolls by itself where it is too wide, also by keys."""
    return f'<div class="scrolling" role="region" aria-label="{escape(name)}" tabindex="0">{table}</div>'


def _section(place: str, title: str, content: str) -> str:
    return f'<section id="{place}"><h2>{escape(title)}</h2>{content}</section>'


def _class(verdict: str) -> str:
    return verdict.replace(" ", "-")
