"""Derivatives of flows to parameters: against complex steps through the solver, and differences of solved flows."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from chuteflow import Chute, Flow, InputError, curve, flows, load, save
from chuteflow.numerics.complex_step import STEP
from chuteflow.steady import linearised
from chuteflow.steady.collocation import LOG_Q
from chuteflow.steady.free import all_free, free_parameter, vary
from chuteflow.steady.model import step_model
from chuteflow.steady.quantities import FIELDS, NUMBERS
from chuteflow.steady.sensitivity import sensitivity

CHUTE = Chute(0.3, 0.8, 0.8, 0.6)
#: Central differences of order 8: weights of the values at +-1, +-2, ... steps.
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
#: Relative steps that suit them: the smaller the more the flow changes.
STEPS = {"slope": 1e-3, "e": 8e-4, "ew": 2e-3, "roughness": 1e-3, "closure.packing": 4e-3, "base.diameter": 4e-3}
CASES = {
    "lun": (CHUTE, {"Q": 3.0}),
    "interface": (replace(CHUTE, surface="interface"), {"Q": 3.0}),
    "friction": (replace(CHUTE, closure="lun:friction=0.02"), {"M": 1.0}),
    "garzo-dufty-fourier": (replace(CHUTE, closure="garzo-dufty-fourier"), {"h": 1.8}),
    "another base": (replace(CHUTE, slope=0.32, base="johnson-jackson:specularity=0.3"), {"M": 0.5}),
}


def coldest(chute, condition):
    return flows(chute, **condition, tolerance=1e-11)[-1]


def through_the_solver(flow, parameter, at):
    """Derivatives of ln Q, ln h, ln M and ln T_surface by Newton's method in complex numbers from ``flow``."""
    problem = replace(flow.solution.problem, model=step_model(flow.chute, parameter.model_name))
    z = flow.solution.z.astype(complex)
    target = flow.solution.state.macroscopic()[at]
    for _ in range(4):
        state = problem.state(z)
        off = np.append(state.residual(), state.macroscopic()[at] - target)
        z = z - np.linalg.solve(np.concatenate([state.jacobian(), state.macroscopic_gradient()[at][None]]), off)
    return problem.state(z).macroscopic().imag / STEP


@pytest.mark.parametrize("name", CASES)
def test_derivatives_are_those_of_a_complex_step_through_the_solver(name):
    chute, condition = CASES[name]
    flow = coldest(chute, condition)
    found = flow.sensitivity()
    for j, parameter in enumerate(found.parameters):
        wanted = through_the_solver(flow, parameter, LOG_Q)
        place = [found.logarithmic[n][j] for n in ("mass_flux", "centre_of_mass", "mass_holdup", "surface_temperature")]
        np.testing.assert_allclose(place, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


def finer(problem, z, parts):
    """The flow on a grid with so many pieces in the place of each, and its unknowns there."""
    breaks = np.array(problem.breaks)
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(parts) / parts
    other = replace(problem, breaks=(*inner.ravel().tolist(), 1.0))
    nodes = len(problem.grid.nodes)
    return other, np.concatenate([problem.grid.interpolate(z[:nodes], other.grid.nodes), z[nodes:]])


@pytest.mark.parametrize(("closure", "holdup", "parts"), [("garzo-dufty", 1.2, 3), ("extended", 2.0, 6)])
def test_the_sparse_solution_on_many_pieces_is_that_of_the_dense_matrix(closure, holdup, parts, monkeypatch):
    monkeypatch.setattr(linearised, "_DENSE", 0)
    flow = flows(replace(CHUTE, closure=closure), M=holdup)[0]
    problem, z = finer(flow.solution.problem, flow.solution.z, parts)
    state = problem.state(z)
    gradient = state.macroscopic_gradient()
    border = np.array([0.1, 0.2, 1.0, 0.3]) @ gradient
    sides = np.zeros((len(z), 2))
    sides[-1, 0] = 1.0
    sides[:-1, 1] = -state.residual() + np.sin(np.arange(len(z) - 1.0)) * np.abs(state.jacobian()).max(axis=1)
    found = linearised.solve_bordered(state, border, sides)
    wanted = np.linalg.solve(np.concatenate([state.jacobian(), border[None]]), sides)
    assert np.abs(found - wanted).max(axis=0) == pytest.approx([0.0, 0.0], abs=1e-12 * np.abs(wanted).max())
    rates = linearised.rates_along_branch(state, gradient)
    along = gradient @ wanted[:, 0]
    np.testing.assert_allclose(np.outer(rates, along), np.outer(along, rates), rtol=1e-12, atol=1e-12)


def differences(flow, condition, parameter, z, step):
    """Derivatives of numbers and fields of independently solved flows, by central differences of order 8."""
    value = parameter.of(flow.chute)
    numbers = dict.fromkeys(NUMBERS, 0.0)
    fields = {name: np.zeros(len(z)) for name in FIELDS}
    for k, weight in enumerate(WEIGHTS, 1):
        for sign in (1.0, -1.0):
            there = coldest(vary(flow.chute, [parameter], [value + sign * k * step]), condition)
            profile = there.profile(z)
            for name in NUMBERS:
                numbers[name] += sign * weight * getattr(there, name) / step
            for name in FIELDS:
                fields[name] = fields[name] + sign * weight * getattr(profile, name) / step
    return numbers, fields


@pytest.mark.parametrize("key", STEPS)
def test_numbers_and_profiles_agree_with_differences_of_flows(key):
    # The coldest flow is far from folds, so that differences have nine digits.
    condition = {"Q": 3.0}
    flow = coldest(CHUTE, condition)
    parameter = free_parameter(CHUTE, key)
    z = np.linspace(0.0, 2.0 * flow.centre_of_mass, 6)
    numbers, fields = differences(flow, condition, parameter, z, STEPS[key] * parameter.of(CHUTE))
    found = sensitivity(flow, [key])
    profiles = found.profile(z)
    for name in NUMBERS:
        if np.isfinite(getattr(flow, name)) and name != "mass_flux":
            size = abs(numbers[name]) + 1e-2 * getattr(flow, name)
            assert abs(found.numbers[name][0] - numbers[name]) < 1e-9 * size, name
    for name in FIELDS:
        if name != "height":
            size = np.abs(fields[name]).max()
            np.testing.assert_allclose(profiles[name][0], fields[name], atol=1e-9 * size, err_msg=name)


@pytest.mark.parametrize("at", ["M", "h", "T_surface"])
def test_any_place_can_be_kept(at):
    flow = coldest(CHUTE, {"Q": 3.0})
    value = {"M": flow.mass_holdup, "h": flow.centre_of_mass, "T_surface": flow.surface_temperature}[at]
    kept: dict[str, Any] = {at: value}
    found = flow.sensitivity(["ew"], at=at)
    step = 4e-4 * CHUTE.wall_restitution
    change = 0.0
    for k, weight in enumerate(WEIGHTS, 1):
        for sign in (1.0, -1.0):
            moved = replace(CHUTE, wall_restitution=CHUTE.wall_restitution + sign * k * step)
            near = min(
                flows(moved, tolerance=1e-11, **kept),
                key=lambda other: np.abs(other.solution.macroscopic - flow.solution.macroscopic).max(),
            )
            change += sign * weight * near.mass_flux / step
    assert found.numbers["mass_flux"][0] == pytest.approx(change, rel=2e-9)
    assert found.numbers[{"M": "mass_holdup", "h": "centre_of_mass", "T_surface": "surface_temperature"}[at]][0] == 0.0


def folds(chute):
    return [p for branch in curve(chute).branches for p in branch.special if p.kind == "fold-Q"]


def test_at_a_fold_what_is_infinite_is_said_and_the_rest_is_finite():
    point = folds(CHUTE)[0]
    found = point.flow.sensitivity(["slope", "e"])
    assert "fold of Q" in str(found.at_fold)
    assert np.isinf(found.numbers["mass_holdup"]).all()
    assert found.numbers["mass_flux"].tolist() == [0.0, 0.0]
    assert np.isinf(found.profile([0.5, 1.0])["velocity"]).all()
    along, across = found.numbers_along
    assert np.isfinite([along[name] for name in NUMBERS if name != "interface_height"]).all()
    assert np.isfinite([across[name] for name in NUMBERS if name != "interface_height"]).all()
    assert all(np.isfinite(values).all() for values in found.profile_along([0.5, 1.0])[1].values())
    # The flows at this flux turn in the parameter.
    path = found.path("e")
    assert abs(path["e"]) < 1e-6
    assert sum(value**2 for value in path.values()) == pytest.approx(1.0)
    # At a fixed hold-up nothing is special.
    assert found.held("M").at_fold is None
    assert np.isfinite(found.held("M").numbers["mass_flux"]).all()


def test_a_fold_moves_with_what_changes_across_the_branch():
    step = 1e-4
    for i, point in enumerate(folds(CHUTE)):
        found = point.flow.sensitivity(["e"])
        high, low = (folds(replace(CHUTE, restitution=0.8 + sign * step))[i].flow.mass_flux for sign in (1.0, -1.0))
        assert found.across[LOG_Q, 0] == pytest.approx(np.log(high / low) / (2.0 * step), rel=1e-5)


def test_the_derivative_along_a_path_keeps_the_flux():
    found = coldest(CHUTE, {"Q": 3.0}).sensitivity(["e"])
    path = found.path("e")
    assert path["ln Q"] == pytest.approx(0.0, abs=1e-12)
    assert path["ln M"] / path["e"] == pytest.approx(found.logarithmic["mass_holdup"][0], rel=1e-9)


def test_profiles_at_a_share_of_the_mass_follow_the_grains():
    flow = coldest(CHUTE, {"Q": 3.0})
    found = flow.sensitivity(["ew"])
    share = np.array([0.2, 0.7, 1.0])
    moved, kept = found.profile(share, "overburden"), found.profile(flow.at_overburden(share).height)
    assert moved["height"][0, -1] == pytest.approx(0.0, abs=1e-9)
    # Where all of the mass is above, that is the base under either coordinate.
    assert moved["velocity"][0, -1] == pytest.approx(kept["velocity"][0, -1], rel=1e-8)
    with pytest.raises(InputError, match="choose one of height, overburden"):
        found.profile(share, "depth")


def test_a_flow_from_a_file_has_the_same_derivatives(tmp_path):
    flow = coldest(CHUTE, {"Q": 3.0})
    save(flow, tmp_path / "flow.json")
    found = load(tmp_path / "flow.json")
    assert isinstance(found, Flow)
    loaded = found.sensitivity(["e"]).numbers
    for name, values in flow.sensitivity(["e"]).numbers.items():
        np.testing.assert_allclose(loaded[name], values, rtol=1e-9, err_msg=name)


def test_all_numbers_that_can_vary_are_named():
    keys = {p.key for p in all_free(replace(CHUTE, closure="extended", base="johnson-jackson"))}
    assert keys == {
        "slope", "e", "ew", "closure.packing", "closure.friction", "base.specularity", "base.packing",
    }  # fmt: skip
    assert free_parameter(CHUTE, "restitution").key == "e"
    assert free_parameter(CHUTE, "friction").key == "closure.friction"
    with pytest.raises(InputError, match=r"closure.packing or base.packing"):
        free_parameter(replace(CHUTE, base="johnson-jackson"), "packing")
    with pytest.raises(InputError, match="unknown parameter 'sloppe'"):
        coldest(CHUTE, {"Q": 3.0}).sensitivity(["sloppe"])
    with pytest.raises(InputError, match="choose one of T_surface, Q, M, h"):
        coldest(CHUTE, {"Q": 3.0}).sensitivity(at="u")


def test_parameters_are_ranked():
    found = coldest(CHUTE, {"Q": 3.0}).sensitivity(["slope", "ew", "closure.packing"])
    assert [key for key, _ in found.ranked("surface_temperature")] == ["slope", "ew", "closure.packing"]
    with pytest.raises(InputError, match="unknown quantity"):
        found.ranked("speed")
