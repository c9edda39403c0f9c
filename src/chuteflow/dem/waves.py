"""Waves in a simulation: the rate and the frequency of the longest one that fits into the box.

# notation: a(t) complex amplitude of density or momentum, sigma rate, omega frequency, s = sigma + i omega.

Waves that run to either side have one rate and frequency, a = A exp(s t) + B exp(s* t). Density and momentum down the
slope have the same s. It is found by least squares in (sigma, omega), in which all A and B follow linearly.
"""

from __future__ import annotations

import math
import os
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
    """The growth of a wave: its ``rate`` and ``frequency``, and ``explained``, the fraction of the mean squares of both
    amplitudes that one wave of constant rate explains."""

    rate: float
    frequency: float
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


def written(waves: Amplitudes) -> str:
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
    """Rate and frequency of the wave over all of its times."""
    from scipy.optimize import least_squares

    times = waves.times - waves.times.mean()
    half = 0.5 * float(np.ptp(times))
    data = np.stack([one / np.sqrt(np.mean(np.abs(one) ** 2)) for one in (waves.density, waves.momentum)], axis=1)

    def left(x: Array) -> Array:
        s = complex(x[0], x[1]) / half
        modes = np.exp(np.stack([s * times, s.conjugate() * times], axis=1))
        rest = data - modes @ np.linalg.lstsq(modes, data, rcond=None)[0]
        return np.concatenate([rest.real.ravel(), rest.imag.ravel()])

    tried = [np.array([0.0, math.pi * periods]) for periods in _PERIODS]
    first = min(tried, key=lambda x: float(left(x) @ left(x)))
    found: Any = least_squares(left, first)
    rate, frequency = found.x / half
    return Growth(float(rate), abs(float(frequency)), 1.0 - 2.0 * float(found.cost) / float(np.sum(np.abs(data) ** 2)))
