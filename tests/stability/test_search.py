"""The search for the fastest wave: flows whose oblique ridges are narrow, and maps by brute force."""

import os

import numpy as np
import pytest

import chuteflow
from chuteflow import Chute, stability_of
from chuteflow.numerics.eigenproblem import refine_eigenpair, refine_eigenvalue
from chuteflow.stability.modes import Disturbances, leading

from .brute import MISSED, campaign, highest

STEEP = Chute(0.568, 0.627, 0.478, 0.847)


@pytest.mark.parametrize(
    ("chute", "temperature", "which", "growth", "wave"),
    [
        (STEEP, 8.0, 0, 0.0021179, (0.004769, 0.030354)),
        pytest.param(STEEP, 8.5, 0, 0.0041611, (0.004704, 0.032544), marks=pytest.mark.slow),
        pytest.param(STEEP, 9.5, 0, 0.0094762, (0.004997, 0.042771), marks=pytest.mark.slow),
        (Chute(0.536202, 0.675958, 0.482668, 0.800872), 13.198687, 1, 0.00808, (0.003333, 0.027242)),
        # Two modes cross at kx = 0, and the maximisation from beside it ends in the other one.
        pytest.param(Chute(0.461, 0.605, 0.577, 0.566), 3.508, 0, 0.134356, (0.0, 0.05287), marks=pytest.mark.slow),
    ],
)
def test_narrow_ridges_are_found(chute, temperature, which, growth, wave):
    flow = chuteflow.flows(chute, T_surface=temperature)[which]
    found = stability_of(flow)
    assert found.stable is False
    assert found.unresolved == ()
    assert found.mode is not None
    assert found.mode.growth == pytest.approx(growth, rel=1e-3)
    assert (found.mode.kx, found.mode.ky) == pytest.approx(wave, rel=2e-3, abs=1e-12)


@pytest.mark.slow
def test_a_flow_that_was_refused_for_one_wavenumber_is_answered():
    chute = Chute(0.48275511614686295, 0.6551280340983859, 0.4055941365102813, 0.826299156587647)
    found = stability_of(chuteflow.flows(chute, T_surface=2.5672393065240544)[2])
    assert found.stable is False
    assert found.unresolved
    assert found.mode is not None
    assert found.mode.growth > 0.0827


@pytest.mark.slow
@pytest.mark.parametrize("which", range(int(os.environ.get("CHUTEFLOW_MAPS", "5"))))
def test_the_fastest_wave_is_that_of_a_map_by_brute_force(which):
    """Five flows of maps of 30 x 30, three minutes; with CHUTEFLOW_MAPS=71 all of the campaign, 60 x 60, in an hour."""
    points = 30 if which < len(MISSED) + 1 and "CHUTEFLOW_MAPS" not in os.environ else 60
    flows = campaign(40, 24)
    for _ in range(which):
        next(flows)
    _, flow = next(flows)
    found, peak = stability_of(flow), highest(flow, points, points)
    if peak is None:
        assert not found.grows or (found.mode is not None and found.mode.direction == "uniform")
        return
    assert found.mode is not None
    assert found.mode.growth > (1.0 - 1e-3) * max(peak.growth, peak.maximum)


def test_the_derivatives_of_an_eigenvalue_are_those_of_differences(disturbances):
    kx, ky, step = 0.03, 0.02, 1e-5
    (mode,) = leading(disturbances["A"], kx, ky)
    of = disturbances["A"].coarse_operator(kx, ky)
    pair = refine_eigenpair(of.matrix(kx, ky), of.weights, mode.sigma)
    exact = of.slopes(pair.left, pair.right, kx, ky) / pair.size(of.weights)
    for i, (x, y) in enumerate(((step, 0.0), (0.0, step))):
        ahead, behind = (
            refine_eigenvalue(of.matrix(kx + s * x, ky + s * y), of.weights, pair.value)[0] for s in (1.0, -1.0)
        )
        assert exact[i] == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-5, abs=1e-6)


def test_a_pair_is_alike_to_itself_and_not_to_another(disturbances):
    of = disturbances["A"].coarse_operator(0.1, 0.05)
    one, other = disturbances["A"].candidates(0.1, 0.05)[:2]
    pairs = [refine_eigenpair(of.matrix(0.1, 0.05), of.weights, complex(sigma)) for sigma in (one, other)]
    assert pairs[0].likeness(pairs[0], of.weights) == pytest.approx(1.0)
    assert pairs[0].likeness(pairs[1], of.weights) < 1e-6
    residual = pairs[0].left.conj() @ of.matrix(0.1, 0.05) - pairs[0].value * pairs[0].left.conj() * of.weights
    assert np.abs(residual).max() < 1e-9 * np.abs(of.matrix(0.1, 0.05)).max() * np.abs(pairs[0].left).max()


@pytest.mark.slow
def test_negative_maxima_are_climbed():
    # The slowest to decay is the longest wave searched, on either axis or between.
    (flow,) = chuteflow.flows(Chute(0.155, 0.56, 0.953, 0.755), T_surface=1.552)
    found = stability_of(flow)
    assert found.stable is True
    assert found.mode is not None
    (along,) = leading(Disturbances(flow), found.searched[0], 0.0)
    assert 0.0 > found.mode.growth >= along.growth
