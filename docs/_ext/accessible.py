"""What the theme leaves out for those who use the keyboard or a screen reader."""

from __future__ import annotations

from typing import Any

from sphinx.application import Sphinx


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    # After the theme, which makes the list of pages.
    app.connect("html-page-context", _completed, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _completed(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Captions of the list of pages have a level, and what scrolls sideways is reached by the keyboard."""
    if "furo_navigation_tree" in context:
        level = 'role="heading" aria-level="2"'
        context["furo_navigation_tree"] = context["furo_navigation_tree"].replace('role="heading"', level)
    if "body" in context:
        body = context["body"].replace("<pre>", '<pre tabindex="0">')
        context["body"] = body.replace('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper')
