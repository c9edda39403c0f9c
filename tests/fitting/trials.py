"""Synthetic measurements: flows of random chutes with noise, and what a fit makes of them."""

import time
from dataclasses import dataclass, replace

import numpy as np

from chuteflow import Chute, Flow, InputError, flows
from chuteflow.fitting.calibration import Fit, fit
from chuteflow.fitting.measurements import Measurements, measurements

FREE = ("e", "ew", "roughness")
#: What a fit is told at first, whatever the truth is.
FIRST = Chute(0.3, 0.75, 0.7, 0.65)


def measured(flow: Flow, rng: np.random.Generator, noise: float = 0.05, points: int = 20, **more) -> Measurements:
    """Profiles of a flow at heights up to its depth, with relative noise, and its flux."""
    z = np.linspace(0.05, 0.9, points) * flow.depth
    profile = flow.profile(z)

    def blurred(values):
        return values * (1.0 + noise * rng.standard_normal(len(values)))

    return measurements(
        z,
        nu=blurred(profile.volume_fraction),
        T=blurred(profile.granular_temperature),
        u=blurred(profile.velocity),
        numbers={"Q": flow.mass_flux},
        relative_errors=dict.fromkeys(("nu", "T", "u"), noise),
        **more,
    )


def random_flow(rng: np.random.Generator, closure: str) -> Flow:
    """One of the flows of a random chute at a random flux."""
    while True:
        e, ew, r = rng.uniform([0.72, 0.6, 0.55], [0.92, 0.92, 0.75])
        try:
            found = flows(Chute(0.3, e, ew, r, closure=closure), Q=float(np.exp(rng.uniform(-0.5, 2.0))))
        except InputError:
            continue
        if len(found):
            return found[int(rng.integers(len(found)))]


@dataclass(frozen=True)
class Trial:
    """A fit of one trial: which intervals cover the truth, whether it is on the right flow, or says that another may
    be; and how long it took."""

    flow: Flow
    found: Fit
    covered: tuple[bool, ...]
    right: bool
    says: bool
    seconds: float


def trial(seed: int, closure: str) -> Trial:
    """Trial number ``seed`` of a law."""
    rng = np.random.default_rng(seed)
    flow = random_flow(rng, closure)
    data = measured(flow, rng)
    start = time.process_time()
    found = fit(data, replace(FIRST, closure=closure), FREE)
    seconds = time.process_time() - start
    truth = (flow.chute.restitution, flow.chute.wall_restitution, flow.chute.roughness)
    covered = tuple(
        bool(one.interval.low <= value <= one.interval.high) for one, value in zip(found.estimates, truth, strict=True)
    )
    off = np.abs(found.experiments[0].flow.solution.macroscopic - flow.solution.macroscopic).max()
    says = any(other.fits_as_well for other in found.alternatives)
    return Trial(flow, found, covered, bool(off < 0.3), says, seconds)
