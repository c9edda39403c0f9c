"""Studies: what may stand in one, which points it has, and what tells one from another."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

from chuteflow.errors import InputError
from chuteflow.steady.quantities import NUMBERS
from chuteflow.sweeps.outcome import PointStatus
from chuteflow.sweeps.stability import STABILITY_NUMBERS
from chuteflow.sweeps.study import KINDS, from_canonical, from_dict, read

FIXED = {"slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6, "T_surface": 1.0}


def study(kind="product", folder=Path(), design=None, results=None, search=None, **parameters):
    return from_dict(
        {
            "design": {"kind": kind, **(design or {})},
            "parameters": FIXED | parameters,
            "results": results or {},
            "search": search or {},
        },
        folder,
    )


def column(one, name):
    return one.design.rows(0, one.points)[name]


# Designs


def test_a_product_has_every_combination_the_last_parameter_fastest():
    one = from_dict(
        {
            "parameters": {
                "slope": {"from": 0.2, "to": 0.4, "points": 3},
                "e": [0.7, 0.8],
                "ew": 0.8,
                "roughness": 0.6,
                "T_surface": {"from": 1.0, "to": 100.0, "points": 3, "scale": "log"},
                "surface": ["free", "interface"],
            }
        },
        Path(),
    )
    rows = np.stack([column(one, name) for name in ("slope", "e", "T_surface", "surface")], axis=1)
    expected = list(itertools.product([0.2, 0.3, 0.4], [0.7, 0.8], [1.0, 10.0, 100.0], [0.0, 1.0]))
    assert one.points == 36
    np.testing.assert_allclose(rows, expected, rtol=1e-15)
    assert set(column(one, "closure")) == {0.0}


def test_a_list_has_its_points_as_they_are(tmp_path):
    (tmp_path / "points.csv").write_text("slope,T_surface,surface\n0.3,1.5,free\n0.31,2.5,interface\n")
    one = from_dict(
        {
            "design": {"kind": "list", "file": "points.csv"},
            "parameters": {"e": 0.8, "ew": [0.7, 0.9], "roughness": 0.6},
        },
        tmp_path,
    )
    assert one.points == 2
    assert column(one, "slope").tolist() == [0.3, 0.31]
    assert column(one, "T_surface").tolist() == [1.5, 2.5]
    assert column(one, "surface").tolist() == [0.0, 1.0]
    assert column(one, "e").tolist() == [0.8, 0.8]
    assert column(one, "ew").tolist() == [0.7, 0.9]


@pytest.mark.parametrize("kind", ["random", "sobol"])
def test_spread_points_stay_in_their_ranges_and_do_not_depend_on_the_pieces(kind):
    one = study(
        kind,
        design={"points": 10000, "seed": 5},
        slope={"from": 0.2, "to": 0.4},
        T_surface={"from": 0.01, "to": 100.0, "scale": "log"},
        closure=["lun", "lun-fourier"],
        e=[0.7, 0.8, 0.9],
    )
    rows = one.design.rows(0, 10000)
    for piece in ((0, 100), (4000, 4200), (9999, 10000)):
        part = one.design.rows(*piece)
        assert all(np.array_equal(part[name], rows[name][slice(*piece)]) for name in rows)
    assert rows["slope"].min() >= 0.2
    assert rows["slope"].max() <= 0.4
    # Even in the parameter, in its logarithm, and over the values of a list.
    assert np.mean(rows["slope"] < 0.25) == pytest.approx(0.25, abs=0.02)
    assert np.mean(rows["T_surface"] < 0.1) == pytest.approx(0.25, abs=0.02)
    assert [np.mean(rows["e"] == e) for e in (0.7, 0.8, 0.9)] == pytest.approx([1 / 3] * 3, abs=0.02)
    assert np.mean(rows["closure"]) == pytest.approx(0.5, abs=0.02)
    assert np.corrcoef(rows["slope"], np.log(rows["T_surface"]))[0, 1] == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("kind", ["random", "sobol"])
def test_seeds_tell_designs_apart(kind):
    one, same, other = (
        study(kind, design={"points": 8, "seed": seed}, slope={"from": 0.2, "to": 0.4}) for seed in (1, 1, 2)
    )
    assert np.array_equal(column(one, "slope"), column(same, "slope"))
    assert not np.array_equal(column(one, "slope"), column(other, "slope"))
    assert one.digest == same.digest != other.digest


def test_a_study_of_a_hundred_million_points_is_made_at_once():
    one = study("random", design={"points": 10**8}, slope={"from": 0.2, "to": 0.4})
    assert one.chunks == -(-(10**8) // one.chunk)
    assert len(one.design.rows(10**8 - 5, 10**8)["slope"]) == 5


# The same study, and another


def test_the_form_of_the_file_does_not_matter(tmp_path):
    one, other = tmp_path / "one.toml", tmp_path / "other.toml"
    one.write_text(
        "[parameters]\nslope = [0.3, 0.4]\ne = 0.8\new = 1\nroughness = 0.6\n"
        'T_surface = {from = 1, to = 10, points = 3}\nsurface = "free"\n'
    )
    other.write_text(
        '# another form\n[design]\nkind = "product"\n[results]\nflows = 8\n[parameters]\nslope = [0.30, 0.40]\n'
        'e = 8e-1\new = 1.0\nroughness = 0.6\nT_surface = {to = 10.0, scale = "linear", from = 1.0, points = 3}\n'
    )
    assert read(one).digest == read(other).digest


def test_a_study_comes_back_from_its_canonical_form():
    one = study("sobol", design={"points": 64, "seed": 2}, slope={"from": 0.2, "to": 0.4}, surface=["interface"])
    back = from_canonical(one.canonical)
    assert back.digest == one.digest
    assert back.canonical == one.canonical
    assert np.array_equal(column(back, "slope"), column(one, "slope"))


# Refusals


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"slope": -0.3}, "parameters.slope reaches -0.3: must be from 1e-08 to 10000"),
        ({"slope": {"from": 0.2, "to": 0.4}}, "parameters.slope.points is missing: a product needs the number"),
        ({"slope": {"from": 0.4, "to": 0.2, "points": 3}}, "parameters.slope from 0.4 to 0.2: must rise"),
        ({"slope": {"from": 0.2, "points": 3}}, "parameters.slope.to is missing: a range has from and to"),
        (
            {"slope": {"from": 0.2, "to": 0.3, "points": 1}},
            "parameters.slope.points = 1: must be a whole number from 2",
        ),
        ({"slope": {"from": 0.2, "to": 0.3, "step": 0.1}}, "unknown key parameters.slope.step"),
        (
            {"slope": {"from": 0.2, "to": 0.3, "points": 2, "scale": "lin"}},
            "parameters.slope.scale = 'lin': choose one",
        ),
        ({"slope": "steep"}, "parameters.slope = 'steep': must be a number"),
        ({"slope": []}, r"parameters.slope = \[\]: give at least one value"),
        ({"Q": 3.0}, "give exactly one of T_surface, Q, M, h as the condition: got T_surface, Q"),
        ({"surface": "open"}, "parameters.surface: unknown surface 'open': choose one of free, interface"),
        ({"closure": ["lun", 3]}, "parameters.closure: unknown closure 3: choose one of lun, lun-fourier"),
        ({"closure": [[]]}, r"parameters.closure: unknown closure \[\]: choose one of lun, lun-fourier"),
        ({"base": True}, "parameters.base: unknown base True: choose one of richman"),
        ({"closure": "linear"}, "unknown closure 'linear': choose one of lun, lun-fourier"),
        ({"angle": 20.0}, "unknown parameter 'angle': choose from slope, e, ew"),
        ({"results": {"quantities": ["flux"]}}, "unknown quantity 'flux': choose from mass_flux"),
        ({"results": {"quantities": []}}, "must be a list of names"),
        ({"results": {"flows": 0}}, "results.flows = 0: must be a whole number from 1 to 64"),
        ({"results": {"chunk": 1.5}}, "results.chunk = 1.5: must be a whole number"),
        ({"results": {"file": "x"}}, "unknown key results.file: choose from quantities, flows, chunk"),
        ({"search": {"tolerance": 0.1}}, "search.tolerance = 0.1: must be a number from 1e-10 to 0.001"),
        ({"search": {"surface_temperature": [10, 1]}}, "surface temperatures from 10 to 1: must rise"),
        ({"search": {"surface_temperature": 3}}, r"search.surface_temperature = 3: must be two numbers, \[low, high\]"),
        ({"kind": "grid"}, "design.kind = 'grid': choose one of product, random, sobol, list"),
        ({"kind": "random"}, "design.points is missing: must be a whole number from 1"),
        ({"kind": "sobol", "design": {"points": 8, "seed": -1}}, "design.seed = -1: must be a whole number from 0"),
        ({"kind": "list", "slope": [0.1, 0.2], "e": [0.7, 0.8, 0.9]}, "columns of a list must be equally long"),
        ({"kind": "list", "slope": {"from": 1, "to": 2}}, "parameters.slope: a list design takes values, not a range"),
        ({"kind": "list", "design": {"file": "none.csv"}}, "design.file: cannot read none.csv: No such file"),
    ],
)
def test_what_is_wrong_is_named(given, message):
    with pytest.raises(InputError, match=message):
        study(**given)


def test_what_is_missing_is_named():
    with pytest.raises(InputError, match=r"parameters.ew is missing: the study needs slope, e, ew, roughness"):
        from_dict({"parameters": {"slope": 0.3, "e": 0.8, "roughness": 0.6, "Q": 1.0}}, Path())
    with pytest.raises(InputError, match=r"give exactly one of T_surface, Q, M, h as the condition: got none"):
        from_dict({"parameters": {"slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6}}, Path())


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(InputError, match=r"cannot read the study .*none.toml: No such file"):
        read(tmp_path / "none.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("slope = \n")
    with pytest.raises(InputError, match=r"the study .*broken.toml is not TOML"):
        read(broken)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("slope\n", "needs a line of names and at least one of numbers"),
        ("slope,e\n0.3\n", "line 2 of .* has 1 columns: the first has 2"),
        ("slope\nsteep\n", "points.csv, slope = 'steep': must be a number"),
        ("slope,e,slope\n0.3,0.8,0.4\n", "points.csv has the column 'slope' more than once: keep one of them"),
        ("slope\n" + "3" * 140000 + "\n", r"points.csv: field larger than field limit"),
        ("ew\n0.8\n", "parameters.ew is given in the study and in points.csv: give it once"),
    ],
)
def test_lists_that_are_no_list_are_named(tmp_path, text, message):
    (tmp_path / "points.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        study("list", tmp_path, design={"file": "points.csv"})


def test_files_may_begin_with_a_byte_order_mark(tmp_path):
    (tmp_path / "points.csv").write_text("slope,T_surface\n0.3,1.5\n", encoding="utf-8-sig")
    path = tmp_path / "study.toml"
    text = '[design]\nkind = "list"\nfile = "points.csv"\n[parameters]\ne = 0.8\new = 0.8\nroughness = 0.6\n'
    path.write_text(text, encoding="utf-8-sig")
    assert column(read(path), "slope").tolist() == [0.3]


def test_the_study_of_the_documents_is_a_study(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^```toml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    path = tmp_path / "study.toml"
    path.write_text(text)
    one = read(path)
    assert one.points == 20000
    assert one.chunks == 3
    # Every quantity that can be kept is named.
    assert all(f"`{name}`" in page for name in (*NUMBERS, *KINDS, *STABILITY_NUMBERS))
    assert all(f"{status.value} `{status.name.lower()}`" in page for status in PointStatus)
