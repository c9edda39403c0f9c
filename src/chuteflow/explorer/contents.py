"""Parts of answers that pages with and without a server share."""

from __future__ import annotations

from typing import Any

from chuteflow.branches.results import KINDS, Curve
from chuteflow.explorer import sentences
from chuteflow.io import contract
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.quantities import NUMBERS, PLACE, Scales

_DIGITS = 7


def curve_content(found: Curve, scales: Scales | None) -> dict[str, Any]:
    """A curve as the page draws it."""
    content = contract.curve_object(found)
    for branch, entry in zip(found.branches, content["branches"], strict=True):
        entry |= {NUMBERS[name].symbol: short(getattr(branch, name)) for name in PLACE}
        entry["density"] = [flow.density for flow in branch.flows]
        # The page shows where the limits are passed, without the numbers behind it.
        entry["validity"] = {"words": entry["validity"]["words"]}
    return content | {"says": sentences.of_curve(found, scales), "kinds": KINDS}


def short(values: Array) -> list[float]:
    """Numbers with as many digits as a page needs."""
    return [float(f"{value:.{_DIGITS}g}") for value in values]
