"""The posterior distribution of a fit, sampled by the ensemble sampler of emcee, which is an extra of the package.

Priors are uniform within what parameters may be. The likelihood is that of the fit: normal errors, also where they were
estimated, then at that size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chuteflow import display
from chuteflow.checks import whole
from chuteflow.errors import InputError
from chuteflow.extras import require
from chuteflow.fitting.calibration import Fit
from chuteflow.fitting.objective import Objective
from chuteflow.fitting.residuals import TrialChute, TrialFlow
from chuteflow.numerics.chebyshev import Array
from chuteflow.threads import on_one_thread

#: Steps of each walker, and the fraction of them that is thrown away.
_STEPS, _SHARE_OF_START = 400, 0.25
#: Walkers for each unknown.
_WALKERS = 4


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws (n, k) of the parameters called ``keys``; ``autocorrelation`` is the longest time in steps between
    independent ones, and NaN where the chain is too short to tell."""

    keys: tuple[str, ...]
    draws: Array
    autocorrelation: float
    accepted: float

    def __repr__(self) -> str:
        return display.line("Posterior", display.count_of(len(self.draws), "draw"), ", ".join(self.keys))

    def interval(self, key: str, confidence: float = 0.95) -> tuple[float, float]:
        """The central interval of a parameter that holds a fraction ``confidence`` of the draws.

        Raises:
            InputError: for a parameter that was not free.
        """
        if key not in self.keys:
            raise InputError(f"parameter {key!r}: choose from {', '.join(self.keys)}")
        tail = 0.5 * (1.0 - confidence)
        low, high = np.quantile(self.draws[:, self.keys.index(key)], [tail, 1.0 - tail])
        return float(low), float(high)


@on_one_thread
def sample(found: Fit, *, steps: int = _STEPS, seed: int = 0) -> Posterior:
    """Draws from the posterior distribution of the free parameters of a fit.

    Args:
        found: a fit with a linear loss and known heights of the bases.
        steps: of each walker; a quarter of them is thrown away.
        seed: of the draws.

    Raises:
        InputError: without emcee, or for a fit of another kind.
    """
    emcee = require("emcee", "bayes", "sampling")
    if found.loss != "linear" or any(one.base is not None for one in found.experiments):
        raise InputError("sampling knows fits with a linear loss and known heights of the bases")
    steps = whole("steps", steps, 8, 1_000_000)
    posterior = _LogPosterior.of(found)
    rng = np.random.default_rng(seed)
    unknowns = posterior.objective.unknowns
    walkers = max(_WALKERS * unknowns, 8)
    spread = np.full(unknowns, 1e-3)
    spread[: len(found.free)] = np.sqrt(np.diag(found.covariance))
    low, high = posterior.objective.bounds()
    width = np.minimum(np.where(np.isfinite(high - low), 0.05 * (high - low), np.inf), spread)
    start = np.clip(posterior.centre + width * rng.standard_normal((walkers, unknowns)), low + 1e-9, high - 1e-9)
    sampler = emcee.EnsembleSampler(walkers, unknowns, posterior)
    sampler.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    chain = sampler.get_chain(discard=int(_SHARE_OF_START * steps), flat=True)
    times = sampler.get_autocorr_time(quiet=True, tol=0)
    return Posterior(
        tuple(parameter.key for parameter in found.free),
        np.asarray(chain)[:, : len(found.free)],
        float(np.max(times)),
        float(np.mean(sampler.acceptance_fraction)),
    )


@dataclass(eq=False)
class _LogPosterior:
    """The logarithm of the posterior density; flows are followed from the fit."""

    objective: Objective
    places: tuple[TrialFlow, ...]
    centre: Array
    scale: float

    @classmethod
    def of(cls, found: Fit) -> _LogPosterior:
        """That of a fit."""
        cases = tuple(TrialChute.of(one, found.chute, found.free) for one in found.measured.experiments)
        objective = Objective(cases, False, found.loss)
        places = tuple(
            TrialFlow.of(case, one.flow, found.values) for case, one in zip(cases, found.experiments, strict=True)
        )
        for place in places:
            # Its derivatives say how far flows move.
            _ = place.answer
        scale = 1.0 if found.measured.errors_known else found.error_scale
        return cls(objective, places, objective.start(places), scale)

    def __call__(self, x: Array) -> float:
        """Of unknowns (p,): minus infinity where there is no flow."""
        low, high = self.objective.bounds()
        if not ((x >= low) & (x <= high)).all():
            return -np.inf
        values = x[: self.objective.parameters]
        total = 0.0
        for i, (case, place) in enumerate(zip(self.objective.cases, self.places, strict=True)):
            column = self.objective.label_column(i)
            flow = case.followed(place, values, place.label if column is None else float(x[column]))
            if flow is None:
                return -np.inf
            residual = case.residual(flow)
            total += float(residual @ residual)
        return -0.5 * total / self.scale**2 if np.isfinite(total) else -np.inf
