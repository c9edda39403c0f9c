"""The equations in time: rest at steady flows, growth rates, conservation of mass, the balance of energy."""

import itertools
from functools import lru_cache

import numpy as np
import pytest
from numpy.polynomial import Legendre
from scipy.integrate import solve_ivp

import chuteflow
from chuteflow.errors import InputError
from chuteflow.numerics.legendre import lobatto
from chuteflow.stability.layer import DEGREE, FIELDS, Layer
from chuteflow.stability.modes import Disturbances
from chuteflow.stability.relaxation import disturb

PAPER = chuteflow.Chute(0.3, 0.8, 0.8, 0.6)
#: Chutes with folds of M: two flows at T_surface = 1, on the one side of it and on the other.
FOLDED = chuteflow.Chute(0.36, 0.8, 0.8, 0.85)
PRODUCTIVE = chuteflow.Chute(0.3, 0.9, 0.6, 0.8)


@lru_cache(maxsize=8)
def flows_of(chute, **condition):
    return chuteflow.flows(chute, **condition)


def cases():
    """Name, flow and whether it grows at k = 0."""
    rows = {
        "A": (PAPER, {"Q": 3.0}, 0, False),
        "B": (PAPER, {"Q": 3.0}, 1, False),
        "C": (PAPER, {"Q": 3.0}, 2, False),
        "folded-thin": (FOLDED, {"T_surface": 1.0}, 0, False),
        "folded-deep": (FOLDED, {"T_surface": 1.0}, 1, True),
        "productive-cool": (PRODUCTIVE, {"T_surface": 1.0}, 0, True),
        "productive-deep": (PRODUCTIVE, {"T_surface": 1.0}, 1, True),
    }
    return {name: (flows_of(chute, **condition)[i], grows) for name, (chute, condition, i, grows) in rows.items()}


CASES = ("A", "B", "C", "folded-thin", "folded-deep", "productive-cool", "productive-deep")


@pytest.fixture(scope="module")
def known():
    return cases()


def random_state(layer, flow, size=0.05):
    """A smooth state well off the steady one, moving and off balance."""
    s = (layer.mass / layer.mass_holdup)[None]
    bumps = size * np.random.default_rng(7).normal(size=(FIELDS, 4)) @ np.cos(np.pi * np.arange(4)[:, None] * s)
    bumps[2] *= 1.0 - s[0]  # no flow through the base
    return layer.steady(flow) + bumps.ravel()


@pytest.mark.parametrize("name", CASES)
def test_a_steady_flow_is_at_rest_to_round_off(known, name):
    flow, _ = known[name]
    degree = 64 if flow.mass_holdup > 1.0 else DEGREE
    layer = Layer.of(flow, degree)
    state = layer.steady(flow)
    # Differences of nodal values are exact to their rounding, times the norm of the matrix.
    assert np.abs(layer.rate(state)).max() < 2e-16 * degree**4 * max(1.0, np.abs(state).max())
    expected = (flow.mass_flux, flow.centre_of_mass, flow.surface_temperature, flow.base_temperature)
    assert layer.numbers(state) == pytest.approx(expected, rel=1e-12)


def test_the_residual_of_a_steady_flow_falls_exponentially_with_the_degree(known):
    flow, _ = known["C"]
    size = [np.abs(Layer.of(flow, n).rate(Layer.of(flow, n).steady(flow))).max() for n in (16, 24, 32, 40)]
    assert all(late < 0.1 * early for early, late in itertools.pairwise(size))


@pytest.mark.parametrize("name", CASES)
def test_rates_are_those_of_the_normal_modes(known, name):
    """The leading growth, and the oscillation that decays most slowly, are those of the modes at k = 0."""
    flow, grows = known[name]
    modes = [mode.sigma for mode in Disturbances(flow).modes(0.0, 0.0, count=4) if abs(mode.sigma) > 1e-9]
    rates = Layer.of(flow).growth_rates(Layer.of(flow).steady(flow))
    swinging = max((sigma for sigma in modes if sigma.imag > 0.0), key=lambda sigma: sigma.real)
    assert np.abs(rates - swinging).min() < 3e-4 * abs(swinging)
    assert (rates[0].real > 0.0) == grows
    if grows:
        assert rates[0] == pytest.approx(modes[0], rel=1e-3)


def test_stability_changes_at_the_fold_of_the_holdup():
    """At k = 0 a flow grows on the one side of a fold of M, not on the other, and not at all at it."""
    curve = chuteflow.curve(PRODUCTIVE, points=60, surface_temperature=(0.3, 30.0))
    (fold,) = (point for branch in curve.branches for point in branch.special if point.kind == "fold-M")
    branch = next(branch for branch in curve.branches if fold in branch.special)
    at_fold = Layer.of(fold.flow)
    assert abs(at_fold.growth_rates(at_fold.steady(fold.flow))[0]) < 3e-6
    leading = []
    for flow in (branch.flows[fold.position - 1], branch.flows[fold.position + 2]):
        layer = Layer.of(flow)
        leading.append(float(layer.growth_rates(layer.steady(flow))[0].real))
    assert min(leading) < -1e-5 < 1e-5 < max(leading)


@pytest.mark.parametrize("name", ["A", "productive-cool"])
def test_growth_rates_converge_with_the_degree(known, name):
    flow, _ = known[name]
    rates = [Layer.of(flow, n).growth_rates(Layer.of(flow, n).steady(flow)) for n in (20, 30, 40)]
    swinging = rates[-1][np.argmax(np.where(rates[-1].imag > 0.0, rates[-1].real, -np.inf))]
    errors = [np.abs(r - swinging).min() for r in rates[:-1]]
    assert errors[1] < 0.01 * errors[0] + 1e-12
    assert errors[1] < 1e-7


def test_the_jacobian_is_that_of_differences(known):
    flow, _ = known["B"]
    layer = Layer.of(flow, 12)
    state = random_state(layer, flow)
    step = 1e-6
    by_differences = [
        (layer.rate(state + step * e) - layer.rate(state - step * e)) / (2.0 * step) for e in np.eye(len(state))
    ]
    exact = layer.jacobian(state)
    np.testing.assert_allclose(np.stack(by_differences, axis=-1), exact, atol=1e-8 * np.abs(exact).max())


def test_mass_is_conserved_by_any_motion(known):
    """(2.1) in the height: as z moves with w, d(nu dz)/dt = 0 for all grains, whatever the motion.

    The logarithmic rate is that of nu, -d ln tau/dt, and that of dz, dw/dz.
    """
    flow, _ = known["B"]
    layer = Layer.of(flow, 30)
    state = random_state(layer, flow)
    ends = solve_ivp(lambda _, y: layer.rate(y), (0.0, 3.0), state, "Radau", rtol=1e-6).y[:, -1]
    assert np.abs(ends - state)[: layer.degree + 1].max() > 0.01  # it moved
    for y in (state, ends):
        thinning = layer.rate(y)[: layer.degree + 1]
        tau, w = np.exp(y[: layer.degree + 1]), y.reshape(FIELDS, -1)[2]
        # w as a polynomial of the coordinate of the nodes, differentiated without the matrix of the layer
        s = lobatto(layer.degree).nodes
        w_s = Legendre.fit(s, w, layer.degree, domain=[0.0, 1.0]).deriv()(s)
        whole = np.expm1(layer.stretch)
        m_s = layer.mass_holdup * layer.stretch * np.exp(layer.stretch * s) / whole
        stretching = -(layer.mass / tau) * w_s / m_s  # dw/dz
        np.testing.assert_allclose(thinning, stretching, atol=1e-11)
    assert layer.weights.sum() == pytest.approx(flow.mass_holdup, rel=1e-13)


@pytest.mark.parametrize("name", ["A", "C", "productive-cool"])
def test_the_balance_of_energy_holds_at_any_state(known, name):
    """dE/dt along the motion, by differences, is the work of gravity less what collisions take."""
    flow, _ = known[name]
    for degree in (12, DEGREE):
        layer = Layer.of(flow, degree)
        state = random_state(layer, flow)
        step = 1e-7
        rate = layer.rate(state)
        ahead, behind = (layer.energy(state + way * step * rate).total for way in (1.0, -1.0))
        power = layer.power(state)
        scale = power.gravity + power.collisions + power.base
        assert (ahead - behind) / (2.0 * step) == pytest.approx(power.net, abs=1e-6 * scale)


def test_the_balance_of_energy_holds_over_time(known):
    """The energy of a disturbed flow changes by the integral of the power, to the tolerance of the integration."""
    flow, _ = known["productive-cool"]
    layer = Layer.of(flow, 16)
    start = disturb(layer.steady(flow), temperature=1.3)
    n = len(start)

    def with_energy(_, y):
        return np.append(layer.rate(y[:n]), layer.power(y[:n]).net)

    def jacobian(_, y):
        out = np.zeros((n + 1, n + 1))
        out[:n, :n] = layer.jacobian(y[:n])
        return out

    whole = solve_ivp(with_energy, (0.0, 20.0), np.append(start, 0.0), "Radau", jac=jacobian, rtol=1e-7, atol=1e-9)
    change = layer.energy(whole.y[:n, -1]).total - layer.energy(start).total
    assert abs(change) > 0.01 * layer.energy(start).total
    assert change == pytest.approx(whole.y[n, -1], rel=3e-6)


def test_energy_and_power_of_a_steady_flow_are_those_of_its_budget(known):
    flow, _ = known["A"]
    layer = Layer.of(flow)
    power, budget = layer.power(layer.steady(flow)), flow.energy_budget
    assert power.gravity == pytest.approx(flow.chute.slope * flow.mass_flux, rel=1e-12)
    assert power.collisions == pytest.approx(budget.dissipation, rel=1e-10)
    assert power.base == pytest.approx(budget.base_loss, rel=1e-10)
    assert power.net == pytest.approx(0.0, abs=1e-11 * power.gravity)
    assert layer.energy(layer.steady(flow)).potential == pytest.approx(flow.mass_holdup * flow.centre_of_mass)


def test_the_interface_is_refused():
    flow = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6, surface="interface"), Q=3.0)[0]
    with pytest.raises(InputError, match="--surface free"):
        Layer.of(flow)
