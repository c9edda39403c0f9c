"""The explorer's server: its answers, what it refuses, and that it stays up."""

import csv
import io
import json
import random
import re
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
from concurrent.futures import ThreadPoolExecutor

import pytest
from starlette.testclient import TestClient

import chuteflow
from chuteflow.errors import InputError
from chuteflow.faces.explorer import lanes, queries
from chuteflow.faces.explorer.server import PAGE, application, bound, host_of

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
    assert given["says"] == "Three flows share the flux Q = 3."
    assert given["flows"][0]["words"].startswith("hot, dilute, deep: ")


def test_the_profiles_are_those_of_the_flow(client):
    entry = client.get("/ask/flows", params=PAPER | {"Q": "3"}).json()["flows"][1]
    flow = chuteflow.flows(chuteflow.Chute(0.3, 0.8, 0.8, 0.6), Q=3.0)[1]
    profile = flow.profile(entry["profile"]["z"])
    assert entry["profile"]["nu"] == pytest.approx(profile.volume_fraction.tolist(), abs=1e-6)
    assert entry["profile"]["u"] == pytest.approx(profile.velocity.tolist(), rel=1e-5)


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


def test_the_recipes_give_the_same_flows(client):
    recipes = client.get("/ask/flows", params=PAPER | {"Q": "3.25"}).json()["recipes"]
    namespace = {}
    exec(recipes["python"], namespace)
    run = subprocess.run(
        [sys.executable, "-m", *recipes["command"].split(), "--json"], capture_output=True, text=True, check=True
    )
    from_command = [flow["Q"] for flow in json.loads(run.stdout)["flows"]]
    assert from_command == [flow.mass_flux for flow in namespace["flows"]]
    assert from_command == pytest.approx([3.25] * 3)


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
        (PAPER | {"Q": "much"}, "'much': must be a number"),
        (PAPER | {"Q": "nan"}, "must be from"),
        (PAPER | {"Q": "1e300"}, "must be from"),
        (PAPER | {"Q": "3", "e": "1.2"}, "restitution e = 1.2"),
        (PAPER | {"Q": "3", "surface": "wet"}, "unknown surface 'wet'"),
        (PAPER | {"Q": "3", "points": "9999999"}, "unknown parameter 'points'"),
    ],
)
def test_a_bad_query_gets_one_clear_line(client, query, said):
    given = client.get("/ask/flows", params=query)
    assert given.status_code == 400
    assert said in given.json()["error"]
    assert "\n" not in given.json()["error"]


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
    controls = client.get("/about").json()["controls"]
    assert list(controls) == ["slope", "e", "ew", "roughness", "Q"]
    assert all(control["meaning"].endswith(".") and control["low"] < control["high"] for control in controls.values())


def test_a_question_that_takes_too_long_is_ended_and_the_next_answered(monkeypatch):
    lane = lanes.Lane(limit=0.001)
    try:
        late = lane._put("curve", PAPER)
        assert late.status == 504
        assert "no answer within" in json.loads(late.body)["error"]
        lane._limit = 60.0
        assert lane._put("flows", PAPER | {"Q": "3"}).status == 200
    finally:
        lane.close()


def test_a_process_that_dies_is_replaced():
    lane = lanes.Lane(limit=60.0)
    try:
        assert lane._put("flows", PAPER | {"Q": "3"}).status == 200
        assert lane._process is not None
        lane._process.kill()
        lane._process.join()
        assert lane._put("flows", PAPER | {"Q": "3"}).status == 200
    finally:
        lane.close()


def test_a_port_in_use_is_said():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        number = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"cannot listen at 127.0.0.1 port {number}: .*--port 0"):
            bound("127.0.0.1", number)
    with pytest.raises(InputError, match="not an address of this machine"):
        bound("no such host", None)


def test_fifty_clients_and_random_requests_leave_the_server_up(served):
    with served() as page, ThreadPoolExecutor(50) as pool:
        rng = random.Random(5)
        statuses = list(pool.map(lambda path: fetched(page, path), [random_path(rng) for _ in range(300)]))
        assert set(statuses) <= {200, 400, 404, 414, 422, 503}
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
    question = rng.choice(["ask/flows", "ask/flows", "ask/curve", "ask/nothing", "about", "page/main.js", "..", ""])
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
