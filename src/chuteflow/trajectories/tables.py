"""The functions of ln x that trajectories need, on a fine uniform grid.

# notation: L = ln x, y = q/(p sqrt(T)), a, k, net = loss - s^2 work as in chuteflow.steady.model, b the heat flux y
# that a base would give.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from chuteflow.numerics.tabulate import Array, FunctionTable
from chuteflow.steady.model import CONDUCTION, COUPLING, DENSITY, GAMMA, LOSS, WORK, Model, evaluate_closures

#: The table runs over LOW <= ln x <= LOW + (ENTRIES - 1)/PER_UNIT; outside, the functions are constant.
LOW, PER_UNIT, ENTRIES = -25.0, 48.0, 4096
#: Columns of a table: 1/a, k, net, b; what the heights and velocities are integrals of, x/nu and work exp(Gamma/2); and
#: beta, the same in all rows.
INVERSE, COUPLED, NET, BASE, HEIGHT, SHEARING, BETA = range(7)
#: Columns of the bounds: see :class:`Tables`.
(
    NET_LOW, NET_HIGH, CURVE_LOW, CURVE_HIGH, RELAX_HIGH, SPREAD, BASE_LOW, BASE_HIGH,
    NET_ABOVE, CURVE_ABOVE, RELAX_ABOVE, BASE_ABOVE,
) = range(12)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Tables:
    """What the trajectories of one model need.

    ``values`` (entries, 7) are the functions; ``bounds`` (entries, 12) are extrema of them over all smaller L (net
    from both sides, A = (1 - k)/(2 a) from both sides, the largest c = 1 + ((1 + beta) k - beta)/2, the largest
    (1 + beta) a, b from both sides) and over all larger L (the largest net, the smallest A, the largest c, the
    smallest b). ``rate`` is the fastest
    rate of y in p, and ``scale`` the size of heat fluxes y.
    """

    values: Array
    bounds: Array
    rate: float
    scale: float


@lru_cache(maxsize=4)
def _closures(table: FunctionTable) -> Array:
    """The closures (8, entries) of all chutes with the same grains."""
    f, _ = evaluate_closures(table, np.exp(LOW + np.arange(ENTRIES) / PER_UNIT))
    return f


@lru_cache(maxsize=64)
def tables(model: Model) -> Tables:
    """The tables of ``model``."""
    f = _closures(model.table)
    conduction, coupling = f[CONDUCTION], f[COUPLING]
    net = f[LOSS] - model.slope**2 * f[WORK]
    base = model.base_flux(f)
    height, shearing = np.exp(-f[DENSITY]), f[WORK] * np.exp(0.5 * f[GAMMA])
    columns = [1.0 / conduction, coupling, net, base, height, shearing, np.full_like(net, model.beta)]
    values = np.stack(columns, axis=1)
    curve = 0.5 * (1.0 - coupling) / conduction
    relax = 1.0 + 0.5 * (coupling * (1.0 + model.beta) - model.beta)
    lowest, highest = np.minimum.accumulate, np.maximum.accumulate
    bounds = np.stack(
        [
            lowest(net), highest(net), lowest(curve), highest(curve), highest(relax),
            highest(conduction) * (1.0 + model.beta), lowest(base), highest(base),
            highest(net[::-1])[::-1], lowest(curve[::-1])[::-1], highest(relax[::-1])[::-1], lowest(base[::-1])[::-1],
        ],
        axis=1,
    )  # fmt: skip
    rate = float(np.sqrt(2.0 * np.abs(net) / conduction).max())
    return Tables(values, bounds, rate, model.flux_scale)


def base_table(model: Model) -> Array:
    """The heat flux that the base of ``model`` would give, (entries, 1)."""
    return np.ascontiguousarray(model.base_flux(_closures(model.table))[:, None])


def bounds_for(model: Model, bases: Array) -> Array:
    """The bounds of the grains, slope and surface of ``model`` that hold for every base whose heat flux lies between
    those of some, ``bases`` (entries, K)."""
    bounds = tables(model).bounds.copy()
    low, high = bases.min(axis=1), bases.max(axis=1)
    bounds[:, BASE_LOW] = np.minimum.accumulate(low)
    bounds[:, BASE_HIGH] = np.maximum.accumulate(high)
    bounds[:, BASE_ABOVE] = np.minimum.accumulate(low[::-1])[::-1]
    return bounds


def envelope(models: Sequence[Model]) -> Array:
    """The least and the largest heat flux that the bases of ``models`` with the same grains give, (entries, 2)."""
    every = np.concatenate([base_table(one) for one in models], axis=1)
    return np.stack([every.min(axis=1), every.max(axis=1)], axis=1)
