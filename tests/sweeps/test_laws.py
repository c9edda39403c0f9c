"""Studies with laws of files, with parameters and with breaks."""

from pathlib import Path

import numpy as np
import pytest
import zarr

from chuteflow import Chute, InputError, flows
from chuteflow.cli.program import DONE, main
from chuteflow.sweeps.engine import solve_chunk
from chuteflow.sweeps.outcome import Reason
from chuteflow.sweeps.store import Store
from chuteflow.sweeps.study import from_canonical, from_dict, read

LAW = """
from dataclasses import replace

from chuteflow.theory.extended import EXTENDED

OWN = replace(EXTENDED, name="own")
"""
STUDY = """
[design]
kind = "product"
[parameters]
slope = [0.29, 0.3]
e = 0.8
ew = 0.8
roughness = 0.6
Q = 3.0
closure = ["lun", "grains.py:OWN", "extended", "garzo-dufty-fourier:radial=ma-ahmadi", "garzo-dufty"]
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "grains.py").write_text(LAW)
    study = tmp_path / "study.toml"
    study.write_text(STUDY)
    return study


def test_points_are_those_of_the_search_of_one_chute(path):
    study = read(path)
    solved = solve_chunk(study, 0)
    closures = study.design.axes["closure"].words
    for i in range(study.points):
        name = closures[int(solved.parameters["closure"][i])]
        closure = "extended" if "grains" in name else name
        found = flows(Chute(float(solved.parameters["slope"][i]), 0.8, 0.8, 0.6, closure=closure), Q=3.0)
        assert solved.n_flows[i] == len(found)
        got = solved.quantities["mass_holdup"][i, : len(found)]
        np.testing.assert_allclose(got, [flow.mass_holdup for flow in found], rtol=1e-7)


def test_a_law_of_a_file_gives_the_bits_of_the_built_in_one(path):
    study = read(path)
    solved = solve_chunk(study, 0)
    words = study.design.axes["closure"].words
    own, built_in = (solved.parameters["closure"] == words.index(name) for name in ("grains.py:OWN", "extended"))
    for name in study.quantities:
        np.testing.assert_array_equal(solved.quantities[name][own], solved.quantities[name][built_in])


def test_a_store_knows_its_laws_again_wherever_it_is_opened(path, tmp_path, monkeypatch):
    store = Store.made(tmp_path / "study.zarr", read(path))
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    again = Store.opened(store.path)
    assert again.study.digest == store.study.digest
    assert again.study.laws == store.study.laws


def test_a_store_refuses_another_law_of_the_same_name(path, tmp_path):
    Store.made(tmp_path / "study.zarr", read(path))
    (tmp_path / "grains.py").write_text(LAW.replace("EXTENDED,", "EXTENDED.configured(packing=0.65),"))
    with pytest.raises(InputError, match=r"differs in closures\.grains\.py:OWN|is another now than"):
        Store.made(tmp_path / "study.zarr", read(path))


def test_studies_of_the_papers_laws_stay_what_they_were(path):
    path.write_text(STUDY[: STUDY.index("closure")] + 'closure = "lun-fourier"\n')
    study = read(path)
    assert "closures" not in study.canonical
    assert study.design.axes["closure"].words == ("lun", "lun-fourier")
    assert from_canonical(study.canonical).digest == study.digest


def test_points_on_other_bases(path):
    bases = ["richman", "richman:diameter=1.2", "johnson-jackson:specularity=0.2"]
    path.write_text(STUDY[: STUDY.index("closure")] + f"base = {bases}\n".replace("'", '"'))
    study = read(path)
    assert from_canonical(study.canonical).digest == study.digest
    solved = solve_chunk(study, 0)
    assert solved.singly == study.points
    for i in range(study.points):
        base = bases[int(solved.parameters["base"][i])]
        found = flows(Chute(float(solved.parameters["slope"][i]), 0.8, 0.8, 0.6, base=base), Q=3.0)
        assert solved.n_flows[i] == len(found)
        got = solved.quantities["mass_holdup"][i, : len(found)]
        np.testing.assert_allclose(got, [flow.mass_holdup for flow in found], rtol=1e-7)


def test_why_there_is_no_flow_is_not_said_by_a_hot_limit_that_is_none(path):
    text = STUDY[: STUDY.index("closure")].replace("[0.29, 0.3]", "0.42") + 'closure = ["lun", "garzo-dufty"]\n'
    path.write_text(text)
    solved = solve_chunk(read(path), 0)
    assert solved.n_flows.tolist() == [0, 0]
    assert solved.reason[0] == Reason.TOO_STEEP_FOR_HOT_FLOWS_NO_OTHER_FOUND
    assert solved.reason[1] == Reason.NONE_FOUND_IN_THE_RANGE_SEARCHED


def test_two_flows_of_moderate_depth_are_found():
    parameters = {
        "slope": 0.3151755787861835,
        "e": 0.8664500970114325,
        "ew": 0.6794127150808549,
        "roughness": 0.8285609810188521,
        "M": 4.79322153646058,
    }
    solved = solve_chunk(from_dict({"design": {"kind": "list"}, "parameters": parameters}, Path()), 0)
    assert solved.n_flows.tolist() == [2]


def test_a_chute_on_which_trajectories_wind_is_solved():
    study = from_dict(
        {"parameters": {"slope": [0.42], "e": 0.8, "ew": 0.8, "roughness": 0.6, "Q": 3.0}, "design": {"kind": "list"}},
        Path(),
    )
    solved = solve_chunk(study, 0)
    assert solved.n_flows.tolist() == [0]


@pytest.mark.parametrize("closure", ["grains.py:NONE", "missing.py:OWN", "extended:packing=9", "unheard-of"])
def test_a_law_that_is_not_there_is_named(path, closure):
    path.write_text(STUDY[: STUDY.index("closure")] + f'closure = "{closure}"\n')
    with pytest.raises(InputError, match=r"parameters\.closure: "):
        read(path)


@pytest.mark.slow
def test_two_workers_give_the_bits_of_the_built_in_law(path, tmp_path):
    head = STUDY[: STUDY.index("closure")].replace("[0.29, 0.3]", "[0.28, 0.29, 0.3, 0.31]")
    found = {}
    for closure in ("grains.py:OWN", "extended"):
        path.write_text(head + f'closure = "{closure}"\n')
        out = tmp_path / f"{closure.partition('.')[0]}.zarr"
        assert main(["sweep", str(path), "--out", str(out), "--workers", "2", "--no-check", "--quiet"]) == DONE
        found[closure] = zarr.open_group(out, mode="r")
    own, built_in = found.values()
    names = [name for name, array in built_in.arrays() if array.dtype.kind in "fi"]
    assert len(names) > 5
    for name in names:
        np.testing.assert_array_equal(own[name][:], built_in[name][:])
