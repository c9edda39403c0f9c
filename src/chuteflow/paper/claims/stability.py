"""What Part 2 says of stability, on flows of the paper's chute and of one steep flow besides."""

from __future__ import annotations

from functools import cache

from chuteflow import Chute, Flow, Stability, flows, stability_of
from chuteflow.paper.claims.registry import Finding, claim, decide
from chuteflow.paper.claims.shared import SLOPE, named_flows
from chuteflow.paper.materials import dissipative
from chuteflow.stability.budget import ModeBudget, energy_budget

#: Surface temperatures of the branch of figure 3 that stand for it beside flows A and C, hot to cold.
_WARMTH = (20.0, 1.7, 1.2, 0.5)
#: A flow of a sample of chutes, steep and far from elastic, and its surface temperature.
_STEEP = Chute(0.568, 0.627, 0.478, 0.847), 9.9
#: Flows in which something else may feed what grows: steep with a wave along, and dense with short waves.
_STEEP_ALONG = Chute(0.54, 0.672, 0.532, 0.863), 6.607
_VORTICES = Chute(0.283, 0.892, 0.715, 0.555), 238.0
_LOSS = ("collisional loss by density", "collisional loss by temperature")
_PART_2 = "section 3.5, and Part 2"


@cache
def _stability_of_flows() -> dict[str, tuple[Flow, Stability]]:
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
    if found.stable is None:
        return "unknown"
    return "stable" if found.stable or found.mode is None else found.mode.direction


@claim(
    "three-unstable-modes",
    _PART_2,
    "Unstable disturbances take three qualitatively different forms, and each is the fastest to grow somewhere.",
)
def three_unstable_modes() -> Finding:
    """Directions of the modes that grow fastest."""
    found_by_name = _stability_of_flows()
    leaders = {"flow A": found_by_name["flow A"][1], "flow C": found_by_name["flow C"][1], "a steep flow": _steep()}
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
    kinds = {name: _kind(found) for name, (_, found) in _stability_of_flows().items()}
    stable = [name for name, kind in kinds.items() if kind == "stable"]
    return decide(
        "a small part",
        kinds,
        holds=0 < len(stable) < 0.5 * len(kinds),
        reason=f"{len(stable)} of {len(kinds)} flows of the branch of figure 3 are stable, those in its middle: hotter "
        "ones are unstable across the slope, colder ones along it. Of a random sample of 82 flows 13 are stable.",
    )


@claim(
    "inversion-and-stability",
    _PART_2,
    "No correlation is found between linear instability and density inversion.",
)
def inversion_and_stability() -> Finding:
    """Whether each of the two goes with either of the other."""
    seen = {}
    for name, (flow, found) in _stability_of_flows().items():
        if found.stable is not None:
            seen.setdefault(f"{flow.density}, {'stable' if found.stable else 'unstable'}", name)
    return decide(
        "no correlation",
        seen,
        holds=len(seen) == 4,
        reason="Along the branch of figure 3 alone there are stable and unstable flows with and without a density "
        "inversion: neither implies the other. In a random sample of 82 flows fewer of the inverted ones are stable, 1 "
        "of 22, than of the others, 12 of 60, which hints at a weak trend.",
    )


@cache
def _budgets() -> dict[str, ModeBudget]:
    """Energy budgets of the fastest modes: of one of each kind, and of two where something else may feed it."""
    found_by_name = _stability_of_flows()
    chute, temperature = _STEEP_ALONG
    vortices, flux = _VORTICES
    (inverted,) = (flow for flow in flows(vortices, Q=flux) if flow.density == "inverted")
    fastest = {
        "flow A": found_by_name["flow A"][1],
        "flow C": found_by_name["flow C"][1],
        "a steep flow": _steep(),
        "a steep flow, along": stability_of(flows(chute, T_surface=temperature)[0]),
        "an inverted flow, short waves": stability_of(inverted),
    }
    return {name: energy_budget(found.mode) for name, found in fastest.items() if found.mode is not None}


def _source(budget: ModeBudget) -> tuple[str, float]:
    """What feeds a mode most: the collisional loss, both of its parts together, or another term, and its rate."""
    rates = {term.name: term.total for term in budget.terms if term.name not in _LOSS}
    rates["collisional loss"] = budget.rate(*_LOSS)
    name = max(rates, key=lambda term: rates[term])
    return name, rates[name]


@claim("inelastic-clustering", _PART_2, "Inelastic clustering is the dominant mechanism of the instabilities.")
def inelastic_clustering() -> Finding:
    """Whether the collisional loss, larger where grains are dense, feeds the modes most."""
    budgets = _budgets()
    sources = {name: _source(budget)[0] for name, budget in budgets.items()}
    clusters = {name for name, source in sources.items() if source == "collisional loss"}
    numbers = "; ".join(
        f"{name} ({budget.mode.direction}, growth {budget.mode.growth:.2g}): {source} {rate:.2g}"
        + ("" if name in clusters else f", collisional loss {budget.rate(*_LOSS):.2g}")
        for name, budget in budgets.items()
        for source, rate in [_source(budget)]
    )
    return decide(
        "dominant",
        sources,
        holds=clusters == set(sources),
        reason=f"The largest source of energy of the mode that grows fastest: {numbers}.",
        # The terms are integrals over the mode; they add up to its eigenvalue, which they know nothing of.
        corrected=clusters >= {"flow A", "flow C", "a steep flow"}
        and all(abs(budget.closure) < 1e-3 * budget.mode.growth for budget in budgets.values()),
        correction="It is so for a mode of each kind, along, across and oblique, in long waves. It is not so "
        "everywhere: gravity feeds some waves along steep chutes, and the shear of the flow feeds short waves.",
    )
