"""Parts of answers that are common to pages with and without a server."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from chuteflow.branches.results import KINDS, Branch, Curve
from chuteflow.explorer import sentences
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.quantities import NUMBERS, PLACE, Scales

_DIGITS = 7


def curve_content(found: Curve, scales: Scales | None) -> dict[str, Any]:
    """A curve as the page draws it, without the limits of the theory, which take longer to compute."""
    return {
        "branches": [_branch(branch) for branch in found.branches],
        "reason": found.reason,
        "incomplete": found.incomplete,
        "says": sentences.of_curve(found, scales),
        "kinds": KINDS,
    }


def _branch(branch: Branch) -> dict[str, Any]:
    places = {NUMBERS[name].symbol: short(getattr(branch, name)) for name in PLACE}
    special = [
        {"kind": point.kind} | {NUMBERS[name].symbol: float(getattr(point.flow, name)) for name in PLACE}
        for point in branch.special
    ]
    return places | {"density": densities(branch), "special": special}


def densities(branch: Branch) -> list[str]:
    """The kind of density of each flow of a branch.

    It changes at the onsets of inversion, which are located, so that few flows have to be evaluated.
    """
    onsets = [point.position + 1 for point in branch.special if point.kind == "density-inversion"]
    found: list[str] = []
    for first, end in pairwise([0, *onsets, len(branch.flows)]):
        stretch = branch.flows[first:end]
        kinds = {flow.density for flow in (*stretch[:1], *stretch[-1:])}
        found += [*kinds] * len(stretch) if len(kinds) == 1 else [flow.density for flow in stretch]
    return found


def limits_passed(branch: Branch) -> list[tuple[str, ...]]:
    """The limits of the theory that each flow of a branch exceeds, by name."""
    return [flow.validity.words for flow in branch.flows]


def short(values: Array) -> list[float]:
    """Numbers with as many digits as a page needs."""
    return [float(f"{value:.{_DIGITS}g}") for value in values]
