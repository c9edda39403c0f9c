"""``chuteflow report``: one page with every figure of the paper, every claim, and a verdict on each."""

from __future__ import annotations

import time
from datetime import datetime
from typing import TYPE_CHECKING

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.commands.figures import METHOD_HELP, FigureNumbers
from chuteflow.paper.figures import FIGURES, METHODS, compute, drawn, method_note
from chuteflow.processes import available_cores

if TYPE_CHECKING:
    from chuteflow.paper.claims import ClaimResult
    from chuteflow.paper.report import ShownFigure
    from chuteflow.paper.sources import Source

_EPILOG = "Example: chuteflow report --out report, then open report/index.html in a browser."
_NAME = "index.html"


@click.command("report", help=COMMANDS["report"], epilog=_EPILOG)
@options.option("--out", metavar="DIR", help="Directory to write to, created if needed; here by default.")
@options.option("--method", type=click.Choice(METHODS), help=METHOD_HELP)
@options.option("--only", type=FigureNumbers(), help="FigureNumbers of the figures, such as 2,3; all by default.")
@click.option("--no-claims", is_flag=True, help="Leave out the claims.")
@options.quiet_option
def command(out: str | None, method: str | None, only: list[int] | None, no_claims: bool, quiet: bool) -> None:
    """Compute all, and write the page at the end, whole or not at all."""
    path = options.directory(out or ".") / _NAME
    from chuteflow.io.writing import require_writable, write_whole

    require_writable(path, (".html",))
    started, begin = datetime.now().astimezone(), time.perf_counter()
    from chuteflow.paper.report import Report, page
    from chuteflow.paper.sources import source

    flows = source(method or METHODS[0], available_cores())
    figures = [_draw_figure(number, flows) for number in only or FIGURES]
    verdicts = [] if no_claims else _check_claims()
    report = Report(figures, verdicts, flows.words, started, time.perf_counter() - begin)
    write_whole(path, page(report))
    click.echo(f"{path}: {len(figures)} figures, {len(verdicts)} claims, {report.seconds:.0f} s")


def _tell(progress: str) -> None:
    if not options.is_quiet():
        click.echo(progress, err=True)


def _draw_figure(number: int, flows: Source) -> ShownFigure:
    from chuteflow.paper.captions import CAPTIONS
    from chuteflow.paper.facts import facts
    from chuteflow.paper.report import ShownFigure, picture

    begin = time.perf_counter()
    data = compute(number, flows)
    found = ShownFigure(
        number=number,
        title=FIGURES[number],
        caption=CAPTIONS[number],
        picture=picture(drawn(number, data)),
        facts=facts(data),
        notes=(method_note(number, flows), *data.table().notes),
    )
    _tell(f"figure {number} of {max(FIGURES)}: {time.perf_counter() - begin:.1f} s")
    return found


def _check_claims() -> list[ClaimResult]:
    from chuteflow.paper.claims import CLAIMS, check

    found = []
    for verdict in check():
        found.append(verdict)
        _tell(f"claim {len(found)} of {len(CLAIMS)}, {verdict.id}: {verdict.verdict}")
    return found
