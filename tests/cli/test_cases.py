"""A chute is said once: by a file, a case or the environment; and results in SI units with its grains."""

import json
import math
import re
import time

import click
import pytest

import chuteflow
from chuteflow.branches.nearest import nearest
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.program import chuteflow as program
from chuteflow.cli.program import main
from chuteflow.io.chute_file import read_chute
from chuteflow.steady.cases import CASES, GUESSED, TYPICAL, case

PAPER = "--slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6"
FILE = """
case = "paper-dissipative"
roughness = 0.65
surface = "interface"
[grains]
diameter = "1 mm"
density = 2500
"""


@pytest.fixture
def run(capsys, monkeypatch):
    monkeypatch.delenv("CHUTEFLOW_CASE", raising=False)

    def call(*words):
        code = main([part for word in words for part in (word.split() if isinstance(word, str) else word)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(FILE, encoding="utf-8")
    return str(path)


# The chute


def test_a_case_is_its_numbers(run):
    _, by_case, _ = run("solve --case paper-dissipative --flux 3 --json")
    _, by_hand, _ = run(f"solve {PAPER} --flux 3 --json")
    assert by_case == by_hand


def test_the_environment_names_a_case_and_options_override_it(run, monkeypatch):
    monkeypatch.setenv("CHUTEFLOW_CASE", "paper-dissipative")
    _, out, _ = run("hot --slope 0.31 --json")
    assert json.loads(out)["chute"]["slope"] == 0.31
    assert json.loads(out)["chute"]["e"] == 0.8
    _, out, _ = run("hot --case paper-productive --json")
    assert json.loads(out)["chute"]["e"] == 0.9
    _, out, _ = run("hot --angle 20 --json")
    assert json.loads(out)["chute"]["slope"] == pytest.approx(math.tan(math.radians(20.0)), rel=1e-12)


def test_a_file_describes_a_chute(run, file, monkeypatch):
    _, out, _ = run("solve --flux 3 --json --chute", [file])
    chute = json.loads(out)["chute"]
    assert (chute["slope"], chute["roughness"], chute["surface"]) == (0.3, 0.65, "interface")
    monkeypatch.setenv("CHUTEFLOW_CASE", file)
    _, again, _ = run("solve --flux 3 --json")
    assert json.loads(again) == json.loads(out)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("slope = 0.3\nangle = 17\n", "slope and angle"),
        ("e = 0.8\nrestitution = 0.8\n", "e is given twice, also as restitution"),
        ("slop = 0.3\n", "unknown key 'slop': did you mean slope?"),
        ("e = 'a'\n", "e = 'a': must be a number"),
        ("slope = [\n", "not a TOML file"),
        ("[grains]\ndensity = '3 mm'\n", "'mm' is not a unit like kg/m^3"),
        ("[grains]\ndensity = -1\n", "must be a positive number"),
        ("case = 'glass'\n", "did you mean glass-beads?"),
        ("surface = 3\n", "must be a name in quotes"),
        ("[chute]\nslope = 0.3\n[grains]\nslope = 0.3\n", "slope is given twice"),
        ("slope = 16.7\ne = 0.8\new = 0.8\nroughness = 0.6\n", "did you mean --angle 16.7?"),
    ],
)
def test_a_bad_file_is_one_line(run, tmp_path, text, said):
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    code, out, err = run("hot --chute", [str(path)])
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("hot --case glas-beads", "unknown case 'glas-beads': did you mean glass-beads?"),
        ("hot --case mine.toml", "a file is given by --chute mine.toml"),
        ("hot --case sand", "missing --slope or --angle"),
        ("hot --case sand --chute x.toml", "give one of them"),
        ("hot --chute nowhere.toml", "nowhere.toml: cannot be read"),
        ("cases marbles", "choose one of paper-dissipative"),
        (f"hot {PAPER} --si", "--diameter is missing"),
        (f"solve {PAPER.replace('0.3', '16.7')} --flux 3", "slope 16.7: did you mean --angle 16.7?"),
        ("solve --angle 0.3 --case sand --flux 3", "angle 0.3: did you mean --slope 0.3?"),
        ("solve --case sand --slope 0.35 --flux 3kg/m2 --si", "'kg/m2' is not a unit like kg/m/s"),
    ],
)
def test_a_mistake_is_one_line(run, words, said):
    code, out, err = run(words)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


def test_every_number_of_a_material_says_how_it_is_known():
    for one in CASES.values():
        for key, known in {**one.numbers, **one.grains}.items():
            if known.how in (TYPICAL, GUESSED):
                assert known.uncertainty, (one.name, key)
                assert known.source, (one.name, key)
    assert case("sand").numbers["e"].how == GUESSED
    assert case("glass-beads").numbers["e"].how == TYPICAL


def test_cases_are_listed_and_told(run):
    _, out, _ = run("cases")
    assert all(name in out for name in CASES)
    _, out, _ = run("cases glass-beads")
    assert "+- 0.02" in out
    assert "not checked against it" in out
    _, out, _ = run("cases --json")
    assert [one["name"] for one in json.loads(out)["cases"]] == [*CASES]


def test_a_case_makes_a_chute_in_python(file):
    assert case("sand").chute(slope=0.35).restitution == 0.7
    with pytest.raises(chuteflow.InputError, match=r"sand has no slope: give slope=... \(or angle=... in degrees\)"):
        case("sand").chute()
    assert case("sand").chute(angle=19, e=0.75) == chuteflow.Chute.at_angle(19, 0.75, 0.7, 0.7)
    assert chuteflow.cases()["sand"] == case("sand")
    for wrong, message in (
        ({"slope": 0.3, "angle": 20}, "slope is given twice, also as angle"),
        ({"slope": 0.3, "ew": 0.7, "wall_restitution": 0.8}, "wall_restitution is given twice"),
        ({"slope": 0.3, "rough": 0.6}, "unknown argument 'rough': did you mean roughness?"),
    ):
        with pytest.raises(chuteflow.InputError, match=re.escape(message)):
            case("sand").chute(**wrong)
    mine = read_chute(file)
    assert mine.scales == chuteflow.Scales(1e-3, 2500.0)
    assert mine.chute().roughness == 0.65


def test_what_is_nearest_shows_itself_with_the_range_that_was_examined():
    table = chuteflow.nearest(chuteflow.Chute(0.5, 0.8, 0.8, 0.6))._repr_html_()
    assert "tan(theta) = 0.5 (26.57 degrees)" in table
    assert "degrees)</td><td>" in table


def test_a_case_shows_how_each_number_is_known():
    table = case("glass-beads")._repr_html_()
    assert "<td>roughness</td><td>0.65 </td><td>0.1</td><td>guessed</td>" in table
    assert "0.003 m" in table


# Units


def test_a_flux_by_volume_is_one_by_mass(run):
    grains = ["--diameter", "1 mm", "--density", "2500"]
    _, by_volume, err = run(f"solve {PAPER} --json", grains, ["--flux", "0.0004 m2/s"])
    assert not err
    _, by_mass, _ = run(f"solve {PAPER} --json", grains, ["--flux", "1 kg/m/s"])
    assert json.loads(by_volume)["flows"][0]["Q"] == pytest.approx(1.0, rel=1e-9)
    assert json.loads(by_volume) == json.loads(by_mass)
    _, by_depth, _ = run(f"solve {PAPER} --json", grains, ["--holdup", "0.5 mm"])
    assert json.loads(by_depth)["flows"][0]["M"] == pytest.approx(1.25, rel=1e-9)


def test_a_bare_number_beside_si_is_said_to_be_dimensionless(run):
    words = f"solve {PAPER} --diameter 0.001 --density 2500 --flux 3 --json"
    _, out, err = run(words)
    assert "--flux 3 is taken as dimensionless, 0.72701 kg/m/s here" in err
    assert json.loads(out)["flows"][0]["Q"] == pytest.approx(0.72701, rel=1e-4)
    _, again, err = run(words, "--quiet")
    assert (again, err) == (out, "")


def test_a_range_searched_takes_units(run):
    factor = chuteflow.Scales(1e-3, 2500.0).factor("surface_temperature", 0.3)
    grains = ["--diameter", "1 mm", "--density", "2500"]
    given = ["--search-temperature", f"{0.1 * factor!r}:{10.0 * factor!r} m2/s2", "--largest-holdup", "10 kg/m2"]
    code, out, _ = run(f"solve {PAPER} --flux 3 --quiet --json", grains, given)
    assert code == 0
    searched = json.loads(out)["searched"]
    assert searched["T_surface"] == pytest.approx([0.1 * factor, 10.0 * factor])
    assert searched["M_max"] == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("words", "place", "quantity"),
    [
        ("curve --points 8", ("branches", 0, "Q"), "mass_flux"),
        ("relax --flux 3 --duration 0.01", ("t",), "time"),
        ("relax --flux 3 --duration 0.01", ("T_base",), "base_temperature"),
        ("compare-closures --with lun --flux 3", ("closures", 0, "flows", 0, "U"), "mean_velocity"),
        ("hot", ("M",), "mass_holdup"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("stability --flux 3 --kx 0.01 --ky 0", ("flows", 0, "mode", "growth"), "growth"),
                ("stability --flux 3 --kx 0.01 --ky 0", ("flows", 0, "mode", "kx"), "wavenumber"),
                ("growth --flux 3 --kx 0:0.02 --ky 0:0.02 --size 4x4", ("kx",), "wavenumber"),
                (
                    "boundary --slope 0.29:0.3 --samples 2 --search-temperature 0.1:10",
                    ("boundaries", 0, "T_surface"),
                    None,
                ),
            )
        ),
    ],
)
def test_si_scales_what_every_command_prints(run, words, place, quantity):
    grains = "--diameter 0.002 --density 2500 --quiet"
    of = PAPER.replace("--slope 0.3 ", "") if words.startswith("boundary") else PAPER
    _, plain, _ = run(words, of, "--json")
    code, scaled, _ = run(words, of, "--json", grains)
    assert code == 0
    one, other = json.loads(plain), json.loads(scaled)
    if quantity is not None:
        assert other["units"] if "closures" not in other else other["closures"][0]["units"]
    for key in place:
        one, other = one[key], other[key]
    factor = chuteflow.Scales(0.002, 2500.0).factor(quantity or "surface_temperature", 0.3)
    if quantity is None:  # on the slope of each point
        one, other, factor = one[-1:], other[-1:], factor
        assert other == pytest.approx([one[0] * factor], rel=1e-2)
    elif isinstance(one, list):
        assert other == pytest.approx([factor * value for value in one], rel=1e-12)
    else:
        assert other == pytest.approx(factor * one, rel=1e-12)


# What is nearest


def test_the_nearest_with_a_flow_has_one(run):
    chute = chuteflow.Chute(0.2, 0.8, 0.8, 0.85)
    found = nearest(chute, Q=3.0)
    for name, value in found.parameters.items():
        values = {**chute.as_dict(), name: value}
        assert len(chuteflow.flows(chuteflow.Chute(**values), Q=3.0)) > 0, name
    _, out, _ = run("solve --slope 0.2 --e 0.8 --ew 0.8 --roughness 0.85 --flux 3 --json")
    near = json.loads(out)["nearest_with_flow"]
    assert near["slope"] == found.parameters["slope"]
    assert near["examined"]["slope"][0] < 0.2 < near["slope"] < near["examined"]["slope"][1]


def test_what_is_nearest_is_told_soon_where_flows_multiply_with_depth():
    began = time.process_time()
    found = nearest(chuteflow.Chute(0.373, 0.8, 0.8, 0.55), Q=100.0)
    # It took eighteen seconds where every value was searched to the largest hold-up that the answer had needed.
    assert time.process_time() - began < 3.0
    slope = found.parameters["slope"]
    assert slope is not None
    assert len(chuteflow.flows(chuteflow.Chute(slope, 0.8, 0.8, 0.55), Q=100.0)) > 0


def test_the_nearest_flux_has_a_flow():
    chute = case("sand").chute(slope=0.46)
    found = nearest(chute, Q=3.0)
    assert found.value is not None
    assert 20.0 < found.value < 25.0
    assert len(chuteflow.flows(chute, Q=found.value * 1.001)) > 0


# The table of commands

_CHUTE, _GRAINS, _PICTURE, _ANSWER = ("chute", "case"), ("si",), ("plot",), ("json", "save", "plot")
#: What does not make sense, by command, and why.
WITHOUT = {
    "sweep": ("the study file says the chutes; results go to its store", (*_CHUTE, *_GRAINS, *_ANSWER)),
    "predict": ("the chute is that of the fit; --diameter and --density give SI units", (*_CHUTE, *_GRAINS)),
    "design": ("each flow found is of another chute: one picture does not hold them", _PICTURE),
    "cases": ("a list of chutes, without flows", (*_CHUTE, *_GRAINS, "save", *_PICTURE)),
    "closures": ("laws, dimensionless, without a chute", (*_CHUTE, *_GRAINS)),
    "figures": ("the chutes are those of the paper; pictures are the answer", (*_CHUTE, *_GRAINS, *_ANSWER)),
    "claims": ("the chutes are those of the paper; a list of verdicts", (*_CHUTE, *_GRAINS, "save", *_PICTURE)),
    "report": ("the chutes are those of the paper; a page is the answer", (*_CHUTE, *_GRAINS, *_ANSWER)),
    "compare": ("the run says the chute; it is dimensionless", (*_CHUTE, *_GRAINS)),
    "explore": ("a page is the answer", _ANSWER),
    "dem run": ("grains are simulated without units; the run is the answer", (*_GRAINS, *_ANSWER)),
    "dem read": ("it turns the files of a run into one", (*_CHUTE, *_GRAINS, *_ANSWER, "quiet")),
    "dem study": ("the chutes are those of the study; its runs are the answer", (*_CHUTE, *_GRAINS, *_ANSWER)),
    "dem waves": ("the run says the chute", (*_CHUTE, *_GRAINS, "json", *_PICTURE, "quiet")),
    "dem results": ("the files say the chutes; a table is the answer", (*_CHUTE, *_GRAINS, "json", "save")),
}


def every_command():
    """All commands by name, those of groups too."""
    for name in COMMANDS:
        command = program.get_command(click.Context(program), name)
        assert command is not None
        parts = command.commands if isinstance(command, click.Group) else None
        yield from [(name, command)] if parts is None else [(f"{name} {part}", one) for part, one in parts.items()]


def test_every_command_accepts_what_makes_sense():
    found = dict(every_command())
    assert found.keys() >= WITHOUT.keys()
    for name, command in found.items():
        accepted = {option.removeprefix("--") for param in command.params for option in param.opts}
        _, without = WITHOUT.get(name, ("", ()))
        assert {"chute", "case", "si", "json", "save", "plot", "quiet"} - accepted == set(without), name


#: A question of each command that has a chute, an amount and grains.
ASKED = {
    "solve": ["--flux", "3"],
    "curve": [],
    "boundary": ["--of", "fold-Q"],
    "domain": ["--roughness", "0.5:0.6"],
    "hot": [],
    "sensitivities": ["--flux", "3"],
    "fit": ["data.csv", "--free", "e"],
    "design": ["--unknown", "e", "--flux", "3", "--holdup", "1"],
    "compare-closures": ["--flux", "3"],
    "explore": ["--no-browser"],
    "stability": ["--flux", "3"],
    "growth": ["--flux", "3"],
    "neutral": [],
    "relax": ["--flux", "3"],
}
_NO_SLOPE = ["--e", "0.8", "--ew", "0.8"]
_BASE = ["--roughness", "0.6"]


@pytest.mark.parametrize("name", ASKED)
@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (["--slope", "17"], "did you mean --angle 17? A slope is tan(theta)"),
        (["--angle", "0.3"], "did you mean --slope 0.3? An angle is in degrees"),
        (["--slope", "0.3", "--angle", "17"], "give one of them, not both"),
        (["--slope", "0.3", "--diameter", "1 s", "--density", "2500"], "'s' is not a unit like m"),
        (["--slope", "0.3", "--diameter", "1 mm"], "--density is missing"),
        (["--slope", "0.3", "--si"], "--diameter is missing"),
        (["--case", "sand", "--chute", "mine.toml"], "give one of them"),
        (["--case", "sandy"], "did you mean sand?"),
    ],
)
def test_mistakes_of_units_and_slopes_are_one_line(run, name, mistake, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data.csv").write_text("z,nu\n0,0.3\n1,0.2\n2,0.1\n")
    base = [] if name == "domain" else _BASE
    if name in ("boundary", "domain"):
        # A range in the place of the first slope or angle.
        ranged = [i + 1 for i, one in enumerate(mistake) if one in ("--slope", "--angle")][:1]
        mistake = [f"{one}:{float(one) + 0.1:g}" if i in ranged else one for i, one in enumerate(mistake)]
    code, out, err = run(name, ASKED[name], _NO_SLOPE, base, mistake)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert message in err


def test_a_range_of_angles_is_one_of_slopes(run):
    ask = "boundary --of fold-Q --in e,Q --e 0.7:0.8 --ew 0.8 --roughness 0.6"
    code, out, err = run(ask, ["--angle", "15:17"])
    assert (code, out) == (2, "")
    low, high = (math.tan(math.radians(angle)) for angle in (15, 17))
    assert f"--slope {low:g}:{high:g}: only --e takes a range" in err
    code, out, err = run(ask, ["--angle", "15:17", "--slope", "0.3"])
    assert (code, out) == (2, "")
    assert "--slope and --angle 15:17: give one of them, not both" in err


# Numbers of a flow


@pytest.mark.parametrize("surface", ["free", pytest.param("interface", marks=pytest.mark.slow)])
def test_the_numbers_that_follow_from_others(surface):
    for flow in chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6, surface=surface), Q=3.0):
        profile = flow.sampled(20_001)
        steps = profile.height[1] - profile.height[0]
        mass = steps * (profile.volume_fraction.sum() - 0.5 * (profile.volume_fraction[[0, -1]].sum()))
        assert flow.mean_velocity == pytest.approx(flow.mass_flux / flow.mass_holdup)
        assert flow.mean_volume_fraction == pytest.approx(mass / flow.depth, rel=1e-7)
        assert flow.froude_number == pytest.approx(flow.mean_velocity / math.sqrt(flow.depth))
        top = flow.depth * (5.0 if surface == "free" else 1.0)
        assert flow.surface_velocity == pytest.approx(float(flow.profile([top]).velocity[0]), rel=1e-9)


# Pictures, names and completion


def test_a_picture_is_written_in_several_formats(run, tmp_path):
    code, _, _ = run(f"solve {PAPER} --flux 3 --plot", [str(tmp_path / "a.b.png,pdf,svg")])
    assert code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.b.pdf", "a.b.png", "a.b.svg"]
    assert (tmp_path / "a.b.pdf").read_bytes().startswith(b"%PDF")


def test_slides_have_larger_text(run, tmp_path):
    from matplotlib.image import imread

    for name in ("print", "slides"):
        run(f"solve {PAPER} --flux 3 --theme {name} --plot", [str(tmp_path / f"{name}.png")])
    small, large = (imread(tmp_path / f"{name}.png").shape for name in ("print", "slides"))
    assert large[0] > 1.2 * small[0]
    axes = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), Q=3.0).plot(theme="slides")
    assert axes[0].xaxis.label.get_fontsize() > 1.4 * 9.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--theme slides", "there is no picture, give --plot too"),
        ("--theme neon --plot a.png", "unknown theme 'neon': choose one of print, slides"),
        ("--plot a.png,gif", "the name must end in .png, .pdf or .svg"),
    ],
)
def test_a_picture_that_cannot_be_is_one_line(run, words, said):
    code, out, err = run(f"solve {PAPER} --flux 3", words)
    assert (code, out) == (2, "")
    assert said in err


def test_long_names_are_those_of_python(run):
    _, short, _ = run(f"solve {PAPER} --flux 3 --json")
    _, long, _ = run("solve --slope 0.3 --restitution 0.8 --wall-restitution 0.8 --roughness 0.6 --mass-flux 3 --json")
    assert long == short
    flow = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)[0]
    assert (flow.Q, flow.h, flow.chute.e) == (flow.mass_flux, flow.centre_of_mass, 0.8)
    with pytest.raises(AttributeError, match="no attribute 'colour'"):
        _ = flow.colour


def test_a_shell_completes_cases(capsys, monkeypatch):
    monkeypatch.setenv("_CHUTEFLOW_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", "chuteflow solve --case s")
    monkeypatch.setenv("COMP_CWORD", "3")
    main([])
    assert capsys.readouterr().out.split() == ["plain,steel", "plain,sand"]
