"""Answers to the questions of the page, computed in a worker process of the server."""

from __future__ import annotations

import base64
import json
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from chuteflow.branches.curve import curve
from chuteflow.branches.enumeration import flows
from chuteflow.branches.results import Curve
from chuteflow.checks import number_in
from chuteflow.errors import ChuteflowError, InputError
from chuteflow.explorer import queries, sentences
from chuteflow.explorer.contents import curve_content, find_limits_passed, short
from chuteflow.explorer.heights import sample_heights
from chuteflow.explorer.queries import GRAINS, Query
from chuteflow.explorer.recipes import recipes
from chuteflow.explorer.sampled import FIELDS, TOP, budget
from chuteflow.io import contract
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import PARAMETERS
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow
from chuteflow.steady.quantities import NUMBERS

#: Relative error allowed: too small to be visible on a page. Exports use the default tolerance.
_VISIBLE = 1e-6
#: Flows of the curve, which the page joins smoothly: half a pixel from the curve through very many.
_CURVE_POINTS = 60
#: Linear interpolation between two heights of a profile is accurate to this fraction of a field's largest value.
_STRAIGHT = 7e-4
#: Other errors of a computation, after which the process goes on.
_FAILURES = (ArithmeticError, ValueError, LookupError)


@dataclass(frozen=True)
class Answer:
    """What is sent back: a status of HTTP, a media type, the bytes, and a file name for downloads."""

    status: int
    media: str
    body: bytes
    name: str | None = None


def answer(question: str, query: Query) -> Answer:
    """The answer to one of QUESTIONS; a bad query or a failure is an answer too."""
    try:
        return QUESTIONS[question](query)
    except InputError as error:
        return problem(400, str(error))
    except ChuteflowError as error:
        return leave_out(question, query, str(error))
    except _FAILURES as error:
        return leave_out(question, query, f"the computation failed ({type(error).__name__}: {error})")


def problem(status: int, what: str) -> Answer:
    """An answer that says what went wrong."""
    return _json({"error": " ".join(what.split())}, status)


#: What is left out where a question has no answer.
_LEFT_OUT = {
    "flows": "the flows at this flux are left out",
    "curve": "the curve of all flows is left out",
    "limits": "where the curve passes limits of the theory is left out",
    "map": "this column of the map is left out",
    "export": "this file is left out",
    "data": "this file is not read",
    "stability": "the stability of this flow is left out",
}


def leave_out(question: str, query: Query, why: str) -> Answer:
    """An answer that says what is left out and why; in place of flows, also how to compute them elsewhere."""
    content: dict[str, Any] = {"error": " ".join(f"{_LEFT_OUT[question]}: {why}".split())}
    if question == "flows":
        chute, other = queries.read(query, other=("Q",), optional=GRAINS)
        ways = recipes(chute, queries.flux(other["Q"]), queries.scales(other))
        content |= {"chute": contract.chute_object(chute), "flows": [], "recipes": ways}
    return _json(content, 422)


def _json(content: Any, status: int = 200) -> Answer:
    return Answer(status, "application/json", json.dumps(content, allow_nan=False).encode())


def _flows(query: Query) -> Answer:
    chute, other = queries.read(query, other=("Q",), optional=GRAINS)
    flux, scales = queries.flux(other["Q"]), queries.scales(other)
    found = flows(chute, Q=flux, tolerance=_VISIBLE)
    top = TOP * max((flow.centre_of_mass for flow in found), default=1.0)
    shown = [
        {
            **_place(flow),
            "profile": _profile(flow, top),
            "budget": budget(flow),
            **sentences.of_flow(flow, found),
        }
        for flow in found
    ]
    return _json(
        {
            "chute": contract.chute_object(chute),
            "flows": shown,
            "top": top,
            "says": sentences.of_flows(found, flux, scales),
            "recipes": recipes(chute, flux, scales),
        }
    )


def _place(flow: Flow) -> dict[str, Any]:
    """Where a flow is on the curve, how well that is known, and how far the flow keeps to the theory."""
    numbers = {NUMBERS[name].symbol: contract.finite(getattr(flow, name)) for name in contract.PLACE}
    return numbers | {"error": contract.finite(flow.error), "validity": contract.validity_object(flow)}


def _profile(flow: Flow, top: float) -> dict[str, list[float]]:
    """Fields over height, at heights so close that linear interpolation between them is accurate."""

    def sample(log_share: Array) -> Array:
        found = flow.at_overburden(np.exp(log_share))
        return np.array([found.height, *(getattr(found, name) for name in FIELDS.values())])

    heights, *found = sample_heights(sample, TOP * flow.centre_of_mass, min(top, flow.interface_height), _STRAIGHT)
    return {"z": short(heights)} | {name: short(field) for name, field in zip(FIELDS, found, strict=True)}


def _curve(query: Query) -> Answer:
    chute, other = queries.read(query, optional=GRAINS)
    scales = queries.scales(other)
    found = _solve_curve(chute)
    return _json(curve_content(found, scales))


def _limits(query: Query) -> Answer:
    chute, _ = queries.read(query)
    return _json({"words": [find_limits_passed(branch) for branch in _solve_curve(chute).branches]})


@lru_cache(maxsize=4)
def _solve_curve(chute: Chute) -> Curve:
    """The curve as the page draws it; a query refers to its flows by their indices."""
    return curve(chute, points=_CURVE_POINTS, tolerance=_VISIBLE)


def _map(query: Query) -> Answer:
    from chuteflow.explorer.domains import map_column

    return _json(asdict(map_column(queries.map_column(query))))


def _stability(query: Query) -> Answer:
    from chuteflow.explorer.growth import examine_stability

    at_flux = "branch" not in query
    chute, other = queries.read(query, other=("Q", "flow") if at_flux else ("branch", "point"), optional=GRAINS)
    scales = queries.scales(other)
    if at_flux:
        found = flows(chute, Q=queries.flux(other["Q"]), tolerance=_VISIBLE)
        flow = found[queries.place("flow", other, len(found))]
    else:
        branches = _solve_curve(chute).branches
        branch = branches[queries.place("branch", other, len(branches))]
        flow = branch.flows[queries.place("point", other, len(branch.flows))]
    known = examine_stability(flow)
    says, waves = sentences.of_stability(known, chute, scales), sentences.of_waves(known, chute, scales)
    return _json(asdict(known) | {"says": says, "waves": waves})


def _export(query: Query) -> Answer:
    from chuteflow.io import files
    from chuteflow.plotting import plots

    chute, other = queries.read(query, other=("Q", "what", "format"), optional=GRAINS)
    scales = queries.scales(other)
    kinds: dict[str, Callable[[], Any]] = {
        "profiles": lambda: flows(chute, Q=queries.flux(other["Q"])),
        "curve": lambda: curve(chute),
    }
    if (other["what"], other["format"]) == ("page", "html"):
        from chuteflow.explorer.standalone import standalone

        page = standalone(chute, queries.flux(other["Q"]), scales)
        return Answer(200, "text/html", page.encode(), "chuteflow.html")
    media = {"csv": "text/csv", "svg": "image/svg+xml", "png": "image/png"}
    for name, table in (("what", kinds), ("format", media)):
        if other[name] not in table:
            raise InputError(f"{name} = {other[name][:40]!r}: choose one of {', '.join(table)}")
    what, suffix = other["what"], other["format"]
    result = kinds[what]()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"chuteflow-{what}.{suffix}"
        if suffix == "csv":
            files.save(result, path, scales=scales)
        else:
            draw = plots.plot_flows if what == "profiles" else plots.plot_curve
            plots.write_figure(draw(result, scales=scales), path)
        return Answer(200, media[suffix], path.read_bytes(), path.name)


def _data(query: Query) -> Answer:
    """What was measured, from a file that was sent: its ``name`` and its ``content`` in base64."""
    from chuteflow.explorer.data import read_sent

    name, slope = queries.file_name(query), query.get("slope")
    content = base64.b64decode(query["content"])
    at = None if slope is None else PARAMETERS["slope"].checked(number_in("slope", slope, 0.0))
    return _json({"data": read_sent(name, content, slope=at, scales=queries.scales(query))})


#: What can be asked, by the last part of its address.
QUESTIONS: dict[str, Callable[[Query], Answer]] = {
    "flows": _flows,
    "curve": _curve,
    "limits": _limits,
    "map": _map,
    "stability": _stability,
    "export": _export,
    "data": _data,
}
