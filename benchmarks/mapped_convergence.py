"""The paper's mapped method beside the overburden one: convergence, cost, and where the mapped one fails.

Run as ``python benchmarks/mapped_convergence.py``; takes less than a minute. Flows A, B and C are those of the paper's
figure 2: Q = 3, e = e_w = 0.8, r = 0.6, tan(theta) = 0.3. What it prints is also written to
benchmarks/results/mapped_convergence.txt.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: one core for either method

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from chuteflow import Chute, Flow, flows
from chuteflow.numerics.newton import newton
from chuteflow.steady.collocation import LOG_Q, LOG_T, prolong
from chuteflow.steady.mapped.solution import MappedSolution, best_multiple, refine, solve_mapped
from chuteflow.steady.solver import Condition
from timing import median_time

Array = np.ndarray
TARGET = 1e-8
DEGREES = (*range(6, 32, 2), *range(32, 64, 4), *range(64, 128, 8), *range(128, 256, 16), *range(256, 401, 24))
MATERIAL = (0.3, 0.8, 0.8, 0.6)
CHUTES = {"half-line": Chute(*MATERIAL), "interface": Chute(*MATERIAL, surface="interface")}


RESULTS = Path(__file__).parent / "results" / "mapped_convergence.txt"
said: list[str] = []


def say(line: str = "") -> None:
    said.append(line)
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def true_error(macroscopic: Array, flow: Flow) -> float:
    """Largest error of ln Q, ln h and ln M against the overburden method at its tightest."""
    return float(np.abs(macroscopic - flow.solution.macroscopic)[:LOG_T].max())


def overburden(flow: Flow, degree: int, condition: Condition) -> Array:
    """ln (Q, h, M, T) by the overburden method on one grid."""
    problem, start = prolong(flow.solution.problem, flow.solution.z, degree)
    weights = np.array(condition.weights)

    def system(z: Array) -> tuple[Array, Array]:
        state = problem.state(z)
        residual = np.append(state.residual(), weights @ state.macroscopic() - condition.value)
        return residual, np.vstack([state.jacobian(), weights @ state.macroscopic_gradient()])

    result = newton(system, start, tolerance=1e-9, longest_step=1.0)
    return problem.state(result.z).macroscopic() if result.converged else np.full(4, np.nan)


def mapped(flow: Flow, degree: int, condition: Condition, multiple: int) -> Array:
    """ln (Q, h, M, T) by the mapped method."""
    return solve_mapped(flow.chute, flow, condition, degree, multiple=multiple).macroscopic


def smallest_degree(attempt: Callable[[int], Array], flow: Flow) -> int | None:
    """The smallest degree from which on TARGET is met at two successive ones."""
    met = None
    for degree in DEGREES:
        if true_error(attempt(degree), flow) < TARGET:
            if met is not None:
                return met
            met = degree
        else:
            met = None
    return met


def newton_alone(solution: MappedSolution, near: Array, condition: Condition) -> int:
    """Newton's method of the mapped system from ``near``; how many iterations it took."""
    weights = np.array(condition.weights)

    def system(z: Array) -> tuple[Array, Array]:
        residual, jacobian, macroscopic, gradient = solution.system.evaluate(z)
        return np.append(residual, weights @ macroscopic - condition.value), np.vstack([jacobian, weights @ gradient])

    return newton(system, near, tolerance=1e-9, longest_step=1.0).iterations


def decay_of_coefficients() -> None:
    """|a_n| and |b_n| of X and Y, and the heat potential's gradient of the overburden method, over the largest."""
    orders = (0, 4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384)
    say("Coefficients |a_n| of X (X = sqrt(nu)) and |b_n| of Y (Y = sqrt(T)), over the largest, larger of n and n+1")
    say("flow               " + "".join(f"{'n=' + str(n):>9}" for n in orders))
    for surface, chute in CHUTES.items():
        for name, flow in zip("ABC", flows(chute, Q=3.0, tolerance=1e-11), strict=True):
            best = best_multiple(flow.centre_of_mass / flow.surface_temperature)
            for multiple in sorted({1, best}) if surface == "half-line" else (1,):
                solution = solve_mapped(chute, flow, Condition.fix(LOG_Q, 3.0), 400, multiple=multiple)
                for letter, series in (("X", solution.x_coefficients), ("Y", solution.y_coefficients)):
                    sizes = np.abs(series) / np.abs(series).max()
                    row = "".join(f"{max(sizes[n : n + 2]):9.0e}" for n in orders)
                    label = f"{name} k={multiple} {letter}" if surface == "half-line" else f"{name} {surface} {letter}"
                    say(f"{label:<19}{row}")
            problem = flow.solution.problem
            fine, z = prolong(problem, flow.solution.z, 120)
            sizes = np.abs(fine.grid.to_coefficients @ z[:-2])
            sizes = np.append(sizes / sizes.max(), 0.0)
            row = "".join(f"{max(sizes[n : n + 2]):9.0e}" for n in orders if n < problem.degree)
            say(f"{name + ' overburden g':<19}{row}")
    say()


def cost() -> None:
    """Degree and time to 1e-8, from a flow whose flux is 2 % higher."""
    say(f"Smallest N for {TARGET:g} in Q, h and M, and the time of Newton's method from a flow with 2 % more flux")
    say(f"{'flow':<14}{'method':<20}{'N':>5}{'unknowns':>10}{'iterations':>12}{'ms':>9}")
    condition = Condition.fix(LOG_Q, 3.0)
    for surface, chute in CHUTES.items():
        for name, flow, near in zip("ABC", flows(chute, Q=3.0, tolerance=1e-11), flows(chute, Q=3.06), strict=True):
            degree = smallest_degree(lambda n, f=flow: overburden(f, n, condition), flow)
            if degree is not None:
                took = median_time(lambda f=near, n=degree: overburden(f, n, condition), 25).cpu
                say(f"{name + ' ' + surface:<14}{'overburden':<20}{degree:5}{degree + 3:10}{'':>12}{took:9.2f}")
            best = best_multiple(flow.centre_of_mass / flow.surface_temperature)
            for multiple in sorted({1, 2, 3, best}) if surface == "half-line" else (1,):
                label = f"mapped, k = {multiple}" if surface == "half-line" else "mapped"
                degree = smallest_degree(lambda n, f=flow, k=multiple: mapped(f, n, condition, k), flow)
                if degree is None:
                    say(f"{name + ' ' + surface:<14}{label:<20} > 400")
                    continue
                solution = solve_mapped(chute, near, Condition.fix(LOG_Q, 3.06), degree, multiple=multiple)
                iterations = newton_alone(solution, solution.z, condition)
                took = median_time(lambda s=solution: newton_alone(s, s.z, condition), 25).cpu
                unknowns = len(solution.z)
                say(f"{name + ' ' + surface:<14}{label:<20}{degree:5}{unknowns:10}{iterations:12}{took:9.2f}")
    say()


def coldest() -> None:
    """The lowest surface temperature at which N <= 400 suffices, by bisection."""
    say(f"Lowest T_surface at which the mapped method meets {TARGET:g} with N <= 400, and N ten times hotter")
    rows = [("half-line", "k = 1", 1), ("half-line", "k near h/T_inf", None), ("interface", "", None)]
    for surface, label, multiple in rows:
        chute = CHUTES[surface]

        def at(temperature: float, chute: Chute = chute, multiple: int | None = multiple) -> MappedSolution:
            (flow,) = flows(chute, T_surface=temperature)
            return refine(chute, flow, Condition.fix(LOG_T, temperature), TARGET, multiple=multiple)

        low, high = 1e-7, 2.0
        while high / low > 1.03:
            middle = float(np.sqrt(low * high))
            if at(middle).converged:
                high = middle
            else:
                low = middle
        hotter = at(10.0 * high)
        say(f"{surface + ' ' + label:<28}{high:10.2e}    N = {hotter.degree} at {10.0 * high:.2e}")
    say()


def overburden_when_cold() -> None:
    """Degrees that the overburden method takes for the same flows."""
    say("N of the Chebyshev grid of an overburden flow, half-line:")
    for temperature in (1.0, 0.1, 0.04, 0.01, 0.001):
        (flow,) = flows(CHUTES["half-line"], T_surface=temperature)
        say(f"    T_inf = {temperature:<8g}N = {flow.solution.problem.degree}")


if __name__ == "__main__":
    decay_of_coefficients()
    cost()
    coldest()
    overburden_when_cold()
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text("\n".join(line.rstrip() for line in said) + "\n", encoding="utf-8")
