"""Section 3.6, figures 5 and 6: flows whose interior makes energy, and whose base takes it."""

from __future__ import annotations

import numpy as np

from chuteflow import Flow, flows, hot
from chuteflow.paper.claims.registry import Finding, claim, decide
from chuteflow.paper.claims.shared import MASS_FLUX, PRODUCTIVE, SLOPE, all_flows, count, curve_of, folds
from chuteflow.paper.materials import dissipative, productive


def _at_three() -> Flow:
    return flows(productive(0.4), Q=MASS_FLUX)[0]


@claim(
    "productive-interior",
    "section 3.6, figure 6",
    "With e = 0.9, e_w = 0.6, r = 0.8, flows on slopes from 0.4 to 0.44 are productive inside, and the base takes "
    "energy.",
)
def productive_interior() -> Finding:
    """Kinds of interior, and the largest heat flux from the base over p sqrt(T)."""
    found = [flow for slope in PRODUCTIVE for flow in all_flows(curve_of(productive(slope)))]
    kinds = {flow.interior for flow in found}
    flux = max(float(flow.profile(0.0).heat_flux) for flow in found)
    return decide(
        "productive",
        " or ".join(sorted(kinds)),
        holds=kinds == {"productive"} and flux < 0.0,
        reason=f"All {len(found)} flows traced, with T_inf from 0.001 to 10000; the heat flux from the base is "
        "negative in each."
        if flux < 0.0
        else "The base gives energy to some flow.",
    )


@claim(
    "productive-temperature",
    "section 3.6, figure 5(b)",
    "In a productive flow the temperature rises with height, has its maximum inside, and decays to T_inf from above.",
)
def productive_temperature() -> Finding:
    """Temperatures at the base, at the maximum and far above, at tan(theta) = 0.4 and Q = 3."""
    flow = _at_three()
    z = np.linspace(0.0, 2.0 * flow.depth, 2001)
    T = flow.profile(z).granular_temperature
    top = int(np.argmax(T))
    return decide(
        "maximum inside",
        {
            "T at base": flow.base_temperature,
            "largest T": float(T[top]),
            "at z": float(z[top]),
            "T_inf": flow.surface_temperature,
        },
        holds=0 < top < len(z) - 1 and T[0] < T[top] and T[top] > flow.surface_temperature * (1.0 + 10.0 * flow.error),
        reason=f"The maximum exceeds T_inf by {T[top] / flow.surface_temperature - 1.0:.0e} of it, which takes a very "
        "close inspection to see.",
    )


@claim(
    "productive-one-to-one",
    "section 3.6, figure 6",
    "On slopes from 0.4 to 0.44 of the productive chute there is one flow at each mass flux, and h and Q are "
    "one-to-one.",
)
def productive_one_to_one() -> Finding:
    """Whether there are folds, and several branches."""
    found = {slope: curve_of(productive(slope)) for slope in PRODUCTIVE}
    single = all(len(c.branches) == 1 and not folds(c) for c in found.values())
    monotonic = all(bool(np.all(np.diff(c.branches[0].centre_of_mass) < 0.0)) for c in found.values())
    return decide(
        1.0,
        float(max(count(c, MASS_FLUX) for c in found.values())),
        holds=single and monotonic,
        reason="Every curve is one branch without folds, along which Q and h fall together with T_inf.",
    )


@claim(
    "productive-steeper",
    "section 3.6",
    "Productive flows are found on a range of slopes, typically steeper than for dissipative flows.",
)
def productive_steeper() -> Finding:
    """The slopes with hot flows of both chutes."""
    bounds = {"productive": hot(productive(SLOPE)).slope_bounds, "dissipative": hot(dissipative(SLOPE)).slope_bounds}
    known = {name: b for name, b in bounds.items() if b is not None and b.interior == name}
    return decide(
        "steeper",
        {name: f"{b.lowest:.4g} to {b.highest:.4g}" for name, b in known.items()},
        holds=len(known) == 2
        and known["productive"].lowest > known["dissipative"].lowest
        and known["productive"].highest > known["dissipative"].highest,
        reason="Slopes with hot flows of the materials of figures 6 and 4, in closed form.",
    )


@claim(
    "productive-multiplicity",
    "section 3.6",
    "On more gentle slopes productive flows are multiple, in a small part of parameter space.",
)
def productive_multiplicity() -> Finding:
    """Folds of the productive chute by slope, and the kinds of interior there."""
    slopes = (0.3, 0.32, 0.33, 0.35, 0.37, 0.39)
    found = {slope: curve_of(productive(slope)) for slope in slopes}
    multiple = [slope for slope in slopes if folds(found[slope])]
    flux = max(float(flow.profile(0.0).heat_flux) for slope in multiple for flow in all_flows(found[slope]))
    kinds = {flow.interior for slope in multiple for flow in all_flows(found[slope])}
    return decide(
        "multiple on gentle slopes",
        {f"{slope:g}": f"{len(folds(found[slope]))} folds of Q" for slope in slopes},
        holds=bool(multiple) and max(multiple) < min(PRODUCTIVE) and flux < 0.0 and "dissipative" not in kinds,
        reason=f"Where flows are multiple, the base takes energy, so that the interior makes it on the whole; it is "
        f"{' or '.join(sorted(kinds))}, with dissipation in some of its depth. Flows that are productive at every "
        "height are single on all slopes from 0.35 on.",
    )
