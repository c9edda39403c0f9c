"""Answers to the questions of the page, made in a process beside the server."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chuteflow.analysis.curve import curve
from chuteflow.analysis.enumeration import flows
from chuteflow.analysis.results import KINDS, Branch, FlowSet
from chuteflow.errors import ChuteflowError, InputError
from chuteflow.faces import contract, words
from chuteflow.faces.explorer import queries
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow

Query = Mapping[str, str]

#: Relative error allowed: far below what can be seen on a page. Exports are exact.
_VISIBLE = 1e-6
_CURVE_POINTS = 120
_HEIGHTS = 81
#: Profiles reach so many times the largest centre of mass.
_TOP = 2.5
_FIELDS = {"z": "height", "nu": "volume_fraction", "T": "granular_temperature", "u": "velocity"}
_DIGITS = 7
_COUNTS = ("No flow carries", "One flow carries", "Two flows share", "Three flows share", "Four flows share")


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
        return problem(422, str(error))


def problem(status: int, what: str) -> Answer:
    """An answer that says what went wrong."""
    return _json({"error": " ".join(what.split())}, status)


def _json(content: Any, status: int = 200) -> Answer:
    return Answer(status, "application/json", json.dumps(content, allow_nan=False).encode())


def _flows(query: Query) -> Answer:
    chute, other = queries.read(query, other=("Q",))
    flux = queries.flux(other["Q"])
    found = flows(chute, Q=flux, tolerance=_VISIBLE)
    top = _TOP * max((flow.centre_of_mass for flow in found), default=1.0)
    content = contract.flow_set_object(found)
    for flow, entry in zip(found, content["flows"], strict=True):
        entry |= {
            "profile": _profile(flow, top),
            "budget": asdict(flow.energy_budget) | {"heat_from_base": flow.energy_budget.heat_from_base},
            "words": f"{words.among(flow, found)}: {words.kinds(flow)}",
            "name": words.among(flow, found),
        }
    return _json(content | {"top": top, "says": _says(found, flux), "recipes": _recipes(chute, flux)})


def _profile(flow: Flow, top: float) -> dict[str, list[float]]:
    profile = flow.sampled(_HEIGHTS, min(top, flow.interface_height))
    return {symbol: _short(getattr(profile, name)) for symbol, name in _FIELDS.items()}


def _short(values: np.ndarray) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in values]


def _says(found: FlowSet, flux: float) -> str:
    count = len(found)
    lead = _COUNTS[count] if count < len(_COUNTS) else f"{count} flows share"
    if not count:
        return f"{lead} Q = {flux:.4g}: {found.reason}."
    return f"{lead} the flux Q = {flux:.4g}."


def _recipes(chute: Chute, flux: float) -> dict[str, str]:
    """The command and the lines of Python that give the same flows."""
    options = " ".join(f"--{short} {_text(value)}" for short, value in contract.chute_object(chute).items())
    arguments = ", ".join(f"{name}={value!r}" for name, value in chute.as_dict().items())
    return {
        "command": f"chuteflow solve {options} --flux {_text(flux)}",
        "python": f"import chuteflow\nchute = chuteflow.Chute({arguments})\nflows = chuteflow.flows(chute, Q={flux!r})",
    }


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else repr(value)


def _curve(query: Query) -> Answer:
    chute, _ = queries.read(query)
    found = curve(chute, points=_CURVE_POINTS, tolerance=_VISIBLE)
    content = contract.curve_object(found)
    for branch, entry in zip(found.branches, content["branches"], strict=True):
        entry |= _rounded(branch) | {"density": [flow.density for flow in branch.flows]}
    says = f"{words.multiplicity(found, None)}." if found.branches else f"No flow at any flux: {found.reason}."
    return _json(content | {"says": says[0].upper() + says[1:], "kinds": KINDS})


def _rounded(branch: Branch) -> dict[str, list[float]]:
    names = {"Q": "mass_flux", "h": "centre_of_mass", "M": "mass_holdup", "T_surface": "surface_temperature"}
    return {symbol: _short(getattr(branch, name)) for symbol, name in names.items()}


def _export(query: Query) -> Answer:
    from chuteflow.faces import files, plots

    chute, other = queries.read(query, other=("Q", "what", "format"))
    kinds: dict[str, Callable[[], Any]] = {
        "profiles": lambda: flows(chute, Q=queries.flux(other["Q"])),
        "curve": lambda: curve(chute),
    }
    media = {"csv": "text/csv", "svg": "image/svg+xml", "png": "image/png"}
    for name, table in (("what", kinds), ("format", media)):
        if other[name] not in table:
            raise InputError(f"{name} = {other[name][:40]!r}: choose one of {', '.join(table)}")
    what, suffix = other["what"], other["format"]
    result = kinds[what]()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"chuteflow-{what}.{suffix}"
        if suffix == "csv":
            files.save(result, path)
        else:
            plots.write_figure((plots.plot_flows if what == "profiles" else plots.plot_curve)(result), path)
        return Answer(200, media[suffix], path.read_bytes(), path.name)


#: What can be asked, by the last part of its address.
QUESTIONS: dict[str, Callable[[Query], Answer]] = {
    "flows": _flows,
    "curve": _curve,
    "export": _export,
}
