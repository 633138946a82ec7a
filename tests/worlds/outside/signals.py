"""Filters and random functions that the mechanisms are made of; rows of 10 ms."""

import numpy as np
from scipy.signal import bilinear, lfilter

from tests.worlds.drive_profile import STEP_S
from tests.worlds.rail import Floats


def low_pass(x: Floats, time_s: float) -> Floats:
    """First-order lag along the rows, begun at the first value."""
    keep = float(np.exp(-STEP_S / time_s))
    start = keep * np.asarray(x[:1], dtype=float)
    return np.asarray(lfilter([1 - keep], [1.0, -keep], x, axis=0, zi=start)[0])


def leaky_sum(x: Floats, time_s: float) -> Floats:
    """Integral over time with a memory of so many seconds, begun at 0."""
    keep = float(np.exp(-STEP_S / time_s))
    return np.asarray(lfilter([time_s * (1 - keep)], [1.0, -keep], x, axis=0))


def oscillator(x: Floats, frequency: float, damping: float) -> Floats:
    """x as a mass on a spring with a damper follows it; Hz and share of the critical damping."""
    w = 2 * np.pi * frequency
    b, a = bilinear([w * w], [1.0, 2 * damping * w, w * w], 1 / STEP_S)
    first = np.asarray(x[:1], dtype=float)
    return np.asarray(first + lfilter(b, a, x - first, axis=0))


def play(x: Floats, width: float) -> Floats:
    """What follows x through a clearance of a width: it stands still while x turns round."""
    y = np.empty_like(x, dtype=float)
    y[0] = x[0]
    half = 0.5 * width
    for row in range(1, len(x)):
        y[row] = np.minimum(np.maximum(y[row - 1], x[row] - half), x[row] + half)
    return y


def stretches(rng: np.random.Generator, place: Floats, inside: float, outside: float) -> Floats:
    """1 in stretches of track and 0 between, of exponential lengths with these means, m.

    A Markov process along the track, the same for every axle; edges of a metre.
    """
    at, last = float(np.min(place)) - 10.0, float(np.max(place)) + 10.0
    places, values, now = [at], [0.0], 0.0
    while at < last:
        at += float(rng.exponential(inside if now else outside)) + 1.5
        places += [at - 0.5, at + 0.5]
        values += [now, 1.0 - now]
        now = 1.0 - now
    return np.interp(place, places, values)


def coloured(rng: np.random.Generator, rows: int, step_s: float, memory_s: float) -> Floats:
    """Gaussian noise of variance 1: white for no memory, else autoregressive of first order."""
    white = rng.standard_normal(rows)
    if memory_s <= 0:
        return white
    keep = float(np.exp(-step_s / memory_s))
    white[1:] *= np.sqrt(1 - keep * keep)
    return np.asarray(lfilter([1.0], [1.0, -keep], white))


def rough_place(
    rng: np.random.Generator, place: Floats, wavelengths: tuple[float, float]
) -> Floats:
    """Random irregularity along the track, variance 1: waves of lengths between two, m."""
    lengths = np.exp(rng.uniform(*np.log(wavelengths), 24))
    phases = rng.uniform(0, 2 * np.pi, 24)
    total = np.zeros_like(place)
    for length, phase in zip(lengths, phases, strict=True):
        total += np.sin(2 * np.pi * place / length + phase)
    return np.asarray(total * np.sqrt(2 / 24))
