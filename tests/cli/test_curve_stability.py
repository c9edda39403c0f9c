"""``chuteflow curve --stability``: table, JSON, file and picture, by a known verdict."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import chuteflow
from chuteflow.cli.program import main
from chuteflow.plotting.stability_curve import plot_marked
from chuteflow.stability import along

CURVE = "curve --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --points 40 --search-temperature 0.3:10"


@pytest.fixture(autouse=True)
def known_verdict(monkeypatch):
    """Stable for surface temperatures from 1 to 2; unstable across the slope above, along it below."""

    def verdict(flow):
        T = flow.surface_temperature
        direction = "across" if T > 1.5 else "along"
        mode = SimpleNamespace(
            direction=direction, kind=direction, kx=0.1, ky=0.0, growth=0.01, frequency=0.2, speed=2.0, error=1e-8
        )
        return SimpleNamespace(stable=1.0 < T < 2.0, mode=mode)

    monkeypatch.setattr(along, "stability_of", verdict)


def run(arguments: str) -> int:
    return main(arguments.split())


def test_the_table_has_the_changes_and_the_stretches_in_words(capsys):
    assert run(f"{CURVE} --stability --samples 10") == 0
    told = capsys.readouterr().out
    assert told.count("stability-change") == 2
    (line,) = (line for line in told.splitlines() if line.startswith("stability, by 10 flows: "))
    assert [part.split(" from ")[0] for part in line.split(": ", 1)[1].split("; ")] == [
        "unstable across the slope",
        "stable",
        "unstable along the slope",
    ]


def test_json_has_the_special_points_and_the_examined_flows(capsys):
    assert run(f"{CURVE} --stability --samples 10 --json") == 0
    (branch,) = json.loads(capsys.readouterr().out)["branches"]
    changes = [point for point in branch["special"] if point["kind"] == "stability-change"]
    assert [point["T_surface"] for point in changes] == pytest.approx([2.0, 1.0], rel=5e-3)
    assert len(branch["stability"]) == 10
    for sample in branch["stability"]:
        assert sample["stable"] == (1.0 < sample["T_surface"] < 2.0)
        assert sample["mode"]["growth"] == 0.01


@pytest.mark.parametrize("ending", ["nc", "csv", "json"])
def test_files_keep_the_special_points(capsys, tmp_path, ending):
    path = tmp_path / f"curve.{ending}"
    assert run(f"{CURVE} --stability --samples 10 --save {path}") == 0
    assert "stability-change" in capsys.readouterr().out
    loaded = chuteflow.load(path)
    assert isinstance(loaded, chuteflow.Curve)
    kinds = [point.kind for point in loaded.branches[0].special]
    assert kinds.count("stability-change") == 2


def test_the_picture_is_solid_where_stable_and_dashed_where_not():
    curve = chuteflow.curve(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), points=40, surface_temperature=(0.3, 10.0))
    figure = plot_marked(along.mark_stability(curve, samples=10))
    lines = [line for line in figure.axes[0].get_lines() if np.size(line.get_xdata()) > 1]
    assert [line.get_linestyle() for line in lines] == ["--", "-", "--"]
    assert len({line.get_color() for line in lines}) == 3


def test_samples_without_stability_are_refused(capsys):
    assert run(f"{CURVE} --samples 10") == 2
    assert "give both" in capsys.readouterr().err
