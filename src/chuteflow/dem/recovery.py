"""Fits of the parameters of a chute to a measured flow: whether the parameters of its grains are recovered.

Profiles of the volume fraction, the granular temperature and the velocity are fitted where p/M is from 0.1 to 0.9, at
the measured hold-up, the height of the base unknown. Where the theory does not hold within the statistical errors,
these are widened by one factor until it does, and intervals with them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chuteflow.dem.measured import Measured
from chuteflow.errors import InputError
from chuteflow.fitting.calibration import Fit, fit
from chuteflow.fitting.measurements import PROFILES, Measurements, measurements

#: Fractions of the hold-up above between which profiles are fitted: the theory does not describe the layer on the base.
FITTED = (0.1, 0.9)
#: Trial chutes that the search starts from, beside the chute of the run.
_TRIALS = 8


@dataclass(frozen=True, eq=False)
class Recovery:
    """A fit, and the factor by which the statistical errors were multiplied for it."""

    fit: Fit
    widening: float


def recover(measured: Measured, closure: str, free: Sequence[str]) -> Recovery:
    """Fit the parameters ``free`` of the flow of a law at the measured hold-up.

    Raises:
        InputError: for parameters of the chute that are not known, unknown names, or too few heights.
        SolveError: where no fit was found.
    """
    roughness = measured.roughness_by_area if math.isfinite(measured.roughness_by_area) else measured.roughness
    chute = measured.chute(roughness, closure)

    def fitted(widening: float) -> Recovery:
        data = as_measurements(measured, widening)
        return Recovery(fit(data, chute, free, base_height=True, trials=_TRIALS), widening)

    found = fitted(1.0)
    scale = found.fit.error_scale
    return fitted(scale) if found.fit.measured.errors_known and scale > 1.0 else found


def as_measurements(measured: Measured, widening: float = 1.0) -> Measurements:
    """The profiles of a measured flow as they are fitted, their errors multiplied by ``widening``.

    Raises:
        InputError: for a flow with too few heights there.
    """
    names = {symbol: field for symbol, (field, _) in PROFILES.items()}
    low, high = FITTED
    kept = (measured.fraction_above > low) & (measured.fraction_above < high)
    for field in names.values():
        kept &= np.isfinite(measured.fields[field])
    known = all(field in measured.errors and (measured.errors[field][kept] > 0.0).all() for field in names.values())
    if not kept.any():
        raise InputError(f"no height has p/M from {low:g} to {high:g}: there is nothing to fit")
    values = {symbol: measured.fields[field][kept] for symbol, field in names.items()}
    return measurements(
        measured.height[kept],
        nu=values["nu"],
        T=values["T"],
        u=values["u"],
        numbers={"M": measured.holdup},
        errors={symbol: widening * measured.errors[field][kept] for symbol, field in names.items()} if known else None,
    )
