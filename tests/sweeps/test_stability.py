"""Stability among the quantities of a study."""

from pathlib import Path

import numpy as np
import pytest

import chuteflow
from chuteflow.stability.result import stability_of
from chuteflow.sweeps.engine import solve_chunk
from chuteflow.sweeps.stability import STABILITY_KINDS
from chuteflow.sweeps.store import variables
from chuteflow.sweeps.study import from_dict

STUDY = {
    "parameters": {"slope": [0.1, 0.3], "e": 0.8, "ew": 0.8, "roughness": 0.6, "T_surface": 1.7},
    "results": {"quantities": ["mass_flux", "stable", "mode", "growth", "kx", "ky", "density"], "flows": 2},
}


@pytest.mark.parametrize(("temperature", "stable"), [(0.2, 0), pytest.param(1.7, 1, marks=pytest.mark.slow)])
def test_a_study_keeps_the_verdict_of_each_flow(temperature, stable):
    study = from_dict({**STUDY, "parameters": {**STUDY["parameters"], "T_surface": temperature}}, Path())
    assert study.chunk == 16
    solved = solve_chunk(study, 0)
    assert solved.n_flows.tolist() == [0, 1]
    assert solved.reason[0] > 0
    flow = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), T_surface=temperature)[0]
    found = stability_of(flow)
    kept = {name: values[1, 0] for name, values in solved.quantities.items()}
    assert kept["mass_flux"] == pytest.approx(flow.mass_flux)
    assert kept["stable"] == found.stable == stable
    assert found.mode is not None
    assert STABILITY_KINDS["mode"][kept["mode"]] == found.mode.direction
    assert (kept["growth"], kept["kx"], kept["ky"]) == pytest.approx((found.mode.growth, found.mode.kx, found.mode.ky))
    for name in ("stable", "mode"):
        assert solved.quantities[name][0].tolist() == [-1, -1]
    assert np.isnan(solved.quantities["growth"][0]).all()


def test_the_reason_is_given_where_stability_is_not_known():
    given = {**STUDY, "parameters": {**STUDY["parameters"], "slope": 0.3, "surface": "interface"}}
    solved = solve_chunk(from_dict(given, Path()), 0)
    assert solved.n_flows.tolist() == [1]
    assert solved.quantities["stable"].tolist() == [[-1, -1]]
    assert "free surface" in solved.failures[0]


def test_arrays_of_a_store_say_what_the_flags_mean():
    stored = variables(from_dict(STUDY, Path()))
    assert stored["stable"].attributes["flag_meanings"] == "unstable stable"
    assert stored["growth"].attributes["units"] == "1"
