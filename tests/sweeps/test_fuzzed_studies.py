"""Studies of every kind of nonsense: each is a study, or is told in one line."""

import os
import random

import pytest

from chuteflow.cli.program import main
from chuteflow.sweeps.engine import solve_chunk
from chuteflow.sweeps.store import Marker, Store
from chuteflow.sweeps.study import from_canonical, read

GOOD = (
    """title = "A study"
[design]
kind = "sobol"
points = 5
seed = 1
[parameters]
slope = {from = 0.2, to = 0.45}
e = {from = 0.7, to = 0.95}
ew = {from = 0.6, to = 0.95, scale = "log"}
roughness = 0.6
surface = ["free", "interface"]
T_surface = [1.0, 3.0]
[search]
tolerance = 1e-7
surface_temperature = [1e-3, 1e5]
largest_holdup = 30
[results]
quantities = ["centre_of_mass", "mass_holdup", "density"]
flows = 4
chunk = 2
""",
    """[parameters]
slope = {from = 0.2, to = 0.4, points = 3}
e = 0.8
ew = [0.7, 0.8]
roughness = 0.6
closure = "lun"
T_surface = 2
[results]
chunk = 2
""",
    """[design]
kind = "list"
file = "points.csv"
[parameters]
e = 0.8
ew = 0.8
roughness = [0.6, 0.61]
[results]
chunk = 2
""",
)
CSV = "slope,T_surface,surface\n0.3,1.5,free\n0.31,2.5,interface\n"
#: Values that have broken readers of studies.
VALUES = (
    "1" * 401,
    "1" * 5001,
    "0x" + "f" * 5001,
    "-1",
    "0",
    "1e999",
    "1e30",
    "1000000000000",
    "99999999999999999999999",
    "nan",
    "inf",
    "-inf",
    "1e-320",
    "true",
    '""',
    '"0.3"',
    '"x\\u0000y"',
    '"../.."',
    '"/dev/null"',
    '"' + "y" * 300 + '"',
    "[]",
    "[[]]",
    "[true]",
    "[1, 2, 3, 4]",
    '["free", 3]',
    "[" * 5000,
    "[" * 400 + "]" * 400,
    "{}",
    "{from = 1}",
    "{from = 0.2, to = 0.3, points = 1000000000000}",
    "{from = 0.2, to = 0.3, points = 1e30}",
    f"{{from = 0.2, to = 0.3, points = 1{'0' * 30}}}",
    "{from = 0.2, to = 1e300, points = 3}",
    "{from = -1e308, to = 1e308, points = 3}",
    "1979-05-27",
    "07:32:00",
    "1979-05-27T07:32:00Z",
    "'''\n'''",
)
#: Values that may well be meant.
ORDINARY = ("0.3", "2", "[0.3, 0.31]", "{from = 0.2, to = 0.3, points = 2}", '"free"', '"lun"', "1e-6", "[1e-2, 1e4]")
FIELDS = (
    "9" * 140000,
    "",
    "nan",
    "inf",
    "1e999",
    "1" * 400,
    "x",
    "0.3\0",
    "\ufeff0.3",
    '"',
    "-0",
    "0.3,0.4",
    "ü",
    "slope",
)


def fuzzed(rng, text, fields):
    """A text with a few changes, as bytes."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        lines = text.split("\n")
        i = rng.randrange(len(lines))
        kind = rng.randrange(9)
        if kind <= 3:
            # Another value, or another name.
            before, sign, after = lines[i].partition("=" if "=" in lines[i] else ",")
            value = rng.choice(fields)
            lines[i] = (
                f"{before}{sign}{value}"
                if kind < 3 or not sign
                else f"{rng.choice((value, 'slope', 'x', 'Q'))}{sign}{after}"
            )
        elif kind == 4:
            del lines[i]
        elif kind == 5:
            lines.insert(rng.randrange(len(lines)), lines[i])
        elif kind == 6:
            place = rng.randrange(len(text) + 1)
            lines = (text[:place] + rng.choice((*"\0\t\"'[]{}=#,.\\\r", "\ufeff", "\u2028")) + text[place:]).split("\n")
        elif kind == 7:
            lines = text[: rng.randrange(len(text) + 1)].split("\n")
        else:
            rng.shuffle(lines)
        text = "\n".join(lines)
    content = bytearray(text.encode())
    if rng.random() < 0.1 and content:
        content[rng.randrange(len(content))] = rng.randrange(256)
    return bytes(content)


def told_or_solved(folder, seed, capsys):
    """Whether a fuzzed study is one; where it is, its store is made and its first chunk computed."""
    rng = random.Random(seed)
    text = rng.choice(GOOD)
    table = "points.csv" in text and rng.random() < 0.6
    path = folder / f"{seed}.toml"
    path.write_bytes(text.encode() if table else fuzzed(rng, text, VALUES if rng.random() < 0.5 else ORDINARY))
    (folder / "points.csv").write_bytes(
        fuzzed(rng, CSV, FIELDS if rng.random() < 0.5 else ORDINARY) if table else CSV.encode()
    )
    code = main(["sweep", str(path), "--out", str(folder / "none.zarr"), "--status"])
    told = capsys.readouterr()
    assert code == 2, seed
    assert told.err.startswith("chuteflow: "), seed
    assert told.err.count("\n") == 1, seed
    assert len(told.err) < 1000, seed
    if "there is no store" not in told.err:
        return False
    study = read(path)
    assert from_canonical(study.canonical, study.columns.__getitem__).digest == study.digest, seed
    if study.chunk <= 64 and study.flows <= 64:
        store = Store.made(folder / f"{seed}.zarr", study)
        assert Store.opened(store.path).study.digest == study.digest
        solved = solve_chunk(study, 0)
        store.put(0, solved.arrays(), Marker(0, len(solved.status), int(solved.n_flows.sum()), 0, 0.0, {}))
        assert store.is_done(0)
    return True


@pytest.mark.parametrize("value", VALUES)
def test_a_value_of_any_kind_is_used_or_told(tmp_path, capsys, value):
    for key in ("slope = 0.3", "T_surface = 2", "surface = 'free'", "e = 0.8"):
        path = tmp_path / "study.toml"
        rest = "\n".join(
            line for line in ("slope = 0.3", "e = 0.8", "ew = 0.8", "roughness = 0.6", "T_surface = 2") if line != key
        )
        path.write_text(f"[parameters]\n{rest}\n{key.split(' =')[0]} = {value}\n")
        assert main(["sweep", str(path), "--out", str(tmp_path / "none.zarr"), "--status"]) == 2
        told = capsys.readouterr().err
        assert told.startswith("chuteflow: ")
        assert told.count("\n") == 1
        assert len(told) < 500


@pytest.mark.parametrize("field", FIELDS)
def test_a_field_of_any_kind_is_used_or_told(tmp_path, capsys, field):
    (tmp_path / "points.csv").write_text(CSV.replace("0.31", field))
    (tmp_path / "study.toml").write_text(GOOD[2])
    assert main(["sweep", str(tmp_path / "study.toml"), "--out", str(tmp_path / "none.zarr"), "--status"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("chuteflow: ")
    assert told.count("\n") == 1


def test_a_few_fuzzed_studies(tmp_path, capsys):
    found = [told_or_solved(tmp_path, seed, capsys) for seed in range(40)]
    assert True in found
    assert False in found


@pytest.mark.slow
def test_fuzzed_studies(tmp_path, capsys):
    count = int(os.environ.get("CHUTEFLOW_FUZZ_STUDIES", "300"))
    found = [told_or_solved(tmp_path, 1000 + seed, capsys) for seed in range(count)]
    assert 0.02 * count < sum(found) < 0.98 * count
    with capsys.disabled():
        print(f"\nfuzzed studies: {count}, of which {sum(found)} are studies")
