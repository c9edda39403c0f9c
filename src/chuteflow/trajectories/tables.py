"""The functions of ln x that trajectories need, on a fine uniform grid.

# notation: L = ln x, y = q/(p sqrt(T)), a, k, net = loss - s^2 work as in chuteflow.steady.model, b the heat flux y
# that a base would give.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from chuteflow.numerics.compiled import compiled
from chuteflow.numerics.tabulate import Array, FunctionTable
from chuteflow.steady.model import CONDUCTION, COUPLING, DENSITY, GAMMA, LOSS, WORK, Model, closure_coordinate

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
    rate of y in p, ``steepest`` the largest slope of b, and ``scale`` the size of heat fluxes y.
    """

    values: Array
    bounds: Array
    rate: float
    steepest: float
    scale: float


@lru_cache(maxsize=1)
def _coordinates() -> Array:
    """Of the entries, in the tables of closures."""
    return closure_coordinate(np.exp(LOW + np.arange(ENTRIES) / PER_UNIT))


@lru_cache(maxsize=4)
def _closures(table: FunctionTable) -> Array:
    """The closures (8, entries) of all chutes with the same grains."""
    return table.values(_coordinates())


@lru_cache(maxsize=8)
def tables(model: Model) -> Tables:
    """The tables of ``model``."""
    f = _closures(model.table)
    values, bounds, rate, steepest = _tabulate(
        f, model.base_flux(f), np.exp(-f[DENSITY]), np.exp(0.5 * f[GAMMA]), float(model.slope), float(model.beta)
    )
    return Tables(values, bounds, rate, steepest, model.flux_scale)


@compiled
def _tabulate(f: Any, base: Any, height: Any, root: Any, slope: float, beta: float) -> tuple[Any, Any, float, float]:
    """Functions, bounds, the fastest rate and the largest slope of b, see :class:`Tables`, from the closures (8,
    entries), the heat flux (entries,) that the base would give, x/nu and exp(Gamma/2)."""
    entries = len(base)
    values = np.empty((entries, 7))
    bounds = np.empty((entries, 12))
    rate = steepest = 0.0
    net_low = curve_low = base_low = np.inf
    net_high = curve_high = base_high = relax_high = spread = -np.inf
    for i in range(entries):
        conduction, coupling = f[CONDUCTION, i], f[COUPLING, i]
        net = f[LOSS, i] - slope * slope * f[WORK, i]
        inverse = 1.0 / conduction
        values[i, INVERSE] = inverse
        values[i, COUPLED] = coupling
        values[i, NET] = net
        values[i, BASE] = base[i]
        values[i, HEIGHT] = height[i]
        values[i, SHEARING] = f[WORK, i] * root[i]
        values[i, BETA] = beta
        curve = 0.5 * (1.0 - coupling) * inverse
        relax = 1.0 + 0.5 * (coupling * (1.0 + beta) - beta)
        net_low, net_high = min(net_low, net), max(net_high, net)
        curve_low, curve_high = min(curve_low, curve), max(curve_high, curve)
        base_low, base_high = min(base_low, base[i]), max(base_high, base[i])
        relax_high = max(relax_high, relax)
        spread = max(spread, conduction * (1.0 + beta))
        rate = max(rate, 2.0 * abs(net) * inverse)
        steepest = max(steepest, abs(base[i] - base[max(i - 1, 0)]) * PER_UNIT)
        bounds[i, NET_LOW], bounds[i, NET_HIGH] = net_low, net_high
        bounds[i, CURVE_LOW], bounds[i, CURVE_HIGH] = curve_low, curve_high
        bounds[i, RELAX_HIGH], bounds[i, SPREAD] = relax_high, spread
        bounds[i, BASE_LOW], bounds[i, BASE_HIGH] = base_low, base_high
        bounds[i, NET_ABOVE], bounds[i, CURVE_ABOVE] = net, curve
        bounds[i, RELAX_ABOVE], bounds[i, BASE_ABOVE] = relax, base[i]
    for i in range(entries - 2, -1, -1):
        for highest in (NET_ABOVE, RELAX_ABOVE):
            bounds[i, highest] = max(bounds[i, highest], bounds[i + 1, highest])
        for lowest in (CURVE_ABOVE, BASE_ABOVE):
            bounds[i, lowest] = min(bounds[i, lowest], bounds[i + 1, lowest])
    return values, bounds, math.sqrt(rate), steepest


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
