"""What pictures show, by the numbers in them."""

import os
import subprocess
import sys
from typing import Any

import matplotlib
import numpy as np
import pytest

from chuteflow import Chute, InputError, Scales, curve, flows
from chuteflow.faces.plots import plot_curve, plot_flows, write_figure

PAPER = Chute(0.3, 0.8, 0.8, 0.6)


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
    solid = [line for line in lines_of(axes) if line.get_linestyle() == "-"]
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
