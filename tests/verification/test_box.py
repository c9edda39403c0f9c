"""Every chute and condition there can be, edges included: flows or a reason, within seconds, and nothing else."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from chuteflow import Chute, Flow, FlowSet, SolveError, flows

from .limits import TooLate, processor_time

#: Seconds of processor time after which an answer has come too late.
LIMIT = 20.0
#: Fraction of the examples that may end with a SolveError.
MOST_UNSOLVED = 0.01
#: What is asked for, and how it may be missed besides the flow's own error.
ASKED = {"Q": "mass_flux", "h": "centre_of_mass", "M": "mass_holdup", "T_surface": "surface_temperature"}
MET = 1e-10


def even_in_logarithm(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers from ``low`` to ``high``, and both often."""
    within = st.floats(math.log(low), math.log(high)).map(lambda log: min(max(math.exp(log), low), high))
    return st.one_of(within, within, within, st.sampled_from([low, high]))


CHUTES = st.builds(
    Chute,
    slope=st.one_of(even_in_logarithm(1e-3, 1e2), even_in_logarithm(0.05, 0.6), even_in_logarithm(0.05, 0.6)),
    restitution=st.one_of(
        st.sampled_from([1.0, 1.0 - 1e-9, 1e-3]),
        st.floats(1e-3, 1.0),
        st.floats(0.3, 1.0),
    ),
    wall_restitution=st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
    roughness=st.one_of(st.sampled_from([0.5, math.sqrt(0.75)]), st.floats(0.5, math.sqrt(0.75))),
    surface=st.sampled_from(["free", "interface"]),
    closure=st.sampled_from(["lun", "lun-fourier"]),
)
CONDITIONS = st.one_of(
    st.tuples(st.just("Q"), even_in_logarithm(1e-6, 1e6)),
    st.tuples(st.just("h"), even_in_logarithm(1e-6, 1e6)),
    st.tuples(st.just("M"), even_in_logarithm(1e-9, 300.0)),
    st.tuples(st.just("T_surface"), even_in_logarithm(1e-6, 1e8)),
)


def ask(chute: Chute, name: str, value: float) -> FlowSet:
    condition: dict[str, Any] = {name: value}
    return flows(chute, **condition)


def check_answer(found: FlowSet, name: str, value: float) -> None:
    """Flows that are what was asked for, all different, from hot to cold, or a reason."""
    assert (found.reason is None) == (len(found) > 0)
    assert found.reason is None or found.reason.strip()
    for flow in found:
        check_flow(flow)
        assert abs(getattr(flow, ASKED[name]) / value - 1.0) <= flow.error + MET
        low, high = found.searched.surface_temperature
        assert low * (1.0 - 1e-8) <= flow.surface_temperature <= high * (1.0 + 1e-8)
        assert flow.mass_holdup <= found.searched.largest_holdup * (1.0 + 1e-8)
    order = [(-flow.surface_temperature, flow.mass_holdup) for flow in found]
    assert order == sorted(set(order))


def check_flow(flow: Flow) -> None:
    """Finite numbers and fields, and positive where they must be."""
    numbers = [getattr(flow, name) for name in ASKED.values()]
    numbers += [flow.error, flow.base_temperature, flow.base_volume_fraction, flow.slip_velocity, flow.depth]
    assert all(math.isfinite(number) and number > 0.0 for number in numbers), numbers
    assert 0.0 < flow.base_volume_fraction <= flow.largest_volume_fraction * (1.0 + 1e-9)
    assert flow.largest_volume_fraction < 0.62
    assert flow.interior in ("dissipative", "productive", "mixed")
    assert flow.density in ("monotonic", "inverted")
    profile = flow.sampled(9)
    assert all(np.isfinite(values).all() for values in vars(profile).values())
    assert min(profile.volume_fraction.min(), profile.granular_temperature.min()) > 0.0


def examine(examples: int) -> None:
    """Ask for the flows of ``examples`` chutes at conditions of all kinds."""
    unsolved: list[str] = []

    @settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        database=None,
        phases=(Phase.explicit, Phase.generate),
        suppress_health_check=[HealthCheck.too_slow],
    )
    @given(CHUTES, CONDITIONS)
    def there_is_an_answer(chute: Chute, asked: tuple[str, float]) -> None:
        name, value = asked
        with processor_time(LIMIT):
            try:
                found = ask(chute, name, value)
            except SolveError as error:
                unsolved.append(f"flows({chute!r}, {name}={value!r}): {error}")
                return
            check_answer(found, name, value)

    there_is_an_answer()
    listed = "\n".join(unsolved)
    assert len(unsolved) <= MOST_UNSOLVED * examples, f"{len(unsolved)} of {examples} unsolved:\n{listed}"


def test_there_is_an_answer():
    examine(100)


@pytest.mark.slow
def test_there_is_an_answer_to_many():
    examine(3000)


EDGES = [
    Chute(slope, e, e_w, r, surface, closure)
    for slope in (1e-3, 0.3, 1e2)
    for e in (1e-3, 1.0)
    for e_w in (0.0, 1.0)
    for r in (0.5, math.sqrt(0.75))
    for surface in ("free", "interface")
    for closure in ("lun", "lun-fourier")
]


@pytest.mark.slow
@pytest.mark.parametrize("name", ASKED)
def test_there_is_an_answer_at_every_corner(name):
    for chute in EDGES:
        for value in (1e-6, 1.0, 300.0 if name == "M" else 1e6):
            with processor_time(LIMIT):
                check_answer(ask(chute, name, value), name, value)


def test_a_late_answer_is_noticed(monkeypatch):
    monkeypatch.setattr(f"{__name__}.LIMIT", 0.05)
    with pytest.raises(TooLate), processor_time(LIMIT):
        _run_on()


def _run_on() -> None:
    while True:
        pass
