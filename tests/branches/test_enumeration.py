"""All flows of a chute: the paper's, hidden branches, extreme values, and why there is none."""

import json
import time
from pathlib import Path

import numpy as np
import pytest

from chuteflow import Chute, InputError, curve, flows
from chuteflow.branches.enumeration import flows_within
from chuteflow.branches.ranges import SearchRange
from chuteflow.steady.collocation import LOG_Q
from chuteflow.steady.solver import TOLERANCE

PAPER = Chute(0.3, 0.8, 0.8, 0.6)


def test_the_three_flows_of_the_paper():
    a, b, c = flows(PAPER, Q=3.0)
    assert [round(f.surface_temperature, 2) for f in (a, b, c)] == [7.34, 2.54, 0.20]
    assert c.surface_temperature == pytest.approx(0.197, abs=5e-4)
    assert [round(f.centre_of_mass, 2) for f in (a, b, c)] == [8.84, 3.98, 1.77]
    assert [round(f.mass_holdup, 2) for f in (a, b, c)] == [0.44, 0.59, 1.26]
    assert [f.density for f in (a, b, c)] == ["monotonic", "monotonic", "inverted"]
    assert {f.interior for f in (a, b, c)} == {"dissipative"}
    for flow in (a, b, c):
        assert flow.mass_flux == pytest.approx(3.0, rel=1e-12)
        assert flow.error <= 1e-10


@pytest.mark.parametrize(
    ("chute", "count"), [(Chute(0.3, 0.9, 0.6, 0.8), 2), (Chute(0.36, 0.8, 0.8, 0.85), 2), (PAPER, 1)]
)
def test_flows_of_one_surface_temperature(chute, count):
    found = flows(chute, T_surface=1.0)
    assert len(found) == count
    holdups = [f.mass_holdup for f in found]
    assert holdups == sorted(holdups)
    for flow in found:
        assert flow.surface_temperature == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("surface", ["free", "interface"])
@pytest.mark.parametrize("closure", ["lun", "lun-fourier"])
def test_the_same_flow_by_each_quantity(surface, closure):
    chute = Chute(0.3, 0.8, 0.8, 0.6, surface=surface, closure=closure)
    for flow in flows(chute, Q=3.0):
        for found in (
            flows(chute, M=flow.mass_holdup),
            flows(chute, h=flow.centre_of_mass),
            flows(chute, T_surface=flow.surface_temperature),
        ):
            off = [abs(f.mass_flux / 3.0 - 1.0) for f in found]
            assert min(off) < 1e-9


def test_near_a_fold_there_are_two_flows_or_none():
    (branch,) = curve(PAPER, surface_temperature=(0.01, 500.0)).branches
    folds = [s.flow.mass_flux for s in branch.special if s.kind == "fold-Q"]
    lower, upper = sorted(folds)
    for apart in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        assert len(flows(PAPER, Q=lower * (1.0 + apart))) == 3
        assert len(flows(PAPER, Q=lower * (1.0 - apart))) == 1
        assert len(flows(PAPER, Q=upper * (1.0 - apart))) == 3
        assert len(flows(PAPER, Q=upper * (1.0 + apart))) == 1


def test_extreme_fluxes_extend_the_search():
    (cold,) = flows(PAPER, Q=1e-6)
    (hot,) = flows(PAPER, Q=1e6)
    assert cold.mass_flux == pytest.approx(1e-6, rel=1e-10)
    assert hot.mass_flux == pytest.approx(1e6, rel=1e-10)
    assert flows(PAPER, Q=1e6).searched.surface_temperature[1] > hot.surface_temperature
    # Q ~ sqrt(T): the hot branch continues the flow at a thousandth of the flux
    less = flows(PAPER, Q=1e3)[0]
    assert hot.surface_temperature / less.surface_temperature == pytest.approx(1e6, rel=1e-3)


def test_deep_flows_beyond_the_separatrix():
    found = flows(Chute(0.29, 0.9, 0.8, 0.7), M=29.0)
    by_temperature = [f.surface_temperature for f in found]
    assert len(found) >= 3
    assert by_temperature == sorted(by_temperature, reverse=True)
    for flow in found:
        assert flow.mass_holdup == pytest.approx(29.0, rel=1e-10)


@pytest.mark.parametrize(
    ("chute", "condition", "reason"),
    [
        (Chute(0.2, 0.8, 0.8, 0.85), {"Q": 3.0}, "base and interior both lose energy at every density"),
        (Chute(0.5, 0.8, 0.8, 0.5), {"Q": 3.0}, "base and interior both gain energy at every density"),
        (Chute(0.41, 0.8, 0.8, 0.6), {"T_surface": 100.0}, "the slope is too steep: lambda = "),
        (Chute(0.3, 1.0, 1.0, 0.6), {"Q": 3.0}, "elastic grains lose no energy inside"),
        (Chute(0.3, 0.9, 0.6, 0.8), {"Q": 1e-3}, "no flow has Q = 0.001: those of this chute have about 4.3"),
    ],
)
def test_why_there_is_none(chute, condition, reason):
    found = flows(chute, **condition)
    assert len(found) == 0
    assert found.reason is not None
    assert reason in found.reason


def test_elastic_grains_flow_where_the_base_takes_energy():
    found = flows(Chute(0.3, 1.0, 0.0, 0.8), Q=3.0)
    assert len(found) == 1
    assert found[0].interior == "productive"
    assert float(found[0].profile(0.0).heat_flux) < 0.0


def test_hot_flows_between_the_printed_bound_and_the_exact_one():
    # lambda = 2.91 lies between 2.284, printed, and 3, exact (section 4.3)
    found = flows(Chute(0.4, 0.8, 0.8, 0.6), T_surface=500.0)
    assert len(found) == 1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "give exactly one of Q, M, h and T_surface: got none"),
        ({"Q": 1.0, "M": 2.0}, "got Q, M"),
        ({"Q": 0.0}, "Q = 0: must be from"),
        ({"Q": -1.0}, "Q = -1: must be from"),
        ({"Q": float("nan")}, "Q = nan: must be from"),
        ({"Q": "three"}, "Q = 'three': must be a number"),
        ({"T_surface": 1e300}, "T_surface = 1e\\+300"),
        ({"Q": 3.0, "tolerance": 1.0}, "tolerance 1: must be"),
        ({"Q": 3.0, "surface_temperature": (10.0, 1.0)}, "must rise"),
        ({"Q": 3.0, "largest_holdup": -1.0}, "largest hold-up -1"),
    ],
)
def test_bad_input(given, message):
    with pytest.raises(InputError, match=message):
        flows(PAPER, **given)


def test_a_flow_set_is_a_sequence():
    found = flows(PAPER, Q=3.0)
    assert len(found) == 3
    assert list(found[:2]) == [found[0], found[1]]
    assert found[-1].surface_temperature == min(f.surface_temperature for f in found)
    assert np.isfinite([f.mass_flux for f in found]).all()


def test_no_flow_strays_to_another_of_its_surface_temperature():
    # One of two deep flows was lost where Newton's method on a coarse grid ran from its start to the other.
    chute = Chute(
        0.4376640473607999, 0.7200801029618495, 0.4020079295545805, 0.7537729039169501, "interface", "lun-fourier"
    )
    found = flows(chute, T_surface=0.03818473684352112)
    assert len(found) == 6
    # by an independent integration, DOP853
    assert found[-1].mass_holdup == pytest.approx(20.01959871, rel=1e-8)


def test_a_flow_just_beyond_the_range_extends_it():
    # The rough end of the branch passes the value just inside the range, the flow itself just outside.
    chute = Chute(0.3701877234047303, 0.5626627358233449, 0.33102981650642344, 0.5128316109822653, "interface")
    (found,) = flows(chute, Q=344.3168597509368)
    assert found.surface_temperature == pytest.approx(1.0037e5, rel=1e-3)
    assert flows(chute, Q=344.3168597509368).searched.surface_temperature[1] > found.surface_temperature


@pytest.mark.slow
def test_a_holdup_at_which_flows_are_too_many_is_told_soon():
    chute = Chute(slope=0.6, restitution=1.0 / 3.0, wall_restitution=0.0, roughness=0.8660254037844386)
    begin = time.process_time()
    found = flows(chute, M=300.0)
    assert time.process_time() - begin < 20.0
    assert found.incomplete is not None


@pytest.mark.parametrize("case", json.loads((Path(__file__).parent / "deep_flows.json").read_text()), ids=str)
def test_deep_flows_are_all_found(case):
    """Flows of one hold-up, some of which agree in T_surface to eleven digits; found by a program that knows nothing of
    this one."""
    names = ("slope", "e", "e_w", "r", "surface", "closure")
    found = flows(Chute(*(case[name] for name in names)), M=case["M"])
    assert found.incomplete is None
    expected = sorted((flow["Q"], flow["h"], flow["T_surface"], flow["nu_max"]) for flow in case["flows"])
    got = np.array(
        sorted((f.mass_flux, f.centre_of_mass, f.surface_temperature, f.largest_volume_fraction) for f in found)
    )
    np.testing.assert_allclose(got[:, :3], np.array(expected)[:, :3], rtol=1e-9)
    # Those of the other program are the largest of samples.
    above = got[:, 3] / np.array(expected)[:, 3] - 1.0
    assert -1e-9 < above.min() <= above.max() < 1e-3
    for flow, (flux, *_) in zip(sorted(found, key=lambda f: f.mass_flux), expected, strict=True):
        assert abs(flow.mass_flux / flux - 1.0) <= flow.error


def test_one_trajectory_with_four_bases():
    chute = Chute(0.49126, 0.632, 0.5484, 0.8133, "interface")
    found = [flow.mass_holdup for flow in flows(chute, T_surface=2.92067)]
    assert found == pytest.approx([0.0972062, 1.6499688, 7.547789, 7.690052], rel=1e-6)
    fluxes = sorted(flow.mass_flux for flow in flows(chute, M=7.68997))
    assert fluxes == pytest.approx([156.948, 338.508, 353.494, 1042.708], rel=1e-5)


def test_a_surface_temperature_near_the_limit_of_a_deep_branch():
    # T_surface of the flows of hold-up 9 to 30 differs by 6e-6, less than rough flows are wrong by: at the end of the
    # branch, where no deeper flow could tell, the rough one was on the wrong side.
    chute = Chute(0.522571, 0.657921, 0.023403, 0.612599, "interface")
    for mass in (9.0, 12.0):
        (flow,) = flows(chute, M=mass)
        (found,) = flows(chute, T_surface=flow.surface_temperature)
        assert found.mass_holdup == pytest.approx(mass, rel=1e-8)
        assert abs(found.mass_holdup / mass - 1.0) <= found.error + 1e-10


def test_a_surface_temperature_near_the_limit_of_thin_flows():
    # Of thinner flows than this one it differs by 1e-8. By the brute force of tests/verification.
    chute = Chute(0.359172, 0.48837, 0.473461, 0.831665, "interface", "lun-fourier")
    (found,) = flows(chute, T_surface=0.004624141801388148)
    assert found.mass_holdup == pytest.approx(1.18155e-8, rel=1e-4)


def test_where_the_surface_temperature_does_not_tell_the_error_does():
    # All flows deeper than 23 have it to rounding.
    chute = Chute(0.522571, 0.657921, 0.023403, 0.612599, "interface")
    (flow,) = flows(chute, M=29.0)
    (found,) = flows(chute, T_surface=flow.surface_temperature)
    assert abs(np.log(found.mass_holdup / flow.mass_holdup)) <= found.error


def test_just_below_lambda_3_an_answer_comes_at_once():
    for slope in (0.372, 0.3735, 0.3739, 0.374):
        begin = time.process_time()
        flows(Chute(slope, 0.8, 0.8, 0.55), Q=3.0)
        assert time.process_time() - begin < 2.0


def test_where_families_are_many_already_the_range_is_not_extended():
    chute = Chute(0.6, 0.4105827264455308, 0.0, 0.8660254037844386, closure="lun-fourier")
    begin = time.process_time()
    found = flows(chute, Q=1e-6)
    assert time.process_time() - begin < 20.0
    assert [flow.mass_flux for flow in found] == pytest.approx([1e-6, 1e-6], rel=1e-10)
    assert found.searched.largest_holdup == 30.0


@pytest.mark.parametrize(
    ("chute", "flux"),
    [
        (PAPER, 3.0),
        # Trajectories wind.
        (Chute(0.36, 0.8, 0.8, 0.75), 20.0),
        (Chute(0.38, 0.8, 0.8, 0.84), 2.0),
        # The branch of the second flow enters the range of surface temperatures at a flux beyond the bound.
        (Chute(0.391089189961052, 0.8156062013526888, 0.6924967997059326, 0.8477526561903331), 0.1407366280409692),
    ],
    ids=str,
)
def test_trajectories_need_not_be_followed_to_larger_fluxes(chute, flux):
    every = flows(chute, Q=flux)
    found = flows_within(chute, LOG_Q, flux, TOLERANCE, SearchRange.checked((1e-3, 1e5), 30.0).restrict(LOG_Q, flux))
    assert len(found) == len(every) > 0
    for one, other in zip(found, every, strict=True):
        assert one.mass_holdup == pytest.approx(other.mass_holdup, rel=1e-9)
    assert every.searched.cells is not None
    assert found.searched.cells is not None
    if every.searched.cells.number > 20_000:
        assert found.searched.cells.number < every.searched.cells.number / 2
