"""The site asks nobody for anything: the build fails where a page or a style sheet would load what is not in the site.

Links that a reader may follow are no such thing.
"""

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import SphinxError

_LOADING = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href", "object": "data"}
#: A link with one of these relations is for the reader, or for a search engine, not loaded.
_NOT_LOADED = {"author", "canonical", "copyright", "genindex", "index", "next", "prev", "search", "up"}
_OUTSIDE = re.compile(r"(?:[a-z]+:)?//")
_IN_STYLE = re.compile(r"""(?:@import\s+(?:url\(\s*)?|url\(\s*)["']?([^"')\s;]+)""")


class _Loaded(HTMLParser):
    """Collects what a page loads."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self._in_style = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what the element loads."""
        given = dict(attrs)
        self._in_style = tag == "style"
        place = given.get(_LOADING.get(tag, ""))
        if place and not (tag == "link" and given.get("rel") in _NOT_LOADED):
            self.found.append(place)
        self.found += _IN_STYLE.findall(given.get("style") or "")

    def handle_data(self, data: str) -> None:
        """Note what a style sheet in the page loads."""
        if self._in_style:
            self.found += _IN_STYLE.findall(data)


def loaded_from_outside(site: Path) -> Iterator[str]:
    """What pages and style sheets of a site load from elsewhere, as "file: address"."""
    for path in sorted([*site.rglob("*.html"), *site.rglob("*.css")]):
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".html":
            page = _Loaded()
            page.feed(text)
            places = page.found
        else:
            places = _IN_STYLE.findall(text)
        yield from (f"{path.relative_to(site)}: {place}" for place in places if _OUTSIDE.match(place))


def _check(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        found = list(loaded_from_outside(Path(app.outdir)))
        if found:
            raise SphinxError("the site would load from outside\n" + "\n".join(found))


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to the end of the build."""
    app.connect("build-finished", _check)
    return {"parallel_read_safe": True}
