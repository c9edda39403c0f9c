"""The claims on Part 2: their verdicts, and that other flows would change them."""

from types import SimpleNamespace

import pytest

from chuteflow.paper.claims import CLAIMS, stability
from chuteflow.stability.budget import ModeBudget, Term

IDS = ("three-unstable-modes", "stable-in-a-small-part", "inversion-and-stability")


@pytest.fixture
def known(monkeypatch):
    """Judged flows as the claims find them, by kind and density, without computing them."""

    def examined(kind, density):
        mode = SimpleNamespace(direction=kind, growth=0.01, kx=0.1, ky=0.0)
        flow = SimpleNamespace(density=density, centre_of_mass=2.0)
        return flow, SimpleNamespace(stable=kind == "stable", mode=mode, flow=flow)

    table = {
        "T_inf = 20": examined("across", "monotonic"),
        "flow A": examined("across", "monotonic"),
        "T_inf = 1.7": examined("stable", "monotonic"),
        "T_inf = 1.2": examined("stable", "inverted"),
        "flow C": examined("along", "inverted"),
    }
    monkeypatch.setattr(stability, "_stability_of_flows", lambda: table)
    monkeypatch.setattr(stability, "_steep", lambda: examined("oblique", "inverted")[1])
    return table, examined


def test_results_follow_from_the_flows(known):
    assert [CLAIMS[id].check().verdict for id in IDS] == ["confirmed"] * 3


@pytest.mark.parametrize(
    ("id", "name", "kind", "density"),
    [
        ("three-unstable-modes", "flow C", "across", "inverted"),
        ("stable-in-a-small-part", "flow A", "stable", "monotonic"),
        ("inversion-and-stability", "T_inf = 1.2", "along", "inverted"),
    ],
)
def test_other_flows_change_a_verdict(known, id, name, kind, density):
    table, examined = known
    table[name] = examined(kind, density)
    assert CLAIMS[id].check().verdict == "not confirmed"


def budget(loss, shear, closure=1e-9):
    """A budget with what the loss feeds in all, and the shear."""
    parts = ("collisional loss by density", 3.0 * loss), ("collisional loss by temperature", -2.0 * loss)
    terms = tuple(Term(name, thermal=rate) for name, rate in (*parts, ("shear production", shear)))
    return ModeBudget(SimpleNamespace(growth=0.01, direction="along"), terms, (0.3, 0.4, 0.3), closure)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("others", "of_kinds", "expected"),
    [
        (budget(0.05, 0.01), budget(0.05, 0.01), "confirmed"),
        (budget(0.01, 0.05), budget(0.05, 0.01), "corrected"),
        (budget(0.01, 0.05), budget(0.01, 0.05), "not confirmed"),
        # Terms that do not add up to the growth rate decide nothing.
        (budget(0.01, 0.05, closure=0.001), budget(0.05, 0.01), "not confirmed"),
    ],
)
def test_what_feeds_the_modes_decides_on_clustering(monkeypatch, others, of_kinds, expected):
    kinds = dict.fromkeys(("flow A", "flow C", "a steep flow"), of_kinds)
    monkeypatch.setattr(stability, "_budgets", lambda: kinds | {"a steep flow, along": others})
    assert CLAIMS["inelastic-clustering"].check().verdict == expected


@pytest.mark.slow
@pytest.mark.parametrize("id", IDS)
def test_real_flows_confirm_them(id):
    assert CLAIMS[id].check().verdict == "confirmed"
