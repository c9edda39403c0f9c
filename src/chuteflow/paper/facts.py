"""What is measured in each figure, as a small table of words: for pages that put numbers beside the pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from chuteflow.branches.lines import SteadyFlow, in_order
from chuteflow.paper.curves import Curves
from chuteflow.paper.figure_01 import Figure1
from chuteflow.paper.figure_03 import Figure3
from chuteflow.paper.figure_05 import Figure5
from chuteflow.paper.figure_11 import Figure11
from chuteflow.paper.figure_14 import TEMPERATURES, Figure14
from chuteflow.paper.hot_profiles import FIELDS, HotProfiles
from chuteflow.paper.sources import SteadyCurve

Row = tuple[str, ...]
_FLOW = ("flow", "Q", "h", "M", "T at the surface", "estimated relative error")


@dataclass(frozen=True)
class TextTable:
    """Rows of words under a header."""

    header: Row
    rows: Sequence[Row]


def facts(data: Any) -> TextTable:
    """The facts of a figure, from its data."""
    match data:
        case Figure1():
            return TextTable(("grains drawn", "arrows"), [(str(len(data.grains)), str(len(data.profile.height)))])
        case Curves():
            header = (data.key, "families", "Q at folds", "T at the onset of inversion", "T from", "T to")
            return TextTable(header, [row for name, found in data.curves.items() for row in _curve(str(name), found)])
        case Figure3():
            rows = [_flow(name, flow) for name, flow in data.flows.items()]
            points = (point for branch in data.curve.branches for point in branch.special)
            return TextTable(_FLOW, [*rows, *(_flow(point.kind, point.flow) for point in points)])
        case Figure5():
            hottest = f"{data.largest_temperature:.8g}", f"{data.height_of_largest:.5g}"
            header = (*_FLOW, "largest T", "at the height")
            return TextTable(header, [(*_flow("productive", data.flow), *hottest)])
        case HotProfiles():
            header = (*_FLOW, "λ", *(f"distance in {field.replace('_', ' ')}" for field in FIELDS))
            distances = (f"{data.largest_distance(field):.2%}" for field in FIELDS)
            return TextTable(header, [(*_flow("hot", data.flow), f"{data.lambda_:.5g}", *distances)])
        case Figure11():
            rows = [(f"λ = {value:.5g}", f"{slope:.6g}") for value, slope in data.marks.items()]
            return TextTable(("where", "slope"), [*rows, ("δ = 0", f"{data.slope_of_divergence:.6g}")])
        case Figure14():
            header = ("e, e_w", "points", *(f"with a flow at T = {temperature:g}" for temperature in TEMPERATURES))
            return TextTable(
                header,
                [
                    (f"{e}, {e_w}", str(len(found.exists)), *(str(int(count)) for count in found.exists.sum(axis=0)))
                    for (e, e_w), found in data.domains.items()
                ],
            )
        case _:
            return TextTable(_FLOW, list(_flows(data.flows)))


def _flows(found: Mapping[Any, SteadyFlow]) -> Iterator[Row]:
    for name, flow in found.items():
        yield _flow(name if isinstance(name, str) else ", ".join(name), flow)


def _flow(name: str, flow: SteadyFlow) -> Row:
    numbers = flow.mass_flux, flow.centre_of_mass, flow.mass_holdup, flow.surface_temperature
    return (name, *(f"{number:.6g}" for number in numbers), f"{flow.error:.0e}")


def _curve(name: str, found: SteadyCurve) -> Iterator[Row]:
    points = [point for branch in found.branches for point in in_order(branch)]
    temperatures = [point.flow.surface_temperature for point in points]
    folds = [f"{point.flow.mass_flux:.6g}" for point in points if point.special == "fold-Q"]
    onsets = [f"{point.flow.surface_temperature:.5g}" for point in points if point.special == "density-inversion"]
    ends = f"{min(temperatures):.3g}", f"{max(temperatures):.3g}"
    yield name, str(len(found.branches)), ", ".join(folds) or "none", ", ".join(onsets) or "none", *ends
