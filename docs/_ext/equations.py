"""Equations of the paper: where they stand, what implements them, and links both ways.

- ``{equation} 3.16`` shows an equation under its number. The option ``code`` names what implements it, as dotted
  paths separated by commas; the option ``printed`` tells a misprint that is mended here.
- ``{eqn}`3.16``` is a link to an equation from anywhere. Docstrings get such links without asking.
- ``{eq-code}`(3.16) chuteflow.theory.boundary.slip_coefficient``` is a link to code in a line of text.

The build fails where there is no such object, where the module of an object does not name the equation, and
where an equation that is named stands nowhere.
"""

import inspect
import re
from functools import cached_property
from importlib import import_module
from itertools import pairwise
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from modules import public_names
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective, SphinxRole

import chuteflow

#: The number of an equation of the paper in text: (3.16) or (A 1).
NUMBER = re.compile(r"(?<!\w)\((?:([2-4]\.[1-9]\d*)|A ?([1-9]))\)")
#: What stands between the first and the last of a range.
_DASHES = {"-", "–"}


def numbers(text: str) -> set[str]:
    """The equations that a text names, such as 3.16, A1, and all from (4.11) to (4.13) in (4.11)-(4.13)."""
    named = list(NUMBER.finditer(text))
    found = {numbered(match) for match in named}
    for first, last in pairwise(named):
        if text[first.end() : last.start()].strip() in _DASHES:
            (section, low), (_, high) = (re.findall(r"^\d\.|^A|\d+$", numbered(match)) for match in (first, last))
            found |= {f"{section}{number}" for number in range(int(low), int(high) + 1)}
    return found


def numbered(match: re.Match[str]) -> str:
    """What a match of NUMBER names, such as 3.16 or A1."""
    return match[1] or f"A{match[2]}"


def label(number: str) -> str:
    """The name of the place where an equation stands."""
    return f"equation-{number.replace('.', '-').lower()}"


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
    """What is wrong with ``(numbers) dotted.path``, or None."""
    named, _, path = text.rpartition(" ")
    try:
        found = implementation(path)
    except LookupError as error:
        return str(error)
    if isinstance(found, property | cached_property):
        found = getattr(found, "fget", None) or found.func
    module = inspect.getsource(inspect.getmodule(found) or found)
    missing = numbers(named) - numbers(module)
    return f"the module of {path} does not name {named}" if missing else None


def shown_as(path: str) -> str:
    """The path under which the reference shows an object: public names stand at the top of the package."""
    for name in public_names():
        home = f"{getattr(chuteflow, name).__module__}.{name}"
        if path == home or path.startswith(f"{home}."):
            return f"chuteflow.{name}{path.removeprefix(home)}"
    return path


def _code_link(path: str, page: str) -> addnodes.pending_xref:
    target, short = shown_as(path), ".".join(path.split(".")[-2:])
    link = addnodes.pending_xref("", refdomain="py", reftype="obj", reftarget=target, refdoc=page, refwarn=True)
    link += nodes.literal(short, short, classes=["xref", "py"])
    return link


class Equation(SphinxDirective):
    """An equation of the paper under its number, and links to what implements it."""

    has_content = True
    required_arguments = 1
    option_spec: ClassVar = {"code": directives.unchanged_required, "printed": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """The equation, its links, and what the paper prints in its place."""
        number = self.arguments[0]
        shown = f"({number})"
        formula = "\n".join(self.content).strip()
        # Sphinx sets lines in an environment that takes no tag; here the number belongs to the whole.
        tagged = rf"\[{formula} \tag{{{number}}}\]"
        block = nodes.math_block(formula, tagged, nowrap=True, number=None, label=None)
        whole = nodes.container("", block, ids=[label(number)], classes=["equation"])
        self.env.domains.standard_domain.note_hyperlink_target(label(number), self.env.docname, label(number), shown)
        whole += self._beside(shown)
        return [whole]

    def _beside(self, shown: str) -> nodes.paragraph:
        beside = nodes.paragraph(classes=["in-code"])
        for path in self.options["code"].split(","):
            path = path.strip()
            if wrong := fault(f"{shown} {path}"):
                raise self.error(wrong)
            beside += [_code_link(path, self.env.docname), nodes.Text(" ")]
        if "printed" in self.options:
            found, messages = self.parse_inline(f"The paper prints {self.options['printed']}")
            beside += nodes.inline("", "", *found, *messages, classes=["printed"])
        return beside


class EquationLink(SphinxRole):
    """A number such as 3.16 as (3.16), with a link to where the equation stands."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """The link."""
        link = addnodes.pending_xref(
            "",
            refdomain="std",
            reftype="ref",
            reftarget=label(self.text),
            refdoc=self.env.docname,
            refexplicit=True,
            refwarn=True,
        )
        link += nodes.inline("", f"({self.text})")
        return [link], []


class EquationCode(SphinxRole):
    """``(number) dotted.path`` as the number with a link to the object."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """The nodes."""
        named, _, path = self.text.rpartition(" ")
        if wrong := fault(self.text):
            return [], [self.inliner.reporter.warning(wrong, line=self.lineno)]
        return [nodes.Text(f"{named} "), _code_link(path, self.env.docname)], []


def setup(app: Sphinx) -> dict[str, bool]:
    """Register directive and roles."""
    app.add_directive("equation", Equation)
    app.add_role("eqn", EquationLink())
    app.add_role("eq-code", EquationCode())
    return {"parallel_read_safe": True}
