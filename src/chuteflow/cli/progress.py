"""Progress of a command: nothing with --quiet."""

from __future__ import annotations

from chuteflow.cli.options import is_quiet
from chuteflow.progress import ProgressLine


class Progress(ProgressLine):
    """A :class:`chuteflow.progress.ProgressLine` that is quiet where the running command is."""

    def __init__(self, seconds: float = 0.0) -> None:
        super().__init__(seconds, quiet=is_quiet())
