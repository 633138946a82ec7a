"""Smoothing of signals: local parabolas (Savitzky and Golay, Anal. Chem. 36 (1964)).

The width of the window is chosen by the prediction error: by leave-one-out cross-validation where
the noise is white, by Mallows' criterion where it may have a memory.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.noise_memory import LastingNoise, fit_lasting_noise
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.sampling.traces import Trace

SPEED_WINDOWS_S = (0.3, 0.6, 1.0, 1.5, 2.2, 3.0)
"""Widths for the vehicle speed less the part that the efforts predict, s."""
WHEEL_WINDOWS_S = (0.05, 0.09, 0.15)
"""Widths for the wheel speeds, s."""
EFFORT_WINDOWS_S = (0.15,)
"""Width for the tractive efforts, s."""
HIGH_PASS_WINDOW_S = 0.4
"""Width of the window of the high-pass filter, s."""
GAP_CYCLES = 3.0
"""Time between two readings, in cycles of the signal, from which it is a gap."""
DELAY_STEPS_S, LOW_PASS_STEPS_S, LAG_REACH = (0.1, 0.02, 0.005), (0.3, 0.04, 0.005), 10
"""Steps of the search for the lag of the vehicle speed behind the efforts, coarse to fine, s, for a
delay and for a time constant, and steps to either side."""
LAGS_FORGOTTEN = 5.0
"""Time constants in which a first-order lag forgets its input."""
CLEAR_PITCH = 0.1
"""Share of what the impulse leaves of the speed's differences that a pitch must explain."""
ABOUT_HALF = 0.55
"""Largest width of a window, relative to another one, that counts as half of it."""
SAME_NOISE = 4.0
"""Ratio of the lasting noise's variance by a window and by one of half its width, up to which both
count as the same."""
LEAST_DURATION, LONGEST_ERROR_S = 0.2, 3.0
"""Least time for which a smoothed value errs, relative to white noise, and the longest one, s."""
LEAST_READINGS = 8
"""A signal with fewer readings is not used."""
LEAST_POINTS = 5
"""Least number of readings in a window."""


class SmoothedSignal(NamedTuple):
    """A smoothed signal.

    Attributes:
        t_s: Stamps, s; shape (n,).
        value: Smoothed values in the signal's unit; shape (n,).
        rate: Rates of change, the signal's unit per second; shape (n,).
        std: Standard deviation of a smoothed value, the signal's unit.
        gaps: Last stamp before and first stamp after each gap, s; shape (gaps, 2).
        window_s: Width of the smoothing window, s.
        largest_std: Standard deviation of a smoothed value where the noise may have a memory, and
            its memory is the longest that the readings do not rule out; the signal's unit.

    """

    t_s: Array
    value: Array
    rate: Array
    std: float
    gaps: Array
    window_s: float = 0.0
    largest_std: float = 0.0


class _Smoothing(NamedTuple):
    """Smoothing with one window: cross-validated mean square, values, rates, stds, width."""

    unseen_square: float
    value: Array
    rate: Array
    std: float
    window_s: float
    largest_std: float


class _LaggedImpulse(NamedTuple):
    """Square of the speed's differences that an impulse explains, its lag, s, and its speed."""

    explained: float
    lag: float
    speed: Array


def available_readings(trace: Trace, origin_us: int) -> tuple[Array, Array]:
    """Stamps since time 0, s, and values of the readings that are available."""
    good = np.isfinite(trace.value)
    return (trace.t_us[good] - origin_us) / 1e6, trace.value[good]


def smooth_signal(
    trace: Trace,
    origin_us: int,
    windows_s: Sequence[float],
    known: Array | None = None,
    *,
    has_memory: bool = False,
) -> SmoothedSignal | None:
    """Smooth a trace, gap-free run by run; None where it has too few readings.

    Args:
        trace: Readings in the signal's unit; those that are not available are left out.
        origin_us: Stamp of time 0, µs.
        windows_s: Widths to choose from, s; a window has at least five readings.
        known: Part of the signal that needs no smoothing, at the readings that are available, in
            the signal's unit; shape (n,).
        has_memory: Whether the signal's noise may last from reading to reading.

    """
    t, raw = available_readings(trace, origin_us)
    known_part = np.zeros(len(t)) if known is None else known
    raw = raw - known_part
    if len(t) < LEAST_READINGS:
        return None
    cycle = float(np.median(np.diff(t)))
    runs = _split_at_gaps(t, cycle)
    best = _best_smoothing(raw, runs, cycle, windows_s, has_memory=has_memory)
    if best is None:
        return None
    available = np.isfinite(best.rate)
    kept, known_rate = t[available], np.gradient(known_part, t)[available]
    after = np.flatnonzero(np.diff(kept) > GAP_CYCLES * cycle) + 1
    gaps = np.stack([kept[after - 1], kept[after]], axis=1)
    value = best.value[available] + known_part[available]
    rate = best.rate[available] + known_rate
    return SmoothedSignal(kept, value, rate, best.std, gaps, best.window_s, best.largest_std)


def _best_smoothing(
    raw: Array,
    runs: Sequence[NDArray[np.int64]],
    cycle: float,
    windows_s: Sequence[float],
    *,
    has_memory: bool,
) -> _Smoothing | None:
    """Smoothing with the least prediction error; None where every run is too short."""
    longest = max(len(run) for run in runs)
    counts = sorted({max(round(window / cycle / 2) * 2 + 1, LEAST_POINTS) for window in windows_s})
    fits = [_smooth(raw, runs, points, cycle) for points in counts if points <= longest]
    if not fits:
        return None
    if has_memory:
        noise = _estimate_noise(raw, runs, fits, cycle)
        scored = [_score_by_noise(raw, fit, cycle, noise) for fit in fits]
    else:
        scored = [_score_by_leverage(raw, fit, cycle) for fit in fits]
    return min(scored, key=lambda smoothing: smoothing.unseen_square)


class _Fit(NamedTuple):
    """Local parabolas of one width: values and rates, NaN in short runs; filter weights."""

    value: Array
    rate: Array
    weights: Array


def _smooth(raw: Array, runs: Sequence[NDArray[np.int64]], points: int, cycle: float) -> _Fit:
    """Fit local parabolas of so many points to every run that is long enough."""
    value, rate = np.full(len(raw), np.nan), np.full(len(raw), np.nan)
    for run in runs:
        if len(run) >= points:
            value[run] = scipy.signal.savgol_filter(raw[run], points, 2)
            rate[run] = scipy.signal.savgol_filter(raw[run], points, 2, deriv=1, delta=cycle)
    return _Fit(value, rate, scipy.signal.savgol_coeffs(points, 2))


def _estimate_noise(
    raw: Array, runs: Sequence[NDArray[np.int64]], fits: Sequence[_Fit], cycle: float
) -> LastingNoise:
    """Noise by the widest window that leaves no motion.

    Noise is the same whatever window shows it. Motion that a window does not follow grows with its
    width and looks like noise that lasts: such a window says nothing of the noise.
    """
    noises = [fit_lasting_noise(raw - fit.value, runs, fit.weights, cycle) for fit in fits]
    widths = [len(fit.weights) for fit in fits]
    for place in reversed(range(len(fits))):
        halves = [k for k in range(place) if widths[k] <= ABOUT_HALF * widths[place]]
        if halves and noises[place].lasting <= SAME_NOISE * noises[halves[-1]].lasting:
            return noises[place]
    return noises[min(1, len(noises) - 1)]


def _score_by_leverage(raw: Array, fit: _Fit, cycle: float) -> _Smoothing:
    """Smoothing of white noise, with its leave-one-out prediction error.

    Leverage is the weight of a reading in its own smoothed value. A residual over 1 − leverage is
    the leave-one-out prediction error (PRESS; Allen, Technometrics 16, 1974).
    """
    leverage = float(fit.weights[len(fit.weights) // 2])
    error = float(np.nanmean((raw - fit.value) ** 2))
    std = float(np.sqrt(error * leverage / (1.0 - leverage)))
    unseen = error / (1.0 - leverage) ** 2
    return _Smoothing(unseen, fit.value, fit.rate, std, len(fit.weights) * cycle, std)


def _score_by_noise(raw: Array, fit: _Fit, cycle: float, noise: LastingNoise) -> _Smoothing:
    """Smoothing of noise with a memory, with Mallows' criterion.

    Leaving a reading out says little where its neighbours have the same error. The criterion takes
    the noise's autocovariance instead (Opsomer, Wang and Yang, Statistical Science 16 (2001)).
    """
    points = len(fit.weights)
    away_s = cycle * np.arange(-(points // 2), points // 2 + 1, dtype=np.float64)
    error = float(np.nanmean((raw - fit.value) ** 2))
    variance = float(noise.autocovariance(np.zeros(1))[0])
    unseen = error - variance + 2.0 * float(fit.weights.dot(noise.autocovariance(away_s)))
    both = scipy.signal.fftconvolve(fit.weights, fit.weights[::-1])
    lag_s = cycle * np.arange(1 - points, points, dtype=np.float64)
    std = float(np.sqrt(max(float(both @ noise.autocovariance(lag_s)), 0.0)))
    # A smoothed value errs for longer than the window where the noise itself lasts.
    wide_s = cycle * np.arange(-4 * points, 4 * points + 1, dtype=np.float64)
    lasting = scipy.signal.fftconvolve(noise.autocovariance(wide_s), both)
    duration = _correlation_time(lasting) / _correlation_time(both)
    window_s = min(points * cycle * max(duration, LEAST_DURATION), LONGEST_ERROR_S)
    largest = float(np.hypot(std, np.sqrt(noise.largest)))
    return _Smoothing(unseen, fit.value, fit.rate, std, window_s, largest)


def _correlation_time(autocovariance: Array) -> float:
    """Sum of the positive part of an autocorrelation, steps; 0 where nothing varies."""
    variance = float(autocovariance.max())
    return float(np.sum(np.maximum(autocovariance, 0.0))) / variance if variance > 0.0 else 0.0


def high_pass(trace: Trace, origin_us: int) -> list[tuple[Array, Array]]:
    """High-pass part of a signal: its readings less a local parabola over 0.4 s.

    Args:
        trace: Readings in the signal's unit.
        origin_us: Stamp of time 0, µs.

    Returns:
        Stamps, s, and values of each gap-free run.

    """
    t, value = available_readings(trace, origin_us)
    if len(t) < LEAST_READINGS:
        return []
    cycle = float(np.median(np.diff(t)))
    points = max(round(HIGH_PASS_WINDOW_S / cycle / 2) * 2 + 1, LEAST_POINTS)
    return [
        (t[run], value[run] - scipy.signal.savgol_filter(value[run], points, 2))
        for run in _split_at_gaps(t, cycle)
        if len(run) > points
    ]


def _split_at_gaps(t_s: Array, cycle: float) -> list[NDArray[np.int64]]:
    """Indices of readings that follow each other without a gap."""
    return np.split(np.arange(len(t_s)), np.flatnonzero(np.diff(t_s) > GAP_CYCLES * cycle) + 1)


def predict_speed_from_efforts(
    trace: Trace, origin_us: int, efforts: Sequence[SmoothedSignal]
) -> Array | None:
    """Predict the change of the vehicle speed: impulse of the efforts over the train's mass.

    A radar on a body that pitches reads an error that follows speed and total effort. It is neither
    noise nor slow: smoothing would take half of it off. So the prediction has it.

    Resistance grows with the speed, and so does the pull of a track on which the train keeps a
    speed: the distance travelled has the impulse of that. Without it a speed that swings over
    minutes is met best by an impulse of the efforts that comes 35 ms too late.

    A train is heavy: its speed is this prediction and a slower part, which alone needs smoothing.
    Masses and lag are estimated by least squares on differences over a second: were a late speed
    not met by a late impulse, the difference would be fast, and smoothing would take a part of it
    off. The same holds of a speed that its instrument smooths, which a late impulse meets at its
    bends alone. So the lag is a delay or a time constant, whichever explains more.

    Args:
        trace: Vehicle speed, m/s.
        origin_us: Stamp of time 0, µs.
        efforts: Smoothed tractive effort of every axle, N.

    Returns:
        Predicted speed at the available readings, m/s, without its offset; None: too few readings.

    """
    t, v = available_readings(trace, origin_us)
    if len(t) < LEAST_READINGS or not efforts:
        return None
    step = max(round(1.0 / float(np.median(np.diff(t)))), 1)
    if len(t) <= 2 * step:
        return None
    total = np.sum([np.interp(t, effort.t_s, effort.value) for effort in efforts], axis=0)
    # Integrated at their own stamps: the efforts go on in a gap of the speed.
    impulse = np.sum([np.interp(t, effort.t_s, integrate(effort)) for effort in efforts], axis=0)
    travelled = np.concatenate([[0.0], np.cumsum(np.diff(t) * (v[1:] + v[:-1]) / 2)])
    dv = _second_difference(v, step)
    square = float(dv @ dv)

    def fit(lag: float, lagged: Callable[[Array, Array, float], Array]) -> _LaggedImpulse:
        """Least-squares fit of impulse and pitch that come so much earlier than the speed, s."""
        # The pitch comes last: the fit without it has the others.
        late = np.stack([lagged(t, impulse, lag), travelled, lagged(t, total * v, lag)])
        design = np.stack([_second_difference(part, step) for part in late])
        gram, right = design @ design.T, design @ dv

        def explain(count: int) -> tuple[Array, float]:
            """Factors of the first parts, and the square that they explain."""
            factors = np.asarray(
                np.linalg.lstsq(gram[:count, :count], right[:count], rcond=None)[0],
                dtype=np.float64,
            )
            return factors, float(right[:count] @ factors)

        factors, explained = explain(2)
        if factors[0] <= 0.0:
            return _LaggedImpulse(0.0, lag, np.zeros(len(t)))  # no train is pushed backwards
        alone = _LaggedImpulse(explained, lag, factors @ late[:2])
        factors, explained = explain(3)
        # A pitch that is read into noise would stay in the speed, which nothing smooths out.
        if factors[0] <= 0.0 or square - explained > (1.0 - CLEAR_PITCH) * (
            square - alone.explained
        ):
            return alone
        return _LaggedImpulse(explained, lag, factors @ late)

    def search(
        lagged: Callable[[Array, Array, float], Array], steps_s: Sequence[float]
    ) -> _LaggedImpulse:
        best = fit(0.0, lagged)
        for reach in steps_s:
            around = (best.lag + k * reach for k in range(-LAG_REACH, LAG_REACH + 1))
            best = max([best, *(fit(lag, lagged) for lag in around)], key=lambda fit: fit.explained)
        return best

    delayed = search(_delayed, DELAY_STEPS_S)
    return max(delayed, search(_low_passed, LOW_PASS_STEPS_S), key=lambda fit: fit.explained).speed


def _delayed(t_s: Array, values: Array, lag: float) -> Array:
    """Values that come late by a lag, s."""
    return np.interp(t_s - lag, t_s, values)


def _low_passed(t_s: Array, values: Array, time_s: float) -> Array:
    """Values behind a first-order lag of a time constant, s; at 0 and below, the values.

    Gaps are straight lines; behind one that the lag forgets it is at rest.
    """
    if time_s <= 0.0:
        return values
    lags = LagStates(pause_s=LAGS_FORGOTTEN * time_s)
    return lags.follow("speed", np.zeros(len(t_s)), t_s, values, 1.0 / time_s)


def integrate(signal: SmoothedSignal) -> Array:
    """Integral of a signal over time since its first reading, by the trapezoidal rule, (n,)."""
    mean = (signal.value[1:] + signal.value[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(np.diff(signal.t_s) * mean)])


def _second_difference(x: Array, step: int) -> Array:
    """Second differences, which remove the slow part, a constant pull."""
    return np.asarray(x[2 * step :] - 2 * x[step:-step] + x[: -2 * step])


def is_covered(signal: SmoothedSignal, from_s: Array, to_s: Array) -> NDArray[np.bool_]:
    """Whether a signal has no gap between two times, s, for each pair of them; shape (n,)."""
    if not len(signal.t_s):
        return np.zeros(len(from_s), dtype=np.bool_)
    inside = (from_s >= signal.t_s[0]) & (to_s <= signal.t_s[-1])
    if len(signal.gaps):
        # A gap between the two times begins before the later one and ends after the earlier one.
        first = np.searchsorted(signal.gaps[:, 1], from_s, side="right")
        last = np.searchsorted(signal.gaps[:, 0], to_s, side="left")
        inside &= first >= last
    return np.asarray(inside)
