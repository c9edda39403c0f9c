"""Sweeps at a given quantity lose none of the flows near turns."""

from pathlib import Path

import numpy as np
import pytest

from chuteflow import Chute, curve, flows
from chuteflow.sweeps.engine import solve_chunk
from chuteflow.sweeps.study import from_dict

#: Chutes at centres of mass that two flows share, near a turn of h.
PAIRS = [
    ((0.3539434384453751, 0.7766404745915528, 0.7668635991592798, 0.8085232838341686), 0.370195341253247),
    ((0.2264135949936713, 0.9369890805505621, 0.751081402846694, 0.8229411437837175), 16.505361888689148),
]


def swept(parameters, condition, values):
    """The chunk of chutes with these ``parameters`` (n, 4) at values (n,) of one quantity."""
    columns = np.array(parameters, dtype=float).reshape(-1, 4).T.tolist()
    named = dict(zip(("slope", "e", "ew", "roughness"), columns, strict=True))
    table = {"design": {"kind": "list"}, "parameters": {**named, condition: list(values)}}
    return solve_chunk(from_dict(table, Path()), 0)


@pytest.mark.parametrize(("parameters", "height"), PAIRS)
def test_two_flows_near_a_turn_are_found(parameters, height):
    chunk = swept([parameters], "h", [height])
    expected = flows(Chute(*parameters), h=height)
    assert chunk.n_flows.tolist() == [len(expected)] == [2]
    for flow, mass in zip(expected, chunk.quantities["mass_holdup"][0, :2], strict=True):
        assert mass == pytest.approx(flow.mass_holdup, rel=1e-7)


def test_just_past_a_cusp_four_flows_are_found_between_the_folds_and_two_beside():
    parameters, fluxes = [], []
    for beyond, low, high in ((1e-4, 905.464237, 905.790341), (1e-3, 991.68551, 1004.12061)):
        for share in (-0.5, 0.5, 1.5):
            parameters.append((0.3629916485 + beyond, 0.8, 0.8, 0.6))
            fluxes.append(low + share * (high - low))
    assert swept(parameters, "Q", fluxes).n_flows.tolist() == [2, 4, 2, 2, 4, 2]


@pytest.mark.slow
def test_beside_folds_there_are_two_flows_more_on_one_side():
    random = np.random.default_rng(5)
    parameters, fluxes, sides = [], [], []
    while len(fluxes) < 120:
        chute = Chute(*random.uniform((0.2, 0.7, 0.6, 0.55), (0.33, 0.93, 0.9, 0.8)))
        points = [p.flow for b in curve(chute, points=5).branches for p in b.special if p.kind == "fold-Q"]
        for fold in points:
            if sum(abs(np.log(other.mass_flux / fold.mass_flux)) < 0.1 for other in points) == 1:
                distance = 10.0 ** random.uniform(-4.0, -2.0)
                parameters += 2 * [(chute.slope, chute.restitution, chute.wall_restitution, chute.roughness)]
                fluxes += [fold.mass_flux * (1.0 - distance), fold.mass_flux * (1.0 + distance)]
                sides.append(fold)
    count = swept(parameters, "Q", fluxes).n_flows.reshape(-1, 2)
    assert (np.abs(count[:, 1] - count[:, 0]) == 2).all()
