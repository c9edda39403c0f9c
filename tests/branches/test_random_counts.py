"""Random chutes near folds and just past cusps: the flows that are given, beside a dense scan of every branch.

CHUTEFLOW_RANDOM_CHUTES sets the number of chutes; a chute takes some ten seconds.
"""

import os
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from chuteflow import Chute, curve, flows
from chuteflow.branches.paths import solve_between
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.solution_branches import trace_branches
from chuteflow.parameters import LARGEST_HOLDUP, SURFACE_TEMPERATURE
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T
from chuteflow.steady.model import model

CHUTES = int(os.environ.get("CHUTEFLOW_RANDOM_CHUTES", "6"))
ARGUMENTS = {LOG_Q: "Q", LOG_H: "h", LOG_M: "M", LOG_T: "T_surface"}
FOLDS = {"fold-Q": LOG_Q, "fold-M": LOG_M, "fold-T": LOG_T}
#: Flows of a dense scan of a branch, and by how much it is finer near extrema.
DENSE, FINER = 800, 30


def macroscopic(flow):
    return np.log([flow.mass_flux, flow.centre_of_mass, flow.mass_holdup, flow.surface_temperature])


def searched(chute):
    return SearchRange.checked(SURFACE_TEMPERATURE, LARGEST_HOLDUP, chute.surface)


def scanned(chute):
    """The flows of each branch in order, and their quantities (k, 4)."""
    for branch in trace_branches(model(chute), searched(chute)):
        # What the branch was followed by shows peaks that are narrower than the distance of the samples.
        places = np.union1d(np.linspace(0.0, branch.arclength[-1], DENSE), branch.arclength)
        places = places[np.append(True, np.diff(places) > 1e-9)]
        solutions = [point.solution for point in branch.at(places, 1e-9)]
        yield solutions, np.array([solution.macroscopic for solution in solutions])


def counted(branches, which, target):
    """Changes of sign along the branches, more closely where the quantity turns near the target."""
    count = 0
    for solutions, quantities in branches:
        off = quantities[:, which] - target
        count += int(np.sum((off[1:] >= 0.0) != (off[:-1] >= 0.0)))
        steps = np.diff(off)
        for i in np.flatnonzero(steps[1:] * steps[:-1] <= 0.0) + 1:
            alike = len(set((off[i - 1 : i + 2] >= 0.0).tolist())) == 1
            if alike and abs(off[i]) < 2.0 * (abs(steps[i - 1]) + abs(steps[i])):
                finer = [off[i - 1]]
                for first, last in ((i - 1, i), (i, i + 1)):
                    ends = solutions[first], solutions[last]
                    places = np.linspace(0.0, 1.0, FINER + 1)[1:-1]
                    finer += [solve_between(*ends, place, 1e-9).macroscopic[which] - target for place in places]
                    finer.append(off[last])
                sides = np.array(finer) >= 0.0
                count += int(np.sum(sides[1:] != sides[:-1]))
    return count


def random_chute(random):
    surface = "interface" if random.random() < 0.25 else "free"
    return Chute(*random.uniform((0.18, 0.65, 0.5, 0.5), (0.45, 0.95, 0.92, 0.86)), surface=surface)


def folds_in_flux(chute):
    return sum(len(branch.turns(LOG_Q, 1e-10)) for branch in trace_branches(model(chute), searched(chute)))


def past_a_cusp(random):
    """A random chute a little beyond the slope at which its number of folds changes."""
    while True:
        chute = random_chute(random)
        low, high = chute.slope, chute.slope + random.uniform(0.01, 0.05)
        few, many = (folds_in_flux(replace(chute, slope=slope)) for slope in (low, high))
        if few != many:
            break
    for _ in range(13):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if folds_in_flux(replace(chute, slope=middle)) == few else (low, middle)
    beyond = 10.0 ** random.uniform(-4.5, -3.0)
    return replace(chute, slope=high + beyond if many > few else low - beyond)


def asked(chute, branches, random):
    """Values of quantities near folds, between those of a pair, and near turns of h."""
    found = [(FOLDS[p.kind], p.flow) for b in curve(chute, points=5).branches for p in b.special if p.kind in FOLDS]
    for which, flow in found:
        yield which, macroscopic(flow)[which] + random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-6.0, -2.0)
    fluxes = sorted(np.log(flow.mass_flux) for which, flow in found if which == LOG_Q)
    if len(fluxes) > 1:
        yield from ((LOG_Q, 0.5 * sum(fluxes[:2])), (LOG_Q, 0.5 * sum(fluxes[-2:])))
    for _, quantities in branches:
        rises = np.diff(quantities[:, LOG_H]) > 0.0
        for i in np.flatnonzero(rises[1:] != rises[:-1])[:1] + 1:
            yield LOG_H, quantities[i, LOG_H] + random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-5.0, -2.0)


@pytest.mark.slow
def test_near_folds_and_past_cusps_flows_are_those_of_a_dense_scan():
    random = np.random.default_rng(5)
    questions = 0
    different: list[tuple[Chute, dict[str, Any], int, int]] = []
    for i in range(CHUTES):
        chute = past_a_cusp(random) if i % 3 == 0 else random_chute(random)
        branches = list(scanned(chute))
        within = searched(chute)
        for which, target in asked(chute, branches, random):
            if abs(target) > np.log(1e11):
                continue
            given: dict[str, Any] = {ARGUMENTS[which]: float(np.exp(target))}
            found = flows(chute, **given)
            inside = sum(within.contains(macroscopic(flow)) for flow in found)
            expected = counted(branches, which, target)
            questions += 1
            if inside != expected:
                different.append((chute, given, inside, expected))
                print(different[-1], flush=True)
    print(f"{CHUTES} chutes, {questions} questions, {len(different)} differ")
    assert not different
    assert questions >= CHUTES
