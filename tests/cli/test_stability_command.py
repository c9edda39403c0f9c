"""``chuteflow stability``: verdicts for people and programs, files, pictures, and refusals."""

import csv
import json

import pytest

import chuteflow
from chuteflow.cli.program import main
from chuteflow.stability import search
from chuteflow.stability.modes import UnresolvedError

MATERIAL = ["--slope", "0.3", "--e", "0.8", "--ew", "0.8", "--roughness", "0.6"]
#: Wavenumbers are given, so that no search is needed.
AT = ["--flux", "3", "--kx", "0.01", "--ky", "0"]


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    code = main(["stability", *arguments])
    printed = capsys.readouterr()
    return code, printed.out, printed.err


def test_json_object_holds_the_modes_of_every_flow(capsys):
    code, out, _ = run(capsys, *MATERIAL, *AT, "--modes", "2", "--json")
    told = json.loads(out)
    assert code == 0
    assert told["chute"]["slope"] == 0.3
    # One wave says nothing of the others: what it does is told beside it.
    assert [flow["stable"] for flow in told["flows"]] == [None, None, None]
    assert [flow["grows"] for flow in told["flows"]] == [False, False, True]
    for flow in told["flows"]:
        assert flow["complete"] is False
        assert flow["examined"] == 1
        assert flow["unresolved"] == []
        assert flow["wavenumbers"] == [0.01, 0.01]
        assert flow["threshold"] == pytest.approx(1e-6 / flow["h"] ** 0.5)
        assert "without --kx and --ky all are searched" in flow["why"]
        rates = flow["budget"]["terms"]
        assert sum(term["total"] for term in rates.values()) == pytest.approx(flow["mode"]["growth"], abs=1e-6)
        assert flow.keys() >= {"Q", "T_surface", "stable", "mode", "modes", "wavenumbers", "why"}
        assert flow["mode"].keys() == {"kx", "ky", "growth", "frequency", "speed", "kind", "error"}
        assert flow["modes"][0] == flow["mode"]
        assert flow["mode"]["growth"] > flow["modes"][1]["growth"]
        assert flow["mode"]["kx"] == 0.01
        assert flow["mode"]["kind"] == "along"
        assert flow["mode"]["speed"] == pytest.approx(flow["mode"]["frequency"] / 0.01)
    coldest = chuteflow.stability_of(chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)[2], kx=0.01, ky=0.0)
    assert coldest.mode is not None
    assert told["flows"][2]["mode"]["growth"] == coldest.mode.growth


def test_waves_across_have_no_speed(capsys):
    _, out, _ = run(capsys, *MATERIAL, "--temperature", "0.19680572", "--kx", "0", "--ky", "0.01", "--json")
    (flow,) = json.loads(out)["flows"]
    assert flow["mode"]["kind"] == "across"
    assert flow["mode"]["speed"] is None
    assert flow["mode"]["growth"] == pytest.approx(1.3764e-3, rel=1e-3)


def test_the_text_says_what_grows(capsys):
    code, out, _ = run(capsys, *MATERIAL, *AT)
    assert code == 0
    assert "cold, dense, shallow: a wave along the slope, 628.32 grain diameters long" in out
    assert "this wave makes the flow unstable" in out
    assert "hot, dilute, deep: a wave along the slope" in out
    assert "whether the flow is stable is not known from this" in out
    assert "stable:" not in out
    assert out.count("energy of the mode: ") == 3


def test_after_a_search_the_text_has_the_verdict_the_threshold_and_what_is_not_known(capsys, monkeypatch):
    calm = ["--slope", "0.535", "--e", "0.684", "--ew", "0.5", "--roughness", "0.835", "--flux", "0.355"]
    _, out, _ = run(capsys, *calm)
    (flow,) = chuteflow.flows(chuteflow.Chute(0.535, 0.684, 0.5, 0.835), Q=0.355)
    assert f"stable: nothing grows faster than {1e-6 / flow.centre_of_mass**0.5:.2g} for wavenumbers from " in out

    def unknown(disturbances, kx, ky, **settings):
        raise UnresolvedError(disturbances.flow, kx, ky)

    monkeypatch.setattr(search, "leading", unknown)
    code, out, _ = run(capsys, *calm, "--json")
    assert code == 0
    (flow,) = json.loads(out)["flows"]
    assert flow["stable"] is None
    assert flow["complete"] is True
    assert {"kx": 0.0, "ky": 0.0} in flow["unresolved"]
    assert "do not resolve" in flow["why"]
    code, out, _ = run(capsys, *calm)
    assert "not known: nothing is known to grow" in out
    assert "kx = 0 and ky = 0" in out


@pytest.mark.parametrize("command", ["stability", "growth", "relax"])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--surface", "interface"), "free surface"),
        (("--closure", "garzo-dufty"), "take the Fourier form of the closure"),
    ],
)
def test_where_nothing_can_be_said_of_any_flow_the_chute_is_refused(capsys, command, options, said):
    code = main([command, *MATERIAL, "--flux", "3", *options])
    out, err = capsys.readouterr()
    assert code == 2
    assert not out
    assert len(err.splitlines()) == 1
    assert said in err


def test_no_flow_is_an_answer(capsys):
    code, out, _ = run(capsys, *MATERIAL[2:], "--slope", "0.01", "--flux", "3", "--json")
    told = json.loads(out)
    assert code == 0
    assert told["flows"] == []
    assert told["reason"]


def test_files_and_picture(capsys, tmp_path):
    table, whole, picture, budget = (tmp_path / name for name in ("m.csv", "m.json", "m.svg", "b.svg"))
    assert main(["stability", *MATERIAL, *AT, "--save", str(table), "--plot", str(picture)]) == 0
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["stable"] for row in rows] == ["", "", ""]
    assert float(rows[2]["growth"]) == pytest.approx(7.25595e-3, rel=1e-4)
    drawing = picture.read_text()
    assert drawing.count("axes_") >= 6
    assert main(["stability", *MATERIAL, *AT, "--save", str(whole), "--budget", str(budget)]) == 0
    assert budget.read_text().count("axes_") >= 3
    mode = json.loads(whole.read_text())["flows"][2]["mode"]
    assert len(mode["z"]) == len(mode["nu"]["real"]) == len(mode["T"]["imaginary"])
    assert mode["z"][-1] == 0.0
    assert max(abs(complex(*uv)) for uv in zip(mode["u"]["real"], mode["u"]["imaginary"], strict=True)) <= 1.0 + 1e-12
    capsys.readouterr()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([*MATERIAL, "--flux", "3", "--kx", "nan"], "kx = nan"),
        ([*MATERIAL, "--flux", "3", "--kx", "1e9"], "must be from -10000 to 10000"),
        ([*MATERIAL, "--flux", "3", "--modes", "0"], "--modes 0"),
        ([*MATERIAL], "missing one of --flux"),
        ([*MATERIAL, "--flux", "3", "--save", "x.nc"], "must end in .csv or .json"),
        ([*MATERIAL, "--flux", "3", "--plot", "x.gif"], "must end in"),
    ],
)
def test_bad_input_is_refused_before_anything_is_computed(capsys, words, said):
    code, out, err = run(capsys, *words)
    assert code == 2
    assert not out
    assert said in err
    assert err.count("\n") == 1
