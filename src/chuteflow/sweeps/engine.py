"""One chunk of a study: its points to arrays, the same to the last bit wherever and whenever it is computed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.branches.enumeration import solve_within
from chuteflow.branches.ranges import SearchRange
from chuteflow.errors import ChuteflowError, InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import BY_KEY
from chuteflow.steady.chute import SURFACES, Chute
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T
from chuteflow.sweeps.bases import Flows, solve_at_temperature
from chuteflow.sweeps.batch import Batch, Indices
from chuteflow.sweeps.numbers import KINDS, ONE_BY_ONE, evaluate_quantities
from chuteflow.sweeps.outcome import Flags, PointStatus, Reason, reasons
from chuteflow.sweeps.stability import STABILITY_KINDS, STABILITY_NUMBERS, needs_stability, stability_quantities
from chuteflow.sweeps.study import RANGES, Study
from chuteflow.theory.bases import BASES
from chuteflow.theory.constitutive import Law, require_positive

_WHICH = {"Q": LOG_Q, "h": LOG_H, "M": LOG_M, "T_surface": LOG_T}
#: Restitutions between which a law is taken to keep its meaning where it does at both.
_RESTITUTIONS = 257
#: What a calculation may end with that is no reason to stop the others.
_FAILURES = (ChuteflowError, ArithmeticError, ValueError, LookupError)


@dataclass(frozen=True, eq=False)
class Chunk:
    """The points of a chunk: ``parameters`` by name (n,), ``status``, ``reason`` and ``n_flows`` (n,), ``error`` and
    the ``quantities`` (n, flows); ``failures`` says of the points that failed why. ``singly`` is how many points were
    solved one by one."""

    parameters: Mapping[str, Array]
    status: Flags
    reason: Flags
    n_flows: NDArray[np.int32]
    error: Array
    quantities: Mapping[str, NDArray[Any]]
    failures: Mapping[int, str]
    singly: int

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """All arrays by the names that they have in a store."""
        return {
            **self.parameters,
            "status": self.status,
            "reason": self.reason,
            "n_flows": self.n_flows,
            "error": self.error,
            **self.quantities,
        }


def solve_chunk(study: Study, chunk: int) -> Chunk:
    """All points of chunk number ``chunk``."""
    first, last = study.extent(chunk)
    out = _empty(study, study.design.rows(first, last), last - first)
    failures: dict[int, str] = {}
    valid = _valid(study, out.parameters, failures)
    out.status[~valid] = PointStatus.INVALID
    out.reason[~valid] = Reason.NO_ANSWER
    batched = valid & _in_batches(study, out.parameters)
    searched = valid & ~batched
    batches = list(_batches(study, out.parameters, batched))
    for batch, points in batches:
        solved = _solved(study, batch, out.parameters["T_surface"][points])
        _fill(study, out, points, solved)
        searched[points[solved.unsettled]] = True
    for point in np.flatnonzero(searched).tolist():
        _fill_singly(study, out, point, failures)
    none = (out.n_flows == 0) & (out.status == PointStatus.COMPLETE)
    others = _on_other_bases(study, out.parameters)
    out.reason[none & others] = Reason.NONE_FOUND_IN_THE_RANGE_SEARCHED
    # What is proved is known of the base of the paper.
    for batch, points in [*batches, *_batches(study, out.parameters, none & ~batched & ~others)]:
        some = np.flatnonzero(none[points])
        if some.size:
            out.reason[points[some]] = reasons(batch.take(some))
    found_failures = {first + i: why for i, why in sorted(failures.items())}
    return replace(out, failures=found_failures, singly=int(searched.sum()))


def _in_batches(study: Study, parameters: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Which points are integrated in batches: at given surface temperatures, where nothing has to be searched for, on
    the base of the paper, with laws without breaks, at which integration in a batch would lose its order; and for
    quantities that batches compute."""
    asked = set(study.quantities)
    if study.condition != "T_surface" or needs_stability(study.quantities) or not asked.isdisjoint(ONE_BY_ONE):
        return np.zeros(len(parameters["closure"]), dtype=bool)
    smooth = np.isin(parameters["closure"], [i for i, law in enumerate(study.laws) if law.smooth])
    return smooth & ~_on_other_bases(study, parameters)


def _empty(study: Study, parameters: dict[str, Array], n: int) -> Chunk:
    grid = (n, study.flows)
    return Chunk(
        parameters=parameters,
        status=np.full(n, PointStatus.COMPLETE, dtype=np.int8),
        reason=np.zeros(n, dtype=np.int8),
        n_flows=np.zeros(n, dtype=np.int32),
        error=np.full(grid, np.nan),
        quantities={
            name: np.full(grid, -1, dtype=np.int8) if name in KINDS else np.full(grid, np.nan)
            for name in study.quantities
        },
        failures={},
        singly=0,
    )


def _valid(study: Study, parameters: Mapping[str, Array], failures: dict[int, str]) -> NDArray[np.bool_]:
    """Which points are chutes with a condition in range; why the others are not, into ``failures``."""
    valid = np.ones(len(parameters["slope"]), dtype=bool)
    for name in (*BY_KEY, study.condition):
        low, high = RANGES[name]
        off = ~((parameters[name] >= low) & (parameters[name] <= high))
        for i in np.flatnonzero(off & valid).tolist():
            failures[i] = f"{name} = {parameters[name][i]:g}: must be from {low:g} to {high:g}"
        valid &= ~off
    for i in np.flatnonzero(valid & ~_surely_meaningful(study, parameters, valid)).tolist():
        try:
            chosen = study.laws[int(parameters["closure"][i])]
            require_positive(chosen, float(parameters["e"][i]), float(parameters["slope"][i]))
        except InputError as error:
            valid[i] = False
            failures[i] = str(error)
    return valid


def _surely_meaningful(study: Study, parameters: Mapping[str, Array], valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where the law has a meaning at a slightly smaller and a slightly larger restitution, and for every slope."""
    place = np.where(valid, parameters["e"], 0.0) * (_RESTITUTIONS - 1)
    below, above = np.floor(place).astype(np.intp), np.ceil(place).astype(np.intp)
    out = np.zeros(len(valid), dtype=bool)
    for i, chosen in enumerate(study.laws):
        if not chosen.knows_slope and (parameters["closure"] == i).any():
            good = _meaningful(chosen)
            out |= (parameters["closure"] == i) & good[below] & good[above]
    return out


@lru_cache(maxsize=8)
def _meaningful(closure: Law) -> NDArray[np.bool_]:
    """Whether a law that does not know the slope has a meaning at evenly spaced restitutions from 0 to 1."""
    good = np.zeros(_RESTITUTIONS, dtype=bool)
    for i in range(1, _RESTITUTIONS):
        try:
            require_positive(closure, i / (_RESTITUTIONS - 1), 1.0)
        except InputError:
            continue
        good[i] = True
    return good


def _batches(study: Study, parameters: Mapping[str, Array], some: NDArray[np.bool_]) -> Iterator[tuple[Batch, Indices]]:
    """Batches of some of the points (n,), which share closure and surface, and these points."""
    for i, closure in enumerate(study.laws):
        for j, surface in enumerate(SURFACES):
            points = np.flatnonzero(some & (parameters["closure"] == i) & (parameters["surface"] == j))
            if points.size:
                roughness = np.minimum(parameters["roughness"][points], BY_KEY["roughness"].high)
                slope, e, ew = (np.ascontiguousarray(parameters[name][points]) for name in ("slope", "e", "ew"))
                yield Batch.of(closure, surface, slope, e, ew, roughness), points


@dataclass(frozen=True, eq=False)
class _Solved:
    """Every flow of a batch (k,), its quantities by name (k,), and the members (n,) to be solved one by one."""

    flows: Flows
    quantities: Mapping[str, Array]
    unsettled: NDArray[np.bool_]


def _solved(study: Study, batch: Batch, temperature: Array) -> _Solved:
    """Every flow of the batch at the surface temperatures (n,)."""
    try:
        flows, unsettled = solve_at_temperature(batch, temperature, study.largest_holdup, study.tolerance)
        return _sound(_Solved(flows, evaluate_quantities(study.quantities, batch, flows), unsettled))
    except _FAILURES:
        if len(batch) == 1:
            return _Solved(Flows.joined([]), dict.fromkeys(study.quantities, np.empty(0)), np.ones(1, dtype=bool))
    # One member must not keep the others from being solved: it is found by halves.
    half = len(batch) // 2
    members = np.arange(len(batch))
    one, two = (_solved(study, batch.take(some), temperature[some]) for some in (members[:half], members[half:]))
    return _Solved(
        Flows.joined([one.flows, replace(two.flows, member=two.flows.member + half)]),
        {name: np.concatenate([one.quantities[name], two.quantities[name]]) for name in study.quantities},
        np.concatenate([one.unsettled, two.unsettled]),
    )


def _sound(solved: _Solved) -> _Solved:
    """Without the members on which a quantity is not a number: they are solved one by one."""
    good = np.ones(solved.flows.member.size, dtype=bool)
    for values in solved.quantities.values():
        good &= ~np.isnan(values)
    if good.all():
        return solved
    unsettled = solved.unsettled.copy()
    unsettled[solved.flows.member[~good]] = True
    kept = ~unsettled[solved.flows.member]
    values = {name: value[kept] for name, value in solved.quantities.items()}
    return _Solved(solved.flows.take(kept), values, unsettled)


def _fill(study: Study, out: Chunk, points: Indices, solved: _Solved) -> None:
    """Put flows, in order of members and along each from hot to cold, into the rows of their points."""
    flows = solved.flows
    counts = np.bincount(flows.member, minlength=len(points))
    out.n_flows[points] = counts
    out.status[points[counts > study.flows]] = PointStatus.MORE_FLOWS_THAN_KEPT
    place = np.arange(flows.member.size) - (np.cumsum(counts) - counts)[flows.member]
    kept = place < study.flows
    where = points[flows.member[kept]], place[kept]
    out.error[where] = flows.error[kept]
    for name, values in solved.quantities.items():
        out.quantities[name][where] = values[kept]


def _on_other_bases(study: Study, parameters: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Which points have another base than that of the paper."""
    others = [i for i, one in enumerate(study.bases) if one != BASES["richman"]]
    return np.isin(parameters["base"], others) if others else np.zeros(len(parameters["slope"]), dtype=bool)


def _fill_singly(study: Study, out: Chunk, point: int, failures: dict[int, str]) -> None:
    """Solve one point by the search of :func:`chuteflow.flows`."""
    p = out.parameters
    slope, e, ew, roughness = (float(p[name][point]) for name in BY_KEY)
    surface, closure = SURFACES[int(p["surface"][point])], study.laws[int(p["closure"][point])]
    base = study.bases[int(p["base"][point]) if "base" in p else 0]
    which, value = _WHICH[study.condition], float(p[study.condition][point])
    # Of this chute nothing else is asked.
    within = SearchRange.checked(study.surface_temperature, study.largest_holdup, surface).restrict(which, value)
    try:
        chute = Chute(slope, e, ew, roughness, surface, closure, base)
        found = solve_within(chute, which, value, study.tolerance, within)
    except _FAILURES as error:
        out.status[point], out.reason[point] = PointStatus.FAILED, Reason.NO_ANSWER
        failures[point] = str(error) or type(error).__name__
        return
    out.n_flows[point] = len(found)
    if len(found) > study.flows:
        out.status[point] = PointStatus.MORE_FLOWS_THAN_KEPT
    for k, flow in enumerate(found[: study.flows]):
        out.error[point, k] = flow.error
        known, why = stability_quantities(flow) if needs_stability(study.quantities) else ({}, None)
        if why is not None:
            failures[point] = why
        for name, values in out.quantities.items():
            if name in STABILITY_KINDS or name in STABILITY_NUMBERS:
                values[point, k] = known.get(name, values[point, k])
                continue
            value = getattr(flow, name)
            values[point, k] = KINDS[name].index(value) if name in KINDS else value
