"""``chuteflow relax``: table, verdict, JSON, files, picture, progress, interruption and bad input."""

import csv
import json
import re
import sys

import pytest

from chuteflow import progress
from chuteflow.cli.program import main

PAPER = "--slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6"
PRODUCTIVE = "--slope 0.3 --e 0.9 --ew 0.6 --roughness 0.8 --holdup 1.38185"


def run(arguments: str) -> int:
    return main(["relax", *arguments.split()])


def test_the_table_and_the_verdict(capsys):
    assert run(f"{PAPER} --flux 3 --flow 2 --duration 3000") == 0
    lines = capsys.readouterr().out.splitlines()
    assert "tan(theta) = 0.3" in lines[0]
    assert lines[2].split() == ["t", "Q", "h", "T_surface", "T_base"]
    assert [float(cell) for cell in lines[3].split()] == pytest.approx([0.0, 3.0, 3.9837, 2.7946, 4.3011], rel=1e-3)
    assert float(lines[-3].split()[1]) == pytest.approx(3.0, rel=1e-4)
    assert lines[-1].startswith("it has come to the flow it came from")


def test_json_files_and_picture_tell_the_same(capsys, tmp_path):
    files = [tmp_path / name for name in ("way.json", "way.csv", "way.png")]
    saved = f"{PAPER} --flux 3 --flow 3 --heat 0.8 --push 1.2 --duration 20"
    assert run(f"{saved} --json --save {files[0]}") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(files[0].read_text())
    assert printed["chute"]["slope"] == 0.3
    assert printed["t"][0] == 0.0
    assert printed["t"][-1] == pytest.approx(20.0)
    assert printed["Q"][0] == pytest.approx(1.2 * printed["from"]["Q"])
    assert printed["T_surface"][0] == pytest.approx(0.8 * printed["from"]["T_surface"])
    assert printed["arrested"] is False
    assert printed["steady"][printed["nearest"]]["Q"] == pytest.approx(3.0)
    assert run(f"{saved} --save {files[1]} --plot {files[2]}") == 0
    rows = list(csv.DictReader(files[1].read_text().splitlines()))
    assert [float(row["h"]) for row in rows] == printed["h"]
    assert files[2].read_bytes().startswith(b"\x89PNG")


def test_the_picture_holds_the_way_and_the_steady_flows(monkeypatch, tmp_path):
    drawn = []
    monkeypatch.setattr("chuteflow.plotting.plots.write_figure", lambda figure, path: drawn.append(figure))
    assert run(f"{PRODUCTIVE} --duration 10 --plot {tmp_path / 'way.png'}") == 0
    for ax in drawn[0].axes:
        way, *steady = ax.get_lines()
        assert len(steady) == 2
        assert way.get_xdata()[-1] == pytest.approx(10.0)
        assert ax.get_xscale() == "log"


@pytest.mark.slow
def test_beyond_a_fold_the_verdict_says_where_it_goes(capsys):
    assert run(f"{PRODUCTIVE} --flow 2 --heat 1.1 --duration 10000") == 0
    verdict = capsys.readouterr().out.splitlines()[-1]
    assert verdict.startswith("it comes to another flow of the same hold-up, Q = 6.6037")
    assert run(f"{PRODUCTIVE} --flow 2 --heat 0.9 --duration 10000") == 0
    verdict = capsys.readouterr().out.splitlines()[-1]
    found = re.match(r"it comes to rest at t = ([0-9.]+): collisions take more energy", verdict)
    assert found
    assert float(found[1]) == pytest.approx(2949.0, abs=0.5)


def test_the_rate_of_the_leading_mode_is_told_beside_what_was_seen(capsys):
    assert run(f"{PAPER} --flux 3 --duration 60 --json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["leading"] == pytest.approx(-0.13406, abs=1e-4)
    assert printed["rate"] > printed["leading"]
    assert run(f"{PAPER} --flux 3 --duration 60") == 0
    assert "the leading discrete mode of that flow has the rate -0.134" in capsys.readouterr().out


def test_too_short_a_time_is_said(capsys):
    assert run(f"{PAPER} --flux 3 --heat 2 --duration 5") == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith("give a longer --duration")


def test_no_flow_is_an_answer(capsys):
    assert run("--slope 0.1 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3") == 0
    assert capsys.readouterr().out.startswith("no flow: ")
    assert run("--slope 0.1 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3 --json") == 0
    assert json.loads(capsys.readouterr().out)["flows"] == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("--flow 4", "choose from 1 (hottest) to 3"),
        ("--flow 0", "choose from 1"),
        ("--heat 0", "must be above 0"),
        ("--heat 1e9", "at most 1000"),
        ("--push -2", "must be above 0"),
        ("--duration 0", "must be above 0"),
        ("--duration nan", "must be above 0"),
        ("--heat hot", "not a number"),
        ("--surface interface", "--surface free"),
        ("--save way.nc", ".csv or .json"),
        ("--plot /nowhere/way.png", "no directory"),
        ("--holdup 1", "give one of"),
    ],
)
def test_bad_input_is_one_line(capsys, arguments, said):
    assert run(f"{PAPER} --flux 3 {arguments}") == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert said in complaint


def test_what_cannot_be_followed_is_one_line(capsys):
    assert run(f"{PAPER} --flux 3 --heat 1000") == 1
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert "disturb it less" in complaint


def test_a_slow_run_shows_how_far_it_is_on_a_terminal_alone(monkeypatch, capsys):
    clock = iter(range(100_000))
    monkeypatch.setattr(progress.time, "monotonic", lambda: 2.0 * next(clock))
    assert run(f"{PAPER} --flux 3 --duration 1") == 0
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert run(f"{PAPER} --flux 3 --duration 1") == 0
    assert "of 1\r" in capsys.readouterr().err


def test_an_interruption_leaves_no_file_and_no_traceback(monkeypatch, capsys, tmp_path):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("chuteflow.stability.relaxation.Radau.step", interrupted)
    assert run(f"{PAPER} --flux 3 --save {tmp_path / 'way.csv'}") == 130
    assert capsys.readouterr().err.strip() == "chuteflow: interrupted"
    assert not list(tmp_path.iterdir())
