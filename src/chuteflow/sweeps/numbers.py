"""Quantities of the registry, and kinds, of many flows at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q
from chuteflow.steady.flow import CUTOFF
from chuteflow.steady.kinds import DENSITIES, INTERIORS
from chuteflow.sweeps.bases import Flows
from chuteflow.sweeps.batch import HEIGHT, LOG_P, LOG_X, Batch, Indices, Pointwise
from chuteflow.sweeps.marching import Accuracy, Ends, march, start
from chuteflow.sweeps.stability import STABILITY_KINDS

#: Names of kinds in the order of their flags.
KINDS: dict[str, tuple[str, ...]] = {"interior": INTERIORS, "density": DENSITIES, **STABILITY_KINDS}
#: With which flows are examined again for what happens on the way to the base.
_ACCURACY = Accuracy(1e-10, 1e-7)
#: Net loss within this of zero, in its largest value on the way, decides nothing.
_DECIDES = 1e-9
#: Quantities that are not computed in batches: studies that ask for them are solved one by one.
ONE_BY_ONE = ("surface_velocity", "mean_volume_fraction")


def evaluate_quantities(names: Sequence[str], batch: Batch, flows: Flows) -> dict[str, Array]:
    """The quantities ``names`` of the flows, (k,) each; kinds as their places among KINDS."""
    of = batch.take(flows.member)
    plain = {
        "mass_flux": lambda: np.exp(flows.macroscopic[LOG_Q]),
        "centre_of_mass": lambda: np.exp(flows.macroscopic[LOG_H]),
        "mass_holdup": lambda: np.exp(flows.macroscopic[LOG_M]),
        "surface_temperature": lambda: flows.temperature,
        "base_temperature": lambda: of.at_state(flows.state).temperature,
        "base_volume_fraction": lambda: of.at_state(flows.state).nu,
        "slip_velocity": lambda: _slip(of.at_state(flows.state)),
        "mean_velocity": lambda: _mean_velocity(flows),
        "angle": lambda: np.degrees(np.arctan(of.slope)),
    }
    out: dict[str, Array] = {name: value() for name, value in plain.items() if name in names}
    rest = set(names) - set(plain)
    if rest and flows.member.size:
        inside = InteriorQuantities(of, flows)
        further: dict[str, Callable[[], Array]] = {
            "largest_volume_fraction": lambda: inside.largest,
            "depth": lambda: inside.depth,
            "interface_height": lambda: inside.top,
            "froude_number": lambda: _mean_velocity(flows) / np.sqrt(inside.depth),
            "interior": lambda: inside.interior,
            "density": lambda: inside.inverted,
        }
        out |= {name: value() for name, value in further.items() if name in rest}
    elif rest:
        out |= {name: np.empty(0) for name in rest}
    return out


def _slip(at: Pointwise) -> Array:
    return at.slip * np.sqrt(at.temperature)


def _mean_velocity(flows: Flows) -> Array:
    return np.exp(flows.macroscopic[LOG_Q] - flows.macroscopic[LOG_M])


class InteriorQuantities:
    """What happens between the surface and the base of flows, each on a member of its own."""

    def __init__(self, of: Batch, flows: Flows) -> None:
        self._of, self._flows = of, flows
        self._ends = Ends.of(of, np.exp(flows.state[LOG_P]) * (1.0 + 1e-12))
        self._first, _ = start(of, flows.temperature, self._ends.rate, _ACCURACY.start)
        # Where the density turns: v = 1.
        self._turns = self._march(lambda at, _: at.v - 1.0)
        first, base = np.exp(self._first[LOG_X]), of.at_state(flows.state).nu
        largest = np.maximum(first / (1.0 + first / of.law.densest), base)
        member, state = self._turns
        if member.size:
            np.maximum.at(largest, member, of.take(member).at_state(state).nu)
        self.largest: Array = largest

    def _march(self, event: Callable[[Pointwise, Indices], Array]) -> tuple[Indices, Array]:
        found = march(self._of, self._flows.temperature, self._ends, _ACCURACY, event)
        above = found.state[LOG_P] < self._flows.state[LOG_P, found.member]
        return found.member[above], found.state[:, above]

    @property
    def inverted(self) -> Array:
        """1 where the volume fraction rises with height anywhere: where it falls downwards at a turn or the base."""
        out = self._of.at_state(self._flows.state).v > 1.0
        out |= self._of.at_state(self._first).v > 1.0
        out[self._turns[0]] = True
        return out.astype(float)

    @property
    def interior(self) -> Array:
        """Places among INTERIORS."""
        nets = [self._of.at_state(self._first).net, self._of.at_state(self._flows.state).net]
        size = np.maximum(np.abs(nets[0]), np.abs(nets[1]))
        member, _ = self._march(lambda at, _: at.net)
        gains = (nets[0] < -_DECIDES * size) | (nets[1] < -_DECIDES * size)
        loses = (nets[0] > _DECIDES * size) | (nets[1] > _DECIDES * size)
        gains[member] = loses[member] = True
        return np.where(gains & loses, 1.0, np.where(gains, 2.0, 0.0))

    @property
    def top(self) -> Array:
        """Height of the interface, infinite on the half-line."""
        if self._of.surface_stress == 0.0:
            return np.full(len(self._of), np.inf)
        return self._flows.state[HEIGHT].copy()

    @property
    def depth(self) -> Array:
        """Height above which the density is below CUTOFF of the largest, or of the interface where it stays above."""
        target = np.log(CUTOFF * self.largest)
        log_nu = self._first[LOG_X] - np.log1p(np.exp(self._first[LOG_X]) / self._of.law.densest)
        # z is counted from the start of the integration, and so is that of the base here.
        base = self._flows.state[LOG_P]
        whole = march(self._of, self._flows.temperature, self._ends, _ACCURACY, lambda at, i: np.log(at.p) - base[i])
        bottom = np.full(len(self._of), np.nan)
        bottom[whole.member] = whole.state[HEIGHT]
        out = bottom - self._first[HEIGHT]
        member, state = self._march(lambda at, members: np.log(at.nu) - target[members])
        # The first such place from the surface down; it is there unless the density begins above the target.
        order = np.lexsort((-state[LOG_P], member))
        height = np.full(len(self._of), np.nan)
        height[member[order]] = state[HEIGHT, order]
        below = log_nu < target
        out[below] = (bottom - height)[below]
        if self._of.surface_stress == 0.0:
            # Above the start of the integration z runs as -T ln p.
            above = ~below
            rise = log_nu[above] - target[above]
            out[above] += self._flows.temperature[above] * rise
        return out
