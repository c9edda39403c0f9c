"""The picture of each kind of result, as the axes that it is drawn on."""

from __future__ import annotations

import sys
from functools import singledispatch
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.bifurcations.boundary import Boundary, BoundarySet
from chuteflow.bifurcations.diagram import Diagram
from chuteflow.branches.results import Branch, Curve, FlowSet, FlowSets, Searched
from chuteflow.errors import InputError
from chuteflow.maps import Domain
from chuteflow.plotting import plots, style
from chuteflow.plotting.boundary_plot import plot_boundaries, plot_boundary, plot_none
from chuteflow.plotting.domain_plot import plot_domain
from chuteflow.plotting.growth_plot import plot_family_map, plot_wave_map
from chuteflow.plotting.hot_plot import plot_hot
from chuteflow.plotting.relaxation_plot import plot_relaxation
from chuteflow.plotting.scan_plot import plot_scan, plot_sets
from chuteflow.plotting.stability_plot import plot_modes
from chuteflow.stability.answers import StabilityAnswer
from chuteflow.stability.planes import FamilyMap, WaveMap
from chuteflow.stability.relaxation import Relaxation
from chuteflow.stability.result import Stability
from chuteflow.steady.flow import Flow, Profile
from chuteflow.steady.hot import HotModel
from chuteflow.steady.quantities import Scales
from chuteflow.sweeps.scan import Scan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI = 110


def plot(result: Any, *, scales: Scales | None = None, theme: str = "print", **options: Any) -> Any:
    """Draw ``result`` in the look of a ``theme``, and return the axes: one, or an array of them. In a notebook the
    picture is shown.

    Raises:
        InputError: for a result without a picture, or an option that it does not have.
    """
    try:
        figure = style.apply_theme(drawn(result, scales, **options), theme)
    except TypeError as error:
        if "unexpected keyword argument" not in str(error):
            raise
        raise InputError(
            f"the picture of a {type(result).__name__}: {str(error).partition(') ')[2] or error}"
        ) from None
    _show(figure)
    axes = [ax for ax in figure.axes if ax.get_label() != "<colorbar>"]
    # Where there is no flow there is one panel, and callers count on an array all the same.
    return axes[0] if len(axes) == 1 and not isinstance(result, (FlowSet, Curve)) else np.array(axes)


@singledispatch
def drawn(result: Any, scales: Scales | None) -> Figure:
    """The figure of a result."""
    raise InputError(f"a {type(result).__name__} has no picture")


@drawn.register(Flow)
def _flow(result: Flow, scales: Scales | None) -> Figure:
    return plots.plot_flows(_alone(result), scales=scales)


@drawn.register(FlowSet)
def _flows(result: FlowSet, scales: Scales | None) -> Figure:
    return plots.plot_flows(result, scales=scales)


@drawn.register(FlowSets)
def _sets(result: FlowSets, scales: Scales | None, quantity: str = "centre_of_mass") -> Figure:
    return plot_sets(result, quantity, scales=scales)


@drawn.register(Profile)
def _profile(result: Profile, scales: Scales | None) -> Figure:
    if scales is not None:
        raise InputError("a profile does not know the slope, on which the scales depend: plot its flow")
    return plots.plot_profile(result)


@drawn.register(Curve)
def _curve(result: Curve, scales: Scales | None) -> Figure:
    return plots.plot_curve(result, scales=scales)


@drawn.register(Branch)
def _branch(result: Branch, scales: Scales | None) -> Figure:
    temperature, holdup = result.surface_temperature, result.mass_holdup
    searched = Searched((float(temperature.min()), float(temperature.max())), float(holdup.max()))
    alone = Curve(result.flows[0].chute, (result,), searched, max(flow.error for flow in result.flows), None)
    return plots.plot_curve(alone, scales=scales)


@drawn.register(BoundarySet)
def _no_boundaries(result: BoundarySet, scales: Scales | None) -> Figure:
    return plot_none(result)


@drawn.register(Diagram)
def _diagram(result: Diagram, scales: Scales | None) -> Figure:
    return plot_boundaries(result, scales=scales)


@drawn.register(Boundary)
def _boundary(result: Boundary, scales: Scales | None, quantity: str = "mass_flux") -> Figure:
    return plot_boundary(result, quantity, scales=scales)


@drawn.register(Domain)
def _domain(result: Domain, scales: Scales | None) -> Figure:
    if scales is not None:
        raise InputError("a domain has no units: plot it without scales")
    return plot_domain(result)


@drawn.register(WaveMap)
def _waves(result: WaveMap, scales: Scales | None) -> Figure:
    return plot_wave_map(result, scales=scales)


@drawn.register(FamilyMap)
def _family(result: FamilyMap, scales: Scales | None) -> Figure:
    return plot_family_map(result, scales=scales)


@drawn.register(Stability)
def _stability(result: Stability, scales: Scales | None) -> Figure:
    modes = () if result.mode is None else (result.mode,)
    return plot_modes(_alone(result.flow), [StabilityAnswer(result.flow, result, modes)], scales=scales)


@drawn.register(HotModel)
def _hot(result: HotModel, scales: Scales | None) -> Figure:
    if scales is not None:
        raise InputError("a hot limit has factors of powers of T_inf: plot it without scales")
    return plot_hot(result)


@drawn.register(Relaxation)
def _relaxation(result: Relaxation, scales: Scales | None) -> Figure:
    return plot_relaxation(result.flow, result.moments, result.outcome, scales=scales)


@drawn.register(Scan)
def _scan(result: Scan, scales: Scales | None, quantity: str | None = None) -> Figure:
    return plot_scan(result, quantity, scales=scales)


def _alone(flow: Flow) -> FlowSet:
    """A flow as a set of one, as if nothing else was searched."""
    temperature = flow.surface_temperature
    return FlowSet(flow.chute, (flow,), Searched((temperature, temperature), flow.mass_holdup), flow.error, None)


def _show(figure: Figure) -> None:
    """Show a picture in the notebook that runs, if one does."""
    module = sys.modules.get("IPython")
    if module is None or module.get_ipython() is None or not hasattr(module.get_ipython(), "kernel"):
        return
    stream = BytesIO()
    with style.own_settings():
        figure.savefig(stream, format="png", dpi=_DPI)
    module.display.display(module.display.Image(data=stream.getvalue()))
