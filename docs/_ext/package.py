"""What the extensions share: pages that are made from the package are read anew when the package changes."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

import chuteflow


class FromPackage(SphinxDirective):
    """A directive whose result depends on the code of the package."""

    @property
    def quick(self) -> bool:
        """Whether this is a build that leaves out what takes long."""
        return "quick" in self.env.app.tags

    def note_package(self) -> None:
        """Let the page depend on every module."""
        for path in Path(chuteflow.__file__).parent.rglob("*.py"):
            self.env.note_dependency(str(path))

    def table(self, heading: Sequence[str], rows: Iterable[Sequence[str]], widths: Sequence[int]) -> nodes.table:
        """A table whose cells are inline markup of the page."""
        group = nodes.tgroup(cols=len(widths))
        group += [nodes.colspec(colwidth=width) for width in widths]
        head, body = nodes.thead(), nodes.tbody()
        head += self._row(heading)
        body += [self._row(row) for row in rows]
        group += [head, body]
        table = nodes.table()
        table += group
        return table

    def _row(self, cells: Sequence[str]) -> nodes.row:
        row = nodes.row()
        for cell in cells:
            entry = nodes.entry()
            found, messages = self.parse_inline(cell)
            entry += nodes.paragraph("", "", *found)
            entry += messages
            row += entry
        return row
