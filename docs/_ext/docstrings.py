"""Docstrings are plain text with a few roles: keep what they mean from being read as markup.

Formulas such as |lambda| < 1, 2 * x or lambda_ hold characters that reStructuredText has other plans for, and
an indented formula is to stay as it is set. The number of an equation becomes a link to where it stands.
"""

import re
from typing import Any

from equations import NUMBER, numbered
from sphinx.application import Sphinx

#: Literals and roles, which stay as they are.
_MARKUP = re.compile(r"(``.+?``|:\w+:`[^`]+`)")
_SPECIAL = re.compile(r"(\*|\||(?<=\w)_(?!\w)|`)")
#: Headings that napoleon makes into fields.
_SECTION = re.compile(r"(Args|Raises|Returns|Yields):$")


def escaped(line: str) -> str:
    """The line with the special characters outside of literals and roles escaped, and equations linked."""
    parts = _MARKUP.split(line)
    parts[::2] = [linked(_SPECIAL.sub(r"\\\1", part), ":eqn:`{}`") for part in parts[::2]]
    return "".join(parts)


def linked(text: str, role: str) -> str:
    """The text with the equations that it names as links, in the markup ``role``."""
    return NUMBER.sub(lambda match: role.format(numbered(match)), text)


def marked_up(lines: list[str]) -> list[str]:
    """A docstring as reStructuredText: indented paragraphs outside of sections are formulas, set literally."""
    lines = [line.removeprefix("# ") for line in lines]  # a comment on notation, for readers of the source
    out: list[str] = []
    in_section = in_formula = False
    for i, line in enumerate(lines):
        indented = line.startswith("    ")
        if line.strip() and not indented:
            in_section, in_formula = bool(_SECTION.match(line)), False
        elif indented and not in_section and not in_formula and not lines[i - 1].strip():
            out += ["::", ""]
            in_formula = True
        out.append(line if in_formula else escaped(line))
    return out


def _process(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    marked = marked_up(lines)
    if what in ("attribute", "data", "property"):
        # What stands before a colon in the first line would be taken for a type.
        marked[:1] = marked[0].replace(": ", ":\n", 1).split("\n")
    lines[:] = marked


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect before napoleon, which is to see the result."""
    app.connect("autodoc-process-docstring", _process, priority=100)
    return {"parallel_read_safe": True}
