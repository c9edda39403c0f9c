"""Maps of existence against the flows that are solved one by one."""

import numpy as np
import pytest

from chuteflow import Chute, InputError, curve, domain, flows, hot
from chuteflow.branches.counting import flux_counts, most_at_once
from chuteflow.maps import CODES, exists_at
from chuteflow.maps.columns import PiecewiseConstant, alike
from chuteflow.maps.kinds import _monotonic_pieces, classify_flows
from chuteflow.maps.plane import ParameterAxis, ParameterPlane, classify
from chuteflow.maps.zeros import bound_extremes, evaluate_zeros
from chuteflow.steady.model import model
from chuteflow.theory.hot import dilute, hot_parameters
from chuteflow.theory.laws import law
from chuteflow.trajectories.refining import integrate_trajectories

from .domain_points import compare, enumerated, random_planes

TEMPERATURES = (1.0, 10.0, 100.0)


def some_chutes(surface):
    random = np.random.default_rng(4)
    materials = [(0.8, 0.8), (0.9, 0.6), (0.95, 0.7)]
    return [
        Chute(
            random.choice([0.2, 0.25, 0.3, 0.35, 0.4]),
            *materials[random.integers(3)],
            random.uniform(0.5, 0.86),
            surface=surface,
        )
        for _ in range(8)
    ]


@pytest.mark.parametrize("surface", ["free", "interface"])
def test_the_map_holds_the_flows_that_are_solved(surface):
    chutes = some_chutes(surface)
    found = exists_at(chutes, TEMPERATURES)
    solved = [[len(flows(chute, T_surface=t)) > 0 for t in TEMPERATURES] for chute in chutes]
    np.testing.assert_array_equal(found, solved)
    assert found.any()
    assert not found.all()


def test_a_chute_is_told_the_same_alone_and_in_company():
    chutes = [Chute(slope, 0.8, 0.8, r) for slope in (0.3, 0.4, 0.45) for r in (0.5, 0.6, 0.7, 0.8, 0.86)]
    together = exists_at(chutes, TEMPERATURES)
    alone = [exists_at([chute], TEMPERATURES)[0] for chute in chutes]
    np.testing.assert_array_equal(together, alone)


def test_hot_flows_end_where_the_closed_form_has_their_bounds():
    bounds = hot(Chute(0.3, 0.8, 0.8, 0.6)).slope_bounds
    assert bounds is not None
    inside, outside = bounds.lowest + 1e-3, bounds.lowest - 1e-3
    chutes = [Chute(slope, 0.8, 0.8, 0.6) for slope in (inside, outside)]
    assert exists_at(chutes, [1e4]).tolist() == [[True], [False]]
    # lambda = 2.909: beyond the bound in print, 2.284. The hold-up grows without bound towards lambda = 3.
    assert exists_at([Chute(0.4, 0.8, 0.8, 0.6)], [500.0]).item()
    assert not exists_at([Chute(0.4, 0.8, 0.8, 0.6)], [500.0], largest_holdup=10.0).item()


@pytest.mark.parametrize("temperature", [[], [-1.0], [[1.0]], [float("nan")]])
def test_a_temperature_that_cannot_be_is_refused(temperature):
    with pytest.raises(InputError, match="temperature"):
        exists_at([Chute(0.3, 0.8, 0.8, 0.6)], temperature)


# Maps


@pytest.fixture(scope="module")
def base_map():
    """Over both parameters of the base, which share one grid of trajectories."""
    return domain(
        Chute(0.3, 0.8, 0.8, 0.6),
        ("wall_restitution", 0.6, 0.9),
        ("roughness", 0.5, 0.866),
        size=(50, 40),
        temperatures=TEMPERATURES,
        tolerance=0.01,
    )


@pytest.mark.parametrize(("surface", "seed", "count"), [("free", 11, 16), ("interface", 12, 6)])
def test_points_are_classified_as_by_the_full_enumeration(surface, seed, count):
    _near, far, unknown = compare(seed, count, 2e-3, surface)
    assert not far
    assert not unknown


@pytest.mark.parametrize(("seed", "slope"), [(103, 0.4368441269246962), (104, 0.47473192667213815)])
def test_what_deep_trajectories_show_by_interpolation_alone_is_no_kind(seed, slope):
    plane, place = next(
        point for point in random_planes(seed) if point[0].chute_at(*point[1]).slope == pytest.approx(slope, rel=1e-12)
    )
    assert classify(plane, *place) == enumerated(plane.chute_at(*place))


@pytest.mark.slow
@pytest.mark.parametrize("surface", ["free", "interface"])
@pytest.mark.parametrize("seed", range(100, 110))
def test_a_thousand_points_for_each_surface_are_classified_as_by_the_full_enumeration(surface, seed):
    _near, far, unknown = compare(seed, 100, 2e-3, surface)
    # Where deep branches are many, neither side is sure of their number.
    assert len({chute for _, _, _, chute in far}) <= 3
    assert len(unknown) <= 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("closure", "base"),
    [("garzo-dufty", "richman"), ("extended", "richman:diameter=1.2"), ("lun", "johnson-jackson:specularity=0.2")],
)
def test_points_under_other_laws_on_other_bases_are_those_of_the_full_enumeration(closure, base):
    chute = Chute(0.3, 0.8, 0.8, 0.6, closure=closure, base=base)
    plane = ParameterPlane(
        ParameterAxis("slope", 0.28, 0.4), ParameterAxis("roughness", 0.56, 0.7), chute, TEMPERATURES
    )
    assert plane.hot_known is (closure != "garzo-dufty")
    for place in ((0.15, 0.3), (0.8, 0.6)):
        assert classify(plane, *place) == enumerated(plane.chute_at(*place))


def test_a_map_under_a_law_without_a_temperature_far_above_leaves_hot_flows_open():
    chute = Chute(0.3, 0.8, 0.8, 0.6, closure="garzo-dufty")
    found = domain(chute, ("wall_restitution", 0.7, 0.8), ("roughness", 0.6, 0.65), size=(4, 4), tolerance=0.1)
    assert (found.hot == -1).all()
    assert found.exists.any()
    with pytest.raises(InputError, match=r"closure garzo-dufty at e = 0\.5: T grows so fast far above"):
        domain(chute, ("restitution", 0.5, 0.8), ("roughness", 0.6, 0.65))


def test_cells_are_those_of_their_centres(base_map):
    plane, random = base_map.plane, np.random.default_rng(1)
    wrong = 0
    for _ in range(60):
        j, i = int(random.integers(len(base_map.y))), int(random.integers(len(base_map.x)))
        u, v = (i + 0.5) / len(base_map.x), (j + 0.5) / len(base_map.y)
        found = classify(plane, u, v)
        said = (base_map.most[j, i], base_map.families[j, i])
        if said != found[:2]:
            around = [classify(plane, u + a * 0.01, v + b * 0.01)[:2] for a in (-1, 0, 1) for b in (-1, 0, 1)]
            assert said in around
            wrong += 1
    assert wrong < 6


def test_boundaries_part_what_differs(base_map):
    plane = base_map.plane
    kinds = {boundary.kind for boundary in base_map.boundaries}
    assert {"F21=0", "existence", "multiplicity", "temperature"} <= kinds
    checked = 0
    for boundary in base_map.boundaries:
        if boundary.kind != "temperature" or len(boundary.points) < 8:
            continue
        number = len(CODES) + TEMPERATURES.index(boundary.temperature)
        for first, last in zip(boundary.points[2:-2], boundary.points[3:-2], strict=False):
            x, y = 0.5 * (first + last)
            u, v = (x - 0.6) / 0.3, (y - 0.5) / (plane.y.high - 0.5)
            along = np.array([(last - first)[0] / 0.3, (last - first)[1] / (plane.y.high - 0.5)])
            across = np.array([-along[1], along[0]]) / max(np.hypot(*along), 1e-12) * 0.011
            beside = [(u + s * across[0], v + s * across[1]) for s in (-1.0, 1.0)]
            if not all(0.0 <= share <= 1.0 for point in beside for share in point):
                continue
            sides = [classify(plane, *point)[number] for point in beside]
            assert sides[0] != sides[1]
            checked += 1
    assert checked > 20


def test_hot_flows_end_on_the_closed_form(base_map):
    limit = dilute(law("lun"), 0.8, 0.0)
    lines = [boundary for boundary in base_map.boundaries if boundary.kind == "F21=0"]
    off = [
        abs(hot_parameters(limit, float(point[0]), float(point[1]), 0.3).F21)
        for boundary in lines
        for point in boundary.points[1:-1]
    ]
    assert max(off) < 5e-4
    inside = [hot(Chute(0.3, 0.8, x, y)).exists for x in base_map.x[::9] for y in base_map.y[::9]]
    assert base_map.hot[::9, ::9].T.ravel().astype(bool).tolist() == inside


def test_regions_fill_the_plane_once(base_map):
    def area(polygon):
        x, y = polygon.T
        return 0.5 * abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))

    regions = base_map.regions("most")
    whole = (0.9 - 0.6) * (base_map.plane.y.high - 0.5)
    assert sum(area(region.polygon) for region in regions) == pytest.approx(whole)
    threes = sum(area(region.polygon) for region in regions if region.value == 3)
    assert threes / whole == pytest.approx((base_map.most == 3).mean(), abs=0.02)


def test_axes_may_be_given_either_way_round(base_map):
    turned = domain(
        Chute(0.3, 0.8, 0.8, 0.6),
        ("roughness", 0.5, 0.866),
        ("wall_restitution", 0.6, 0.9),
        size=(40, 50),
        tolerance=0.05,
    )
    assert (base_map.most == turned.most.T).mean() > 0.95
    assert (base_map.hot == turned.hot.T).mean() > 0.95


def test_processes_change_nothing(base_map):
    given = {"size": (20, 20), "tolerance": 0.1}
    axes = ("wall_restitution", 0.7, 0.9), ("roughness", 0.5, 0.7)
    alone = domain(base_map.plane.chute, *axes, **given)
    together = domain(base_map.plane.chute, *axes, **given, workers=2)
    assert alone.columns == together.columns


def test_an_empty_plane_has_no_boundaries():
    found = domain(
        Chute(0.01, 0.8, 0.8, 0.6), ("wall_restitution", 0.6, 0.9), ("roughness", 0.5, 0.8), size=(5, 4), tolerance=0.1
    )
    assert not found.exists.any()
    assert not found.boundaries
    assert found.exists_at.shape == (0, 4, 5)


def test_the_interface_says_nothing_of_hot_flows():
    found = domain(
        Chute(0.3, 0.8, 0.8, 0.6, surface="interface"),
        ("wall_restitution", 0.6, 0.9),
        ("roughness", 0.5, 0.8),
        size=(5, 4),
        tolerance=0.1,
    )
    assert (found.hot == -1).all()
    assert found.exists.any()


def test_a_fold_of_the_curve_is_where_the_number_of_flows_changes(base_map):
    """The window of three flows by the folds that :func:`chuteflow.curve` locates, along one column of the map."""
    wall = 0.8
    u = (wall - 0.6) / 0.3
    counts = []
    for y in base_map.y[::4]:
        folds = [p for branch in curve(Chute(0.3, 0.8, wall, float(y))).branches for p in branch.special]
        counts.append(sum(point.kind == "fold-Q" for point in folds))
    mapped = [classify(base_map.plane, u, float((y - 0.5) / (base_map.plane.y.high - 0.5)))[0] for y in base_map.y[::4]]
    assert [count >= 2 for count in counts] == [most >= 3 for most in mapped]


def test_bands_narrower_than_can_be_resolved_are_left_out():
    left, right = PiecewiseConstant((0.2, 0.2005, 0.6), (0, 1, 2, 1)), PiecewiseConstant((0.21, 0.61), (0, 2, 1))
    pair = alike(left, right, 1e-3)
    assert pair is not None
    assert pair[0].stops == pytest.approx((0.20025, 0.6))
    assert alike(left, right, 1e-4) is None


@pytest.mark.parametrize(
    ("changed", "what"),
    [
        ({"size": (0, 5)}, "size"),
        ({"tolerance": 0.5}, "tolerance"),
        ({"temperatures": (1e9,)}, "temperature"),
        ({"workers": 0}, "workers"),
        ({"y": ("slope", 0.1, 0.2)}, "both axes"),
        ({"y": ("roughness", 0.1, 0.6)}, "roughness"),
        ({"y": ("roughness", 0.6, 0.5)}, "must rise"),
        ({"y": ("rough", 0.5, 0.6)}, "unknown parameter"),
        ({"largest_holdup": -1.0}, "hold-up"),
    ],
)
def test_what_cannot_be_mapped_is_refused(changed, what):
    given = {"x": ("slope", 0.1, 0.5), "y": ("roughness", 0.5, 0.8)} | changed
    with pytest.raises(InputError, match=what):
        domain(Chute(0.3, 0.8, 0.8, 0.6), **given)


def test_two_turns_of_the_flux_between_two_points_of_a_family_are_seen():
    # ln Q = s^3 - s/4 along a branch, between whose points it rises throughout.
    s = np.array([-1.2, -0.8, -0.55, 0.55, 0.8, 1.2])
    log_q, rise = s**3 - 0.25 * s, 3.0 * s**2 - 0.25
    assert (np.diff(log_q) > 0.0).all()
    assert (rise > 0.0).all()
    every, _ = _monotonic_pieces(s, np.zeros_like(s), log_q, rise)
    assert most_at_once(every) == 3
    near = np.linspace(-1.2, 1.2, 40)
    _, sure = _monotonic_pieces(near, np.zeros_like(near), near**3 - 0.25 * near, 3.0 * near**2 - 0.25)
    assert most_at_once(sure) == 3
    every, _ = _monotonic_pieces(s, np.zeros_like(s), s**3 + 0.25 * s, 3.0 * s**2 + 0.25)
    assert most_at_once(every) == 1


@pytest.mark.parametrize(
    ("slope", "roughness", "most"),
    [(0.38625, 0.57775, 2), (0.40375, 0.61475, 2), (0.358, 0.5275, 2), (0.36, 0.52825, 1), (0.385, 0.5735, 2)],
)
def test_scatter_of_deep_flows_makes_no_folds(slope, roughness, most):
    # In each, ln Q of neighbouring flows on the grid differs from a smooth line by more than its change.
    plane = ParameterPlane(
        ParameterAxis("slope", 0.25, 0.45), ParameterAxis("roughness", 0.5, 0.86), Chute(0.3, 0.8, 0.8, 0.6), ()
    )
    found = classify(plane, (slope - 0.25) / 0.2, (roughness - 0.5) / 0.36)
    assert found[CODES.index("most")] == most
    solved = curve(Chute(slope, 0.8, 0.8, roughness), points=10)
    assert max(count.flows for count in flux_counts(solved)) == most


def test_the_first_inverted_flow_is_where_the_density_at_its_base_first_rises():
    plane = ParameterPlane(
        ParameterAxis("slope", 0.25, 0.45), ParameterAxis("roughness", 0.5, 0.86), Chute(0.3, 0.8, 0.8, 0.6), ()
    )
    # By curves of 300 points it is at r = 0.76589.
    mapped = [classify(plane, 0.465, (r - 0.5) / 0.36)[CODES.index("inverted")] for r in (0.7654, 0.7664)]
    assert mapped == [1, 0]


def test_a_trajectory_that_runs_off_in_its_last_step_ends_no_map():
    chute = Chute(0.38750000000000007, 0.7901041666666666, 0.8, 0.6)
    grid = integrate_trajectories(model(chute), 1e-3, 1e5, 30.0)
    zeros = evaluate_zeros(grid, bound_extremes(grid))
    assert np.isfinite([zeros.log_q, zeros.log_m, zeros.log_t, zeros.rise]).all()


@pytest.mark.parametrize("surface", ["free", "interface"])
def test_a_grid_for_many_bases_shows_the_flows_that_a_grid_for_one_shows(surface):
    """On a slope where saddle and centre coexist, so that trajectories wind."""
    plane = ParameterPlane(
        ParameterAxis("roughness", 0.5, 0.866),
        ParameterAxis("wall_restitution", 0.4, 0.95),
        Chute(0.4, 0.8, 0.8, 0.7, surface),
        (),
    )
    for u, v in np.random.default_rng(3).uniform(size=(6, 2)):
        grid = integrate_trajectories(model(plane.chute_at(u, v)), 1e-3, 1e5, 30.0)
        alone = classify_flows(grid, bound_extremes(grid), (), plane.within)
        assert classify(plane, u, v)[:2] == (alone.most, alone.families)


@pytest.mark.parametrize(
    ("chute", "expected"),
    [
        (Chute(0.47470002445560056, 0.6572855104534975, 0.9508171882287197, 0.5855234301669094, "interface"), (0, 0)),
        (Chute(0.47503803782221854, 0.6586131909135841, 0.6871708648089082, 0.5711874528328157, "interface"), (0, 0)),
        (Chute(0.46259287459556375, 0.6596572551540848, 0.6437188262973245, 0.8158457924446051, "interface"), (3, 2)),
    ],
)
def test_deep_families_of_steep_chutes_are_those_that_are_solved(chute, expected):
    plane = ParameterPlane(ParameterAxis("slope", 0.1, 0.6), ParameterAxis("roughness", 0.5, 0.866), chute, ())
    found = classify(plane, (chute.slope - 0.1) / 0.5, (chute.roughness - 0.5) / 0.366)
    assert found[:2] == expected
