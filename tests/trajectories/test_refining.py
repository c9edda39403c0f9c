"""The grid of trajectories: regions that no trajectory leaves, and what a finer grid sees."""

import numpy as np

from chuteflow import Chute
from chuteflow.steady.collocation import LOG_M
from chuteflow.steady.model import LOSS, WORK, model
from chuteflow.trajectories.kernel import COLD, FREE, HOT, LOW_FLUX, look_up, region_of
from chuteflow.trajectories.refining import Refinement, carry_down
from chuteflow.trajectories.tables import BASE, COUPLED, INVERSE, NET, tables

HALVED = Refinement(delta=0.2, finest=0.0125, per_decade=24.0, step=0.125, lengths=0.3)


def deep_chute(seed):
    """A random chute with a slope at which loss balances work at two densities."""
    rng = np.random.default_rng([2026, seed])
    e = float(rng.uniform(0.3, 0.75))
    surface, closure = str(rng.choice(["free", "interface"])), str(rng.choice(["lun", "lun-fourier"]))
    f, _ = model(Chute(0.3, e, 0.5, 0.7, closure=closure)).closures(np.exp(np.linspace(-10.0, 20.0, 600)))
    balanced = np.sqrt(f[LOSS] / f[WORK])
    slope = float(balanced.min() + rng.uniform(0.05, 0.5) * (balanced[-1] - balanced.min()))
    e_w, r = float(rng.uniform(0.0, 0.6)), float(rng.uniform(0.5, 0.866))
    return Chute(slope, e, e_w, r, surface, closure)


def crossings(chute, holdup, refinement):
    """How often the rough branches pass a hold-up."""
    grid = carry_down.__wrapped__(model(chute), 1e-3, 1e5, 1.05 * holdup, refinement)
    assert grid.complete
    deeper = [branch.macroscopic[:, LOG_M] > np.log(holdup) for branch in grid.branches]
    return sum(int(np.sum(one[1:] != one[:-1])) for one in deeper)


def residuals(t, p, big_l, y, lengths):
    """B on the way of one trajectory, by small steps of the equations as docs/theory/enumeration.md has them."""
    out = []
    for step in np.full(lengths, 0.01):
        inverse, k, net = (look_up(t.values, big_l, column) for column in (INVERSE, COUPLED, NET))
        h = step * min(p, 1.0 / t.rate, 1.0 / (1.0 + abs(y) * inverse))
        big_l += h * (1.0 / p - y * inverse)
        y += h * (net - 0.5 * (1.0 - k) * inverse * y * y - (1.0 + 0.5 * k) * y / p)
        p += h
        out.append(y - look_up(t.values, big_l, BASE))
    return np.array(out)


def test_no_trajectory_leaves_a_region_and_the_residual_keeps_its_sign():
    seen = set()
    for seed in range(4):
        t = tables(model(deep_chute(seed)))
        rng = np.random.default_rng(seed)
        for _ in range(200):
            p = float(np.exp(rng.uniform(np.log(0.05), np.log(30.0))))
            big_l, y = float(rng.uniform(-9.0, 6.0)), float(t.scale * rng.uniform(-4.0, 4.0))
            region = region_of(t.bounds, p, big_l, y)
            if region != FREE:
                seen.add(region)
                assert ((residuals(t, p, big_l, y, 400) > 0.0) == (region == HOT)).all()
    assert seen == {HOT, LOW_FLUX, COLD}


def test_elsewhere_the_residual_may_change_its_sign():
    t = tables(model(deep_chute(0)))
    changed = [
        len(set((residuals(t, 5.0, big_l, 0.2 * t.scale, 3000) > 0.0).tolist())) > 1
        for big_l in np.linspace(-2.0, 3.0, 20).tolist()
        if region_of(t.bounds, 5.0, big_l, 0.2 * t.scale) == FREE
    ]
    assert any(changed)


def test_twelve_flows_do_not_depend_on_the_refinement():
    chute = Chute(0.6, 0.36, 0.0, 0.75**0.5)
    assert crossings(chute, 20.0, HALVED) == crossings(chute, 20.0, Refinement()) == 12
