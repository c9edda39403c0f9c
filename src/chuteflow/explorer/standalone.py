"""One page that needs no server: the flows of one chute at every flux of a range, in one file."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from chuteflow.branches.results import Curve
from chuteflow.errors import SolveError
from chuteflow.explorer import queries, sentences
from chuteflow.explorer.about import about
from chuteflow.explorer.contents import curve_content, find_limits_passed, short
from chuteflow.explorer.recipes import recipes
from chuteflow.explorer.sampled import FIELDS, Deviation, SampledBranch, SampledCurve, budget, sample_curve
from chuteflow.io import contract, words
from chuteflow.parameters import LARGEST_HOLDUP, SURFACE_TEMPERATURE
from chuteflow.steady.chute import Chute
from chuteflow.steady.quantities import Scales

PAGE = Path(__file__).parent / "page"
#: Flows on the longest branch: as many as fit into the file, and bytes that it may have.
_POINTS, _LARGEST = (240, 160, 100, 60), 1_900_000
#: Fields are stored as integers up to this one, which stands for their largest value in a flow.
_WHOLE = 100_000
#: Nothing is loaded from anywhere.
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"

_IMPORT = re.compile(r'^import (?:\{ ([^}]+) \}|\* as (\w+)) from "\./(\w+)\.js";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function|const|class) (\w+))", re.MULTILINE)


def standalone(
    chute: Chute,
    flux: float,
    scales: Scales | None = None,
    *,
    surface_temperature: tuple[float, float] = SURFACE_TEMPERATURE,
    largest_holdup: float = LARGEST_HOLDUP,
    data: Sequence[Mapping[str, Any]] = (),
) -> str:
    """The page of ``chute`` as HTML, at first at ``flux``; in SI units where there are ``scales``. It draws ``data``,
    what was measured, behind the flows.

    It has every branch in the range of surface temperatures and hold-ups, and states the error of its interpolation
    at flows solved between.

    Raises:
        InputError: for a range out of bounds.
        SolveError: where a branch could not be followed, or where the file became too large.
    """
    for points in _POINTS:
        found = sample_curve(chute, points, surface_temperature, largest_holdup)
        page = _html(_content(found, flux, scales, data))
        if len(page.encode()) <= _LARGEST:
            return page
    raise SolveError("the curve has too many branches for one page: narrow the range that is searched")


# --- the data of the page ---------------------------------------------------------------------------------------------


def _content(
    found: SampledCurve, flux: float, scales: Scales | None, data: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    chute = found.curve.chute
    return {
        "about": _about(found.curve, flux, scales) | {"data": list(data)},
        "chute": contract.chute_object(chute),
        "curve": curve_content(found.curve, scales),
        "limits": {"words": [find_limits_passed(branch) for branch in found.curve.branches]},
        "branches": [_branch(one) for one in found.branches],
        "recipes": recipes(chute, FLUX_PLACE, scales),
        "says": list(_notes(found, scales)),
        "error": max([found.deviation.place, found.deviation.budget, *found.deviation.fields.values()]),
    }


#: What stands for the flux in the command lines of a page that has none of its own.
FLUX_PLACE = "{flux}"


def _about(curve: Curve, flux: float, scales: Scales | None) -> dict[str, Any]:
    """Metadata for the page: one case, and the flux as the only control."""
    fluxes = [float(q) for branch in curve.branches for q in branch.mass_flux] or [*queries.FLUX_RANGE]
    control = replace(queries.CONTROLS["Q"], low=_round_down(min(fluxes)), high=-_round_down(-max(fluxes)))
    state = contract.chute_object(curve.chute) | {"Q": min(max(flux, control.low), control.high), "stability": ""}
    if scales is not None:
        state |= {"si": "1", "d": 1e3 * scales.diameter, "rho": scales.density}
    preset = queries.Preset("this chute", state)
    return about() | {
        "controls": {"Q": asdict(control)},
        "presets": [asdict(preset)],
        "cases": [],
        "choices": {},
        "fixed": [name for name in state if name != "Q"],
    }


def _round_down(value: float, digits: int = 4) -> float:
    size = 10.0 ** (np.floor(np.log10(abs(value))) + 1 - digits)
    return float(f"{np.floor(value / size) * size:.{digits + 1}g}")


def _branch(one: SampledBranch) -> dict[str, Any]:
    largest = np.maximum(np.abs(one.fields).max(axis=2), 1e-300)
    whole = np.round(one.fields / largest[..., None] * _WHOLE).astype(int)
    flows = one.branch.flows
    return {
        "heights": short(one.heights),
        "top": short(one.top),
        "fields": {
            name: {"unit": short(largest[:, i] / _WHOLE), "rows": whole[:, i].tolist()} for i, name in enumerate(FIELDS)
        },
        "budget": {name: short(one.budget[:, i]) for i, name in enumerate(budget(flows[0]))},
        "names": [flow.name for flow in flows],
        "kinds": [sentences.kinds(flow) for flow in flows],
    }


def _notes(found: SampledCurve, scales: Scales | None) -> list[str]:
    """What was searched, what the page holds, and its error."""
    curve = found.curve
    says = [f"{words.chute(curve.chute)}."]
    if scales is not None:
        says.append(f"{words.scales(scales)}.")
    says.append(f"{words.searched(curve.searched, curve.chute, scales)}. Outside this range nothing is known.")
    if curve.incomplete:
        says.append(words.in_own_units(f"There may be more flows: {curve.incomplete}", scales) + ".")
    if curve.branches:
        says.append(_accuracy(found))
    return says


def _accuracy(found: SampledCurve) -> str:
    stored, errors = sum(len(one.branch.flows) for one in found.branches), found.deviation
    return (
        f"The page holds {stored} solved flows and interpolates between them. It was compared with {errors.flows} "
        f"flows solved between them: {_errors_in_words(errors)}. Where Q is as near to a fold as that, a flow too many "
        "or too few may be shown. Names, kinds and limits of the theory are those of the nearest solved flow. "
        "Stability was not examined."
    )


def _errors_in_words(errors: Deviation) -> str:
    symbols = {"nu": "volume fraction", "T": "granular temperature", "u": "velocity"}
    fields = ", ".join(f"{_percent(errors.fields[symbol])} in the {name}" for symbol, name in symbols.items())
    rates = max(errors.fields["production"], errors.fields["dissipation"])
    return (
        f"errors are at most {_percent(errors.place)} in Q, h, M and T_surface, {fields}, each relative to the largest "
        f"value of the profile, and {_percent(rates)} in rates of energy"
    )


def _percent(fraction: float) -> str:
    """A fraction with one digit, rounded up."""
    return f"{-_round_down(-100.0 * fraction, 1):g} %" if fraction else "0 %"


# --- the file ---------------------------------------------------------------------------------------------------------


def _html(content: dict[str, Any]) -> str:
    page = (PAGE / "index.html").read_text(encoding="utf-8")
    icon = (PAGE / "icon.svg").read_text(encoding="utf-8")
    # No "<" in the data can end the element that holds it.
    data = json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    for link, instead in (
        ('<html lang="en">', '<html lang="en" class="standalone">'),
        (
            '<meta charset="utf-8">',
            f'<meta charset="utf-8">\n<meta http-equiv="content-security-policy" content="{_POLICY}">',
        ),
        ('<link rel="icon" href="page/icon.svg">', f'<link rel="icon" href="data:image/svg+xml,{_quote(icon)}">'),
        (
            '<link rel="stylesheet" href="page/style.css">',
            f"<style>\n{(PAGE / 'style.css').read_text(encoding='utf-8')}</style>",
        ),
        ('<script type="module" src="page/main.js"></script>\n', ""),
        (
            "</body>",
            f'<script type="application/json" id="standalone-data">{data}</script>\n'
            f"<script>\n{bundle('main')}</script>\n</body>",
        ),
    ):
        if page.count(link) != 1:
            raise SolveError(f"the page has no place for what belongs to {link}")
        page = page.replace(link, instead)
    return page


def _quote(text: str) -> str:
    from urllib.parse import quote

    return quote(text)


def bundle(entry: str) -> str:
    """The module ``entry`` of the page and all that it imports as one script."""
    parts: dict[str, str] = {}
    _add(entry, parts)
    return "(async () => {\n" + "".join(parts.values()) + "})();\n"


def _add(name: str, parts: dict[str, str]) -> None:
    """Add a module after those that it imports: a function that is called at once and returns what it exports."""
    if name in parts:
        return
    text = (PAGE / f"{name}.js").read_text(encoding="utf-8")
    for _, _, other in _IMPORT.findall(text):
        _add(other, parts)

    def taken(found: re.Match[str]) -> str:
        names, whole, other = found.groups()
        wanted = whole or "{ " + names.replace(" as ", ": ") + " }"
        return f"const {wanted} = module_{other};\n"

    exported = _EXPORT.findall(text)
    body = _EXPORT.sub("", _IMPORT.sub(taken, text))
    parts[name] = f"const module_{name} = await (async () => {{\n{body}\nreturn {{ {', '.join(exported)} }};\n}})();\n"
