"""What results show of themselves at a prompt and in a notebook: one line, one table."""

from functools import cache
from xml.etree import ElementTree

import numpy as np
import pytest

import chuteflow
from chuteflow import display
from chuteflow.maps import Domain
from chuteflow.stability.along import MarkedBranch, MarkedCurve, Sample, StabilityRun
from chuteflow.stability.neutral import NeutralCurve
from chuteflow.stability.planes import FamilyMap, WaveMap

CHUTE = chuteflow.Chute(0.3, 0.8, 0.8, 0.6)
NOWHERE = chuteflow.Chute(0.2, 0.8, 0.8, 0.85)


@cache
def paper_flows():
    return chuteflow.flows(CHUTE, Q=3.0)


@cache
def paper_curve():
    return chuteflow.curve(CHUTE, points=200, surface_temperature=(0.01, 1000.0))


def public_results():
    axis = np.linspace(0.1, 1.0, 50)
    growth = np.full((50, 50), np.nan)
    neutral = NeutralCurve(np.ones((500, 2)), axis, axis, ("the edge", "the edge"))
    boundaries = chuteflow.boundary(
        CHUTE, of="fold-Q", second="slope", bounds=(0.29, 0.3), samples=2, surface_temperature=(0.1, 10.0)
    )
    domain = chuteflow.domain(
        CHUTE,
        x=("slope", 0.2, 0.3),
        y=("roughness", 0.55, 0.65),
        size=(4, 4),
        tolerance=0.1,
        surface_temperature=(1.0, 10.0),
    )
    stability = chuteflow.stability_of(paper_flows()[2], kx=0.01, ky=0.0)
    branch = paper_curve().branches[0]
    sample = Sample(0.0, paper_flows()[2], stability)
    marked = MarkedBranch(branch, (sample,) * 24, (StabilityRun("stable", branch.flows),), ())
    return [
        CHUTE,
        paper_flows(),
        paper_flows()[0],
        paper_flows()[0].sampled(),
        paper_flows()[0].energy_budget,
        paper_flows()[0].validity,
        paper_flows().searched,
        chuteflow.flows(NOWHERE, Q=3.0),
        paper_curve(),
        branch,
        branch.special[0],
        chuteflow.curve(NOWHERE),
        chuteflow.hot(CHUTE),
        chuteflow.hot(NOWHERE),
        boundaries,
        *boundaries,
        domain,
        domain.boundaries[0],
        domain.regions("most")[0],
        stability,
        stability.mode,
        sample,
        marked,
        marked.runs[0],
        MarkedCurve(paper_curve(), (marked,)),
        neutral,
        WaveMap(paper_flows()[0], axis, axis, growth, growth, growth > 0.0, growth > 1.0, 1e-6, (neutral,)),
        FamilyMap(
            branch.flows, 0.0, axis, growth, growth, growth > 0.0, growth > 1.0, axis, (neutral,), (branch.flows,)
        ),
    ]


@pytest.fixture(scope="module")
def results():
    return public_results()


def test_every_result_is_one_short_line(results):
    for result in results:
        line = repr(result)
        assert "\n" not in line
        assert len(line) < 300, line
        assert "array(" not in line


def test_tables_in_notebooks_are_well_formed_and_short(results):
    shown = [result for result in results if hasattr(result, "_repr_html_")]
    kinds = {type(result) for result in shown}
    assert {chuteflow.Flow, chuteflow.FlowSet, chuteflow.Curve, chuteflow.Branch, chuteflow.Boundary} <= kinds
    assert {chuteflow.BoundarySet, Domain, chuteflow.Stability, chuteflow.Profile} <= kinds
    for result in shown:
        page = ElementTree.fromstring(f"<div>{result._repr_html_()}</div>")
        header = page.findall("./table/thead/tr/th")
        rows = page.findall("./table/tbody/tr")
        assert len(rows) < 70
        assert {len(row) for row in rows} <= {len(header)}


def test_lines_hold_the_numbers_that_place_a_flow():
    assert repr(paper_flows()[0]).startswith(
        "<Flow: hot, dilute, deep; Q = 3, h = 8.8389, M = 0.43922, T_surface = 7.3386, "
    )
    assert repr(paper_flows()) == "<FlowSet: 3 flows; T_surface = 7.3386, 2.5405, 0.19681>"
    assert repr(paper_curve()).startswith("<Curve: 1 branch, 200 flows; Q from ")
    assert repr(chuteflow.flows(NOWHERE, Q=3.0)).startswith("<FlowSet: 0 flows; ")


def test_a_table_of_flows_has_their_numbers():
    page = ElementTree.fromstring(f"<div>{paper_flows()._repr_html_()}</div>")
    cells = [[cell.text for cell in row] for row in page.findall("./table/tbody/tr")]
    assert [row[1] for row in cells] == [flow.name for flow in paper_flows()]
    assert [row[5] for row in cells] == ["7.3386", "2.5405", "0.19681"]


def test_of_many_rows_the_middle_is_left_out():
    table = display.html_table("many", ["n"], [[str(i)] for i in range(1000)])
    assert "... 940 more ..." in table
    assert "<td>0</td>" in table
    assert "<td>999</td>" in table


def test_what_is_no_number_is_a_dash():
    assert display.line("A", x=float("nan")) == "<A: x = ->"
    assert display.span("x", [float("nan")]) == "x not known"
