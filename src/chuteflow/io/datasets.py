"""Each kind of result as a :class:`chuteflow.io.dataset.Dataset`, from which files and tables are made."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import singledispatch
from typing import Any

import numpy as np

from chuteflow import __version__
from chuteflow.bifurcations.boundary import Boundary, BoundarySet
from chuteflow.bifurcations.tracing import TURNS
from chuteflow.branches.lines import in_order
from chuteflow.branches.results import KINDS, Branch, Curve, FlowSet, FlowSets, Searched
from chuteflow.errors import InputError
from chuteflow.io.contract import factor
from chuteflow.io.dataset import Dataset, Variable, flags, variable
from chuteflow.io.records import HEIGHTS, KIND_OF, Row, rows
from chuteflow.io.references import PAPER, TITLES, numbers_are
from chuteflow.maps import KINDS_OF_BOUNDARIES, Domain
from chuteflow.maps.kinds import DENSITIES as DENSITY_BITS
from chuteflow.maps.kinds import INTERIORS as INTERIOR_BITS
from chuteflow.stability.planes import FamilyMap, WaveMap
from chuteflow.stability.relaxation import Relaxation
from chuteflow.stability.result import Stability
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow, Profile
from chuteflow.steady.hot import HotModel
from chuteflow.steady.kinds import DENSITIES, INTERIORS
from chuteflow.steady.quantities import FIELDS, NUMBERS, PLACE, SCALED, VALIDITY, Quantity, Scales
from chuteflow.steady.solver import SolverStatus
from chuteflow.steady.validity import WORDS
from chuteflow.sweeps.scan import Scan

_STATUS = tuple(status.name.lower() for status in SolverStatus)
#: Numbers of a cell of a domain: what they mean, and what their values mean, or the bits of which they are sums.
CLASSES: dict[str, tuple[str, dict[int, str]]] = {
    "hot": (
        "hot, dilute flows by the closed form of section 4",
        {-1: "not_known_in_closed_form", 0: "no_hot_flows", 1: "hot_flows"},
    ),
    "exists": ("any flow in the range searched", {0: "no_flow", 1: "flows"}),
    "most": ("largest number of flows that share one mass flux", {}),
    "families": ("number of branches, connected sets of flows", {}),
    "hidden": (
        "hidden branches: more than one, so that a continuation from a known flow does not meet all",
        {0: "none", 1: "hidden_families"},
    ),
    "interior": ("kinds of interior among the flows", {bit: name for name, bit in INTERIOR_BITS.items()}),
    "density": ("kinds of density among the flows", {bit: name for name, bit in DENSITY_BITS.items()}),
}
#: Those of CLASSES whose values are sums of bits.
BITS = ("interior", "density")


@singledispatch
def dataset(result: Any, scales: Scales | None = None) -> Dataset:
    """``result`` as named arrays, in SI units where ``scales`` are given.

    Raises:
        InputError: for what is no result, or cannot take SI units.
    """
    raise InputError(f"a {type(result).__name__} is no table: take a result with several numbers")


# Flows


@dataset.register(Flow)
@dataset.register(FlowSet)
@dataset.register(Curve)
def _of_flows(result: Flow | FlowSet | Curve, scales: Scales | None = None) -> Dataset:
    found = rows(result)
    variables = flow_variables(found, scales)
    if isinstance(result, Curve):
        variables |= _places(found)
    return Dataset(variables, attributes(result, scales))


@dataset.register(Branch)
def _of_branch(result: Branch, scales: Scales | None = None) -> Dataset:
    found = [Row(point.flow, 0, point.special) for point in in_order(result)]
    special = {"special_kind": _places(found)["special_kind"]}
    return Dataset(flow_variables(found, scales) | special, result.flows[0].chute.as_dict())


@dataset.register(FlowSets)
def _of_sets(result: FlowSets, scales: Scales | None = None) -> Dataset:
    """Every flow under every condition: those of one condition are told by its number, ``point``."""
    found = [Row(flow, i) for i, one in enumerate(result) for flow in one]
    point = np.array([row.branch for row in found], dtype="i4")
    count = Variable(("flow",), point, {"long_name": f"number of the value of {result.quantity}", "units": "1"})
    return Dataset({"point": count, **flow_variables(found, scales)}, result.chute.as_dict())


def flow_dataset(result: Flow | FlowSet | Curve, scales: Scales | None, history: str) -> Dataset:
    """What a file has of a result: its numbers, and the profiles of all its flows."""
    found = rows(result)
    whole = _of_flows(result, scales)
    return Dataset(
        {**whole.variables, **_profiles(found, scales)}, {**whole.attributes, "history": history}, whole.index
    )


def attributes(result: Flow | FlowSet | Curve, scales: Scales | None) -> dict[str, Any]:
    """The attributes of a result."""
    found: dict[str, Any] = {**_about(TITLES[KIND_OF[type(result)]], scales), **result.chute.as_dict()}
    if not isinstance(result, Flow):
        found |= {
            **_describe_search(result.searched),
            "searched_comment": "dimensionless range in which flows were searched for",
            "tolerance": result.tolerance,
            "tolerance_comment": "relative error allowed in Q, h and M",
            "reason": result.reason or "",
        }
    return found


def _about(title: str, scales: Scales | None) -> dict[str, Any]:
    """What every result says of itself."""
    grains = {}
    if scales is not None:
        grains = {
            "grain_diameter_in_m": scales.diameter,
            "grain_density_in_kg_per_m3": scales.density,
            "gravity_in_m_per_s2": scales.gravity,
        }
    return {
        "Conventions": "CF-1.11",
        "title": title,
        "source": f"chuteflow {__version__}",
        "references": PAPER,
        "comment": numbers_are(scales),
        **grains,
    }


def _describe_search(searched: Searched) -> dict[str, Any]:
    return {
        "searched_surface_temperature": np.array(searched.surface_temperature),
        "searched_largest_holdup": searched.largest_holdup,
    }


def flow_variables(found: Sequence[Row], scales: Scales | None) -> dict[str, Variable]:
    """Numbers and kinds of flows along one dimension, ``flow``."""
    along = ("flow",)
    flows = [row.flow for row in found]
    variables = {}
    for name, quantity in NUMBERS.items():
        values = _scale(flows, name, scales)
        # There is no interface on the half-line.
        if not len(values) or np.isfinite(values).all():
            described = _describe(quantity, scales) | {"ancillary_variables": "error status"}
            variables[name] = Variable(along, values, described)
    error = {"units": "1", "long_name": "estimated relative error of Q, h and M, the largest"}
    status = [flow.solution.status.name.lower() for flow in flows]
    variables |= {
        "error": Variable(along, np.array([flow.error for flow in flows]), error),
        "interior": flags(
            along, [flow.interior for flow in flows], INTERIORS, "balance of fluctuation energy inside the flow"
        ),
        "density": flags(
            along, [flow.density for flow in flows], DENSITIES, "course of the volume fraction with height"
        ),
        "status": flags(along, status, _STATUS, "how the solution ended"),
    }
    return variables | _validity(flows)


def _validity(flows: Sequence[Flow]) -> dict[str, Variable]:
    """Numbers that show how far flows keep to the theory, and a bit for each limit that is passed."""
    known = [flow.validity for flow in flows]
    numbers = {
        name: Variable(
            ("flow",),
            np.array([getattr(one, name) for one in known], dtype="f8"),
            {"units": "1", "long_name": quantity.description},
        )
        for name, quantity in VALIDITY.items()
    }
    bits = {word: 1 << i for i, word in enumerate(WORDS)}
    described = {
        "long_name": "limits of the theory that are passed",
        "flag_masks": np.array([*bits.values()], dtype="i1"),
        "flag_meanings": " ".join(word.partition(":")[0].replace(" ", "_") for word in WORDS),
        "comment": "; ".join(f"{word}: {meaning}" for word, meaning in WORDS.items()),
    }
    passed = np.array([sum(bits[word] for word in one.words) for one in known], dtype="i1")
    return numbers | {"validity": Variable(("flow",), passed, described)}


def _places(found: Sequence[Row]) -> dict[str, Variable]:
    """The branch of each flow of a curve, and the special points among them."""
    branch = np.array([row.branch for row in found], dtype="i4")
    comment = "; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS.items())
    kinds = [row.special or "none" for row in found]
    return {
        "branch": Variable(("flow",), branch, {"long_name": "number of the branch of flows", "units": "1"}),
        "special_kind": flags(("flow",), kinds, ("none", *KINDS), "kind of special point", comment),
    }


def _profiles(found: Sequence[Row], scales: Scales | None) -> dict[str, Variable]:
    profiles = [row.flow.sampled(HEIGHTS) for row in found]
    variables = {}
    for name, quantity in FIELDS.items():
        by = [factor(name, row.flow.chute, scales) for row in found]
        values = np.array([getattr(p, name) * f for p, f in zip(profiles, by, strict=True)]).reshape(-1, HEIGHTS)
        beside = {"positive": "up"} if name == "height" else {"coordinates": "height"}
        variables[name] = Variable(("flow", "height_index"), values, _describe(quantity, scales) | beside)
    return variables


@dataset.register(Profile)
def _of_profile(result: Profile, scales: Scales | None = None) -> Dataset:
    if scales is not None:
        raise InputError("a profile does not know the slope, on which the scales depend: multiply by Scales.factor")
    fields = {
        name: Variable(("height_index",), np.ravel(getattr(result, name)), _describe(quantity, None))
        for name, quantity in FIELDS.items()
    }
    return Dataset(fields, {"comment": numbers_are(None)}, ("height",))


def _scale(flows: Sequence[Any], name: str, scales: Scales | None) -> np.ndarray:
    return np.array([getattr(flow, name) * factor(name, flow.chute, scales) for flow in flows])


def _describe(quantity: Quantity, scales: Scales | None) -> dict[str, str]:
    return {
        "units": quantity.unit_without_scales if scales is None else quantity.unit,
        "long_name": quantity.description,
        "symbol": quantity.symbol,
        "comment": f"{quantity.equation} of the paper",
    }


def _unit(name: str, scales: Scales | None) -> str:
    return SCALED[name].unit_without_scales if scales is None else SCALED[name].unit


# Boundaries


@dataset.register(BoundarySet)
def _of_boundaries(result: BoundarySet, scales: Scales | None = None) -> Dataset:
    others = {name: value for name, value in result.chute.as_dict().items() if name != result.second}
    ends = "; ".join(f"boundary {i}: {b.ends[0]}, {b.ends[1]}" for i, b in enumerate(result)) or str(result.reason)
    about = {
        "Conventions": "CF-1.11",
        "title": f"boundaries of the kind {result.kind} through {result.second}",
        "source": f"chuteflow {__version__}",
        "references": PAPER,
        "comment": numbers_are(scales),
        "chute": ", ".join(f"{name} = {value}" for name, value in others.items()),
        "ends": ends,
    }
    return Dataset(_along_boundaries(result, result.second, scales), about)


@dataset.register(Boundary)
def _of_boundary(result: Boundary, scales: Scales | None = None) -> Dataset:
    return Dataset(_along_boundaries([result], result.second, scales), {"comment": numbers_are(scales)})


def _along_boundaries(boundaries: Sequence[Boundary], second: str, scales: Scales | None) -> dict[str, Variable]:
    """Every point of all boundaries in order, the turning points in their places."""
    points = [
        point
        for number, boundary in enumerate(boundaries)
        for i, (flow, error) in enumerate(zip(boundary.flows, boundary.error.tolist(), strict=True))
        for point in (
            (number, "none", flow, error),
            *((number, turn.kind, turn.flow, turn.error) for turn in boundary.special if turn.position == i),
        )
    ]
    along = ("point",)
    flows = [flow for _, _, flow, _ in points]
    number = Variable(along, np.array([n for n, *_ in points], dtype="i4"), {"long_name": "number of the boundary"})
    kinds = ("none", *TURNS)
    comment = "; ".join(f"{kind}: {meaning}" for kind, meaning in TURNS.items())
    return {
        "boundary": number,
        "special": flags(along, [kind for _, kind, *_ in points], kinds, "kind of turning point", comment),
        second: variable(along, [getattr(flow.chute, second) for flow in flows], second),
        **{
            name: variable(along, _scale(flows, name, scales), NUMBERS[name].description, _unit(name, scales))
            for name in PLACE
        },
        "error": variable(
            along,
            [error for *_, error in points],
            "estimated relative error of Q, h, M and the second parameter, the largest",
        ),
    }


# Maps


@dataset.register(Domain)
def _of_domain(result: Domain, scales: Scales | None = None) -> Dataset:
    if scales is not None:
        raise InputError("a domain has no units: omit scales")
    plane = result.plane
    x, y = plane.x.name, plane.y.name
    variables = {
        name: variable((name,), values, f"{name.replace('_', ' ')} of the chute")
        for name, values in ((x, result.x), (y, result.y))
    }
    for name in CLASSES:
        values = getattr(result, name).astype("i2" if name == "most" else "i1")
        variables[name] = Variable((y, x), values, _class(name))
    index = (y, x)
    if plane.temperatures:
        variables["temperature"] = variable(("temperature",), plane.temperatures, "surface temperature")
        there = {"flag_values": np.arange(2, dtype="i1"), "flag_meanings": "no_flow flow"}
        variables["exists_at"] = Variable(
            ("temperature", y, x),
            result.exists_at.astype("i1"),
            {"long_name": "a flow at the surface temperature", **there},
        )
        index = ("temperature", y, x)
    return Dataset(variables, _about_domain(result), index)


def _about_domain(found: Domain) -> dict[str, Any]:
    plane = found.plane
    fixed = {n: value for n, value in plane.chute.as_dict().items() if n not in (plane.x.name, plane.y.name)}
    return {
        **_about(DOMAIN_TITLE, None),
        **fixed,
        **_describe_search(found.searched),
        "tolerance": found.tolerance,
        "tolerance_comment": "fraction of each axis to which boundaries are located",
    }


#: What a file with a domain holds.
DOMAIN_TITLE = "domains of existence of steady, fully developed flows of grains down a chute"


def _class(name: str) -> dict[str, Any]:
    meaning, values = CLASSES[name]
    if not values:
        return {"long_name": meaning, "units": "1"}
    kind = "flag_masks" if name in BITS else "flag_values"
    return {
        "long_name": meaning,
        kind: np.array(list(values), dtype="i1"),
        "flag_meanings": " ".join(values.values()),
    }


def outlines(found: Domain) -> Dataset:
    """The boundaries of a domain, point after point, with the number of the line and its kind."""
    lines, along = found.boundaries, ("point",)
    lengths = [len(one.points) for one in lines]
    points = np.concatenate([np.empty((0, 2)), *(one.points for one in lines)])
    comment = "; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS_OF_BOUNDARIES.items())
    kinds = [one.kind for one, length in zip(lines, lengths, strict=True) for _ in range(length)]
    axes = ((found.plane.x.name, points[:, 0]), (found.plane.y.name, points[:, 1]))
    return Dataset(
        {
            **{name: variable(along, values, name.replace("_", " ")) for name, values in axes},
            "line": variable(along, np.repeat(np.arange(len(lines), dtype="i4"), lengths), "number of the line"),
            "kind": flags(along, kinds, tuple(KINDS_OF_BOUNDARIES), "kind of boundary", comment),
        },
        {"long_name": "boundaries between classes as lines"},
    )


# Disturbances


@dataset.register(WaveMap)
def _of_waves(result: WaveMap, scales: Scales | None = None) -> Dataset:
    chute = result.flow.chute
    wave, unit = factor("wavenumber", chute, scales), _unit("wavenumber", scales)
    axes = {
        "kx": variable(("kx",), wave * result.kx, "wavenumber along the slope", unit),
        "ky": variable(("ky",), wave * result.ky, "wavenumber across the slope", unit),
    }
    return Dataset({**axes, **_growth(("kx", "ky"), result, chute, scales)}, chute.as_dict(), ("kx", "ky"))


@dataset.register(FamilyMap)
def _of_family(result: FamilyMap, scales: Scales | None = None) -> Dataset:
    chute = result.flows[0].chute
    axes = {
        "depth_wavenumber": variable(("depth_wavenumber",), result.depth_wavenumber, "wavenumber times centre of mass"),
        **{
            name: Variable(("flow",), _scale(result.flows, name, scales), _describe(NUMBERS[name], scales))
            for name in PLACE
        },
    }
    growth = _growth(("depth_wavenumber", "flow"), result, chute, scales)
    about = chute.as_dict() | {"angle_of_waves": result.angle}
    return Dataset({**axes, **growth}, about, ("depth_wavenumber",))


def _growth(
    dimensions: tuple[str, str], found: WaveMap | FamilyMap, chute: Chute, scales: Scales | None
) -> dict[str, Variable]:
    """Growth and frequency over two dimensions; NaN where none is resolved."""
    known = np.where(found.unresolved, "not_known", np.where(found.grows, "grows", "does_not_grow"))
    meanings = ("does_not_grow", "grows", "not_known")
    state = flags(dimensions, known.ravel().tolist(), meanings, "whether a disturbance grows")
    return {
        **{
            name: Variable(
                dimensions, factor(name, chute, scales) * getattr(found, name), _describe(SCALED[name], scales)
            )
            for name in ("growth", "frequency")
        },
        "state": Variable(dimensions, state.values.reshape(known.shape), state.attributes),
    }


@dataset.register(Stability)
def _of_stability(result: Stability, scales: Scales | None = None) -> Dataset:
    chute, mode = result.flow.chute, result.mode
    numbers = {name: getattr(result.flow, name) * factor(name, chute, scales) for name in PLACE}
    rates = {} if mode is None else {"kx": mode.kx, "ky": mode.ky, "growth": mode.growth, "frequency": mode.frequency}
    scale: dict[str, str] = {"kx": "wavenumber", "ky": "wavenumber"}
    known = {True: "stable", False: "unstable", None: "not_known"}[result.stable]
    return Dataset(
        {
            **{
                name: Variable((), np.asarray(value), _describe(NUMBERS[name], scales))
                for name, value in numbers.items()
            },
            "stability": Variable((), np.asarray(known)),
            "kind": Variable((), np.asarray("" if mode is None else mode.kind)),
            **{
                name: variable(
                    (),
                    value * factor(scale.get(name, name), chute, scales),
                    f"{name} of the mode that grows fastest",
                    _unit(scale.get(name, name), scales),
                )
                for name, value in rates.items()
            },
        },
        chute.as_dict(),
    )


@dataset.register(Relaxation)
def _of_relaxation(result: Relaxation, scales: Scales | None = None) -> Dataset:
    chute = result.flow.chute
    along = {
        name: Variable(
            ("time",),
            factor(name, chute, scales) * np.array([getattr(moment, name) for moment in result.moments]),
            _describe(SCALED[name], scales),
        )
        for name in ("time", "mass_flux", "centre_of_mass", "surface_temperature", "base_temperature")
    }
    return Dataset(along, chute.as_dict(), ("time",))


@dataset.register(HotModel)
def _of_hot(result: HotModel, scales: Scales | None = None) -> Dataset:
    if scales is not None:
        raise InputError("a hot limit has factors of powers of T_inf: take it without scales")
    plain = {name: value for name, value in result.as_dict().items() if not isinstance(value, list)}
    values = {name: np.asarray(np.nan if value is None else value) for name, value in plain.items()}
    described = {name: variable((), value, f"{name} of the hot limit") for name, value in values.items()}
    return Dataset(described, result.chute.as_dict())


# Studies


@dataset.register(Scan)
def _of_scan(result: Scan, scales: Scales | None = None) -> Dataset:
    axes = {name: variable((name,), values, result.description(name)) for name, values in result.axes.items()}
    by: Callable[[str], Any] = (
        (lambda name: 1.0) if scales is None else (lambda name: result.over_slopes(lambda s: scales.factor(name, s)))
    )
    points = tuple(result.axes)
    variables = {
        "flows": variable(points, result.count, "number of flows"),
        "state": Variable(points, result.status, {"long_name": "how the search ended", **result.status_flags}),
    }
    for name, values in result.quantities.items():
        if name in NUMBERS:
            variables[name] = Variable((*points, "flow"), values * by(name), _describe(NUMBERS[name], scales))
        else:
            variables[name] = Variable((*points, "flow"), values, result.flags(name))
    return Dataset({**axes, **variables}, {"comment": numbers_are(scales), **result.fixed}, points)
