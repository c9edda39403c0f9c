"""Runs the examples of a Markdown page or notebook in order, as a reader would: python run_page.py PAGE, in an empty
folder.

Python blocks share one set of names, and ``sh`` blocks hold command lines of chuteflow alone. A line may end in the
comment "# exit code N". What a block writes is compared with the ``output`` block after it, if there is one: numbers
to their last digit, estimated errors to their order of magnitude; a line "..." stands for any lines.
"""

import json
import re
import shlex
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from itertools import pairwise
from pathlib import Path

_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_EXIT = re.compile(r"# exit code (\d+)$")
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
#: An estimated error: one digit, and small.
_ERROR = re.compile(r"\de-(?:09|1\d)")


@dataclass(frozen=True)
class Example:
    """One block of a page: its line, language and code, and the output that the page shows, or None."""

    line: int
    language: str
    code: str
    output: str | None


def examples(text: str) -> Iterator[Example]:
    """The blocks of a page that are run."""
    blocks = list(_BLOCK.finditer(text))
    for block, after in pairwise([*blocks, None]):
        if block is not None and block[1] in ("python", "sh"):
            shown = after[2] if after is not None and after[1] == "output" else None
            yield Example(text.count("\n", 0, block.start()) + 1, block[1], block[2], shown)


def cells(text: str) -> Iterator[Example]:
    """The code cells of a notebook, as examples."""
    for number, cell in enumerate(json.loads(text)["cells"]):
        if cell["cell_type"] == "code":
            yield Example(number, "python", "".join(cell["source"]), None)


def blocks_of(page: Path) -> Iterator[Example]:
    """The examples of a page or notebook."""
    text = page.read_text(encoding="utf-8")
    return cells(text) if page.suffix == ".ipynb" else examples(text)


def run(example: Example, names: dict[str, object], page: str) -> str:
    """What the example writes."""
    written = StringIO()
    with redirect_stdout(written), redirect_stderr(written):
        if example.language == "python":
            # As many empty lines before it as there are in the page, so that a traceback names the right one.
            exec(compile("\n" * example.line + example.code, page, "exec"), names)
        else:
            for line in example.code.replace("\\\n", " ").splitlines():
                _command(line, written)
    return written.getvalue()


def _command(line: str, written: StringIO) -> None:
    from chuteflow.cli.program import main

    words = shlex.split(line, comments=True)
    if not words:
        return
    if words[0] != "chuteflow":
        raise SystemExit(f"{line}: only chuteflow is run")
    wanted = _EXIT.search(line)
    code = main(words[1:])
    if code != (int(wanted[1]) if wanted else 0):
        raise SystemExit(f"{line}: exit code {code}\n{written.getvalue()}")


def agree(shown: str, written: str) -> bool:
    """Whether a page shows what was written."""
    pieces = [piece.splitlines() for piece in re.split(r"^\.\.\.\n", shown, flags=re.MULTILINE)]
    left = [line.rstrip() for line in written.splitlines()]
    for i, piece in enumerate(pieces):
        last = len(left) - len(piece)
        places = range(last, last + 1) if i == len(pieces) - 1 and i else range(1 if i == 0 else last + 1)
        place = next((p for p in places if p >= 0 and all(map(_same, piece, left[p : p + len(piece)]))), None)
        if place is None or last < 0:
            return False
        left = left[place + len(piece) :]
    return not left


def _same(shown: str, written: str) -> bool:
    if _NUMBER.sub("0", shown).split() != _NUMBER.sub("0", written).split():
        return False
    return all(map(_equal, _NUMBER.findall(shown), _NUMBER.findall(written)))


def _equal(shown: str, written: str) -> bool:
    one, other = float(shown), float(written)
    if _ERROR.fullmatch(shown) and _ERROR.fullmatch(written):
        return 1e-2 < one / other < 1e2
    digits, _, power = shown.partition("e")
    unit = 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
    return abs(one - other) <= (1.5 * unit if "." in digits else 0.0)


def main(page: Path) -> None:
    """Run the page, and end with a message where an example fails or writes something else."""
    names: dict[str, object] = {"__name__": "__main__"}  # as a script that a reader runs
    sys.path.insert(0, str(Path.cwd()))
    for example in blocks_of(page):
        written = run(example, names, str(page))
        if example.output is not None and not agree(example.output, written):
            raise SystemExit(f"{page}, line {example.line}: the page shows\n{example.output}\nwritten was\n{written}")
        if example.language == "sh" and not written.strip():
            raise SystemExit(f"{page}, line {example.line}: nothing was written")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
