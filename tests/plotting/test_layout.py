"""Pictures can be read: no text on another or cut off, one typeface, and legends that hide nothing."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.legend import Legend
from matplotlib.text import Text

import chuteflow
from chuteflow import Chute, Scales, flows
from chuteflow.bifurcations.diagram import diagram
from chuteflow.plotting.axes import drawn
from chuteflow.plotting.closure_plot import plot_comparison, plot_laws
from chuteflow.plotting.sensitivity_plot import plot_sensitivities
from chuteflow.plotting.stability_curve import plot_marked
from chuteflow.stability.along import mark_stability
from chuteflow.theory.laws import LAWS

PAPER = Chute(0.3, 0.8, 0.8, 0.6)
SI = Scales(1e-3, 2500.0)
#: Text may touch by so many pixels.
TOUCH = 2.0


@cache
def paper_flows():
    return flows(PAPER, Q=3.0)


@cache
def paper_curve():
    return chuteflow.curve(PAPER, points=60)


def laws():
    return list(LAWS.values())


def chutes_of_laws():
    return [Chute(0.3, 0.8, 0.8, 0.6, closure=name) for name in LAWS]


QUICK = {
    "flow": lambda: drawn(paper_flows()[0], None),
    "flows": lambda: drawn(paper_flows(), None),
    "flows in SI": lambda: drawn(paper_flows(), SI),
    "no flow": lambda: drawn(flows(Chute(0.2, 0.8, 0.8, 0.85), Q=3.0), None),
    "profile": lambda: drawn(paper_flows()[2].sampled(), None),
    "flows at several fluxes": lambda: drawn(flows(PAPER, Q=[1.0, 2.0, 3.0, 5.0]), SI),
    "curve": lambda: drawn(paper_curve(), None),
    "curve in SI": lambda: drawn(paper_curve(), SI),
    "hot": lambda: drawn(chuteflow.hot(PAPER), None),
    "scan": lambda: drawn(chuteflow.scan(PAPER, slope=np.linspace(0.28, 0.32, 5), Q=3.0), None),
    "sensitivities": lambda: plot_sensitivities([flow.sensitivity() for flow in paper_flows()]),
    "laws": lambda: plot_laws(laws(), 0.8, 0.3),
}
SLOW = {
    "curve of a steep chute": lambda: drawn(chuteflow.curve(Chute(0.35, 0.8, 0.8, 0.6)), None),
    "a deep flow": lambda: drawn(flows(Chute(0.38, 0.8, 0.8, 0.6), M=20.0), SI),
    "scan of two parameters": lambda: drawn(
        chuteflow.scan(PAPER, slope=np.linspace(0.25, 0.35, 7), Q=np.linspace(1.0, 4.0, 6)), None
    ),
    "domain": lambda: drawn(
        chuteflow.domain(PAPER, ("slope", 0.1, 0.45), ("roughness", 0.5, 0.866), size=(24, 24)), None
    ),
    "growth": lambda: drawn(chuteflow.growth(paper_flows()[2], size=(10, 10)), SI),
    "neutral": lambda: drawn(chuteflow.neutral(PAPER, size=(8, 8)), None),
    "stability": lambda: drawn(chuteflow.stability_of(paper_flows()[2]), None),
    "stability in SI": lambda: drawn(chuteflow.stability_of(paper_flows()[0]), SI),
    "stability along a curve": lambda: plot_marked(mark_stability(chuteflow.curve(PAPER, points=8))),
    "relaxation": lambda: drawn(chuteflow.relax(paper_flows()[1], duration=20.0), SI),
    "boundaries": lambda: drawn(diagram(chuteflow.boundary(PAPER, bounds=(0.25, 0.38))), None),
    "laws compared": lambda: plot_comparison(
        [flows(chute, Q=3.0) for chute in chutes_of_laws()],
        [chuteflow.curve(chute, points=40) for chute in chutes_of_laws()],
    ),
}


@pytest.mark.parametrize("name", QUICK)
def test_a_picture_can_be_read(name):
    assert faults(QUICK[name]()) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_a_larger_picture_can_be_read(name):
    assert faults(SLOW[name]()) == []


def test_faults_are_seen():
    figure = drawn(paper_flows(), None)
    figure.set_layout_engine("none")
    axes = figure.axes[0]
    axes.text(0.5, 0.5, "one text", transform=axes.transAxes)
    axes.text(0.52, 0.5, "another", transform=axes.transAxes, fontfamily="monospace")
    figure.text(0.99, 0.5, "cut off", in_layout=False)
    axes.legend(loc="upper left", handles=axes.get_lines())
    found = "; ".join(faults(figure))
    for fault in ("'one text' on 'another'", "'cut off' is cut off", "typefaces", "a legend hides"):
        assert fault in found


def faults(figure):
    """What makes a picture hard to read, in words."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    width, height = canvas.get_width_height()
    texts = [(text, text.get_window_extent(canvas.get_renderer())) for text in visible_texts(figure)]
    found = [
        f"{text.get_text()!r} is cut off"
        for text, box in texts
        if min(box.x0, box.y0) < -1.0 or box.x1 > width + 1.0 or box.y1 > height + 1.0
    ]
    for (one, a), (other, b) in combinations(texts, 2):
        across, along = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        if min(across, along) > TOUCH:
            found.append(f"{one.get_text()!r} on {other.get_text()!r}")
    typefaces = {tuple(text.get_fontfamily()) for text, _ in texts}
    if len(typefaces) > 1:
        found.append(f"typefaces {typefaces}")
    for legend in figure.findobj(Legend):
        found += [f"a legend hides {hidden} points of a line" for hidden in hidden_by(legend, figure) if hidden]
    return found


def visible_texts(figure):
    outside = set()
    for axes in figure.findobj(Axes):
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            room = 1e-9 * (high - low)
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if not low - room <= tick.get_loc() <= high + room:
                    outside |= {tick.label1, tick.label2}
    return [
        text
        for text in figure.findobj(Text)
        if text not in outside and text.get_visible() and text.get_text().strip()
        if text.get_window_extent().width > 1.0
    ]


def hidden_by(legend, figure):
    box = legend.get_window_extent()
    for axes in figure.axes:
        for line in axes.lines:
            if line.get_transform() != axes.transData or not line.get_visible():
                continue
            x, y = axes.transData.transform(np.column_stack([np.asarray(v, dtype=float) for v in line.get_data()])).T
            yield int(np.sum(in_box(box, x, y) & in_box(axes.bbox, x, y)))


def in_box(box, x, y):
    return (x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)
