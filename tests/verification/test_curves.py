"""Curves: they depend on no step, number of points or range, and turn where the reference turns."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from chuteflow import Branch, Chute, Curve, SpecialPoint, curve, flows

from .reference import QUANTITIES, Case, refine
from .test_engine import guess_of, logs

CHUTES = {
    "three flows at one flux": Chute(0.3, 0.8, 0.8, 0.6),
    "below an interface": Chute(0.3, 0.8, 0.8, 0.6, "interface"),
    "productive": Chute(0.3, 0.9, 0.6, 0.8),
    "rough, with a fold of T": Chute(0.36, 0.8, 0.8, 0.85),
    "several families": Chute(0.29, 0.9, 0.8, 0.7),
}
#: Above this hold-up T_surface, a double, may not tell flows apart.
DEEP = 15.0
KINDS = {"fold-Q": 0, "fold-M": 2, "fold-T": 3}
QUICK = ("below an interface", "three flows at one flux")
SOME_SLOW = [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in CHUTES]


@cache
def traced(name: str, points: int = 200, low: float = 1e-2, high: float = 500.0) -> Curve:
    return curve(CHUTES[name], points=points, surface_temperature=(low, high))


def special_points(of: Curve) -> list[SpecialPoint]:
    return [point for branch in of.branches for point in branch.special]


def inside(point: SpecialPoint) -> bool:
    """Whether a point is well inside the narrowest of the ranges that are compared."""
    return 1.1e-2 < point.flow.surface_temperature < 450.0 and point.flow.mass_holdup < 27.0


def same_points(one: Curve, other: Curve) -> None:
    """Every special point of either is on the other, to 1e-8."""
    for here, there in ((one, other), (other, one)):
        for point in filter(inside, special_points(here)):
            distances = [
                np.abs(logs(point.flow) - logs(match.flow)).max()
                for match in special_points(there)
                if match.kind == point.kind
            ]
            assert min(distances, default=np.inf) < 1e-8, (point.kind, np.exp(logs(point.flow)))


@pytest.fixture(params=CHUTES)
def name(request):
    return request.param


@pytest.mark.parametrize("points", [50, 333])
def test_special_points_do_not_depend_on_the_number_of_points(name, points):
    assert special_points(traced(name))
    same_points(traced(name), traced(name, points))


def test_special_points_do_not_depend_on_the_range(name):
    same_points(traced(name), traced(name, 200, 2e-3, 5e4))


def test_a_branch_has_as_many_points_as_asked_for_without_jumps(name):
    longest = max(traced(name).branches, key=lambda branch: len(branch.flows))
    assert len(longest.flows) == 200
    quantities = (longest.mass_flux, longest.centre_of_mass, longest.mass_holdup, longest.surface_temperature)
    steps = np.linalg.norm(np.diff(np.log(quantities), axis=1), axis=0)
    np.testing.assert_allclose(steps, steps.mean(), rtol=0.3)


def test_every_flow_of_a_branch_is_found_at_its_own_temperature(name):
    for branch in traced(name).branches:
        for i in range(0, len(branch.flows), max(1, len(branch.flows) // 3)):
            flow = branch.flows[i]
            if flow.mass_holdup > DEEP:
                continue
            found = flows(CHUTES[name], T_surface=flow.surface_temperature)
            distance = min(np.abs(logs(other) - logs(flow)).max() for other in found)
            assert distance < 1e-8 + 10.0 * _error_near_fold(branch, i)


def _error_near_fold(branch: Branch, i: int) -> float:
    """Error of M at given T_surface from an error of 1e-11 in T_surface: large where T_surface turns."""
    near = slice(max(i - 1, 0), i + 2)
    t, m = np.log(branch.surface_temperature[near]), np.log(branch.mass_holdup[near])
    return 1e-11 * float(np.ptp(m) / (np.ptp(t) + 1e-300))


@pytest.mark.parametrize("name", SOME_SLOW)
def test_flows_of_a_branch_are_those_of_the_reference(name):
    chute = CHUTES[name]
    case = Case(chute.slope, chute.restitution, chute.wall_restitution, chute.roughness, chute.surface)
    for branch in traced(name).branches:
        for flow in branch.flows[:: max(1, len(branch.flows) // 3)]:
            reference = refine(case, 2, flow.mass_holdup, guess_of(flow))
            # where M turns a flow is not known by its M
            known = reference.error < 1e-11
            assert not known or np.abs(reference.logs - logs(flow))[:3].max() < 1e-9


@pytest.mark.parametrize("name", SOME_SLOW)
def test_a_quantity_turns_where_the_fold_says(name):
    """Flows of the reference at either side of a fold, at equal steps of another quantity, agree to second order."""
    chute = CHUTES[name]
    case = Case(chute.slope, chute.restitution, chute.wall_restitution, chute.roughness, chute.surface)
    for point in filter(inside, special_points(traced(name))):
        if point.kind not in KINDS:
            continue
        turning = KINDS[point.kind]
        along = 2 if turning != 2 else 3
        at = logs(point.flow)
        step = 1e-3
        sides = []
        for shift in (-2.0, -1.0, 1.0, 2.0):
            value = float(np.exp(at[along] + shift * step))
            sides.append(refine(case, along, value, guess_of(point.flow)).logs[turning])
        slope = (sides[0] - 8.0 * sides[1] + 8.0 * sides[2] - sides[3]) / (12.0 * step)
        bend = (sides[1] - 2.0 * at[turning] + sides[2]) / step**2
        assert abs(slope / bend) < 1e-6, (point.kind, np.exp(at))
        assert abs(bend) > 1e-3


@pytest.mark.parametrize("beside", [pytest.param(1e-2, marks=pytest.mark.slow), 1e-5, 1e-8])
def test_two_flows_more_on_one_side_of_a_fold(name, beside):
    chute = CHUTES[name]
    case = Case(chute.slope, chute.restitution, chute.wall_restitution, chute.roughness, chute.surface)
    for point in filter(inside, special_points(traced(name))):
        if point.kind not in KINDS:
            continue
        which = KINDS[point.kind]
        at = logs(point.flow)
        found = []
        for value in np.exp(at[which] + np.array([-beside, beside])):
            condition: dict[str, Any] = {QUANTITIES[which]: float(value)}
            found.append(flows(chute, **condition))
        fewer, more = sorted(found, key=len)
        assert len(more) == len(fewer) + 2, (point.kind, np.exp(at), len(fewer), len(more))
        for flow in sorted(more, key=lambda flow: np.abs(logs(flow) - at).max())[:2]:
            # by its M, which is known where Q and T are not, and the other way round
            along = 2 if which != 2 else 3
            reference = refine(case, along, float(np.exp(logs(flow)[along])), guess_of(flow))
            assert abs(reference.logs[which] - logs(flow)[which]) < 1e-9
