"""Notebooks as pages: their code is run when the pages are built, and what each cell shows stands below it.

A quick build does not run them.
"""

import ast
import base64
import json
import os
import tempfile
from contextlib import redirect_stdout
from io import BytesIO, StringIO
from typing import Any, ClassVar

import numpy as np
from docutils import nodes
from docutils.parsers import Parser
from matplotlib.axes import Axes
from myst_parser.parsers.sphinx_ import MystParser
from sphinx.application import Sphinx

_DPI = 110


class NotebookParser(Parser):
    """A notebook as a Markdown page with the outputs of its cells."""

    supported: ClassVar = ("notebook",)

    def parse(self, inputstring: str, document: nodes.document) -> None:
        """Run the cells in order, in one folder, and parse the page."""
        quick = "quick" in document.settings.env.app.tags
        names: dict[str, Any] = {}
        parts = []
        for cell in json.loads(inputstring)["cells"]:
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                parts.append(source)
                continue
            parts.append(f"```python\n{source}\n```")
            if not quick:
                parts += run(source, names)
        MystParser().parse("\n\n".join(parts), document)


def run(source: str, names: dict[str, Any]) -> list[str]:
    """What a cell shows, as parts of a page: what it prints, and its last value unless a semicolon ends it."""
    tree = ast.parse(source)
    end = tree.body[-1] if tree.body else None
    last = end if isinstance(end, ast.Expr) else None
    if last is not None:
        tree.body.pop()
    written = StringIO()
    folder = names.setdefault("__folder__", tempfile.mkdtemp())
    before = os.getcwd()
    os.chdir(folder)
    try:
        with redirect_stdout(written):
            exec(compile(tree, "notebook", "exec"), names)
            value = None if last is None else eval(compile(ast.Expression(last.value), "notebook", "eval"), names)
    finally:
        os.chdir(before)
    shown = [f"```text\n{written.getvalue()}```"] if written.getvalue() else []
    pictures = [value] if _is_picture(value) else [names[n] for n in _assigned(tree) if _is_picture(names.get(n))]
    shown += [_picture(axes) for axes in pictures]
    if value is not None and not _is_picture(value) and not source.rstrip().endswith(";"):
        shown.append(_value(value))
    return shown


def _assigned(tree: ast.Module) -> list[str]:
    """Names that the cell gives to what its calls return."""
    return [
        target.id
        for one in tree.body
        if isinstance(one, ast.Assign)
        for target in one.targets
        if isinstance(target, ast.Name)
    ]


def _is_picture(value: Any) -> bool:
    return isinstance(value, Axes) or (
        isinstance(value, np.ndarray) and value.size > 0 and isinstance(value.flat[0], Axes)
    )


def _picture(axes: Any) -> str:
    stream = BytesIO()
    figure = np.ravel(axes)[0].figure
    figure.savefig(stream, format="png", dpi=_DPI)
    width, height = figure.get_size_inches() * _DPI
    data = base64.b64encode(stream.getvalue()).decode()
    size = f'width="{width:.0f}" height="{height:.0f}"'
    return _raw(f'<img alt="the picture that the cell draws" {size} src="data:image/png;base64,{data}">')


def _value(value: Any) -> str:
    shown = getattr(value, "_repr_html_", None)
    # The table of xarray brings styles and icons of its own, which these pages have no need of.
    if shown is None or type(value).__module__.startswith("xarray"):
        return f"```text\n{value!r}\n```"
    return _raw(f'<div class="table-wrapper">{shown()}</div>')


def _raw(html: str) -> str:
    return f"```{{raw}} html\n{html}\n```"


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the format; the working directory is that of the process, so pages are read one by one."""
    app.add_source_suffix(".ipynb", "notebook")
    app.add_source_parser(NotebookParser)
    return {"parallel_read_safe": False}
