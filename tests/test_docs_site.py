"""The documentation builds without network, loads nothing from outside, and links every equation to code."""

import re
from importlib import import_module
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[1] / "docs"

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(DOCS / "_ext")
    docstrings, equations, offline = map(import_module, ("docstrings", "equations", "offline"))

#: Numbers of the equations of the paper.
PAPER = [f"{section}.{number}" for section, last in ((2, 16), (3, 32), (4, 27)) for number in range(1, last + 1)]
PAPER += ["A1", "A2"]


def checked(site):
    """Assertions that hold for the quick build and for the whole one."""
    assert (site / "index.html").is_file()
    assert list(offline.loaded_from_outside(site)) == []
    model, hot = ((site / "theory" / f"{name}.html").read_text(encoding="utf-8") for name in ("model", "hot"))
    for number in PAPER:
        assert f'id="{equations.label(number)}"' in model + hot, number
    # Every equation is followed by a link into the reference.
    following = (model + hot).split('class="equation docutils container"')[1:]
    assert len(following) == len(PAPER)
    for after in following:
        beside = re.search(r'<p class="in-code">(.*?)</p>', after, re.DOTALL)
        assert beside is not None
        assert 'href="../reference/' in beside[1], beside[1]
    # Mathematics is set by a script of the site.
    assert re.search(r'src="\.\./_static/[^"]*mathjax[^"]*"', model, re.IGNORECASE)


def test_the_site_builds_without_network(quick_site):
    checked(quick_site)


@pytest.mark.slow
def test_the_whole_site_builds_without_network(whole_site):
    site = whole_site
    checked(site)
    figures = (site / "figures.html").read_text(encoding="utf-8")
    assert len(re.findall(r"<img[^>]*figure_\d\d\.png", figures)) == 17
    claims = (site / "verification" / "claims.html").read_text(encoding="utf-8")
    assert claims.count("<tr") > 80
    # Code that implements an equation leads back to it, and to its source.
    reference = (site / "reference" / "theory.html").read_text(encoding="utf-8")
    assert 'href="../theory/model.html#equation-3-16"' in reference
    assert "viewcode-link" in reference


# What the extensions refuse


@pytest.mark.parametrize(
    ("page", "found"),
    [
        ('<script src="https://cdn.example/x.js"></script>', 1),
        ('<link rel="stylesheet" href="//cdn.example/x.css">', 1),
        ('<img src="http://example/x.png">', 1),
        ("<style>@import url(https://example/x.css)</style>", 1),
        ('<p style="background: url(https://example/x.png)">', 1),
        ('<a href="https://example.org">a link</a>', 0),
        ('<link rel="next" href="https://example.org/next">', 0),
        ('<script src="_static/x.js"></script><img src="data:image/png;base64,aa">', 0),
    ],
)
def test_what_is_loaded_from_outside_is_seen(page, found, tmp_path):
    (tmp_path / "page.html").write_text(page, encoding="utf-8")
    assert len(list(offline.loaded_from_outside(tmp_path))) == found


def test_what_a_style_sheet_loads_is_seen(tmp_path):
    style = 'a { background: url("https://x/y.png") } b { background: url(here.png) } @import "//x/y.css";'
    (tmp_path / "x.css").write_text(style, encoding="utf-8")
    assert len(list(offline.loaded_from_outside(tmp_path))) == 2


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("F1 of (3.16), slip", {"3.16"}),
        ("(4.11)-(4.13)", {"4.11", "4.12", "4.13"}),
        ("(2.9)–(2.11) and (3.1)", {"2.9", "2.10", "2.11", "3.1"}),
        ("(A 1) and (A2)", {"A1", "A2"}),
        ("sqrt(2.5), (1.5), (4,), (12) and f(3.1)", set()),
    ],
)
def test_equations_in_text(text, found):
    assert equations.numbers(text) == found


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("(3.16) chuteflow.theory.boundary.slip_coefficient", None),
        ("(3.15) chuteflow.steady.flow.Flow.slip_velocity", None),
        ("(4.24) chuteflow.theory.hot.HotSolution.log_c", None),
        ("(3.16) chuteflow.theory.boundary.nothing", "there is no chuteflow.theory.boundary.nothing"),
        (
            "(4.27) chuteflow.theory.boundary.kappa",
            "the module of chuteflow.theory.boundary.kappa does not name (4.27)",
        ),
    ],
)
def test_code_of_an_equation(text, complaint):
    assert equations.fault(text) == complaint


def test_public_names_are_linked_where_the_reference_has_them():
    assert equations.shown_as("chuteflow.steady.flow.Flow.slip_velocity") == "chuteflow.Flow.slip_velocity"
    assert equations.shown_as("chuteflow.theory.hot.Dilute") == "chuteflow.theory.hot.Dilute"


def test_docstrings_link_equations_and_stay_plain():
    assert docstrings.escaped("F1 of (3.16), |x| and ``(3.16)``") == r"F1 of :eqn:`3.16`, \|x\| and ``(3.16)``"
    assert docstrings.marked_up(["Text:", "", "    a * b (3.1)"]) == ["Text:", "", "::", "", "    a * b (3.1)"]
