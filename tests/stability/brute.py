"""The fastest growing wave of a flow by brute force: all eigenvalues at all points of a map over ln k and direction.

The map takes all eigenvalues of a small grid at each point, with no mode followed from one to the next, and then
checks the points in the order of what grows there, on the grids of the search. The peak is climbed by Nelder and
Mead's method over the leading mode of each place.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

import chuteflow
from chuteflow.numerics.eigenproblem import Inverse
from chuteflow.stability.base import Resolution, base
from chuteflow.stability.linear import Operator, operator
from chuteflow.stability.modes import Disturbances
from chuteflow.stability.result import leading, wavenumbers

#: Degrees of the grid of the map, tried in turn; relative difference of rates from those of the search that will do.
DEGREES, ALIKE = (20, 26, 32), 0.02
#: Points beyond the best that are checked: the map's grid may be wrong by this fraction.
MARGIN = 0.05
MOST_CHECKED = 400


@dataclass(frozen=True)
class Peak:
    """The highest point of a map, the maximum near by, and how many points could not be resolved."""

    growth: float
    kx: float
    ky: float
    maximum: float
    summit_kx: float
    summit_ky: float
    degree: int
    checked: int
    unresolved: int


def highest(flow: chuteflow.Flow, points: int = 60, directions: int = 60) -> Peak | None:
    """The highest peak of a map; None where nothing grows at any of its points."""
    disturbances = Disturbances(flow)
    low, high = np.log(wavenumbers(flow))
    logs = np.linspace(low, high, points)
    angles = np.linspace(0.0, 0.5 * np.pi, directions)
    degree = _degree(disturbances, logs)
    grids: dict[Resolution, Operator] = {}
    screened = np.empty((points, directions))
    for i, log_k in enumerate(logs):
        for j, angle in enumerate(angles):
            screened[i, j] = _largest(disturbances, grids, degree, *_wave(log_k, angle))
    best, place, told, unresolved = disturbances.smallest_rate, None, 0, 0
    for flat in np.argsort(-screened, axis=None):
        i, j = np.unravel_index(int(flat), screened.shape)
        if screened[i, j] < best * (1.0 - MARGIN) or told == MOST_CHECKED:
            break
        told += 1
        try:
            found = leading(disturbances, *_wave(logs[i], angles[j]))
        except chuteflow.SolveError:
            unresolved += 1
            continue
        if found and found[0].growth > best:
            best, place = found[0].growth, (float(logs[i]), float(angles[j]))
    if place is None:
        return None
    maximum, at = _maximised(disturbances, place, (logs[0], logs[-1]), max(logs[1] - logs[0], angles[1]))
    return Peak(best, *_wave(*place), maximum, *_wave(*at), degree, told, unresolved)


def _wave(log_k: float, angle: float) -> tuple[float, float]:
    k = float(np.exp(log_k))
    kx, ky = k * float(np.cos(angle)), k * float(np.sin(angle))
    return 0.0 if kx < 1e-9 * k else kx, 0.0 if ky < 1e-9 * k else ky


def _largest(disturbances: Disturbances, grids: dict[Resolution, Operator], degree: int, kx: float, ky: float) -> float:
    """The largest growth of all eigenvalues of a grid of ``degree``, with the reach and map of the search's."""
    usual = disturbances.coarse_operator(kx, ky).base.resolution
    resolution = Resolution(max(degree, round(usual.degree * degree / 32)), usual.reach, usual.beta)
    if resolution not in grids:
        grids[resolution] = operator(base(disturbances.flow, resolution))
    of = grids[resolution]
    shift = complex(0.05 * (1.0 + abs(kx)), -0.5 * kx * float(of.base.profile.velocity[[0, -1]].sum()))
    inverse = Inverse.of(of.matrix(kx, ky), of.weights, shift)
    mu = np.linalg.eigvals(inverse.columns[inverse.live])
    mu = mu[np.abs(mu) > 1e-13 * np.abs(mu).max()]
    return float(np.real(shift + 1.0 / mu).max())


def _degree(disturbances: Disturbances, logs: np.ndarray) -> int:
    """The smallest of the degrees that shows what grows at a few places as the search's grids do."""
    places = [_wave(logs[i], angle) for i in (len(logs) // 3, len(logs) // 2, 2 * len(logs) // 3) for angle in (0, 1.4)]
    rates = []
    for place in places:
        try:
            found = leading(disturbances, *place)
        except chuteflow.SolveError:
            return DEGREES[-1]
        rates.append(found[0].growth if found else 0.0)
    for degree in DEGREES[:-1]:
        grids: dict[Resolution, Operator] = {}
        seen = [_largest(disturbances, grids, degree, *place) for place in places]
        if all(
            abs(rate - see) < ALIKE * rate if rate > disturbances.smallest_rate else see < disturbances.smallest_rate
            for rate, see in zip(rates, seen, strict=True)
        ):
            return degree
    return DEGREES[-1]


def _maximised(
    disturbances: Disturbances, place: tuple[float, float], ends: tuple[float, float], step: float
) -> tuple[float, tuple[float, float]]:
    def within(x: np.ndarray) -> tuple[float, float]:
        return float(np.clip(x[0], *ends)), float(np.clip(x[1], 0.0, 0.5 * np.pi))

    def fall(x: np.ndarray) -> float:
        try:
            found = leading(disturbances, *_wave(*within(x)))
        except chuteflow.SolveError:
            return 0.0
        return -found[0].growth if found else 0.0

    start = np.array(place)
    simplex = start + np.array([[0.0, 0.0], [step, 0.0], [0.0, step if place[1] < 0.8 else -step]])
    end = minimize(
        fall,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 3e-3, "fatol": 1e-12, "maxfev": 80},
    )
    return -float(end.fun), within(end.x)


#: Flows whose fastest wave was once missed: chute, surface temperature, and which of the flows there.
MISSED = (
    ((0.568, 0.627, 0.478, 0.847), 8.0, 0),
    ((0.568, 0.627, 0.478, 0.847), 8.5, 0),
    ((0.568, 0.627, 0.478, 0.847), 9.5, 0),
    ((0.536202, 0.675958, 0.482668, 0.800872), 13.198687, 1),
)
PAPER = (0.3, 0.8, 0.8, 0.6)


def campaign(random: int, corner: int, seed: int = 12) -> Iterator[tuple[tuple[float, ...], chuteflow.Flow]]:
    """Flows, with the numbers of their chutes: those once missed, the paper's, random ones and some of the corner."""
    for numbers, temperature, which in MISSED:
        yield numbers, chuteflow.flows(chuteflow.Chute(*numbers), T_surface=temperature)[which]
    for flow in chuteflow.flows(chuteflow.Chute(*PAPER), Q=3.0):
        yield PAPER, flow
    rng = np.random.default_rng(seed)
    left = {"random": random, "corner": corner}
    while any(left.values()):
        for kind in ("random", "random", "corner"):
            if not left[kind]:
                continue
            low, high = (
                ((0.15, 0.5, 0.4, 0.5, -0.7), (0.6, 0.98, 1.0, 0.866, 1.5))
                if kind == "random"
                else ((0.5, 0.58, 0.4, 0.78, 0.7), (0.6, 0.7, 0.55, 0.866, 1.2))
            )
            slope, e, ew, roughness, log_temperature = (round(float(x), 3) for x in rng.uniform(low, high))
            found = chuteflow.flows(chuteflow.Chute(slope, e, ew, roughness), T_surface=10.0**log_temperature)
            if len(found):
                left[kind] -= 1
                yield (slope, e, ew, roughness), found[int(rng.integers(len(found)))]
