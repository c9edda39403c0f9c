"""A disturbed flow followed in time, and the steady flow that it comes to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import Radau

from chuteflow import display
from chuteflow.branches.enumeration import flows
from chuteflow.checks import number
from chuteflow.errors import InputError, SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.result import Compared, Result
from chuteflow.stability.layer import FIELDS, Layer
from chuteflow.stability.modes import Disturbances, UnresolvedError, leading
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import SCALED
from chuteflow.threads import on_one_thread

#: Relative error of a step in time.
TOLERANCE = 1e-7
#: A flow comes to rest whose temperature at the base has fallen to this fraction, and whose density there has risen to
#: this fraction of the densest.
_COLD, _PACKED = 1e-4, 0.995


@dataclass(frozen=True, eq=False)
class RelaxationState(Compared):
    """A state on the way, with its time, Q, h, and T at the surface and at the base."""

    time: float
    mass_flux: float
    centre_of_mass: float
    surface_temperature: float
    base_temperature: float
    state: Array


@dataclass(frozen=True, eq=False)
class Outcome(Compared):
    """Which steady flow of the same hold-up a moving one has come to, or whether it was ``arrested``.

    ``distance`` is the largest relative difference in Q, h and T at the base from the nearest of ``steady``, and
    ``nearest`` its index; ``rate`` is that at which the logarithm of the distance changed in the last fifth of the
    time: negative where the flow approaches. At late times that is no rate of a mode: what is left then belongs to the
    continuous spectrum, which touches zero, and its slowest part on the grid of the integration depends on the grid.
    ``leading`` is the growth rate of the leading discrete mode of the nearest flow that is the same all along the
    chute, the mass mode set apart; None where none is resolved.
    """

    steady: tuple[Flow, ...]
    nearest: int | None
    distance: float
    rate: float
    arrested: bool
    leading: float | None = None


@dataclass(frozen=True, eq=False)
class Relaxation(Result):
    """A disturbed ``flow`` followed in time: the ``moments`` that the integration came by, the first of them the start,
    and the steady flow that it has come to."""

    flow: Flow
    moments: tuple[RelaxationState, ...]
    outcome: Outcome

    def __repr__(self) -> str:
        end = self.outcome
        came = "at rest" if end.arrested else None if end.nearest is None else f"{100.0 * end.distance:.2g} % away from"
        target = None if end.nearest is None or end.arrested else f"{came} {end.steady[end.nearest].name}"
        moments = display.count_of(len(self.moments), "moment")
        return display.line("Relaxation", moments, target or came, t=self.moments[-1].time)

    def _repr_html_(self) -> str:
        names = ("time", "mass_flux", "centre_of_mass", "surface_temperature", "base_temperature")
        rows = [[display.number(getattr(moment, name)) for name in names] for moment in self.moments]
        return display.html_table(repr(self)[1:-1], [SCALED[name].symbol for name in names], rows)


def relax(layer: Layer, state: Array, duration: float, tolerance: float = TOLERANCE) -> Iterator[RelaxationState]:
    """The states from ``state`` on for ``duration``, as the integration comes by them; the first is ``state`` itself.

    The integration is implicit, of order 5 (Radau), with the exact Jacobian. It ends early where the flow comes to
    rest: grains that lose more energy than the slope gives are densely packed, and still, after a finite time.

    Args:
        layer: the moving grains.
        state: where they start.
        duration: time, in sqrt(d/(g cos theta)).
        tolerance: relative error of each step in tau, u, w and T.

    Raises:
        SolveError: where the integration cannot continue.
    """
    stepper = Radau(
        lambda _, y: layer.rate(y),
        0.0,
        state,
        duration,
        jac=lambda _, y: layer.jacobian(y),
        rtol=tolerance,
        atol=1e-2 * tolerance,
    )
    step = on_one_thread(stepper.step)
    first = last = RelaxationState(0.0, *layer.numbers(state), state)
    yield first
    while stepper.status == "running" and not _at_rest(layer, first, last):
        with np.errstate(all="ignore"):
            step()
        if stepper.status == "failed" or not np.isfinite(stepper.y).all():
            raise SolveError(f"the flow cannot be followed beyond t = {stepper.t:.6g}: disturb it less")
        last = RelaxationState(float(stepper.t), *layer.numbers(stepper.y), stepper.y.copy())
        yield last


def _at_rest(layer: Layer, first: RelaxationState, last: RelaxationState) -> bool:
    return last.base_temperature < _COLD * first.base_temperature and layer.base_density(last.state) > _PACKED


@on_one_thread
@np.errstate(under="ignore")
def outcome(layer: Layer, moments: Sequence[RelaxationState]) -> Outcome:
    """Which steady flow the last of ``moments`` is nearest to, and whether it approaches."""
    steady = tuple(flows(layer.chute, M=layer.mass_holdup))
    last = moments[-1]
    arrested = _at_rest(layer, moments[0], last)
    if not steady:
        return Outcome(steady, None, float("inf"), 0.0, arrested)
    distances = [_distance(last, flow) for flow in steady]
    nearest = int(np.argmin(distances))
    before = next(moment for moment in moments if moment.time >= 0.8 * last.time)
    earlier, passed = _distance(before, steady[nearest]), last.time - before.time
    moved = earlier > 0.0 and distances[nearest] > 0.0 and passed > 0.0
    rate = np.log(distances[nearest] / earlier) / passed if moved else 0.0
    return Outcome(steady, nearest, distances[nearest], float(rate), arrested, leading_rate(steady[nearest]))


def leading_rate(flow: Flow) -> float | None:
    """Growth rate of the leading discrete mode of ``flow`` at k = 0 but for the mass mode; None where none is
    resolved."""
    try:
        found = leading(Disturbances(flow), 0.0, 0.0, count=2)
    except UnresolvedError:
        return None
    return next((mode.growth for mode in found if mode.kind != "mass"), None)


def _distance(moment: RelaxationState, flow: Flow) -> float:
    names = ("mass_flux", "centre_of_mass", "base_temperature")
    return max(abs(getattr(moment, name) / getattr(flow, name) - 1.0) for name in names)


def disturb(state: Array, temperature: float = 1.0, velocity: float = 1.0) -> Array:
    """``state`` with its granular temperature and its velocity multiplied, and its density as it is.

    Raises:
        InputError: for factors that are not positive, or above 1000.
    """
    temperature, velocity = number("temperature", temperature), number("velocity", velocity)
    for name, factor in (("temperature", temperature), ("velocity", velocity)):
        if not 0.0 < factor <= 1000.0:
            raise InputError(f"{name} times {factor:g}: the factor must be above 0 and at most 1000")
    out = state.reshape(FIELDS, -1).copy()
    out[1] *= velocity
    out[3] += np.log(temperature)
    return out.ravel()
