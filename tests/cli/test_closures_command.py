"""Closures on the command line: the list, one law, several side by side, laws of files, and what is wrong with them."""

import json

import pytest

import chuteflow
from chuteflow.cli.program import BAD_INPUT, DONE, main
from chuteflow.theory.laws import LAWS
from chuteflow.theory.radial import RADIALS

PAPER = ["--slope", "0.3", "--e", "0.8", "--ew", "0.8", "--roughness", "0.6"]
#: The extended theory of the package in a file, and laws that are no good.
FILE = """
from dataclasses import replace

import numpy as np

from chuteflow.theory.constitutive import Law
from chuteflow.theory.extended import EXTENDED
from chuteflow.theory.lun import LUN

OWN = replace(EXTENDED, name="own")


def changed(name, **how):
    def coefficients(nu, room, e, slope):
        return replace(LUN.coefficients(nu, room, e, slope), **{key: value(nu) for key, value in how.items()})

    return Law(name, "", "", LUN.densest, coefficients)


THIN = changed("thin", viscosity=lambda nu: 0.3 - nu)
BLANK = changed("blank", conductivity=lambda nu: nu * np.nan)
SHORT = changed("short", conductivity=lambda nu: np.ones(3))
RAISES = changed("raises", radial=lambda nu: 1 / 0)
NOTHING = Law("nothing", "", "", 0.62, lambda nu, room, e, slope: None)
NUMBER = 3
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "grains.py"
    path.write_text(FILE)
    return path


def answer(capsys, *arguments):
    assert main([*arguments, "--json"]) == DONE
    return json.loads(capsys.readouterr().out)


def test_the_list_has_every_law_and_radial_function(capsys):
    found = answer(capsys, "closures")
    assert [law["name"] for law in found["closures"]] == list(LAWS)
    assert [r["name"] for r in found["radial_functions"]] == list(RADIALS)
    assert all(law["source"] and law["valid"] for law in found["closures"])
    assert main(["closures"]) == DONE
    out = capsys.readouterr().out
    assert all(name in out for name in (*LAWS, *RADIALS))


@pytest.mark.parametrize("name", LAWS)
def test_every_law_is_told_and_drawn(capsys, tmp_path, name):
    picture = tmp_path / "law.svg"
    found = answer(capsys, "closures", name, "--plot", str(picture))
    assert found["parameters"] == LAWS[name].parameters
    assert len(found["functions"]["viscosity"]) == len(found["nu"])
    assert picture.stat().st_size > 10_000


def test_parameters_come_with_the_name_or_apart(capsys):
    with_name = answer(capsys, "solve", *PAPER, "--flux", "3", "--closure", "extended:packing=0.64,radial=torquato")
    apart = ["--closure", "extended", "--set", "packing=0.64", "--set", "radial=torquato"]
    assert answer(capsys, "solve", *PAPER, "--flux", "3", *apart) == with_name
    assert with_name["chute"]["closure"] == "extended:packing=0.64,radial=torquato"
    assert with_name["closure"]["parameters"]["packing"] == 0.64
    assert with_name["flows"] != answer(capsys, "solve", *PAPER, "--flux", "3", "--closure", "extended")["flows"]


def test_a_law_of_a_file_gives_the_same_bits(capsys, file):
    own = answer(capsys, "solve", *PAPER, "--flux", "3", "--closure", f"{file}:OWN")
    built_in = answer(capsys, "solve", *PAPER, "--flux", "3", "--closure", "extended")
    assert len(own["flows"]) == 4
    assert own["flows"] == built_in["flows"]
    assert own["closure"]["digest"] == built_in["closure"]["digest"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("THIN", "has no positive g2 at restitution e = 0.8: it is"),
        ("BLANK", "has no positive g3 at restitution e = 0.8: it is nan at nu = 0"),
        ("SHORT", "g3 (conductivity) has the shape (3,)"),
        ("RAISES", "its function fails at nu from 0 to 0.62, e = 0.8: ZeroDivisionError"),
        ("NOTHING", "its function returns a NoneType: must be Coefficients"),
        ("NUMBER", "'NUMBER' is a int; its laws are"),
        ("ABSENT", "'ABSENT' is not in it; its laws are"),
    ],
)
def test_bad_laws_end_in_one_line(capsys, file, name, message):
    assert main(["solve", *PAPER, "--flux", "3", "--closure", f"{file}:{name}"]) == BAD_INPUT
    said = capsys.readouterr()
    assert said.out == ""
    assert message in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize("content", ["1 +", "raise SystemExit(3)", "import nothing_of_the_kind"])
def test_files_that_do_not_import_end_in_one_line(capsys, tmp_path, content):
    path = tmp_path / "broken.py"
    path.write_text(content)
    assert main(["solve", *PAPER, "--flux", "3", "--closure", f"{path}:OWN"]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "cannot be imported" in said
    assert said.count("\n") == 1


def test_laws_are_compared(capsys, tmp_path):
    picture = tmp_path / "laws.svg"
    arguments = [*PAPER, "--flux", "3", "--with", "lun,extended", "--with", "garzo-dufty:radial=ma-ahmadi"]
    found = answer(capsys, "compare-closures", *arguments, "--plot", str(picture))
    assert [len(one["flows"]) for one in found["closures"]] == [3, 4, 3]
    assert picture.stat().st_size > 10_000
    assert main(["compare-closures", *arguments]) == DONE
    assert capsys.readouterr().out.count("extended") == 4
    assert main(["compare-closures", *PAPER, "--flux", "3", "--closure", "lun"]) == BAD_INPUT


@pytest.mark.parametrize(
    "command",
    [
        ["curve", *PAPER, "--points", "20"],
        ["neutral", *PAPER, "--samples", "4"],
        ["growth", *PAPER, "--flux", "3", "--size", "4x1"],
        ["relax", *PAPER, "--flux", "3", "--duration", "1"],
        ["hot", *PAPER],
    ],
    ids=lambda command: command[0],
)
def test_the_law_of_a_file_reaches_every_command(capsys, file, command):
    codes = []
    outputs = []
    for closure in (f"{file}:OWN", "extended"):
        codes.append(main([*command, "--closure", closure]))
        said = capsys.readouterr()
        outputs.append((said.out + said.err).replace(str(file), "").replace(":OWN", "extended"))
    assert codes[0] == codes[1]
    assert outputs[0] == outputs[1]
    assert "Traceback" not in outputs[0]


def test_a_file_is_read_again_where_it_has_changed(file, tmp_path):
    chute = chuteflow.Chute(0.3, 0.8, 0.8, 0.6, closure=f"{file}:OWN")
    assert len(chuteflow.flows(chute, Q=3.0)) == 4
    file.write_text(FILE.replace('replace(EXTENDED, name="own")', 'replace(LUN, name="own")'))
    assert len(chuteflow.flows(chute, Q=3.0)) == 3
