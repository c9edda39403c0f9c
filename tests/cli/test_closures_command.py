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
    def coefficients(nu, free_fraction, e, slope):
        return replace(LUN.coefficients(nu, free_fraction, e, slope), **{key: value(nu) for key, value in how.items()})

    return Law(name, "", "", LUN.densest, coefficients)


THIN = changed("thin", viscosity=lambda nu: 0.3 - nu)
BLANK = changed("blank", conductivity=lambda nu: nu * np.nan)
SHORT = changed("short", conductivity=lambda nu: np.ones(3))
RAISES = changed("raises", radial=lambda nu: 1 / 0)
NEGATIVE = changed("negative", dissipation=lambda nu: -np.ones_like(nu))
NAMED = changed("named", viscosity=lambda nu: "thick")
LISTED = changed("listed", viscosity=lambda nu: [1.0] * len(nu))
COMPLEX = changed("complex", viscosity=lambda nu: 1.0 + 1j * nu)
FLUX = changed("flux", density_flux=lambda nu: np.full_like(nu, np.nan))
FOUR = Law("four", "", "", 0.62, lambda nu: LUN.coefficients(nu, 1.0 - nu / 0.62, 0.8, 0.3))
PACKED = Law("packed", "", "", "0.62", LUN.coefficients)
BREAKS = Law("breaks", "", "", 0.62, lambda *all: LUN.coefficients(*all), breaks=lambda e, slope: 1 / 0)
BEYOND = Law("beyond", "", "", 0.62, lambda *all: LUN.coefficients(*all), breaks=(0.7,))
SINGLE = changed("single", bulk_viscosity=lambda nu: 0.0, density_conductivity=lambda nu: 0)
NOTHING = Law("nothing", "", "", 0.62, lambda nu, free_fraction, e, slope: None)
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
        ("NEGATIVE", "has no g5/nu^2 that makes sense at restitution e = 0.8: it is -1 at nu = 0"),
        ("NAMED", "g2 (viscosity) is of the type str at nu from 0 to 0.62, e = 0.8"),
        ("LISTED", "g2 (viscosity) is of the type list at nu from 0 to 0.62, e = 0.8"),
        ("COMPLEX", "g2 (viscosity) is of the type complex128 at nu from 0 to 0.62, e = 0.8"),
        ("FLUX", "has no nu g4 that makes sense at restitution e = 0.8: it is nan at nu = 0"),
        ("FOUR", "its function fails at nu from 0 to 0.62, e = 0.8: TypeError"),
        ("PACKED", "its densest packing is '0.62': must be a number above 0, at most 1"),
        ("BREAKS", "its breaks fail at e = 0.8, slope ="),
        ("BEYOND", "has a break at nu = 0.7: must be above 0 and below 0.62"),
        ("NOTHING", "its function returns a NoneType: must be Coefficients"),
        ("NUMBER", "'NUMBER' is a int; its laws are"),
        ("ABSENT", "'ABSENT' is not in it; its laws are"),
    ],
)
def test_bad_laws_end_in_one_line(refused, file, name, message):
    refused(["solve", *PAPER, "--flux", "3", "--closure", f"{file}:{name}"], message)


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


def test_a_coefficient_may_be_a_single_number(capsys, file):
    single = answer(capsys, "solve", *PAPER, "--flux", "3", "--closure", f"{file}:SINGLE")
    assert len(single["flows"]) == 3


#: These take more than a few seconds.
SLOW = ("design", "domain", "boundary", "stability", "growth", "neutral")
#: Commands with a law, without their chute; each ends well.
COMMANDS = [
    ["solve", *PAPER, "--flux", "3"],
    ["curve", *PAPER, "--points", "20"],
    ["boundary", *PAPER[2:], "--slope", "0.28:0.3", "--samples", "2"],
    ["domain", *PAPER[2:6], "--slope", "0.29:0.3", "--roughness", "0.59:0.6", "--size", "4x4", "--tolerance", "0.1"],
    ["hot", *PAPER],
    ["sensitivities", *PAPER, "--flux", "3", "--flow", "2"],
    ["design", "--unknown", "slope", *PAPER[2:], "--flux", "3", "--want", "M=0.75", "--range", "slope=0.28:0.32"],
    ["stability", *PAPER, "--flux", "3", "--kx", "0.1", "--ky", "0"],
    ["growth", *PAPER, "--flux", "3", "--flow", "2", "--size", "4x4"],
    ["neutral", *PAPER, "--size", "4x4"],
    ["relax", *PAPER, "--flux", "3", "--flow", "2", "--duration", "1"],
]


@pytest.mark.parametrize(
    "command",
    [pytest.param(c, marks=pytest.mark.slow if c[0] in SLOW else (), id=c[0]) for c in COMMANDS],
)
def test_the_law_of_a_file_gives_the_same_bits_in_every_command(capsys, file, command):
    own, built_in = (answer(capsys, *command, "--closure", closure) for closure in (f"{file}:OWN", "extended"))
    assert own != built_in
    text = json.dumps(own).replace(f"{file}:OWN", "extended").replace('"name": "own"', '"name": "extended"')
    assert json.loads(text) == built_in


@pytest.mark.parametrize(
    ("command", "why"),
    [
        (["hot"], "has no limit there, which the closed form of hot flows needs"),
        (
            ["growth", "--flux", "3", "--size", "4x4"],
            "has no limit there, which the conditions of disturbed flows need",
        ),
        (["neutral", "--size", "4x4"], "has no limit there, which the conditions of disturbed flows need"),
        (
            ["relax", "--flux", "3", "--duration", "1"],
            "has no limit there, which the conditions of disturbed flows need",
        ),
    ],
    ids=lambda value: value[0],
)
def test_what_cannot_be_posed_without_a_temperature_far_above_says_why(refused, command, why):
    refused([*command, *PAPER, "--closure", "garzo-dufty"], "T goes like p^(-0.297) far above", why)


def test_a_file_is_read_again_where_it_has_changed(file, tmp_path):
    chute = chuteflow.Chute(0.3, 0.8, 0.8, 0.6, closure=f"{file}:OWN")
    assert len(chuteflow.flows(chute, Q=3.0)) == 4
    file.write_text(FILE.replace('replace(EXTENDED, name="own")', 'replace(LUN, name="own")'))
    assert len(chuteflow.flows(chute, Q=3.0)) == 3
