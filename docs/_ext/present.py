"""Trees of pages name some by a pattern, such as ``sweeps*``: one without pages is left out, without complaint."""

import re
from pathlib import Path

from sphinx.application import Sphinx

_PATTERN = re.compile(r"^[\w/]+\*$\n", re.MULTILINE)


def _without_absent(app: Sphinx, page: str, content: list[str]) -> None:
    def kept(match: re.Match[str]) -> str:
        return match[0] if any(Path(app.srcdir).glob(f"{match[0].strip()}.*")) else ""

    content[0] = _PATTERN.sub(kept, content[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to the reading of pages."""
    app.connect("source-read", _without_absent)
    return {"parallel_read_safe": True}
