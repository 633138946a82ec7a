"""Noise of a signal with a white part and one that lasts, from what smoothing leaves of it.

Smoothing takes a part of the noise with the motion. What it leaves has the autocovariance of the
noise behind the filter 1 − S, which is known; the variances of a white part and of an
autoregressive one of first order are fitted to it by non-negative least squares (Lawson and Hanson,
Solving Least Squares Problems, 1974) for each of a few memories.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array

MEMORIES_S = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.75, 1.0, 1.4)
"""Memories of the lasting part that are compared, s. A longer one cannot be distinguished from the
motion behind the widest smoothing window, 3 s."""
MOST_DEVIATIONS, NORMAL_OVER_MEDIAN = 5.0, 1.4826
"""Largest residual that is taken for noise, in standard deviations by the median, and the standard
deviation of a normal variable over the median of its size."""
LONGER_MEMORIES_S = (3.0, 5.0, 10.0)
"""Further memories of noise that is still allowed for, s."""
HAS_MEMORY, CLEARLY_BETTER = 0.7, 0.97
"""Residual norm with a lasting part over that without one, from which there is one; and that of a
longer memory over that of a shorter one, from which it is preferred."""
RULED_OUT = 1.25
"""Residual norm of a memory over the best one, from which it is ruled out."""


@dataclass(frozen=True, slots=True)
class LastingNoise:
    """Noise with a white part and an autoregressive one of first order.

    Attributes:
        white: Variance of the white part, the signal's unit squared.
        lasting: Variance of the autoregressive part, the signal's unit squared.
        memory_s: Time constant of the autoregressive part, s; 0 where there is none.
        largest: Variance of the autoregressive part with the longest memory that is not ruled out,
            the signal's unit squared: of a memory longer than the smoothing window a signal shows
            how fast its noise wanders, 2σ²/τ, and not how far.

    """

    white: float
    lasting: float = 0.0
    memory_s: float = 0.0
    largest: float = 0.0

    def autocovariance(self, lag_s: Array) -> Array:
        """Autocovariance at given lags, s, in the signal's unit squared; shape as `lag_s`."""
        away = np.abs(lag_s)
        covariance = np.where(away == 0.0, self.white, 0.0)
        if self.memory_s:
            covariance = covariance + self.lasting * np.exp(-away / self.memory_s)
        return np.asarray(covariance)


def fit_lasting_noise(
    residual: Array, runs: Sequence[NDArray[np.int64]], weights: Array, cycle_s: float
) -> LastingNoise:
    """Noise of a signal, from what a smoothing filter leaves of its readings.

    Args:
        residual: Readings less their smoothed values, NaN where there is none; shape (n,).
        runs: Indices of readings that follow each other without a gap.
        weights: Weights of the filter, symmetric, of odd length; shape (points,).
        cycle_s: Time between two readings, s.

    """
    points = len(weights)
    lags = np.arange(2 * points)
    # A jump of the signal is no noise: the residual is clipped at a few of its usual sizes.
    usual = float(np.nanmedian(np.abs(residual))) * NORMAL_OVER_MEDIAN
    most = MOST_DEVIATIONS * usual if usual else np.inf
    observed = _autocovariance(np.clip(residual, -most, most), runs, points, len(lags))
    rest = -weights
    rest[points // 2] += 1.0
    kernel = scipy.signal.fftconvolve(rest, rest[::-1])
    reach = len(lags) + points
    away_s = cycle_s * np.arange(-reach, reach + 1, dtype=np.float64)

    def behind_filter(noise: LastingNoise) -> Array:
        passed = scipy.signal.fftconvolve(noise.autocovariance(away_s), kernel, mode="same")
        return np.asarray(passed[reach + lags])

    white = behind_filter(LastingNoise(1.0))
    (size,), miss = scipy.optimize.nnls(white[:, None], observed)
    fits = []
    for memory_s in (*MEMORIES_S, *LONGER_MEMORIES_S):
        lasting = behind_filter(LastingNoise(0.0, 1.0, memory_s))
        sizes, left = scipy.optimize.nnls(np.column_stack([white, lasting]), observed)
        fits.append((float(left), LastingNoise(float(sizes[0]), float(sizes[1]), memory_s)))
    best, least = LastingNoise(float(size)), HAS_MEMORY / CLEARLY_BETTER * float(miss)
    for left, noise in fits[: len(MEMORIES_S)]:
        if left < CLEARLY_BETTER * least and noise.lasting > 0.0:
            best, least = noise, left
    if not best.memory_s:
        return best
    possible = (noise.lasting for left, noise in fits if left <= RULED_OUT * least)
    return replace(best, largest=max(best.lasting, *possible))


def _autocovariance(
    residual: Array, runs: Sequence[NDArray[np.int64]], points: int, lags: int
) -> Array:
    """Autocovariance of the residual within runs at lags 0, 1, .. readings; shape (lags,)."""
    total, count = np.zeros(lags), 0
    for run in runs:
        if len(run) < points:
            continue
        part = np.nan_to_num(residual[run])
        spectrum = np.fft.rfft(part, len(part) + lags)
        total += np.fft.irfft(np.abs(spectrum) ** 2, len(part) + lags)[:lags]
        count += len(part)
    return total / max(count, 1)
