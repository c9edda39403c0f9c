"""The closures against table 1 and table 2 as printed, derivatives, limits, and the table of laws."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chuteflow.errors import InputError
from chuteflow.theory.boundary import (
    INTERFACE_STRESS,
    base_loss,
    kappa,
    slip_coefficient,
    surface_flux,
    surface_stress,
)
from chuteflow.theory.constitutive import Law, reduce, require_positive
from chuteflow.theory.laws import LAWS, law
from chuteflow.theory.lun import DENSEST, LUN

restitutions = st.floats(0.01, 1.0)
densities = st.floats(1e-6, 0.61)


def printed(nu, e):
    """Table 1, letter by letter."""
    g0 = (1.0 - nu / DENSEST) ** (-5.0 * DENSEST / 2.0)
    g0_slope = 2.5 / (1.0 - nu / DENSEST) * g0
    pi = np.sqrt(np.pi)
    x = nu * g0
    return {
        "g0": g0,
        "g1": nu * (1 + 2 * (1 + e) * x),
        "g2": pi * nu * (5 + 4 * (1 + e) * x) / (120 * (3 - e) * (1 + e) * x)
        * (5 + 2 * (1 + e) * (3 * e - 1) * x) + 4 / (5 * pi) * (1 + e) * nu**2 * g0,
        "g3": pi * (5 + 6 * (1 + e) * x) / (4 * (1 + e) * (49 - 33 * e) * g0)
        * (5 + 3 * (1 + e) ** 2 * (2 * e - 1) * x) + 2 / pi * (1 + e) * nu**2 * g0,
        "g4": 3 * pi * (5 + 6 * (1 + e) * x) / (4 * (49 - 33 * e) * x) * e * (1 - e)
        * (2 * nu * g0 + nu**2 * g0_slope),
        "g5": 12 / pi * (1 - e**2) * nu**2 * g0,
        "g6": 4 / (3 * pi) * (1 + e) * nu**2 * g0,
        "A": 1 + np.pi / (12 * np.sqrt(2)) * (1 + 5 / (8 * x)),
    }  # fmt: skip


@given(densities, restitutions)
def test_table_1(nu, e):
    free_fraction = 1.0 - nu / DENSEST
    g = LUN.coefficients(np.array(nu), np.array(free_fraction), e, 0.3)
    want = printed(nu, e)
    got = {
        "g0": g.radial,
        "g1": nu * g.compressibility,
        "g2": g.viscosity,
        "g3": g.conductivity,
        "g4": g.density_conductivity,
        "g5": nu**2 * g.dissipation,
        "g6": g.bulk_viscosity,
    }
    for name, value in got.items():
        assert value == pytest.approx(want[name], rel=1e-12), name
    step = 1e-30
    complex_g = LUN.coefficients(np.array(nu + 1j * step), np.array(free_fraction - 1j * step / DENSEST), e, 0.3)
    assert np.imag(complex_g.compressibility) / step == pytest.approx(g.compressibility_slope, rel=1e-12)


@given(densities, restitutions, st.floats(0.05, 2.0), st.floats(0.5, np.sqrt(3.0) / 2.0))
def test_the_reduced_functions_give_the_printed_equations(nu, e, slope, r):
    want = printed(nu, e)
    f = reduce(LUN, np.array(nu / (1.0 - nu / DENSEST)), e, slope)
    g1, g2 = want["g1"], want["g2"]
    net = (want["g5"] - (g1 * slope) ** 2 / g2) / (nu * g1)
    assert f.loss - slope**2 * f.work == pytest.approx(net, rel=1e-9, abs=1e-9)
    assert f.conduction == pytest.approx(want["g3"] * nu / g1, rel=1e-11)
    assert f.coupling == pytest.approx(want["g4"] / want["g3"], rel=1e-11)
    k = kappa(r)
    f1 = slope / k * (np.sqrt(np.pi / 2) + (k - 0.5 * want["A"] * r**2) * g1 / g2)  # (3.16)
    assert slip_coefficient(f.shear, f.wall_shear, r, slope) == pytest.approx(f1, rel=1e-10, abs=1e-10)
    loss = 2.0 * (1.0 - 0.7) / (1.0 + np.sqrt(1.0 - r**2))
    f2 = g1 * np.sqrt(2 / np.pi) * (k * f1**2 - g1 * slope / g2 * (k - 0.5 * want["A"] * r**2) * f1 - loss)
    assert slope * f1 - base_loss(0.7, r) == pytest.approx(f2 / g1, rel=1e-8, abs=1e-8)  # (3.18)


@given(restitutions)
def test_table_2_is_the_empty_limit(e):
    f = reduce(LUN, np.zeros(()), e, 0.3)
    pi = np.sqrt(np.pi)
    g20 = 5 * pi / (24 * (3 - e) * (1 + e))
    g30 = 25 * pi / (4 * (1 + e) * (49 - 33 * e))
    assert f.work == pytest.approx(1.0 / g20)
    assert f.conduction == pytest.approx(g30)
    assert f.coupling == pytest.approx(15 * pi * e * (1 - e) / (2 * (49 - 33 * e)) / g30)
    assert f.loss == pytest.approx(12 / pi * (1 - e**2))
    assert f.wall_shear == pytest.approx(5 * np.pi / (96 * np.sqrt(2)) / g20)  # A0/g20


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("e", [1e-6, 0.1, 0.5, 0.9, 1.0])
def test_every_law_is_finite_and_positive_to_the_densest_state(name, e):
    x = np.append(0.0, np.logspace(-12.0, 12.0, 200))
    reduced = reduce(LAWS[name], x, e, 0.3)
    for field in fields(reduced):
        assert np.isfinite(getattr(reduced, field.name)).all(), field.name
    require_positive(LAWS[name], e, 0.3)


def test_a_law_that_loses_its_meaning_is_refused():
    def thin(nu, free_fraction, e, slope):
        g = LUN.coefficients(nu, free_fraction, e, slope)
        return type(g)(**{**vars(g), "viscosity": g.viscosity - 0.1})

    with pytest.raises(InputError, match=r"'thin' has no positive g2 at restitution e = 0.8"):
        require_positive(Law("thin", "", "", DENSEST, thin), 0.8, 0.3)


def test_fourier_drops_the_density_gradient_alone():
    x = np.linspace(0.0, 3.0, 30)
    full, fourier = reduce(LUN, x, 0.8, 0.3), reduce(law("lun-fourier"), x, 0.8, 0.3)
    assert (full.coupling > 0.0).all()
    assert (fourier.coupling == 0.0).all()
    np.testing.assert_array_equal(full.conduction, fourier.conduction)


def test_an_unknown_law_names_the_known_ones():
    with pytest.raises(InputError, match="unknown closure 'nope': choose one of lun, lun-fourier"):
        law("nope")


def test_surfaces():
    assert np.sqrt(np.pi) / 48 == surface_stress("interface") == INTERFACE_STRESS
    assert surface_stress("free") == surface_flux("free", 0.3) == 0.0
    assert surface_flux("interface", 0.3) == pytest.approx(-0.09)
