"""The flows of a whole curve in tables, between which a page without a server interpolates, and how exact that is.

Flows are evenly spaced along each branch, and their profiles have common heights, counted from 0 at the base to 1 at
the top of a flow. Between flows everything is a cubic of the position along the branch, between heights a straight
line. Flows solved half-way between tell how far off that is.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from chuteflow.branches.curve import curve
from chuteflow.branches.results import Branch, Curve
from chuteflow.explorer.straight import Sampler, straight_heights
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
#: Relative error allowed in the flows that are kept, and how far a straight line between two heights may be off, as a
#: share of the largest value of its field in its flow.
_TOLERANCE, _STRAIGHT = 1e-8, 5e-3
#: Flows by which the heights are chosen, and flows between those kept that are solved to tell the error, at most.
_CHOOSING, _CHECKED = 40, 120


@dataclass(frozen=True, eq=False)
class SampledBranch:
    """A branch in tables with one row for each of its flows.

    ``place`` (flows, 5) has the logarithms of Q, h, M, T_surface and the top; ``heights`` are shares of the top;
    ``fields`` is (flows, fields, heights); ``budget`` (flows, terms) what fluctuation energy is gained and lost.
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
    """How far what is interpolated is off, at worst, at the ``flows`` solved between those kept.

    ``place`` is relative, of Q, h, M, T_surface and the top at the same position along the branch; ``fields`` are
    shares of the largest value of a field in its flow, by symbol; ``budget`` is a share of its largest term.
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


def sampled(chute: Chute, points: int, surface_temperature: tuple[float, float], largest_holdup: float) -> SampledCurve:
    """Every flow of ``chute`` in a range, the longest branch with so many ``points``.

    Raises:
        InputError: for a range out of bounds.
        SolveError: where a branch could not be followed.
    """
    within = {"surface_temperature": surface_temperature, "largest_holdup": largest_holdup}
    kept = curve(chute, points=points, tolerance=_TOLERANCE, **within)
    between = curve(chute, points=2 * points - 1, tolerance=_TOLERANCE, **within)
    branches = tuple(map(_sampled, kept.branches))
    pairs = zip(branches, between.branches, strict=True)
    return SampledCurve(kept, branches, _worst([_deviation(one, other) for one, other in pairs]))


def interpolated(table: Array, positions: Array) -> Array:
    """Rows of a ``table`` at ``positions`` between them, by the cubic through the four rows nearest to each."""
    first = np.clip(np.floor(positions).astype(int) - 1, 0, len(table) - 4)
    rows = first + np.arange(4)[:, None]
    return np.einsum("kn,kn...->n...", lagrange(rows.astype(float), positions), table[rows])


def _sampled(branch: Branch) -> SampledBranch:
    flows = branch.flows
    chosen = flows[:: max(1, len(flows) // _CHOOSING)]
    heights = straight_heights([_field_sampler(flow) for flow in chosen], np.linspace(0.0, 1.0, 17), _STRAIGHT)[0]
    return SampledBranch(
        branch,
        np.array([_place(flow) for flow in flows]),
        heights,
        np.array([_field_sampler(flow)(heights) for flow in flows]),
        np.array([list(budget(flow).values()) for flow in flows]),
    )


def budget(flow: Flow) -> dict[str, float]:
    """What fluctuation energy the whole flow gains and loses, by term."""
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
    return lambda shares: fields(flow, shares * top)


def _deviation(kept: SampledBranch, between: Branch) -> Deviation:
    """What is off at flows of the same branch that are closer together."""
    flows = between.flows
    # Every second one, or fewer: where the branch is the longest, those are half-way between the flows that are kept.
    which = np.arange(1, len(flows) - 1, 2 * max(1, len(flows) // (2 * _CHECKED)))
    positions = which * (len(kept.place) - 1) / (len(flows) - 1)
    middles = np.sort(np.concatenate([kept.heights, 0.5 * (kept.heights[1:] + kept.heights[:-1])]))
    solved = [flows[i] for i in which.tolist()]
    place = np.abs(np.expm1(interpolated(kept.place, positions) - [_place(flow) for flow in solved]))
    told = interpolated(kept.budget, positions)
    terms = np.array([list(budget(flow).values()) for flow in solved])
    off = np.empty((len(solved), len(FIELDS)))
    for i, (flow, rows) in enumerate(zip(solved, interpolated(kept.fields, positions), strict=True)):
        exact = _field_sampler(flow)(middles)
        straight = np.array([np.interp(middles, kept.heights, row) for row in rows])
        off[i] = np.abs(straight - exact).max(axis=1) / np.abs(exact).max(axis=1)
    return Deviation(
        len(solved),
        float(place.max()),
        dict(zip(FIELDS, off.max(axis=0).tolist(), strict=True)),
        float((np.abs(told - terms).max(axis=1) / np.abs(terms).max(axis=1)).max()),
    )


def _worst(those: list[Deviation]) -> Deviation:
    return Deviation(
        sum(one.flows for one in those),
        max((one.place for one in those), default=0.0),
        {name: max((one.fields[name] for one in those), default=0.0) for name in FIELDS},
        max((one.budget for one in those), default=0.0),
    )
