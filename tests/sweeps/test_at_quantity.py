"""Sweeps at a given quantity lose none of the flows near turns that the search by branches finds."""

import numpy as np
import pytest

from chuteflow import Chute, curve, flows
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q
from chuteflow.sweeps.at_quantity import solve_at_quantity
from chuteflow.sweeps.batch import Batch

#: Chutes at centres of mass that two flows share, near a turn of h that lies between two columns.
PAIRS = [
    ((0.3539434384453751, 0.7766404745915528, 0.7668635991592798, 0.8085232838341686), 0.370195341253247),
    ((0.2264135949936713, 0.9369890805505621, 0.751081402846694, 0.8229411437837175), 16.505361888689148),
]


def swept(parameters, which, values):
    columns = np.array(parameters, dtype=float).reshape(-1, 4).T
    batch = Batch.of("lun", "free", *columns)
    found, unsettled = solve_at_quantity(batch, which, np.array(values, dtype=float), (1e-3, 1e5), 30.0, 1e-10)
    return np.bincount(found.member, minlength=len(batch)), unsettled, found


@pytest.mark.parametrize(("parameters", "height"), PAIRS)
def test_two_flows_near_a_turn_are_found(parameters, height):
    (count,), (unsettled,), found = swept([parameters], LOG_H, [height])
    expected = flows(Chute(*parameters), h=height)
    assert not unsettled
    assert count == len(expected) == 2
    for flow, log_m in zip(expected, found.macroscopic[LOG_M], strict=True):
        assert np.exp(log_m) == pytest.approx(flow.mass_holdup, rel=1e-8)


def test_just_past_a_cusp_no_lane_is_settled_with_flows_missing():
    parameters, fluxes = [], []
    for beyond, low, high in ((1e-4, 905.464237, 905.790341), (1e-3, 991.68551, 1004.12061)):
        for share in (-0.5, 0.5, 1.5):
            parameters.append((0.3629916485 + beyond, 0.8, 0.8, 0.6))
            fluxes.append(low + share * (high - low))
    count, unsettled, _ = swept(parameters, LOG_Q, fluxes)
    expected = np.tile([2, 4, 2], 2)
    assert (unsettled | (count == expected)).all()


@pytest.mark.slow
def test_near_folds_settled_lanes_have_the_flows_of_the_search_by_families():
    # Deeper branches that live between two columns alone are a matter of the search, not of turns.
    shallow = 4.0
    random = np.random.default_rng(5)
    parameters, fluxes = [], []
    while len(fluxes) < 60:
        chute = Chute(*random.uniform((0.2, 0.7, 0.6, 0.55), (0.33, 0.93, 0.9, 0.8)))
        points = [p for b in curve(chute, points=5).branches for p in b.special if p.kind == "fold-Q"]
        for fold in (p.flow for p in points if p.flow.mass_holdup < shallow):
            parameters.append((chute.slope, chute.restitution, chute.wall_restitution, chute.roughness))
            fluxes.append(fold.mass_flux * (1.0 + random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-4.0, -2.0)))
    _, unsettled, found = swept(parameters, LOG_Q, fluxes)
    count = np.bincount(found.member[found.macroscopic[LOG_M] < np.log(shallow)], minlength=len(fluxes))
    assert unsettled.mean() < 0.5
    for i in np.flatnonzero(~unsettled).tolist():
        expected = [flow for flow in flows(Chute(*parameters[i]), Q=fluxes[i]) if flow.mass_holdup < shallow]
        assert count[i] == len(expected), (parameters[i], fluxes[i])
