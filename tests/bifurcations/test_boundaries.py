"""Boundaries through a second parameter, held against curves, finite differences, exact limits and scaling laws."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import chuteflow
from chuteflow import Chute, InputError, boundary, curve, flows
from chuteflow.bifurcations.conditions import FixedQuantity, InteriorChange, Inversion, Linearisation
from chuteflow.bifurcations.regions import count_flows, find_kinds_beside, find_range_edges
from chuteflow.bifurcations.system import SecondParameter
from chuteflow.bifurcations.tracing import CONTROL
from chuteflow.steady.collocation import LOG_Q, LOG_T, Collocation
from chuteflow.steady.hot import hot

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
PRODUCTIVE = Chute(0.3, 0.9, 0.6, 0.8)


@pytest.fixture(scope="module")
def folds():
    return boundary(PAPER, of="fold-Q", second="slope", bounds=(0.28, 0.32), samples=3)


@pytest.fixture(scope="module")
def cusped():
    return boundary(PAPER, of="fold-Q", second="slope", bounds=(0.355, 0.372), samples=2)


@pytest.fixture(scope="module")
def onset():
    return boundary(PAPER, of="density-inversion", second="slope", bounds=(0.25, 0.4), samples=4)


# Independent confirmation: special points of curves


def special(chute, kind, **ranges):
    return [s.flow for branch in curve(chute, points=60, **ranges).branches for s in branch.special if s.kind == kind]


@pytest.mark.parametrize("slope", [0.2871, 0.3, 0.3143])
def test_folds_of_curves_lie_on_the_boundaries(folds, slope):
    wanted = sorted(f.mass_flux for f in special(replace(PAPER, slope=slope), "fold-Q"))
    got = sorted(flow.mass_flux for line in folds for flow in line.at(slope))
    assert len(wanted) == 2
    np.testing.assert_allclose(got, wanted, rtol=1e-9)


@pytest.mark.parametrize(
    ("of", "second", "bounds", "chute", "ranges"),
    [
        ("fold-M", "wall_restitution", (0.58, 0.62), PRODUCTIVE, {"largest_holdup": 10.0}),
        ("fold-T", "slope", (0.29, 0.302), PRODUCTIVE, {"largest_holdup": 10.0}),
        ("density-inversion", "restitution", (0.79, 0.81), PAPER, {}),
        ("density-inversion", "roughness", (0.59, 0.61), replace(PAPER, surface="interface", slope=0.31), {}),
        ("interior-change", "roughness", (0.62, 0.63), replace(PRODUCTIVE, closure="lun-fourier"), {}),
    ],
)
def test_special_points_of_curves_lie_on_the_boundaries(of, second, bounds, chute, ranges):
    found = boundary(chute, of=of, second=second, bounds=bounds, samples=2, **ranges)
    value = 0.3 * bounds[0] + 0.7 * bounds[1]
    wanted = sorted(f.surface_temperature for f in special(replace(chute, **{second: value}), of, **ranges))
    got = sorted(flow.surface_temperature for line in found for flow in line.at(value))
    assert wanted
    # where a curve turns, its fold is known to the root of the rounding; at a crossing of zero more closely
    np.testing.assert_allclose(got, wanted, rtol=3e-6)
    assert all(line.error.max() < 1e-8 for line in found)


def test_points_are_steady_flows_of_their_chutes(folds):
    (line, *_) = folds
    for flow in line.flows[:: len(line.flows) // 4]:
        again = flows(flow.chute, T_surface=flow.surface_temperature)
        assert min(abs(f.mass_holdup / flow.mass_holdup - 1.0) for f in again) < 1e-9


# Cusps, and what the paper says


def test_the_cusp_is_where_two_folds_merge_with_their_power_laws(cusped):
    (turn,) = [turn for line in cusped for turn in line.cusps]
    (line,) = [line for line in cusped if line.cusps]
    cusp = turn.flow
    assert turn.error < 1e-9
    assert cusp.chute.slope == pytest.approx(0.362991648514, abs=1e-11)
    steps = np.array([2e-5, 8e-5])
    pairs = [line.at(cusp.chute.slope + step) for step in steps]
    assert [len(pair) for pair in pairs] == [2, 2]
    assert line.at(cusp.chute.slope - 1e-6) == []
    for power, quantity in ((0.5, "surface_temperature"), (1.5, "mass_flux")):
        gaps = [abs(np.log(getattr(a, quantity) / getattr(b, quantity))) for a, b in pairs]
        assert np.log(gaps[1] / gaps[0]) / np.log(4.0) == pytest.approx(power, abs=0.02)


def test_three_flows_live_between_the_folds_beyond_the_cusp(cusped):
    (line,) = [line for line in cusped if line.cusps]
    slope = line.cusps[0].flow.chute.slope + 4e-4
    low, high = sorted(flow.mass_flux for flow in line.at(slope))
    within: dict[str, Any] = {"surface_temperature": (0.01, 100.0)}
    counts = [len(flows(replace(PAPER, slope=slope), Q=q, **within)) for q in (0.999 * low, (low * high) ** 0.5)]
    assert counts[1] == counts[0] + 2
    before = replace(PAPER, slope=line.cusps[0].flow.chute.slope - 1e-4)
    assert len(special(before, "fold-Q", **within)) == 1
    assert len(special(replace(PAPER, slope=slope), "fold-Q", **within)) == 3


def test_three_flows_turn_into_a_minimum_near_the_slope_of_the_paper():
    found = boundary(PAPER, bounds=(0.32, 0.35), samples=2)
    ends = {max(line.parameter[0], line.parameter[-1]): line for line in found}
    # the fold of the minimum goes on, the other one runs to cold flows
    assert max(ends) == pytest.approx(0.35)
    other = min(ends)
    assert other == pytest.approx(0.33694, abs=1e-4)
    assert "below 0.001" in " ".join(ends[other].ends)


def test_inversions_begin_and_are_complete_at_the_slopes_of_the_paper(onset):
    (line,) = onset
    first = min(turn.flow.chute.slope for turn in line.special)
    assert first == pytest.approx(0.29, abs=1e-3)
    assert line.parameter.max() == pytest.approx(0.333, abs=4e-3)
    index = len(line.flows) // 2
    assert find_kinds_beside(line, LOG_T, index) == ("monotonic", "inverted")


def test_the_onset_of_inversion_tends_to_the_exact_hot_limit_like_one_over_the_temperature(onset):
    (line,) = onset
    low, high = 0.33, 0.34
    for _ in range(60):  # of the slope at which hot flows turn inverted in the exact solution
        middle = 0.5 * (low + high)
        low, high = (low, middle) if hot(replace(PAPER, slope=middle)).inverted else (middle, high)
    warm = line.surface_temperature > 500.0
    off = (line.parameter[warm] - low) * line.surface_temperature[warm]
    assert np.ptp(off) < 0.02 * abs(off.mean())
    assert hot(replace(PAPER, slope=low)).as_dict()["lambda"] == pytest.approx(0.6603935, abs=1e-6)


def test_the_hottest_limit_of_the_range_is_that_of_the_exact_hot_flow(folds):
    (line,) = [line for line in find_range_edges(folds) if line.surface_temperature.min() > 9e4]
    for flow in (line.flows[0], line.flows[-1]):
        assert flow.mass_holdup == pytest.approx(hot(flow.chute).as_dict()["M"], rel=1e-4)


# The range, and what is found in it


def test_a_pair_of_folds_between_two_sampled_values_is_found():
    found = boundary(PAPER, bounds=(0.35, 0.4), samples=2, surface_temperature=(0.05, 20.0))
    (line,) = [line for line in found if line.cusps]
    assert found.bounds[0] < line.parameter.min()
    assert line.parameter.max() < found.bounds[1]


def test_crossings_of_families_are_the_same_seen_by_two_quantities():
    chute = replace(PRODUCTIVE, surface="interface")
    ranges = {"surface_temperature": (0.01, 0.2), "largest_holdup": 2.0}
    places = []
    for of in ("fold-M", "fold-T"):
        found = boundary(chute, of=of, bounds=(0.3305, 0.3317), samples=3, **ranges)
        (turn,) = [t for line in found for t in line.special if t.kind == "crossing"]
        places.append((turn.flow.chute.slope, turn.flow.mass_holdup, turn.flow.surface_temperature))
    np.testing.assert_allclose(places[0], places[1], rtol=1e-7)


def test_ends_are_at_the_edges_of_the_range(folds, onset):
    for line in folds:
        assert {line.parameter[0], line.parameter[-1]} == {0.28, 0.32}
        assert all("is the end of its range" in end for end in line.ends)
    (line,) = onset
    np.testing.assert_allclose(sorted(line.surface_temperature[[0, -1]]), [1e-3, 1e5], rtol=1e-10)


def test_a_boundary_does_not_depend_on_the_path(folds):
    control = replace(CONTROL, initial_step=0.01, max_step=0.1, max_angle=0.05)
    other = boundary(PAPER, bounds=(0.27, 0.32), samples=2, control=control)
    assert len(other) == len(folds)
    for slope in (0.2901, 0.3107):
        one, two = (sorted(f.mass_flux for line in s for f in line.at(slope)) for s in (folds, other))
        np.testing.assert_allclose(one, two, rtol=1e-9)


def test_a_parameter_may_end_where_chutes_end():
    found = boundary(PAPER, second="wall_restitution", bounds=(0.95, 1.0), samples=2)
    assert max(line.parameter.max() for line in found) == 1.0


def test_regions_are_counted(folds):
    low, high = sorted(flow.mass_flux for line in folds for flow in line.at(0.3))
    assert [count_flows(folds, 0.3, q) for q in (0.9 * low, (low * high) ** 0.5, 1.1 * high)] == [1, 3, 1]


def test_nothing_to_follow_has_a_reason():
    found = boundary(PAPER, of="fold-T", bounds=(0.29, 0.3), samples=2, surface_temperature=(0.1, 10.0))
    assert len(found) == 0
    assert found.reason is not None
    assert "fold-T" in found.reason


# Exact derivatives


def conditions():
    yield Inversion()
    yield InteriorChange(False)
    yield InteriorChange(True)
    yield FixedQuantity(LOG_Q, 0.3)


@pytest.mark.parametrize("second", ["slope", "restitution", "wall_restitution", "roughness"])
def test_derivatives_of_the_augmented_system_are_those_of_differences(folds, second):
    point = folds[0].traced.points[3]
    value = getattr(point.flow.chute, second)
    sweep = SecondParameter(point.flow.chute, second, 0.9 * value, 1.1 * value)
    degree, stretch = point.system.degree, point.system.stretch
    rng = np.random.default_rng(5)
    z = point.w[:-1] + 1e-3 * rng.standard_normal(len(point.w) - 1)
    direction = rng.standard_normal(len(z))
    direction /= np.linalg.norm(direction)

    def local(z, value):
        here, beyond = sweep.models(value)
        return Linearisation.at(Collocation(here, degree, stretch), Collocation(beyond, degree, stretch), z)

    base = local(z, value)
    made = [point.system.condition.adapt_to(base), *conditions()]
    step = 1e-5
    by_z = local(z + step * direction, value), local(z - step * direction, value)
    by_value = local(z, value + step), local(z, value - step)
    for condition in made:
        _, gradient, by_parameter = condition(base)
        ahead, behind = (condition(at)[0] for at in by_z)
        scale = 1e-6 * (1.0 + float(np.abs(gradient).max()))
        assert gradient @ direction == pytest.approx((ahead - behind) / (2 * step), rel=1e-5, abs=scale)
        ahead, behind = (condition(at)[0] for at in by_value)
        assert by_parameter == pytest.approx((ahead - behind) / (2 * step), rel=1e-5, abs=scale)
    np.testing.assert_allclose(
        base.by_parameter, (by_value[0].residual - by_value[1].residual) / (2 * step), rtol=1e-5, atol=1e-6
    )


# Bad input, and the package


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"of": "fold-h"}, "cannot follow 'fold-h': choose one of fold-Q"),
        ({"second": "surface"}, "unknown second parameter 'surface': choose one of slope"),
        ({"bounds": (0.4, 0.3)}, "the range must rise"),
        ({"bounds": (-0.1, 0.3)}, "slope"),
        ({"samples": 1}, "samples = 1: must be from 2 to 1000"),
        ({"tolerance": 1.0}, "tolerance 1: must be from"),
        ({"largest_holdup": 0.0}, "largest hold-up"),
    ],
)
def test_bad_input(given, message):
    with pytest.raises(InputError, match=message):
        boundary(PAPER, **({"bounds": (0.28, 0.32)} | given))


def test_only_folds_bound_numbers_of_flows(onset):
    with pytest.raises(InputError, match="do not bound numbers of flows"):
        count_flows(onset, 0.3, 1.0)


def test_the_names_are_at_the_top_of_the_package(folds):
    assert isinstance(folds, chuteflow.BoundarySet)
    assert isinstance(folds[0], chuteflow.Boundary)


@pytest.mark.slow
def test_a_boundary_holds_its_own_points():
    # Deep, cold flows at its end are not resolved to the tolerance where they are solved once more.
    found = boundary(replace(PAPER, slope=0.373), bounds=(0.373, 0.3747), samples=2)
    lines = [line.traced for line in found]
    assert len(lines) == 2
    for line, other in (lines, lines[::-1]):
        assert all(line.holds(point) for point in (*line.points[:3], *line.points[-3:]))
        assert not any(line.holds(point) for point in other.points[::8])


@pytest.mark.slow
def test_each_boundary_is_listed_once():
    found = boundary(replace(PAPER, slope=0.34), bounds=(0.34, 0.38), samples=9)
    assert len(found) == 2
    assert [turn.kind for line in found for turn in line.special] == ["cusp"]
    line, other = (b.traced for b in found)
    assert line.repeats(line)
    assert not line.repeats(other)
    assert not other.repeats(line)
