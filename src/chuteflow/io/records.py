"""What a file keeps of a result so that it loads back to the last bit: the discretised unknowns of its flows.

The continuous problem is rebuilt from the parameters of the chute; the rest is (degree, stretch, z, macroscopic,
error, status) of every flow.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from chuteflow.branches.lines import in_order
from chuteflow.branches.ranges import SearchRange
from chuteflow.branches.results import KINDS, Branch, Cells, Curve, FlowSet, Searched, SpecialPoint
from chuteflow.checks import number, shorten, whole
from chuteflow.errors import InputError
from chuteflow.io.contract import PARAMETERS, chute_object, closure_object, finite
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import WHOLE, Collocation
from chuteflow.steady.elements import DEGREES, MOST_PIECES
from chuteflow.steady.flow import Flow
from chuteflow.steady.model import model
from chuteflow.steady.solver import Solution, SolverStatus, check_tolerance
from chuteflow.theory.constitutive import Law, Unknown, fingerprint
from chuteflow.theory.laws import law, runs_code

#: What can be saved and loaded, and its names in the files.
Result = Flow | FlowSet | Curve
KIND_OF = {Flow: "flow", FlowSet: "flows", Curve: "curve"}

#: Heights of saved profiles, from the base to the depth of each flow.
HEIGHTS = 101
#: Version of the layout of the files; a file of a later one is refused.
FORMAT = 1
#: Largest difference of ln Q, ln h, ln M and ln T_surface between a file and the flow rebuilt from it.
_AGREEMENT = 1e-6
#: Largest stretch that is believed: that of a hold-up at which nothing is searched over the coldest temperature.
_LARGEST_STRETCH = 100.0
#: Relative difference of values of one law on two machines.
_SAME_LAW = 1e-9
#: Names in the head of a file.
LAW, CLOSURE, CHECKSUM = "law", "closure", "checksum"


@dataclass(frozen=True, eq=False)
class Row:
    """One flow of a result: its branch (0 outside a curve), and its kind of special point, or empty."""

    flow: Flow
    branch: int = 0
    special: str = ""


def rows(result: Result) -> list[Row]:
    """All flows of ``result`` in order; on a branch the special points in their places."""
    if isinstance(result, Flow):
        return [Row(result)]
    if isinstance(result, FlowSet):
        return [Row(flow) for flow in result]
    return [Row(point.flow, i, point.special) for i, branch in enumerate(result.branches) for point in in_order(branch)]


def head(result: Result, found: Sequence[Row]) -> dict[str, Any]:
    """All that a file keeps beside the rows ``found``, as JSON values."""
    kept: dict[str, Any] = {
        "format": FORMAT,
        "kind": KIND_OF[type(result)],
        "chute": chute_object(result.chute),
        LAW: fingerprint_of(result.chute, found[0].flow.law if found else None),
        CLOSURE: closure_object(result.chute, found[0].flow.law if found else None),
    }
    if not isinstance(result, Flow):
        kept |= {
            "searched": {
                "surface_temperature": list(result.searched.surface_temperature),
                "largest_holdup": result.searched.largest_holdup,
                **({} if result.searched.cells is None else {"cells": asdict(result.searched.cells)}),
            },
            "tolerance": result.tolerance,
            "reason": result.reason,
        }
        kept["incomplete"] = result.incomplete
    if isinstance(result, Curve):
        kept["ends"] = [list(branch.ends) for branch in result.branches]
    return kept | {CHECKSUM: checksum(kept, map(unknowns, found))}


def checksum(kept: Mapping[str, Any], rows: Iterable[Mapping[str, Any]] = ()) -> str:
    """What tells whether anything was changed that a result is restored from."""
    found = hashlib.sha256(json.dumps(kept, sort_keys=True).encode())
    for row in rows:
        found.update(json.dumps(row, sort_keys=True).encode())
    return found.hexdigest()


def require_checksum(kept: Mapping[str, Any], rows: Iterable[Mapping[str, Any]] = ()) -> None:
    """Check what a file keeps against its checksum. Files of chuteflow 0.1 have none.

    Raises:
        InputError: where it is another.
    """
    rest = {name: value for name, value in kept.items() if name != CHECKSUM}
    if CHECKSUM in kept and kept[CHECKSUM] != checksum(rest, rows):
        raise InputError("it is damaged, or was changed: its checksum is that of other numbers")


def fingerprint_of(chute: Chute, registered: Law | None = None) -> list[float]:
    """Values of the law of ``chute``, by default the one that has its name now."""
    return fingerprint(registered or chute.law, chute.restitution, chute.slope)


def require_law(chute: Chute, kept: Mapping[str, Any]) -> None:
    """Check that the law of a file is the one that has its name now. Files of chuteflow 0.1 do not tell.

    Raises:
        InputError: where it is another.
    """
    if LAW not in kept or not chute.law.known:
        return
    values, now = numbers("the law", kept[LAW]), np.array(fingerprint_of(chute))
    if values.shape != now.shape or not np.allclose(values, now, rtol=_SAME_LAW, atol=0.0):
        raise InputError(
            f"it was written with another law than the one that is now registered under the name {chute.closure!r}: "
            "register that one to load it, or compute it again"
        )


def numbers(what: str, values: Any) -> Array:
    """A list of finite numbers as an array.

    Raises:
        InputError: for what is none.
    """
    if not isinstance(values, list):
        raise InputError(f"{what}: must be a list of numbers")
    return np.array([number(what, value) for value in values])


def unknowns(row: Row) -> dict[str, Any]:
    """A discretised flow and its place in the result, as JSON values."""
    solution = row.flow.solution
    problem = solution.problem
    grid = _grid(problem.degree, float(np.reshape(problem.stretch, ())), problem.breaks, solution.z.tolist())
    return grid | _place(row)


def _unknowns_read(row: Row, kept: Mapping[str, Any]) -> dict[str, Any]:
    """The same of a flow whose law is not known here: its unknowns are those that were read."""
    return _grid(kept["degree"], kept["stretch"], _breaks(kept.get("breaks")), kept["z"]) | _place(row)


def _grid(degree: int, stretch: float, breaks: Sequence[float], z: Sequence[float]) -> dict[str, Any]:
    pieces = {"breaks": list(breaks)} if len(breaks) > len(WHOLE) else {}
    return pieces | {"degree": degree, "stretch": stretch, "z": list(z)}


def _place(row: Row) -> dict[str, Any]:
    solution = row.flow.solution
    return {
        "macroscopic": [finite(value) for value in solution.macroscopic],
        "error": finite(solution.error),
        "status": solution.status.name,
        "branch": row.branch,
        "special": row.special,
    }


def row_from(chute: Chute, kept: Mapping[str, Any]) -> Row:
    """The row that :func:`unknowns` came from.

    Raises:
        InputError: where the unknowns are not those of the flow they claim to be.
    """
    # Everything is checked before anything is computed with it: a grid takes the square of its degree in memory.
    degree = whole("the degree of a flow", kept["degree"], 2, max(DEGREES))
    stretch = number("the stretch of a flow", kept["stretch"], 0.0, _LARGEST_STRETCH)
    breaks = _breaks(kept.get("breaks"))
    if len(kept["z"]) != degree * (len(breaks) - 1) + 3 or len(kept["macroscopic"]) != 4:
        raise InputError("a flow has the wrong number of unknowns")
    z = numbers("the unknowns of a flow", kept["z"])
    if kept["status"] not in SolverStatus.__members__:
        raise InputError(f"a flow has the unknown status {shorten(kept['status'])}")
    status = SolverStatus[kept["status"]]
    logarithms = [math.nan if v is None else number("ln Q, ln h, ln M or ln T", v) for v in kept["macroscopic"]]
    error = math.inf if kept["error"] is None else number("the error of a flow", kept["error"], 0.0)
    if chute.law.known:
        source: Any = Collocation(model(chute), degree, stretch, breaks), z
    else:
        source = chute.law
    solution = Solution(np.array(logarithms), error, status, source)
    if solution.converged and chute.law.known:
        with np.errstate(all="ignore"):
            distance = np.abs(solution.problem.state(z).macroscopic() - solution.macroscopic).max()
        if not distance <= _AGREEMENT:
            raise InputError("the unknowns of a flow do not give its mass flux, centre of mass and hold-up")
    if kept["special"] and kept["special"] not in KINDS:
        raise InputError(f"it holds an unknown kind of special point, {shorten(kept['special'])}")
    return Row(Flow(chute, solution), whole("the branch of a flow", kept["branch"], 0), str(kept["special"]))


def _breaks(kept: Any) -> tuple[float, ...]:
    """The breaks between the pieces of a grid; files have them where there are several."""
    if kept is None:
        return WHOLE
    breaks = numbers("the pieces of a grid", kept)
    ends = len(breaks) > len(WHOLE) and (breaks[0], breaks[-1]) == WHOLE
    if not ends or len(breaks) > MOST_PIECES + 1 or np.diff(breaks).min() <= 0.0:
        raise InputError("the pieces of a grid: their ends must rise from 0 to 1")
    return tuple(breaks.tolist())


def chute_from(kept: Mapping[str, Any]) -> Chute:
    """The chute of the head of a file, with a law without a function where its own is not registered here, or is in a
    Python file that was not asked for in this process.

    Raises:
        InputError: for parameters out of range.
    """
    values = {name: kept["chute"][short] for short, name in PARAMETERS.items()}
    values["base"] = kept["chute"].get("base", "richman")
    described = isinstance(kept.get(CLOSURE), Mapping)
    try:
        # To read a file must not run another that it names.
        if described and runs_code(values["closure"]):
            values["closure"] = _unknown_law(kept[CLOSURE])
        law(values["closure"])
    except InputError:
        if not described:
            raise
        values["closure"] = _unknown_law(kept[CLOSURE])
    return Chute(**values)


def _unknown_law(kept: Mapping[str, Any]) -> Law:
    name, asked, description, source, valid = (
        str(kept[key]) for key in ("name", "asked", "description", "source", "valid")
    )
    densest = number("the densest packing of the law", kept["densest"], 0.0, 1.0)
    return Law(name, description, source, densest, Unknown(asked), valid=valid, spec=asked)


def restored(kept: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> Result:
    """The result with this head and these rows.

    Raises:
        InputError: for a head of a later format, numbers out of range, or rows that do not fit it.
    """
    require_format(kept)
    chute = chute_from(kept)
    require_law(chute, kept)
    found = [row_from(chute, row) for row in rows]
    result = _result(chute, kept, found)
    require_checksum(kept, map(unknowns, found) if chute.law.known else map(_unknowns_read, found, rows))
    return result


def _result(chute: Chute, kept: Mapping[str, Any], found: Sequence[Row]) -> Result:
    kind = kept["kind"]
    if kind == "flow":
        if len(found) != 1:
            raise InputError(f"it holds {len(found)} flows in the place of one")
        return found[0].flow
    within = SearchRange.checked(
        kept["searched"]["surface_temperature"], kept["searched"]["largest_holdup"], chute.surface
    )
    searched = Searched((within.coldest, within.hottest), within.deepest, _cells(kept["searched"]))
    tolerance, reason = check_tolerance(kept["tolerance"]), _sentence("reason", kept["reason"])
    incomplete = _sentence("incomplete", kept.get("incomplete"))
    if kind == "flows":
        flows = tuple(row.flow for row in found)
        for one, two in pairwise(flows):
            if one.surface_temperature < two.surface_temperature or _same(one, two):
                raise InputError("its flows are not from hot to cold, each once")
        return FlowSet(chute, flows, searched, tolerance, reason, incomplete)
    if kind != "curve":
        raise InputError(f"it holds an unknown kind of result, {shorten(kind)}")
    ends = [(str(begin), str(end)) for begin, end in kept["ends"]]
    if any(row.branch >= len(ends) for row in found):
        raise InputError("it holds flows of a branch that is not in it")
    branches = [_branch([row for row in found if row.branch == i], at) for i, at in enumerate(ends)]
    return Curve(chute, tuple(branches), searched, tolerance, reason, incomplete)


def _cells(kept: Mapping[str, Any]) -> Cells | None:
    cells = kept.get("cells")
    if cells is None:
        return None
    delta = number("delta", cells["delta"], 1e-6, 1e6)
    counts = [whole(name, cells[name], 0, 10**12) for name in ("number", "undecided")]
    return Cells(delta, *counts)


def _sentence(name: str, value: Any) -> str | None:
    if not (value is None or isinstance(value, str)):
        raise InputError(f"{name} = {shorten(value)}: must be a sentence or null")
    return value


def _same(one: Flow, two: Flow) -> bool:
    """Whether two flows are one and the same to the last bit."""
    return np.array_equal(one.solution.macroscopic, two.solution.macroscopic)


def require_format(kept: Mapping[str, Any]) -> None:
    """Check that the layout of a file is one that is known here.

    Raises:
        InputError: for a later one.
    """
    found = whole("format", kept["format"], 1)
    if found > FORMAT:
        raise InputError(
            f"it was written by a later chuteflow (format {found}, this one reads up to {FORMAT}): update chuteflow"
        )


def _branch(found: Sequence[Row], ends: tuple[str, str]) -> Branch:
    """The branch of these rows.

    Raises:
        InputError: for one without flows, or with one of them twice in a row.
    """
    flows: list[Flow] = []
    special: list[SpecialPoint] = []
    for row in found:
        if not row.special:
            if flows and _same(flows[-1], row.flow):
                raise InputError("it holds a flow twice")
            flows.append(row.flow)
        elif flows:
            special.append(SpecialPoint(row.special, row.flow, len(flows) - 1))
        else:
            raise InputError("it holds a branch that begins with a special point")
    if not flows:
        raise InputError("it holds a branch without flows")
    return Branch(tuple(flows), tuple(special), ends)
