"""Steady flows of grains down an inclined chute: all that a search of a stated range finds, each with its error."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from chuteflow.bifurcations.boundary import Boundary, BoundarySet, Turning, boundary
    from chuteflow.branches.curve import curve
    from chuteflow.branches.enumeration import flows
    from chuteflow.branches.results import Branch, Curve, FlowSet, Searched, SpecialPoint
    from chuteflow.errors import ChuteflowError, InputError, SolveError
    from chuteflow.fitting.calibration import Fit, fit
    from chuteflow.fitting.comparison import compare
    from chuteflow.fitting.design import design
    from chuteflow.fitting.measurements import Measurements, measurements, together
    from chuteflow.fitting.prediction import predict
    from chuteflow.io.files import load, save
    from chuteflow.io.measurements_file import read_measurements
    from chuteflow.maps.domain import Domain, domain
    from chuteflow.stability.verdict import Stability, stability_of
    from chuteflow.steady.chute import Chute
    from chuteflow.steady.flow import Flow, Profile
    from chuteflow.steady.hot import HotModel, hot
    from chuteflow.steady.quantities import QUANTITIES, Quantity, Scales

__version__ = "0.1.0"

# Imported when first asked for, so that the command line starts quickly.
_HOMES = {
    "Boundary": "bifurcations.boundary",
    "BoundarySet": "bifurcations.boundary",
    "Branch": "branches.results",
    "Chute": "steady.chute",
    "ChuteflowError": "errors",
    "Curve": "branches.results",
    "Domain": "maps.domain",
    "Flow": "steady.flow",
    "FlowSet": "branches.results",
    "InputError": "errors",
    "Profile": "steady.flow",
    "QUANTITIES": "steady.quantities",
    "Quantity": "steady.quantities",
    "Scales": "steady.quantities",
    "Searched": "branches.results",
    "SolveError": "errors",
    "SpecialPoint": "branches.results",
    "Turning": "bifurcations.boundary",
    "boundary": "bifurcations.boundary",
    "Stability": "stability.verdict",
    "Fit": "fitting.calibration",
    "HotModel": "steady.hot",
    "Measurements": "fitting.measurements",
    "compare": "fitting.comparison",
    "design": "fitting.design",
    "fit": "fitting.calibration",
    "measurements": "fitting.measurements",
    "predict": "fitting.prediction",
    "read_measurements": "io.measurements_file",
    "together": "fitting.measurements",
    "curve": "branches.curve",
    "domain": "maps.domain",
    "flows": "branches.enumeration",
    "hot": "steady.hot",
    "load": "io.files",
    "save": "io.files",
    "stability_of": "stability.verdict",
}

__all__ = [
    "QUANTITIES",
    "Boundary",
    "BoundarySet",
    "Branch",
    "Chute",
    "ChuteflowError",
    "Curve",
    "Domain",
    "Fit",
    "Flow",
    "FlowSet",
    "HotModel",
    "InputError",
    "Measurements",
    "Profile",
    "Quantity",
    "Scales",
    "Searched",
    "SolveError",
    "SpecialPoint",
    "Stability",
    "Turning",
    "__version__",
    "boundary",
    "compare",
    "curve",
    "design",
    "domain",
    "fit",
    "flows",
    "hot",
    "load",
    "measurements",
    "predict",
    "read_measurements",
    "save",
    "stability_of",
    "together",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'chuteflow' has no attribute {name!r}")
    value = getattr(import_module(f"chuteflow.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
