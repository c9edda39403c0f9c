"""The claims: the table of them, the verdict on each, and that verdicts follow from what is computed."""

import math
import re
import time
from collections.abc import Mapping
from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest

from chuteflow.errors import InputError
from chuteflow.paper.claims import (
    CLAIMS,
    VERDICTS,
    ClaimResult,
    check,
    domains,
    far_field,
    flow_curves,
    hot_flows,
    interface,
    matching,
    model,
    productive_flows,
    shown,
    three_flows,
)
from chuteflow.paper.claims.cold import cold_slope_bounds
from chuteflow.paper.claims.registry import Finding, claim, close, decide, rounds_to
from chuteflow.paper.claims.shared import count, curve_of, named_flows
from chuteflow.paper.materials import dissipative
from chuteflow.steady.flow import Flow
from chuteflow.theory.hot import HotSolution

NOT_A_NUMBER = re.compile(r"\bnan\b")
CORRECTED = {
    "all-inverted-on-steep-slopes",
    "base-traction",
    "cold-gentle",
    "expansion-of-velocity",
    "far-gradient",
    "flow-c",
    "inelastic-clustering",
    "interface-coefficients",
    "interface-inversion",
    "interface-profiles",
    "interface-stress",
    "inversion-slope",
    "inverted-if-shallow",
    "lambda-c",
    "less-elastic-grains",
    "maximum-flow-rate",
    "minimum-flux",
    "minimum-slope",
    "moderate-density",
    "no-analytic-solution",
    "no-three-flows-on-steep-slopes",
    "sign-of-lambda",
    "slip-limit",
    "temperature-gradient-dominates",
}
NOT_CONFIRMED = {"inversion-and-transition"}
#: Sections of the paper with something to test; 3.3 defines, and no more.
SECTIONS = {"1", "2", "2.1", "2.2", "3.1", "3.2", "3.4", "3.5", "3.6", "3.7", "4.1", "4.2", "4.3", "5", "appendix"}
#: What the published numbers become by computation, by claim and name.
NUMBERS = {
    ("flow-a", "T_inf"): 7.338568376,
    ("flow-b", "h"): 3.983737122,
    ("flow-c", "T_inf"): 0.1968057232,
    ("three-branches", "from Q"): 2.7684,
    ("three-branches", "to Q"): 5.0133,
    ("interface-stress", None): math.sqrt(math.pi) / 48.0,
    ("lambda-c", None): 3.0,
    ("lambda-inversion", None): 0.6603935,
    ("shooting-constant", None): 4.586131014,
    ("slope-at-lambda-one", None): 0.354104395,
    ("inversion-slope", "tan(theta)"): 0.336008486,
    ("no-inversion-on-gentle-slopes", None): 0.2896,
    ("minimum-slope", None): 0.1729,
    ("no-three-flows-on-steep-slopes", None): 0.3533,
    ("less-elastic-grains", "largest g40/g30"): 0.46187,
    ("hot-is-dilute", "largest nu at T_inf = 100000"): 3.1626e-6,
    ("slip-velocity", "A"): 1.47670,
    ("finite-range-of-slopes", "from tan(theta)"): 0.18,
    ("finite-range-of-slopes", "to tan(theta)"): 0.4,
}


@pytest.fixture(scope="module")
def timed() -> dict[str, tuple[ClaimResult, float]]:
    """All of them, computed once, with the processor time that each took."""
    found, begin = {}, time.process_time()
    for verdict in check():
        now = time.process_time()
        found[verdict.id], begin = (verdict, now - begin), now
    return found


@pytest.fixture(scope="module")
def verdicts(timed) -> dict[str, ClaimResult]:
    return {id: verdict for id, (verdict, _) in timed.items()}


# The table


def test_there_are_many_and_ids_are_short_slugs():
    assert len(CLAIMS) >= 45
    assert all(id == entry.id for id, entry in CLAIMS.items())
    assert all(id == id.lower() and id.replace("-", "").isalnum() and len(id) <= 32 for id in CLAIMS)


def test_every_section_with_something_to_test_is_covered():
    assert {section for entry in CLAIMS.values() for section in entry.sections} == SECTIONS


def test_claims_are_in_the_order_of_the_paper():
    order = sorted(SECTIONS)
    places = [order.index(entry.sections[0]) for entry in CLAIMS.values()]
    assert places == sorted(places)


def test_statements_are_sentences_of_their_own():
    statements = [entry.statement for entry in CLAIMS.values()]
    assert len(set(statements)) == len(statements)
    assert all(statement.endswith(".") and len(statement) < 260 for statement in statements)
    assert all(entry.sections for entry in CLAIMS.values())


def test_a_second_claim_of_one_id_is_refused():
    with pytest.raises(ValueError, match="two claims 'flow-a'"):
        claim("flow-a", "section 3.5", "Once more.")(lambda: Finding(1.0, 1.0, "confirmed", ""))


# The verdicts


@pytest.mark.slow
def test_all_of_them_take_less_than_half_a_minute(timed):
    assert len(timed) == len(CLAIMS)
    assert sum(seconds for _, seconds in timed.values()) < 30.0


def expected_verdict(id: str) -> str:
    return "corrected" if id in CORRECTED else "not confirmed" if id in NOT_CONFIRMED else "confirmed"


@pytest.mark.slow
@pytest.mark.parametrize("id", CLAIMS)
def test_result(verdicts, id):
    found = verdicts[id]
    assert found.verdict == expected_verdict(id), found
    assert found.verdict in VERDICTS
    assert (found.statement, found.source) == (CLAIMS[id].statement, CLAIMS[id].source)


@pytest.mark.slow
@pytest.mark.parametrize("id", CLAIMS)
def test_values_are_finite_and_said_in_words(verdicts, id):
    found = verdicts[id]
    for value in (found.printed, found.computed):
        parts = list(value.values()) if isinstance(value, Mapping) else [value]
        assert parts
        assert all(isinstance(part, str) or (isinstance(part, float) and math.isfinite(part)) for part in parts)
        assert not NOT_A_NUMBER.search(shown(value))
    assert found.reason.endswith(".")
    assert not NOT_A_NUMBER.search(found.reason)
    assert "inf " not in found.reason.replace("T_inf ", "")


@pytest.mark.slow
@pytest.mark.parametrize(("place", "expected"), NUMBERS.items())
def test_number(verdicts, place, expected):
    id, name = place
    computed = verdicts[id].computed
    assert (computed if name is None else computed[name]) == pytest.approx(expected, rel=3e-4)


def test_results_cannot_be_changed():
    found: Any = CLAIMS["flow-a"].check()
    with pytest.raises(FrozenInstanceError):
        found.verdict = "corrected"


# Verdicts follow from what is computed


def test_rounds_to():
    assert rounds_to(7.3449, "7.34")
    assert not rounds_to(7.3451, "7.34")
    assert rounds_to(0.65951, "0.660")
    assert not rounds_to(0.6594, "0.660")
    assert not rounds_to(math.nan, "0.660")


def test_close_is_never_so_for_what_is_not_finite():
    assert close(1.0, 1.0 + 1e-9, 1e-8)
    assert not close(math.nan, 1.0, 1.0)
    assert not close(math.inf, math.inf, 1.0)


@pytest.mark.parametrize(
    ("holds", "corrected", "verdict", "words"),
    [
        (True, True, "confirmed", "numbers"),
        (False, True, "corrected", "numbers instead"),
        (False, False, "not confirmed", "numbers"),
    ],
)
def test_decide(holds, corrected, verdict, words):
    found = decide(1.0, 2.0, holds=holds, corrected=corrected, reason="numbers", correction="instead")
    assert (found.verdict, found.reason) == (verdict, words)


def scaled(name: str, factor: float):
    """A property of a flow that is wrong by a factor."""
    right = getattr(Flow, name)
    return property(lambda flow: factor * right.__get__(flow))


WRONG = {
    "flow-a": (Flow, "surface_temperature", scaled("surface_temperature", 1.002)),
    "flow-b": (Flow, "centre_of_mass", scaled("centre_of_mass", 1.002)),
    "flow-c": (Flow, "mass_holdup", scaled("mass_holdup", 0.99)),
    "slip-falls": (Flow, "slip_velocity", property(lambda flow: 1.0)),
    "three-branches": (flow_curves, "count", lambda found, Q: 2),
    "window-grows": (flow_curves, "folds", lambda found: [1.0, 2.0]),
    "no-inversion-on-gentle-slopes": (flow_curves, "inversion_onset", lambda surface: 0.284),
    "productive-one-to-one": (productive_flows, "folds", lambda found: [1.0]),
    "interface-stress": (interface, "INTERFACE_STRESS", 0.037),
    "interface-cold-branch": (interface, "named_flows", lambda surface="free": named_flows("free")),
    "slip-limit": (hot_flows, "kappa", lambda r: 0.7),
    "lambda-of-figure-12": (hot_flows, "_model", lambda chute: hot_flows.hot(replace(chute, slope=0.29))),
    "expansion": (hot_flows, "expansion", lambda v, s, mu: (2.01 * s * v, 1.0 + 0.7 * s**2 * v, 1.0 + 0.0 * s)),
    "lambda-inversion": (domains, "inversion_lambda", lambda: 0.6606),
    "slope-bounds": (domains, "_budget", lambda value, right=domains._budget: right(1.01 * value)),
    "far-density": (far_field, "decay_rate", lambda flow, field, nu: 2.0),
    "far-heat-flux": (far_field, "net_production", lambda: 1.0),
    "base-traction": (model, "_traction_factor", lambda big_a: 0.5),
    "only-cold-inverted": (three_flows, "named_flows", lambda: dict.fromkeys("ABC", named_flows()["A"])),
    "shooting-constant": (hot_flows, "hot_solution", lambda v: domains.hot_solution(1.001)),
    "local-series": (HotSolution, "c", property(lambda solution: 4.6)),
    "slip-velocity": (model, "_traction_factor", lambda big_a: 0.5),
    "finite-range-of-slopes": (flow_curves, "cold_slope_bounds", lambda chute: (0.16, 0.36)),
    "interface-converges": (interface, "named_flows", lambda surface: {"C": named_flows()["C"]}),
    "hot-is-dilute": (Flow, "largest_volume_fraction", scaled("largest_volume_fraction", 1.01)),
    "lambda-diverges": (hot_flows, "_model", lambda chute: hot_flows.hot(replace(chute, slope=1.01 * chute.slope))),
    "lambda-zero-agrees": (domains, "slope_at", lambda *values: 1.015 * (hot_flows.slope_at(*values) or 0.0)),
}


@pytest.mark.parametrize("id", WRONG)
def test_a_wrong_value_changes_the_verdict(monkeypatch, id):
    assert CLAIMS[id].check().verdict == expected_verdict(id)
    monkeypatch.setattr(*WRONG[id])
    assert CLAIMS[id].check().verdict != expected_verdict(id)


def test_the_printed_bound_would_be_confirmed_if_the_equations_had_it(monkeypatch):
    monkeypatch.setattr("scipy.special.i0e", lambda x: np.sqrt(3.0 / 2.284) * np.ones_like(x))
    monkeypatch.setattr("scipy.special.i1e", lambda x: np.ones_like(x))
    monkeypatch.setattr(domains, "close", lambda *_: False)
    assert CLAIMS["lambda-c"].check().verdict == "confirmed"


# What the claims rest on


def test_flows_of_a_curve_are_counted():
    found = curve_of(dissipative(0.3))
    assert [count(found, Q) for Q in (1.0, 3.0, 6.0)] == [1, 3, 1]


def test_cold_flows_exist_between_their_bounds():
    low, high = cold_slope_bounds(dissipative(0.3))
    assert cold_slope_bounds(dissipative(0.25)) == (low, high)
    coldest = {slope: curve_of(dissipative(slope), 1e-4, 40).branches for slope in (0.99 * low, 1.06 * low)}
    assert [bool(branches) for branches in coldest.values()] == [False, True]
    assert low == pytest.approx(0.17285, abs=1e-5)
    assert high == pytest.approx(0.35333, abs=1e-5)


# Choosing


def test_claims_are_computed_one_at_a_time(monkeypatch):
    computed = []
    for id in ("flow-a", "flow-b"):
        entry = CLAIMS[id]
        monkeypatch.setitem(CLAIMS, id, replace(entry, test=lambda e=entry: computed.append(e.id) or e.test()))
    found = check(["flow-b", "flow-a"])
    assert computed == []
    assert next(found).id == "flow-a"
    assert computed == ["flow-a"]


def test_an_unknown_claim_is_named_before_anything_is_computed():
    with pytest.raises(InputError, match=r"no claim 'flow-d': did you mean .*flow-a"):
        check(["flow-a", "flow-d"])


def test_matching():
    assert matching(["flow-c", "three-flows"]) == ["three-flows", "flow-c"]
    assert set(matching(["interface"])) == {id for id in CLAIMS if "interface" in id}
    with pytest.raises(InputError, match="did you mean lambda-c"):
        matching(["lambda-cc"])
    with pytest.raises(InputError, match="no claim ''"):
        matching([""])


def test_shown():
    assert shown(0.1968057) == "0.19681"
    assert shown({"T_inf": 7.34, "kind": "hot"}) == "T_inf: 7.34; kind: hot"
