"""Maps of existence against the flows that are solved one by one."""

import numpy as np
import pytest

from chuteflow import Chute, InputError, flows, hot
from chuteflow.analysis.domains import exists_at

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
