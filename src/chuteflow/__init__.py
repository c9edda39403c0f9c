"""Steady flows of grains down an inclined chute: all that a search of a stated range finds, each with its error."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from chuteflow.bifurcations.boundary import Boundary, BoundarySet, Turning, boundary
    from chuteflow.branches.curve import curve
    from chuteflow.branches.enumeration import flows
    from chuteflow.branches.nearest import Nearest, nearest
    from chuteflow.branches.results import Branch, Curve, FlowSet, FlowSets, Searched, SpecialPoint
    from chuteflow.errors import ChuteflowError, InputError, SolveError
    from chuteflow.fitting.calibration import Fit, fit
    from chuteflow.fitting.comparison import compare
    from chuteflow.fitting.design import design
    from chuteflow.fitting.measurements import Measurements, measurements, together
    from chuteflow.fitting.prediction import predict
    from chuteflow.io.chute_file import read_chute
    from chuteflow.io.files import load, save
    from chuteflow.io.measurements_file import read_measurements
    from chuteflow.maps.domain import Domain, domain
    from chuteflow.stability.disturbed import growth, neutral, relax
    from chuteflow.stability.planes import FamilyMap, WaveMap
    from chuteflow.stability.relaxation import Relaxation
    from chuteflow.stability.result import Stability, stability_of
    from chuteflow.steady.cases import Case, case, cases
    from chuteflow.steady.chute import Chute
    from chuteflow.steady.flow import Flow, Profile
    from chuteflow.steady.hot import HotModel, hot
    from chuteflow.steady.quantities import QUANTITIES, Quantity, Scales
    from chuteflow.sweeps.scan import Scan, scan
    from chuteflow.sweeps.sweep import sweep
    from chuteflow.theory.laws import closures

__version__ = "0.2.0"

# Imported when first asked for, so that the command line starts quickly.
_HOMES = {
    "Boundary": "bifurcations.boundary",
    "BoundarySet": "bifurcations.boundary",
    "Branch": "branches.results",
    "Case": "steady.cases",
    "Chute": "steady.chute",
    "ChuteflowError": "errors",
    "Curve": "branches.results",
    "Domain": "maps.domain",
    "FamilyMap": "stability.planes",
    "Flow": "steady.flow",
    "FlowSet": "branches.results",
    "FlowSets": "branches.results",
    "HotModel": "steady.hot",
    "InputError": "errors",
    "Nearest": "branches.nearest",
    "Profile": "steady.flow",
    "QUANTITIES": "steady.quantities",
    "Quantity": "steady.quantities",
    "Relaxation": "stability.relaxation",
    "Scales": "steady.quantities",
    "Scan": "sweeps.scan",
    "Searched": "branches.results",
    "SolveError": "errors",
    "SpecialPoint": "branches.results",
    "Stability": "stability.result",
    "Fit": "fitting.calibration",
    "Measurements": "fitting.measurements",
    "compare": "fitting.comparison",
    "design": "fitting.design",
    "fit": "fitting.calibration",
    "measurements": "fitting.measurements",
    "predict": "fitting.prediction",
    "read_measurements": "io.measurements_file",
    "together": "fitting.measurements",
    "Turning": "bifurcations.boundary",
    "WaveMap": "stability.planes",
    "boundary": "bifurcations.boundary",
    "case": "steady.cases",
    "cases": "steady.cases",
    "closures": "theory.laws",
    "curve": "branches.curve",
    "domain": "maps.domain",
    "flows": "branches.enumeration",
    "growth": "stability.disturbed",
    "hot": "steady.hot",
    "load": "io.files",
    "nearest": "branches.nearest",
    "neutral": "stability.disturbed",
    "read_chute": "io.chute_file",
    "relax": "stability.disturbed",
    "save": "io.files",
    "scan": "sweeps.scan",
    "stability_of": "stability.result",
    "sweep": "sweeps.sweep",
}

__all__ = [
    "QUANTITIES",
    "Boundary",
    "BoundarySet",
    "Branch",
    "Case",
    "Chute",
    "ChuteflowError",
    "Curve",
    "Domain",
    "FamilyMap",
    "Fit",
    "Flow",
    "FlowSet",
    "FlowSets",
    "HotModel",
    "InputError",
    "Measurements",
    "Nearest",
    "Profile",
    "Quantity",
    "Relaxation",
    "Scales",
    "Scan",
    "Searched",
    "SolveError",
    "SpecialPoint",
    "Stability",
    "Turning",
    "WaveMap",
    "__version__",
    "boundary",
    "case",
    "cases",
    "closures",
    "compare",
    "curve",
    "design",
    "domain",
    "fit",
    "flows",
    "growth",
    "hot",
    "load",
    "measurements",
    "nearest",
    "neutral",
    "predict",
    "read_chute",
    "read_measurements",
    "relax",
    "save",
    "scan",
    "stability_of",
    "sweep",
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
