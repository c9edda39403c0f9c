"""What every result can do: draw itself, become a table, be equal to its copy."""

import pickle
import subprocess
import sys
from functools import cache

import numpy as np
import pytest

import chuteflow
from chuteflow.stability.neutral import NeutralCurve
from chuteflow.stability.planes import FamilyMap, WaveMap
from chuteflow.steady.quantities import NUMBERS

CHUTE = chuteflow.Chute(0.3, 0.8, 0.8, 0.6)
NOWHERE = chuteflow.Chute(0.2, 0.8, 0.8, 0.85)
GRAINS = chuteflow.Scales(1e-3, 2500.0)


def waves():
    axis = np.linspace(0.1, 1.0, 5)
    growth = np.outer(axis, axis) - 0.3
    return axis, growth, (NeutralCurve(np.ones((5, 2)), axis, axis, ("the edge", "the edge")),)


def wave_map():
    axis, growth, neutral = waves()
    unresolved = np.zeros_like(growth, dtype=bool)
    unresolved[0, 0] = True
    return WaveMap(flows()[0], axis, axis, growth, growth, growth > 0.0, unresolved, 1e-6, neutral)


def family_map():
    axis, growth, neutral = waves()
    of = curve().branches[0].flows[:5]
    return FamilyMap(of, 0.0, axis, growth, growth, growth > 0.0, growth > 9.0, axis, neutral, (of,))


@cache
def flows():
    return chuteflow.flows(CHUTE, Q=3.0)


@cache
def curve():
    return chuteflow.curve(CHUTE, points=12)


@cache
def boundaries():
    return chuteflow.boundary(
        CHUTE, of="fold-Q", second="slope", bounds=(0.29, 0.3), samples=2, surface_temperature=(0.1, 10.0)
    )


#: Kinds that take seconds to compute.
SLOW = ("boundaries", "boundary", "domain", "stability")
#: Each kind of result, its rows as a table, and whether it can take SI units.
RESULTS = {
    "flow": (lambda: flows()[0], 1, True),
    "flows": (flows, 3, True),
    "no flows": (lambda: chuteflow.flows(NOWHERE, Q=3.0), 0, True),
    "sets": (lambda: chuteflow.flows(CHUTE, Q=[1.0, 3.0]), 4, True),
    "profile": (lambda: flows()[0].sampled(11), 11, False),
    "curve": (curve, 15, True),
    "branch": (lambda: curve().branches[0], 15, True),
    "boundaries": (boundaries, None, True),
    "boundary": (lambda: boundaries()[0], None, True),
    "domain": (
        lambda: chuteflow.domain(
            CHUTE,
            ("slope", 0.28, 0.3),
            ("roughness", 0.55, 0.65),
            size=(3, 2),
            tolerance=0.1,
            surface_temperature=(1.0, 10.0),
        ),
        6,
        False,
    ),
    "hot": (lambda: chuteflow.hot(CHUTE), 1, False),
    "stability": (lambda: chuteflow.stability_of(flows()[2], kx=0.01, ky=0.0), 1, True),
    "relaxation": (lambda: chuteflow.relax(flows()[0], duration=0.01), None, True),
    "waves": (wave_map, 25, True),
    "family": (family_map, 25, True),
    "scan": (lambda: chuteflow.scan(CHUTE, Q=[1.0, 3.0]), 16, True),
    "scan of two": (lambda: chuteflow.scan(CHUTE, slope=[0.29, 0.3], Q=[1.0, 3.0], quantities=("density",)), 32, True),
}


KINDS = [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in RESULTS]


@cache
def result_of(name):
    return RESULTS[name][0]()


@pytest.mark.parametrize("name", KINDS)
def test_a_result_is_a_table(name):
    pytest.importorskip("pandas")
    xarray = pytest.importorskip("xarray")
    result, (_, rows, scaled) = result_of(name), RESULTS[name]
    table, data = result.to_dataframe(), result.to_xarray()
    assert rows is None or len(table) == rows
    assert isinstance(data, xarray.Dataset)
    for variable in data.data_vars.values():
        assert variable.dtype.kind in "OUS" or {"units", "flag_meanings", "long_name"} & variable.attrs.keys()
    if not scaled:
        with pytest.raises(chuteflow.InputError):
            result.to_dataframe(scales=GRAINS)
    elif "mass_flux" in table:
        factor = GRAINS.factor("mass_flux", 0.3)
        other = result.to_xarray(scales=GRAINS)
        assert other.mass_flux.attrs["units"] == "kg/m/s"
        if name not in ("boundaries", "boundary"):
            np.testing.assert_allclose(other.mass_flux, factor * data.mass_flux, rtol=1e-12)


@pytest.mark.parametrize("name", KINDS)
def test_a_result_draws_itself(name):
    from matplotlib.axes import Axes

    axes = np.ravel(result_of(name).plot())
    assert all(isinstance(ax, Axes) for ax in axes)
    assert all(ax.figure is axes[0].figure for ax in axes)
    with pytest.raises(chuteflow.InputError, match="unexpected"):
        result_of(name).plot(colour="red")


@pytest.mark.parametrize("name", KINDS)
def test_a_result_is_equal_to_its_copy(name):
    result = result_of(name)
    copy = pickle.loads(pickle.dumps(result))
    assert copy is not result
    assert copy == result
    assert hash(copy) == hash(result)
    assert not copy != result  # noqa: SIM202 - the other operator
    assert result != "a result"


@pytest.mark.parametrize("name", KINDS)
def test_a_result_shows_itself(name):
    result = result_of(name)
    assert "\n" not in repr(result)
    assert len(repr(result)) < 300
    assert result._repr_html_().startswith("<p>0 flows" if name == "no flows" else "<table>")


def test_a_curve_without_flows_draws_itself_on_an_array_of_axes():
    nothing = chuteflow.curve(chuteflow.Chute(0.5, 0.8, 0.8, 0.6))
    assert nothing.plot().shape == (1,)
    assert "nearest" in nothing._repr_html_()


def test_a_study_over_fluxes_is_drawn_in_si_units():
    chute = chuteflow.Chute(0.3, 0.8, 0.8, 0.6)
    fluxes = np.array([1.0, 4.0, 100.0])
    ax = chuteflow.scan(chute, e=[0.75, 0.8], Q=fluxes).plot(scales=GRAINS)
    factor = GRAINS.factor("mass_flux", 0.3)
    assert ax.get_xlabel() == "mass flux, $Q$ (kg/m/s)"
    assert ax.get_xscale() == "log"
    # Cells meet halfway between the fluxes, on an axis of logarithms.
    edges = ax.collections[0].get_coordinates()[0, :, 0]
    np.testing.assert_allclose(edges, factor * np.array([0.5, 2.0, 20.0, 500.0]), rtol=1e-12)
    # Each number of flows has one shade.
    norm = ax.collections[0].norm
    assert norm.boundaries[0] % 1.0 == 0.5
    assert set(np.diff(norm.boundaries)) == {1.0}
    ax = chuteflow.scan(chute, slope=[0.3, 0.31], Q=fluxes[:2]).plot(scales=GRAINS)
    assert ax.get_xlabel() == "mass flux, $Q$ (dimensionless)"


def test_other_results_are_not_equal():
    assert flows()[0] != flows()[1]
    assert flows() != chuteflow.flows(CHUTE, Q=3.1)
    assert curve() != chuteflow.curve(CHUTE, points=13)
    assert len({flows()[0], flows()[1], pickle.loads(pickle.dumps(flows()[0]))}) == 2


def test_a_table_of_flows_has_numbers_and_words():
    pytest.importorskip("pandas")
    table = flows().to_dataframe()
    for name in NUMBERS:
        if name != "interface_height":
            assert table[name].tolist() == [getattr(flow, name) for flow in flows()]
    assert table.density.tolist() == [flow.density for flow in flows()]
    assert table.validity[0] == "large_slip and rarefied"


def test_a_curve_gives_the_flows_at_a_value():
    assert curve().at(Q=3.0) == flows()
    with pytest.raises(chuteflow.InputError, match="exactly one"):
        curve().at()


def test_arrays_of_a_quantity_give_the_flows_at_each():
    found = chuteflow.flows(CHUTE, Q=np.array([1.0, 3.0]))
    assert [len(one) for one in found] == [1, 3]
    assert found[1] == flows()
    assert found.values == (1.0, 3.0)
    assert [len(one) for one in chuteflow.flows(CHUTE, T_surface=(0.2, 5.0))] == [1, 1]
    with pytest.raises(chuteflow.InputError, match="one-dimensional"):
        chuteflow.flows(CHUTE, Q=np.ones((1, 1)))
    with pytest.raises(chuteflow.InputError, match="exactly one"):
        chuteflow.flows(CHUTE, Q=[1.0], M=[0.5])


def test_a_scan_has_the_flows_of_every_combination():
    told = []
    names = ("mass_holdup", "angle", "interior")
    found = chuteflow.scan(CHUTE, slope=[0.29, 0.3], Q=[1.0, 3.0], quantities=names, progress=told.append)
    assert told == [1.0]
    assert found.count.shape == (2, 2)
    for i, slope in enumerate((0.29, 0.3)):
        for j, flux in enumerate((1.0, 3.0)):
            wanted = chuteflow.flows(chuteflow.Chute(slope, 0.8, 0.8, 0.6), Q=flux)
            assert found.count[i, j] == len(wanted)
            holdups = found.quantities["mass_holdup"][i, j, : len(wanted)]
            np.testing.assert_allclose(holdups, [flow.mass_holdup for flow in wanted], rtol=1e-7)
    by_key = chuteflow.scan(slope=0.3, e=0.8, ew=0.8, roughness=0.6, Q=[1.0, 3.0], quantities=names)
    np.testing.assert_array_equal(by_key.count, found.count[1])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"slop": 0.3}, "unknown parameter 'slop'"),
        ({"e": 0.8, "restitution": 0.8, "Q": 1.0}, "given twice"),
        ({"Q": [[1.0]]}, "one-dimensional"),
        ({}, "exactly one of"),
        ({"Q": 1.0, "slope": np.linspace(0.2, 0.3, 2000), "e": np.linspace(0.7, 0.9, 2000)}, "4000000 points"),
    ],
)
def test_a_bad_scan_is_refused(given, said):
    with pytest.raises(chuteflow.InputError, match=said):
        chuteflow.scan(CHUTE, **given)


def test_without_pandas_a_line_says_what_is_missing():
    code = (
        "import sys; sys.modules['pandas'] = None\n"
        "import chuteflow\n"
        "try: chuteflow.hot(chuteflow.Chute(0.3, 0.8, 0.8, 0.6)).to_dataframe()\n"
        "except chuteflow.InputError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "to_dataframe needs pandas, which is not installed: pip install 'chuteflow[tables]'\n"


@pytest.mark.slow
def test_a_sweep_from_python_fills_a_store(tmp_path):
    xarray = pytest.importorskip("xarray")
    table = {
        "parameters": {"slope": 0.3, "e": 0.8, "ew": 0.8, "roughness": 0.6, "Q": [1.0, 3.0]},
        "results": {"chunk": 1},
    }
    told = []
    path = chuteflow.sweep(table, tmp_path / "study.zarr", workers=1, progress=told.append)
    assert told == [0.5, 1.0]
    with xarray.open_zarr(path) as data:
        assert data.n_flows.values.tolist() == [1, 3]
    assert chuteflow.sweep(table, path, workers=1, progress=told.append) == path
    assert len(told) == 2
