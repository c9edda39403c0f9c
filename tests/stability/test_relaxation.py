"""Disturbed flows followed in time: where they go, how fast, and the same by finite volumes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import chuteflow
from chuteflow.errors import InputError, SolveError
from chuteflow.stability.layer import FIELDS, Layer
from chuteflow.stability.relaxation import disturb, outcome, relax

from .finite_volumes import Cells

PAPER = chuteflow.Chute(0.3, 0.8, 0.8, 0.6)
PRODUCTIVE = chuteflow.Chute(0.3, 0.9, 0.6, 0.8)


@pytest.fixture(scope="module")
def paper():
    return chuteflow.flows(PAPER, Q=3.0)


@pytest.fixture(scope="module")
def pair():
    """Two flows of one hold-up, on either side of a fold of M: the hot one is stable, the other is not."""
    return chuteflow.flows(PRODUCTIVE, M=1.38185)


def followed(flow, duration, degree=24, tolerance=1e-7, **factors):
    layer = Layer.of(flow, degree)
    return layer, list(relax(layer, disturb(layer.steady(flow), **factors), duration, tolerance))


@pytest.mark.parametrize("which", [0, 1, 2])
def test_a_steady_flow_stays_as_it_is(paper, which):
    layer, moments = followed(paper[which], 1e4, degree=40)
    drift = np.abs(moments[-1].state - moments[0].state).max()
    assert moments[-1].time == pytest.approx(1e4)
    assert drift < 1e-9
    assert outcome(layer, moments).distance < 1e-10


@pytest.mark.parametrize("which", [0, 1, 2])
def test_a_disturbed_flow_comes_back_at_the_rate_of_the_linear_theory(paper, which):
    flow = paper[which]
    layer = Layer.of(flow, 24)
    decay = float(layer.growth_rates(layer.steady(flow))[0].real)
    assert decay < 0.0
    layer, moments = followed(flow, 5.0 / -decay, temperature=1.05)
    end = outcome(layer, moments)
    assert end.nearest is not None
    assert end.steady[end.nearest].surface_temperature == pytest.approx(flow.surface_temperature, rel=1e-7)
    assert end.distance < 1e-3
    assert end.rate == pytest.approx(decay, rel=0.01)
    assert not end.arrested


def test_a_flow_beyond_the_fold_leaves_at_the_rate_of_the_linear_theory(pair):
    """From a disturbance along the growing mode the flow departs as exp(sigma t), to 1 %."""
    flow = pair[1]
    layer = Layer.of(flow, 24)
    state = layer.steady(flow)
    values, vectors = np.linalg.eig(layer.jacobian(state))
    leading = int(np.argmax(np.real(values)))
    sigma = float(np.real(values[leading]))
    assert sigma > 1e-3
    mode = np.real(vectors[:, leading])
    moments = list(relax(layer, state + 1e-5 * mode / np.abs(mode).max(), 2.0 / sigma, 1e-9))
    away = [np.abs(moment.state - state).max() for moment in (moments[0], moments[-1])]
    assert np.log(away[1] / away[0]) == pytest.approx(2.0, rel=0.01)


def test_of_two_flows_of_one_holdup_the_hot_one_is_come_to(pair):
    layer, moments = followed(pair[1], 1e4, tolerance=1e-5, temperature=1.1)
    end = outcome(layer, moments)
    assert end.nearest == 0
    assert end.distance < 1e-3
    assert end.rate < 0.0


def test_cooled_a_little_the_other_one_comes_to_rest(pair):
    layer, moments = followed(pair[1], 1e4, tolerance=1e-5, temperature=0.9)
    end = outcome(layer, moments)
    assert end.arrested
    # In a finite time that does not depend on the grid
    assert moments[-1].time == pytest.approx(2948.6, rel=1e-3)
    assert moments[-1].mass_flux < 0.02 * pair[1].mass_flux
    nu = layer.mass / np.exp(moments[-1].state[: layer.degree + 1])
    assert nu.max() > 0.61


def test_results_converge_with_degree_and_time_tolerance(paper):
    def numbers(degree, tolerance):
        _, moments = followed(paper[1], 10.0, degree, tolerance, temperature=1.2, velocity=0.9)
        return np.array([moments[-1].mass_flux, moments[-1].centre_of_mass, moments[-1].base_temperature])

    best = numbers(30, 1e-8)
    by_degree = [np.abs(numbers(degree, 1e-8) / best - 1.0).max() for degree in (10, 18)]
    by_tolerance = [np.abs(numbers(30, tolerance) / best - 1.0).max() for tolerance in (1e-3, 1e-5, 1e-7)]
    assert by_degree[1] < 0.2 * by_degree[0]
    assert by_degree[1] < 1e-4
    assert by_tolerance[2] < by_tolerance[1] < by_tolerance[0]
    # a step in time that is asked for to 1e-7
    assert by_tolerance[2] < 1e-6


@pytest.mark.parametrize("which", [0, 1])
def test_growth_rates_of_finite_volumes_converge_to_those(pair, which):
    flow = pair[which]
    layer = Layer.of(flow)
    expected = layer.growth_rates(layer.steady(flow))[0].real
    rates, fluxes = [], []
    for count in (30, 60):
        cells = Cells(PRODUCTIVE, flow.mass_holdup, count, layer.stretch + 2.0)
        state = cells.steady(cells.of_flow(flow))
        values = np.linalg.eigvals(cells.jacobian(state))
        rates.append(values[np.argmin(np.abs(values - expected))].real)
        fluxes.append(cells.flux(state))
    # Errors of second order fall by four, and what is left of them when they are taken off is small.
    assert abs(rates[1] / expected - 1.0) < 0.5 * abs(rates[0] / expected - 1.0)
    assert (4.0 * rates[1] - rates[0]) / 3.0 == pytest.approx(expected, rel=0.01)
    assert (4.0 * fluxes[1] - fluxes[0]) / 3.0 == pytest.approx(flow.mass_flux, rel=2e-3)


def test_a_large_disturbance_goes_the_same_way_by_finite_volumes(paper):
    flow = paper[1]
    times = np.array([0.5, 2.0, 5.0, 10.0, 20.0])
    layer = Layer.of(flow, 32)
    start = disturb(layer.steady(flow), temperature=1.5, velocity=0.8)
    spectral = solve_ivp(
        lambda _, y: layer.rate(y), (0.0, 20.0), start, "Radau", times, jac=lambda _, y: layer.jacobian(y), rtol=1e-6
    )
    by_spectral = np.array([layer.numbers(y)[0] for y in spectral.y.T])
    by_cells = []
    for count in (25, 50):
        cells = Cells(PAPER, flow.mass_holdup, count, layer.stretch + 2.0)
        at_first = cells.of_flow(flow).reshape(4, -1)
        at_first[1] *= 0.8
        at_first[2] *= 1.5
        run = solve_ivp(
            lambda _, y, cells=cells: cells.rate(y),
            (0.0, 20.0),
            at_first.ravel(),
            "BDF",
            times,
            jac=lambda _, y, cells=cells: cells.jacobian(y),
            rtol=1e-6,
            atol=1e-8,
        )
        by_cells.append(np.array([cells.flux(y) for y in run.y.T]))
    assert np.ptp(by_spectral) > 0.05 * flow.mass_flux
    np.testing.assert_allclose((4.0 * by_cells[1] - by_cells[0]) / 3.0, by_spectral, rtol=2e-3)


def test_a_disturbance_multiplies_temperature_and_velocity_and_leaves_density(paper):
    layer = Layer.of(paper[0], 12)
    state = layer.steady(paper[0])
    before, after = state.reshape(FIELDS, -1), disturb(state, temperature=2.0, velocity=3.0).reshape(FIELDS, -1)
    np.testing.assert_array_equal(after[0], before[0])
    np.testing.assert_allclose(after[1], 3.0 * before[1])
    np.testing.assert_allclose(np.exp(after[3]), 2.0 * np.exp(before[3]))


@pytest.mark.parametrize("factors", [{"temperature": 0.0}, {"velocity": -1.0}, {"temperature": 1001.0}])
def test_factors_out_of_range_are_refused(paper, factors):
    layer = Layer.of(paper[0], 12)
    with pytest.raises(InputError, match="must be above 0"):
        disturb(layer.steady(paper[0]), **factors)


def test_what_cannot_be_followed_is_said(paper):
    layer = Layer.of(paper[0], 12)
    with pytest.raises(SolveError, match="disturb it less"):
        list(relax(layer, disturb(layer.steady(paper[0]), temperature=1000.0), 10.0))
