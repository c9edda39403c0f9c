"""The engine against the reference: every flow there and no other, to 1e-9, with no error understated."""

from typing import Any

import numpy as np
import pytest

from chuteflow import Chute, Flow, flows

from .cases import CONDITIONS, NAMED, RANDOM, Asked, random_asked
from .reference import QUANTITIES, Array, Case, Guess, ReferenceFlow, Scan, refine

AGREEMENT = 1e-9
#: Flows are one and the same when their logarithms agree to this.
SAME = 1e-5
#: A flow this near to an edge of the range, in the logarithm, may be on either side of it.
EDGE = 1e-2


def chute_of(case: Case) -> Chute:
    return Chute(case.slope, case.e, case.e_w, case.r, case.surface, case.closure)


def logs(flow: Flow) -> Array:
    return np.log([flow.mass_flux, flow.centre_of_mass, flow.mass_holdup, flow.surface_temperature])


def complaints(scan: Scan, asked: Asked) -> list[str]:
    """What is wrong with the flows that the engine gives for ``asked``."""
    case, which, value = asked
    condition: dict[str, Any] = {QUANTITIES[which]: value}
    found = flows(chute_of(case), **condition)
    expected = scan.flows(which, value)
    out = [] if scan.complete else ["the scan is not complete"]
    if bool(found.reason) == bool(len(found)):
        out.append(f"{len(found)} flows, and as reason {found.reason!r}")
    unseen = list(expected)
    for flow in found:
        match = [r for r in unseen if np.abs(r.logs - logs(flow)).max() < SAME]
        if match:
            unseen.remove(match[0])
            out += disagreement(flow, match[0])
            continue
        if inside(scan, logs(flow)):
            out.append(f"invented: {describe(logs(flow))}")
        else:  # beyond the range of the scan: the flow must be there, whether the scan sees it or not
            out += disagreement(flow, refine(case, which, value, guess_of(flow)))
    return out + [f"missed: {describe(r.logs)}" for r in unseen if inside(scan, r.logs)]


def disagreement(flow: Flow, reference: ReferenceFlow) -> list[str]:
    true = float(np.abs(logs(flow) - reference.logs)[:3].max())
    out = []
    if true > AGREEMENT:
        out.append(f"off by {true:.2e}: {describe(logs(flow))}")
    if true > flow.error + reference.error:
        out.append(f"off by {true:.2e}, said {flow.error:.2e} (reference {reference.error:.2e})")
    if reference.error > 0.1 * AGREEMENT:
        out.append(f"the reference itself errs by {reference.error:.2e}")
    return out


def inside(scan: Scan, at: Array) -> bool:
    """Whether a flow is well inside the range of the scan, and not too thin for it."""
    low, high = np.log(scan.temperatures)
    return bool(low + EDGE < at[3] < high - EDGE and np.log(scan.thinnest) + EDGE < at[2] < np.log(scan.mass) - EDGE)


def describe(at: Array) -> str:
    return ", ".join(f"{name} = {np.exp(v):.9g}" for name, v in zip(QUANTITIES, at, strict=True))


def guess_of(flow: Flow) -> Guess:
    """The profile of a flow as a start for the reference."""
    top = flow.interface_height
    thin = flow.centre_of_mass + flow.surface_temperature * np.geomspace(1e-3, 60.0, 300)
    z = np.unique(np.concatenate([np.linspace(0.0, min(flow.depth, top), 600), thin[thin < top]]))
    profile = flow.profile(z[z <= top])
    p, t = profile.normal_stress[::-1], profile.granular_temperature[::-1]
    y = profile.heat_flux[::-1] / (p * np.sqrt(t))
    return Guess(flow.surface_temperature, flow.mass_holdup, p, np.log(t), y)


@pytest.mark.parametrize("name", NAMED)
def test_named_flows(name):
    asked, count = NAMED[name]
    scan = Scan(asked.case, columns=240)
    assert len(scan.flows(asked.which, asked.value)) == count
    wrong = complaints(scan, asked)
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(RANDOM))
def test_random_flows(seed):
    conditions = random_asked(seed)
    scan = Scan(conditions[0].case)
    wrong = [f"{asked}: {complaint}" for asked in conditions for complaint in complaints(scan, asked)]
    assert not wrong, "\n".join(wrong)


def test_random_chutes_are_many_and_various():
    conditions = [asked for seed in range(RANDOM) for asked in random_asked(seed)]
    assert len(conditions) == RANDOM * CONDITIONS >= 200
    assert len({asked.case for asked in conditions}) == RANDOM
    assert {(asked.case.surface, asked.case.closure, asked.which) for asked in conditions} == {
        (surface, closure, which)
        for surface in ("free", "interface")
        for closure in ("lun", "lun-fourier")
        for which in range(4)
    }
    restitution = np.array([asked.case.e for asked in conditions])
    assert restitution.min() < 0.35
    assert restitution.max() == 1.0
