"""Files of flows under laws that are not registered where they are read."""

from dataclasses import replace
from typing import Any

import pytest

import chuteflow
from chuteflow import Chute, InputError
from chuteflow.theory.extended import EXTENDED
from chuteflow.theory.laws import LAWS

CHUTE: dict[str, Any] = {"slope": 0.3, "restitution": 0.8, "wall_restitution": 0.8, "roughness": 0.6}


@pytest.fixture
def found(monkeypatch):
    monkeypatch.setitem(LAWS, "own", replace(EXTENDED, name="own"))
    flows = chuteflow.flows(Chute(**CHUTE, closure="own"), Q=3.0)
    assert len(flows) == 4
    return flows


@pytest.mark.parametrize("suffix", [".nc", ".csv", ".json"])
def test_a_file_loads_without_its_law_and_says_where_that_is_needed(found, monkeypatch, tmp_path, suffix):
    path = tmp_path / f"flows{suffix}"
    chuteflow.save(found, path)
    monkeypatch.delitem(LAWS, "own")
    again: Any = chuteflow.load(path)
    assert [flow.mass_holdup for flow in again] == [flow.mass_holdup for flow in found]
    assert "not registered here" in repr(again[0])
    for ask in (
        lambda: again[0].profile([0.0]),
        lambda: again[0].largest_volume_fraction,
        lambda: chuteflow.flows(again.chute, Q=2.0),
        lambda: chuteflow.save(again, tmp_path / f"again{suffix}"),
    ):
        with pytest.raises(InputError, match="closure 'own' is not registered here"):
            ask()


@pytest.mark.parametrize("suffix", [".csv", ".json"])
def test_a_damaged_file_without_its_law_is_not_believed(found, monkeypatch, tmp_path, suffix):
    path = tmp_path / f"flows{suffix}"
    chuteflow.save(found, path)
    monkeypatch.delitem(LAWS, "own")
    text = path.read_text()
    assert "stretch" in text
    place = text.index(":", text.index("stretch")) + 2
    path.write_text(text[:place] + "1" + text[place:])
    with pytest.raises(InputError, match="its checksum is that of other numbers"):
        chuteflow.load(path)


@pytest.mark.parametrize("suffix", [".nc", ".csv", ".json"])
def test_parameters_and_bases_come_back_to_the_last_bit(tmp_path, suffix):
    chute = Chute(**CHUTE, closure="extended:packing=0.64", base="richman:diameter=1.2")
    found = chuteflow.flows(chute, Q=3.0)
    assert len(found)
    path = tmp_path / f"flows{suffix}"
    chuteflow.save(found, path)
    again: Any = chuteflow.load(path)
    assert str(again.chute.closure) == "extended:packing=0.64"
    assert again.chute.law == chute.law
    assert str(again.chute.base) == "richman:diameter=1.2"
    for one, other in zip(found, again, strict=True):
        assert one.mass_flux == other.mass_flux
        assert one.largest_volume_fraction == other.largest_volume_fraction


def test_to_load_a_file_runs_no_other(tmp_path):
    source = tmp_path / "grains.py"
    source.write_text("from chuteflow.theory.extended import EXTENDED as OWN\n")
    chute = Chute(**CHUTE, closure=f"{source}:OWN")
    path = tmp_path / "flows.json"
    chuteflow.save(chuteflow.flows(chute, Q=3.0), path)
    # A law that was asked for in this process is known again.
    again: Any = chuteflow.load(path)
    assert again.chute.law.known
    other = tmp_path / "other.py"
    other.write_text("raise SystemExit('it ran')\n")
    path.write_text(path.read_text().replace("grains.py", "other.py"))
    with pytest.raises(InputError, match="checksum"):
        chuteflow.load(path)
