"""Derivatives of analytic functions by a step along the imaginary axis, exact to rounding.

f(x + i h) = f(x) + i h f'(x) + O(h^2): with a step whose square is far below rounding the imaginary part over the step
is the derivative, with no difference of close numbers in it (J. N. Lyness and C. B. Moler 1967, SIAM J. Numer. Anal. 4,
202-210).
"""

from __future__ import annotations

from typing import Any

import numpy as np

#: The step h. A larger one would show where values are small, as temperatures far below 1; a smaller one would
#: underflow in products with what is already tiny.
STEP = 1e-40


def stepped(value: Any, direction: Any = 1.0) -> Any:
    """``value`` a step further along ``direction``, on the imaginary axis."""
    return value + 1j * STEP * direction


def derivative(value: Any) -> Any:
    """The derivative along the step, of what a function gives at a stepped argument."""
    return np.imag(value) / STEP
