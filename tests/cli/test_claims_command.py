"""``chuteflow claims``: the list that other programs rely on, the table for people, and exit codes."""

import json
import subprocess
import sys

import pytest

from chuteflow.cli.commands import claims as claims_command
from chuteflow.cli.program import main
from chuteflow.paper.claims import CLAIMS, check

CONTRACT = {"id", "statement", "printed", "computed", "verdict"}
QUICK = "flow-c,transition-angle,lambda-of-figure-12"


def run(*arguments: str) -> int:
    return main(["claims", *arguments])


def test_json_is_the_list_of_the_library(capsys):
    assert run("--only", QUICK, "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert [entry["id"] for entry in printed] == ["flow-c", "transition-angle", "lambda-of-figure-12"]
    for entry, verdict in zip(printed, check(QUICK.split(",")), strict=True):
        assert entry.keys() >= CONTRACT | {"reason", "source"}
        assert {name: entry[name] for name in CONTRACT} == {name: getattr(verdict, name) for name in CONTRACT}


def test_what_json_cannot_hold_is_null():
    assert claims_command._plain({"a": float("nan"), "b": {"c": float("inf"), "d": "words"}, "e": 1.0}) == {
        "a": None,
        "b": {"c": None, "d": "words"},
        "e": 1.0,
    }


def test_table_has_every_claim_and_the_numbers_of_verdicts(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "90")
    assert run("--only", QUICK) == 0
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    assert max(map(len, lines)) <= 90
    assert lines[0].split() == ["verdict", "claim", "printed", "computed"]
    assert lines[-1] == "3 claims: 2 confirmed, 1 corrected, 0 not confirmed"
    assert all(f"[{id}]" in captured.out for id in QUICK.split(","))
    assert captured.err == ""  # not a terminal


def test_part_of_an_id_chooses_all_that_have_it(capsys):
    assert run("--only", "far-", "--list") == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert listed == [id for id in CLAIMS if "far-" in id]


@pytest.mark.parametrize(("section", "claim"), [("4.3", "lambda-c"), ("4", "lambda-c"), ("appendix", "fourier-curve")])
def test_section_chooses_its_claims(capsys, section, claim):
    assert run("--section", section, "--list") == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert claim in listed
    assert all(any(name.startswith(section) for name in CLAIMS[id].sections) for id in listed)
    assert len(listed) < len(CLAIMS)


@pytest.mark.parametrize("suffix", [".json", ".txt"])
def test_out_writes_what_would_be_printed(capsys, tmp_path, suffix):
    path = tmp_path / f"claims{suffix}"
    assert run("--only", "transition-angle", "--out", str(path)) == 0
    assert capsys.readouterr().out == ""
    text = path.read_text(encoding="utf-8")
    if suffix == ".json":
        assert json.loads(text)[0]["verdict"] == "confirmed"
    else:
        assert text.endswith("1 claim: 1 confirmed, 0 corrected, 0 not confirmed\n")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--only", "flow-d"], "there is no claim 'flow-d': did you mean"),
        (["--only", ""], "there is no claim ''"),
        (["--section", "9"], "no claim of section '9'"),
        (["--only", "flow-a", "--section", "4.3"], "no claim of section '4.3' among those chosen: they are of 3.5"),
        (["--out", "claims.pdf"], "must end in .json or .txt"),
        (["--only", "flow-a", "--only", "flow-b"], "is given 2 times"),
    ],
)
def test_bad_input_is_one_line_and_2(refused, arguments, words):
    refused(["claims", *arguments], words)


def test_progress_is_shown_on_a_terminal_alone(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    found = list(claims_command._watch(check(QUICK.split(",")), 3))
    assert len(found) == 3
    assert "2 of 3 claims" in capsys.readouterr().err


def test_help_imports_nothing_that_takes_long():
    code = (
        "import sys; from chuteflow.cli.program import main; main(['claims', '--help']); "
        "print(*(m for m in ('numpy', 'scipy', 'matplotlib') if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == ""
