"""What the extensions share: pages that are made from the package are read again when the package changes."""

import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

import chuteflow

#: The content of a cell.
Cell = str | list[nodes.Node]


class FromPackage(SphinxDirective):
    """A directive whose result depends on the code of the package."""

    @property
    def quick(self) -> bool:
        """Whether this is a build that leaves out what takes long."""
        return "quick" in self.env.app.tags

    def note_package(self) -> None:
        """Let the page depend on every module, and on what makes the page of them."""
        for path in [*Path(chuteflow.__file__).parent.rglob("*.py"), *Path(__file__).parent.glob("*.py")]:
            self.env.note_dependency(str(path))

    def image(self, file: str, said: str, make: Callable[[Path], None]) -> nodes.Element:
        """The picture in ``file`` that ``make`` draws into a folder; in a quick build the words on what it shows."""
        self.note_package()
        if self.quick:
            return nodes.paragraph(said, said)
        folder = Path(self.env.doctreedir).parent / ".pictures" / self.env.docname
        folder.mkdir(parents=True, exist_ok=True)
        make(folder)
        page = Path(self.env.doc2path(self.env.docname)).parent
        return nodes.image(uri=Path(os.path.relpath(folder / file, page)).as_posix(), alt=said)

    def table(self, heading: Sequence[Cell], rows: Iterable[Sequence[Cell]], widths: Sequence[int]) -> nodes.table:
        """A table whose cells are inline markup of the page, or nodes."""
        group = nodes.tgroup(cols=len(widths))
        group += [nodes.colspec(colwidth=width) for width in widths]
        head, body = nodes.thead(), nodes.tbody()
        head += self._row(heading)
        body += [self._row(row) for row in rows]
        group += [head, body]
        table = nodes.table()
        table += group
        return table

    def _row(self, cells: Sequence[Cell]) -> nodes.row:
        row = nodes.row()
        for cell in cells:
            entry = nodes.entry()
            if isinstance(cell, str):
                found, messages = self.parse_inline(cell)
                entry += nodes.paragraph("", "", *found)
                entry += messages
            else:
                entry += cell
            row += entry
        return row
