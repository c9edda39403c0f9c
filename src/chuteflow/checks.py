"""Numbers that are given from outside: one check for all, and one way to show what was given."""

from __future__ import annotations

import math
import numbers
from typing import TYPE_CHECKING, Any

from chuteflow.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: Characters of a value that a message shows.
MOST_SHOWN = 60


def number(name: str, value: Any, low: float = -math.inf, high: float = math.inf) -> float:
    """``value`` as a finite float from ``low`` to ``high``, see :func:`real`.

    Raises:
        InputError: naming ``name``, what was given and what is allowed.
    """
    found = real(name, value, _from_to(low, high))
    if not (math.isfinite(found) and low <= found <= high):
        kind = "" if math.isfinite(found) or math.isfinite(high) else " a finite number"
        raise InputError(f"{name} = {shorten(value)}: must be{kind}{_from_to(low, high)}")
    return found


def real(name: str, value: Any, allowed: str = "") -> float:
    """``value`` as a float, finite or not: a real number of Python, numpy or another library.

    Text, truth values, complex numbers and arrays are refused, however they convert.

    Raises:
        InputError: naming ``name``, what was given and what is ``allowed``.
    """
    try:
        if _is_real(value):
            return float(value)
    except OverflowError:
        return math.inf
    except (TypeError, ValueError):
        pass
    raise InputError(f"{name} = {shorten(value)}: must be a number{allowed}")


def number_in(name: str, text: str, low: float = -math.inf, high: float = math.inf) -> float:
    """The finite number from ``low`` to ``high`` that ``text`` spells.

    Raises:
        InputError: naming ``name``, what was given and what is allowed.
    """
    try:
        found = float(text)
    except ValueError:
        raise InputError(f"{name} = {shorten(text)}: must be a number{_from_to(low, high)}") from None
    return number(name, found, low, high)


def whole(name: str, value: Any, low: float, high: float = math.inf) -> int:
    """``value`` as an int from ``low`` to ``high``: a whole number, also as a float such as 1e3.

    Raises:
        InputError: naming ``name``, what was given and what is allowed.
    """
    try:
        found = int(value) if _is_real(value) else None
    except (TypeError, ValueError, OverflowError):
        found = None
    if found is None or found != value:
        raise InputError(f"{name} = {shorten(value)}: must be a whole number{_from_to(low, high)}")
    if not low <= found <= high:
        raise InputError(f"{name} = {shorten(value)}: must be{_from_to(low, high)}")
    return found


def pair(name: str, value: Any) -> tuple[float, float]:
    """``value`` as two numbers, the second larger than the first.

    Raises:
        InputError: naming ``name`` and what was given.
    """
    try:
        low, high = value
    except (TypeError, ValueError):
        raise InputError(f"{name} = {shorten(value)}: must be two numbers, the second larger than the first") from None
    return number(name, low), number(name, high)


def check_size(size: Any, fewest: int, most: int) -> tuple[int, int]:
    """Numbers of points along two axes.

    Raises:
        InputError: saying what was given and what is allowed.
    """
    allowed = f"must be from {fewest}x{fewest} to {most}x{most}"
    try:
        x, y = (whole("size", points, -math.inf) for points in size)
    except (TypeError, ValueError):
        raise InputError(f"size = {shorten(size)}: {allowed}") from None
    if not (fewest <= min(x, y) and max(x, y) <= most):
        raise InputError(f"size {shorten(x)}x{shorten(y)}: {allowed}")
    return x, y


def real_array(name: str, values: Any) -> NDArray[np.float64]:
    """``values`` as an array of floats: a real number or any shape of them, finite or not.

    Raises:
        InputError: naming ``name``, for text, truth values, complex numbers and rows of different lengths.
    """
    import numpy as np

    try:
        found = np.asarray(values)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {shorten(values)}: must be an array of numbers") from None
    if found.size and found.dtype.kind not in "iuf":
        raise InputError(f"{name} = {shorten(values)}: must be an array of numbers")
    return found.astype(float)


def shorten(value: Any) -> str:
    """``value`` for a message: on one line, and not too long."""
    try:
        text = f"{value:g}" if isinstance(value, float) else repr(value)
    except (ValueError, RecursionError):
        # Python prints neither very long integers nor what is nested as deep.
        text = f"an integer of {value.bit_length()} bits" if isinstance(value, int) else f"a {type(value).__name__}"
    text = " ".join(text.split())
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."


def _is_real(value: Any) -> bool:
    if getattr(value, "ndim", 0) != 0:
        return False
    kind = getattr(getattr(value, "dtype", None), "kind", None)
    if kind is not None:
        return kind in "iuf"
    if isinstance(value, (bool, str, bytes, bytearray)):
        return False
    return isinstance(value, numbers.Real) or (hasattr(value, "__float__") and not isinstance(value, numbers.Complex))


def _from_to(low: float, high: float) -> str:
    if math.isinf(high):
        return "" if math.isinf(low) else f" from {low:g} on"
    return f" from {low:g} to {high:g}"
