"""``chuteflow hot``: the object that other programs rely on, the text for people, and exit codes."""

import json
import re
import subprocess
import sys

import pytest

from chuteflow.cli.program import main
from chuteflow.steady.chute import Chute
from chuteflow.steady.hot import hot

CONTRACT = {
    "lambda",
    "delta",
    "F21",
    "alpha",
    "exists",
    "inverted",
    "M",
    "Q_over_sqrt_T",
    "h_over_T",
    "slope_bounds",
}


def run(*arguments: str) -> int:
    return main(["hot", *arguments])


def chute_arguments(slope: float, e: float = 0.8, ew: float = 0.8, roughness: float = 0.6) -> list[str]:
    numbers = {"--slope": slope, "--e": e, "--ew": ew, "--roughness": roughness}
    return [word for name, value in numbers.items() for word in (name, repr(value))]


def test_json_object_is_that_of_the_library(capsys):
    assert run(*chute_arguments(0.3), "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed.keys() >= CONTRACT
    assert printed.pop("chute") == {
        "slope": 0.3,
        "e": 0.8,
        "ew": 0.8,
        "roughness": 0.6,
        "surface": "free",
        "closure": "lun",
    }
    assert printed == hot(Chute(0.3, 0.8, 0.8, 0.6)).as_dict()
    assert printed["lambda"] == pytest.approx(0.272, abs=5e-4)
    assert printed["exists"] is True
    assert printed["inverted"] is False
    low, high = printed["slope_bounds"]
    assert low < 0.3 < high


@pytest.mark.parametrize("slope", [0.1, 0.41, 0.5])
def test_numbers_of_a_flow_that_does_not_exist_are_null(capsys, slope):
    assert run(*chute_arguments(slope), "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["exists"] is False
    assert [printed[name] for name in ("inverted", "M", "Q_over_sqrt_T", "h_over_T")] == [None] * 4
    assert len(printed["slope_bounds"]) == 2
    assert printed["reason"]


def test_closure_is_passed_on(capsys):
    assert run(*chute_arguments(0.3), "--closure", "lun-fourier", "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["chute"]["closure"] == "lun-fourier"


def test_text_gives_the_scaling_laws(capsys):
    assert run(*chute_arguments(0.3)) == 0
    text = capsys.readouterr().out
    model = hot(Chute(0.3, 0.8, 0.8, 0.6)).as_dict()
    assert f"Q = {model['Q_over_sqrt_T']:.5g} sqrt(T_inf)" in text
    assert f"h = {model['h_over_T']:.5g} T_inf" in text
    assert f"M = {model['M']:.5g}" in text
    assert f"h = {model['h_over_T'] / model['Q_over_sqrt_T'] ** 2:.5g} Q^2" in text
    assert re.search(r"lambda +0\.27202 ", text)
    assert "tan(theta) from 0.18896 to 0.40124" in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (chute_arguments(0.38), "densest above the base"),
        (chute_arguments(0.42, 0.9, 0.6, 0.8), "interior productive"),
        (chute_arguments(0.41), "no hot flow: the slope is too steep: lambda = 3.75217 is not below 3"),
        (chute_arguments(0.1), "no hot flow: base and interior both lose energy"),
        (chute_arguments(0.5), "no hot flow: base and interior both gain energy"),
        (chute_arguments(0.3, 1.0, 1.0), "no slope has hot flows"),
    ],
    ids=["inverted", "productive", "lambda", "gentle", "steep", "elastic"],
)
def test_text_says_what_there_is(capsys, arguments, words):
    assert run(*arguments) == 0
    assert words in capsys.readouterr().out


def test_factors_too_large_for_a_number_are_printed(capsys):
    assert run(*chute_arguments(0.40124)) == 0
    assert re.search(r"Q = \d\.\d{3}e\+13\d{3} sqrt", capsys.readouterr().out)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([*chute_arguments(0.3), "--surface", "interface"], "surface = 'interface'"),
        (chute_arguments(0.3, roughness=0.3), "roughness r = 0.3"),
        (["--slope", "0.3"], "missing --e"),
        ([*chute_arguments(0.3), "--closure", "unheard-of"], "unknown closure"),
    ],
)
def test_bad_input_is_one_line_and_2(refused, arguments, words):
    refused(["hot", *arguments], words)


def test_what_takes_long_to_import_is_left_out():
    code = (
        "import sys; from chuteflow.cli.program import main; "
        f"main(['hot', *{chute_arguments(0.3)!r}]); "
        "print(*(m for m in ('scipy.optimize', 'scipy.integrate', 'matplotlib') if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == ""
