"""The flows that are given, beside those of a brute force that shares nothing with the program (``brute_force``).

CHUTEFLOW_BRUTE_FORCE sets the fraction of the campaign that is run: 1 for 1,050 chutes and 1,152 questions at corners,
some 20 minutes.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import chuteflow
from chuteflow import FlowSet, SolveError
from chuteflow.branches.solution_branches import find_branches
from chuteflow.steady.model import model
from chuteflow.trajectories.refining import REFINEMENT, integrate_trajectories

from .brute_force import NEAR, QUANTITIES, BruteForce, Chute, Fineness, Found, balances

SHARE = float(os.environ.get("CHUTEFLOW_BRUTE_FORCE", "0.02"))
DEEP = json.loads((Path(__file__).parents[1] / "branches" / "deep_flows.json").read_text())
SURFACES, CLOSURES = ("free", "interface"), ("lun", "lun-fourier")
ARGUMENTS = ("mass_flux", "centre_of_mass", "mass_holdup", "surface_temperature")
#: Ranges of Q, h, M and T_surface that are asked for.
WIDE = ((1e-3, 1e4), (1e-2, 1e4), (1e-2, 25.0), (1e-3, 1e5))
FINER = Fineness(delta=0.01, log_step=0.03, step=0.015, per_decade=100, most=600_000)
#: How far the flows of both may be apart in ln Q, ln h, ln M and ln T_surface.
ALIKE = 0.02
#: Processor seconds of one answer on a machine that does other things too.
LIMIT = 2.0


@dataclass
class Tally:
    """What came out for one group of chutes."""

    questions: int = 0
    flows: int = 0
    undecided: int = 0
    seconds: list[float] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    claims: list[float] = field(default_factory=list)

    def __str__(self) -> str:
        slowest, most = (float(np.quantile(self.seconds, q)) for q in (1.0, 0.99))
        kinds = dict(Counter(line.split(":")[0] for line in self.wrong))
        return (
            f"{self.questions} questions, {self.flows} flows, {self.undecided} undecided, wrong {kinds}, "
            f"99 % within {most:.3f} s, slowest {slowest:.3f} s, {sum(t > 0.5 for t in self.seconds)} above 0.5 s, "
            f"{len(self.claims)} claimed errors, "
            f"largest difference over claim {max(self.claims, default=0.0):.2f}"
        )


def chute_of(chute: Chute) -> chuteflow.Chute:
    return chuteflow.Chute(chute.slope, chute.e, chute.e_w, chute.r, surface=chute.surface, closure=chute.closure)


def macroscopic(found: FlowSet) -> np.ndarray:
    return np.log([[getattr(flow, name) for name in ARGUMENTS] for flow in found]).reshape(-1, 4)


def ask(chute: Chute, name: str, value: float, tally: Tally, **further: Any) -> FlowSet:
    """The answer of the program, with nothing remembered, and its time."""
    find_branches.cache_clear()
    integrate_trajectories.cache_clear()
    condition: dict[str, Any] = {name: value}
    begin = time.process_time()
    try:
        return chuteflow.flows(chute_of(chute), **condition, **further)
    finally:
        tally.seconds.append(time.process_time() - begin)


def paired(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether each flow has its own counterpart."""
    left = list(range(len(other)))
    for flow in one:
        if not left:
            return False
        apart = [float(np.abs(other[k] - flow).max()) for k in left]
        nearest = int(np.argmin(apart))
        if apart[nearest] > ALIKE:
            return False
        left.pop(nearest)
    return not left


def brute(chute: Chute, name: str, value: float, deepest: float, fineness: Fineness) -> Found:
    force = BruteForce(chute, deepest)
    if name == "T_surface":
        return force.at_temperature(value, fineness)
    return force.answer(*force.segments(fineness), name, value)


def compare(tally: Tally, chute: Chute, name: str, value: float, deepest: float, expected: Found) -> None:
    """Hold one answer against the brute force; where they differ, against a finer one."""
    tally.questions += 1
    where = f"{chute}, {name}={value!r}"
    try:
        answer = ask(chute, name, value, tally)
    except SolveError as error:
        tally.wrong.append(f"refused: {where}: {error}")
        return
    if tally.seconds[-1] > LIMIT:
        tally.wrong.append(f"slow: {where}: {tally.seconds[-1]:.2f} s")
    given = macroscopic(answer)
    inside = given[given[:, 2] < math.log(deepest)]
    if name != "T_surface":
        inside = BruteForce(chute, deepest).inside(given, name)
    if not paired(expected.flows, inside):
        expected = brute(chute, name, value, deepest, FINER)
    tally.flows += len(expected.flows)
    if not expected.decided:
        tally.undecided += 1
        return
    if not paired(expected.flows, inside):
        more = len(inside) - len(expected.flows)
        kind = "other" if more == 0 else "missed" if more < 0 else "invented"
        if kind == "missed" and answer.incomplete:
            kind = "refused"
        told = f"{len(inside)} for {len(expected.flows)}; incomplete: {answer.incomplete}"
        tally.wrong.append(f"{kind}: {where}: {told}")
    check_claims(tally, chute, name, value, answer)


def check_claims(tally: Tally, chute: Chute, name: str, value: float, answer: FlowSet) -> None:
    """The errors that flows claim, beside flows at a tolerance ten times as small."""
    if not len(answer):
        return
    exact = ask(chute, name, value, Tally(), tolerance=1e-11)
    if len(exact) != len(answer):
        tally.wrong.append(f"tolerance: {chute}, {name}={value!r}: {len(answer)} flows, {len(exact)} at 1e-11")
        return
    others = macroscopic(exact)
    for flow, place in zip(answer, macroscopic(answer), strict=True):
        # Deep flows may share T_surface to rounding, and come in another order.
        reference = exact[int(np.argmin(np.abs(others - place).max(axis=1)))]
        apart = max(abs(getattr(flow, n) / getattr(reference, n) - 1.0) for n in ARGUMENTS[:3])
        tally.claims.append(max(apart - reference.error - 1e-13, 0.0) / flow.error)
        if tally.claims[-1] > 1.0:
            tally.wrong.append(f"claim: {chute}, {name}={value!r}: {apart:.1e} for {flow.error:.1e}")


def random_chute(rng: np.random.Generator, slopes: Callable[[Chute], float], least_e: float, most_e: float) -> Chute:
    e, e_w, r = (float(rng.uniform(*span)) for span in ((least_e, most_e), (0.0, 1.0), (0.5, math.sqrt(0.75))))
    surface, closure = str(rng.choice(SURFACES)), str(rng.choice(CLOSURES))
    chute = Chute(0.3, round(e, 6), round(e_w, 6), round(r, 6), surface, closure)
    return chute._replace(slope=round(slopes(chute), 6))


def box(rng: np.random.Generator) -> Chute:
    return random_chute(rng, lambda _: math.exp(rng.uniform(math.log(0.02), math.log(1.2))), 0.02, 1.0)


def general(rng: np.random.Generator) -> Chute:
    return random_chute(rng, lambda _: float(rng.uniform(0.1, 0.65)), 0.3, 1.0)


def deep(rng: np.random.Generator) -> Chute:
    return random_chute(rng, lambda c: balances(c)[1] * float(rng.uniform(0.97, 1.03)), 0.3, 0.98)


def window(rng: np.random.Generator) -> Chute:
    def slope(chute: Chute) -> float:
        low, high = balances(chute)
        return low + (high - low) * float(rng.uniform(0.02, 0.98))

    return random_chute(rng, slope, 0.3, 0.95)


#: Name: the chutes, how many in full, and whether hold-ups from 6 to 29.5 are asked for.
GROUPS: dict[str, tuple[Callable[[np.random.Generator], Chute], int, bool]] = {
    "box": (box, 300, False),
    "general": (general, 200, False),
    "deep": (deep, 100, False),
    "deep, M 6 to 29.5": (deep, 150, True),
    "window, M 6 to 29.5": (window, 200, True),
    "window": (window, 100, False),
}
DEEPEST = 30.0


def questions(rng: np.random.Generator, chute: Chute, deep_only: bool) -> Iterator[tuple[str, float, Found, float]]:
    """What is asked of a chute: one hold-up, or two quantities, one of them that of a flow there is."""
    if deep_only:
        mass = float(rng.uniform(6.0, 29.5))
        yield "M", mass, brute(chute, "M", mass, mass, Fineness()), mass
        return
    force = BruteForce(chute, DEEPEST)
    segments, why = force.segments()
    for which, of_flow in zip(rng.permutation(4)[:2].tolist(), (True, False), strict=True):
        name = QUANTITIES[which]
        value = math.exp(rng.uniform(*np.log(WIDE[which])))
        if of_flow and len(segments):
            there = float(segments[rng.integers(len(segments)), 0, which]) + 1e-6
            value = min(max(math.exp(there), WIDE[which][0]), WIDE[which][1])
        if name == "T_surface":
            yield name, value, force.at_temperature(value), DEEPEST
        else:
            yield name, value, force.answer(segments, why, name, value), DEEPEST


def run(group: str, share: float, seed: int = 14) -> Tally:
    """A fraction of one group of chutes."""
    sample, number, deep_only = GROUPS[group]
    tally, seen = Tally(), 0
    for i in range(max(1, round(share * number))):
        rng = np.random.default_rng([seed, list(GROUPS).index(group), i])
        chute = sample(rng)
        for name, value, expected, deepest in questions(rng, chute, deep_only):
            compare(tally, chute, name, value, deepest, expected)
        check_branches(tally, chute)
        print(*(f"{group} {i} {line}\n" for line in tally.wrong[seen:]), sep="", end="", flush=True)
        seen = len(tally.wrong)
    print(group, tally, flush=True)
    return tally


def check_branches(tally: Tally, chute: Chute) -> None:
    """Half of delta gives the same numbers of flows at some hold-ups, unless a fold is near."""
    problem = model(chute_of(chute))
    refinements = [replace(REFINEMENT, delta=share * REFINEMENT.delta) for share in (1.0, 0.5)]
    grids = [integrate_trajectories(problem, 1e-3, 1e5, DEEPEST, refinement) for refinement in refinements]
    deepest = min(grid.deepest for grid in grids)
    for mass in np.geomspace(0.01, 0.98, 12) * deepest:
        counts = [
            [sum(int(np.sum((m[1:] >= at) != (m[:-1] >= at))) for b in grid.branches for m in [b.macroscopic[:, 2]])
             for at in math.log(mass) + np.array([-5.0, 0.0, 5.0]) * NEAR]
            for grid in grids
        ]  # fmt: skip
        if all(len(set(c)) == 1 for c in counts) and counts[0] != counts[1]:
            tally.wrong.append(f"delta: {chute}, M={mass:.5g}: {counts[0][0]} flows, {counts[1][0]} with half of delta")


CORNERS = [
    (Chute(slope, e, e_w, r, surface, closure), name, value)
    for slope, e, e_w, r, surface, closure in product(
        (1e-3, 0.3, 1e2), (1e-3, 0.8, 1.0), (0.0, 1.0), (0.5, math.sqrt(0.75)), SURFACES, CLOSURES
    )
    for name, value in (
        ("Q", 1e-6), ("Q", 1.0), ("Q", 1e6), ("h", 1e-6), ("h", 1e6), ("M", 1e-6), ("M", 300.0), ("T_surface", 1e-6),
    )
]  # fmt: skip


def run_corners(share: float) -> Tally:
    """A fraction of the questions at corners and edges: answered, and fast."""
    tally = Tally()
    for chute, name, value in CORNERS[:: max(1, round(1.0 / share))]:
        tally.questions += 1
        try:
            tally.flows += len(ask(chute, name, value, tally, surface_temperature=(1e-6, 1e5)))
        except SolveError as error:
            tally.wrong.append(f"refused: {chute}, {name}={value!r}: {error}")
        if tally.seconds[-1] > LIMIT:
            tally.wrong.append(f"slow: {chute}, {name}={value!r}: {tally.seconds[-1]:.2f} s")
    print("corners", tally, *tally.wrong, sep="\n", flush=True)
    return tally


def test_the_flows_of_the_paper_and_of_a_deep_question_are_found_by_brute_force():
    force = BruteForce(Chute(0.3, 0.8, 0.8, 0.6))
    found = force.answer(*force.segments(), "Q", 3.0)
    assert found.decided
    assert np.exp(found.flows[:, 3]) == pytest.approx([7.34134, 2.54049, 0.196783], rel=1e-4)
    assert np.exp(found.flows[:, 1]) == pytest.approx([8.8423, 3.9837, 1.77088], rel=1e-4)
    check_deep(DEEP[6])


def check_deep(asked: dict[str, Any]) -> None:
    chute = Chute(*(asked[name] for name in ("slope", "e", "e_w", "r", "surface", "closure")))
    found = brute(chute, "M", asked["M"], asked["M"], Fineness())
    known = np.log([[flow["Q"], flow["h"], asked["M"], flow["T_surface"]] for flow in asked["flows"]])
    assert paired(known, found.flows)
    order, known_order = np.argsort(found.flows[:, 0]), np.argsort(known[:, 0])
    assert np.abs(found.flows[order] - known[known_order]).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("asked", DEEP, ids=lambda asked: f"{asked['slope']:g}")
def test_deep_flows_are_found_by_brute_force(asked):
    check_deep(asked)


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_flows_are_those_of_the_brute_force(group):
    tally = run(group, SHARE)
    assert not tally.wrong
    assert tally.undecided <= 0.05 * tally.questions + 1


@pytest.mark.slow
def test_questions_at_corners_are_answered_in_time():
    assert not run_corners(SHARE).wrong
