"""Stability among the quantities of a study: flows are solved one by one, and their stability is computed, about two
seconds for each."""

from __future__ import annotations

from collections.abc import Sequence

from chuteflow.errors import ChuteflowError
from chuteflow.steady.flow import Flow

#: Kinds, as their names in order of their flags, and numbers with what they are.
STABILITY_KINDS = {"stable": ("unstable", "stable"), "mode": ("along", "across", "oblique", "uniform")}
STABILITY_NUMBERS = {
    "growth": "growth rate of the mode that grows fastest, in sqrt(g cos(theta)/d)",
    "kx": "its wavenumber along the slope, in 1/d",
    "ky": "its wavenumber across the slope, in 1/d",
}
#: Points of a chunk, unless a study says otherwise.
STABILITY_CHUNK = 16


def needs_stability(names: Sequence[str]) -> bool:
    """Whether the stability of flows has to be computed for the quantities ``names``."""
    return any(name in STABILITY_KINDS or name in STABILITY_NUMBERS for name in names)


def stability_quantities(flow: Flow) -> tuple[dict[str, float], str | None]:
    """What is known of the stability of ``flow`` by name, kinds as their flags, and why it is not known.

    What is not known, and the mode where the continuous spectrum hides all of them, is left out.
    """
    from chuteflow.stability.result import stability_of

    try:
        found = stability_of(flow)
    except ChuteflowError as error:
        return {}, str(error)
    out = {} if found.stable is None else {"stable": float(found.stable)}
    if found.mode is not None:
        out |= {
            "mode": float(STABILITY_KINDS["mode"].index(found.mode.direction)),
            "growth": found.mode.growth,
            "kx": found.mode.kx,
            "ky": found.mode.ky,
        }
    if found.stable is not None:
        return out, None
    return (
        out,
        f"whether a disturbance grows is not resolved at {len(found.unresolved)} wavenumbers, and nothing else grows",
    )
