"""``chuteflow fit``, ``predict``, ``sensitivities`` and ``design``: files, answers and refusals."""

import json

import numpy as np
import pytest

from chuteflow import Chute, flows
from chuteflow.cli.program import BAD_INPUT, DONE, main
from chuteflow.io.fit_records import load_calibration
from chuteflow.io.measurements_file import read_measurements
from chuteflow.steady.quantities import Scales

PAPER = ["--slope", "0.3", "--e", "0.8", "--ew", "0.8", "--roughness", "0.6"]
SCALES = Scales(0.002, 2500.0)


@pytest.fixture(scope="module")
def flow():
    return flows(Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)[-1]


def written(path, flow, head="z,nu,T,u,Q", scale=lambda name, values: values, noise=0.0):
    z = np.linspace(0.1, 0.8, 8) * flow.depth
    p = flow.profile(z)
    rng = np.random.default_rng(4)
    columns = [
        scale(name, values * (1.0 + noise * rng.standard_normal(8)))
        for name, values in (
            ("volume_fraction", p.volume_fraction),
            ("granular_temperature", p.granular_temperature),
            ("velocity", p.velocity),
        )
    ]
    heights, flux = scale("height", z), float(scale("mass_flux", np.array([flow.mass_flux]))[0])
    rows = [",".join([repr(float(v)) for v in row] + [repr(flux)]) for row in zip(heights, *columns, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return str(path)


def answer(capsys, *arguments):
    assert main([*arguments, "--json"]) == DONE
    return json.loads(capsys.readouterr().out)


def test_a_fit_is_printed_saved_and_predicted_from(flow, tmp_path, capsys):
    data = written(tmp_path / "data.csv", flow, noise=0.03)
    known = ["--slope", "0.3", "--ew", "0.8", "--roughness", "0.6"]
    out = str(tmp_path / "fit.nc")
    command = ["fit", data, *known, "--free", "e", "--trials", "2"]
    assert main([*command, "--out", out]) == DONE
    text = capsys.readouterr().out
    assert "flow 3 of 3" in text
    assert "errors were not given" in text
    assert "measured without a model" in text
    (found,) = answer(capsys, *command, "--out", str(tmp_path / "fit.json"))["fits"]
    estimate = found["estimates"]["e"]
    assert estimate["interval"][0] < 0.8 < estimate["interval"][1]
    assert estimate["determined"]
    assert len(found["experiments"][0]["residuals"]["nu"]["residual"]) == 8
    for name in ("fit.nc", "fit.json"):
        loaded = load_calibration(tmp_path / name)
        assert loaded.chute.restitution == estimate["value"]
        assert loaded.covariance[0, 0] == found["covariance"][0][0]
    predicted = answer(capsys, "predict", out, "--slope", "0.29", "--flux", "3")
    assert predicted["parameters"] == ["e"]
    assert predicted["chute"]["slope"] == 0.29
    assert all(0.0 < one["errors"]["M"] < 0.1 for one in predicted["flows"])
    assert predicted["folds"][0]["relative_error"] > 0.0
    scales = Scales(1e-3, 2500.0)
    flux = scales.factor("mass_flux", 0.29)
    grains = ("--diameter", "1 mm", "--density", "2500")
    in_si = answer(capsys, "predict", out, "--slope", "0.29", "--flux", f"{3.0 * flux!r} kg/m/s", *grains)
    assert in_si["units"]["Q"] == "kg/m/s"
    for name, symbol in (("mass_flux", "Q"), ("mass_holdup", "M")):
        by = scales.factor(name, 0.29)
        assert in_si["flows"][0]["flow"][symbol] == pytest.approx(by * predicted["flows"][0]["flow"][symbol])
        assert in_si["flows"][0]["errors"][symbol] == pytest.approx(by * predicted["flows"][0]["errors"][symbol])
    assert in_si["folds"][0]["value"] == pytest.approx(flux * predicted["folds"][0]["value"])
    assert in_si["flows"][0]["profiles"]["z"][-1] == pytest.approx(1e-3 * predicted["flows"][0]["profiles"]["z"][-1])
    known_all = answer(capsys, "predict", out, "--e", "0.8", "--flux", "3")
    assert known_all["parameters"] == []
    assert known_all["flows"][0]["errors"]["M"] == 0.0


@pytest.mark.slow
def test_fits_predictions_and_sensitivities_are_drawn(flow, tmp_path):
    data = written(tmp_path / "data.csv", flow, noise=0.03)
    out, *pictures = (str(tmp_path / name) for name in ("fit.nc", "fit.png", "direct.png", "prediction.png", "s.png"))
    known = ["--slope", "0.3", "--ew", "0.8", "--roughness", "0.6"]
    fitted = ["fit", data, *known, "--free", "e", "--trials", "2", "--out", out]
    assert main([*fitted, "--plot", pictures[0], "--direct", pictures[1]]) == DONE
    assert main(["predict", out, "--flux", "3", "--plot", pictures[2]]) == DONE
    assert main(["sensitivities", *PAPER, "--flux", "3", "--plot", pictures[3]]) == DONE
    assert all((tmp_path / picture).stat().st_size > 1000 for picture in pictures)


def series(experiment, symbol):
    found = experiment.profile(symbol)
    assert found is not None
    return found


def test_units_are_read(flow, tmp_path):
    in_mm = {"height": 1e3, "velocity": 1e2, "mass_flux": 1.0}

    def scale(name, values):
        return values * SCALES.factor(name, 0.3) * in_mm.get(name, 1.0)

    head = "z [mm],nu,T [m^2/s^2],u [cm/s],Q [kg/m/s]"
    path = written(tmp_path / "si.csv", flow, head, scale)
    (one,) = read_measurements(path, slope=0.3, scales=SCALES).experiments
    profile = flow.profile(np.linspace(0.1, 0.8, 8) * flow.depth)
    for symbol, values in (
        ("nu", profile.volume_fraction),
        ("T", profile.granular_temperature),
        ("u", profile.velocity),
    ):
        np.testing.assert_allclose(series(one, symbol).value, values, rtol=1e-12)
    assert one.exact["Q"] == pytest.approx(flow.mass_flux, rel=1e-12)


def test_experiments_parameters_errors_and_gaps_are_read(tmp_path):
    path = tmp_path / "two.csv"
    path.write_text(
        "experiment,slope,z,nu,nu_error [%],Q,h,h_error\n"
        "a,0.3,0,0.3,5,3,1.8,0.1\na,0.3,1,,5,3,1.8,0.1\na,0.3,2,0.2,5,3,1.8,0.1\na,0.3,3,0.1,5,3,1.8,0.1\n"
        "b,0.28,,,,2,1.7,0.1\n",
        encoding="utf-8",
    )
    a, b = read_measurements(path).experiments
    assert series(a, "nu").height.tolist() == [0.0, 2.0, 3.0]
    assert series(a, "nu").error.tolist() == [0.05] * 3
    assert (a.given["slope"], b.given["slope"]) == (0.3, 0.28)
    assert (a.exact, b.exact) == ({"Q": 3.0}, {"Q": 2.0})
    assert b.profiles == ()
    assert b.scalars[0].error == 0.1


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "cannot read it"),
        ("", "needs a line with the names"),
        ("z,nu\n0,0.3\n1,-0.2\n2,0.1\n", "nu = -0.2 at z = 1: must be above 0"),
        ("z,T\n0,1\n1,-1\n2,1\n", "T = -1 at z = 1"),
        ("z,nu\n0,0.3\n2,0.2\n1,0.1\n", "z = 1 comes after 2"),
        ("z,nu\n0,0.3\n1,0.2\n1,0.1\n", "z = 1 is there twice"),
        ("z,nu\n0,0.3\n1,nan\n2,0.1\n", "must be finite; leave it empty"),
        ("z,nu\n0,0.3\n", "needs 3 at least"),
        ("z,nu\n0,0.3\n1,many\n2,0.1\n", "must be a number, or empty"),
        ("z,density\n0,0.3\n", "unknown column 'density'"),
        ("z,nu,nu\n0,0.3,0.3\n", "'nu' is there twice"),
        ("z,nu\n0,0.3,1\n", "line 2 has 3 cells"),
        ("z [mm],nu\n0,0.3\n1,0.2\n2,0.1\n", "a unit needs the grains"),
        ("z [kg],nu\n0,0.3\n1,0.2\n2,0.1\n", "'kg' is not a unit like m"),
        ("z,nu [mm]\n0,0.3\n1,0.2\n2,0.1\n", "'nu [mm]': it has no unit"),
        ("z,nu,Q\n0,0.3,3\n1,0.2,4\n2,0.1,3\n", "Q has several values"),
        ("Q\n3\n", "cannot determine"),
    ],
)
def test_bad_data_are_one_line(content, said, tmp_path, refused):
    path = tmp_path / "bad.csv"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    grains = (
        ["--diameter", "0.001", "--density", "2500"] if "[k" in said or "kg" in said or "mn" in str(content) else []
    )
    arguments = ["fit", str(path), "--slope", "0.3", "--free", "e,ew,roughness", *grains]
    refused(arguments, said)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["fit", "{data}", "--slope", "0.3"], "missing --free"),
        (["fit", "{data}", "--free", "e", "--ew", "0.8", "--roughness", "0.6"], "what is the slope"),
        (["fit", "{data}", "--free", "e", "--slope", "0.3"], "missing --ew"),
        (["fit", "{data}", *PAPER, "--free", "x"], "unknown parameter 'x'"),
        (["fit", "{data}", *PAPER, "--free", "e", "--closure", "lunn"], "unknown closure 'lunn'"),
        (["fit", "{data}", *PAPER, "--free", "e", "--range", "e"], "is not a range"),
        (["fit", "{data}", *PAPER, "--free", "e", "--out", "fit.txt"], "must end in .nc or .json"),
        (["predict", "{data}", "--flux", "3"], "must end in .nc or .json"),
        (["predict", "{data}.nc", "--flux", "3"], "cannot load"),
        (["predict", "{data}.nc", "--flux", "3"], "No such file or directory\n"),
        (["sensitivities", *PAPER, "--flux", "3", "--fixed", "u"], "choose one of T_surface, Q, M, h"),
        (["sensitivities", *PAPER, "--flux", "3", "--parameters", "e,x"], "unknown parameter 'x'"),
        (["design", *PAPER, "--flux", "3"], "missing --unknown"),
        (
            ["design", *PAPER[2:], "--unknown", "slope", "--flux", "3 kg/m/s", "--holdup", "1"],
            "which is unknown: omit the unit",
        ),
        (["design", *PAPER, "--unknown", "slope", "--flux", "3"], "1 condition for 1 unknown parameter"),
        (["design", *PAPER, "--unknown", "slope", "--flux", "3", "--want", "width=3"], "unknown quantity 'width'"),
    ],
)
def test_bad_options_are_one_line(arguments, said, flow, tmp_path, refused):
    data = written(tmp_path / "data.csv", flow)
    refused([word.format(data=data) for word in arguments], said)


def test_a_damaged_fit_is_refused(tmp_path, capsys):
    for name, content in (("a.json", "{}"), ("b.json", '{"format": 1, "kind": "flow"}'), ("c.nc", "not HDF5")):
        (tmp_path / name).write_text(content, encoding="utf-8")
        assert main(["predict", str(tmp_path / name), "--flux", "3"]) == BAD_INPUT
        assert "cannot load" in capsys.readouterr().err


def test_sensitivities_are_printed_and_saved(flow, tmp_path, capsys):
    found = answer(capsys, "sensitivities", *PAPER, "--flux", "3")
    assert len(found["flows"]) == 3
    last = found["flows"][-1]
    assert last["derivatives"]["M"]["slope"] == pytest.approx(flow.sensitivity(["slope"]).numbers["mass_holdup"][0])
    assert last["derivatives"]["H"]["slope"] is None
    assert last["fold"] is None
    grains = ["--diameter", "1 mm", "--density", "2500"]
    assert main(["sensitivities", *PAPER, "--flux", "1 kg/m/s", *grains]) == DONE
    assert "numbers are dimensionless" in capsys.readouterr().out
    table = tmp_path / "s.csv"
    assert main(["sensitivities", *PAPER, "--flux", "3", "--flow", "3", "--fixed", "M", "--save", str(table)]) == DONE
    assert "derivatives at fixed M" in capsys.readouterr().out
    assert table.read_text(encoding="utf-8").splitlines()[0].startswith("quantity,value,d/dslope")
    assert main(["sensitivities", "--slope", "0.05", *PAPER[2:], "--flux", "3"]) == DONE
    assert "no flow" in capsys.readouterr().out


@pytest.mark.slow
def test_a_chute_is_designed(capsys):
    found = answer(capsys, "design", "--unknown", "slope", *PAPER[2:], "--flux", "3", "--holdup", "1")
    for one in found["solutions"]:
        assert one["flow"]["M"] == pytest.approx(1.0, abs=1e-6)
        assert one["flow"]["Q"] == pytest.approx(3.0, abs=1e-6)
    assert found["solutions"]


@pytest.mark.slow
def test_a_chute_is_designed_in_si_units_and_saved(tmp_path, capsys):
    scales, saved = Scales(1e-3, 2500.0), tmp_path / "design.csv"
    flux = 3.0 * scales.factor("mass_flux", 0.3)
    asked = ["--unknown", "e", "--slope", "0.3", *PAPER[4:], "--flux", f"{flux!r} kg/m/s", "--holdup", "1"]
    found = answer(capsys, "design", *asked, "--diameter", "1 mm", "--density", "2500", "--save", str(saved))
    assert [one["flow"]["Q"] for one in found["solutions"]] == pytest.approx([flux] * len(found["solutions"]))
    head, *rows = saved.read_text(encoding="utf-8").splitlines()
    assert head.startswith("slope,e,ew,roughness,Q [kg/m/s]")
    assert len(rows) == len(found["solutions"]) > 0


def test_flows_without_a_name_are_not_taken_for_one(tmp_path, capsys):
    path = tmp_path / "data.csv"
    path.write_text("Q,h\n1,2\n2,3\n", encoding="utf-8")
    assert main(["fit", str(path), *PAPER, "--free", "e"]) == BAD_INPUT
    assert "where rows are several flows, name them in a column experiment" in capsys.readouterr().err
