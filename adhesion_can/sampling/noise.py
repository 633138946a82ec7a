"""Noise of the sensors, estimated from the readings of a recording.

The differences of a signal show: noise that changes from one reading to the next, and
errors that last, as far as their differences grow no further while the motion still does not show.
A constant error shows nowhere in them. Where the motion is as fast as the readings, where a signal
stands still or repeats itself, nothing is known, and the reason is given.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.readings import Role
from adhesion_can.sampling.differences import (
    BlockVariance,
    block_means,
    differences,
    freedom_share,
    low_quantile,
)
from adhesion_can.sampling.traces import Trace

ORDERS = (2, 3, 4, 5, 6)
"""Orders of differences; the first one that a higher one does not reduce is used."""
REDUCED = 1.1
"""Ratio of the variances of one order and the next up to which the motion is removed."""
LAG_ORDER = 3
"""Order of the differences over several readings."""
STRIDES = (1, 2, 4, 8, 16, 32, 64)
"""Readings from one point of a difference to the next."""
SPAN, SPANS = 4096, 8
"""Number of readings that are taken in one piece, and of pieces spread over the recording."""
BLOCK = 48
"""Number of differences in a block, for a stride of one."""
LEAST_READINGS = 60
"""Number of readings below which nothing is estimated."""
TOO_FEW = "too few readings"
LEAST_BLOCK = 30
"""Number of differences in the shortest block, for a stride of one."""
LEAST_STRIDES = 3
"""Number of strides without motion below which it is not known how long errors last."""
FASTEST = 2.5
"""Growth of a variance with a doubled stride beyond which it is motion."""
SETTLED = 1.3
"""Ratio of two variances up to which they count as the same."""
LEAST_STEP_SHARE = 1.5
"""Variance over that of the rounding, from which there is noise beside it."""
REPEATED = 0.6
"""Share of repeated values from which a signal is not measured again for each reading."""


@dataclass(frozen=True, slots=True)
class NoiseEstimate:
    """Noise of one sensor.

    Attributes:
        std: Standard deviation of the measurement without the rounding of its signal, SI; None
            where it is not known.
        std_error: Standard error of `std`, SI; 0 where that is not known.
        lasts_s: Time for which errors last, s; 0 where those of neighbouring readings are
            independent; None where the motion hides it.
        seen_s: Longest time over which errors would have shown, s.
        reason: Reason why `std` is not known, or why it is a bound; '' where there is none.

    """

    std: float | None = None
    std_error: float = 0.0
    lasts_s: float | None = None
    seen_s: float = 0.0
    reason: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Values as JSON has them."""
        return {
            "std": self.std,
            "std_error": None if self.std is None else self.std_error,
            "lasts_s": self.lasts_s,
            "seen_s": self.seen_s,
            "reason": self.reason or None,
        }


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Noise of all sensors of a recording.

    Attributes:
        wheel_speed: Noise of the wheel speeds, rad/s, of all axles together.
        vehicle_speed: Noise of the vehicle speed, m/s.
        effort: Noise of the efforts, N, of all axles together.
        wheel_speed_by_axle: Noise of each wheel speed, rad/s, by axle number.
        effort_by_axle: Noise of each effort, N, by axle number.

    """

    wheel_speed: NoiseEstimate
    vehicle_speed: NoiseEstimate
    effort: NoiseEstimate
    wheel_speed_by_axle: Mapping[int, NoiseEstimate]
    effort_by_axle: Mapping[int, NoiseEstimate]


Signal = tuple[Role, int]


def estimate_noise(traces: Mapping[Signal, Trace], steps: Mapping[Role, float]) -> SensorNoise:
    """Noise of the sensors from the readings of a recording.

    Args:
        traces: Readings by role and axle, 0 for roles without one.
        steps: Step of one raw bit of each role, SI; 0 where there is none.

    """

    def by_axle(wanted: Role) -> dict[int, NoiseEstimate]:
        axles = sorted(axle for role, axle in traces if role is wanted)
        step = steps.get(wanted, 0.0)
        return {axle: estimate_signal(traces[wanted, axle], step) for axle in axles}

    by_wheel, by_effort = by_axle(Role.WHEEL_SPEED), by_axle(Role.TRACTIVE_EFFORT)
    return SensorNoise(
        wheel_speed=pool(list(by_wheel.values())),
        vehicle_speed=by_axle(Role.VEHICLE_SPEED).get(0, NoiseEstimate(reason=TOO_FEW)),
        effort=pool(list(by_effort.values())),
        wheel_speed_by_axle=by_wheel,
        effort_by_axle=by_effort,
    )


def pool(parts: Sequence[NoiseEstimate]) -> NoiseEstimate:
    """Noise of several sensors of one kind: the median of the variances that are known."""
    known = [part for part in parts if part.std is not None]
    if not known:
        return parts[0] if parts else NoiseEstimate(reason="no readings")
    std = sqrt(float(np.median([(part.std or 0.0) ** 2 for part in known])))
    lasting = [part.lasts_s for part in known if part.lasts_s is not None]
    return NoiseEstimate(
        std,
        sqrt(sum(part.std_error**2 for part in known)) / len(known),
        sorted(lasting)[(len(lasting) - 1) // 2] if len(lasting) > len(known) / 2 else None,
        min(part.seen_s for part in known),
        next((part.reason for part in known if part.reason), ""),
    )


def estimate_signal(trace: Trace, step: float = 0.0) -> NoiseEstimate:
    """Noise of one signal.

    Args:
        trace: Readings of the signal.
        step: Step of one raw bit, unit of the signal; 0 where there is none.

    """
    if int(np.isfinite(trace.value).sum()) < LEAST_READINGS:
        return NoiseEstimate(reason=TOO_FEW)
    cycle_s = float(np.median(np.diff(trace.t_us))) * 1e-6
    t_s, value = _spans(trace)
    by_order = {order: _variance(t_s, value, order, 1, cycle_s) for order in ORDERS}
    order = _settled_order(by_order)
    var = by_order[order or ORDERS[-1]].var
    rounding = step * step / 12.0
    reason = _unknown(value, var, rounding)
    if reason or order is None:
        return NoiseEstimate(reason=reason or "the signal moves too fast for its cycle")
    strides, by_stride = _lags(t_s, value, cycle_s)
    if not (len(by_stride) and by_stride[0] > 0.0):
        return NoiseEstimate(reason="the signal stands still for most of the recording")
    level, lasts_s, seen_s = _duration(strides, by_stride, cycle_s)
    total = var * max(level / float(by_stride[0]), 1.0)
    if total <= LEAST_STEP_SHARE * rounding:
        bound = sqrt(max(total - rounding, 0.0))
        reason = "the resolution of the signal hides it"
        return NoiseEstimate(bound, sqrt(rounding), lasts_s, seen_s, reason)
    std = sqrt(total - rounding)
    return NoiseEstimate(std, 0.5 * by_order[order].std_error * total / std, lasts_s, seen_s)


def _unknown(value: Array, var: float, rounding: float) -> str:
    """Reason why the differences of a signal say nothing about its noise; '' for none.

    Args:
        value: Values, NaN where not available, shape (pieces, n).
        var: Variance of the differences; NaN without any.
        rounding: Variance of the rounding of the signal.

    """
    if not np.isfinite(var):
        return "no part without gaps is long enough"
    moved = np.diff(value, axis=-1)
    repeats = float((moved == 0.0).sum()) / max(int(np.isfinite(moved).sum()), 1)
    if repeats == 1.0:
        return "the signal is constant"
    if repeats > REPEATED and var > LEAST_STEP_SHARE * rounding:
        return f"{100 * repeats:.0f} % of its readings repeat the previous one"
    return ""


def _spans(trace: Trace) -> tuple[Array, Array]:
    """Stamps, s, and values in pieces spread over the recording, shape (pieces, n) each."""
    count = len(trace.t_us)
    length = min(SPAN, count)
    starts = [int(i) for i in np.linspace(0, count - length, min(SPANS, count // length))]
    value = np.stack([trace.value[i : i + length] for i in starts])
    t_us = np.stack([trace.t_us[i : i + length] for i in starts])
    return (t_us - trace.t_us[0]) * 1e-6, value


def _variance(
    t_s: Array, value: Array, order: int, stride: int, cycle_s: float, size: int = BLOCK
) -> BlockVariance:
    d = differences(t_s, value, order, stride, cycle_s)
    size = min(size * stride, d.shape[-1])
    if size < BLOCK // 2:
        return low_quantile(np.empty(0), 1.0)
    return low_quantile(block_means(d * d, size), max(size * freedom_share(order), 1.0))


def _settled_order(by_order: Mapping[int, BlockVariance]) -> int | None:
    """First order whose variance a higher order does not reduce; None where none is."""
    for order in ORDERS[:-1]:
        chance = by_order[order + 1].std_error
        if by_order[order].var <= (REDUCED + chance) * by_order[order + 1].var:
            return order
    last = ORDERS[-1]
    return last if by_order[last - 1].var <= SETTLED * by_order[last].var else None


def _lags(t_s: Array, value: Array, cycle_s: float) -> tuple[Array, Array]:
    """Strides as far as the recording reaches, and the variances of their differences."""
    longest = t_s.shape[-1] - LAG_ORDER
    strides = [s for s in STRIDES if LEAST_BLOCK * s + LAG_ORDER * s <= longest]
    sizes = [min(BLOCK, (longest - LAG_ORDER * s) // s) for s in strides]
    variances = [
        _variance(t_s, value, LAG_ORDER, stride, cycle_s, size).var
        for stride, size in zip(strides, sizes, strict=True)
    ]
    end = next((i for i, var in enumerate(variances) if not np.isfinite(var)), len(variances))
    return np.array(strides[:end], dtype=np.float64), np.array(variances[:end])


def _without_motion(var: Array) -> int:
    """Number of the first strides that show errors alone.

    The variance of errors doubles with the stride at most, that of the motion grows up to 64-fold
    (order 3). So the first stride with more growth is motion, and the one before may hold some of
    it. Growth without an end is motion as well where the variance stood still before.
    """
    growth = var[1:] / var[:-1]
    fast = np.flatnonzero(growth > FASTEST)
    count = max(int(fast[0]), 1) if len(fast) else len(var)
    growing = growth[: count - 1] > SETTLED
    if not len(growing) or not growing[-1] or growing.all():
        return count
    still = int(np.argmin(growing))
    return still + int(np.argmax(growing[still:])) + 1


def _duration(strides: Array, var: Array, cycle_s: float) -> tuple[float, float | None, float]:
    """Variance of all errors, the time for which they last, and the longest time seen, s.

    The errors are white noise and an autoregressive process of first order, with the correlation
    e^(−t/τ), whose variances and τ fit the differences best.
    """
    count = _without_motion(var)
    strides, var = strides[:count], var[:count]
    first, seen_s = float(var[0]), float(strides[-1]) * cycle_s
    if count < LEAST_STRIDES:
        return first, None, seen_s
    if var.max() <= SETTLED**2 * first:
        return first, 0.0, seen_s
    best = (np.inf, first, 0.0)
    for lasts_s in np.geomspace(cycle_s, 4.0 * seen_s, 25).tolist():
        rho = np.exp(-strides * cycle_s / lasts_s)
        lasting = 1.0 - 1.5 * rho + 0.6 * rho**2 - 0.1 * rho**3
        cost, total = _fit_parts(lasting, var)
        best = min(best, (cost, total, lasts_s))
    _, total, lasts_s = best
    # A process that lasts longer than was seen has at least the variance that was reached.
    return (total, lasts_s, seen_s) if lasts_s <= seen_s else (float(var[-1]), seen_s, seen_s)


def _fit_parts(lasting: Array, var: Array) -> tuple[float, float]:
    """Relative least squares of variances by a white part and one that lasts, both at least 0.

    Args:
        lasting: Variances by stride of a process of variance 1 that lasts, shape (n,).
        var: Variances by stride, shape (n,).

    Returns:
        Sum of squares, and the sum of both variances.

    """
    inverse, other = 1.0 / var, lasting / var
    aa, ab, bb = float(inverse @ inverse), float(inverse @ other), float(other @ other)
    a, b = float(inverse.sum()), float(other.sum())
    det = max(aa * bb - ab * ab, 1e-30)
    white, lasting_var = (bb * a - ab * b) / det, (aa * b - ab * a) / det
    if white < 0.0:
        white, lasting_var = 0.0, b / bb
    elif lasting_var < 0.0:
        white, lasting_var = a / aa, 0.0
    rest = 1.0 - white * inverse - lasting_var * other
    return float(rest @ rest), white + lasting_var
