"""What a file that cannot be loaded is answered with."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from chuteflow.errors import InputError

#: What reading a damaged file may end with.
_DAMAGE = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RuntimeError)


@contextmanager
def loading(path: str | os.PathLike[str], otherwise: str) -> Iterator[None]:
    """The block in which the file ``path`` is read; where it is not damaged it is what ``otherwise`` says.

    Raises:
        InputError: for a file that is missing, damaged or refused in the block, in one line that names it.
    """
    try:
        # What a library says of a file that cannot be opened is longer.
        with open(path, "rb"):
            pass
        yield
    except InputError as error:
        raise InputError(f"cannot load {path}: {error}") from None
    except OSError as error:
        raise InputError(f"cannot load {path}: {error.strerror or 'it is not a file of this format'}") from None
    except _DAMAGE:
        raise InputError(f"cannot load {path}: it is damaged, or {otherwise}") from None
