"""Packages that only some answers need, and what to install where one is missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from chuteflow.errors import InputError


def require(module: str, extra: str, what: str) -> Any:
    """The ``module`` of a package that the ``extra`` of chuteflow installs, imported for ``what``.

    Raises:
        InputError: where it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        name = (error.name or module).partition(".")[0]
        raise InputError(f"{what} needs {name}, which is not installed: pip install 'chuteflow[{extra}]'") from None
