"""The explorer's server: its answers, what it refuses, and that it stays up."""

import csv
import io
import json
import math
import random
import re
import shlex
import socket
import time
import urllib.error
import urllib.parse
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from starlette.testclient import TestClient

import chuteflow
from chuteflow.cli.program import main
from chuteflow.errors import InputError
from chuteflow.explorer import answers, contents, domains, growth, queries, sentences
from chuteflow.explorer.server import PAGE, application, bind_socket, host_of
from chuteflow.stability.modes import Disturbances
from chuteflow.steady.chute import SURFACES
from chuteflow.theory.laws import LAWS

PAPER = {"slope": "0.3", "e": "0.8", "ew": "0.8", "roughness": "0.6"}


@pytest.fixture(scope="module")
def client():
    with TestClient(application(), base_url="http://127.0.0.1:8765") as client:
        yield client


def test_the_flows_are_those_of_the_library(client):
    given = client.get("/ask/flows", params=PAPER | {"Q": "3"}).json()
    flows = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)
    assert [flow["T_surface"] for flow in given["flows"]] == pytest.approx(
        [flow.surface_temperature for flow in flows], rel=1e-6
    )
    assert given["says"] == (
        "Three flows share the flux Q = 3: one hot, dilute, deep; one warm, moderately dense; "
        "one cold, dense, shallow, densest above its base."
    )
    assert given["flows"][0]["name"] == "hot, dilute, deep"
    assert given["flows"][2]["kinds"] == "density inverted, interior dissipative"


def test_the_profiles_are_those_of_the_flow(client):
    entry = client.get("/ask/flows", params=PAPER | {"Q": "3"}).json()["flows"][1]
    flow = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)[1]
    profile = flow.profile(entry["profile"]["z"])
    assert entry["profile"]["nu"] == pytest.approx(profile.volume_fraction.tolist(), abs=1e-6)
    assert entry["profile"]["u"] == pytest.approx(profile.velocity.tolist(), rel=1e-5)


@pytest.mark.parametrize("surface", SURFACES)
def test_straight_lines_between_the_points_of_a_profile_show_no_corner_that_is_not_there(surface):
    flows = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6, surface=surface), Q=3.0)
    top = 2.5 * max(flow.centre_of_mass for flow in flows)
    for flow in flows:
        profile = answers._profile(flow, top)
        z = np.array(profile["z"])
        assert (np.diff(z) > 0.0).all()
        assert len(z) < 300
        between = np.linspace(0.0, min(z[-1], flow.interface_height), 2001)
        exact = flow.profile(between)
        for symbol, name in answers.FIELDS.items():
            field = getattr(exact, name)
            off = np.abs(np.interp(between, z, profile[symbol]) - field).max()
            assert off < 1e-3 * np.abs(field).max(), (symbol, off)


def test_work_conduction_and_dissipation_balance_at_each_height(client):
    entry = client.get("/ask/flows", params=PAPER | {"Q": "3"}).json()["flows"][1]
    profile, budget = entry["profile"], entry["budget"]
    z, work, loss = (np.array(profile[name]) for name in ("z", "production", "dissipation"))
    assert integral(work, z) == pytest.approx(budget["shear_work"], rel=2e-3)
    assert integral(loss, z) == pytest.approx(budget["dissipation"], rel=2e-3)
    # Conduction, the rest of the balance, is what the base gives.
    assert integral(loss - work, z) == pytest.approx(budget["heat_from_base"], rel=1e-2)
    flow = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)[1]
    flux = flow.profile(z[:2]).heat_flux
    assert (loss - work)[:2].mean() == pytest.approx((flux[0] - flux[1]) / (z[1] - z[0]), rel=1e-3)


def integral(values, z):
    return float((np.diff(z) * (values[1:] + values[:-1]) / 2).sum())


def test_the_curve_says_how_many_flows_share_a_flux(client):
    given = client.get("/ask/curve", params=PAPER).json()
    assert "3 for Q from 2.7684 to 5.0133" in given["says"]
    (branch,) = given["branches"]
    assert len(branch["density"]) == len(branch["Q"]) == len(branch["h"])
    folds = [point["Q"] for point in branch["special"] if point["kind"] == "fold-Q"]
    assert folds == pytest.approx([2.76842953, 5.01334052], rel=1e-6)


def test_no_flow_is_an_answer_with_its_reason(client):
    given = client.get("/ask/flows", params=PAPER | {"slope": "0.1", "Q": "3"})
    assert given.status_code == 200
    assert given.json()["flows"] == []
    assert given.json()["says"].startswith("No flow carries Q = 3: ")


@pytest.mark.parametrize(
    "more",
    [{}, {"surface": "interface", "Q": "2.75", "diameter": "0.0007", "density": "2650"}],
    ids=["dimensionless", "SI beneath an interface"],
)
def test_the_recipes_and_the_downloads_give_the_same_tables(client, more, tmp_path, monkeypatch):
    query = PAPER | {"Q": "3"} | more
    tables = {
        f"chuteflow-{what}.csv": client.get("/ask/export", params=query | {"what": what, "format": "csv"}).content
        for what in ("profiles", "curve")
    }
    recipes = client.get("/ask/flows", params=query).json()["recipes"]
    monkeypatch.chdir(tmp_path)
    exec(recipes["python"], {})
    assert {name: (tmp_path / name).read_bytes() for name in tables} == tables
    for name in tables:
        (tmp_path / name).unlink()
    for line in recipes["command"].splitlines():
        program, *arguments = shlex.split(line)
        assert program == "chuteflow"
        assert main(arguments) == 0
    assert {name: (tmp_path / name).read_bytes() for name in tables} == tables


def test_sentences_are_in_the_units_of_the_grains(client):
    grains = {"diameter": "0.001", "density": "2500"}
    given = client.get("/ask/flows", params=PAPER | {"Q": "3"} | grains).json()
    flux = 3.0 * chuteflow.Scales(0.001, 2500.0).factor("mass_flux", 0.3)
    assert f"Q = {flux:.5g} kg/m/s" in given["says"]
    assert given["flows"][0]["Q"] == pytest.approx(3.0)
    assert "kg/m/s" in client.get("/ask/curve", params=PAPER | grains).json()["says"]


def test_a_column_of_the_map_tells_what_the_curve_tells(client):
    query = {"e": "0.8", "ew": "0.8", "x": "slope", "y": "roughness", "place": str((0.3 - 0.05) / 0.65)}
    column = client.get("/ask/map", params=query).json()
    assert (column["outer"], column["inner"], column["at"]) == ("slope", "roughness", pytest.approx(0.3))
    most = column["parts"]["most"]
    assert len(most["values"]) == len(most["stops"]) + 1
    for roughness, count in ((0.6, 3), (0.82, 2)):
        says = client.get("/ask/curve", params=PAPER | {"roughness": str(roughness)}).json()["says"]
        assert (
            most["values"][sum(stop < roughness for stop in most["stops"])]
            == count
            == max(map(int, re.findall(r"(\d+) for Q", says)))
        )
    (edge,) = column["parts"]["hot"]["stops"]
    # Hot flows end where lambda = 3 or where the base gives nothing, in closed form.
    sides = [chuteflow.hot(chuteflow.Chute(0.3, 0.8, 0.8, edge + off)).exists for off in (-0.004, 0.004)]
    assert sides == [True, False]


def test_a_map_whose_columns_run_along_x(client):
    query = {"e": "0.8", "ew": "0.8", "x": "roughness", "y": "slope", "place": "0.4"}
    column = client.get("/ask/map", params=query).json()
    assert (column["outer"], column["inner"]) == ("slope", "roughness")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"x": "Q"}, "x = 'Q': choose one of slope, e, ew, roughness"),
        ({"y": "slope"}, "both slope"),
        ({"place": "2"}, "place = 2: must be from 0 to 1"),
        ({"e": "7"}, "restitution e = 7"),
    ],
)
def test_a_bad_map_is_refused(client, change, said):
    query = {"e": "0.8", "ew": "0.8", "x": "slope", "y": "roughness", "place": "0.4"} | change
    given = client.get("/ask/map", params=query)
    assert given.status_code == 400
    assert said in given.json()["error"]


def test_a_column_is_looked_at_closely_near_the_stops_of_those_beside_it(monkeypatch):
    # A band between two of the points that are looked at anyway.
    band = 0.3, 0.32

    def summary(plane, outer, inner):
        return (0, int(band[0] < inner < band[1]), 0, 0, 0)

    monkeypatch.setattr(domains, "summarise", summary)
    query = {"e": "0.8", "ew": "0.8", "x": "slope", "y": "roughness", "place": "0.4"}
    low, high = queries.CONTROLS["roughness"].low, queries.CONTROLS["roughness"].high
    near = ",".join(f"{low + fraction * (high - low):.4g}" for fraction in band)
    known = [domains.map_column(queries.map_column(query | more)).parts["most"] for more in ({}, {"near": near})]
    assert [part.values for part in known] == [(0,), (0, 1, 0)]
    assert known[1].stops == pytest.approx(
        [low + fraction * (high - low) for fraction in band], abs=0.01 * (high - low)
    )


@pytest.mark.parametrize(
    ("near", "said"),
    [(40 * "0.6,", "near has 40 values: give at most 32"), ("x", "near = 'x': must be a number from -1 to 2")],
)
def test_what_a_column_is_near_is_checked(client, near, said):
    query = {"e": "0.8", "ew": "0.8", "x": "slope", "y": "roughness", "place": "0.4", "near": near}
    given = client.get("/ask/map", params=query)
    assert (given.status_code, given.json()["error"]) == (400, said)


def test_what_is_left_out_comes_with_how_to_compute_it_elsewhere():
    given = answers.leave_out("flows", PAPER | {"Q": "3"}, "no time")
    content = json.loads(given.body)
    assert (given.status, content["error"]) == (422, "the flows at this flux are left out: no time")
    assert content["recipes"]["command"].startswith("chuteflow solve --slope 0.3 ")
    assert content["flows"] == []


def test_a_computation_that_fails_is_an_answer_too(monkeypatch):
    def fails(query):
        return np.linalg.inv(np.zeros((2, 2)))

    monkeypatch.setitem(answers.QUESTIONS, "curve", fails)
    given = answers.answer("curve", PAPER)
    assert given.status == 422
    assert json.loads(given.body)["error"] == (
        "the curve of all flows is left out: the computation failed (LinAlgError: Singular matrix)"
    )


def test_an_unstable_flow_and_its_fastest_wave(client):
    given = client.get("/ask/stability", params=PAPER | {"Q": "3", "flow": "1"}).json()
    assert given["state"] == "unstable"
    assert given["says"] == "unstable: waves across the slope, growth 0.001, wavelength 500 d"
    assert given["waves"] == "waves of 2.5 d to 25000 d searched"
    fastest = given["fastest"]
    flow = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)[1]
    (mode,) = Disturbances(flow).modes(0.0, 2.0 * math.pi / fastest["length"])
    assert mode.growth == pytest.approx(fastest["growth"], abs=1e-6)


@pytest.mark.parametrize(
    ("direction", "kx", "ky", "grows", "said"),
    [
        ("oblique", 0.1, 0.1, True, "unstable: oblique waves, growth 0.02, wavelength 44 d"),
        ("uniform", 0.0, 0.0, True, "unstable: as a whole, growth 0.02"),
        ("along", 0.1, 0.0, False, "stable: no wave grows"),
    ],
)
def test_the_words_on_stability(monkeypatch, direction, kx, ky, grows, said):
    mode = SimpleNamespace(kx=kx, ky=ky, direction=direction, growth=0.02, error=1e-9)
    found = SimpleNamespace(stable=not grows, mode=mode, searched=(1e-3, 10.0))
    monkeypatch.setattr(growth, "stability_of", lambda flow: found)
    chute = chuteflow.Chute(0.3, 0.8, 0.8, 0.6)
    known = growth.examine_stability(chuteflow.flows(chute, Q=3.0)[0])
    assert sentences.of_stability(known, chute, None) == said
    assert sentences.of_waves(known, chute, None) == "waves of 0.63 d to 6300 d searched"


def test_stability_that_cannot_be_posed_is_not_known(client):
    query = PAPER | {"Q": "3", "flow": "0", "surface": "interface"}
    given = client.get("/ask/stability", params=query).json()
    assert given["state"] == "unknown"
    assert given["says"].startswith("not known whether it is stable: ")
    assert client.get("/ask/stability", params=query | {"flow": "7"}).status_code == 400


@pytest.mark.parametrize("what", ["profiles", "curve"])
def test_exports(client, what):
    query = PAPER | {"Q": "3", "what": what}
    table = client.get("/ask/export", params=query | {"format": "csv"})
    assert table.headers["content-disposition"] == f'attachment; filename="chuteflow-{what}.csv"'
    rows = list(csv.reader(line for line in io.StringIO(table.text) if not line.startswith("#")))
    assert len(rows) > 100
    assert client.get("/ask/export", params=query | {"format": "svg"}).text.startswith("<?xml")
    assert client.get("/ask/export", params=query | {"format": "png"}).content.startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ({}, "missing slope"),
        (PAPER, "missing Q"),
        (PAPER | {"Q": "much"}, "Q = 'much': must be a number"),
        (PAPER | {"Q": "3", "slope": "steep"}, "slope = 'steep': must be a number"),
        (PAPER | {"Q": "3", "ew": "nan"}, "ew = nan: must be a finite number"),
        (PAPER | {"Q": "3", "e": ""}, "e = '': must be a number"),
        (PAPER | {"Q": "nan"}, "must be from"),
        (PAPER | {"Q": "1e300"}, "must be from"),
        (PAPER | {"Q": "3", "e": "1.2"}, "restitution e = 1.2"),
        (PAPER | {"Q": "3", "surface": "wet"}, "unknown surface 'wet'"),
        (PAPER | {"Q": "3", "points": "9999999"}, "unknown parameter 'points'"),
        (PAPER | {"Q": "3", "diameter": "0.001"}, "SI units need diameter and density"),
        (PAPER | {"Q": "3", "diameter": "0.001", "density": "-1"}, "density = -1: must be from"),
    ],
)
def test_a_bad_query_gets_one_clear_line(client, query, said):
    given = client.get("/ask/flows", params=query)
    assert given.status_code == 400
    assert said in given.json()["error"]
    assert "\n" not in given.json()["error"]


def test_a_status_is_told_in_the_answer_where_that_is_wanted(client):
    given = client.get("/ask/flows", params=PAPER | {"Q": "0"}, headers={"x-status": "in-answer"})
    assert (given.status_code, given.json()) == (
        200,
        {"error": "Q = 0: must be from 0.001 to 100000", "status": 400},
    )


def test_a_parameter_given_twice_is_refused(client):
    given = client.get("/ask/flows?slope=0.3&slope=0.4")
    assert (given.status_code, given.json()) == (400, {"error": "'slope' is given several times: give it once"})


def test_what_is_not_served_is_refused_in_json(client):
    assert client.get("/ask/everything").status_code == 404
    assert "error" in client.get("/page/../server.py").json()
    assert client.get("/page/%2e%2e/server.py").status_code == 404
    assert client.post("/ask/flows").status_code == 405
    assert client.get("/ask/flows?x=" + 2000 * "9").status_code == 414


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example:8765", "", "localhost.:80"])
def test_another_host_is_refused(client, host):
    given = client.get("/", headers={"host": host})
    assert given.status_code == 400
    assert "is not served" in given.json()["error"]


def test_pages_of_other_servers_are_refused(client):
    headers = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "cors"}
    assert client.get("/ask/flows", params=PAPER | {"Q": "3"}, headers=headers).status_code == 403
    assert client.get("/", headers=headers | {"sec-fetch-mode": "navigate"}).status_code == 200


def test_hosts_are_read_without_their_port():
    assert [host_of(h) for h in ("LOCALHOST:80", "[::1]:8765", "127.0.0.1")] == ["localhost", "::1", "127.0.0.1"]


def test_any_host_where_that_was_asked_for():
    with TestClient(application(None), base_url="http://lab.example") as client:
        assert client.get("/about").status_code == 200


def test_the_page_asks_no_other_machine_for_anything(client):
    policy = client.get("/").headers["content-security-policy"]
    assert policy.startswith("default-src 'self'")
    for file in PAGE.iterdir():
        links = re.findall(r"https?://[^\s\"'`)]+", file.read_text(encoding="utf-8"))
        assert all(link == "http://www.w3.org/2000/svg" for link in links), file.name


def test_the_page_is_small():
    assert sum(file.stat().st_size for file in PAGE.iterdir()) < 300_000


def test_every_preset_is_a_case_that_works(client):
    for preset in queries.PRESETS:
        given = client.get("/ask/flows", params=dict(preset.state))
        assert given.status_code == 200, preset.title


def test_every_control_is_explained(client):
    about = client.get("/about").json()
    assert list(about["controls"]) == ["slope", "e", "ew", "roughness", "Q"]
    assert all(control["low"] < control["high"] for control in about["controls"].values())
    assert {name: list(choice["options"]) for name, choice in about["choices"].items()} == {
        "surface": list(SURFACES),
        "closure": list(LAWS),
    }
    for control in (*about["controls"].values(), *about["choices"].values()):
        assert control["meaning"].endswith(".")


def test_a_port_in_use_is_said():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        number = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"cannot listen at 127.0.0.1 port {number}: .*--port 0"):
            bind_socket("127.0.0.1", number)
    with pytest.raises(InputError, match="not an address of this machine"):
        bind_socket("no such host", None)


@pytest.mark.slow
def test_fifty_clients_and_random_requests_leave_the_server_up(served):
    with served() as page, ThreadPoolExecutor(50) as pool:
        rng = random.Random(5)
        statuses = list(pool.map(lambda path: fetched(page, path), [random_path(rng) for _ in range(300)]))
        assert set(statuses) <= {200, 400, 404, 414, 422}
        assert statuses.count(200) > 20
        assert fetched(page, "ask/flows?" + urllib.parse.urlencode(PAPER | {"Q": "3"})) == 200


def test_it_starts_within_a_second_and_ends_at_ctrl_c(served):
    began = time.monotonic()
    with served() as page:
        assert fetched(page, "") == 200
        # Four times the target: other tests run beside this one.
        assert time.monotonic() - began < 4.0


def random_path(rng):
    names = ["slope", "e", "ew", "roughness", "Q", "surface", "closure", "what", "format", "%00", "x"]
    values = ["0.3", "0.8", "3", "-1", "1e999", "nan", "", "free", "lun", "%ff", "'", "0.31", 1500 * "1"]
    asked = ["ask/flows", "ask/flows", "ask/curve", "ask/map", "ask/stability", "ask/nothing"]
    question = rng.choice([*asked, "about", "page/main.js", "..", ""])
    sound = PAPER | {"slope": f"{rng.uniform(0.28, 0.33):.4f}"} | ({"Q": "3"} if question == "ask/flows" else {})
    if rng.random() < 0.4:
        return f"{question}?{urllib.parse.urlencode(sound)}"
    return f"{question}?" + "&".join(f"{rng.choice(names)}={rng.choice(values)}" for _ in range(rng.randrange(6)))


def fetched(page, path):
    try:
        response = urllib.request.urlopen(page + path, timeout=60)
    except urllib.error.HTTPError as refused:
        response = refused
    with response:
        content = response.read()
    assert response.status == 200 or "error" in json.loads(content)
    return response.status


def test_stability_is_of_the_flow_of_the_curve_that_was_asked_for(monkeypatch):
    examined = []
    monkeypatch.setattr(
        growth, "examine_stability", lambda flow: examined.append(flow) or growth.FlowStability("stable", (2.0, 50.0))
    )
    query = {"slope": "0.3", "e": "0.8", "ew": "0.8", "roughness": "0.6"}
    branch = json.loads(answers.answer("curve", query).body)["branches"][0]
    given = json.loads(answers.answer("stability", query | {"branch": "0", "point": "40"}).body)
    assert given["says"] == "stable: no wave grows"
    assert examined[0].mass_flux == pytest.approx(branch["Q"][40], rel=1e-6)
    assert examined[0].centre_of_mass == pytest.approx(branch["h"][40], rel=1e-6)
    refused = answers.answer("stability", query | {"branch": "0", "point": "60"})
    assert refused.status == 400
    assert b"there are 60, counted from 0" in refused.body


def test_a_coarse_column_is_like_the_fine_one_but_rougher():
    query = {"e": "0.8", "ew": "0.8", "x": "slope", "y": "roughness", "place": str((0.3 - 0.05) / 0.65)}
    fine, coarse = (json.loads(answers.answer("map", query | more).body) for more in ({}, {"coarse": "1"}))
    assert coarse["tolerance"] > 3 * fine["tolerance"]
    assert coarse["parts"]["most"]["values"][0] == fine["parts"]["most"]["values"][0]
    assert answers.answer("map", query | {"coarse": "yes"}).status == 400


@pytest.mark.parametrize(
    "chute",
    [
        chuteflow.Chute(0.3, 0.8, 0.8, 0.6),
        chuteflow.Chute(0.28, 0.8, 0.8, 0.6),
        chuteflow.Chute(0.31, 0.8, 0.8, 0.6, surface="interface"),
    ],
)
def test_kinds_of_density_between_onsets_are_those_of_the_flows(chute):
    for branch in chuteflow.curve(chute, points=40, tolerance=1e-6).branches:
        assert contents.densities(branch) == [flow.density for flow in branch.flows]


def test_limits_passed_along_the_curve(client):
    curve = client.get("/ask/curve", params=PAPER).json()
    words = client.get("/ask/limits", params=PAPER).json()["words"]
    assert [len(one) for one in words] == [len(branch["Q"]) for branch in curve["branches"]]
    flows = client.get("/ask/flows", params=PAPER | {"Q": "3"}).json()["flows"]
    (branch,) = curve["branches"]
    for flow in flows:
        nearest = int(np.abs(np.log(np.array(branch["h"]) / flow["h"])).argmin())
        assert words[0][nearest] == flow["validity"]["words"]
