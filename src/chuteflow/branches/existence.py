"""Why there is no flow: where energy cannot balance, or where the branches that exist do not lead.

# notation: y = q/(p sqrt(T)) heat flux, base(nu) the flux that the base gives, net = loss - s^2 work.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from chuteflow.branches.ranges import SearchRange
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.model import LOSS, WORK, Model
from chuteflow.theory.hot import LAMBDA_C, dilute, hot_parameters

_NAMES = ("Q", "h", "M", "T_surface")
_DENSITIES = np.append(0.0, np.logspace(-9.0, 12.0, 2000))


def explain_none_found(model: Model, branches: Sequence[Array], which: int, value: float, within: SearchRange) -> str:
    """One sentence on why no flow was found, given the quantities (k, 4) of the branches that were."""
    if branches:
        spans = [np.exp([_least(f, f[:, which]), -_least(f, -f[:, which])]) for f in branches]
        ranges = " and ".join(f"{low:.3g} to {high:.3g}" for low, high in sorted(map(tuple, spans)))
        name = _NAMES[which]
        return f"no flow has {name} = {value:g}: those of this chute have about {ranges} ({_describe_range(within)})"
    return f"{explain_imbalance(model)} ({_describe_range(within)})"


def _least(places: Array, values: Array) -> float:
    """The least of ``values`` (k,) along a branch through ``places`` (k, 4), by the parabola through the smallest of
    them and its neighbours."""
    i = int(values.argmin())
    if not 0 < i < len(values) - 1:
        return float(values[i])
    before, after = (float(np.linalg.norm(places[k] - places[i])) for k in (i - 1, i + 1))
    if before == 0.0 or after == 0.0:
        return float(values[i])
    down, up = (values[i - 1] - values[i]) / before, (values[i + 1] - values[i]) / after
    bend = (down + up) / (before + after)
    slope = up - bend * after
    return float(values[i] - (0.25 * slope**2 / bend if bend > 0.0 else 0.0))


def explain_imbalance(model: Model) -> str:
    """What keeps energy from balancing on a chute without flows."""
    chute = model.chute
    f, _ = model.closures(_DENSITIES)
    net = f[LOSS] - model.slope**2 * f[WORK]
    base = model.base_flux(f)
    free = model.surface_stress == 0.0
    if free and net.min() >= 0.0 and base.max() <= 0.0:
        return "base and interior both lose energy at every density: nothing keeps the grains agitated"
    if net.max() <= 0.0 and base.min() >= 0.0:
        if chute.restitution == 1.0:
            return (
                "elastic grains lose no energy inside, so that only flows with a base that takes energy "
                "remain, and this base gives energy at every density: lower e_w or the slope"
            )
        return "base and interior both gain energy at every density: nothing takes it away"
    if model.beta != 0.0:
        # The hot limit is known for laws with a temperature far above.
        return "no flow balances the energy gained and lost"
    limit = dilute(model.law, chute.restitution, chute.slope)
    hot = hot_parameters(limit, chute.wall_restitution, chute.roughness, chute.slope, model.base)
    if hot.delta > 0.0 and hot.F21 > 0.0 and hot.lambda_ > LAMBDA_C:
        return (
            f"the slope is too steep: lambda = {hot.lambda_:.4g} > 3, so that the base gives more energy "
            "than a hot flow can lose, and no colder flow was found"
        )
    if hot.delta > 0.0 >= hot.F21:
        return "hot flows lose energy inside and at the base, and no colder flow balances"
    if hot.delta < 0.0 <= hot.F21:
        return "hot flows gain energy inside and at the base, and no colder flow balances"
    return "no flow balances the energy gained and lost"


def _describe_range(within: SearchRange) -> str:
    return (
        f"searched: surface temperatures {within.coldest:.3g} to {within.hottest:.3g}, hold-ups to {within.deepest:.3g}"
    )
