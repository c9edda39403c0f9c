"""The reference against itself: three integrations of one flow, and the paper's limits."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from .cases import NAMED
from .reference import (
    HEAT,
    Array,
    B,
    Case,
    Guess,
    Scan,
    Table1,
    base_flux,
    derivative,
    fall,
    logit_at,
    macroscopic,
    rates_of,
    refine,
    sensitivity,
    start,
)

PAPER = Case(0.3, 0.8, 0.8, 0.6)


@pytest.mark.parametrize("e", [0.05, 0.5, 0.8, 1.0])
def test_limits_of_table_2(e):
    g = Table1(Case(0.3, e, 0.8, 0.6), 1e-12, 1.0 - 1e-12 / 0.62)
    root = math.sqrt(math.pi)
    assert g.g1 / 1e-12 == pytest.approx(1.0, rel=1e-11)
    assert g.g2 == pytest.approx(5.0 * root / (24.0 * (3.0 - e) * (1.0 + e)), rel=1e-11)
    assert g.g3 == pytest.approx(25.0 * root / (4.0 * (1.0 + e) * (49.0 - 33.0 * e)), rel=1e-11)
    assert g.g4 == pytest.approx(15.0 * root * e * (1.0 - e) / (2.0 * (49.0 - 33.0 * e)), rel=1e-11, abs=1e-300)
    assert g.g5 / 1e-24 == pytest.approx(12.0 / root * (1.0 - e**2), rel=1e-11, abs=1e-300)


def test_derivatives_of_table_1():
    nu, h = np.array([0.01, 0.2, 0.5, 0.6]), 1e-6
    ahead, behind = (Table1(PAPER, x, 1.0 - x / 0.62) for x in (nu + h, nu - h))
    here = Table1(PAPER, nu, 1.0 - nu / 0.62)
    np.testing.assert_allclose(here.dg1, (ahead.g1 - behind.g1) / (2.0 * h), rtol=1e-6)
    np.testing.assert_allclose(here.dg0, (ahead.g0 - behind.g0) / (2.0 * h), rtol=1e-6)


@pytest.mark.parametrize("surface", ["free", "interface"])
def test_numbers_printed_in_the_paper(surface):
    scan = Scan(Case(0.3, 0.8, 0.8, 0.6, surface), columns=240)
    found = np.exp([flow.logs for flow in scan.flows(0, 3.0)])
    assert len(found) == 3
    if surface == "free":  # C is 0.197, printed as 0.19
        np.testing.assert_allclose(found[:, 3], [7.34, 2.54, 0.197], atol=6e-3)
        np.testing.assert_allclose(found[:, 1], [8.84, 3.98, 1.77], atol=6e-3)
        np.testing.assert_allclose(found[:, 2], [0.44, 0.59, 1.26], atol=6e-3)


@pytest.mark.parametrize("closure", ["lun", "lun-fourier"])
def test_start_at_the_surface_does_not_matter(closure):
    case = Case(0.3, 0.8, 0.8, 0.6, closure=closure)
    p, t = 1e-5, 2.0
    late, _ = fall(case, t, p)
    early = start(case, p, t)
    # the leading terms err by (p/T)^2 in T and by p/T in q
    assert abs(late[B] - early[B]) < 10.0 * (p / t) ** 2
    assert abs(late[HEAT] / early[HEAT] - 1.0) < 20.0 * p / t


@pytest.mark.parametrize("name", ["the paper's three flows", "the same below an interface, Fourier", "elastic grains"])
def test_shooting_in_one_piece_agrees_with_many(name):
    asked, _ = NAMED[name]
    for flow in Scan(asked.case, columns=240).flows(asked.which, asked.value):
        mass, temperature = float(np.exp(flow.logs[2])), float(np.exp(flow.logs[3]))
        end, p0 = fall(asked.case, temperature, mass)
        log_q, log_h, excess = macroscopic(asked.case, end, asked.case.p_s + mass, p0, temperature)
        assert abs(log_q - flow.logs[0]) < 1e-12
        assert abs(log_h - flow.logs[1]) < 1e-12
        assert abs(excess) < 1e-12
        assert flow.error < 1e-12
        assert flow.stress < 1e-13


def test_deep_flow_is_beyond_one_piece_and_agrees_with_collocation():
    asked, _ = NAMED["deep, surface known to no double"]
    hot = max(Scan(asked.case, columns=240).candidates(asked.which, asked.value), key=lambda g: g.surface_temperature)
    flow = refine(asked.case, asked.which, asked.value, hot)
    # a change of T_surface in its last digit changes T at the base in the seventh
    assert sensitivity(asked.case, float(np.exp(flow.logs[3])), asked.value) > 1e8
    assert flow.error < 1e-12
    np.testing.assert_allclose(by_collocation(asked.case, hot, asked.value), flow.logs, rtol=0.0, atol=1e-8)


def by_collocation(case: Case, near: Guess, mass: float) -> Array:
    """ln Q, ln h, ln M, ln T_surface of the flow near a guess at the hold-up ``mass``, by scipy's solve_bvp.

    The coordinate is ln(p/p0)/rate + p - p0: ln p in the layer at the surface, p below. The unknowns are ln T, Y/p,
    depth and velocity lost and their moments.
    """
    p0, p_b = 1e-7 * min(near.surface_temperature, 1.0), case.p_s + mass
    rate = rates_of(case)[0]
    fine = np.geomspace(p0, p_b, 20000)
    pace = np.log(fine / p0) / rate + fine - p0

    def stress(s: Array) -> Array:
        p = np.interp(s * pace[-1], pace, fine)
        for _ in range(4):
            p = p + (s * pace[-1] - np.log(p / p0) / rate - p + p0) / (1.0 / (rate * p) + 1.0)
        return p

    def state(p: Array, v: Array) -> Array:
        heat = v[1] * p**2 * np.exp(0.5 * v[0])
        return np.stack([logit_at(case, p, v[0]), v[0], heat, *v[2:]])

    def right(s: Array, v: Array, _: Array) -> Array:
        p = stress(s)
        rates = derivative(case, np.log(p), state(p, v))
        rates[HEAT] = rates[HEAT] / (p**2 * np.exp(0.5 * v[0])) - v[1] * (2.0 + 0.5 * rates[B])
        return rates[1:] * (pace[-1] / (1.0 / rate + p))

    def ends(above: Array, below: Array, unknown: Array) -> Array:
        top = start(case, p0, np.exp(unknown[0]))
        flux = base_flux(case, logit_at(case, p_b, below[0]))
        scaled = top[HEAT] / (p0**2 * np.exp(0.5 * top[B]))
        return np.array([above[0] - top[B], above[1] - scaled, *above[2:], below[1] * p_b - float(flux)])

    s = np.linspace(0.0, 1.0, 600)
    first = np.zeros((6, len(s)))
    first[0] = np.interp(stress(s), near.p, near.b)
    first[1] = np.interp(stress(s), near.p, near.y / near.p)
    found = solve_bvp(right, ends, s, first, p=[math.log(near.surface_temperature)], tol=1e-9, max_nodes=20000)
    assert found.success, found.message
    base = state(np.array(p_b), found.y[:, -1])
    assert found.p is not None
    log_t = float(found.p[0])
    log_q, log_h, _ = macroscopic(case, base, p_b, p0, math.exp(log_t))
    return np.array([log_q, log_h, math.log(mass), log_t])
