"""Every boundary of a kind over a range of a second parameter: entered at several values of it, and followed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, overload

import numpy as np

from chuteflow import display
from chuteflow.bifurcations import starting_points
from chuteflow.bifurcations.points import BoundaryPoint
from chuteflow.bifurcations.starting_points import may_follow
from chuteflow.bifurcations.system import SecondParameter
from chuteflow.bifurcations.tracing import CONTROL, BoundaryTracing, TracedBoundary, trace_boundary
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.results import Searched
from chuteflow.branches.solution_branches import TracedBranch
from chuteflow.checks import pair, whole
from chuteflow.errors import InputError, SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.continuation import ContinuationSettings
from chuteflow.parameters import LARGEST_HOLDUP, PARAMETERS, SURFACE_TEMPERATURE
from chuteflow.progress import report_progress
from chuteflow.result import Compared, Result, from_above
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.line import LineOfFlows
from chuteflow.steady.quantities import NUMBERS, PLACE
from chuteflow.steady.solver import TOLERANCE, check_tolerance
from chuteflow.theory.constitutive import require_height
from chuteflow.threads import on_one_thread

#: What can be followed.
KINDS = starting_points.KINDS
#: Values of the parameter at which boundaries are entered, by default.
SAMPLES = 13
#: A value at which branches cannot be distinguished is moved by so many spacings, in turn.
_ASIDE = (0.0, 0.07, -0.11)


@dataclass(frozen=True, eq=False)
class Turning(Compared):
    """A turning point of a boundary in its second parameter: ``kind`` is one of TURNS, ``flow`` the flow there,
    ``error`` the estimated relative error, ``position`` the index of the point of the boundary before it."""

    kind: str
    flow: Flow
    error: float
    position: int

    def __repr__(self) -> str:
        return display.line("Turning", self.kind, repr(self.flow.chute), Q=self.flow.mass_flux, error=self.error)


@dataclass(frozen=True, eq=False)
class Boundary(Result, LineOfFlows):
    """Flows of one kind of special point, in order as the ``second`` parameter of their chutes varies.

    ``error`` (k,) are the estimated relative errors, the largest of Q, h, M and the parameter; ``special`` are
    the turning points; ``ends`` says in words why the boundary ends at either side.
    """

    kind: str
    second: str
    flows: tuple[Flow, ...]
    error: Array
    special: tuple[Turning, ...]
    ends: tuple[str, str]
    traced: TracedBoundary = field(repr=False, compare=False)

    def __repr__(self) -> str:
        turns = display.count_of(len(self.special), "turning point")
        reach = (display.span(self.second, self.parameter), display.span("Q", self.mass_flux))
        points = display.count_of(len(self.flows), "point")
        return display.line("Boundary", f"{self.kind} in {self.second}", f"{points}, {turns}", *reach)

    def _repr_html_(self) -> str:
        columns = [self.parameter, *(getattr(self, name) for name in PLACE), self.error]
        rows = [[display.number(value) for value in row] for row in zip(*columns, strict=True)]
        header = [self.second, *(NUMBERS[name].symbol for name in PLACE), "error"]
        return display.html_table(repr(self)[1:-1], header, rows)

    def at(self, value: float, tolerance: float = TOLERANCE) -> list[Flow]:
        """The flows of the boundary whose second parameter has a ``value``, in order along it.

        Raises:
            SolveError: where one could not be solved to ``tolerance``.
        """
        return [point.flow for point in self.traced.at(value, tolerance)]

    @cached_property
    def parameter(self) -> Array:
        """The second parameter along the boundary, (k,)."""
        return np.array([getattr(flow.chute, self.second) for flow in self.flows])

    @property
    def cusps(self) -> tuple[Turning, ...]:
        """The cusps among the turning points."""
        return tuple(turn for turn in self.special if turn.kind == "cusp")


@dataclass(frozen=True, eq=False)
class BoundarySet(Result, Sequence[Boundary]):
    """Every boundary that was found, the longest first.

    ``chute`` gives the other parameters; ``bounds`` is the range of the ``second``, ``sampled`` the values of it at
    which boundaries were entered, and ``families`` those of the flows there. ``skipped`` are the values at which
    branches could not be distinguished. ``reason`` says why there is none.

    Complete is this: every boundary is found that passes a sampled value on a branch in the range searched, and
    is followed from end to end. One that begins and ends between two sampled values is searched for from both,
    where flows come nearest to it; it could be missed if neither shows a sign of it, as where a whole branch
    of flows exists between them alone.
    """

    chute: Chute
    kind: str
    second: str
    bounds: tuple[float, float]
    boundaries: tuple[Boundary, ...]
    sampled: tuple[float, ...]
    families: tuple[tuple[TracedBranch, ...], ...] = field(repr=False, compare=False)
    skipped: tuple[float, ...]
    searched: Searched
    tolerance: float
    reason: str | None

    def plot(self, *, scales: Any = None, **options: Any) -> Any:
        """Draw the boundaries over the second parameter and a ``quantity``, one of those that place a flow on a curve;
        the mass flux by default.

        Returns matplotlib's axes; see :meth:`chuteflow.result.Result.plot`.
        """
        from chuteflow.bifurcations.diagram import diagram

        quantity = options.pop("quantity", "mass_flux")
        if quantity not in PLACE:
            raise InputError(f"quantity = {quantity!r}: choose one of {', '.join(PLACE)}")
        shown = diagram(self, quantity) if len(self) else self
        return from_above("plotting.axes", "plot")(shown, scales=scales, **options)

    @cached_property
    def incomplete(self) -> str | None:
        """Which flows boundaries were not followed among, in words; None where there are none."""
        solutions = (solution for branches in self.families for branch in branches for solution in branch.solutions)
        if all(may_follow(solution) for solution in solutions):
            return None
        return (
            "some deep flows wind more than a grid of few pieces resolves: boundaries among these are not followed, "
            "and may be missing"
        )

    def __repr__(self) -> str:
        count = display.count_of(len(self), "boundary", "boundaries")
        bounds = f"{self.second} from {display.number(self.bounds[0])} to {display.number(self.bounds[1])}"
        return display.line("BoundarySet", f"{count} of {self.kind}", bounds, self.reason)

    def _repr_html_(self) -> str:
        rows = [
            [
                *(str(i), display.count_of(len(one.flows), "point"), display.span(self.second, one.parameter)),
                *(display.span("Q", one.mass_flux), ", ".join(turn.kind for turn in one.special), *one.ends),
            ]
            for i, one in enumerate(self, 1)
        ]
        header = ["", "points", self.second, "Q", "turning points", "begins at", "ends at"]
        return display.html_table(repr(self)[1:-1], header, rows, self.reason)

    def __len__(self) -> int:
        return len(self.boundaries)

    @overload
    def __getitem__(self, index: int) -> Boundary: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Boundary]: ...
    def __getitem__(self, index: int | slice) -> Boundary | Sequence[Boundary]:
        return self.boundaries[index]

    def __iter__(self) -> Iterator[Boundary]:
        return iter(self.boundaries)


@on_one_thread
@np.errstate(under="ignore")
def boundary(
    chute: Chute,
    *,
    of: str = "fold-Q",
    second: str = "slope",
    bounds: tuple[float, float],
    samples: int = SAMPLES,
    tolerance: float = TOLERANCE,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
    control: ContinuationSettings = CONTROL,
    progress: Callable[[str, float], object] | None = None,
) -> BoundarySet:
    """Follow every boundary of a kind over a range of a second parameter, through its turning points.

    Args:
        chute: the chute; its ``second`` parameter is not used.
        of: what to follow, one of KINDS: a fold, the onset of density inversion, or a change of interior.
        second: "slope", "restitution", "wall_restitution" or "roughness".
        bounds: the range of the second parameter.
        samples: values of it, evenly over the range, at which all branches of flows are searched for points of
            boundaries, and for signs of boundaries beside them; each is then followed over the whole range, once.
        tolerance: relative error allowed in Q, h, M and the second parameter, from 1e-11 to 1e-3.
        surface_temperature: range of T_surface.
        largest_holdup: largest M.
        control: steps of the continuation.
        progress: called with what is being done and the fraction of the range that is done; without it, a terminal or
            notebook shows a line.

    Raises:
        InputError: for an unknown kind or parameter, or a range or number out of bounds.
        SolveError: where a boundary could not be followed or a point not solved to the tolerance.
    """
    if progress is None:
        with report_progress("boundary", None) as tell:
            return boundary(
                chute,
                of=of,
                second=second,
                bounds=bounds,
                samples=samples,
                tolerance=tolerance,
                surface_temperature=surface_temperature,
                largest_holdup=largest_holdup,
                control=control,
                progress=lambda what, fraction: tell(fraction),
            )
    sweep = _check_second(chute, of, second, bounds)
    samples = whole("samples", samples, 2, 1000)
    tolerance = check_tolerance(tolerance)
    within = SearchRange.checked(surface_temperature, largest_holdup, chute.surface)
    found: list[TracedBoundary] = []
    sampled: list[float] = []
    entered: list[tuple[TracedBranch, ...]] = []
    skipped: list[float] = []

    def follow(points: Iterator[BoundaryPoint], fraction: float) -> None:
        for point in points:
            inside = within.contains(point.flow.solution.macroscopic)
            if inside and not any(other.holds(point) for other in found):
                notice = partial(progress, "following", fraction)
                line = trace_boundary(point, BoundaryTracing(within, tolerance, control, notice))
                # A point that could not be distinguished from those of a known line has led to it again.
                if not any(line.repeats(other) for other in found):
                    found[:] = [other for other in found if not other.repeats(line)] + [line]

    values = np.linspace(sweep.low, sweep.high, samples).tolist()
    spacing = (sweep.high - sweep.low) / (samples - 1)
    for i, value in enumerate(values):
        fraction = i / samples
        progress("searching", fraction)
        branches, value = _branches_at(sweep, value, spacing, within)
        if branches is None:
            skipped.append(value)
            continue
        sampled.append(value)
        entered.append(tuple(branches))
        for condition in starting_points.make_test_functions(of):
            follow(starting_points.find_on_branches(sweep, condition, value, branches, spacing, tolerance), fraction)
    for condition in starting_points.make_test_functions(of):
        for low, high in pairwise(values):
            for value in starting_points.find_values_for_all_flows(sweep, condition, low, high):
                branches = starting_points.trace_branches_at(sweep, value, within)
                follow(starting_points.find_along_branches(sweep, condition, value, branches, tolerance), 1.0)
    boundaries = sorted((as_boundary(of, second, b) for b in found), key=lambda b: -len(b.flows))
    return BoundarySet(
        chute=chute,
        kind=of,
        second=second,
        bounds=(sweep.low, sweep.high),
        boundaries=tuple(boundaries),
        sampled=tuple(sampled),
        families=tuple(entered),
        skipped=tuple(skipped),
        searched=Searched((within.coldest, within.hottest), within.deepest),
        tolerance=tolerance,
        reason=None if boundaries else f"no branch of flows in the range searched has a point of the kind {of}",
    )


def _check_second(chute: Chute, of: str, second: str, bounds: tuple[float, float]) -> SecondParameter:
    if of not in KINDS:
        raise InputError(f"cannot follow {of!r}: choose one of {', '.join(KINDS)}")
    if second not in PARAMETERS:
        raise InputError(f"unknown second parameter {second!r}: choose one of {', '.join(PARAMETERS)}")
    low, high = pair("bounds", bounds)
    sweep = SecondParameter(chute, second, low, high)
    for value in (low, high):
        end = sweep.chute_at(value)  # which says what is allowed
        if end.surface == "free":
            require_height(end.law, end.restitution, end.slope)
    if not low < high:
        raise InputError(f"{second} from {low:g} to {high:g}: the range must rise")
    return sweep


def _branches_at(
    sweep: SecondParameter, value: float, spacing: float, within: SearchRange
) -> tuple[list[TracedBranch] | None, float]:
    """The branches of flows at a value of the parameter, or close by where they cannot be distinguished just there."""
    for aside in _ASIDE:
        beside = float(np.clip(value + aside * spacing, sweep.low, sweep.high))
        try:
            return starting_points.trace_branches_at(sweep, beside, within), beside
        except SolveError:
            continue
    return None, value


def as_boundary(kind: str, second: str, found: TracedBoundary) -> Boundary:
    """A boundary that was traced, of a ``kind`` and through a ``second`` parameter."""
    return Boundary(
        kind=kind,
        second=second,
        flows=tuple(point.flow for point in found.points),
        error=np.array([point.error for point in found.points]),
        special=tuple(Turning(t.kind, t.point.flow, t.point.error, t.position) for t in found.turns),
        ends=found.ends,
        traced=found,
    )
