"""The appendix, figures 15 to 17: Fourier's heat flux, with g4 = 0."""

from __future__ import annotations

import numpy as np

from chuteflow.paper.claims.far_field import decay_rate, dilute_limits, excess, net_production, thin_limit
from chuteflow.paper.claims.model import allowed_restitutions
from chuteflow.paper.claims.registry import Finding, claim, close, decide
from chuteflow.paper.claims.shared import NAMES, SLOPE, curve_of, flows_at, folds, named_flows
from chuteflow.paper.materials import dissipative
from chuteflow.theory.hot import dilute
from chuteflow.theory.laws import law

_FIELDS = {"nu": "volume_fraction", "T": "granular_temperature", "u": "velocity"}


@claim(
    "fourier-three-flows",
    "appendix, figure 15",
    "With g4 = 0 the three flows at Q = 3 persist, with the same character.",
)
def fourier_three_flows() -> Finding:
    """The three flows, their kinds and relative changes of h."""
    full, fourier = flows_at(), flows_at(closure="lun-fourier")
    kinds = [[(flow.density, flow.interior) for flow in found] for found in (full, fourier)]
    changes = {
        name: b.centre_of_mass / a.centre_of_mass - 1.0 for name, a, b in zip(NAMES, full, fourier, strict=False)
    }
    return decide(
        3.0,
        float(len(fourier)),
        holds=len(fourier) == 3 and kinds[0] == kinds[1],
        reason="Kinds of density and interior are the same; h changes by "
        + ", ".join(f"{value:.1%} in {name}" for name, value in changes.items())
        + ".",
    )


@claim(
    "fourier-temperature",
    "appendix, figure 15",
    "The difference is most apparent in the temperature profiles.",
)
def fourier_temperature() -> Finding:
    """Largest changes of the fields over their maxima."""
    changes = {}
    for name, flow in named_flows().items():
        z = np.linspace(0.0, flow.depth, 201)
        a, b = flow.profile(z), named_flows(closure="lun-fourier")[name].profile(z)
        changes[name] = {
            symbol: float(np.abs(getattr(b, field) - getattr(a, field)).max() / getattr(a, field).max())
            for symbol, field in _FIELDS.items()
        }
    led = [name for name, row in changes.items() if max(row, key=lambda symbol: row[symbol]) == "T"]
    return decide(
        "temperature",
        {name: ", ".join(f"{symbol} {value:.1%}" for symbol, value in row.items()) for name, row in changes.items()},
        holds=led == list(NAMES),
        reason="Largest changes of nu, T and u over their maxima, up to the depth at which nu is 1 % of its maximum.",
    )


@claim(
    "temperature-gradient-dominates",
    "appendix, figure 16",
    "The heat flux along temperature gradients dominates that along density gradients in each of the three flows.",
)
def temperature_gradient_dominates() -> Finding:
    """The ratio of the parts of the heat flux, where that is largest and far above."""
    main, far = {}, {}
    for name, flow in named_flows().items():
        at = flow.profile(np.linspace(0.0, 3.0 * flow.depth, 1201))
        fraction = np.abs(at.density_heat_flux / at.conductive_heat_flux)
        mass = at.heat_flux > 0.5 * at.heat_flux.max()
        main[name], far[name] = float(fraction[mass].max()), float(fraction[-1])
    return decide(
        "dominates",
        {
            **{f"{name}, large flux": value for name, value in main.items()},
            **{f"{name}, far": v for name, v in far.items()},
        },
        holds=max(main.values()) < 0.5 and max(far.values()) < 0.5,
        corrected=max(main.values()) < 0.5 and all(close(value, 1.0, 0.05) for value in far.values()),
        reason="The density part over the temperature part: the most where the heat flux exceeds half of its maximum, "
        "and far above.",
        correction="It does where the heat flux is large. Far above, where the flux falls like nu^2 (3.25) and its "
        "parts like nu, the two cancel and are equal.",
    )


@claim(
    "far-temperature-fourier",
    "appendix, (A 2)",
    "With g4 = 0, T = T_inf - a^2/(4 g30) (tan^2(theta)/g20 - g52) T_inf^3 exp(-2 z/T_inf) far above the base.",
)
def far_temperature_fourier() -> Finding:
    """The excess of temperature over T_inf^3 nu^2, with Fourier's heat flux."""
    printed = -net_production() / (4.0 * dilute_limits().g30)
    found = {
        name: thin_limit(
            flow, lambda at, f=flow: excess(at, f) / (f.surface_temperature**2 * at.volume_fraction), 1e-3 / (i + 1)
        )
        for (i, name), flow in zip(enumerate(NAMES), named_flows(closure="lun-fourier").values(), strict=True)
    }
    return decide(
        printed,
        found,
        holds=all(close(value, printed, 2e-2) for value in found.values()),
        reason="(T - T_inf)/(T_inf^3 nu^2) in the three flows with g4 = 0.",
    )


@claim(
    "fourier-decays-faster",
    "appendix, figure 15",
    "The temperature decays more rapidly to its far-field value if g4 = 0.",
)
def fourier_decays_faster() -> Finding:
    """Rates of decay of T - T_inf, times T_inf, with either heat flux."""
    full, fourier = (
        {
            name: decay_rate(flow, lambda at, f=flow: at.granular_temperature - f.surface_temperature, 1e-4)
            for name, flow in named_flows(closure=closure).items()
        }
        for closure in ("lun", "lun-fourier")
    )
    return decide(
        "faster",
        {f"{name}, {what}": rate for what, part in (("g4", full), ("no g4", fourier)) for name, rate in part.items()},
        holds=all(fourier[name] > 1.5 * full[name] for name in NAMES),
        reason="Rates of decay of T - T_inf where nu is near 1e-4, in units of 1/T_inf: 1 by (A 1) and 2 by (A 2).",
    )


@claim("fourier-curve", "appendix, figure 17", "The character of the Q-h curve is unaffected by taking g4 = 0.")
def fourier_curve() -> Finding:
    """The folds with either heat flux."""
    full, fourier = (folds(curve_of(dissipative(SLOPE, closure=closure))) for closure in ("lun", "lun-fourier"))
    return decide(
        {"from Q": full[0], "to Q": full[-1]},
        {"from Q": fourier[0], "to Q": fourier[-1]},
        holds=len(full) == len(fourier) == 2 and all(close(b, a, 0.1) for a, b in zip(full, fourier, strict=True)),
        reason="Ends of the range with three flows at tan(theta) = 0.3, with g4 and with g4 = 0.",
    )


@claim(
    "less-elastic-grains",
    "appendix",
    "If the grains are made less elastic the density part of the heat flux becomes more important, as g4 ~ (1 - e).",
)
def less_elastic_grains() -> Finding:
    """g40/g30 over all e of the law, against 1.2 e (1 - e^2), which follows from table 2."""
    e = np.array(allowed_restitutions())
    limits = [dilute(law("lun"), value, SLOPE) for value in e.tolist()]
    ratio = np.array([limit.g40 / limit.g30 for limit in limits])
    top = float(e[np.argmax(ratio)])
    formula = bool(np.allclose(ratio, 1.2 * e * (1.0 - e**2), rtol=1e-12, atol=1e-15))
    return decide(
        "grows as e falls",
        {"largest g40/g30": float(ratio.max()), "at e": top},
        holds=bool(np.all(np.diff(ratio) < 0.0)),
        corrected=formula and abs(top - 3.0**-0.5) < 0.01 and top < 0.8,
        reason=f"g40/g30 = 1.2 e (1 - e^2), over e from {e[0]:g} to 1.",
        correction="It grows down to e = 1/sqrt(3), far from nearly elastic grains, and falls below.",
    )
