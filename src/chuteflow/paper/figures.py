"""The figures of the paper that can be drawn: a new one is one module here, and one row in the table.

A module has ``compute(source)``, which gives the data of the figure from flows of a source, and ``draw(data)``, which
makes a matplotlib figure of it.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol, cast

from chuteflow.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chuteflow.paper.data import FigureData
    from chuteflow.paper.sources import Source

#: Numbers and titles.
FIGURES = {
    1: "The coordinates",
    2: "Profiles of the three flows at mass flux 3",
    3: "Centre of mass, mass hold-up and mass flux along the branch of flows",
    4: "Centre of mass against mass flux over slopes",
    5: "Profiles of a productive flow",
    6: "Centre of mass against mass flux of productive flows",
    7: "Volume fraction with either surface condition",
    8: "Centre of mass against mass flux with either surface condition",
    9: "Centre of mass against mass flux over slopes, interface conditions",
    10: "Centre of mass against mass flux of hot flows, logarithmic",
    11: "Parameters of hot flows against slope",
    12: "Expansion of a hot flow against the full equations",
    13: "Reduced system at lambda = 1 against the full equations",
    14: "Where flows exist, in the plane of slope and roughness",
    15: "Profiles with either heat flux",
    16: "Parts of the heat flux",
    17: "Centre of mass against mass flux with either heat flux",
}

#: Methods to compute flows by; the first is the default.
METHODS = ("overburden", "mapped")
#: Figures that the choice of a method does not change, and why: their ``compute`` takes no source.
WITHOUT_METHOD = {
    1: "a sketch",
    11: "the reduced model alone",
    14: "a search from the surface down, and the reduced model",
}


class FigureModule(Protocol):
    """What a module of a figure offers."""

    @property
    def compute(self) -> Callable[..., FigureData]:
        """The data, from a source of flows, by default the overburden method."""
        ...

    def draw(self, data: Any) -> Figure:
        """The picture of the data."""
        ...


def figure(number: int) -> FigureModule:
    """The module of figure ``number``, a key of FIGURES."""
    if number not in FIGURES:
        raise KeyError(number)
    return cast("FigureModule", import_module(f"chuteflow.paper.figure_{number:02d}"))


def compute(number: int, source: Source) -> FigureData:
    """The data of figure ``number`` from the flows of ``source``."""
    module = figure(number)
    return module.compute() if number in WITHOUT_METHOD else module.compute(source)


@style.own_settings()
def drawn(number: int, data: FigureData) -> Figure:
    """The picture of ``data``, with a line above it where a method does not reach all flows."""
    from chuteflow.plotting import style

    picture = figure(number).draw(data)
    if incomplete(data):
        style.caption(picture, "lines end where the method does not converge: see the data")
    return picture


def incomplete(data: FigureData) -> bool:
    """Whether flows of a figure are missing because a method does not reach them."""
    from chuteflow.paper.sources import NOT_REACHED

    return any(note.startswith(NOT_REACHED) for note in data.table().notes)


def method_note(number: int, source: Source) -> str:
    """The method behind the data of figure ``number``, in words."""
    if number in WITHOUT_METHOD:
        return f"method: {WITHOUT_METHOD[number]}, whatever the choice of a method"
    return f"method: {source.words}"
