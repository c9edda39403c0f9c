"""Roots in brackets: one at a time and many at once, to the accuracy that is asked for."""

import math

import numpy as np
import pytest

from chuteflow.numerics.roots import bisect, find_zeros, itp_trial, secants

#: Rising functions on a bracket, with their roots; flat, steep and lopsided ones among them.
FUNCTIONS = {
    "straight": (lambda x: 2.0 * x - 0.6, 0.0, 1.0, 0.3),
    "cube": (lambda x: x**3 - 2.0, 0.0, 4.0, 2.0 ** (1.0 / 3.0)),
    "exponential": (lambda x: math.exp(10.0 * x) - 5.0, -1.0, 3.0, math.log(5.0) / 10.0),
    "arc tangent": (lambda x: math.atan(50.0 * (x - 0.1)), -5.0, 20.0, 0.1),
}


@pytest.mark.parametrize(("function", "low", "high", "root"), FUNCTIONS.values(), ids=FUNCTIONS)
def test_bisection_leaves_no_number_between(function, low, high, root):
    found = bisect(function, low, high)
    assert found == pytest.approx(root, rel=1e-14)
    assert function(np.nextafter(found, -np.inf)) <= 0.0 <= function(np.nextafter(found, np.inf))


@pytest.mark.parametrize(("function", "low", "high", "root"), FUNCTIONS.values(), ids=FUNCTIONS)
def test_secants_meet_the_size_that_is_asked_for(function, low, high, root):
    found = secants(function, (low, high), (function(low), function(high)), 0.5 * (low + high), 1e-10, most=200)
    assert abs(function(found)) < 1e-10
    assert found == pytest.approx(root, rel=1e-9)


def test_secants_of_a_smooth_function_are_few():
    tried = []

    def function(x):
        tried.append(x)
        return math.exp(x) - 2.0

    found = secants(function, (0.0, 1.5), (-1.0, math.exp(1.5) - 2.0), 0.75, 1e-13)
    assert found == pytest.approx(math.log(2.0), rel=1e-12)
    # Both ends were halved at every step once, and each step won one bit.
    assert len(tried) < 10


@pytest.mark.parametrize(("function", "low", "high", "root"), FUNCTIONS.values(), ids=FUNCTIONS)
def test_trials_stay_in_the_bracket_and_near_its_middle(function, low, high, root):
    del root
    values = function(low), function(high)
    middle = 0.5 * (low + high)
    secant = low - values[0] * (high - low) / (values[1] - values[0])
    assert itp_trial((low, high), values, 0.0, math.inf) == pytest.approx(secant)
    near = itp_trial((low, high), values, 0.0, 0.01 * (high - low))
    assert abs(near - middle) <= 0.0101 * (high - low)
    assert itp_trial((low, high), values, 10.0, math.inf) == pytest.approx(middle)


def test_many_roots_at_once_are_those_found_one_by_one():
    targets = np.linspace(0.5, 60.0, 300)
    low, high = np.full(300, -1.0), np.full(300, 6.0)

    def function(which, x):
        return x**3 - targets[which]

    indices = np.arange(300)
    found = find_zeros(function, low, high, function(indices, low), function(indices, high), 1e-13, 0.0)
    np.testing.assert_allclose(found, np.cbrt(targets), rtol=1e-12)


def test_a_function_that_is_not_finite_has_no_root():
    def function(which, x):
        return np.where(which == 1, np.nan, x - 0.25)

    ends = np.zeros(3), np.ones(3)
    found = find_zeros(function, *ends, np.full(3, -0.25), np.full(3, 0.75), 1e-12, 0.0)
    assert np.isnan(found[1])
    np.testing.assert_allclose(found[[0, 2]], 0.25)
