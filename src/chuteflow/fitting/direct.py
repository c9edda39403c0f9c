"""What profiles say without a model: in a steady chute the stresses are known from the volume fraction alone.

# notation: p normal stress, the integral of nu dz above; s slope, nu volume fraction, T granular temperature, u
# velocity; g1 = p/T, g2 = s p/(sqrt(T) du/dz), and F1 = u/sqrt(T) at the base.

The normal stress is the weight of the grains above (3.4), and the shear stress s times that (3.5), whatever the grains
are. Above the highest value nu is taken to fall off exponentially, at the rate of the values below, and what is there
to be known to a half. Errors come from many draws of
the measurements within their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chuteflow.errors import InputError
from chuteflow.fitting.measurements import Experiment, Series
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.chute import Chute
from chuteflow.theory.bases import base
from chuteflow.theory.boundary import surface_stress
from chuteflow.theory.constitutive import Law, reduce

#: Draws of the measurements.
_DRAWS = 400
#: Values that a slope is taken from, and those of the tail.
_WINDOW, _TAIL = 5, 4
#: Relative error of the part of the stress that is above the highest value.
_TAIL_ERROR = 0.5


@dataclass(frozen=True, eq=False)
class MeasuredFunction:
    """A function of the volume fraction as it was measured (m,), its standard errors, and what the law gives there.

    ``ratio_error`` is the standard error of the measured value over that of the law, which has one too, as the volume
    fraction was measured.
    """

    value: Array
    error: Array
    law: Array
    ratio_error: Array

    @property
    def deviation(self) -> Array:
        """By how many errors the law is above what was measured."""
        return (1.0 - self.value / self.law) / self.ratio_error


@dataclass(frozen=True, eq=False)
class DirectMeasurement:
    """What one experiment says of g1, and where velocities were measured of g2 and the slip coefficient F1.

    ``height`` and ``nu`` (m,) are where; F1 is that at the base, to which the lowest values are extended, in arrays of
    one value.
    """

    name: str
    height: Array
    nu: Array
    g1: MeasuredFunction
    g2: MeasuredFunction | None
    slip: MeasuredFunction | None
    closure: str


def direct(experiment: Experiment, chute: Chute, *, error_scale: float = 1.0, seed: int = 0) -> DirectMeasurement:
    """g1, g2 and the slip of an experiment from its profiles, beside the law and the base of ``chute``.

    Args:
        experiment: with profiles of nu and T at heights of which some are the same, and of u for g2 and the slip.
        chute: for the slope, the law and the base.
        error_scale: what the errors of the measurements are multiplied with.
        seed: of the draws.

    Raises:
        InputError: without profiles of nu and T, or where too few of their heights are the same.
    """
    nu, temperature = experiment.profile("nu"), experiment.profile("T")
    if nu is None or temperature is None:
        raise InputError(f"experiment {experiment.name}: g1 needs profiles of nu and T")
    height = np.intersect1d(nu.height, temperature.height)
    velocity = experiment.profile("u")
    shared = height if velocity is None else np.intersect1d(height, velocity.height)
    if len(shared) >= _WINDOW:
        height = shared
    else:
        velocity = None
    if len(height) < _WINDOW:
        raise InputError(f"experiment {experiment.name}: nu and T need {_WINDOW} heights that are the same")
    rng = np.random.default_rng(seed)
    draws = _draws(nu, rng, error_scale)
    picked = np.searchsorted(nu.height, height)
    tails = np.append(1.0, np.exp(_TAIL_ERROR * rng.standard_normal(_DRAWS)))
    stress = _stresses(nu.height, draws, surface_stress(chute.surface), tails)[:, picked]
    t = _draws(temperature, rng, error_scale)[:, np.searchsorted(temperature.height, height)]
    density = draws[:, picked]
    law, e, slope = chute.law, chute.restitution, chute.slope
    _, _, coefficients = law.at(_scale(density, law), e, slope)
    g1 = _summarise(stress / t, density * coefficients.compressibility)
    g2 = slip = None
    if velocity is not None:
        u = _draws(velocity, rng, error_scale)[:, np.searchsorted(velocity.height, height)]
        with np.errstate(invalid="ignore", divide="ignore"):
            shear = slope * stress / (np.sqrt(t) * (u @ _slopes(height).T))
        g2 = _summarise(shear, np.broadcast_to(coefficients.viscosity, density.shape))
        at_base = _at_base(height)
        t_0, nu_0 = np.maximum(t @ at_base, 1e-12), np.maximum(density @ at_base, 1e-12)
        slip = _summarise((u @ at_base / np.sqrt(t_0))[:, None], _slip(chute, law, _scale(nu_0, law))[:, None])
    return DirectMeasurement(experiment.name, height, nu.value[picked], g1, g2, slip, str(chute.closure))


def _scale(nu: Array, law: Law) -> Array:
    """nu/(1 - nu/nu*), of densities beyond the packing that of the densest."""
    return nu / (1.0 - np.minimum(nu / law.densest, 0.999999))


def _draws(series: Series, rng: np.random.Generator, scale: float) -> Array:
    """The values, and draws of them within their errors (1 + draws, m)."""
    noise = np.concatenate([np.zeros((1, len(series.value))), rng.standard_normal((_DRAWS, len(series.value)))])
    noise *= series.error * scale
    return series.value * np.exp(noise) if series.relative else np.maximum(series.value + noise, 1e-12)


def _stresses(z: Array, nu: Array, top: float, tails: Array) -> Array:
    """Integrals of nu (k, m) over the heights above each, with an exponential tail times ``tails`` (k,), or ``top`` at
    an interface."""
    log_nu = np.log(nu)
    step = np.diff(z)
    # The mean of nu on an interval on which it goes exponentially.
    rise = np.diff(log_nu, axis=1)
    flat = np.abs(rise) < 1e-6
    mean = np.where(flat, nu[:, :-1], np.diff(nu, axis=1) / np.where(flat, 1.0, rise))
    above = np.cumsum((mean * step)[:, ::-1], axis=1)[:, ::-1]
    found = np.concatenate([above, np.zeros((len(nu), 1))], axis=1)
    if top > 0.0:
        return found + top
    tail = slice(-_TAIL, None)
    centred = z[tail] - z[tail].mean()
    decay = -(log_nu[:, tail] @ centred) / (centred @ centred)
    # Where values do not fall off there is no end: at least the last height again.
    return found + (tails * nu[:, -1] / np.maximum(decay, 1.0 / max(float(z[-1]), 1e-12)))[:, None]


def _slopes(z: Array) -> Array:
    """The matrix (m, m) that takes values to their slopes: of parabolas through neighbours by least squares."""
    out = np.zeros((len(z), len(z)))
    for i in range(len(z)):
        first = min(max(i - _WINDOW // 2, 0), len(z) - _WINDOW)
        near = slice(first, first + _WINDOW)
        out[i, near] = np.linalg.pinv((z[near] - z[i])[:, None] ** np.arange(3))[1]
    return out


def _at_base(z: Array) -> Array:
    """Weights (m,) that take values to that at z = 0: of a parabola through the lowest."""
    out = np.zeros(len(z))
    out[:_WINDOW] = np.linalg.pinv(z[:_WINDOW, None] ** np.arange(3))[0]
    return out


def _summarise(draws: Array, law: Array) -> MeasuredFunction:
    """The first draw, which is without noise, and how far the others spread."""
    return MeasuredFunction(draws[0], _width(draws[1:]), law[0], _width(draws[1:] / law[1:]))


def _width(draws: Array) -> Array:
    low, high = np.quantile(draws, [0.1587, 0.8413], axis=0)
    return 0.5 * (high - low)


def _slip(chute: Chute, law: Law, scaled: Array) -> Array:
    """F1 of the base at scaled densities."""
    on = base(chute.base)
    first, second = on.functions(reduce(law, scaled, chute.restitution, chute.slope))
    return np.asarray(on.slip(first, second, chute.roughness, chute.slope))
