"""Errors of means over time series that are correlated: the Gamma method.

# notation: C(t) autocovariance at a lag of t samples, n samples, W the last lag that is summed, tau integrated
# correlation time in samples, C(0)/2 + C(1) + ... over C(0).

The variance of a mean of n samples is 2 tau C(0)/n. The sum over lags ends where the error of leaving out the rest
equals the error of the noise, as in U. Wolff, Comput. Phys. Commun. 156 (2004) 143, and is corrected for the mean, or
the line, having been taken off the samples. It is never taken to be less than that of independent samples: a few
samples may look as if they cancelled one another.
"""

from __future__ import annotations

import numpy as np

from chuteflow.dem.output import Array

#: Decay time of the autocovariance over the integrated correlation time, as it is guessed for the window.
_DECAY = 2.0


def long_run_variance(samples: Array, fitted: int = 1) -> Array:
    """n times the variance of the mean of ``samples`` (n, ...) in the order of time, whose mean is 0 since ``fitted``
    constants, 1 for a mean and 2 for a straight line, were taken off; NaN where a sample is."""
    count = len(samples)
    covariance = _autocovariance(samples.reshape(count, -1))
    # The noise is spread evenly over the lags; lag 0 counts once, all others twice.
    sums = 2.0 * np.cumsum(covariance, axis=0) - covariance[0]
    window = _windows(sums, covariance[0], count)
    found = sums[window, np.arange(sums.shape[1])] * (1.0 + fitted * (2.0 * window + 1.0) / count)
    return np.maximum(found, covariance[0] * (1.0 + fitted / count)).reshape(samples.shape[1:])


def correlation_time(samples: Array) -> float:
    """tau of ``samples`` (n,), in samples: 1/2 where they are not correlated."""
    away = samples - samples.mean()
    spread = float(away @ away) / len(away)
    return float(long_run_variance(away)) / (2.0 * spread) if spread > 0.0 else 0.5


def _autocovariance(samples: Array) -> Array:
    """Of lags up to half of the samples (lags, m)."""
    count = len(samples)
    power = np.abs(np.fft.rfft(samples, 2 * count, axis=0)) ** 2
    lags = np.arange(max(count // 2, 1))
    return np.fft.irfft(power, 2 * count, axis=0)[: len(lags)] / (count - lags)[:, None]


def _windows(sums: Array, variance: Array, count: int) -> Array:
    """W (m,): the first lag at which noise outweighs what is left out."""
    lags = np.arange(1, len(sums))[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        doubled = sums[1:] / variance
        decay = _DECAY / np.log((doubled + 1.0) / (doubled - 1.0))
        decay = np.where(doubled > 1.0, decay, 1e-10)
        enough = np.exp(-lags / decay) < decay / np.sqrt(lags * count)
    return np.where(enough.any(axis=0), 1 + enough.argmax(axis=0), len(sums) - 1)
