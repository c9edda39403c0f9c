"""Neutral curves: of a plane with known ones, of flow A of the paper, and along its branch."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import chuteflow
from chuteflow.errors import InputError, SolveError
from chuteflow.stability import planes
from chuteflow.stability.modes import Disturbances
from chuteflow.stability.neutral import EigenvalueGrid, neutral_curves
from chuteflow.stability.planes import FamilyPlane, family_map, wave_map
from chuteflow.stability.result import leading

PAPER = chuteflow.Chute(0.3, 0.8, 0.8, 0.6)


@dataclass
class KnownPlane:
    """Three modes: one grows by ``growth(a, b)``, one decays, and one stands still a little below zero."""

    growth: Any
    size: tuple[float, float] = (1.0, 1.0)

    def wave(self, z) -> Any:
        values = np.array([self.growth(*z) + 0.3j * z[0], -0.5, -2e-5])
        of = SimpleNamespace(matrix=lambda kx, ky: np.diag(values), weights=np.ones(3))
        return SimpleNamespace(coarse_operator=lambda kx, ky, level: of), 0.0, 0.0

    def scan(self, points):
        a = b = np.linspace(0.0, 1.0, points)
        leading = self.growth(a[:, None], b) + 0.3j * a[:, None]
        return EigenvalueGrid(a, b, np.where(leading.real > -2e-5, leading, -2e-5))


def circle(a, b, centre=(0.5, 0.5), radius=0.3):
    return 0.1 * (radius**2 - (a - centre[0]) ** 2 - (b - centre[1]) ** 2)


def test_a_closed_curve_is_followed_all_around():
    plane = KnownPlane(circle)
    (found,) = neutral_curves(plane, plane.scan(9))
    assert found.ends == ("its own start: it is closed",) * 2
    np.testing.assert_allclose(np.hypot(*(found.z - 0.5).T), 0.3, atol=1e-7)
    angles = np.unwrap(np.arctan2(*(found.z - 0.5).T))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2.0 * np.pi, abs=0.05)
    np.testing.assert_allclose(found.frequency, -0.3 * found.z[:, 0], atol=1e-9)
    assert found.error.max() < 1e-10


def test_a_curve_ends_on_the_edges_exactly():
    plane = KnownPlane(lambda a, b: circle(a, b, centre=(0.0, 0.0), radius=0.7))
    (found,) = neutral_curves(plane, plane.scan(9))
    assert found.ends == ("the edge of the range",) * 2
    ends = sorted((found.z[0].tolist(), found.z[-1].tolist()))
    np.testing.assert_allclose(ends, [[0.0, 0.7], [0.7, 0.0]], atol=1e-7)


def test_two_curves_are_found_once_each_and_none_where_nothing_grows():
    two = KnownPlane(lambda a, b: np.maximum(circle(a, b, (0.25, 0.3), 0.15), circle(a, b, (0.75, 0.7), 0.2)))
    assert len(neutral_curves(two, two.scan(17))) == 2
    none = KnownPlane(lambda a, b: -0.1 - a * b)
    assert neutral_curves(none, none.scan(9)) == []


def test_no_curve_is_made_up_where_growth_is_not_known():
    plane = KnownPlane(lambda a, b: 0.1 * (b - 0.5) + 0.0 * a)
    scan = plane.scan(9)
    unknown = np.broadcast_to(scan.b > 0.3, scan.sigma.shape)
    masked = EigenvalueGrid(scan.a, scan.b, np.where(unknown, np.nan, scan.sigma), unresolved=unknown)
    assert len(neutral_curves(plane, scan)) == 1
    assert neutral_curves(plane, masked) == []


@pytest.mark.parametrize(
    "given",
    [{"kx": "0:0.1"}, {"kx": 0.1}, {"ky": ("0", "1")}, {"size": 4.5}, {"size": ("4", "4")}, {"size": (4.0, 4.5)}],
)
def test_what_is_no_range_or_size_is_refused(three, given):
    with pytest.raises(InputError, match="must be"):
        wave_map(three["C"], **({"kx": (0.0, 0.1), "ky": (0.0, 0.1)} | given))


def test_on_the_neutral_curve_of_flow_a_the_leading_mode_neither_grows_nor_decays():
    flow = chuteflow.flows(PAPER, Q=3.0)[0]
    found = wave_map(flow, kx=(0.0, 0.02), ky=(0.0, 0.03), size=(6, 6))
    (curve,) = found.neutral
    assert curve.ends == ("the edge of the range",) * 2
    # Flow A is unstable to waves along the slope and across it: the curve cuts both axes.
    ends = sorted((curve.z[0].tolist(), curve.z[-1].tolist()))
    assert ends[0] == pytest.approx([0.0, 0.02190], abs=2e-5)
    assert ends[1] == pytest.approx([0.00869, 0.0], abs=2e-5)
    assert curve.error.max() < 2e-6
    disturbances = Disturbances(flow)
    for kx, ky in curve.z[[3, len(curve.z) // 2, -4]]:
        inside, outside = (leading(disturbances, share * kx, share * ky)[0].growth for share in (0.99, 1.01))
        assert inside > 0.0 > outside
    # The map and the curve agree on which of its points grow.
    lone = disturbances.modes(float(found.kx[1]), float(found.ky[2]))[0]
    assert found.growth[1, 2] == pytest.approx(lone.growth, abs=1e-5)


def test_a_flow_that_cannot_be_solved_ends_no_map(monkeypatch):
    flows = chuteflow.curve(PAPER, surface_temperature=(0.5, 8.0), points=12).branches[0].flows
    between = planes.flow_between

    def failing(flows, position):
        if 4.5 < position < 6.5:
            raise SolveError("no")
        return between(flows, position)

    monkeypatch.setattr(planes, "flow_between", failing)
    monkeypatch.setattr(planes, "neutral_curves", lambda *_: [])
    found = family_map(flows, angle=0.0, depth_wavenumber=(0.01, 0.3), size=(4, 5))
    assert found.unresolved[:, 2].all()
    assert not found.unresolved[:, [0, 1, 3, 4]].any()
    assert np.isnan(found.growth[:, 2]).all()
    assert np.isfinite(found.growth[:, [0, 4]]).any()


@pytest.mark.slow
def test_neutral_waves_along_a_family_separate_growth_from_decay():
    flows = chuteflow.curve(PAPER, points=24, surface_temperature=(0.5, 8.0)).branches[0].flows
    found = family_map(flows, angle=0.0, depth_wavenumber=(0.005, 0.3), size=(6, 7))
    assert len(found.neutral) == 2  # hot flows and cold ones are unstable, those between are not
    plane = FamilyPlane(flows, 0.0, float(np.log(0.005)), float(np.log(60.0)))
    for curve, members in zip(found.neutral, found.neutral_flows, strict=True):
        i = len(members) // 2
        assert curve.error.max() < 1e-4
        k = float(curve.z[i, 0]) / members[i].centre_of_mass
        growth = leading(Disturbances(members[i]), k, 0.0)[0].growth
        assert abs(growth) < 1e-6
        assert plane.flow(float(curve.z[i, 1])).mass_flux == pytest.approx(members[i].mass_flux, rel=1e-9)
    warm, cold = sorted(found.neutral_flows, key=lambda members: -members[0].surface_temperature)
    assert min(f.surface_temperature for f in warm) > max(f.surface_temperature for f in cold)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"size": (3, 10)}, "size 3x10"),
        ({"kx": (0.2, 0.1), "ky": (0.0, 0.1)}, "must rise"),
        ({"kx": (0.0, 1e9), "ky": (0.0, 0.1)}, "kx"),
    ],
)
def test_maps_out_of_range_are_refused(settings, said):
    flow = chuteflow.flows(PAPER, Q=3.0)[0]
    with pytest.raises(InputError, match=said):
        wave_map(flow, **settings)


def test_families_out_of_range_are_refused():
    flows = chuteflow.flows(PAPER, Q=3.0)
    refused: list[tuple[dict[str, Any], str]] = [
        ({"angle": 91.0}, "from 0"),
        ({"angle": "across"}, "must be a number"),
        ({"angle": 0.0, "depth_wavenumber": 0.1}, "must be two numbers"),
        ({"angle": 0.0, "depth_wavenumber": (0.1, 0.0)}, "must rise"),
    ]
    for settings, said in refused:
        with pytest.raises(InputError, match=said):
            family_map(flows, **settings)
    with pytest.raises(InputError, match="at least 2"):
        family_map(flows[:1], angle=0.0)
