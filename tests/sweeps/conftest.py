"""What several tests of sweeps use."""

import hashlib
from pathlib import Path

import pytest

from chuteflow.sweeps.store import Store
from chuteflow.sweeps.study import from_dict
from chuteflow.sweeps.work import work

PARAMETERS = {
    "slope": {"from": 0.2, "to": 0.4},
    "e": 0.8,
    "ew": [0.7, 0.8],
    "roughness": {"from": 0.5, "to": 0.8},
    "T_surface": {"from": 0.5, "to": 50.0, "scale": "log"},
}


def table(points=48, chunk=12, **results):
    """The table of a small random study at given surface temperatures."""
    return {
        "design": {"kind": "random", "points": points, "seed": 3},
        "parameters": dict(PARAMETERS),
        "results": {"chunk": chunk, **results},
    }


def fingerprint(store):
    """A hash of the arrays and metadata of a store, by their names; what is only about the run is left out."""
    files = [path for path in Path(store).rglob("*") if path.is_file() and ".chuteflow" not in path.parts]
    return {str(path.relative_to(store)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    """A store whose chunks were computed one after the other in this process."""
    path = tmp_path_factory.mktemp("sweeps") / "whole.zarr"
    store = Store.made(path, from_dict(table(), Path()))
    for chunk in range(store.study.chunks):
        work(str(path), chunk)
    return store


@pytest.fixture(name="fingerprint")
def _fingerprint():
    return fingerprint


@pytest.fixture(name="table")
def _table():
    return table
