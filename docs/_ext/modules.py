"""Directives of the reference: the public names of the package, and all modules of a layer, found at build."""

import pkgutil
from collections.abc import Iterator
from importlib import import_module

from docutils import nodes
from docutils.statemachine import StringList
from package import FromPackage
from sphinx.application import Sphinx

import chuteflow

#: Public names that other pages show.
_ELSEWHERE = {"__version__", "QUANTITIES"}


def public_names() -> list[str]:
    """The names at the top of the package that the page of the package documents: functions, classes, errors."""
    names = [name for name in chuteflow.__all__ if name not in _ELSEWHERE]
    return sorted(names, key=lambda name: (isinstance(getattr(chuteflow, name), type), name.endswith("Error")))


def modules_of(layer: str) -> Iterator[str]:
    """The dotted names of all modules of a layer that hold anything."""
    package = import_module(f"chuteflow.{layer}")
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not found.name.rsplit(".", 1)[-1].startswith("_"):
            yield found.name


class _Generated(FromPackage):
    """reStructuredText that is written at build."""

    def lines(self) -> Iterator[str]:
        """The text."""
        raise NotImplementedError

    def run(self) -> list[nodes.Node]:
        """Parse the text, its titles included."""
        self.note_package()
        container = nodes.section()
        container.document = self.state.document
        text = StringList(list(self.lines()), source=self.get_source_info()[0])
        self.state.nested_parse(text, self.content_offset, container, match_titles=True)
        return container.children


class Package(_Generated):
    """Everything at the top of the package."""

    def lines(self) -> Iterator[str]:
        """One entry for each public name."""
        for name in public_names():
            kind = "autoclass" if isinstance(getattr(chuteflow, name), type) else "autofunction"
            yield f".. {kind}:: chuteflow.{name}"
            if kind == "autoclass":
                yield "   :members:"
                yield "   :show-inheritance:" if name.endswith("Error") else ""
            yield ""


class Layer(_Generated):
    """Every module of the layer that the argument names; what the page of the package has is left out.

    The content, if there is any, names the modules that are shown, one a line.
    """

    required_arguments = 1
    has_content = True

    def lines(self) -> Iterator[str]:
        """One section for each module."""
        names = public_names()
        layer = self.arguments[0]
        yield from (import_module(f"chuteflow.{layer}").__doc__ or "", "")
        chosen = [f"chuteflow.{layer}.{name}" for name in self.content] or modules_of(layer)
        for name in chosen:
            title = name.removeprefix("chuteflow.")
            module = import_module(name)
            left_out = ", ".join(n for n in names if getattr(module, n, None) is getattr(chuteflow, n))
            yield from (title, "-" * len(title), "")
            yield f".. automodule:: {name}"
            yield "   :members:"
            yield f"   :exclude-members: {left_out}"
            yield ""


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    app.add_directive("public-names", Package)
    app.add_directive("layer", Layer)
    return {"parallel_read_safe": True}
