"""Random points of random planes, classified by a map and by the full enumeration."""

from itertools import pairwise
from typing import Any

import numpy as np

from chuteflow import Chute, SolveError, curve, flows
from chuteflow.maps import CODES, ParameterAxis, ParameterPlane
from chuteflow.maps.kinds import DENSITIES, INTERIORS
from chuteflow.maps.plane import classify

#: Ranges in which nearly all flows are.
RANGES = {
    "slope": (0.1, 0.6),
    "restitution": (0.6, 0.97),
    "wall_restitution": (0.4, 0.97),
    "roughness": (0.5, 0.866),
}
TEMPERATURES = (1.0, 10.0, 100.0)
NAMES = (*CODES, *(f"exists at {t:g}" for t in TEMPERATURES))


def random_planes(seed, surface="free"):
    """Planes without end, each a random pair of axes with all else at random."""
    random = np.random.default_rng(seed)
    while True:
        x, y = random.choice(list(RANGES), 2, replace=False)
        others: dict[str, Any] = {name: float(random.uniform(*bounds)) for name, bounds in RANGES.items()}
        plane = ParameterPlane(
            ParameterAxis(str(x), *RANGES[x]),
            ParameterAxis(str(y), *RANGES[y]),
            Chute(**others, surface=surface),
            TEMPERATURES,
        )
        yield plane, tuple(map(float, random.uniform(0.01, 0.99, 2)))


def enumerated(chute):
    """The class of a chute by the curve of all its branches and all flows at each temperature."""
    found = curve(chute, tolerance=1e-8, points=300)
    stretches = []
    for branch in found.branches:
        turns = [point.flow.mass_flux for point in branch.special if point.kind == "fold-Q"]
        stops = [branch.flows[0].mass_flux, *turns, branch.flows[-1].mass_flux]
        stretches += [(min(pair), max(pair)) for pair in pairwise(stops)]
    edges = sorted({edge for stretch in stretches for edge in stretch})
    most = max((sum(a <= low and high <= b for a, b in stretches) for low, high in pairwise(edges)), default=0)
    every = [flow for branch in found.branches for flow in branch.flows]
    at = [any(flow.mass_holdup <= 30.0 for flow in flows(chute, T_surface=t)) for t in TEMPERATURES]
    return (
        most,
        len(found.branches),
        *(int(any(flow.interior == name for flow in every)) for name in INTERIORS),
        *(int(any(flow.density == name for flow in every)) for name in DENSITIES),
        *map(int, at),
    )


def compare(seed, count, tolerance, surface="free"):
    """Numbers in which map and enumeration differ at ``count`` points: those within ``tolerance`` of a boundary,
    those that are not, and the points at which the enumeration gave up."""
    near, far, unknown = [], [], []
    points = random_planes(seed, surface)
    for _ in range(count):
        plane, (u, v) = next(points)
        chute = plane.chute_at(u, v)
        mapped = classify(plane, u, v)
        try:
            solved = enumerated(chute)
        except SolveError as error:
            unknown.append((chute, str(error)))
            continue
        differ = [i for i in range(len(solved)) if solved[i] != mapped[i]]
        if not differ:
            continue
        around = [
            classify(plane, u + a * share * tolerance, v + b * share * tolerance)
            for share in (1.0, 0.5)
            for a in (-1, 0, 1)
            for b in (-1, 0, 1)
        ]
        for i in differ:
            where = near if any(other[i] == solved[i] for other in around) else far
            where.append((NAMES[i], mapped[i], solved[i], chute))
    return near, far, unknown
