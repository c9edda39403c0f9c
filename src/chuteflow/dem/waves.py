"""Waves in a simulation: the rate and the frequency of the longest one that fits into the box.

# notation: a(t) complex amplitude of density or momentum, sigma rate, omega frequency, s = sigma + i omega.

Waves that run to either side have one rate and frequency, a = A exp(s t) + B exp(s* t). Density and momentum down the
slope have the same s. It is found by least squares in (sigma, omega), in which all A and B follow linearly.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chuteflow.dem import script
from chuteflow.dem.output import Array, read_waves
from chuteflow.dem.run import Run
from chuteflow.errors import InputError

Complex = NDArray[np.complex128]

#: Directions of the waves, with the first column of waves.txt of each.
DIRECTIONS = {"along": 0, "across": 4}
#: Columns of a file.
_COLUMNS = ("t", "density_re", "density_im", "momentum_re", "momentum_im")
#: Smallest number of values to which a wave is fitted.
_FEWEST = 20
#: Frequencies that are tried first, in numbers of periods in the window.
_PERIODS = np.arange(0.5, 12.1, 0.5)
#: Waves that errors are taken from, and values in a row that their noise is taken in.
_REDRAWN, _BLOCK = 60, 8


@dataclass(frozen=True, eq=False)
class Amplitudes:
    """Of the longest wave in one direction: ``times`` (n,), and complex ``density`` (n,) and ``momentum`` (n,), means
    over the grains of exp(-i k x) and of the velocity down the slope times that; ``wavenumber`` is k."""

    times: Array
    density: Complex
    momentum: Complex
    wavenumber: float

    def within(self, begin: float, end: float) -> Amplitudes:
        """Those from time ``begin`` to ``end``.

        Raises:
            InputError: where there are too few.
        """
        kept = (self.times >= begin) & (self.times <= end)
        if np.count_nonzero(kept) < _FEWEST:
            raise InputError(
                f"{np.count_nonzero(kept)} values of the waves from t = {begin:g} to {end:g}: at least {_FEWEST} are "
                "needed"
            )
        return Amplitudes(self.times[kept], self.density[kept], self.momentum[kept], self.wavenumber)


@dataclass(frozen=True)
class Growth:
    """The growth of a wave: its ``rate`` and ``frequency`` with their standard errors, and ``explained``, the fraction
    of the mean squares of both amplitudes that one wave of constant rate explains."""

    rate: float
    frequency: float
    rate_error: float
    frequency_error: float
    explained: float


def amplitudes(run: Run, direction: str) -> Amplitudes:
    """The longest wave of a run ``along`` or ``across`` the slope.

    Raises:
        InputError: for a run without waves.txt, or an unknown direction.
    """
    if direction not in DIRECTIONS:
        raise InputError(f"direction {direction!r}: choose one of {', '.join(DIRECTIONS)}")
    steps, parts = read_waves(run.folder / script.WAVES)
    cos, sin, cos_v, sin_v = parts.T[DIRECTIONS[direction] :][:4]
    length = run.scene.size[list(DIRECTIONS).index(direction)]
    times = steps * run.steps.step
    return Amplitudes(times, cos - 1j * sin, cos_v - 1j * sin_v, 2.0 * math.pi / length)


def format_csv(waves: Amplitudes) -> str:
    """The amplitudes as CSV, with the wavenumber before them."""
    lines = [f"# wavenumber = {waves.wavenumber!r}", ",".join(_COLUMNS)]
    columns = (waves.times, waves.density.real, waves.density.imag, waves.momentum.real, waves.momentum.imag)
    lines += [",".join(f"{value:.5g}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join(lines) + "\n"


def read_amplitudes(path: str | os.PathLike[str]) -> Amplitudes:
    """The amplitudes in a file of :func:`written`.

    Raises:
        InputError: for a file that is missing or none of these.
    """
    try:
        head, names, *rows = Path(path).read_text(encoding="utf-8").splitlines()
        wavenumber = float(head.removeprefix("# wavenumber ="))
        t, *parts = np.array([row.split(",") for row in rows], dtype=float).T
        if tuple(names.split(",")) != _COLUMNS or len(parts) != len(_COLUMNS) - 1:
            raise ValueError
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    except ValueError:
        raise InputError(f"{path} holds no waves; `chuteflow dem waves` writes them") from None
    return Amplitudes(t, parts[0] + 1j * parts[1], parts[2] + 1j * parts[3], wavenumber)


def growth(waves: Amplitudes) -> Growth:
    """Rate and frequency of the wave over all of its times.

    The noise of the grains drives the wave, so that what it does at one time is seen at all later ones. Errors are how
    far the same fit is off for waves that start as this one, driven by its own noise in another order. They know
    nothing of a rate that changes within the window.
    """
    times = waves.times - waves.times.mean()
    data = np.stack([one / np.sqrt(np.mean(np.abs(one) ** 2)) for one in (waves.density, waves.momentum)], axis=1)
    starts = [complex(0.0, 2.0 * math.pi * periods / np.ptp(times)) for periods in _PERIODS]
    s, left = _fit_exponent(times, data, starts)
    off = np.array([_fit_exponent(times, one, [s])[0] for one in _redrawn(times, data, s)]) - s
    errors = np.sqrt(np.mean(off.real**2)), np.sqrt(np.mean(off.imag**2))
    explained = 1.0 - left / float(np.sum(np.abs(data) ** 2))
    return Growth(s.real, abs(s.imag), float(errors[0]), float(errors[1]), explained)


def _modes(times: Array, s: complex) -> Complex:
    """exp(s t) and exp(s* t), (n, 2)."""
    return np.exp(np.stack([s * times, s.conjugate() * times], axis=1))


def _fit_exponent(times: Array, data: Complex, starts: Sequence[complex]) -> tuple[complex, float]:
    """The s with which :func:`_modes` are nearest to ``data`` (n, 2), from the best of ``starts``, and the sum of the
    squares that are left."""
    from scipy.optimize import least_squares

    half = 0.5 * float(np.ptp(times))

    def residual(x: Array) -> Array:
        modes = _modes(times, complex(x[0], x[1]) / half)
        rest = data - modes @ np.linalg.lstsq(modes, data, rcond=None)[0]
        return np.concatenate([rest.real.ravel(), rest.imag.ravel()])

    tried = [np.array([s.real, s.imag]) * half for s in starts]
    first = min(tried, key=lambda x: float(residual(x) @ residual(x)))
    found: Any = least_squares(residual, first)
    return complex(found.x[0], found.x[1]) / half, 2.0 * float(found.cost)


def _redrawn(times: Array, data: Complex, s: complex) -> Iterator[Any]:
    """Waves (n, 2) that start as ``data`` and are driven by its noise, in blocks in another order.

    In terms of the two modes, z exp(-s t) is constant but for the noise, whose steps follow from the data.
    """
    step = float(times[1] - times[0])
    factors = np.exp(np.array([s, s.conjugate()]) * step)
    shapes = np.linalg.lstsq(_modes(times, s), data, rcond=None)[0]
    states = data @ np.linalg.pinv(shapes)
    noise = states[1:] - factors * states[:-1]
    random = np.random.default_rng(0)
    count = len(noise)
    for _ in range(_REDRAWN):
        begins = random.integers(0, count - _BLOCK + 1, size=-(-count // _BLOCK))
        steps = np.concatenate([noise[begin : begin + _BLOCK] for begin in begins])[:count]
        again = [states[0]]
        for one in steps:
            again.append(factors * again[-1] + one)
        yield np.array(again) @ shapes
