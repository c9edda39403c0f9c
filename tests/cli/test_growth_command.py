"""``chuteflow growth`` and ``chuteflow neutral``: tables, JSON, files, pictures and bad input."""

import json
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from chuteflow import Chute
from chuteflow.cli.program import main
from chuteflow.plotting.growth_plot import plot_wave_map

PAPER = "--slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6"
SMALL = f"growth {PAPER} --flux 3 --kx 0:0.02 --ky 0:0.03 --size 4x5"


def run(arguments: str) -> int:
    return main(arguments.split())


def test_map_json_files_and_picture(capsys, tmp_path):
    files = [tmp_path / name for name in ("map.json", "map.png")]
    assert run(f"{SMALL} --json --save {files[0]} --plot {files[1]}") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(files[0].read_text())
    assert printed["kx"] == pytest.approx(np.linspace(0.0, 0.02, 4).tolist())
    assert np.shape(printed["growth"]) == (4, 5)
    assert printed["growth"][0][1] > 0.0 > printed["growth"][3][4]
    assert printed["flow"]["Q"] == pytest.approx(3.0)
    (curve,) = printed["neutral"]
    assert len(curve["kx"]) == len(curve["ky"]) == len(curve["error"])
    assert max(curve["error"]) < 1e-5
    assert files[1].read_bytes().startswith(b"\x89PNG")


def test_the_report_and_rows_of_csv(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    away = SMALL.replace("0:0.02", "0.05:0.07").replace("0:0.03", "0.05:0.08")
    assert run(f"{away} --save {tmp_path / 'map.csv'}") == 0
    told = capsys.readouterr()
    assert "largest growth on the map: -" in told.out
    assert "growing: 0 of 20 points" in told.out
    assert "no neutral curve in this range" in told.out
    assert "20% of the map" in told.err
    rows = (tmp_path / "map.csv").read_text().splitlines()
    assert rows[0] == "kx,ky,growth,frequency"
    assert len(rows) == 21


def test_a_wavenumber_that_is_not_resolved_ends_nothing(capsys, tmp_path):
    picture = tmp_path / "map.svg"
    words = f"growth {PAPER} --flux 3 --kx 0:0.02 --ky 0:0.0218562 --size 4x4 --json --plot {picture}"
    assert run(words) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["unresolved"] == [{"kx": 0.0, "ky": pytest.approx(0.0218562)}]
    assert printed["growth"][0][3] is None
    assert sum(value is None for row in printed["growth"] for value in row) == 1
    assert printed["threshold"] == pytest.approx(1e-6 / printed["flow"]["h"] ** 0.5)
    assert len(printed["neutral"]) == 1
    drawing = picture.read_text()
    assert "hatched" in drawing or "pattern" in drawing


def test_round_off_of_the_mass_mode_is_no_growth(capsys):
    assert run(f"growth {PAPER} --flux 3 --flow 2 --kx 0:1e-9 --ky 0:1e-9 --size 4x4") == 0
    assert "growing: 0 of 16 points" in capsys.readouterr().out


def test_what_is_not_known_is_hatched_and_nothing_else():
    told = np.array([[0.1, 0.2, -0.1], [0.2, np.nan, -0.1], [0.1, 0.1, -0.2]])
    flow = SimpleNamespace(chute=Chute(0.3, 0.8, 0.8, 0.6), mass_flux=3.0, centre_of_mass=2.0)
    axis = np.array([0.0, 0.1, 0.2])
    for rates in (told, np.nan_to_num(told), np.full((3, 3), np.nan)):
        unknown = np.isnan(rates)
        mapped: Any = SimpleNamespace(
            flow=flow, kx=axis, ky=axis, growth=rates, grows=rates > 0.0, unresolved=unknown, neutral=()
        )
        figure = plot_wave_map(mapped)
        hatches = [patch.get_hatch() for patch in figure.axes[0].patches]
        assert hatches == (["////"] if unknown.any() else [])
        # All shades lie within what is told: none is made up for the rest.
        assert ("hatched" in figure.get_suptitle()) == unknown.any()


@pytest.mark.slow
@pytest.mark.parametrize("size", ["10x10", "12x12"])
def test_a_family_with_unresolved_waves_is_mapped(capsys, tmp_path, size):
    path = tmp_path / "map.json"
    assert run(f"neutral {PAPER} --waves across --size {size} --save {path}") == 0
    assert "neutral curve 1" in capsys.readouterr().out
    saved = json.loads(path.read_text())
    hidden = sum(value is None for row in saved["growth"] for value in row)
    assert hidden >= len(saved["unresolved"])


@pytest.mark.slow
def test_waves_along_a_family(capsys, tmp_path):
    words = f"neutral {PAPER} --search-temperature 0.5:8 --kh 0.005:0.3 --size 5x5"
    assert run(f"{words} --plot {tmp_path / 'branch.png'} --save {tmp_path / 'branch.csv'} --json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert np.shape(printed["growth"]) == (5, 5)
    assert len(printed["neutral"]) == 2
    assert (tmp_path / "branch.csv").read_text().startswith("kh,Q,h,M,T_surface,growth,frequency\n")


def test_no_flow_is_an_answer(capsys):
    none = "--slope 0.1 --e 0.8 --ew 0.8 --roughness 0.6"
    for words in (f"growth {none} --flux 3", f"neutral {none}"):
        assert run(words) == 0
        assert capsys.readouterr().out.startswith("no flow: ")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (f"growth {PAPER} --flux 3 --size 40", "MxN"),
        (f"growth {PAPER} --flux 3 --size 2x2", "size 2x2"),
        (f"growth {PAPER} --flux 3 --kx 1:0 --ky 0:1", "must rise"),
        (f"growth {PAPER} --flux 3 --kx 1", "LO:HI"),
        (f"growth {PAPER} --flux 3 --flow 9", "choose from 1"),
        (f"growth {PAPER} --flux 3 --kx 0:1 --ky 0:1 --surface interface", "free surface"),
        (f"growth {PAPER} --flux 3 --save map.nc", ".csv or .json"),
        (f"neutral {PAPER} --waves sideways", "along, across or an angle"),
        (f"neutral {PAPER} --waves 120", "from 0"),
        (f"neutral {PAPER} --kh 0:1", "k h from 0"),
    ],
)
def test_bad_input_is_one_line(capsys, arguments, said):
    assert run(arguments) == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert said in complaint
