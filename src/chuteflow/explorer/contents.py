"""Parts of answers that are common to pages with and without a server."""

from __future__ import annotations

from typing import Any

from chuteflow.branches.results import KINDS, Branch, Curve
from chuteflow.explorer import sentences
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.flow import rough_kinds
from chuteflow.steady.kinds import density_kind
from chuteflow.steady.quantities import NUMBERS, PLACE, Scales

_DIGITS = 7
#: A rough density excess nearer to zero than this does not tell the kind.
_UNSURE = 1e-5


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

    Flows whose rough density excess is close to zero are evaluated.
    """
    excess = rough_kinds([flow.solution for flow in branch.flows])[:, 0]
    return [
        density_kind(rough) if abs(rough) > _UNSURE else flow.density
        for flow, rough in zip(branch.flows, excess.tolist(), strict=True)
    ]


def find_limits_passed(branch: Branch) -> list[tuple[str, ...]]:
    """The limits of the theory that each flow of a branch exceeds, by name."""
    return [flow.validity.words for flow in branch.flows]


def short(values: Array) -> list[float]:
    """Numbers with as many digits as a page needs."""
    return [float(f"{value:.{_DIGITS}g}") for value in values]
