"""What pictures show, by the numbers in them."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from functools import cache
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.text import Text

from chuteflow import Chute, InputError, Scales, curve, flows
from chuteflow.branches.lines import in_order, smooth
from chuteflow.plotting import style
from chuteflow.plotting.growth_plot import plot_family_map
from chuteflow.plotting.plots import plot_curve, plot_flows, write_figure
from chuteflow.stability.planes import FamilyMap

PAPER = Chute(0.3, 0.8, 0.8, 0.6)


#: The curve of the paper's chute with the usual number of flows.
@cache
def paper_curve():
    return curve(PAPER)


def lines_of(axes):
    return [line for line in axes.lines if len(line.get_xdata()) > 2]


def values(data):
    return np.asarray(data, dtype=float)


def test_profiles_are_those_of_the_flows():
    found = flows(PAPER, Q=3.0)
    figure = plot_flows(found)
    assert len(figure.axes) == 3
    for axes, name in zip(figure.axes, ("volume_fraction", "granular_temperature", "velocity"), strict=True):
        lines = lines_of(axes)
        assert len(lines) == 3
        assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 3
        for line, flow in zip(lines, found, strict=True):
            z = values(line.get_ydata())
            drawn = values(line.get_xdata())
            np.testing.assert_allclose(drawn, getattr(flow.profile(z), name), rtol=1e-9, atol=1e-12)


def test_profiles_in_si_units():
    scales = Scales(1e-3, 2500.0)
    plain, si = (plot_flows(flows(PAPER, Q=3.0), scales=s).axes[2] for s in (None, scales))
    ratio = values(lines_of(si)[0].get_xdata())[0] / values(lines_of(plain)[0].get_xdata())[0]
    assert ratio == pytest.approx(scales.factor("velocity", 0.3))
    assert "m/s" in si.get_xlabel()


def test_a_curve_shows_where_the_density_is_inverted():
    result = curve(PAPER, points=60)
    figure = plot_curve(result)
    axes = figure.axes[0]
    solid = [line for line in lines_of(axes) if line.get_linestyle() == "-" and line.get_linewidth() < 4.0]
    dashed = [line for line in lines_of(axes) if line.get_linestyle() != "-"]
    assert solid
    assert dashed
    (branch,) = result.branches
    (onset,) = [s.flow for s in branch.special if s.kind == "density-inversion"]
    assert max(values(line.get_ydata()).max() for line in solid) == pytest.approx(onset.centre_of_mass, rel=1e-9)
    assert min(values(line.get_ydata()).min() for line in dashed) == pytest.approx(onset.centre_of_mass, rel=1e-9)


def test_nothing_to_draw_is_drawn_with_its_reason(tmp_path):
    nothing = Chute(0.2, 0.8, 0.8, 0.85)
    write_figure(plot_flows(flows(nothing, Q=3.0)), tmp_path / "a.png")
    write_figure(plot_curve(curve(nothing)), tmp_path / "b.svg")
    assert {p.name for p in tmp_path.iterdir()} == {"a.png", "b.svg"}


SETTINGS: dict[Any, Any] = {
    "text.usetex": True,
    "font.family": "no such font",
    "figure.autolayout": True,
    "axes.grid": True,
    "lines.linewidth": 9.0,
    "svg.fonttype": "none",
    "savefig.bbox": "tight",
    "axes.formatter.use_mathtext": True,
}


def test_settings_of_the_user_change_nothing(tmp_path):
    found = curve(PAPER, points=20)

    def drawn(name):
        write_figure(plot_curve(found), tmp_path / f"{name}.svg")
        return (tmp_path / f"{name}.svg").read_bytes()

    plain = drawn("plain")
    with matplotlib.rc_context(SETTINGS):
        assert drawn("set") == plain
        assert matplotlib.rcParams["text.usetex"]


@pytest.mark.parametrize("backend", ["module://matplotlib_inline.backend_inline", "no such backend"])
def test_any_backend_is_as_good(backend, tmp_path):
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nbackend: TkAgg\n")
    command = [sys.executable, "-m", "chuteflow", "solve", "--slope", "0.3", "--e", "0.8", "--ew", "0.8"]
    command += ["--roughness", "0.6", "--flux", "3", "--plot", "a.svg"]
    environment = dict(os.environ) | {"MPLBACKEND": backend}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "a.svg").stat().st_size > 5000


def test_an_unknown_format_is_refused(tmp_path):
    with pytest.raises(InputError, match="must end in"):
        write_figure(plot_flows(flows(PAPER, Q=3.0)), tmp_path / "a.gif")
    assert list(tmp_path.iterdir()) == []


# Lines, axes and marks

#: A chute with two folds close to one another, just past a cusp.
FOLDED = Chute(0.3630916485143, 0.8, 0.8, 0.6)
RANGE = (0.4, 100.0)


def logarithms(line):
    return np.log(np.column_stack([*line.values()]))


def test_lines_pass_through_all_flows_and_stay_on_the_curve():
    (coarse,), (fine,) = (curve(FOLDED, points=n, surface_temperature=RANGE).branches for n in (60, 1500))
    flows_along = [point.flow for point in in_order(coarse)]
    drawn = smooth(flows_along)
    np.testing.assert_allclose(drawn["mass_flux"][::10], [flow.mass_flux for flow in flows_along], rtol=1e-12)
    # Each place drawn, to the nearest piece of the finer curve.
    knots = np.log([[getattr(point.flow, name) for name in drawn] for point in in_order(fine)])
    pieces = np.diff(knots, axis=0)
    for place in logarithms(drawn):
        shares = ((place - knots[:-1]) * pieces).sum(axis=1) / (pieces**2).sum(axis=1)
        feet = knots[:-1] + np.clip(shares, 0.0, 1.0)[:, None] * pieces
        assert np.linalg.norm(feet - place, axis=1).min() < 2e-4


def test_folds_are_round_at_the_usual_number_of_flows():
    figure = plot_curve(paper_curve())
    figure.draw_without_rendering()
    for axes in figure.axes:
        for line in lines_of(axes):
            steps = np.diff(axes.transData.transform(line.get_xydata()), axis=0)
            angles = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
            # Beyond some five degrees a corner is seen.
            assert np.degrees(np.abs(np.diff(angles))).max() < 5.0


def test_a_line_through_one_flow_or_two_the_same_is_a_point():
    (flow,) = flows(PAPER, Q=8.0)
    for some in ([flow], [flow, flow]):
        assert smooth(some)["mass_flux"] == pytest.approx([8.0] * len(some), rel=1e-9)


@pytest.mark.parametrize(
    "window", [(0.2, 300.0), (40.0, 90.0), (1e-6, 1e-3), (2.0, 3e6)], ids=["decades", "minor", "small", "large"]
)
def test_all_ticks_are_in_one_typeface(window, tmp_path):
    figure, (ax,) = style.panels(1)
    ax.plot([*window], [*window])
    for axis in "xy":
        style.logarithmic(ax, axis)
    figure.draw_without_rendering()
    labels = [tick.get_text() for which in (False, True) for tick in ax.get_xticklabels(minor=which)]
    assert any(labels)
    write_figure(figure, tmp_path / "a.svg")
    faces = set(re.findall(r'id="([A-Za-z]+)-', (tmp_path / "a.svg").read_text())) & {"DejaVuSans", "STIXGeneral"}
    assert faces == {"STIXGeneral"}


def test_a_small_number_in_a_formula_has_its_power_raised():
    assert style.in_formula("1.2726e-05") == r"1.2726\times10^{-5}"
    assert style.in_formula("0.3") == "0.3"


def test_numbers_on_logarithmic_axes_are_plain_where_none_is_large():
    for window, wanted in (((0.2, 300.0), "10"), ((2.0, 3e6), r"$\mathdefault{10^{5}}$")):
        figure, (ax,) = style.panels(1)
        ax.set_xlim(window)
        style.logarithmic(ax, "x")
        figure.draw_without_rendering()
        assert wanted in [tick.get_text() for tick in ax.get_xticklabels()]
    assert style.power_of_ten(6e5) == r"$\mathdefault{6×10^{5}}$"
    assert style.power_of_ten(1e-3) == r"$\mathdefault{10^{-3}}$"


def family_map(within, points=40):
    (branch,) = curve(PAPER, points=points, surface_temperature=within).branches
    kh = np.geomspace(1e-3, 1.0, 5)
    growth = np.tile(np.linspace(-1.0, 1.0, len(branch.flows)), (5, 1))
    smallest = np.zeros(len(branch.flows))
    return FamilyMap(branch.flows, 90.0, kh, growth, growth, growth > 0.0, np.isnan(growth), smallest, (), ())


@pytest.mark.parametrize("within", [(0.05, 50.0), (0.9, 3.3), (1e-3, 1e5)])
def test_ticks_along_a_family_are_round_temperatures_in_their_places(within):
    found = family_map(within)
    axes = plot_family_map(found).axes[0]
    log_temperature = [flow.surface_temperature for flow in found.flows]
    places, said = axes.get_yticks(), [label.get_text() for label in axes.get_yticklabels()]
    assert 3 <= len(said) <= 13
    for place, text in zip(places, said, strict=True):
        assert re.fullmatch(r"0\.0*[1-9]|[1-9]0*|[1-9]e[+-]\d+", text)
        at = np.interp(place, np.linspace(0.0, 1.0, len(log_temperature)), np.log(log_temperature))
        assert np.exp(at) == pytest.approx(float(text), rel=1e-6)
    assert np.diff(np.sort(places)).min() >= 0.08


@pytest.mark.parametrize("surface", ["free", "interface"])
def test_the_surface_temperature_has_one_symbol(surface):
    chute = replace(PAPER, surface=surface)
    figures = [
        plot_flows(flows(chute, Q=3.0)),
        plot_curve(curve(chute, points=40)),
        plot_curve(curve(Chute(0.3, 0.9, 0.6, 0.8, surface=surface), points=40)),
        plot_family_map(family_map((1.0, 10.0))),
    ]
    texts = [text.get_text() for figure in figures for text in figure.findobj(Text)]
    assert any(r"T_{\mathrm{surface}}" in text for text in texts)
    assert not [text for text in texts if r"\infty" in text or "T_s" in text]


def test_what_is_beyond_the_theory_is_marked():
    figure = plot_curve(paper_curve())
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[-2:] == ["packed: beyond the theory", "dense: beyond the theory"]
    (branch,) = paper_curve().branches
    dense = [flow.mass_flux for flow in branch.flows if flow.largest_volume_fraction > 0.49]
    wide = [line for line in lines_of(figure.axes[0]) if line.get_linewidth() > 4.0]
    flux = np.concatenate([values(line.get_xdata()) for line in wide])
    assert flux.min() == pytest.approx(min(dense), rel=1e-9)
    assert flux.max() == pytest.approx(max(dense), rel=0.05)
    legend = plot_flows(flows(PAPER, T_surface=0.01)).legends[0].get_texts()[0].get_text()
    assert legend.endswith("; dense: beyond the theory, large slip")
