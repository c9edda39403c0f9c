"""What a file keeps of a result so that it loads back to the last bit: the discretised unknowns of its flows.

The continuous problem is rebuilt from the parameters of the chute; the rest is (degree, stretch, z, macroscopic,
error, status) of every flow.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chuteflow.analysis.results import KINDS, Branch, Curve, FlowSet, Searched, SpecialPoint
from chuteflow.errors import InputError
from chuteflow.faces.contract import PARAMETERS, chute_object, finite
from chuteflow.paper.branches import in_order
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import Collocation
from chuteflow.steady.flow import Flow
from chuteflow.steady.model import model
from chuteflow.steady.solver import Solution, Status

#: What can be saved and loaded, and its names in the files.
Result = Flow | FlowSet | Curve
KIND_OF = {Flow: "flow", FlowSet: "flows", Curve: "curve"}

#: Heights of saved profiles, from the base to the depth of each flow.
HEIGHTS = 101
#: Version of the layout of the files; a file of a later one is refused.
FORMAT = 1
#: Largest difference of ln Q, ln h, ln M and ln T_surface between a file and the flow rebuilt from it.
_AGREEMENT = 1e-6
#: Degree of the finest grid that is believed.
_FINEST = 10_000


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


def head(result: Result) -> dict[str, Any]:
    """All that a file keeps beside the rows, as JSON values."""
    kept: dict[str, Any] = {
        "format": FORMAT,
        "kind": KIND_OF[type(result)],
        "chute": chute_object(result.chute),
    }
    if not isinstance(result, Flow):
        kept |= {
            "searched": {
                "surface_temperature": list(result.searched.surface_temperature),
                "largest_holdup": result.searched.largest_holdup,
            },
            "tolerance": result.tolerance,
            "reason": result.reason,
        }
    if isinstance(result, FlowSet):
        kept["incomplete"] = result.incomplete
    if isinstance(result, Curve):
        kept["ends"] = [list(branch.ends) for branch in result.branches]
    return kept


def unknowns(row: Row) -> dict[str, Any]:
    """A discretised flow and its place in the result, as JSON values."""
    solution = row.flow.solution
    return {
        "degree": solution.problem.degree,
        "stretch": float(np.reshape(solution.problem.stretch, ())),
        "z": solution.z.tolist(),
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
    problem = Collocation(model(chute), int(kept["degree"]), float(kept["stretch"]))
    z = np.array(kept["z"], dtype=float)
    macroscopic = np.array([np.nan if v is None else v for v in kept["macroscopic"]], dtype=float)
    if not 2 <= problem.degree <= _FINEST or z.shape != (problem.degree + 3,) or macroscopic.shape != (4,):
        raise InputError("a flow has the wrong number of unknowns")
    error = np.inf if kept["error"] is None else float(kept["error"])
    solution = Solution(macroscopic, error, Status[kept["status"]], (problem, z))
    if solution.converged:
        with np.errstate(all="ignore"):
            distance = np.abs(problem.state(z).macroscopic() - macroscopic).max()
        if not distance <= _AGREEMENT:
            raise InputError("the unknowns of a flow do not give its mass flux, centre of mass and hold-up")
    return Row(Flow(chute, solution), int(kept["branch"]), str(kept["special"]))


def chute_from(kept: dict[str, Any]) -> Chute:
    """The chute that ``chute_object`` came from."""
    return Chute(**{name: kept[short] for short, name in PARAMETERS.items()})


def rebuilt(kept: dict[str, Any], found: Sequence[Row]) -> Result:
    """The result with this head and these rows.

    Raises:
        InputError: for a head of a later format, or rows that do not fit it.
    """
    kind, chute = kept["kind"], chute_from(kept["chute"])
    if kind == "flow":
        (row,) = found
        return row.flow
    low, high = kept["searched"]["surface_temperature"]
    searched = Searched((float(low), float(high)), float(kept["searched"]["largest_holdup"]))
    if kind == "flows":
        told = float(kept["tolerance"]), kept["reason"], kept.get("incomplete")
        return FlowSet(chute, tuple(row.flow for row in found), searched, *told)
    if kind != "curve":
        raise InputError(f"it holds an unknown kind of result, {kind!r}")
    branches = [
        _branch([row for row in found if row.branch == i], (str(begin), str(end)))
        for i, (begin, end) in enumerate(kept["ends"])
    ]
    return Curve(chute, tuple(branches), searched, float(kept["tolerance"]), kept["reason"])


def require_format(kept: Mapping[str, Any]) -> None:
    """Check that the layout of a file is one that is known here.

    Raises:
        InputError: for a later one.
    """
    if int(kept["format"]) > FORMAT:
        raise InputError(
            f"it was written by a later chuteflow (format {kept['format']}, this one reads up to {FORMAT}): "
            "update chuteflow"
        )


def _branch(found: Iterable[Row], ends: tuple[str, str]) -> Branch:
    flows: list[Flow] = []
    special: list[SpecialPoint] = []
    for row in found:
        if not row.special:
            flows.append(row.flow)
        elif row.special in KINDS and flows:
            special.append(SpecialPoint(row.special, row.flow, len(flows) - 1))
        else:
            raise InputError(f"it holds an unknown kind of special point, {row.special!r}")
    return Branch(tuple(flows), tuple(special), ends)
