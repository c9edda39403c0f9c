"""``chuteflow compare``: a measured flow beside the flows of the theory and the functions of its laws."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.errors import InputError

if TYPE_CHECKING:
    from chuteflow.dem.comparison import Candidate, Comparison, Difference
    from chuteflow.dem.measured import Measured
    from chuteflow.dem.recovery import Recovery

_EPILOG = (
    "RUN is what `chuteflow dem` has written, .nc or .csv, or a CSV of another code, see the page on simulations. "
    "Flows of the theory have the measured hold-up M, or the measured flux Q; the roughness r follows from the "
    "distance of the bumps by (2.8), or from the area of a bump.\n\n"
    "Example: chuteflow compare run.nc --with lun,garzo-dufty-fourier --plot compared.png"
)
#: What is compared with of each law.
_COLUMNS = (
    "mass_flux",
    "mass_holdup",
    "mean_temperature",
    "slip_velocity",
    *("volume_fraction", "granular_temperature", "velocity"),
)
_SYMBOLS = {
    "mass_flux": "Q",
    "mass_holdup": "M",
    "mean_temperature": "T_mean",
    "slip_velocity": "u_b",
    "volume_fraction": "nu(p)",
    "granular_temperature": "T(p)",
    "velocity": "u(p)",
}
_SAVED = (".json", ".csv")


@click.command("compare", help=COMMANDS["compare"], epilog=_EPILOG)
@click.argument("run", metavar="RUN")
@click.option(
    "--with",
    "closures",
    metavar="NAME",
    multiple=True,
    help="A closure to compare with, as in compare-closures; all of the list by default.",
)
@options.option("--roughness", type=options.Number(), help="Roughness r, instead of that of the run.")
@options.option(
    "--ew",
    type=options.Number(),
    help="Coefficient of restitution of a grain and the base, if not in the run.",
)
@options.option("--fit", metavar="NAMES", help="Find these parameters from the profiles too, such as e,ew,roughness.")
@options.output_options(_SAVED, "profiles and functions")
def command(run: str, closures: tuple[str, ...], **given: Any) -> None:
    """Read, compare, tell and draw."""
    from functools import partial

    options.require_outputs(given, _SAVED)
    from chuteflow.dem import records
    from chuteflow.dem.comparison import MAPPINGS, compare
    from chuteflow.plotting.comparison_plot import plot_comparison

    measured = _with_parameters(records.load(run), given["roughness"], given["ew"])
    mappings = tuple(MAPPINGS) if given["roughness"] is None else ("spacing",)
    names = options.closure_names(closures)
    found = compare(measured, names, mappings)
    fits = [] if given["fit"] is None else _fits(measured, names, given["fit"])
    content = _content(found) | ({} if given["fit"] is None else _content_of_fits(fits))
    report = chain(_report(found), _report_fits(measured, fits) if fits else ())
    options.deliver_object(given, content, report, partial(_rows, found), partial(plot_comparison, found))


def _fits(measured: Measured, closures: Sequence[str], free: str) -> list[tuple[str, Recovery | str]]:
    """For each closure the fit, or why there is none."""
    from chuteflow.dem.recovery import recover
    from chuteflow.errors import ChuteflowError
    from chuteflow.steady.free import choose_parameters

    names = [name.strip() for name in free.split(",") if name.strip()]
    if not names:
        raise InputError("--fit: which parameters are to be found, for example --fit e,ew,roughness?")
    choose_parameters(measured.chute(measured.roughness), names, {})
    found: list[tuple[str, Recovery | str]] = []
    for closure in closures:
        try:
            found.append((closure, recover(measured, closure, names)))
        except ChuteflowError as error:
            found.append((closure, str(error)))
    return found


def _content_of_fits(fits: Sequence[tuple[str, Recovery | str]]) -> dict[str, Any]:
    from chuteflow.io.fit_records import comparison_object

    done = [one.fit for _, one in fits if not isinstance(one, str)]
    return comparison_object(done, [f"{closure}: {one}" for closure, one in fits if isinstance(one, str)])


def _report_fits(measured: Measured, fits: Sequence[tuple[str, Recovery | str]]) -> Iterator[str]:
    from chuteflow.dem.recovery import FITTED
    from chuteflow.io import tables

    own = {"e": measured.restitution, "ew": measured.wall_restitution, "roughness": measured.roughness_by_area}
    yield ""
    yield (
        f"fitted to nu, T and u over p/M from {FITTED[0]:g} to {FITTED[1]:g}, the height of the base unknown; errors "
        "are widened where the theory does not hold within them"
    )
    header = ["closure", "parameter", "fitted", "error", "interval", "", "simulated", "errors widened"]
    rows, reasons = [], []
    for closure, one in fits:
        if isinstance(one, str):
            reasons.append(f"{closure}: no fit: {one}")
            continue
        for estimate in one.fit.estimates:
            ends = (tables.number(estimate.interval.low), tables.number(estimate.interval.high))
            real = tables.number(own[estimate.key]) if estimate.key in own else ""
            value = tables.number(estimate.value)
            rows.append([closure, estimate.key, value, f"{estimate.error:.2g}", *ends, real, f"{one.widening:.1f}"])
    if rows:
        yield tables.table([header, *rows], words=(0, 1))
    yield from reasons


def _with_parameters(measured: Measured, roughness: float | None, ew: float | None) -> Measured:
    from dataclasses import replace

    changed = {name: value for name, value in (("roughness", roughness), ("wall_restitution", ew)) if value is not None}
    return replace(measured, **changed)


def _content(found: Comparison) -> dict[str, Any]:
    from chuteflow.io.contract import finite, flow_object

    def formatted(rows: Sequence[Difference]) -> list[dict[str, Any]]:
        return [
            {
                "quantity": one.name,
                "measured": finite(one.measured),
                "theory": finite(one.theory),
                "relative": finite(one.relative),
                "relative_error": finite(one.error),
                "verdict": one.agreement,
            }
            for one in rows
        ]

    measured = found.measured
    return {
        "run": {
            "slope": measured.slope,
            "e": measured.restitution,
            "ew": finite(measured.wall_restitution),
            "roughness": finite(measured.roughness),
            "roughness_by_area": finite(measured.roughness_by_area),
            "steadiness": measured.steadiness,
            "numbers": {name: finite(value) for name, value in measured.numbers.items()},
            "number_errors": {name: finite(value) for name, value in measured.number_errors.items()},
        },
        "flows": [
            {
                "closure": one.closure,
                "mapping": one.mapping,
                "condition": one.condition,
                "flow": flow_object(one.flow),
                "differences": formatted(one.differences),
            }
            for one in found.candidates
        ],
        "functions": [{"closure": one.closure, "differences": formatted(one.differences)} for one in found.functions],
        "reasons": [
            dict(zip(("closure", "mapping", "condition", "reason"), row, strict=True)) for row in found.reasons
        ],
    }


def _report(found: Comparison) -> Iterator[str]:
    from chuteflow.dem.comparison import sentences
    from chuteflow.io import tables

    measured = found.measured
    yield (
        f"measured: slope {measured.slope:g}, e {measured.restitution:g}, e_w {measured.wall_restitution:g}, "
        f"r {measured.roughness:.4g} by spacing and {measured.roughness_by_area:.4g} by area; "
        + ", ".join(
            _number(measured, name) for name in ("mass_flux", "mass_holdup", "mean_temperature", "slip_velocity")
        )
    )
    yield f"the run is {_steadiness(measured)}"
    yield ""
    yield (
        "flows of the theory: measured minus theory in %, and in standard errors (of those with the same flux, the one "
        "with the nearest hold-up)"
    )
    header = ["closure", "r by", "same", "Q theory", *(_SYMBOLS[name] for name in _COLUMNS)]
    rows = [
        [
            one.closure,
            one.mapping,
            one.condition,
            tables.number(one.flow.mass_flux),
            *(_cell(one.differences, name) for name in _COLUMNS),
        ]
        for one in _choose_shown(found)
    ]
    yield tables.table([header, *rows], words=(0, 1, 2)) if rows else "none has this hold-up or flux"
    for closure, mapping, condition, reason in found.reasons:
        yield f"{closure}, r by {mapping}, same {condition}: no flow: {reason}"
    yield ""
    yield (
        "functions at the measured state, p/M from 0.1 to 0.8, and the base: measured minus law in %, and in standard "
        "errors"
    )
    names = list(dict.fromkeys(d.name for one in found.functions for d in one.differences))
    rows = [[one.closure, *(_cell(one.differences, name) for name in names)] for one in found.functions]
    yield tables.table([["closure", *names], *rows], words=(0,))
    yield ""
    yield from sentences(found)


def _choose_shown(found: Comparison) -> Iterator[Candidate]:
    """The flows at the measured hold-up, and of those at the measured flux the one whose hold-up is nearest."""
    groups: dict[tuple[str, str, str], list[Candidate]] = {}
    for one in found.candidates:
        groups.setdefault((one.closure, one.mapping, one.condition), []).append(one)
    for (_, _, condition), each in groups.items():
        if condition == "M":
            yield from each
        else:
            yield min(each, key=lambda one: abs(one.flow.mass_holdup - found.measured.holdup))


def _number(measured: Measured, name: str) -> str:
    value, error = measured.numbers.get(name), measured.number_errors.get(name)
    if value is None:
        return f"{_SYMBOLS[name]} not known"
    return f"{_SYMBOLS[name]} {value:.4g}" + (f" ± {error:.1g}" if error else "")


def _steadiness(measured: Measured) -> str:
    if not measured.drifts:
        return "not known to be steady: it has no time series"
    formatted = ", ".join(
        f"{name.replace('_', ' ')} {100.0 * one.value:+.2f} ± {100.0 * one.error:.2f} %"
        for name, one in measured.drifts.items()
    )
    words = {"steady": "steady", "not steady": "not steady", "undecided": "not shown to be steady"}
    return f"{words[measured.steadiness]}; drift over 300 time units: {formatted}"


def _cell(rows: Sequence[Difference], name: str) -> str:
    for one in rows:
        if one.name == name:
            errors = f" ({one.errors:+.0f})" if one.errors == one.errors else ""
            return f"{100.0 * one.relative:+.1f}{errors}" if one.relative == one.relative else "-"
    return ""


def _rows(found: Comparison) -> list[list[str]]:
    header = ["closure", "mapping", "condition", "quantity", "measured", "theory", "relative", "relative_error"]

    def cells(one: Difference) -> list[str]:
        return [one.name.replace(",", ";"), *(f"{v!r}" for v in (one.measured, one.theory, one.relative, one.error))]

    rows = [[c.closure, c.mapping, c.condition, *cells(one)] for c in found.candidates for one in c.differences]
    return [header, *rows, *([f.closure, "", "", *cells(one)] for f in found.functions for one in f.differences)]
