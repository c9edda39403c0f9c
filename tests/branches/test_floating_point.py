"""Overflow and underflow that are expected stay inside: no warning gets out, and nothing depends on np.seterr."""

import warnings

import numpy as np
import pytest

from chuteflow import Chute, ChuteflowError, boundary, curve, flows, hot, stability_of

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
#: An unresolved branch whose solutions run away on a finer grid.
RUNS_AWAY = Chute(0.4713837091075198, 0.7064570046969758, 0.4266495038362583, 0.8214167565470907)
EMPTY_BEFORE_THE_BASE = Chute(
    0.4650749812672964, 0.4796664369844508, 0.5040403790953422, 0.7090609648824436, closure="lun-fourier"
)


@pytest.fixture(params=["warnings", "errors"])
def strict(request):
    """Every warning is an error; with the second parameter also what numpy would pass over in silence."""
    with warnings.catch_warnings(), np.errstate(all="raise" if request.param == "errors" else "warn"):
        warnings.simplefilter("error")
        yield


def test_solutions_that_run_away(strict):
    flows(RUNS_AWAY, T_surface=343.99921934880814)


def test_trajectories_that_are_empty_before_the_base(strict):
    assert len(flows(EMPTY_BEFORE_THE_BASE, Q=2139.8887214727197)) > 0


def test_every_analysis_of_the_papers_chute(strict):
    found = flows(PAPER, Q=3.0)
    for flow in found:
        flow.sampled(21)
        assert flow.energy_budget.dissipation > 0.0
    assert hot(PAPER).exists
    assert len(curve(PAPER, points=12).branches) == 1
    assert stability_of(found[0], kx=0.01, ky=0.1).mode is not None
    assert len(boundary(PAPER, bounds=(0.299, 0.301), samples=2)) > 0


def searches(count, seed):
    """Random chutes with random conditions, of which some are far out."""
    dice = np.random.default_rng(seed)
    for _ in range(count):
        e, ew, r, slope = dice.uniform([0.4, 0.0, 0.5, 0.05], [1.0, 1.0, 0.866, 0.7]).tolist()
        quantity = str(dice.choice(["Q", "M", "h", "T_surface"]))
        value = float(10.0 ** dice.uniform(-4.0, 2.0 if quantity == "M" else 4.0))
        surface, closure = str(dice.choice(["free", "interface"])), str(dice.choice(["lun", "lun-fourier"]))
        yield (slope, e, ew, r, surface, closure), {quantity: value}


def search(arguments, condition):
    try:
        for flow in flows(Chute(*arguments), **condition):
            flow.sampled(21)
    except ChuteflowError:
        pass  # a law without meaning there, or a flow that cannot be resolved


def test_a_few_searches(strict):
    for arguments, condition in searches(8, seed=2):
        search(arguments, condition)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_hundred_searches(strict, seed):
    for arguments, condition in searches(25, seed):
        search(arguments, condition)
