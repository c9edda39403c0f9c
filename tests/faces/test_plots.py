"""What pictures show, by the numbers in them."""

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


def test_an_unknown_format_is_refused(tmp_path):
    with pytest.raises(InputError, match="must end in"):
        write_figure(plot_flows(flows(PAPER, Q=3.0)), tmp_path / "a.gif")
    assert list(tmp_path.iterdir()) == []
