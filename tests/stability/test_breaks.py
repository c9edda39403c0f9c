"""Disturbances of flows that pass a break of their law."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from chuteflow import Chute, flows
from chuteflow.numerics.chebyshev import split_grid
from chuteflow.numerics.eigenproblem import refine_eigenvalue
from chuteflow.stability.base import Resolution, base
from chuteflow.stability.layer import FIELDS, Layer
from chuteflow.stability.linear import operator
from chuteflow.stability.modes import Disturbances
from chuteflow.stability.relaxation import disturb
from chuteflow.theory.constitutive import Law
from chuteflow.theory.extended import Extended


@dataclass(frozen=True)
class Smoothed(Extended):
    """Extended kinetic theory with its max(1, L) smoothed over a ``width`` in L, or as it is at 0."""

    width: float = 0.0

    def breaks(self, e, slope):
        return super().breaks(e, slope) if self.width == 0.0 else ()

    def _shorten(self, plain, nu, free_fraction, e, rate):
        if self.width == 0.0:
            return super()._shorten(plain, nu, free_fraction, e, rate)
        above = self._length(plain, nu, free_fraction, e, rate) - 1.0
        return replace(plain, dissipation=plain.dissipation / (1.0 + 0.5 * (above + np.sqrt(above**2 + self.width**2))))


def smoothed(width):
    formula = Smoothed(radial="carnahan-starling", length="jenkins-berzi", width=width)
    return Law.of("smoothed", "of a test", "none", formula)


@pytest.mark.parametrize(
    ("chute", "mass", "near"),
    [
        (Chute(0.3, 0.8, 0.8, 0.6, closure="jenkins-berzi"), 4.5, -0.118 - 0.2135j),
        (Chute(0.3, 0.8, 0.8, 0.6, closure="lun:radial=vescovi"), 1.3872, -0.02258 - 0.411j),
    ],
)
def test_eigenvalues_converge_as_for_a_smooth_law(chute, mass, near):
    flow = flows(chute, M=mass)[-1]
    found = []
    for degree in (40, 64, 96):
        at = operator(base(flow, Resolution(degree, 12.0, 3.0)))
        assert len(at.base.grid.pieces) > 1
        found.append(refine_eigenvalue(at.matrix(0.1, 0.0), at.weights, near)[0])
    assert abs(found[0] - found[2]) < 1e-6
    assert abs(found[1] - found[2]) < 3e-8


def test_modes_are_the_limit_of_those_of_a_law_that_is_smoothed_ever_less():
    rates = []
    for width in (0.1, 0.05, 0.0):
        (flow,) = flows(Chute(0.3, 0.8, 0.8, 0.6, closure=smoothed(width)), M=2.5)
        mode = Disturbances(flow).followed(0.3, 0.1, -0.182 - 0.243j)
        assert mode is not None
        assert (len(mode.operator.base.grid.pieces) > 1) == (width == 0.0)
        rates.append(mode.sigma)
    # The change goes like the square of the width.
    wide, narrow = (abs(rate - rates[-1]) for rate in rates[:-1])
    assert wide > 3.0 * narrow > 3e-3
    assert abs(rates[1] + (rates[1] - rates[0]) / 3.0 - rates[2]) < 0.2 * narrow


def test_a_split_grid_differentiates_and_integrates_each_piece():
    grid = split_grid(np.array([0.0, 0.3, 1.0]), (8, 11))
    values = np.where(np.arange(len(grid.nodes)) < 9, grid.nodes**3, 2.0 - grid.nodes**2)
    slopes = np.where(np.arange(len(grid.nodes)) < 9, 3.0 * grid.nodes**2, -2.0 * grid.nodes)
    assert grid.derivative @ values == pytest.approx(slopes, abs=1e-12)
    assert grid.weights @ values == pytest.approx(0.3**4 / 4.0 + 2.0 * 0.7 - (1.0 - 0.3**3) / 3.0, abs=1e-14)
    points = np.array([0.1, 0.3, 0.31, 1.0])
    assert grid.interpolation(points) @ values == pytest.approx([1e-3, 0.027, 2.0 - 0.31**2, 1.0], abs=1e-13)


def test_fields_of_a_mode_are_sampled_across_the_break():
    flow = flows(Chute(0.3, 0.8, 0.8, 0.6, closure="lun:radial=vescovi"), M=1.3872)[-1]
    mode = Disturbances(flow).followed(0.1, 0.0, -0.02258 - 0.411j)
    assert mode is not None
    height, fields = mode.sampled(301)
    at = np.interp(height, mode.height[::-1], np.real(mode.fields[3])[::-1])
    assert np.real(fields[3]) == pytest.approx(at, abs=2e-3)


def test_a_flow_in_time_is_steady_and_its_rates_converge_as_for_a_smooth_law():
    flow = flows(Chute(0.3, 0.8, 0.8, 0.6, closure="extended"), M=2.1695)[-1]
    rates = []
    for degree in (32, 40, 56):
        layer = Layer.of(flow, degree)
        assert len(layer.breaks) == 2
        state = layer.steady(flow)
        assert np.abs(layer.rate(state)).max() < 1e-5
        assert layer.numbers(state)[0] == pytest.approx(flow.mass_flux, rel=1e-13)
        every = layer.growth_rates(state)
        rates.append(every[np.abs(every.imag) > 1.0][0])
    assert rates[1].real == pytest.approx(rates[2].real, abs=1e-7)
    assert rates[0].real == pytest.approx(rates[2].real, abs=1e-6)


def test_the_balance_of_energy_holds_on_pieces():
    """dE/dt along the motion, by differences, is the work of gravity less what collisions take."""
    flow = flows(Chute(0.3, 0.8, 0.8, 0.6, closure="extended"), M=2.1695)[-1]
    layer = Layer.of(flow, 24)
    assert layer.breaks
    state = disturb(layer.steady(flow), 1.3, 0.8)
    below = layer.mass / layer.mass_holdup
    state.reshape(FIELDS, -1)[2] = 0.01 * np.sin(3.0 * below) * (1.0 - below)
    rate = layer.rate(state)
    ahead, behind = (layer.energy(state + way * 1e-7 * rate).total for way in (1.0, -1.0))
    power = layer.power(state)
    assert (ahead - behind) / 2e-7 == pytest.approx(power.net, abs=1e-6 * (power.gravity + power.collisions))
    assert layer.weights.sum() == pytest.approx(flow.mass_holdup, rel=1e-13)
