"""Calibration: the parameters of a chute from measurements, how sure they are, and whether the theory fits at all."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from chuteflow import display
from chuteflow.branches.enumeration import flows
from chuteflow.checks import number, shorten, whole
from chuteflow.errors import InputError, SolveError
from chuteflow.fitting.direct import DirectMeasurement, direct
from chuteflow.fitting.identifiability import trade_offs
from chuteflow.fitting.intervals import BetterFit, Interval, interval
from chuteflow.fitting.measurements import Measurements, Series
from chuteflow.fitting.objective import LOSSES, Minimum, Objective
from chuteflow.fitting.residuals import TrialChute, TrialFlow
from chuteflow.fitting.starts import MANY_TRIALS, StartingPoint, at, candidates
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import BY_KEY
from chuteflow.progress import report_progress
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.free import FreeParameter, choose_parameters, vary
from chuteflow.threads import on_one_thread

#: Evaluations in a first fit from each start, in a second one of those that may be the best, and in the last; and the
#: tolerances of their sums of squares.
_FIRST, _SECOND, _LAST = 5, 12, 60
_ROUGHLY, _CLOSELY = 1e-3, 1e-8
#: Relative errors that are allowed of a number that is known exactly, to pass through a fold of it: on the way to a
#: fit, and for intervals. A fold is near where its logarithm changes by less per arclength of the branch.
_LENIENT, _TIGHT, _FLAT = 0.01, 0.002, 0.15
#: First fits that are this many times worse than the best are given up.
_HOPELESS = 30.0
#: Confidence of intervals by default.
CONFIDENCE = 0.95
#: Trial chutes at most.
_MOST_TRIALS = 100_000
#: Passes over the parameters in which what fits for one widens the interval of another.
_PASSES = 3
#: Rounds in which intervals come upon a better fit.
_ROUNDS = 4
#: Parameters of two fits that differ by less, in their errors, are the same; flows by less in ln Q, h, M and T.
_SAME, _SAME_FLOW = 0.2, 0.3
#: Minima are told of that are worse by so many times what the confidence allows at most.
_MAY_FIT = 6.0
#: Fits whose parameters differ by less, in their likely ranges, lead to the same minimum.
_NEAR = 0.05


@dataclass(frozen=True)
class Estimate:
    """One parameter: its value, standard error and confidence interval.

    ``determined`` is whether the data end the interval on both sides.
    """

    key: str
    value: float
    error: float
    interval: Interval

    @property
    def determined(self) -> bool:
        """Whether the data end the interval on both sides."""
        return self.interval.bounded

    @property
    def said(self) -> str:
        """What the data say of it, in words."""
        low, high = display.number(self.interval.low), display.number(self.interval.high)
        if self.determined:
            return f"{self.key} from {low} to {high}"
        if self.interval.open:
            return f"the data do not determine {self.key}: all values from {low} to {high} fit"
        if self.interval.ends[0] == "crossed":
            return f"{self.key} is above {low}: the data do not determine by how much"
        return f"{self.key} is below {high}: the data do not determine by how much"


@dataclass(frozen=True, eq=False)
class Fitted:
    """One experiment of a fit: the flow that was used, number ``rank`` from the hottest of ``flows`` at the estimate;
    the height of its base where that was unknown, with its error; its residuals in the order of the measurements."""

    name: str
    flow: Flow
    rank: int
    flows: int
    base: float | None
    base_error: float | None
    residuals: Array
    profiles: tuple[tuple[Series, Array], ...]


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another fit of the same measurements, on another flow or at other parameters: ``fits_as_well`` where its sum of
    squares is no worse than the confidence allows."""

    values: Array
    chi2: float
    flows: tuple[Flow, ...]
    fits_as_well: bool
    same_flow: bool


@dataclass(frozen=True, eq=False)
class Calibration:
    """What is known of a chute: its parameters, of which those called ``keys`` have the ``covariance`` (k, k), and
    those in ``undetermined`` are not determined by what was measured."""

    chute: Chute
    keys: tuple[str, ...]
    covariance: Array
    undetermined: tuple[str, ...] = ()

    def varied(self, **changes: Any) -> Calibration:
        """The same with other parameters of the chute, by their names in :class:`chuteflow.Chute`, then known.

        Raises:
            InputError: for a value out of range.
        """
        known = {key for key, parameter in BY_KEY.items() if parameter.name in changes}
        kept = [i for i, key in enumerate(self.keys) if key not in known]
        return Calibration(
            replace(self.chute, **changes),
            tuple(self.keys[i] for i in kept),
            self.covariance[np.ix_(kept, kept)],
            tuple(key for key in self.undetermined if key not in known),
        )


@dataclass(frozen=True, eq=False)
class Fit:
    """The outcome of :func:`fit`.

    ``estimates`` are those of the free parameters, ``covariance`` (k, k) theirs; ``chi2`` is the sum of squares over
    the errors, of ``count`` values less ``unknowns`` unknowns; ``error_scale`` is what errors that were given would
    have to be multiplied with for chi2 to be as expected, and what the assumed ones were multiplied with.
    """

    chute: Chute
    free: tuple[FreeParameter, ...]
    measured: Measurements
    estimates: tuple[Estimate, ...]
    covariance: Array
    chi2: float
    count: int
    unknowns: int
    error_scale: float
    loss: str
    confidence: float
    experiments: tuple[Fitted, ...]
    alternatives: tuple[Alternative, ...]
    converged: bool

    def __repr__(self) -> str:
        numbers = {one.key: one.value for one in self.estimates}
        return display.line("Fit", f"closure {self.chute.closure}", **numbers, chi2=self.chi2)

    def _repr_html_(self) -> str:
        rows = [
            [
                *(one.key, display.number(one.value), display.number(one.error)),
                *(f"{display.number(one.interval.low)} to {display.number(one.interval.high)}", one.said),
            ]
            for one in self.estimates
        ]
        head = ("", "estimate", "error", f"{self.confidence:.0%} interval", "")
        return display.html_table("Fit", head, rows, "; ".join(self.warnings) or None)

    @property
    def values(self) -> Array:
        """The estimates (k,)."""
        return np.array([one.value for one in self.estimates])

    @property
    def freedom(self) -> int:
        """Values less unknowns."""
        return self.count - self.unknowns

    @property
    def correlation(self) -> Array:
        """The correlation of the free parameters (k, k)."""
        error = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.covariance / np.outer(error, error)

    @property
    def aicc(self) -> float:
        """Akaike's information criterion for small samples; infinite where there are too few values for it."""
        errors_unknown = not self.measured.errors_known
        p = self.unknowns + errors_unknown
        if self.count - p - 1 <= 0:
            return np.inf
        fitted = self.count * np.log(self.chi2 / self.count) if errors_unknown else self.chi2
        return float(fitted + 2.0 * p + 2.0 * p * (p + 1) / (self.count - p - 1))

    @cached_property
    def probability(self) -> float | None:
        """The chance of so large a chi2 if the theory holds with the errors given; None where none were given, where
        nothing is left to tell, or with a robust loss."""
        if not self.measured.errors_known or self.freedom <= 0 or self.loss != "linear":
            return None
        from scipy.special import chdtrc

        return float(chdtrc(self.freedom, self.chi2))

    @cached_property
    def direct(self) -> tuple[DirectMeasurement, ...]:
        """What the experiments with profiles of nu and T say of g1, g2 and the slip without a model."""
        found = []
        for one, experiment in zip(self.experiments, self.measured.experiments, strict=True):
            scale = 1.0 if self.measured.errors_known else self.error_scale
            with suppress(InputError):
                found.append(direct(experiment, one.flow.chute, error_scale=scale))
        return tuple(found)

    @property
    def trade_offs(self) -> list[str]:
        """Which parameters can be exchanged for one another without a worse fit, in words."""
        return trade_offs(self.estimates, self.correlation)

    @property
    def warnings(self) -> list[str]:
        """What to know before believing the estimates, in sentences."""
        said = [one.said for one in self.estimates if not one.determined]
        said += self.trade_offs
        if not self.converged:
            said.append("the fit did not converge: give a start nearer to the answer")
        if self.probability is not None and self.probability < 1e-3:
            said.append(
                f"the theory does not fit within the errors: chi2 = {self.chi2:.4g} at {self.freedom} degrees of "
                "freedom; the intervals suppose that it does"
            )
        for other in self.alternatives:
            if other.fits_as_well:
                where = ", ".join(
                    f"{p.key} = {display.number(v)}" for p, v in zip(self.free, other.values, strict=True)
                )
                kind = "the same flow" if other.same_flow else "another flow"
                said.append(f"{kind} at {where or 'these parameters'} fits as well: chi2 = {other.chi2:.4g}")
        return said

    @property
    def calibration(self) -> Calibration:
        """What predictions are made from."""
        left = tuple(one.key for one in self.estimates if not one.determined)
        return Calibration(self.chute, tuple(p.key for p in self.free), self.covariance, left)


@on_one_thread
def fit(
    measured: Measurements,
    chute: Chute,
    free: Sequence[str],
    *,
    base_height: bool = False,
    loss: str = "linear",
    confidence: float = CONFIDENCE,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    trials: int | None = None,
    progress: Callable[[float], Any] | None = None,
) -> Fit:
    """The parameters ``free`` of a chute with which its flows come nearest to what was measured.

    Args:
        measured: see :func:`chuteflow.fitting.measurements.measurements`.
        chute: what is known, and from which values the free parameters are tried first.
        free: names of parameters, see :mod:`chuteflow.steady.free`.
        base_height: whether the height of the base is unknown, in each experiment.
        loss: "linear" for least squares, or one that outliers count for less in: soft_l1, huber, cauchy.
        confidence: of the intervals.
        ranges: between which values parameters are searched for first, by name.
        trials: how many trial chutes the search starts from.
        progress: called with the fraction of them that was followed; without it, a terminal or notebook shows a line.

    Raises:
        InputError: for unknown names, or fewer values than unknowns.
        SolveError: where no fit was found.
    """
    if loss not in LOSSES:
        raise InputError(f"loss {shorten(loss)}: choose one of {', '.join(LOSSES)}")
    confidence = number("confidence", confidence, 0.5, 0.9999)
    trials = None if trials is None else whole("trials", trials, 1, _MOST_TRIALS)
    parameters = choose_parameters(chute, free, ranges or {})
    if measured.in_units and any(parameter.key == "slope" for parameter in parameters):
        raise InputError("the slope is free, and makes the measurements dimensionless: give them without units")
    cases = tuple(TrialChute.of(experiment, chute, parameters) for experiment in measured.experiments)
    objective = Objective(cases, base_height, loss)
    _require_enough(objective)
    first = [np.array([parameter.of(chute) for parameter in parameters])]
    with report_progress("fit", progress) as tell:
        best, others = _search(objective, first, trials, tell)
    for _ in range(_ROUNDS):
        scale, covariance = _spread(objective, best, measured.errors_known)
        rise = _rise(confidence, objective.count - objective.unknowns, scale, measured.errors_known)
        try:
            intervals = _intervals(objective, best, covariance, rise, measured.errors_known)
            better = _on_other_flows(objective, best)
            if better is None:
                break
            raise BetterFit(better)
        except BetterFit as found:
            others.append(best)
            best = _finish(objective, found.found)
    else:
        raise SolveError("the fit keeps improving without converging: free fewer of them, or give other ranges")
    return _outcome(objective, measured, chute, best, others, covariance, scale, rise, intervals, confidence)


def _require_enough(objective: Objective) -> None:
    unknowns, count = objective.unknowns, objective.count
    if count < unknowns:
        free = ", ".join(parameter.key for parameter in objective.cases[0].free) or "no parameter"
        more = [
            *([display.count_of(len(objective.labelled), "flow")] if objective.labelled else []),
            *(["the height of the base"] if objective.base_unknown else []),
        ]
        also = f" and the place of {' and '.join(more)}" if more else ""
        raise InputError(
            f"{display.count_of(count, 'value')} cannot determine {unknowns} unknowns ({free}{also}): measure more, "
            "or free fewer parameters"
        )


def _search(
    objective: Objective, first: list[Array], trials: int | None, tell: Callable[[float], Any]
) -> tuple[Minimum, list[Minimum]]:
    """The best fit, and the other minima that starts led to: from more trial chutes where those that are tried first
    lead to nothing that resembles the measurements."""
    if trials is not None:
        return _search_from(objective, candidates(objective, first, trials), tell)
    with suppress(InputError):
        best, others = _search_from(objective, candidates(objective, first), tell)
        if best.chi2 < _HOPELESS * objective.count:
            return best, others
    return _search_from(objective, candidates(objective, first, MANY_TRIALS), tell)


def _search_from(
    objective: Objective, starts: Sequence[StartingPoint], tell: Callable[[float], Any]
) -> tuple[Minimum, list[Minimum]]:
    kept: list[Minimum] = []
    left = []
    for i, start in enumerate(starts):
        tell(i / len(starts))
        # Most starts are on their way to one minimum: it is looked for from the most promising of them.
        one = objective.minimise(
            objective.start(start.places), start.places, most=_FIRST, tolerance=_ROUGHLY, known=kept
        )
        if one is not None and not kept:
            kept.append(_finish(objective, one))
        elif one is not None:
            left.append(one)
    if not kept:
        raise SolveError("no trial flow could be followed to a fit: give ranges nearer to the answer")
    closely = kept[0]
    for one in sorted(left, key=lambda one: one.chi2):
        hopeless = one.chi2 > _HOPELESS * (kept[0].chi2 + objective.count)
        if hopeless or any(_near(objective, one, other) or objective.leads_to(one, other) for other in kept):
            continue
        ended = objective.minimise(one.x.copy(), one.places, most=_SECOND, tolerance=_ROUGHLY, known=kept)
        if ended is not None:
            kept.append(ended)
            kept.sort(key=lambda one: one.chi2)
    beyond = _beyond_fold(objective, kept[0])
    if beyond is not None:
        kept = sorted([beyond, *kept], key=lambda one: one.chi2)
    return closely if kept[0] is closely else _finish(objective, kept[0]), kept[1:]


def _finish(objective: Objective, one: Minimum) -> Minimum:
    """The minimum that a fit leads to, closely."""
    return objective.minimise(one.x.copy(), one.places, most=_LAST, tolerance=_CLOSELY) or one


def _relax(objective: Objective, one: Minimum, error: float) -> tuple[Objective, Minimum] | None:
    """The objective with numbers that are known exactly known to a relative ``error``, whose flows pass through folds
    of them; and its minimum near ``one``."""
    relaxed = replace(objective, cases=tuple(case.relaxed(error) for case in objective.cases))
    values = one.x[: objective.parameters]
    places = [TrialFlow.of(case, place.flow, values) for case, place in zip(relaxed.cases, one.places, strict=True)]
    x = relaxed.start(places)
    if objective.base_unknown:
        x[-len(places) :] = one.x[-len(places) :]
    found = relaxed.minimise(x, places, most=_LAST, tolerance=_ROUGHLY)
    return None if found is None else (relaxed, found)


def _at_fold(objective: Objective, one: Minimum) -> bool:
    """Whether a fold of a number that is known exactly is near."""
    return any(
        abs(float(np.array(place.weights) @ place.answer.tangent)) < _FLAT
        for case, place in zip(objective.cases, one.places, strict=True)
        if case.exact is not None
    )


def _beyond_fold(objective: Objective, one: Minimum) -> Minimum | None:
    """The minimum that is reached through a fold of a number that is known exactly, where one is near; else None."""
    around = _relax(objective, one, _LENIENT) if _at_fold(objective, one) else None
    if around is None:
        return None
    found = around[1]
    values = found.x[: objective.parameters]
    places = []
    for case, place in zip(objective.cases, found.places, strict=True):
        start = TrialFlow.of(case, place.flow, values)
        flow = case.followed(start, values, start.label)
        if flow is None:
            return None
        places.append(start.moved(flow, values, start.label))
    x = objective.start(places)
    if objective.base_unknown:
        x[-len(places) :] = found.x[-len(places) :]
    return objective.minimise(x, places, most=_SECOND, tolerance=_ROUGHLY)


def _intervals(objective: Objective, best: Minimum, covariance: Array, rise: float, known: bool) -> list[Interval]:
    """The intervals of all parameters.

    Where a fold of a number that is known exactly is near, that number is relaxed; so it is where no flow goes on. What
    fits for one parameter at some distance is in the intervals of the others too.
    """
    near = _at_fold(objective, best)
    around = _relax(objective, best, _TIGHT) if near else None
    if around is not None and around[1].chi2 > best.chi2 + rise:
        near, around = False, None
    exactly: list[Minimum] = []
    relaxedly: list[Minimum] = []
    found: list[Interval | None] = [None] * objective.parameters
    for _ in range(_PASSES):
        for j, now in enumerate(found):
            again = now is not None
            if now is not None and not any(now.leaves_out(float(one.x[j])) for one in (*exactly, *relaxedly)):
                continue
            one = None
            if near and around is not None:
                with suppress(BetterFit):
                    one = interval(*around, _spread(*around, known)[1], j, rise, relaxedly, onward=again)
            if one is None or "no flow" in one.ends:
                exact = interval(objective, best, covariance, j, rise, exactly, onward=again)
                one = exact if one is None else one.continued(exact)
            if "no flow" in one.ends and not near and any(case.exact for case in objective.cases):
                around = around or _relax(objective, best, _TIGHT)
                if around is not None:
                    with suppress(BetterFit):
                        relaxed = interval(*around, _spread(*around, known)[1], j, rise, relaxedly, onward=again)
                        one = one.continued(relaxed)
            found[j] = one
    return [one for one in found if one is not None]


def _near(objective: Objective, one: Minimum, other: Minimum) -> bool:
    """Whether two fits are on one way to one minimum: the same flows at almost the same parameters."""
    k = objective.parameters
    apart = np.abs(one.x[:k] - other.x[:k]) / objective.scale()[:k]
    return bool(apart.max(initial=0.0) < _NEAR) and _same_flows(one, other)


def _same_flows(one: Minimum, other: Minimum) -> bool:
    return all(
        np.abs(a.flow.solution.macroscopic - b.flow.solution.macroscopic).max() < _SAME_FLOW
        for a, b in zip(one.places, other.places, strict=True)
    )


def _on_other_flows(objective: Objective, best: Minimum) -> Minimum | None:
    """A better fit that starts from other flows at the same parameters, where there are several experiments."""
    if len(objective.cases) == 1:
        return None
    values = best.x[: objective.parameters]
    now = [case.residual(place.flow) for case, place in zip(objective.cases, best.places, strict=True)]
    for one in at(objective, values):
        swapped = list(best.places)
        for i, (case, place) in enumerate(zip(objective.cases, one.places, strict=True)):
            there = case.residual(place.flow)
            if float(there @ there) < float(now[i] @ now[i]) * (1.0 - 1e-6) - 1e-6:
                swapped[i] = place
        if any(a is not b for a, b in zip(swapped, best.places, strict=True)):
            found = objective.minimise(objective.start(swapped), swapped, most=_SECOND, tolerance=_ROUGHLY)
            if found is not None and found.chi2 < best.chi2 * (1.0 - 1e-3):
                return found
    return None


def _spread(objective: Objective, best: Minimum, known: bool) -> tuple[float, Array]:
    """The scale of the errors, and the covariance of all unknowns: infinite where nothing is known of one."""
    freedom = objective.count - objective.unknowns
    scale = float(np.sqrt(best.chi2 / freedom)) if freedom > 0 else 1.0
    width = objective.scale()
    _, sizes, rows = np.linalg.svd(best.jacobian * width, full_matrices=False)
    # Directions that change nothing are as wide as can be.
    sizes = np.maximum(sizes, 1e-6 * max(float(sizes.max(initial=0.0)), 1e-12))
    covariance = (rows.T / sizes**2) @ rows * np.outer(width, width)
    return scale, covariance * (1.0 if known else scale**2)


def _rise(confidence: float, freedom: int, scale: float, known: bool) -> float:
    """By how much chi2 rises at the ends of an interval: by the normal distribution where errors are known, by that of
    Student where they are estimated."""
    from scipy.special import ndtri, stdtrit

    tail = 0.5 * (1.0 + confidence)
    if known or freedom <= 0:
        return float(ndtri(tail) ** 2)
    return float(stdtrit(freedom, tail) ** 2) * max(scale, 1e-12) ** 2


def _outcome(
    objective: Objective,
    measured: Measurements,
    chute: Chute,
    best: Minimum,
    others: Sequence[Minimum],
    covariance: Array,
    scale: float,
    rise: float,
    intervals: Sequence[Interval],
    confidence: float,
) -> Fit:
    free = objective.cases[0].free
    k = len(free)
    error = np.sqrt(np.diag(covariance))
    estimates = tuple(Estimate(p.key, float(best.x[j]), float(error[j]), intervals[j]) for j, p in enumerate(free))
    experiments = []
    for i, (case, place) in enumerate(zip(objective.cases, best.places, strict=True)):
        column = objective.base_column(i)
        base = None if column is None else float(best.x[column])
        experiments.append(_describe_fit(case, place, base, None if column is None else float(error[column])))
    return Fit(
        chute=vary(chute, free, best.x[:k].tolist()),
        free=free,
        measured=measured,
        estimates=estimates,
        covariance=covariance[:k, :k],
        chi2=best.chi2,
        count=objective.count,
        unknowns=objective.unknowns,
        error_scale=scale,
        loss=objective.loss,
        confidence=confidence,
        experiments=tuple(experiments),
        alternatives=tuple(_alternatives(objective, best, others, error, rise, intervals)),
        converged=best.converged,
    )


def _describe_fit(case: TrialChute, place: TrialFlow, base: float | None, base_error: float | None) -> Fitted:
    residual = case.residual(place.flow, base or 0.0)
    profiles, first = [], 0
    for series in case.experiment.profiles:
        profiles.append((series, residual[first : first + len(series.value)]))
        first += len(series.value)
    rank, many = _rank(case, place)
    return Fitted(case.experiment.name, place.flow, rank, many, base, base_error, residual, tuple(profiles))


def _rank(case: TrialChute, place: TrialFlow) -> tuple[int, int]:
    """Which of the flows with the same exact number, or the same hold-up, this is."""
    asked: dict[str, Any] = dict(case.experiment.exact) or {"M": place.flow.mass_holdup}
    found = flows(place.flow.chute, **asked, tolerance=1e-6)
    if not len(found):
        return 1, 1
    off = [np.abs(one.solution.macroscopic - place.flow.solution.macroscopic).max() for one in found]
    return int(np.argmin(off)) + 1, len(found)


def _alternatives(
    objective: Objective,
    best: Minimum,
    others: Sequence[Minimum],
    error: Array,
    rise: float,
    intervals: Sequence[Interval],
) -> list[Alternative]:
    """Minima that differ from the best one and from one another; what may fit as well is followed further."""
    found: list[Alternative] = []
    kept = [best]
    k = objective.parameters
    for one in sorted(others, key=lambda m: m.chi2):
        if one.chi2 > best.chi2 + _MAY_FIT * rise:
            continue
        if any(_same(objective, one, other, error) or objective.leads_to(one, other) for other in kept):
            continue
        ended = one
        if not one.converged:
            ended = objective.minimise(one.x.copy(), one.places, most=_SECOND, tolerance=_ROUGHLY) or one
        if any(_same(objective, ended, other, error) for other in kept):
            continue
        kept.append(ended)
        # What the intervals hold already is no other answer.
        if _same_flows(ended, best) and all(
            inside.low <= value <= inside.high for inside, value in zip(intervals, ended.x[:k], strict=True)
        ):
            continue
        found.append(
            Alternative(
                ended.x[:k].copy(),
                ended.chi2,
                tuple(place.flow for place in ended.places),
                ended.chi2 <= best.chi2 + rise,
                _same_flows(ended, best),
            )
        )
    return found


def _same(objective: Objective, one: Minimum, other: Minimum, error: Array) -> bool:
    k = objective.parameters
    near = np.abs(one.x[:k] - other.x[:k]) <= np.maximum(_SAME * error[:k], 1e-3 * objective.scale()[:k])
    return bool(near.all()) and abs(one.chi2 - other.chi2) < 3e-2 * (1.0 + other.chi2)
