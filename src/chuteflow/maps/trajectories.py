"""Integration from the surface down: every trajectory of a material and slope, for all surface temperatures.

# notation: p normal stress, L = ln x, y = q/(p sqrt(T)), a, k, net = loss - s^2 work as in
# chuteflow.steady.model, tau the step variable.

For given closure, e, slope and surface the equations are an initial value problem in p, which knows nothing
of the base:

    dL/dln p = 1 - v,    v = p y/a,    dy/dln p = p net - y - y (v + k (1 - v))/2

A flow is a point of a trajectory where y equals the flux that the base gives. The trajectories are
integrated side by side by the classical Runge-Kutta method in tau, with dln p/dtau = 1/(1 + p/p_1):
logarithmic in the thin layer at the surface, uniform below. They end where nothing more can happen: hot,
when the density has vanished and y rises to its limit without meeting the base flux on its way, or cold,
when y runs to minus infinity at finite p.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.tabulate import Array
from chuteflow.steady.model import CONDUCTION, COUPLING, DENSITY, GAMMA, LOSS, WORK, Model
from chuteflow.trajectories.surface import surface_potential

#: Step in tau, and the largest step in p over the shortest length of the equations.
STEP, LENGTHS_PER_STEP = 0.25, 0.6
#: The series at the surface of the half-line is used up to this share of T, or of a length of the equations.
START = 0.05
#: Rows for thin flows, and their step in the logarithm of the overburden.
_THIN_ROWS, _THIN_STEP = 40, 0.5
#: A trajectory is called empty below this x, and cold where y is below this multiple of its scale.
EMPTY, COLD = 1e-6, 4.0
LOG_EMPTY = float(np.log(EMPTY))
_LOW, _HIGH, _ENTRIES = -25.0, 60.0, 4096
_SCALE = (_ENTRIES - 1) / (_HIGH - _LOW)


@dataclass(frozen=True, eq=False)
class ScanTable:
    """Functions of L on a fine uniform grid, for linear interpolation.

    ``pace`` (6, entries): 1/a, k, net and their increments to the next entry, which the integration needs;
    ``fields`` (10, entries): base flux, work, ln(nu/x), Gamma, slip and their increments.
    """

    pace: Array
    fields: Array

    def along(self, big_l: Array) -> tuple[Array, Array, Array]:
        """1/a, k and net at L."""
        inverse, coupling, net = _interpolated(self.pace, big_l)
        return inverse, coupling, net

    def at(self, big_l: Array) -> Array:
        """Base flux, work, ln(nu/x), Gamma and slip at L, (5, ...)."""
        return _interpolated(self.fields, big_l)

    @property
    def nodes(self) -> Array:
        """1/a, k and net at the entries, (3, entries)."""
        return self.pace[:3]


def _interpolated(table: Array, big_l: Array) -> Array:
    position = np.minimum(np.maximum((big_l - _LOW) * _SCALE, 0.0), _ENTRIES - 2.0)
    index = position.astype(np.intp)
    rows = table.take(index, axis=1)
    half = len(table) // 2
    rows[half:] *= position - index
    rows[:half] += rows[half:]
    return rows[:half]


@lru_cache(maxsize=64)
def scan_table(model: Model) -> ScanTable:
    """The scan table of ``model``."""
    f, _ = model.closures(np.exp(np.linspace(_LOW, _HIGH, _ENTRIES)))
    net = f[LOSS] - model.slope**2 * f[WORK]
    pace = np.stack([1.0 / f[CONDUCTION], f[COUPLING], net])
    fields = np.stack([model.base_flux(f), f[WORK], f[DENSITY], f[GAMMA], model.slip(f)])
    return ScanTable(_with_increments(pace), _with_increments(fields))


def _with_increments(values: Array) -> Array:
    return np.concatenate([values, np.diff(values, axis=1, append=values[:, -1:])])


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Trajectories on a structured grid: rows are steps of tau (K), columns are surface temperatures (C).

    ``temperature`` (C,); ``p``, ``big_l``, ``y`` (K, C), held constant after the end of a trajectory, with
    y = -inf after a cold one; ``last`` (C,) is the last row integrated; the first ``thin`` rows lie close to the
    surface, evenly in the logarithm of the overburden; the others evenly in tau, whose turn is ``p1``.
    """

    model: Model
    temperature: Array
    p: Array
    big_l: Array
    y: Array
    last: NDArray[np.intp]
    thin: int
    p1: float

    def tau(self, p: Array) -> Array:
        """The step variable at normal stresses ``p``, from that of p = 1 on."""
        return np.log(p) + (p - 1.0) / self.p1

    def columns(self, which: slice) -> Trajectories:
        """Some of these trajectories."""
        return replace(
            self,
            temperature=self.temperature[which],
            p=self.p[:, which],
            big_l=self.big_l[:, which],
            y=self.y[:, which],
            last=self.last[which],
        )

    def joined(self, other: Trajectories) -> Trajectories:
        """These trajectories and ``other`` ones of the same model and depth, ascending in surface temperature."""
        order = np.argsort(temperature := np.concatenate([self.temperature, other.temperature]), kind="stable")
        rows = max(len(self.p), len(other.p))

        def side_by_side(one: Array, two: Array) -> Array:
            both = (np.pad(a, ((0, rows - len(a)), (0, 0)), mode="edge") for a in (one, two))
            return np.concatenate(list(both), axis=1)[:, order]

        return replace(
            self,
            temperature=temperature[order],
            p=side_by_side(self.p, other.p),
            big_l=side_by_side(self.big_l, other.big_l),
            y=side_by_side(self.y, other.y),
            last=np.concatenate([self.last, other.last])[order],
        )


def rates(model: Model) -> tuple[float, float]:
    """Fastest rate of y in p, and the largest y at which loss and conduction balance."""
    inverse, _, net = scan_table(model).nodes
    rate = np.sqrt(2.0 * np.abs(net) * inverse)
    balance = np.sqrt(2.0 * np.maximum(net, 0.0) / inverse)
    return float(rate.max()), float(balance.max())


def integrate(model: Model, temperature: Array, mass: float) -> Trajectories:
    """Integrate from surface temperatures ``temperature`` (C,) > 0 down to the hold-up ``mass``."""
    table = scan_table(model)
    rate, balance = rates(model)
    p1 = LENGTHS_PER_STEP / (STEP * max(rate, 1e-3))
    floor = -COLD * (balance + rate + 2.0 + model.slope**2)
    empty_inverse, _, empty_net = table.nodes[:, 0]
    # In the empty state y rises to this limit, never to fall again: no base is met beyond its own flux.
    limit = np.sqrt(max(2.0 * empty_net / empty_inverse, 0.0))
    meets = float(model.base_flux(model.closures(np.zeros(1))[0])[0])
    beyond_meeting = empty_net > 0.0 and meets > limit
    end = model.surface_stress + mass

    def derivative(state: Array) -> Array:
        p, big_l, y = state
        inverse, k, net = table.along(big_l)
        v = p * y * inverse
        still = 1.0 - v
        out = np.empty_like(state)
        out[0] = p
        out[1] = still
        out[2] = p * net - y * (1.0 + 0.5 * (v + k * still))
        out /= 1.0 + p * (1.0 / p1)
        return out

    state = np.stack(_start(model, temperature))  # p, L, y
    rows = [state]
    last = np.zeros(len(temperature), dtype=np.intp)
    active = np.arange(len(temperature))
    while active.size:
        # A cold trajectory may run off to infinity within a step; it is ended below.
        with np.errstate(over="ignore", invalid="ignore"):
            state = _runge_kutta_step(derivative, state)
        p, big_l, y = state
        cold = ~(y >= floor) | (big_l > _HIGH)
        y[cold] = -np.inf
        np.minimum(big_l, _HIGH, out=big_l)
        row = rows[-1].copy()
        row[:, active] = state
        last[active] = len(rows)
        rows.append(row)
        done = cold | (p >= end)
        if empty_net > 0.0:
            done |= (big_l < LOG_EMPTY) & (y >= 0.0) & ((y > meets) | beyond_meeting)
        if done.any():
            active, state = active[~done], state[:, ~done]
    whole = np.array(rows)
    thin = _thin_rows(model, temperature, whole, derivative(whole[0]))
    if model.surface_stress > 0.0:
        whole, last = whole[1:], last - 1
    p, big_l, y = np.moveaxis(np.concatenate([thin, whole]), 1, 0)
    return Trajectories(model, temperature, p, big_l, y, last + len(thin), len(thin), p1)


def _thin_rows(model: Model, temperature: Array, rows: Array, slopes: Array) -> Array:
    """Rows (j, 3, C) for bases close to the surface, evenly in the logarithm of the overburden.

    On the half-line they go up from the first row, by the series there; at the interface they lie between the
    first two rows, by the parabola through both that leaves the first with its slope.
    """
    shares = np.exp(-_THIN_STEP * np.arange(_THIN_ROWS, 0, -1))[:, None]
    if model.surface_stress == 0.0:
        return np.moveaxis(np.array(_series(model, temperature, rows[0, 0] * shares)), 0, 1)
    first, second = rows[0], rows[1]
    over = second[0] - first[0]
    # The slopes are those in tau; p' = p/(1 + p/p_1) there.
    by_over = slopes[1:] / slopes[0]
    bend = second[1:] - first[1:] - by_over * over
    thin = np.empty((_THIN_ROWS, *first.shape))
    thin[:, 0] = first[0] + shares * over
    thin[:, 1:] = first[1:] + (by_over * over) * shares[:, None] + bend * shares[:, None] ** 2
    return thin


def _runge_kutta_step(derivative: Callable[[Array], Array], state: Array) -> Array:
    a = derivative(state)
    b = derivative(state + (0.5 * STEP) * a)
    c = derivative(state + (0.5 * STEP) * b)
    d = derivative(state + STEP * c)
    return state + (STEP / 6.0) * (a + 2.0 * (b + c) + d)


def _start(model: Model, temperature: Array) -> tuple[Array, Array, Array]:
    """Where the integration begins: a little below p = 0, or at the interface (3.32)."""
    if model.surface_stress == 0.0:
        return _series(model, temperature, START * np.minimum(temperature, 1.0 / max(rates(model)[0], 1.0)))
    p = np.full_like(temperature, model.surface_stress)
    return p, np.log(p) - surface_potential(model, temperature), np.full_like(p, model.surface_flux)


def _series(model: Model, temperature: Array, p: Array) -> tuple[Array, Array, Array]:
    """p, L and y by the series at the surface of the half-line (3.23)-(3.25), which solves (3.20)-(3.22)."""
    f0, _ = model.closures(np.zeros(1))
    half = 0.5 * (f0[LOSS, 0] - model.slope**2 * f0[WORK, 0])
    theta = np.log(temperature) + 0.5 * p**2 * half / f0[CONDUCTION, 0]
    x = p * np.exp(-theta)
    f, _ = model.closures(x)
    net = f[LOSS] - model.slope**2 * f[WORK]
    v = p**2 * half / f[CONDUCTION]
    y = p * (half + (net - 2.0 * half) / 3.0 - half * (v + f[COUPLING] * (1.0 - v)) / 6.0)
    return p, np.log(x), y
