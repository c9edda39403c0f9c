"""``chuteflow figures``: draw figures of the paper, each with its data beside it."""

from __future__ import annotations

import time
from typing import Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress
from chuteflow.paper.figures import FIGURES, METHODS, WITHOUT_METHOD, compute, drawn, incomplete, method_note
from chuteflow.processes import available_cores


class FigureNumbers(click.ParamType):
    """Numbers of figures, separated by commas."""

    name = "numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> list[int]:
        """The numbers, in order and once each."""
        try:
            numbers = sorted({int(number) for number in value.split(",")})
        except ValueError:
            self.fail(f"{value!r}: write numbers separated by commas, for example 2,3", param, ctx)
        unknown = [str(number) for number in numbers if number not in FIGURES]
        if unknown:
            known = ", ".join(map(str, FIGURES))
            self.fail(f"there is no figure {' and no '.join(unknown)} here: choose from {known}", param, ctx)
        return numbers


_EPILOG = "Figures: " + "; ".join(f"{number}  {title}" for number, title in FIGURES.items())


#: The help of the option.
METHOD_HELP = "How flows are computed: overburden (this package's, the default) or mapped (the paper's own)."


@click.command("figures", help=COMMANDS["figures"], epilog=_EPILOG)
@options.option("--only", type=FigureNumbers(), help="Numbers of the figures, such as 2,3; all by default.")
@options.option("--out", metavar="DIR", help="Directory to write to, created if needed; here by default.")
@options.option(
    "--format",
    "kind",
    type=click.Choice(["png", "pdf", "svg"]),
    help="Format of the pictures; png by default.",
)
@options.option("--method", type=click.Choice(METHODS), help=METHOD_HELP)
@options.quiet_option
def command(only: list[int] | None, out: str | None, kind: str | None, method: str | None, quiet: bool) -> None:
    """Compute, draw and write."""
    folder = options.directory(out or ".")
    chosen = only or list(FIGURES)
    names = {number: folder / f"figure_{number:02d}.{kind or 'png'}" for number in chosen}
    from chuteflow.io.writing import require_writable, write_whole
    from chuteflow.paper.data import csv_text
    from chuteflow.paper.sources import source
    from chuteflow.plotting.plots import write_figure

    for path in names.values():
        require_writable(path, options.DRAWN)
    flows = source(method or METHODS[0], available_cores())
    for number, path in names.items():
        begin = time.perf_counter()
        with Progress() as progress:
            progress.show(f"figure {number} ...")
            data = compute(number, flows)
            write_figure(drawn(number, data), path)
            write_whole(path.with_suffix(".csv"), csv_text(data, method_note(number, flows)))
        unchanged = (
            f"; --method changes nothing: {WITHOUT_METHOD[number]}" if method and number in WITHOUT_METHOD else ""
        )
        ends = "; the method does not reach all flows: see the notes in the data" if incomplete(data) else ""
        took = f"{time.perf_counter() - begin:.1f} s"
        click.echo(f"figure {number}: {path} and {path.with_suffix('.csv').name}, {took}{unchanged}{ends}")
