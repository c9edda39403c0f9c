"""The role ``eq-code``: an equation of the paper, and the function that implements it.

``{eq-code}`(3.16) chuteflow.theory.boundary.slip_coefficient``` links into the reference. It warns, and so
fails the build, where there is no such object, and where its module does not name the equation.
"""

import inspect
import re
from importlib import import_module
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxRole

_NUMBER = re.compile(r"\((\d|A) ?\.?(\d+)\)")
_RANGE = re.compile(r"\((\d|A) ?\.?(\d+)\)-\(\1 ?\.?(\d+)\)")


def numbers(text: str) -> set[tuple[str, int]]:
    """The equations that a text names, such as (3.16), (4.11)-(4.13) and (A 1)."""
    found = {(section, int(number)) for section, number in _NUMBER.findall(text)}
    for section, first, last in _RANGE.findall(text):
        found |= {(section, number) for number in range(int(first), int(last) + 1)}
    return found


def implementation(path: str) -> Any:
    """The object of a dotted path.

    Raises:
        LookupError: where there is none.
    """
    parts = path.split(".")
    for cut in range(len(parts) - 1, 0, -1):
        try:
            found: Any = import_module(".".join(parts[:cut]))
            for name in parts[cut:]:
                found = getattr(found, name)
        except (ImportError, AttributeError):
            continue
        return found
    raise LookupError(f"there is no {path}")


def fault(text: str) -> str | None:
    """What is wrong with the text of a role, or None."""
    label, _, path = text.rpartition(" ")
    try:
        found = implementation(path)
    except LookupError as error:
        return str(error)
    module = inspect.getsource(inspect.getmodule(found) or found)
    missing = numbers(label) - numbers(module)
    return f"the module of {path} does not name {label}" if missing else None


class EquationCode(SphinxRole):
    """``(number) dotted.path`` as the number with a link to the object."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """The nodes."""
        label, _, path = self.text.rpartition(" ")
        if wrong := fault(self.text):
            return [], [self.inliner.reporter.warning(wrong, line=self.lineno)]
        short = ".".join(path.split(".")[-2:])
        link = addnodes.pending_xref(
            "", refdomain="py", reftype="obj", reftarget=path, refdoc=self.env.docname, refwarn=True
        )
        link += nodes.literal(short, short, classes=["xref", "py"])
        return [nodes.Text(f"{label} "), link], []


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the role."""
    app.add_role("eq-code", EquationCode())
    return {"parallel_read_safe": True}
