"""Signals without their noise, as far as what is known of them allows."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.sampling.traces import Trace

SPEED_WINDOWS_S = (0.3, 0.6, 1.0, 1.5, 2.2, 3.0)
"""Over one of these a parabola smooths what the efforts leave of the vehicle speed."""
WHEEL_WINDOWS_S = (0.05, 0.09)
EFFORT_WINDOWS_S = (0.15,)
ROUGH_S = 0.4
GAP_CYCLES = 3.0
SHORTEST = 8
"""Readings; fewer are no signal."""


class SmoothedSignal(NamedTuple):
    """A signal smoothed: stamps, s, value, rate of change, std of the value, gaps, window, s."""

    t_s: Array
    value: Array
    rate: Array
    std: float
    breaks: Array
    window_s: float = 0.0


def smooth_signal(
    trace: Trace, origin_us: int, windows_s: Sequence[float], known: Array | None = None
) -> SmoothedSignal | None:
    """A trace smoothed by local parabolas, stretch by stretch; None where too little is there.

    Of several windows the one is taken that predicts best what it has not seen: each reading from
    its neighbours.

    Args:
        trace: readings; those not available are left out.
        origin_us: stamp of time 0.
        windows_s: widths to choose from, s; at least five readings are taken.
        known: a part of the signal that needs no smoothing, at the readings that are available.

    """
    good = np.isfinite(trace.value)
    t = (trace.t_us[good] - origin_us) / 1e6
    part_known = np.zeros(len(t)) if known is None else known
    raw = trace.value[good] - part_known
    if len(t) < SHORTEST:
        return None
    cycle = float(np.median(np.diff(t)))
    parts = _find_runs(t, cycle)
    longest = max(len(part) for part in parts)
    counts = sorted({max(round(window / cycle / 2) * 2 + 1, 5) for window in windows_s})
    best: tuple[float, Array, Array, float, float] | None = None
    for points in counts:
        if points > longest:
            continue
        value, rate = np.full(len(raw), np.nan), np.full(len(raw), np.nan)
        for part in parts:
            if len(part) >= points:
                value[part] = scipy.signal.savgol_filter(raw[part], points, 2)
                rate[part] = scipy.signal.savgol_filter(raw[part], points, 2, deriv=1, delta=cycle)
        centre = float(scipy.signal.savgol_coeffs(points, 2)[points // 2])
        error = float(np.nanmean((raw - value) ** 2))
        unseen = error / (1.0 - centre) ** 2
        if best is None or unseen < best[0]:
            std = float(np.sqrt(error * centre / (1.0 - centre)))
            best = unseen, value, rate, std, points * cycle
    if best is None:
        return None
    _, value, rate, std, window_s = best
    there = np.isfinite(rate)
    kept, rise = t[there], np.gradient(part_known, t)[there]
    after = np.flatnonzero(np.diff(kept) > GAP_CYCLES * cycle) + 1
    breaks = np.stack([kept[after - 1], kept[after]], axis=1)
    whole = value[there] + part_known[there]
    return SmoothedSignal(kept, whole, rate[there] + rise, std, breaks, window_s)


def rough(trace: Trace, origin_us: int) -> list[tuple[Array, Array]]:
    """The fast part of a signal, what is left of it beside its mean over 0.4 s.

    Returns:
        Stamps, s, and values of each stretch without a gap.

    """
    good = np.isfinite(trace.value)
    t, value = (trace.t_us[good] - origin_us) / 1e6, trace.value[good]
    if len(t) < SHORTEST:
        return []
    cycle = float(np.median(np.diff(t)))
    points = max(round(ROUGH_S / cycle / 2) * 2 + 1, 5)
    return [
        (t[part], value[part] - scipy.signal.savgol_filter(value[part], points, 2))
        for part in _find_runs(t, cycle)
        if len(part) > points
    ]


def _find_runs(t_s: Array, cycle: float) -> list[NDArray[np.int64]]:
    """Readings that follow each other without a gap."""
    return np.split(np.arange(len(t_s)), np.flatnonzero(np.diff(t_s) > GAP_CYCLES * cycle) + 1)


def predict_speed_from_efforts(trace: Trace, origin_us: int, efforts: Sequence[SmoothedSignal]) -> Array | None:
    """What the efforts explain of a vehicle speed: their impulse over the train's mass.

    A train is heavy: its speed is what pulled it, and something slower. So the smoothing is left
    with the slow part. The mass comes from the data, by differences over a second.

    Args:
        trace: vehicle speed.
        origin_us: stamp of time 0.
        efforts: of every axle, smoothed.

    """
    good = np.isfinite(trace.value)
    t, v = (trace.t_us[good] - origin_us) / 1e6, trace.value[good]
    if len(t) < SHORTEST or not efforts:
        return None
    whole = np.sum([np.interp(t, effort.t_s, effort.value) for effort in efforts], axis=0)
    impulse = np.concatenate([[0.0], np.cumsum(np.diff(t) * (whole[1:] + whole[:-1]) / 2)])
    lag = max(round(1.0 / float(np.median(np.diff(t)))), 1)
    if len(t) <= 2 * lag:
        return None
    # Second differences take the slow part, a constant pull, out of both.
    dv, di = (x[2 * lag :] - 2 * x[lag:-lag] + x[: -2 * lag] for x in (v, impulse))
    square = float(di @ di)
    per_mass = max(float(di @ dv) / square, 0.0) if square > 0.0 else 0.0
    return per_mass * impulse


def is_covered(smooth: SmoothedSignal, from_s: Array, to_s: Array) -> NDArray[np.bool_]:
    """Whether a signal is there without a gap from one time to another, for each pair."""
    if not len(smooth.t_s):
        return np.zeros(len(from_s), dtype=np.bool_)
    inside = (from_s >= smooth.t_s[0]) & (to_s <= smooth.t_s[-1])
    if len(smooth.breaks):
        # A break between the two ends: its begin lies before the end, its end after the begin.
        first = np.searchsorted(smooth.breaks[:, 1], from_s, side="right")
        last = np.searchsorted(smooth.breaks[:, 0], to_s, side="left")
        inside &= first >= last
    return np.asarray(inside)
