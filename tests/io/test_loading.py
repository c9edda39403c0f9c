"""What is wrong in a file is said in one line and at once, whatever its format, and never loaded."""

import json
import time
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from chuteflow import Chute, Domain, InputError, curve, flows, load, save
from chuteflow.io import contract
from chuteflow.io.records import checksum
from chuteflow.maps.columns import Column, PiecewiseConstant
from chuteflow.maps.plane import CODES, HOT_CODES, ParameterAxis, ParameterPlane

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
SUFFIXES = [".nc", ".csv", ".json"]


@pytest.fixture(scope="module")
def found():
    return flows(PAPER, Q=3.0)


@pytest.fixture(scope="module")
def traced():
    return curve(PAPER, points=6)


def parts(path):
    """Head and rows of a file, in any format, and how to write others in their place."""
    if path.suffix == ".json":
        whole = json.loads(path.read_text())
        rows = whole["restore"].pop("rows")

        def write(head, rows):
            path.write_text(json.dumps(whole | {"restore": head | {"rows": rows}}))

        return whole["restore"], rows, write
    if path.suffix == ".csv":
        lines = path.read_text().splitlines()
        table = [line for line in lines if not line.startswith(("# restore: ", "# unknowns: "))]
        (head,) = [json.loads(line[11:]) for line in lines if line.startswith("# restore: ")]
        rows = [json.loads(line[12:]) for line in lines if line.startswith("# unknowns: ")]
        del head["rows"]

        def write(head, rows):
            kept = [f"# restore: {json.dumps(head | {'rows': len(rows)})}"]
            path.write_text("\n".join([*table, *kept, *(f"# unknowns: {json.dumps(row)}" for row in rows)]) + "\n")

        return head, rows, write
    return netcdf_parts(path)


def netcdf_parts(path):
    from chuteflow.io import netcdf_file

    with netcdf_file.restored_group(path) as group:
        head = json.loads(group.attrs["head"])
        columns = {name: group[name][...].tolist() for name in group if name not in ("flow", "unknown", "logarithm")}
    rows = list(netcdf_file._rows(columns))

    def write(head, rows):
        statuses, kinds = [s.name for s in netcdf_file._STATUS], ("", *netcdf_file.KINDS)
        with h5py.File(path, "w") as file:
            group = file.create_group("restore")
            group.attrs["head"] = json.dumps(head)
            for name in ("degree", "stretch", "branch"):
                group[name] = np.array([row[name] for row in rows])
            group["error"] = np.array([np.inf if row["error"] is None else row["error"] for row in rows])
            group["unknowns"] = np.array([len(row["z"]) for row in rows], dtype="i4")
            group["z"] = np.concatenate([row["z"] for row in rows])
            group["macroscopic"] = np.array([row["macroscopic"] for row in rows], dtype=float)
            codes = [statuses.index(row["status"]) if row["status"] in statuses else row["status"] for row in rows]
            group["status"] = np.array(codes, dtype="i4")
            group["special"] = np.array([kinds.index(row["special"]) for row in rows], dtype="i4")

    return head, rows, write


def refused(path):
    """The one line that loading ends with, within a second."""
    begin = time.process_time()
    with pytest.raises(InputError) as caught:
        load(path)
    assert time.process_time() - begin < 1.0
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value).removeprefix(f"cannot load {path}: ")


NAN, INFINITE = float("nan"), float("inf")


def of_row(name, value):
    return lambda head, rows: rows[1].update({name: value})


def of_head(name, value):
    return lambda head, rows: head.update({name: value})


def too_fine(head, rows):
    rows[0] |= {"degree": 9999, "z": [0] * 10_002}


def doubled(head, rows):
    rows.insert(1, dict(rows[0]))


def turned(head, rows):
    rows.reverse()


CHANGES = {
    "a negative error": (of_row("error", -1.0), "the error of a flow = -1"),
    "an error that is no number": (of_row("error", NAN), "NaN|the error of a flow = nan"),
    "a tolerance that is no number": (of_head("tolerance", NAN), "NaN"),
    "a tolerance that nobody can ask for": (of_head("tolerance", 2.0), "tolerance 2: must be from 1e-11 to 1e-3"),
    "a negative tolerance": (of_head("tolerance", -1e-8), "tolerance -1e-08"),
    "a negative status": (of_row("status", -1), "status"),
    "a status of no name": (of_row("status", 17), "status"),
    "a format below the first": (of_head("format", -1), "format = -1: must be from 1"),
    "a format that is a truth": (of_head("format", True), "format = True: must be a whole number"),
    "a later format": (of_head("format", 9), "later chuteflow"),
    "a flow twice": (doubled, "each once"),
    "flows from cold to hot": (turned, "from hot to cold"),
    "a grid that is too fine": (too_fine, "the degree of a flow = 9999: must be from 2 to 400"),
    "a degree that is no whole number": (of_row("degree", 24.5), "the degree of a flow = 24.5"),
    "a negative degree": (of_row("degree", -1), "the degree of a flow = -1"),
    "a negative stretch": (of_row("stretch", -1.0), "the stretch of a flow = -1"),
    "a stretch without end": (of_row("stretch", 1e300), "the stretch of a flow"),
    "a negative branch": (of_row("branch", -1), "the branch of a flow = -1"),
    "a slope that is no number": (lambda head, rows: head["chute"].update(slope="steep"), "slope = 'steep'"),
    "a range that falls": (lambda head, rows: head["searched"].update(surface_temperature=[2.0, 1.0]), "must rise"),
    "a range without end": (lambda head, rows: head["searched"].update(largest_holdup=1e9), "largest hold-up"),
    "a reason that is a number": (of_head("reason", 3), "reason = 3"),
    "a result of no kind": (of_head("kind", "river"), "unknown kind of result, 'river'"),
    "a law of other numbers": (of_head("law", [0.62] * 25), "with another law than the one"),
    "a digit changed": (lambda head, rows: rows[2]["z"].__setitem__(3, rows[2]["z"][3] * (1 + 1e-15)), "checksum"),
    "a reason changed": (of_head("reason", "none"), "checksum"),
}  # fmt: skip


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", CHANGES)
def test_values_are_checked_before_anything_is_computed(name, suffix, found, tmp_path):
    path = tmp_path / f"a{suffix}"
    save(found, path)
    head, rows, write = parts(path)
    write(head, rows)
    assert len(load(path)) == 3  # pyright: ignore[reportArgumentType]
    change, message = CHANGES[name]
    change(head, rows)
    write(head, rows)
    assert any(one in refused(path) for one in message.split("|"))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_without_checksum_is_of_the_first_version(suffix, found, tmp_path):
    path = tmp_path / f"a{suffix}"
    save(found, path)
    head, rows, write = parts(path)
    del head["checksum"], head["law"]
    write(head, rows)
    assert [f.mass_holdup for f in load(path)] == [f.mass_holdup for f in found]  # pyright: ignore


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_rows_of_a_curve(suffix, traced, tmp_path):
    path = tmp_path / f"a{suffix}"
    save(traced, path)
    head, rows, write = parts(path)
    write(head, [rows[0], *rows])
    assert "a flow twice" in refused(path)
    write(head, [rows[0] | {"branch": 7}, *rows])
    assert "a branch that is not in it" in refused(path)
    write(head, [row for row in rows if row["special"]])
    assert "begins with a special point" in refused(path)
    write(head | {"ends": [*head["ends"], ["here", "there"]]}, rows)
    assert "a branch without flows" in refused(path)


def test_a_small_file_that_asks_for_much_is_refused_at_once(found, tmp_path):
    """52 kB that took 113 s and 6.9 GB."""
    path = tmp_path / "a.json"
    save(found[0], path)
    whole = json.loads(path.read_text())
    whole["restore"]["rows"][0] |= {"degree": 9999, "z": [0] * 10_002}
    path.write_text(json.dumps(whole))
    assert "the degree of a flow = 9999" in refused(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "damaged"),
        ('{"restore":' * 50_000, "damaged"),
        ('{"restore": ' + "9" * 5000 + "}", "damaged"),
        ('{"restore": {"format": ' + "9" * 400 + "}}", "format|damaged"),
        ('{"restore": NaN}', "NaN is in it"),
        ('{"restore": {"format": 1, "format": 1}}', "'format' is in it twice"),
        ('{"restore": []}', "damaged"),
        ("[]", "damaged"),
        ("", "damaged"),
        ("\0", "damaged"),
    ],
)  # fmt: skip
def test_texts_that_are_no_result(text, message, tmp_path):
    path = tmp_path / "a.json"
    path.write_text(text)
    assert any(one in refused(path) for one in message.split("|"))
    path = tmp_path / "a.csv"
    path.write_text(f"# restore: {text}\n")
    refused(path)


@pytest.mark.parametrize("suffix", [".csv", ".json"])
def test_a_byte_order_mark_is_no_damage(suffix, found, tmp_path):
    path = tmp_path / f"a{suffix}"
    save(found, path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert len(load(path)) == 3  # pyright: ignore[reportArgumentType]


def test_a_column_twice_is_refused(found, tmp_path):
    path = tmp_path / "a.csv"
    save(found, path)
    path.write_text(path.read_text().replace("\nflow,height,", "\nflow,flow,"))
    assert refused(path) == "it has the column 'flow' 2 times"


@pytest.mark.parametrize("text", ["x" * 200_000, '"' + "x" * 200_000, "a,\0b", ",".join("x" * 10)])
def test_a_table_that_is_none(text, found, tmp_path):
    path = tmp_path / "a.csv"
    save(found, path)
    lines = path.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    path.write_text("\n".join([*lines[:first], text]) + "\n")
    refused(path)


def test_a_file_may_claim_any_size(tmp_path):
    path = tmp_path / "a.nc"
    with h5py.File(path, "w") as file:
        file.create_group("restore").create_dataset("z", shape=(10**12,), dtype="f8", chunks=(1000,))
    assert "z claims 1000000000000 numbers" in refused(path)


@pytest.fixture
def small_domain():
    plane = ParameterPlane(
        ParameterAxis("wall_restitution", 0.5, 0.9), ParameterAxis("roughness", 0.55, 0.7), PAPER, ()
    )
    columns = tuple(Column(place, (PiecewiseConstant((0.5,), (0, 1)),) * len(CODES)) for place in (0.0, 1.0))
    hot = tuple(Column(place, (PiecewiseConstant((), (1,)),) * len(HOT_CODES)) for place in (0.0, 1.0))
    return Domain.on_cells(plane, (3, 3), 0.05, columns, hot)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"size": [0, 3]}, "size 0x3"),
        ({"size": [10**9, 3]}, "size 1000000000x3"),
        ({"tolerance": 0.5}, "tolerance = 0.5"),
        ({"tolerance": -1}, "tolerance = -1"),
        ({"axes": [["slope", 0.4, 0.3], ["roughness", 0.5, 0.6]]}, "must rise"),
        ({"columns": [[0.0, []], [1.0, []]]}, "a column must have"),
        ({"columns": [[0.0, [[[0.5], [0]]]]]}, "one class more than stops"),
        ({"columns": [[2.0, []]]}, "a fraction of an axis = 2"),
        ({"columns": [[0.5, []], [0.5, []]]}, "must rise"),
        ({"temperatures": ["hot"]}, "temperatures = 'hot'"),
        ({"format": 0}, "format = 0"),
        ({"law": [1.0]}, "another law"),
        ({"size": [4, 3]}, "checksum"),
    ],
)  # fmt: skip
def test_values_of_a_domain_are_checked(change, message, small_domain, tmp_path):
    path = tmp_path / "a.json"
    save(small_domain, path)
    assert load(path).columns == small_domain.columns  # pyright: ignore[reportAttributeAccessIssue]
    whole = contract.parsed(path.read_bytes())
    whole["restore"] |= change
    path.write_text(json.dumps(whole))
    assert message in refused(path)


def test_a_checksum_is_of_all_that_is_restored():
    row = {"z": [1.0, 2.0], "status": "CONVERGED"}
    head = {"format": 1, "kind": "flow"}
    known = {
        checksum(head, [row]),
        checksum(head),
        checksum(head, [row, row]),
        checksum(head | {"kind": "flows"}, [row]),
        checksum(head, [row | {"z": [1.0, np.nextafter(2.0, 3.0)]}]),
    }
    assert len(known) == 5
    assert checksum(dict(reversed(head.items())), [row]) in known


def test_what_is_no_result_is_named():
    with pytest.raises(InputError, match="cannot save a SimpleNamespace"):
        save(SimpleNamespace(), "a.json")  # pyright: ignore[reportArgumentType]
