"""The same curve by the Python continuation package bice, which drives a system that it is given.

It has no discretisation that fits a half-line, so that it gets this package's own, with its exact derivative: what
differs is the continuation. Q enters by its logarithm.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chuteflow import Flow
from chuteflow.steady.collocation import LOG_Q, Collocation, prolong
from timing import Time, median_time

Array = NDArray[np.float64]
#: Degree of the grid, which stays as it is: enough for the coldest flow of the curve.
DEGREE = 54
#: Steps before it is given up, and the largest one.
MOST_STEPS, LARGEST_STEP = 3000, 0.5


@dataclass(frozen=True)
class Outcome:
    """A curve by bice: its time, points (k, 3) in Q, h and M, the Q of its folds, and why it ended."""

    time: Time
    points: Array
    folds: Array
    said: str


def missing() -> str | None:
    """What is not installed, if anything."""
    if importlib.util.find_spec("bice") is None:
        return "the package bice is not installed (pip install bice): skipped"
    return None


def traced(start: Flow, last_flux: float, repeats: int) -> Outcome:
    """The curve from ``start`` towards smaller Q, until ``last_flux``, folds located."""
    problem, z = prolong(start.solution.problem, start.solution.z, DEGREE)
    found: list[Outcome] = []

    def run() -> None:
        found.append(_traced(problem, z, start.mass_flux, last_flux))

    time = median_time(run, repeats)
    return Outcome(time, found[-1].points, found[-1].folds, found[-1].said)


def _traced(steady: Collocation, z: Array, flux: float, last_flux: float) -> Outcome:
    from bice import Equation, Problem

    class Steady(Equation):
        """Residuals of the flow, and its ln Q less the one wanted."""

        def __init__(self) -> None:
            super().__init__(shape=z.shape)
            self.u = z.copy()
            self.log_flux = math.log(flux)

        def rhs(self, u: Array) -> Array:
            state = steady.state(u)
            return np.append(state.residual(), state.macroscopic()[LOG_Q] - self.log_flux)

        def jacobian(self, u: Array) -> Array:
            state = steady.state(u)
            return np.vstack([state.jacobian(), state.macroscopic_gradient()[LOG_Q]])

    problem, equation = Problem(), Steady()
    problem.add_equation(equation)
    problem.continuation_parameter = (equation, "log_flux")
    settings, stepper = problem.settings, problem.continuation_stepper
    settings.neigs, settings.always_locate_bifurcations, settings.use_sparse_matrices = None, True, False
    stepper.ds, stepper.ds_max = -0.05, LARGEST_STEP
    points, said = [], f"no end after {MOST_STEPS} steps"
    # It prints what it does.
    with contextlib.redirect_stdout(io.StringIO()):
        for _ in range(MOST_STEPS):
            try:
                problem.continuation_step()
            except (np.linalg.LinAlgError, ValueError, RecursionError) as error:
                said = f"stopped: {error}"
                break
            points.append(np.exp(steady.state(equation.u).macroscopic()[:3]))
            if points[-1][0] <= last_flux:
                said = "reached its end"
                break
    branch = problem.bifurcation_diagram.active_branch
    folds = [math.exp(solution.p) for solution in branch.bifurcations()]
    return Outcome(Time(0.0, 0.0), np.reshape(points, (-1, 3)), np.array(folds), said)
