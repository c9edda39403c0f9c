"""Every flow of every point against those of chutes that are searched one by one, by another method."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chuteflow import Chute, flows
from chuteflow.errors import InputError, SolveError
from chuteflow.parameters import BY_KEY
from chuteflow.steady.chute import SURFACES
from chuteflow.steady.kinds import DENSITIES, INTERIORS
from chuteflow.steady.quantities import NUMBERS
from chuteflow.sweeps import engine
from chuteflow.sweeps.batch import Batch
from chuteflow.sweeps.engine import solve_chunk
from chuteflow.sweeps.marching import start
from chuteflow.sweeps.numbers import ONE_BY_ONE
from chuteflow.sweeps.outcome import PointStatus, Reason
from chuteflow.sweeps.study import from_dict
from chuteflow.theory.boundary import surface_stress

VALUES = {"T_surface": (1e-2, 1e4), "Q": (1e-2, 1e4), "M": (5e-2, 20.0), "h": (0.3, 1e3)}
#: Kinds that are found without solving each flow.
KINDS = {"interior": INTERIORS, "density": DENSITIES}
MACROSCOPIC = ("mass_flux", "centre_of_mass", "mass_holdup")
PAPER = {"slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6}
#: Laws that are integrated in batches, in the order of their numbers.
CLOSURES = ("lun", "lun-fourier")

#: Quantities for which chutes are solved in batches.
BATCHED = [name for name in NUMBERS if name not in ONE_BY_ONE]


def random_study(condition, points, seed):
    low, high = VALUES[condition]
    return from_dict(
        {
            "design": {"kind": "random", "points": points, "seed": seed},
            "parameters": {
                "slope": {"from": 0.1, "to": 0.6},
                "e": {"from": 0.5, "to": 0.999},
                "ew": {"from": 0.3, "to": 1.0},
                "roughness": {"from": 0.5, "to": 0.866},
                condition: {"from": low, "to": high, "scale": "log"},
                "surface": list(SURFACES),
                "closure": list(CLOSURES),
            },
            "results": {"quantities": [*BATCHED, *KINDS], "chunk": points, "flows": 16},
        },
        Path(),
    )


def chute_of(chunk, i):
    p = chunk.parameters
    slope, e, ew, roughness = (float(p[name][i]) for name in BY_KEY)
    surface, closure = SURFACES[int(p["surface"][i])], CLOSURES[int(p["closure"][i])]
    return Chute(slope, e, ew, roughness, surface, closure)


def bases_below(chute, temperature, stress):
    """Normal stresses down to ``stress`` at which the trajectory of a surface temperature meets the base,
    by another program of integration."""
    numbers = (chute.slope, chute.restitution, chute.wall_restitution, chute.roughness)
    slope, e, ew, r = (np.array([x]) for x in numbers)
    one = Batch.of(chute.closure, chute.surface, slope, e, ew, r)

    def along(log_p, state):
        rows = np.array([[log_p], [state[0]], [state[1]], [0.0], [0.0], [0.0]])
        return one.at_state(rows), rows

    def rate(log_p, state):
        at, rows = along(log_p, state)
        out = np.empty_like(rows)
        at.derivative(rows, out)
        return out[1:3, 0]

    def excess(log_p, state):
        at, _ = along(log_p, state)
        return (at.y - at.base_flux)[0]

    first = start(one, np.array([temperature]), np.ones(1), 1e-8)[0][:, 0]
    solved = solve_ivp(
        rate, (first[0], np.log(stress)), first[1:3], method="DOP853", events=excess, rtol=1e-11, atol=1e-13
    )
    assert solved.t_events is not None
    return np.exp(solved.t_events[0])


def assert_same_flows(chunk, i, found):
    """That all ``found`` are among the flows of point ``i``; returns how many more these are, all of them real."""
    chute, many = chute_of(chunk, i), int(chunk.n_flows[i])
    kept = {name: values[i, :many] for name, values in chunk.quantities.items()}
    assert np.isnan(chunk.error[i, many:]).all()
    assert (np.diff(kept["surface_temperature"]) <= 0.0).all()
    left = set(range(many))
    for flow in found:
        apart = [abs(np.log(kept["mass_holdup"][k] / flow.mass_holdup)) for k in sorted(left)]
        assert apart, chute
        k = sorted(left)[int(np.argmin(apart))]
        left.remove(k)
        for name in MACROSCOPIC:
            assert abs(np.log(kept[name][k] / getattr(flow, name))) <= chunk.error[i, k] + flow.error, (chute, name)
        for name in BATCHED:
            assert kept[name][k] == pytest.approx(getattr(flow, name), rel=1e-5), (chute, name)
        for name, words in KINDS.items():
            assert words[kept[name][k]] == getattr(flow, name)
    for k in left:
        stress = kept["mass_holdup"][k] + surface_stress(chute.surface)
        bases = bases_below(chute, kept["surface_temperature"][k], 1.01 * stress)
        assert np.abs(np.log(bases / stress)).min() < 1e-7, (chute, k)
    return len(left)


def compare(condition, points, seed):
    study = random_study(condition, points, seed)
    chunk = solve_chunk(study, 0)
    assert (chunk.status == PointStatus.COMPLETE).all()
    assert ((chunk.reason == Reason.HAS_FLOWS) == (chunk.n_flows > 0)).all()
    assert (chunk.error[chunk.error > 0] <= study.tolerance).all()
    more = 0
    for i in range(points):
        asked: dict[str, Any] = {condition: float(chunk.parameters[condition][i])}
        more += assert_same_flows(chunk, i, flows(chute_of(chunk, i), **asked))
    return chunk, more


@pytest.mark.parametrize(("condition", "points"), [("T_surface", 20), ("Q", 10), ("M", 12), ("h", 5)])
def test_flows_are_those_of_the_search_of_one_chute(condition, points):
    chunk, more = compare(condition, points, 1)
    assert more == 0
    assert chunk.n_flows.max() > 0
    assert chunk.n_flows.min() == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
@pytest.mark.parametrize("condition", VALUES)
def test_flows_of_several_hundred_chutes_are_those_of_the_search_of_one(condition, seed):
    chunk, more = compare(condition, 200, seed)
    if condition == "T_surface":
        # A deep flow in a hundred, or one beside the edge of the range, is not seen by the search of one chute.
        assert more <= 2
        # So many are searched together that the speed is not that of the search of one.
        assert chunk.singly <= 20
    else:
        assert more == 0


def paper_study(condition, values, **results):
    parameters = {**PAPER, condition: values}
    return from_dict({"design": {"kind": "list"}, "parameters": parameters, "results": results}, Path())


def test_three_flows_of_the_paper():
    chunk = solve_chunk(paper_study("Q", [3.0]), 0)
    assert chunk.n_flows[0] == 3
    assert chunk.quantities["surface_temperature"][0, :3] == pytest.approx([7.34, 2.54, 0.197], rel=3e-3)
    assert chunk.quantities["mass_flux"][0, :3] == pytest.approx([3.0] * 3, rel=1e-10)


def test_flows_that_do_not_fit_are_counted_and_told():
    chunk = solve_chunk(paper_study("Q", [3.0], flows=2), 0)
    assert chunk.n_flows[0] == 3
    assert chunk.status[0] == PointStatus.MORE_FLOWS_THAN_KEPT
    assert chunk.quantities["surface_temperature"][0] == pytest.approx([7.34, 2.54], rel=3e-3)


def test_a_trajectory_that_grows_dense_again_is_followed_to_its_base():
    """Where the interior gains energy in the end, a thin layer at the surface does not last."""
    parameters = {
        "slope": 0.2213994162803735,
        "e": 0.957297110925067,
        "ew": 0.5275460577362433,
        "roughness": 0.8356708485326632,
        "surface": "interface",
        "closure": "lun-fourier",
        "T_surface": 231.19075660434729,
    }
    chunk = solve_chunk(from_dict({"design": {"kind": "list"}, "parameters": parameters}, Path()), 0)
    assert chunk.n_flows[0] == 1
    stress = chunk.quantities["mass_holdup"][0, 0] + surface_stress("interface")
    bases = bases_below(chute_of(chunk, 0), parameters["T_surface"], 12.0)
    assert bases == pytest.approx([stress], rel=1e-8)


def test_what_is_no_chute_is_told_and_stops_nothing():
    study = from_dict(
        {
            "design": {"kind": "list"},
            "parameters": {
                "slope": [0.3, -1.0, 0.3, 0.3],
                "e": [0.8, 0.8, 1.2, 0.8],
                "ew": 0.8,
                "roughness": [0.6, 0.6, 0.6, 0.9],
                "T_surface": 7.0,
            },
        },
        Path(),
    )
    chunk = solve_chunk(study, 0)
    assert chunk.status.tolist() == [
        PointStatus.COMPLETE,
        PointStatus.INVALID,
        PointStatus.INVALID,
        PointStatus.INVALID,
    ]
    assert chunk.n_flows.tolist() == [1, 0, 0, 0]
    assert chunk.failures[1] == "slope = -1: must be from 1e-08 to 10000"
    assert chunk.failures[2] == "e = 1.2: must be from 1e-08 to 1"
    assert chunk.failures[3] == "roughness = 0.9: must be from 0.5 to 0.866075"
    assert set(chunk.failures) == {1, 2, 3}


def test_a_law_that_loses_its_meaning_is_told(monkeypatch):
    def strict(_, e, __):
        if e < 0.25:
            raise InputError("no meaning, on purpose")

    parameters = {**PAPER, "e": [0.2, 0.2499, 0.2501, 0.8], "T_surface": 7.0}
    study = from_dict({"design": {"kind": "list"}, "parameters": parameters}, Path())
    monkeypatch.setattr(engine, "require_positive", strict)
    engine._meaningful.cache_clear()
    try:
        chunk = solve_chunk(study, 0)
    finally:
        engine._meaningful.cache_clear()
    assert chunk.status.tolist() == [
        PointStatus.INVALID,
        PointStatus.INVALID,
        PointStatus.COMPLETE,
        PointStatus.COMPLETE,
    ]
    assert chunk.failures == {0: "no meaning, on purpose", 1: "no meaning, on purpose"}


def broken_at(slope):
    """The engine of given surface temperatures, broken by one chute."""
    sound = engine.solve_at_temperature

    def broken(batch, *others):
        if (batch.slope == slope).any():
            raise FloatingPointError("broken on purpose")
        return sound(batch, *others)

    return broken


def slopes_study():
    slopes = [0.25, 0.28, 0.3, 0.31, 0.33]
    return from_dict({"design": {"kind": "list"}, "parameters": {**PAPER, "slope": slopes, "T_surface": 7.0}}, Path())


def test_a_chute_that_breaks_its_batch_is_solved_alone(monkeypatch):
    sound = solve_chunk(slopes_study(), 0)
    monkeypatch.setattr(engine, "solve_at_temperature", broken_at(0.31))
    chunk = solve_chunk(slopes_study(), 0)
    assert chunk.singly == 1
    assert not chunk.failures
    others = [0, 1, 2, 4]
    for name, values in chunk.quantities.items():
        # To the last bit: nothing of a chute depends on those beside it.
        assert np.array_equal(values[others], sound.quantities[name][others], equal_nan=True)
        assert values[3] == pytest.approx(sound.quantities[name][3], rel=1e-8, nan_ok=True)


def test_a_chute_that_cannot_be_solved_at_all_is_told(monkeypatch):
    def given_up(*_, **__):
        raise SolveError("given up on purpose")

    monkeypatch.setattr(engine, "solve_at_temperature", broken_at(0.31))
    monkeypatch.setattr(engine, "solve_within", given_up)
    chunk = solve_chunk(slopes_study(), 0)
    assert chunk.status.tolist() == [0, 0, 0, PointStatus.FAILED, 0]
    assert chunk.reason[3] == Reason.NO_ANSWER
    assert chunk.failures == {3: "given up on purpose"}
    assert (chunk.n_flows > 0).tolist() == [True, True, True, False, True]


def test_why_there_is_no_flow():
    def reason_at(slope, e, ew, r):
        parameters = {"slope": slope, "e": e, "ew": ew, "roughness": r, "T_surface": 1.0}
        return Reason(
            solve_chunk(from_dict({"design": {"kind": "list"}, "parameters": parameters}, Path()), 0).reason[0]
        )

    assert reason_at(0.05, 0.8, 0.8, 0.6) == Reason.BASE_AND_INTERIOR_LOSE_ENERGY
    assert reason_at(1.5, 0.9, 0.9, 0.6) == Reason.BASE_AND_INTERIOR_GAIN_ENERGY
    assert reason_at(0.43, 0.8, 0.8, 0.6) == Reason.TOO_STEEP_FOR_HOT_FLOWS_NO_OTHER_FOUND


def test_the_numbers_that_follow_from_others_are_those_of_the_flows():
    names = ["mean_velocity", "froude_number", "angle"]
    table = {
        "parameters": {"slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6, "Q": 3.0},
        "results": {"quantities": names},
    }
    side_by_side = solve_chunk(from_dict(table, Path()), 0).quantities
    table["results"] = {"quantities": [*names, "surface_velocity", "mean_volume_fraction"]}
    singly = solve_chunk(from_dict(table, Path()), 0).quantities
    found = flows(Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)
    for name, values in singly.items():
        wanted = [getattr(flow, name) for flow in found]
        np.testing.assert_allclose(values[0, :3], wanted, rtol=1e-7)
        if name in side_by_side:
            np.testing.assert_allclose(side_by_side[name][0, :3], wanted, rtol=1e-6)
