"""The page that needs no server: what is kept in it, how exact that is, and that it asks nobody for anything."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

import chuteflow
from chuteflow.cli.program import main
from chuteflow.explorer import sampled, standalone
from chuteflow.explorer.standalone import PAGE, bundle
from chuteflow.parameters import LARGEST_HOLDUP, SURFACE_TEMPERATURE

PAPER = "--slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6"
CHUTE = chuteflow.Chute(0.3, 0.8, 0.8, 0.6)
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def found():
    return sampled.sample_curve(CHUTE, 60, SURFACE_TEMPERATURE, LARGEST_HOLDUP)


@pytest.mark.slow
def test_what_is_told_of_the_error_is_the_error(found):
    (one,) = found.branches
    finer = chuteflow.curve(CHUTE, points=178, tolerance=1e-8).branches[0].flows
    # Three times as many intervals: the flows between those kept are at thirds, where the deviation was not looked at.
    thirds = np.arange(1, 177, 3)
    told = np.exp(sampled.interpolate(one.place, thirds / 3))
    solved = np.array([[getattr(finer[i], name) for name in sampled.PLACE] for i in thirds])
    off = np.abs(told[:, :4] / solved - 1.0).max()
    assert 0.1 * found.deviation.place < off < 1.5 * found.deviation.place
    assert found.deviation.place < 0.01
    assert found.deviation.flows > 50
    assert set(found.deviation.fields) == {"nu", "T", "u", "production", "dissipation"}
    assert max(found.deviation.fields.values()) < 0.1


@pytest.mark.slow
def test_the_error_grows_where_flows_are_kept_wrong(found):
    (one,) = found.branches
    fields = one.fields.copy()
    fields[20, 0] *= 1.2
    between = chuteflow.curve(CHUTE, points=119, tolerance=1e-8).branches[0]
    assert sampled._deviation(replace(one, fields=fields), between).fields["nu"] > 0.05


def test_the_curve_is_solved_once(monkeypatch):
    asked, solve = [], sampled.curve
    monkeypatch.setattr(sampled, "curve", lambda *args, **named: asked.append(named["points"]) or solve(*args, **named))
    found = sampled.sample_curve(CHUTE, 30, (0.1, 10.0), LARGEST_HOLDUP)
    assert asked == [59]
    (branch,) = found.curve.branches
    assert len(branch.flows) == 30
    for point in branch.special:
        first, last = (np.log(branch.mass_holdup[point.position + i]) for i in (0, 1))
        assert min(first, last) <= np.log(point.flow.mass_holdup) <= max(first, last)


def test_a_cubic_is_told_exactly_between_its_rows():
    table = np.arange(8.0)[:, None] ** 3
    at = np.array([0.0, 0.3, 1.5, 4.0, 6.7, 7.0])
    assert sampled.interpolate(table, at)[:, 0] == pytest.approx(at**3)


def test_the_script_has_all_modules_and_no_import(monkeypatch):
    script = bundle("main")
    assert not re.search(r"^(import|export) ", script, re.MULTILINE)
    modules = [path.stem for path in PAGE.glob("*.js")]
    assert [script.count(f"const module_{name} = ") for name in modules] == [1] * len(modules)
    # What a module takes has been made before it.
    for name in modules:
        for other in re.findall(r'from "\./(\w+)\.js"', (PAGE / f"{name}.js").read_text()):
            assert script.index(f"const module_{other} = ") < script.index(f"const module_{name} = ")


def test_one_file_that_loads_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(standalone, "_POINTS", (40,))
    path = tmp_path / "page.html"
    assert main(["explore", *PAPER.split(), "--flux", "4", "--export", str(path)]) == 0
    assert "page.html: one page of this chute" in capsys.readouterr().out
    page = path.read_text()
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)
    assert "default-src 'none'" in page
    data = re.search(r'<script type="application/json" id="standalone-data">(.*?)</script>', page)
    assert data is not None
    kept = json.loads(data[1])
    assert kept["about"]["presets"][0]["state"] == {
        "slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6, "surface": "free", "closure": "lun", "Q": 4.0,
        "stability": "",
    }  # fmt: skip
    assert "searched: T_surface from 0.001 to 1e+05, M up to 30" in " ".join(kept["says"])
    assert list(kept["about"]["controls"]) == ["Q"]
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.slow
def test_the_range_is_narrowed_and_said(tmp_path, monkeypatch):
    monkeypatch.setattr(standalone, "_POINTS", (40,))
    path = tmp_path / "page.html"
    grains = "--diameter 1mm --density 2500"
    assert main(["explore", *PAPER.split(), *grains.split(), "--search-temperature", "1:5", "--export", str(path)]) == 0
    assert "M up to 75 kg/m^2" in path.read_text()
    assert "T_surface from 0.009396 to 0.04698 m^2/s^2" in path.read_text()


@pytest.mark.slow
def test_a_page_that_grows_too_large_has_fewer_flows(monkeypatch):
    asked = []
    original = standalone.sample_curve
    monkeypatch.setattr(standalone, "_POINTS", (60, 30))
    monkeypatch.setattr(
        standalone, "sample_curve", lambda chute, points, *a: asked.append(points) or original(chute, points, *a)
    )
    whole = len(standalone.standalone(CHUTE, 3.0))
    monkeypatch.setattr(standalone, "_LARGEST", whole - 1)
    assert len(standalone.standalone(CHUTE, 3.0)) < whole
    assert asked == [60, 60, 30]
    monkeypatch.setattr(standalone, "_LARGEST", 1000)
    with pytest.raises(chuteflow.SolveError, match="narrow the range"):
        standalone.standalone(CHUTE, 3.0)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (f"{PAPER} --export page.txt", "'page.txt': the name must end in .html"),
        (f"{PAPER} --export no/page.html", "there is no directory"),
        ("--slope 0.3 --export page.html", "missing --e "),
        (f"{PAPER} --export page.html --port 3", "leave --port away"),
        (f"{PAPER} --export page.html --flux x", "--flux"),
        (f"{PAPER} --export page.html --flux 1e9", "--flux = 1e+09"),
        (f"{PAPER} --export page.html --gravity 3 --si --diameter 1mm --density 2500", "gravity = 3"),
        ("--search-temperature 1:3", "give --export too"),
        ("--base johnson-jackson:specularity=0.5", "--export takes any"),
        ("--slope 16", "did you mean --angle 16?"),
        ("--e 1.5", "e = 1.5"),
        ("--flux 3", "--flux needs the chute"),
        ("--case nothing", "unknown case"),
    ],
)
def test_what_cannot_be_is_told_on_one_line(line, said, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    refused(["explore", "--no-browser", *line.split()], said)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("line", "query"),
    [
        ("", ""),
        ("--case paper-productive", "?slope=0.4&e=0.9&ew=0.6&roughness=0.8"),
        ("--slope 0.31 --surface interface", "?slope=0.31&surface=interface"),
        (
            "--case glass-beads --si --slope 0.3 --flux 2",
            "?slope=0.3&e=0.97&ew=0.83&roughness=0.65&Q=2.0&si=1&d=3.0&rho=2500.0",
        ),
    ],
)
def test_the_page_opens_with_what_is_given(line, query, monkeypatch, capsys):
    from chuteflow.explorer import connections

    monkeypatch.setattr(connections.Server, "run", lambda _, sockets: [one.close() for one in sockets])
    monkeypatch.setattr("signal.signal", lambda *_: None)
    assert main(["explore", "--no-browser", "--port", "0", *line.split()]) == 0
    address = re.search(r"http://127.0.0.1:\d+/(\S*)", capsys.readouterr().out)
    assert address is not None
    assert address[1] == query


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no chromium here: the tests in a browser are left out")
@pytest.mark.parametrize("surface", ["free", "interface"])
def test_the_page_shows_the_flows_of_the_library(surface, tmp_path):
    from playwright.sync_api import expect, sync_playwright

    path = tmp_path / "page.html"
    assert main(["explore", *PAPER.split(), "--surface", surface, "--export", str(path)]) == 0
    assert path.stat().st_size < 2_000_000
    kept = json.loads(re.search(r'id="standalone-data">(.*?)</script>', path.read_text())[1])  # pyright: ignore[reportOptionalSubscript]
    worst = kept["error"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_context(offline=True, reduced_motion="reduce").new_page()
        troubles, asked = [], []
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("console", lambda message: troubles.append(message.text))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(path.as_uri())
        expect(page.locator("#says")).to_contain_text("share the flux Q = 3")
        for flux in (0.5, 2.9, 3.7, 4.9, 7.0):
            page.locator("#Q").fill(str(flux))
            page.locator("#Q").press("Enter")
            solved = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6, surface=surface), Q=flux)
            rows = page.locator("#flows label")
            expect(rows).to_have_count(len(solved))
            for row, flow in zip(rows.all(), solved, strict=True):
                h, holdup = (float(n) for n in re.findall(r"(?:h|M) ([\d.]+)", row.inner_text())[-2:])
                assert h == pytest.approx(flow.centre_of_mass, rel=2e-3)
                assert holdup == pytest.approx(flow.mass_holdup, rel=2e-3)
            page.locator("#profile-nu").focus()
            page.locator("#profile-nu").press("Home")
            for _ in range(3):
                page.locator("#profile-nu").press("ArrowUp")
                height, *values = map(
                    float, re.findall(r"-?[\d.]+(?:e-?\d+)?", page.locator("#spoken").text_content() or "")
                )
                shown = [
                    flow for flow in solved if height < 2.5 * flow.centre_of_mass and height < flow.interface_height
                ]
                for value, flow in zip(values, shown, strict=False):
                    largest = flow.largest_volume_fraction
                    exact = float(flow.profile([height]).volume_fraction[0])
                    assert abs(value - exact) < (worst + 0.01) * largest
        assert troubles == []
        assert {url.split(":")[0] for url in asked} == {"file"}
        page.wait_for_url("**Q=7")
        page.locator("#Q-slider").press("Home")
        page.wait_for_url(lambda url: "Q=7" not in url)
        page.locator("#undo").click()
        expect(page.locator("#Q")).to_have_value("7")
        browser.close()


@pytest.mark.slow
def test_a_page_of_a_chute_without_flows_says_why(tmp_path):
    path = tmp_path / "page.html"
    assert main(["explore", *PAPER.replace("0.3", "0.1").split(), "--export", str(path)]) == 0
    assert '"branches":[]' in path.read_text()
