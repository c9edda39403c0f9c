"""A law that is registered again under its name: everything that is computed afterwards is of the new one."""

from dataclasses import replace

import numpy as np
import pytest

from chuteflow import Chute, InputError, boundary, curve, flows, hot, load, save, stability_of
from chuteflow.maps.plane import ParameterAxis, ParameterPlane, summarise
from chuteflow.theory.laws import LAWS
from chuteflow.theory.lun import LUN

SLOPE, E, E_W, R = 0.3, 0.8, 0.8, 0.6
NAME = "own"


def lossy(factor):
    """Lun's law with the dissipation times ``factor``."""

    def coefficients(nu, free_fraction, e, slope):
        plain = LUN.coefficients(nu, free_fraction, e, slope)
        return replace(plain, dissipation=factor * plain.dissipation)

    return replace(LUN, name=NAME, coefficients=coefficients)


@pytest.fixture
def chute(monkeypatch):
    """A chute with Lun's law under a name of its own, at which everything has been computed once."""
    monkeypatch.setitem(LAWS, NAME, lossy(1.0))
    return Chute(SLOPE, E, E_W, R, closure=NAME)


def test_flows_are_those_of_the_new_law(chute, monkeypatch):
    assert len(flows(chute, Q=3.0)) == 3
    monkeypatch.setitem(LAWS, NAME, lossy(1.2))
    for asked in (chute, Chute(SLOPE, E, E_W, R, closure=NAME)):
        (flow,) = flows(asked, Q=3.0)
        assert flow.mass_holdup == pytest.approx(0.291609, abs=5e-7)


def _growth(flow):
    mode = stability_of(flow, kx=0.01, ky=0.1).mode
    assert mode is not None
    return mode.growth


def _kinds(chute):
    plane = ParameterPlane(
        ParameterAxis("wall_restitution", 0.5, 0.9), ParameterAxis("roughness", 0.55, 0.7), chute, ()
    )
    return [summarise(plane, share, share) for share in (0.2, 0.5, 0.8)]


@pytest.mark.parametrize(
    "ask",
    [
        lambda chute: curve(chute, points=20).branches[0].mass_holdup,
        lambda chute: hot(chute).parameters.delta,
        lambda chute: _growth(flows(chute, Q=3.0)[0]),
        _kinds,
        lambda chute: [line.mass_flux[0] for line in boundary(chute, bounds=(0.29, 0.31), samples=2)],
    ],
    ids=["curve", "hot", "stability", "domain", "boundary"],
)
def test_every_analysis_is_of_the_new_law(chute, monkeypatch, ask):
    ask(chute)
    monkeypatch.setitem(LAWS, NAME, lossy(0.9))
    again = ask(chute)
    monkeypatch.setitem(LAWS, "never seen", replace(lossy(0.9), name="never seen"))
    fresh = ask(Chute(SLOPE, E, E_W, R, closure="never seen"))
    np.testing.assert_array_equal(again, fresh)


def test_a_flow_keeps_the_law_it_was_solved_with(chute, monkeypatch):
    flow = flows(chute, Q=3.0)[0]
    before = _growth(flow)
    monkeypatch.setitem(LAWS, NAME, lossy(1.2))
    assert _growth(flow) == before


@pytest.mark.parametrize("suffix", [".nc", ".csv", ".json"])
def test_a_file_of_the_older_law_says_so(chute, monkeypatch, tmp_path, suffix):
    path = tmp_path / f"flows{suffix}"
    save(flows(chute, Q=3.0), path)
    monkeypatch.setitem(LAWS, NAME, lossy(1.2))
    with pytest.raises(InputError, match="with another law than the one"):
        load(path)
    monkeypatch.setitem(LAWS, NAME, lossy(1.0))
    assert len(load(path)) == 3  # pyright: ignore[reportArgumentType]
