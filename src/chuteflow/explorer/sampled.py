"""The flows of a whole curve in tables, between which a page without a server interpolates, and the error of that.

Flows are evenly spaced along each branch, and their profiles have common heights, counted from 0 at the base to 1 at
the top of a flow. Between flows everything is a cubic of the position along the branch, between heights a linear
line. Flows solved half-way between them give the error.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np

from chuteflow.branches.curve import curve
from chuteflow.branches.results import Branch, Curve
from chuteflow.explorer.heights import Sampler, refine_heights
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.interpolation import lagrange
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import PLACE

#: A flow without an interface is shown up to so many times the height of its centre of mass.
TOP = 2.5
#: Fields over height, by their symbols in the page's answers.
FIELDS = {
    "nu": "volume_fraction",
    "T": "granular_temperature",
    "u": "velocity",
    "production": "production",
    "dissipation": "dissipation",
}
#: Relative error allowed in the stored flows, and in linear interpolation between two heights, as a
#: fraction of the largest value of its field in its flow.
_TOLERANCE, _STRAIGHT = 1e-8, 5e-3
#: Flows by which the heights are chosen, and flows solved between the stored ones to estimate the error, at most.
_CHOOSING, _CHECKED = 40, 120


@dataclass(frozen=True, eq=False)
class SampledBranch:
    """A branch in tables with one row for each of its flows.

    ``place`` (flows, 5) has the logarithms of Q, h, M, T_surface and the top; ``heights`` are fractions of the top;
    ``fields`` is (flows, fields, heights); ``budget`` (flows, terms) gains and losses of fluctuation energy.
    """

    branch: Branch
    place: Array
    heights: Array
    fields: Array
    budget: Array

    @property
    def top(self) -> Array:
        """The height up to which each flow is shown."""
        return np.exp(self.place[:, -1])


@dataclass(frozen=True)
class Deviation:
    """The largest errors of the interpolation at the ``flows`` solved between the stored ones.

    ``place`` is relative, of Q, h, M, T_surface and the top at the same position along the branch; ``fields`` are
    fractions of the largest value of a field in its flow, by symbol; ``budget`` is a fraction of its largest term.
    """

    flows: int
    place: float
    fields: dict[str, float]
    budget: float


@dataclass(frozen=True, eq=False)
class SampledCurve:
    """The branches of a curve in tables, and their deviation from solved flows."""

    curve: Curve
    branches: tuple[SampledBranch, ...]
    deviation: Deviation


def sample_curve(
    chute: Chute, points: int, surface_temperature: tuple[float, float], largest_holdup: float
) -> SampledCurve:
    """Every flow of ``chute`` in a range, the longest branch with so many ``points``.

    Raises:
        InputError: for a range out of bounds.
        SolveError: where a branch could not be followed.
    """
    within = {"surface_temperature": surface_temperature, "largest_holdup": largest_holdup}
    between = curve(chute, points=2 * points - 1, tolerance=_TOLERANCE, **within)
    halves = all(len(branch.flows) % 2 for branch in between.branches)
    # A branch with an even number of flows has no half that ends where it does.
    stored = _every_second(between) if halves else curve(chute, points=points, tolerance=_TOLERANCE, **within)
    branches = tuple(map(_sample_branch, stored.branches))
    pairs = zip(branches, between.branches, strict=True)
    return SampledCurve(stored, branches, _largest([_deviation(one, other) for one, other in pairs]))


def _every_second(found: Curve) -> Curve:
    """The curve through every second flow, from end to end of each branch."""
    branches = []
    for branch in found.branches:
        flows = branch.flows[::2]
        special = (replace(one, position=min(one.position // 2, len(flows) - 2)) for one in branch.special)
        branches.append(replace(branch, flows=flows, special=tuple(special)))
    return replace(found, branches=tuple(branches))


def interpolate(table: Array, positions: Array) -> Array:
    """Rows of a ``table`` at ``positions`` between them, by the cubic through the four rows nearest to each."""
    first = np.clip(np.floor(positions).astype(int) - 1, 0, len(table) - 4)
    rows = first + np.arange(4)[:, None]
    return np.einsum("kn,kn...->n...", lagrange(rows.astype(float), positions), table[rows])


def _sample_branch(branch: Branch) -> SampledBranch:
    flows = branch.flows
    chosen = flows[:: max(1, len(flows) // _CHOOSING)]
    heights = refine_heights([_field_sampler(flow) for flow in chosen], np.linspace(0.0, 1.0, 17), _STRAIGHT)[0]
    return SampledBranch(
        branch,
        np.array([_place(flow) for flow in flows]),
        heights,
        np.array([_field_sampler(flow)(heights) for flow in flows]),
        np.array([list(budget(flow).values()) for flow in flows]),
    )


def budget(flow: Flow) -> dict[str, float]:
    """The budget of fluctuation energy of the whole flow, by term."""
    return asdict(flow.energy_budget) | {"heat_from_base": flow.energy_budget.heat_from_base}


def fields(flow: Flow, heights: Array) -> Array:
    """The fields (fields, heights) that the page shows."""
    profile = flow.profile(heights)
    return np.array([getattr(profile, name) for name in FIELDS.values()])


def _top(flow: Flow) -> float:
    return flow.interface_height if np.isfinite(flow.interface_height) else TOP * flow.centre_of_mass


def _place(flow: Flow) -> Array:
    return np.log([*(getattr(flow, name) for name in PLACE), _top(flow)])


def _field_sampler(flow: Flow) -> Sampler:
    top = _top(flow)
    return lambda fractions: fields(flow, fractions * top)


def _deviation(stored: SampledBranch, between: Branch) -> Deviation:
    """Errors at flows of the same branch that are closer together."""
    flows = between.flows
    # Every second one, or fewer: on the longest branch, those are half-way between the stored flows.
    which = np.arange(1, len(flows) - 1, 2 * max(1, len(flows) // (2 * _CHECKED)))
    positions = which * (len(stored.place) - 1) / (len(flows) - 1)
    middles = np.sort(np.concatenate([stored.heights, 0.5 * (stored.heights[1:] + stored.heights[:-1])]))
    solved = [flows[i] for i in which.tolist()]
    place = np.abs(np.expm1(interpolate(stored.place, positions) - [_place(flow) for flow in solved]))
    estimated = interpolate(stored.budget, positions)
    terms = np.array([list(budget(flow).values()) for flow in solved])
    errors = np.empty((len(solved), len(FIELDS)))
    for i, (flow, rows) in enumerate(zip(solved, interpolate(stored.fields, positions), strict=True)):
        exact = _field_sampler(flow)(middles)
        linear = np.array([np.interp(middles, stored.heights, row) for row in rows])
        errors[i] = np.abs(linear - exact).max(axis=1) / np.abs(exact).max(axis=1)
    return Deviation(
        len(solved),
        float(place.max()),
        dict(zip(FIELDS, errors.max(axis=0).tolist(), strict=True)),
        float((np.abs(estimated - terms).max(axis=1) / np.abs(terms).max(axis=1)).max()),
    )


def _largest(those: list[Deviation]) -> Deviation:
    return Deviation(
        sum(one.flows for one in those),
        max((one.place for one in those), default=0.0),
        {name: max((one.fields[name] for one in those), default=0.0) for name in FIELDS},
        max((one.budget for one in those), default=0.0),
    )
