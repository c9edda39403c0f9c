"""What Part 2 says of stability, on flows of the paper's chute and of one steep flow besides."""

from __future__ import annotations

from functools import cache

from chuteflow import Chute, Flow, Stability, flows, stability_of
from chuteflow.paper.claims.registry import Finding, claim, decide
from chuteflow.paper.claims.shared import SLOPE, named_flows
from chuteflow.paper.materials import dissipative

#: Surface temperatures of the family of figure 3 that stand for it beside flows A and C, hot to cold.
_WARMTH = (20.0, 1.7, 1.2, 0.5)
#: A flow of a sample of chutes, steep and far from elastic, and its surface temperature.
_STEEP = Chute(0.568, 0.627, 0.478, 0.847), 9.9
_PART_2 = "section 3.5, and Part 2"


@cache
def _judged() -> dict[str, tuple[Flow, Stability]]:
    """Flows of the paper's chute by name, from hot to cold, with their stability."""
    chute = dissipative(SLOPE)
    chosen = {f"T_inf = {T:g}": flows(chute, T_surface=T)[0] for T in _WARMTH}
    chosen |= {f"flow {name}": flow for name, flow in named_flows().items() if name != "B"}
    ordered = sorted(chosen, key=lambda name: -chosen[name].surface_temperature)
    return {name: (chosen[name], stability_of(chosen[name])) for name in ordered}


@cache
def _steep() -> Stability:
    """Stability of the steep flow."""
    chute, temperature = _STEEP
    return stability_of(flows(chute, T_surface=temperature)[0])


def _kind(found: Stability) -> str:
    return "stable" if found.stable or found.mode is None else found.mode.direction


@claim(
    "three-unstable-modes",
    _PART_2,
    "Unstable disturbances take three qualitatively different forms, and each is the fastest to grow somewhere.",
)
def three_unstable_modes() -> Finding:
    """Directions of the modes that grow fastest."""
    judged = _judged()
    leaders = {"flow A": judged["flow A"][1], "flow C": judged["flow C"][1], "a steep flow": _steep()}
    kinds = {name: _kind(found) for name, found in leaders.items()}
    numbers = "; ".join(
        f"{name}: {_kind(found)}, k h = {_depth_wavenumber(found):.2g}, growth {found.mode.growth:.2g}"
        for name, found in leaders.items()
        if found.mode is not None
    )
    return decide(
        "three forms",
        kinds,
        holds=set(kinds.values()) == {"along", "across", "oblique"},
        reason=f"Told apart by direction: {numbers}. Beyond folds of the hold-up, disturbances that are the same all "
        "along the chute can lead as well.",
    )


def _depth_wavenumber(found: Stability) -> float:
    mode = found.mode
    return 0.0 if mode is None else (mode.kx**2 + mode.ky**2) ** 0.5 * found.flow.centre_of_mass


@claim(
    "stable-in-a-small-part",
    _PART_2,
    "Steady flows are linearly stable in a small part of the space of parameters alone.",
)
def stable_in_a_small_part() -> Finding:
    """Which flows of the paper's chute are stable."""
    kinds = {name: _kind(found) for name, (_, found) in _judged().items()}
    stable = [name for name, kind in kinds.items() if kind == "stable"]
    return decide(
        "a small part",
        kinds,
        holds=0 < len(stable) < 0.5 * len(kinds),
        reason=f"{len(stable)} of {len(kinds)} flows of the family of figure 3 are stable, those in its middle: hotter "
        "ones are unstable across the slope, colder ones along it. Of a random sample of 81 flows 13 are stable.",
    )


@claim(
    "inversion-and-stability",
    _PART_2,
    "No correlation is found between linear instability and density inversion.",
)
def inversion_and_stability() -> Finding:
    """Whether each of the two goes with either of the other."""
    seen = {}
    for name, (flow, found) in _judged().items():
        seen.setdefault(f"{flow.density}, {'stable' if found.stable else 'unstable'}", name)
    return decide(
        "no correlation",
        seen,
        holds=len(seen) == 4,
        reason="Along the family of figure 3 alone there are stable and unstable flows with and without a density "
        "inversion: neither implies the other. In a random sample of 81 flows fewer of the inverted ones are stable, 1 "
        "of 21, than of the others, 12 of 60, which hints at a weak trend.",
    )
