"""Directives that draw at build: ``picture``, by a command line, and ``paper-figure``, by number.

The pictures are part of the built site alone, and each stands below the command that makes it. A build with
``-t quick`` leaves them out, all but one of the claims and the source code: it checks the pages in a fifth of the time.
"""

import os
import shlex
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from package import FromPackage
from sphinx.application import Sphinx

from chuteflow.cli.program import main
from chuteflow.paper.captions import CAPTIONS
from chuteflow.paper.figures import FIGURES


class Picture(FromPackage):
    """The command of the content, run, and the picture that it draws with --plot.

    With the option ``quiet`` the command is not shown, for a page that has it already.
    """

    has_content = True
    option_spec: ClassVar = {"quiet": directives.flag}

    def run(self) -> list[nodes.Node]:
        """The command and the picture."""
        command = " ".join(self.content)
        words = shlex.split(command)
        file = words[words.index("--plot") + 1]
        shown = [] if "quiet" in self.options else [_shown(command)]
        return [*shown, self.drawn(words[1:], file, f"the picture that {command} draws")]

    def drawn(self, arguments: list[str], file: str, alternative: str) -> nodes.Element:
        """The picture in ``file`` that the command of the arguments makes; in a quick build its description."""

        def make(folder: Path) -> None:
            before = Path.cwd()
            os.chdir(folder)
            try:
                with redirect_stdout(StringIO()):
                    code = main(arguments)
            finally:
                os.chdir(before)
            if code:
                raise self.error(f"chuteflow {shlex.join(arguments)} ended with exit code {code}")

        return self.image(file, alternative, make)


class PaperFigure(Picture):
    """A figure of the paper, recomputed, below its number and title."""

    has_content = False
    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Section, command, picture and caption."""
        number = int(self.arguments[0])
        title = f"Figure {number}: {FIGURES[number]}"
        section = nodes.section(ids=[f"figure-{number}"], names=[title.lower()])
        section += nodes.title(title, title)
        command = f"chuteflow figures --only {number}"
        section += _shown(command)
        section += self.drawn(shlex.split(command)[1:], f"figure_{number:02d}.png", CAPTIONS[number])
        section += nodes.paragraph(CAPTIONS[number], CAPTIONS[number])
        return [section]


def _shown(command: str) -> nodes.literal_block:
    return nodes.literal_block(command, command, language="sh")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives; the working directory is that of the process, so pages are read one by one."""
    app.add_directive("picture", Picture)
    app.add_directive("paper-figure", PaperFigure)
    return {"parallel_read_safe": False}
