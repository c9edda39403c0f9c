"""Every example in the README and the documents runs as it stands, and prints what the page shows."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from chuteflow.cli.program import main

from .run_page import agree, blocks_of, examples

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
NOTEBOOKS = sorted(DOCS.rglob("*.ipynb"))
PAGES = [ROOT / "README.md", *sorted(path for path in DOCS.rglob("*.md"))]
RUNNER = Path(__file__).with_name("run_page.py")


def name(page):
    return str(page.relative_to(ROOT))


#: Pages whose examples take seconds.
LONG = {"docs/calibration.md", "docs/tutorial.ipynb", "docs/domains.md", "docs/stability-answers.md"}
EXAMPLES = [
    pytest.param(page, id=name(page), marks=pytest.mark.slow if name(page) in LONG else ())
    for page in (*PAGES, *NOTEBOOKS)
    if any(blocks_of(page))
]


@pytest.mark.parametrize("page", EXAMPLES)
def test_examples(page, tmp_path):
    for file in page.parent.glob("*.py"):  # what the page tells to save
        if page.is_relative_to(DOCS) and file.parent != DOCS:
            shutil.copy(file, tmp_path)
    command = [sys.executable, "-W", "error", RUNNER, page]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_every_page_of_the_start_is_run():
    shown = [example.output for example in examples((DOCS / "start.md").read_text(encoding="utf-8"))]
    assert len(shown) >= 3
    assert None not in shown


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_no_example_is_passed_over(page):
    languages = re.findall(r"^```([\w-]+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    # A console holds what installs, serves or does not end, and py what needs a cluster; with text and toml they are
    # shown, not run.
    assert set(languages) <= {"python", "sh", "output", "console", "py", "text", "toml"}


def documented_names():
    text = (DOCS / "reference" / "json.md").read_text(encoding="utf-8")
    return set(re.findall(r"`([\w.-]+)`", text))


def names_in(value):
    if isinstance(value, dict):
        return set(value) | {name for inner in value.values() for name in names_in(inner)}
    return {name for inner in value for name in names_in(inner)} if isinstance(value, list) else set()


@pytest.mark.parametrize(
    "command",
    [
        "solve {chute} --flux 3 --diameter 0.001 --density 2500",
        "curve {chute} --points 8 --search-temperature 0.1:10",
        "hot {chute}",
        "boundary --slope 0.29:0.3 --e 0.8 --ew 0.8 --roughness 0.6 --samples 2 --search-temperature 0.1:10",
        pytest.param(
            "domain --slope 0.2:0.3 --roughness 0.55:0.65 --e 0.8 --ew 0.8 --size 2x2 --tolerance 0.1 --temperature 1 "
            "--processes 1",
            marks=pytest.mark.slow,
        ),
        "claims --only slip-limit",
        "stability {chute} --flux 3 --kx 0.01 --ky 0",
        pytest.param("growth {chute} --flux 3 --kx 0:0.02 --ky 0:0.02 --size 4x4", marks=pytest.mark.slow),
        pytest.param("neutral {chute} --size 4x4 --search-temperature 1:10", marks=pytest.mark.slow),
        "relax {chute} --flux 3 --duration 1",
        "sensitivities {chute} --flux 3 --flow 3",
        pytest.param("design {chute} --unknown slope --flux 3 --holdup 1", marks=pytest.mark.slow),
    ],
    ids=lambda command: command.split()[0],
)
def test_the_page_on_json_has_every_name(command, capsys):
    words = command.format(chute="--slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6").split()
    assert main([*words, "--json"]) == 0
    names = names_in(json.loads(capsys.readouterr().out))
    assert {name for name in names if not re.fullmatch(r"-?\d+", name)} <= documented_names()


# The runner itself


@pytest.mark.parametrize(
    ("shown", "written", "same"),
    [
        ("a 1.25\n", "a 1.25\n", True),
        ("a 1.25\n", "a 1.26\n", True),
        ("a 1.25\n", "a 1.27\n", False),
        ("a  1.25\n", "a 1.25\n", True),
        ("a 1.25\n", "b 1.25\n", False),
        ("3 flows\n", "2 flows\n", False),
        ("error 1e-12\n", "error 3e-11\n", True),
        ("error 1e-12\n", "error 3e-07\n", False),
        ("one\n...\nthree\n", "one\ntwo\nthree\n", True),
        ("one\n...\nthree\n", "one\ntwo\nthree\nfour\n", False),
        ("...\nthree\n", "one\ntwo\nthree\n", True),
        ("one\n...\n", "one\ntwo\n", True),
        ("one\n...\nthree\n...\nfive\n", "one\ntwo\nthree\nfour\nfive\n", True),
        ("one\n...\n6\n...\nfive\n", "one\ntwo\nthree\nfour\nfive\n", False),
        ("one\n", "one\ntwo\n", False),
        ("one\ntwo\n", "one\n", False),
    ],
)
def test_output_is_compared(shown, written, same):
    assert agree(shown, written) == same


@pytest.mark.parametrize(
    "page",
    [
        "```python\nprint(1)\n```\n\n```output\n2\n```\n",
        "```python\nraise ValueError\n```\n",
        "```sh\nchuteflow solve\n```\n",
        "```sh\nchuteflow --version  # exit code 2\n```\n",
        "```sh\nls\n```\n",
    ],
)
def test_a_wrong_example_is_seen(page, tmp_path):
    path = tmp_path / "page.md"
    path.write_text(page, encoding="utf-8")
    done = subprocess.run([sys.executable, RUNNER, path], cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 1
