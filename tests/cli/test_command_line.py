"""The command line as another program or a person meets it: output, exit codes, one line for a mistake."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from chuteflow import Chute, Scales, curve, flows
from chuteflow.cli.program import main

PAPER = ["--slope", "0.3", "--e", "0.8", "--ew", "0.8", "--roughness", "0.6"]
CHUTE = Chute(0.3, 0.8, 0.8, 0.6)
PROGRAM = Path(sys.executable).with_name("chuteflow")


def run(capsys, *arguments):
    code = main(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_the_installed_program_solves_the_papers_chute():
    done = subprocess.run([PROGRAM, "solve", *PAPER, "--flux", "3"], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    rows = [line.split() for line in done.stdout.splitlines() if line[:1] in "123" and "e-" in line]
    assert [row[4] for row in rows] == ["7.3386", "2.5405", "0.19681"]
    assert "hot, dilute, deep" in done.stdout
    assert "density inverted" in done.stdout
    assert "searched: T_surface from 0.001 to 1e+05, M up to 30" in done.stdout


def test_solve_json(capsys):
    code, out, err = run(capsys, "solve", *PAPER, "--flux", "3", "--json")
    assert (code, err) == (0, "")
    printed = json.loads(out)
    assert printed["chute"] == {
        "slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6, "surface": "free", "closure": "lun",
    }  # fmt: skip
    assert printed["reason"] is None
    searched = {name: printed["searched"][name] for name in ("T_surface", "M_max", "delta", "undecided")}
    assert searched == {"T_surface": [0.001, 100000.0], "M_max": 30.0, "delta": 0.2, "undecided": 0}
    assert printed["searched"]["cells"] > 1000
    keys = {"Q", "h", "M", "T_surface", "T_base", "nu_base", "nu_max", "u_base", "interior", "density", "error"}
    for flow, wanted in zip(printed["flows"], flows(CHUTE, Q=3.0), strict=True):
        assert keys <= set(flow)
        assert flow["Q"] == wanted.mass_flux
        assert flow["h"] == wanted.centre_of_mass
        assert flow["M"] == wanted.mass_holdup
        assert flow["T_surface"] == wanted.surface_temperature
        assert flow["T_base"] == wanted.base_temperature
        assert flow["nu_base"] == wanted.base_volume_fraction
        assert flow["nu_max"] == wanted.largest_volume_fraction
        assert flow["u_base"] == wanted.slip_velocity
        assert flow["error"] == wanted.error <= 1e-10


def test_the_table_tells_the_depth_from_the_centre_of_mass(capsys):
    _, out, _ = run(capsys, "solve", *PAPER, "--centre-of-mass", "39.448")
    header, row = (line.split() for line in out.splitlines()[2:4])
    assert row[1 + header.index("h")] == "39.448"
    assert float(row[1 + header.index("depth")]) > 150.0
    assert "depth: the height above which nu is below 1 % of nu_max; the centre of mass is h" in out


def test_the_table_and_the_object_have_names_and_validity(capsys):
    _, out, _ = run(capsys, "solve", *PAPER, "--flux", "3")
    rows = out.splitlines()[2:6]
    assert rows[0].endswith("validity")
    assert [row.partition("e-12  ")[2] for row in rows[1:]] == ["large slip, rarefied"] * 2 + ["large slip"]
    _, out, _ = run(capsys, "solve", *PAPER, "--flux", "3", "--json")
    for flow, wanted in zip(json.loads(out)["flows"], flows(CHUTE, Q=3.0), strict=True):
        assert flow["name"] == wanted.name
        assert flow["validity"]["words"] == list(wanted.validity.words)
        assert flow["validity"]["nu_max"] == wanted.largest_volume_fraction
        assert flow["validity"]["slip_ratio"] == wanted.validity.slip_ratio


def test_curve_json(capsys):
    code, out, _ = run(capsys, "curve", *PAPER, "--json")
    assert code == 0
    printed = json.loads(out)
    assert printed["searched"]["M_max"] == 30.0
    (branch,) = printed["branches"]
    (wanted,) = curve(CHUTE).branches
    assert branch["Q"] == wanted.mass_flux.tolist()
    assert branch["T_surface"] == wanted.surface_temperature.tolist()
    assert len(branch["h"]) == len(branch["M"]) == len(branch["Q"])
    assert branch["validity"]["packing"] == [flow.validity.packing for flow in wanted.flows]
    assert branch["validity"]["words"][-1] == ["packed: beyond the theory", "large slip"]
    assert [point["kind"] for point in branch["special"]] == ["fold-Q", "density-inversion", "fold-Q"]
    assert set(branch["special"][0]) >= {"kind", "Q", "h", "M", "T_surface"}


@pytest.mark.parametrize(
    ("condition", "quantity"),
    [
        ("--flux", "Q"),
        ("--holdup", "M"),
        ("--centre-of-mass", "h"),
        ("--depth", "h"),
        ("--temperature", "T_surface"),
    ],
)
def test_every_condition(capsys, condition, quantity):
    code, out, _ = run(capsys, "solve", *PAPER, condition, "1.3", "--json")
    assert code == 0
    found = json.loads(out)["flows"]
    assert found
    for flow in found:
        assert flow[quantity] == pytest.approx(1.3, rel=1e-9)


def test_an_angle_is_a_slope(capsys):
    others = PAPER[2:]
    _, by_angle, _ = run(capsys, "solve", "--angle", "16.69924423399362", *others, "--flux", "3")
    _, by_slope, _ = run(capsys, "solve", *PAPER, "--flux", "3")
    assert by_angle.splitlines()[3:8] == by_slope.splitlines()[3:8]


def test_surface_and_closure_are_passed_on(capsys):
    _, out, _ = run(
        capsys, "solve", *PAPER, "--flux", "3", "--surface", "interface", "--closure", "lun-fourier", "--json"
    )
    chute = Chute(0.3, 0.8, 0.8, 0.6, surface="interface", closure="lun-fourier")
    assert [f["h"] for f in json.loads(out)["flows"]] == [f.centre_of_mass for f in flows(chute, Q=3.0)]


def test_si_units(capsys):
    scales = Scales(diameter=1e-3, density=2500.0)
    code, out, _ = run(
        capsys, "solve", *PAPER, "--flux", "3", "--diameter", "1 mm", "--density", "2.5 g/cm^3", "--json"
    )
    assert code == 0
    printed = json.loads(out)
    assert printed["units"]["Q"] == "kg/m/s"
    assert printed["flows"][0]["Q"] == pytest.approx(3.0 * scales.factor("mass_flux", 0.3), rel=1e-12)
    _, table, _ = run(capsys, "solve", *PAPER, "--flux", "3", "--diameter", "0.001", "--density", "2500")
    assert "[kg/m/s]" in table


def test_no_flow_is_an_answer(capsys):
    chute = ["--slope", "0.2", "--e", "0.8", "--ew", "0.8", "--roughness", "0.85"]
    code, out, err = run(capsys, "solve", *chute, "--flux", "3")
    assert (code, err) == (0, "")
    assert "no flow: base and interior both lose energy" in out
    code, out, _ = run(capsys, "solve", *chute, "--flux", "3", "--json")
    assert code == 0
    printed = json.loads(out)
    assert printed["flows"] == []
    assert "both lose energy" in printed["reason"]
    assert run(capsys, "curve", *chute)[0] == 0


def test_plot_and_save(capsys, tmp_path):
    for command, condition in (("solve", ["--flux", "3"]), ("curve", ["--points", "30"])):
        for plot in ("a.png", "a.pdf", "a.svg"):
            picture, data = tmp_path / plot, tmp_path / "a.nc"
            code, _, err = run(capsys, command, *PAPER, *condition, "--plot", str(picture), "--save", str(data))
            assert (code, err) == (0, "")
            assert picture.stat().st_size > 5000
            assert data.stat().st_size > 5000
            picture.unlink()
            data.unlink()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["solve", *PAPER], "missing one of --flux, --holdup, --centre-of-mass and --temperature"),
        (["solve", *PAPER, "--flux", "3", "--holdup", "1"], "--flux 3 and --holdup 1: give one"),
        (["solve", *PAPER, "--flux", "3", "--depth", "1"], "--flux 3 and --centre-of-mass 1: give one"),
        (["solve", *PAPER, "--centre-of-mass", "3", "--depth", "1"], "--centre-of-mass is given 2 times"),
        (["solve", *PAPER, "--flux", "three"], "--flux 'three'"),
        (["solve", *PAPER, "--flux", "-3"], "Q = -3"),
        (["solve", *PAPER, "--flux", "nan"], "Q = nan"),
        (["solve", *PAPER[2:], "--flux", "3"], "missing --slope or --angle"),
        (["solve", *PAPER, "--angle", "17", "--flux", "3"], "--slope 0.3 and --angle 17"),
        (["solve", "--angle", "95", *PAPER[2:], "--flux", "3"], "angle = 95.0 degrees"),
        (["solve", "--slope", "0.3", "--flux", "3"], "missing --e"),
        (["solve", *PAPER, "--e", "1.2", "--flux", "3"], "--e is given 2 times"),
        (["solve", "--slope", "0.3", "--e", "1.2", *PAPER[4:], "--flux", "3"], "e = 1.2: must be above 0"),
        (["solve", "--slope", "x", *PAPER[2:], "--flux", "3"], "'x' is not a number"),
        (["solve", *PAPER[:6], "--roughness", "0.2", "--flux", "3"], "roughness r = 0.2"),
        (["solve", *PAPER, "--flux", "3", "--closure", "ideal"], "unknown closure 'ideal': choose one of"),
        (["solve", *PAPER, "--flux", "3", "--surface", "wavy"], "unknown surface 'wavy'"),
        (["solve", *PAPER, "--flux", "3", "--tolerance", "2"], "tolerance 2"),
        (["solve", *PAPER, "--flux", "3", "--search-temperature", "5"], "'5' is not a range"),
        (["solve", *PAPER, "--flux", "3", "--search-temperature", "5:1"], "must rise"),
        (["solve", *PAPER, "--flux", "3", "--largest-holdup", "-1"], "hold-up"),
        (["solve", *PAPER, "--flux", "3", "--diameter", "1 mm"], "--density is missing"),
        (["solve", *PAPER, "--flux", "3", "--diameter", "1 s", "--density", "2500"], "'s' is not a unit like m"),
        (["solve", *PAPER, "--flux", "3", "--diameter", "-1", "--density", "2500"], "diameter = -1"),
        (["solve", *PAPER, "--flux", "3 kg/m/s"], "a unit needs the grains"),
        (["solve", *PAPER, "--flux", "3", "--plot", "picture.gif"], "must end in"),
        (["solve", *PAPER, "--flux", "3", "--save", "nowhere/data.nc"], "no directory"),
        (["solve", *PAPER, "--flux", "3", "--colour", "red"], "--colour"),
        (["curve", *PAPER, "--points", "1"], "points = 1"),
        (["curve", *PAPER, "--flux", "3"], "--flux"),
        (["figures", "--only", "99"], "99"),
        (["dissolve"], "dissolve"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(capsys, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert len(err.splitlines()) == 1
    assert message in err
    assert list(tmp_path.iterdir()) == []


def test_help_is_quick_to_import():
    code = "import sys, chuteflow.cli.program as c; c.main(['--help']); print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "False"
    assert "solve" in done.stdout


def test_the_end_of_a_process_visits_no_objects():
    # With the compiler loaded the interpreter would take a quarter of a second to free them one by one.
    code = (
        "import gc, chuteflow.cli.program as program; program.main = lambda: 0; "
        "from chuteflow.__main__ import run; run(); print(gc.get_freeze_count())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) > 5_000


def test_solve_imports_no_more_than_it_needs():
    # The compiler of the search brings scipy.linalg with it.
    heavy = (
        "scipy.sparse", "scipy.optimize", "scipy.integrate", "scipy.special", "chuteflow.steady.mapped", "matplotlib",
        "pint", "h5py",
    )  # fmt: skip
    code = (
        "import sys, chuteflow.cli.program as c; "
        f"c.main({['solve', *PAPER, '--flux', '3']!r}); "
        f"print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert done.stderr == ""


def test_a_reader_that_goes_away_is_no_traceback():
    command = f"{PROGRAM} curve {' '.join(PAPER)} --json | head -c 10"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True)
    assert done.stderr == ""
