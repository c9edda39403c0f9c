"""Which flows are stable, and what grows fastest."""

import numpy as np
import pytest

import chuteflow
from chuteflow import Chute, stability_of
from chuteflow.stability import result, search
from chuteflow.stability.modes import Disturbances, UnresolvedError
from chuteflow.stability.result import growth_map, leading, leading_modes, wavenumbers

from .population import random_flows, seen_again


def mode_of(flow, **given):
    found = stability_of(flow, **given)
    assert found.mode is not None
    return found, found.mode


@pytest.mark.parametrize(
    ("name", "direction", "growth", "wavenumber"),
    [
        pytest.param("A", "across", 3.969606e-3, 0.010051, marks=pytest.mark.slow),
        pytest.param("B", "across", 1.02525e-3, 0.012621, marks=pytest.mark.slow),
        ("C", "along", 7.27575e-3, 0.01109),
    ],
)
def test_the_fastest_growing_mode_of_the_three_flows_of_the_paper(three, name, direction, growth, wavenumber):
    found, mode = mode_of(three[name])
    assert not found.stable
    assert mode.direction == direction
    assert mode.growth == pytest.approx(growth, rel=2e-5)
    assert max(mode.kx, mode.ky) == pytest.approx(wavenumber, rel=1e-2)
    assert found.searched[0] < mode.kx + mode.ky < found.searched[1]
    # It is the highest point near by.
    k, step = max(mode.kx, mode.ky), np.array([0.8, 1.25])
    for factor in step:
        (near,) = leading_modes(three[name], mode.kx * factor, mode.ky * factor)
        assert near.growth < mode.growth
    (aside,) = leading_modes(three[name], *((mode.kx, 0.1 * k) if direction == "along" else (0.1 * k, mode.ky)))
    assert aside.growth < mode.growth


def test_long_waves_are_followed_to_their_own_summit():
    # Rates of other modes lie close by: a mode lost on the way would end beside the maximum.
    (flow,) = chuteflow.flows(Chute(0.4, 0.9, 0.6, 0.8), Q=3.0)
    _, mode = mode_of(flow, ky=0.0)
    for kx in (5e-5, 8e-5, 1.2e-4, 1.5e-4, 2e-4, 5e-4):
        assert leading_modes(flow, kx, 0.0)[0].growth < mode.growth


def test_a_stable_flow():
    # Dilute, on a steep and rough base: nothing grows at any wavenumber of a fine map either.
    (flow,) = chuteflow.flows(Chute(0.535, 0.684, 0.5, 0.835), Q=0.355)
    found, mode = mode_of(flow)
    assert found.stable
    assert -found.smallest_rate * 20.0 < mode.growth < 0.0
    low, high = found.searched
    for angle in (0.0, 0.7, np.pi / 2):
        for k in np.geomspace(low, high, 3):
            kx, ky = (0.0, k) if angle > 1.5 else (k * np.cos(angle), k * np.sin(angle))
            assert all(other.growth < 0.0 for other in leading(Disturbances(flow), kx, ky))


def test_rapid_flows_with_inverted_density_break_up_into_longitudinal_vortices():
    # Forterre & Pouliquen (2002): a pattern across the slope, as long as the layer is deep.
    (flow,) = (f for f in chuteflow.flows(Chute(0.283, 0.892, 0.715, 0.555), Q=238.0) if f.density == "inverted")
    found, mode = mode_of(flow, kx=0.0)
    assert found.grows
    assert mode.direction == "across"
    assert 1.0 < mode.ky * flow.centre_of_mass < 4.0
    assert mode.growth * np.sqrt(flow.centre_of_mass) > 0.3
    for kx in np.geomspace(*wavenumbers(flow), 8):
        assert all(mode.growth > 20.0 * along.growth for along in leading_modes(flow, kx, 0.0))
    assert seen_again(mode) < 1e-4 * mode.growth


def test_wavenumbers_can_be_fixed(three):
    found, mode = mode_of(three["C"], kx=0.01, ky=0.0)
    assert (mode.kx, mode.ky) == (0.01, 0.0)
    assert found.grows
    found, mode = mode_of(three["C"], kx=0.3, ky=0.3)
    assert not found.grows
    assert mode.growth == pytest.approx(-0.174164, abs=1e-5)


@pytest.mark.parametrize("given", [{"kx": 0.3, "ky": 0.3}, {"kx": 0.01, "ky": 0.0}, {"ky": 0.3}])
def test_single_waves_and_single_directions_say_nothing_of_the_whole(three, given):
    found = stability_of(three["C"], **given)
    assert found.stable is None
    assert not found.complete
    if len(given) == 2:
        assert found.searched == pytest.approx((np.hypot(*given.values()),) * 2)
        assert found.examined == 1


def never_told(where):
    """The leading modes, but unresolved at the wavenumbers of ``where``."""

    def told(disturbances, kx, ky, **settings):
        if where(kx, ky):
            raise UnresolvedError(disturbances.flow, kx, ky)
        return leading(disturbances, kx, ky, **settings)

    return told


def test_an_unresolved_wave_is_told_and_raises_nothing(three, monkeypatch):
    monkeypatch.setattr(result, "leading", never_told(lambda kx, ky: True))
    found = stability_of(three["A"], kx=0.01, ky=0.02)
    assert (found.stable, found.mode, found.grows) == (None, None, False)
    assert found.unresolved == ((0.01, 0.02),)


def test_a_flow_with_unresolved_wavenumbers_is_not_called_stable_but_unstable_if_something_grows(monkeypatch):
    (calm,) = chuteflow.flows(Chute(0.535, 0.684, 0.5, 0.835), Q=0.355)
    monkeypatch.setattr(search, "leading", never_told(lambda kx, ky: kx == ky == 0.0))
    found = stability_of(calm)
    assert found.stable is None
    assert found.complete
    assert found.unresolved == ((0.0, 0.0),)
    steep = chuteflow.flows(Chute(0.568, 0.627, 0.478, 0.847), T_surface=9.5)[0]
    # The maximum itself is unresolved: its mode is known all the same, by itself.
    monkeypatch.setattr(search, "leading", never_told(lambda kx, ky: 0.03 < ky < 0.06))
    found = stability_of(steep)
    assert found.stable is False
    assert found.unresolved
    assert found.mode is not None
    assert found.mode.growth == pytest.approx(0.0094762, rel=1e-4)


def test_the_mass_mode_does_not_count_at_rest(three):
    found, mode = mode_of(three["A"], kx=0.0, ky=0.0)
    assert not found.grows
    assert mode.kind == "uniform"
    assert mode.growth == pytest.approx(-0.13406, abs=1e-4)


def test_a_map_holds_the_leading_modes(three):
    flow = three["C"]
    found = growth_map(Disturbances(flow), np.array([0.0, 0.01]), np.array([0.0, 0.01, 0.02]))
    assert found.growth.shape == (2, 3)
    assert found.growth[1, 0] == pytest.approx(7.2559e-3, rel=1e-4)
    assert found.growth[0, 1] == pytest.approx(1.3764e-3, rel=1e-3)
    assert (found.error < 1e-5).all()
    (mode,) = leading_modes(flow, 0.01, 0.02)
    assert abs(found.growth[1, 2] + 1j * found.frequency[1, 2] - mode.growth - 1j * mode.frequency) < 1e-6


def test_a_map_goes_on_where_the_grids_do_not_tell(three, monkeypatch):
    monkeypatch.setattr(result, "leading", never_told(lambda kx, ky: kx == 0.0))
    found = growth_map(Disturbances(three["C"]), np.array([0.0, 0.01]), np.array([0.0, 0.01]))
    assert found.unresolved.tolist() == [[True, True], [False, False]]
    assert np.isnan(found.growth[0]).all()
    assert np.isfinite(found.growth[1]).all()


@pytest.mark.parametrize("given", [{"kx": "0.1"}, {"ky": [1.0]}, {"kx": 0.1, "ky": "0"}, {"kx": True}])
def test_what_is_no_wavenumber_is_refused(three, given):
    with pytest.raises(chuteflow.InputError, match="must be a number"):
        stability_of(three["C"], **given)


def test_the_message_is_true_of_hot_flows_and_of_cold_ones(three):
    assert "cold" not in str(UnresolvedError(three["A"], 0.0, 0.02))
    (cold,) = chuteflow.flows(Chute(0.3, 0.8, 0.8, 0.6), T_surface=5e-4)[-1:]
    assert "M/T_surface" in str(UnresolvedError(cold, 0.0, 0.02))


def test_a_mode_is_followed_to_wavenumbers_close_by(disturbances):
    (start,) = leading(disturbances["C"], 0.01, 0.0)
    near = disturbances["C"].followed(0.0105, 0.001, start.sigma)
    (direct,) = leading(disturbances["C"], 0.0105, 0.001)
    assert near is not None
    assert abs(near.sigma - direct.sigma) < 1e-6


def test_the_coldest_flows_are_refused_or_right():
    flow = chuteflow.flows(Chute(0.38, 0.655, 0.83, 0.601), Q=0.295)[-1]
    assert flow.surface_temperature < 1e-4
    (mode,) = leading_modes(flow, 0.01 / flow.centre_of_mass, 0.0)
    assert abs(mode.sigma - (2.248243e-3 + 1.5541804e-2j)) < 2e-6


@pytest.mark.parametrize(("seed", "count"), [(5, 2), pytest.param(11, 40, marks=pytest.mark.slow)])
def test_what_grows_in_random_flows_grows_on_another_family_of_maps(seed, count):
    told = 0
    for flow in random_flows(seed, count):
        found = stability_of(flow)
        if found.stable is None:
            assert flow.mass_holdup / flow.surface_temperature > 1e4  # none but the coldest are not known
            continue
        told += 1
        if not found.stable:
            assert found.mode is not None
            assert seen_again(found.mode) < 0.01 * found.mode.growth
    assert told > 0.9 * count


def test_a_climb_goes_on_from_where_it_stopped_on_the_way():
    (flow,) = chuteflow.flows(Chute(0.163, 0.972, 0.557, 0.641), T_surface=10.5)
    beside = leading(Disturbances(flow), 0.00286, 0.0524)[0]
    mode = stability_of(flow).mode
    assert mode is not None
    assert mode.growth >= beside.growth > 0.013
