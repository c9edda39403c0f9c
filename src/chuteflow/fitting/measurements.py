"""Measurements of steady flows, checked and dimensionless: profiles, numbers, and their errors.

An error is absolute, or a fraction of the true value. Relative errors are compared in logarithms, so that the scatter
of a measurement does not decide on its weight. Where no errors are given at all, they are taken to be one unknown
fraction of every value, which the residuals of a fit then estimate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chuteflow import display
from chuteflow.checks import number, real_array, shorten
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import BY_KEY, CONDITIONS
from chuteflow.steady.quantities import NUMBERS

Mask = NDArray[np.bool_]

#: Fields that can be measured over height, by symbol, and whether they must be positive.
PROFILES = {"nu": ("volume_fraction", True), "T": ("granular_temperature", True), "u": ("velocity", False)}
#: Numbers of a whole flow that can be measured, by symbol.
SCALARS = {quantity.symbol: name for name, quantity in NUMBERS.items()}
#: The fraction that errors are taken for until the residuals say better.
ASSUMED = 0.05
#: Fewest heights of a profile.
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class Series:
    """Values (m,) of one field at heights, each with its standard error: of the logarithm where ``relative``."""

    symbol: str
    height: Array
    value: Array
    error: Array
    relative: bool

    @property
    def field(self) -> str:
        """The name in the registry of quantities."""
        return PROFILES[self.symbol][0]


@dataclass(frozen=True)
class Scalar:
    """A number of a flow with its standard error: of the logarithm where ``relative``."""

    symbol: str
    value: float
    error: float
    relative: bool

    @property
    def name(self) -> str:
        """The name in the registry of quantities."""
        return SCALARS[self.symbol]


@dataclass(frozen=True, eq=False)
class Experiment:
    """What was measured of one flow.

    ``given`` are parameters of its chute, by key, that are known; ``exact`` is at most one of Q, M, h and T_surface
    that is known without error, and then picks the flow; all is dimensionless.
    """

    name: str
    profiles: tuple[Series, ...]
    scalars: tuple[Scalar, ...]
    exact: Mapping[str, float] = field(default_factory=dict)
    given: Mapping[str, float] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """How many values there are beside the exact one."""
        return sum(len(series.value) for series in self.profiles) + len(self.scalars)

    def profile(self, symbol: str) -> Series | None:
        """The profile of a field, if it was measured."""
        return next((series for series in self.profiles if series.symbol == symbol), None)


@dataclass(frozen=True, eq=False)
class Measurements:
    """Experiments that are fitted together. ``errors_known`` is whether errors were given, or are to be estimated;
    ``in_units`` whether the values were made dimensionless by the slope."""

    experiments: tuple[Experiment, ...]
    errors_known: bool
    in_units: bool = False

    def __repr__(self) -> str:
        many = display.count_of(len(self.experiments), "experiment")
        return display.line("Measurements", f"{many}, {display.count_of(self.count, 'value')}")

    @cached_property
    def count(self) -> int:
        """How many values there are in all."""
        return sum(experiment.count for experiment in self.experiments)


@dataclass(frozen=True)
class StandardErrors:
    """Standard errors of one quantity: ``values`` are absolute, or fractions where ``relative``."""

    values: Any
    relative: bool = False


def measurements(
    z: ArrayLike | None = None,
    *,
    nu: ArrayLike | None = None,
    T: ArrayLike | None = None,
    u: ArrayLike | None = None,
    numbers: Mapping[str, float] | None = None,
    errors: Mapping[str, Any] | None = None,
    relative_errors: Mapping[str, Any] | None = None,
    given: Mapping[str, float] | None = None,
    trust: Mapping[str, tuple[float, float]] | None = None,
    name: str = "1",
) -> Measurements:
    """The measurements of one flow, dimensionless. Several are joined by :func:`together`.

    Args:
        z: heights above the base (m,), rising.
        nu: volume fractions there; NaN where there is none. So are ``T``, granular temperatures, and ``u``, velocities.
        numbers: numbers of the whole flow by symbol, such as Q, M, h, depth, u_base.
        errors: standard errors by symbol, one for all heights or (m,). With none at all, every value has the same
            unknown fraction for its error; the first of Q, M, h and T_surface without one is then exact.
        relative_errors: the same as fractions of the values.
        given: known parameters of the chute by key: slope, e, ew, roughness.
        trust: ranges (low, high) of z, nu, T and u outside of which values are left out.
        name: what messages call the experiment.

    Raises:
        InputError: for values that no flow has, heights that do not rise, errors that are not positive, or too few.
    """
    said = {key: StandardErrors(value) for key, value in (errors or {}).items()}
    said |= {key: StandardErrors(value, relative=True) for key, value in (relative_errors or {}).items()}
    profiles = {key: value for key, value in (("nu", nu), ("T", T), ("u", u)) if value is not None}
    return together([assemble(name, z, profiles, numbers or {}, said, given or {}, trust or {})])


def together(parts: Sequence[Experiment | Measurements], *, in_units: bool = False) -> Measurements:
    """Several experiments as one set of measurements.

    Raises:
        InputError: for none, two of one name, or errors that are given for some values and not for others.
    """
    found: list[Experiment] = []
    for part in parts:
        found += part.experiments if isinstance(part, Measurements) else [part]
    if not found:
        raise InputError("there are no measurements")
    names = [experiment.name for experiment in found]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"experiment {twice!r} is there twice: name them apart")
    known = {
        not np.isnan(error)
        for experiment in found
        for error in (
            *(float(e) for series in experiment.profiles for e in series.error),
            *(scalar.error for scalar in experiment.scalars),
        )
    }
    if len(known) > 1:
        raise InputError("errors are given for some values and not for others: give them for all, or for none")
    errors_known = known == {True}
    if not errors_known:
        found = [_assume_errors(experiment) for experiment in found]
    return Measurements(tuple(found), errors_known, in_units or any(getattr(p, "in_units", False) for p in parts))


def assemble(
    name: str,
    z: ArrayLike | None,
    profiles: Mapping[str, ArrayLike],
    numbers: Mapping[str, float],
    errors: Mapping[str, StandardErrors],
    given: Mapping[str, float],
    trust: Mapping[str, tuple[float, float]],
) -> Experiment:
    """One experiment, once its values are checked; errors that are not given are NaN.

    Raises:
        InputError: see :func:`measurements`.
    """
    what = f"experiment {name}: "
    for key in errors:
        if key not in profiles and key not in numbers:
            raise InputError(f"{what}errors of {shorten(key)} are given, and no values")
    for key in (*given, *trust):
        known = (*BY_KEY, "z", *PROFILES)
        if key not in known:
            raise InputError(f"{what}unknown {shorten(key)}: choose from {', '.join(known)}")
    series = ()
    if profiles:
        if z is None:
            raise InputError(f"{what}profiles need heights z")
        heights = _heights(what, real_array("z", z).ravel(), trust.get("z"))
        series = tuple(
            _series(what, symbol, heights, values, errors.get(symbol), trust) for symbol, values in profiles.items()
        )
    exact: dict[str, float] = {}
    scalars = []
    for symbol in (*(s for s in CONDITIONS if s in numbers), *(s for s in numbers if s not in CONDITIONS)):
        if symbol not in SCALARS:
            raise InputError(
                f"{what}unknown quantity {shorten(symbol)}: choose from {', '.join((*PROFILES, *SCALARS))}"
            )
        value = _positive(f"{what}{symbol}", number(f"{what}{symbol}", numbers[symbol]))
        if symbol not in errors and symbol in CONDITIONS and not exact:
            exact[symbol] = value
            continue
        scalars.append(_scalar(what, symbol, value, errors.get(symbol)))
    found = Experiment(
        name, series, tuple(scalars), exact, {key: BY_KEY[key].checked(value) for key, value in given.items()}
    )
    if not found.count and not found.exact:
        raise InputError(f"{what}there are no values")
    return found


def _heights(what: str, z: Array, trust: tuple[float, float] | None) -> tuple[Array, Mask]:
    """Heights, and which of them are to be used.

    Raises:
        InputError: for heights that are not finite or do not rise.
    """
    if not np.isfinite(z).all():
        raise InputError(f"{what}z: every row of a profile needs a finite height")
    step = np.diff(z)
    if (step <= 0.0).any():
        i = int(np.argmax(step <= 0.0))
        kind = "is there twice" if step[i] == 0.0 else f"comes after {z[i]:g}"
        raise InputError(f"{what}z = {z[i + 1]:g} {kind}: heights must rise, each once")
    low, high = trust or (-np.inf, np.inf)
    return z, (z >= low) & (z <= high)


def _series(
    what: str,
    symbol: str,
    heights: tuple[Array, Mask],
    values: ArrayLike,
    errors: StandardErrors | None,
    trust: Mapping[str, tuple[float, float]],
) -> Series:
    if symbol not in PROFILES:
        raise InputError(f"{what}unknown profile {shorten(symbol)}: choose from {', '.join(PROFILES)}")
    z, used = heights
    value = real_array(symbol, values).ravel()
    if value.shape != z.shape:
        raise InputError(f"{what}{symbol}: {len(value)} values at {len(z)} heights")
    there = ~np.isnan(value)
    if np.isinf(value).any():
        raise InputError(f"{what}{symbol}: values must be finite")
    positive = PROFILES[symbol][1]
    bad = there & (value <= 0.0) if positive else there & (value < 0.0)
    if bad.any():
        i = int(np.argmax(bad))
        must = "above 0" if positive else "0 or more, down the slope"
        raise InputError(
            f"{what}{symbol} = {value[i]:g} at z = {z[i]:g}: must be {must}; leave it empty if it is missing"
        )
    if symbol == "nu" and (value[there] >= 1.0).any():
        i = int(np.argmax(there & (value >= 1.0)))
        raise InputError(f"{what}nu = {value[i]:g} at z = {z[i]:g}: a volume fraction is below 1")
    low, high = trust.get(symbol, (-np.inf, np.inf))
    used = used & there & (np.where(there, value, 0.0) >= low) & (np.where(there, value, 0.0) <= high)
    if used.sum() < _FEWEST:
        raise InputError(
            f"{what}{symbol}: {int(used.sum())} of its values can be used: a profile needs {_FEWEST} at least"
        )
    relative = errors is None or errors.relative
    if relative and not positive:
        # A velocity of 0 has no logarithm.
        used = used & (value > 0.0)
    spread = np.full(len(z), np.nan) if errors is None else _spread(what, symbol, errors, len(z), used)
    return Series(symbol, z[used], value[used], spread[used], relative)


def _scalar(what: str, symbol: str, value: float, errors: StandardErrors | None) -> Scalar:
    if errors is None:
        return Scalar(symbol, value, np.nan, True)
    spread = _spread(what, symbol, errors, 1, np.ones(1, dtype=bool))
    return Scalar(symbol, value, float(spread[0]), errors.relative)


def _spread(what: str, symbol: str, errors: StandardErrors, size: int, used: Any) -> Array:
    found = real_array(f"errors of {symbol}", errors.values).ravel()
    if found.size not in (1, size):
        raise InputError(f"{what}{symbol}: {found.size} errors for {size} values")
    found = np.broadcast_to(found, size).astype(float)
    if not (np.isfinite(found[used]).all() and (found[used] > 0.0).all()):
        raise InputError(f"{what}errors of {symbol}: must be above 0 for every value")
    return found


def _positive(what: str, value: float) -> float:
    if value <= 0.0:
        raise InputError(f"{what} = {value:g}: must be above 0")
    return value


def _assume_errors(experiment: Experiment) -> Experiment:
    profiles = tuple(
        Series(s.symbol, s.height, s.value, np.full(len(s.value), ASSUMED), True) for s in experiment.profiles
    )
    scalars = tuple(Scalar(s.symbol, s.value, ASSUMED, True) for s in experiment.scalars)
    return Experiment(experiment.name, profiles, scalars, experiment.exact, experiment.given)
