"""The look of all figures: strokes that differ in print and for the colour-blind, panels and labels.

matplotlib is imported when a figure is made, through its objects alone. Figures have the settings of this module
and matplotlib's defaults: neither a user's matplotlibrc nor a backend for windows or notebooks has a say.
"""

from __future__ import annotations

import os
import re
import sys
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.errors import InputError
from chuteflow.steady.quantities import SCALED, Scales

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours of Okabe & Ito (2008), dark ones first; black is for lines that stand alone.
BLACK, BLUE, VERMILION, GREEN, PURPLE = "#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7"
GREY = "#767676"

SOLID: Any = "solid"
DASHED: Any = (0, (5, 2))
DOTTED: Any = (0, (1, 1.4))
DASH_DOTTED: Any = (0, (6, 1.8, 1, 1.8))

#: Strokes of the two kinds of density, as in figures 4 and 9.
OF_DENSITY = {"inverted": SOLID, "monotonic": DASHED}

_SERIF = "STIXGeneral"
_SIZE = 9.0
_WIDTH = 1.3


@dataclass(frozen=True)
class LineStyle:
    """Colour and dashes of a line."""

    colour: str = BLACK
    dashes: Any = SOLID

    def line(self, width: float = _WIDTH) -> dict[str, Any]:
        """The stroke as keyword arguments of ``plot``."""
        # Dots need round ends and a little more width to print as dark as a line.
        dotted = self.dashes == DOTTED
        return {
            "color": self.colour,
            "linestyle": self.dashes,
            "linewidth": width + 0.3 * dotted,
            "solid_capstyle": "round",
        }


#: Strokes of consecutive lines; the first three are those of figure 2.
STROKES = (
    LineStyle(VERMILION, SOLID),
    LineStyle(GREEN, DOTTED),
    LineStyle(BLUE, DASHED),
    LineStyle(PURPLE, DASH_DOTTED),
    LineStyle(BLACK, SOLID),
    LineStyle(GREY, DASHED),
)


@contextmanager
def own_settings() -> Iterator[None]:
    """matplotlib's defaults while a figure is made or written, whatever the settings are before and after.

    It decorates functions too. Settings may ask for programs that are not there, such as LaTeX.
    """
    _import_matplotlib()
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams["svg.hashsalt"] = "chuteflow"  # the same names inside, whenever a picture is drawn
        yield


def _import_matplotlib() -> None:
    """Import matplotlib where the environment names a backend that is not there, which would be an error."""
    backend = os.environ.get("MPLBACKEND")
    if "matplotlib" in sys.modules or backend is None:
        return
    os.environ["MPLBACKEND"] = "agg"
    try:
        import matplotlib
    finally:
        os.environ["MPLBACKEND"] = backend
    with suppress(ValueError):
        matplotlib.rcParams["backend"] = backend


@dataclass(frozen=True)
class Theme:
    """How much larger than in print a figure, its text and its lines are."""

    figure: float = 1.0
    text: float = 1.0
    lines: float = 1.0


#: Looks of figures: for a page, and to be seen from the last row.
THEMES = {"print": Theme(), "slides": Theme(figure=1.3, text=1.6, lines=1.6)}


def require_theme(name: str) -> None:
    """Check the name of a theme.

    Raises:
        InputError: for an unknown one.
    """
    if name not in THEMES:
        raise InputError(f"unknown theme {name!r}: choose one of {', '.join(THEMES)}")


def apply_theme(figure: Figure, name: str) -> Figure:
    """``figure``, which is in the look of print, in that of the theme ``name``.

    Raises:
        InputError: for an unknown theme.
    """
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

    require_theme(name)
    theme = THEMES[name]
    if theme == THEMES["print"]:
        return figure
    width, height = figure.get_size_inches()
    figure.set_size_inches(theme.figure * width, theme.figure * height)
    # Legends and captions are as wide as the figure already.
    across = {text for part in (*figure.legends, *figure.texts) for text in part.findobj(Text)}
    for text in figure.findobj(Text):
        factor = theme.figure if text in across else theme.text
        text.set_fontsize(factor * float(text.get_fontsize()))  # pyright: ignore[reportAttributeAccessIssue]
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            for which in ("major", "minor"):
                size: Any = axis.get_tick_params(which=which).get("labelsize", _SIZE)
                axis.set_tick_params(which=which, labelsize=theme.text * size)
        for line in ax.findobj(Line2D):
            line.set_linewidth(theme.lines * line.get_linewidth())  # pyright: ignore[reportAttributeAccessIssue]
            line.set_markersize(theme.lines * line.get_markersize())  # pyright: ignore[reportAttributeAccessIssue]
    return figure


def stroke(index: int) -> LineStyle:
    """The stroke of line ``index``, from the start again after the last."""
    return STROKES[index % len(STROKES)]


def panels(
    columns: int, rows: int = 1, *, width: float = 7.2, height: float = 2.7, shared_y: bool = False
) -> tuple[Figure, list[Axes]]:
    """A figure of ``width`` by ``height`` inches with panels row by row, lettered (a), (b), ...

    With ``shared_y`` the panels of a row have one ordinate.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = list(np.ravel(figure.subplots(rows, columns, sharey="row" if shared_y else False, squeeze=False)))
    for index, ax in enumerate(axes):
        _calm(ax)
        if columns * rows > 1:
            ax.set_title(f"({'abcdefghijkl'[index]})", loc="left", **title())
    return figure, axes


def title() -> dict[str, Any]:
    """Settings of the letters of panels."""
    return {"fontsize": _SIZE, "fontfamily": _SERIF}


def inset(ax: Axes, place: tuple[float, float, float, float]) -> Axes:
    """Small axes inside ``ax``: left, bottom, width and height as fractions of it."""
    small = ax.inset_axes(place)
    _calm(small)
    small.tick_params(labelsize=_SIZE - 2.0)
    return small


def label(name: str, scales: Scales | None = None) -> str:
    """The label of an axis from the registry of quantities, with the unit where there are scales."""
    quantity = SCALED[name]
    # A name in code has no hyphen.
    name = name.replace("_", " ").replace("holdup", "hold-up")
    return f"{name}, ${quantity.latex}${unit(quantity.name, scales)}"


def unit(name: str, scales: Scales | None) -> str:
    """The unit of a quantity in brackets, with a space before; nothing without scales or unit."""
    quantity = SCALED[name]
    return "" if scales is None or quantity.unit == "1" else f" ({format_unit(quantity.unit)})"


def name_axes(ax: Axes, x: str | None, y: str | None) -> None:
    """Label the axes; None leaves one without."""
    for text, put in ((x, ax.set_xlabel), (y, ax.set_ylabel)):
        if text is not None:
            put(text, fontsize=_SIZE, fontfamily=_SERIF, math_fontfamily="stix")


def name_point(ax: Axes, x: float, y: float, text: str, where: str = "above right") -> None:
    """A filled point, and its name ``where``: words out of above, below, left and right."""
    across, up = ("right" in where) - ("left" in where), ("above" in where) - ("below" in where)
    ax.plot([x], [y], marker="o", markersize=4.0, color=BLACK, linestyle="none", zorder=4)
    ax.annotate(
        text,
        (x, y),
        (5.0 * across, 5.0 * up),
        textcoords="offset points",
        ha={1: "left", 0: "center", -1: "right"}[across],
        va={1: "bottom", 0: "center", -1: "top"}[up],
        fontsize=_SIZE,
        fontfamily=_SERIF,
        fontstyle="italic",
    )


def write(ax: Axes, x: float, y: float, text: str, **settings: Any) -> None:
    """``text`` at a point of the axes; ``settings`` are those of matplotlib's ``annotate``."""
    settings = {"fontsize": _SIZE - 1.0, "textcoords": "offset points", "xytext": (0.0, 0.0)} | settings
    ax.annotate(text, (x, y), fontfamily=_SERIF, math_fontfamily="stix", **settings)


def legend(ax: Axes | Figure, **settings: Any) -> None:
    """A legend without a frame."""
    settings = {"frameon": False, "handlelength": 2.8, "borderaxespad": 0.4, "labelspacing": 0.35} | settings
    ax.legend(prop={"family": _SERIF, "size": _SIZE - 0.5, "math_fontfamily": "stix"}, **settings)


def caption(figure: Figure, text: str) -> None:
    """A line of small print above the panels."""
    figure.suptitle(text, fontsize=_SIZE - 0.5, fontfamily=_SERIF, math_fontfamily="stix", color=GREY)


def spread_scale(ax: Axes, axis: str, values: Sequence[Any]) -> None:
    """A logarithmic ``axis`` ("x" or "y") where positive values span more than a decade and a half."""
    flat = [value for part in values for value in np.ravel(part)]
    if flat and min(flat) > 0.0 and max(flat) > 30.0 * min(flat):
        logarithmic(ax, axis)


def logarithmic(ax: Axes, axis: str) -> None:
    """A logarithmic ``axis`` ("x" or "y"), whose numbers are text in the typeface of all others."""
    from matplotlib.ticker import LogFormatter

    class Powers(LogFormatter):
        """Labels where matplotlib puts them: as plain numbers, or as powers of ten where some are large or small."""

        def __call__(self, x: float, pos: Any = None) -> str:
            if not super().__call__(x, pos):
                return ""
            low, high = self.axis.get_view_interval()  # pyright: ignore[reportOptionalMemberAccess, reportAttributeAccessIssue]
            return f"{x:g}" if min(low, high) >= 5e-4 and max(low, high) <= 2e4 else power_of_ten(x)

    ax.set(**{f"{axis}scale": "log"})
    scaled = getattr(ax, f"{axis}axis")
    scaled.set_major_formatter(Powers())
    scaled.set_minor_formatter(Powers(labelOnlyBase=False))


def power_of_ten(value: float) -> str:
    """A positive number of one digit with its power raised, in the typeface of the text around it."""
    digit, _, exponent = f"{value:.0e}".partition("e")
    times = "" if digit == "1" else f"{digit}×"
    return rf"$\mathdefault{{{times}10^{{{int(exponent)}}}}}$"


def in_formula(number: str) -> str:
    """A printed number inside a formula: "1.2e-05" with its power of ten raised."""
    digits, _, exponent = number.partition("e")
    return rf"{digits}\times10^{{{int(exponent)}}}" if exponent else digits


def sentence(text: str) -> Figure:
    """A figure that holds nothing but a sentence."""
    figure, (ax,) = panels(1, height=1.2)
    ax.set_axis_off()
    ax.text(
        0.5,
        0.5,
        textwrap.fill(text, 100),
        transform=ax.transAxes,
        ha="center",
        va="center",
        fontsize=_SIZE,
        fontfamily=_SERIF,
    )
    return figure


def format_unit(unit: str) -> str:
    """A unit as it is printed, with powers raised."""
    return re.sub(r"\^(\d)", r"$^{\1}$", unit)


def _calm(ax: Axes) -> None:
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_linewidth(0.6)
    ax.tick_params(labelsize=_SIZE - 1.0, width=0.6, length=3.0, labelfontfamily=_SERIF)
    ax.tick_params(which="minor", labelsize=_SIZE - 2.5, width=0.5, length=2.0, labelfontfamily=_SERIF)
    ax.margins(x=0.03, y=0.03)
