"""Detection of coasting axles, and the rolling speeds while they coast."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import RAIL
from adhesion_can.physics.kinematics import wheelset_effort
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.traces import Trace

SOFTEST_CONTACT = min(s.c1 * s.c2 - s.c3 for s in RAIL)
"""Least slope dμ/dλ at zero slip of the surfaces `RAIL`.

An adhesion μ that counts as coasting leaves a slip ratio of at most μ/slope.
"""

GAP_CYCLES, WINDOW_CYCLES = 3.0, 2.0
"""Least gap and least window in cycles of the slowest signal: two lost readings are bridged, and a
window holds a reading on either side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSettings:
    """Definition of coasting, and limits from which a quantity is estimated.

    Attributes:
        adhesion_max: Largest |F/N| of a coasting axle, without the wheelset's inertia, 1. Larger:
            more data, and more creep left in the radii.
        settle_s: Time for which an axle must have coasted before its speed is used, s.
        acceleration_max: Largest acceleration of the vehicle, m/s². Smaller: brakes without a
            signal are left out more surely, with less data.
        speed_min: Least vehicle speed that is used, m/s.
        window_s: Window of the averages of effort and acceleration, s; at least `WINDOW_CYCLES`
            cycles of the slowest signal. Larger: less noise in them, slower detection of coasting.
        gap_s: Largest distance of two readings between which values are interpolated, s; at least
            `GAP_CYCLES` cycles of the slowest signal.
        block_s: Length of the jackknife's blocks, s. It must exceed about five times the
            correlation time of the speed's errors; longer blocks are fewer.
        blocks_min: Least number of blocks with coasting for a radius.
        coasting_min_s: Least total duration of coasting for a radius, s.
        offset_std_max: Largest standard error of an offset that is estimated, m/s; 0.01 m/s are
            0.1 % of a radius at 10 m/s.
        delay_std_max: Largest standard error of a delay that is estimated, s.
        delay_s: Known delay of the vehicle speed, s; None: it is estimated.
        huber: Tuning constant k of Huber's loss, in standard deviations; 1.345 costs 5 % of
            efficiency under normal errors. Smaller: less influence of outliers.

    """

    adhesion_max: float = 0.005
    settle_s: float = 0.5
    acceleration_max: float = 0.4
    speed_min: float = 3.0
    window_s: float = 0.5
    gap_s: float = 0.2
    block_s: float = 10.0
    blocks_min: int = 4
    coasting_min_s: float = 5.0
    offset_std_max: float = 0.01
    delay_std_max: float = 0.05
    delay_s: float | None = None
    huber: float = 1.345


@dataclass(frozen=True, slots=True)
class CoastingDrive:
    """Signals of one recording; an axle without a signal is not among the keys.

    Attributes:
        speed: Vehicle speed, m/s.
        wheel_speed: Wheel speed ω by axle, rad/s.
        effort: Tractive effort F at the rim by axle, N.

    """

    speed: Trace
    wheel_speed: Mapping[int, Trace]
    effort: Mapping[int, Trace]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoastingTimes:
    """Time that is left of a recording by each condition of coasting, and by those before it.

    Attributes:
        recorded: Duration without gaps of the vehicle speed, s.
        read: Time with a reading of the wheel speed beside it, s, shape (m,).
        fast: Time above the least vehicle speed, s, shape (m,).
        steady: Time within the largest acceleration, s, shape (m,).
        idle: Time within the largest adhesion, s, shape (m,).
        settled: Time after settling, s, shape (m,).

    """

    recorded: float
    read: Array
    fast: Array
    steady: Array
    idle: Array
    settled: Array

    @classmethod
    def total(cls, parts: "Sequence[CoastingTimes]") -> "CoastingTimes":
        """Times of all drives together."""
        names = ("read", "fast", "steady", "idle", "settled")
        sums = {name: np.sum([getattr(p, name) for p in parts], axis=0) for name in names}
        return cls(recorded=sum(p.recorded for p in parts), **sums)


@dataclass(frozen=True, slots=True, kw_only=True)
class CoastingRows:
    """Signals of n stamps of the vehicle speed and m axles, with the coasting among them.

    Attributes:
        speed: Vehicle speed v, m/s, shape (n,).
        rolling: Wheel speed ω, rad/s, shape (n, m).
        acceleration: Acceleration a of the vehicle, m/s², shape (n,).
        used: Whether the axle coasts and its value is used, shape (n, m).
        span: Time to the next row, s, 0 over a gap, shape (n,).
        block: Number of the row's block, ascending, shape (n,).
        times: Time that each condition leaves.

    """

    speed: Array
    rolling: Array
    acceleration: Array
    used: NDArray[np.bool_]
    span: Array
    block: NDArray[np.int64]
    times: CoastingTimes


def slowest_cycle_s(drive: CoastingDrive) -> float:
    """Median distance of the readings of the slowest signal, s; 0 without two readings of any."""
    traces = (drive.speed, *drive.wheel_speed.values(), *drive.effort.values())
    return max(
        (float(np.median(np.diff(t.t_us))) / 1e6 for t in traces if len(t.t_us) > 1), default=0.0
    )


def find_coasting(
    drive: CoastingDrive, axles: Sequence[int], vehicle: Locomotive, settings: CalibrationSettings
) -> CoastingRows:
    """Signals of one drive at the stamps of its vehicle speed, with the coasting of each axle."""
    t, v = drive.speed.t_us, drive.speed.value
    cycle_s = slowest_cycle_s(drive)
    gap_us = max(settings.gap_s, GAP_CYCLES * cycle_s) * 1e6
    window_us = max(settings.window_s, WINDOW_CYCLES * cycle_s) * 1e6
    wheels = [drive.wheel_speed[axle] for axle in axles]
    rolling = np.column_stack([wheel.at(t, gap_us) for wheel in wheels])
    spin = np.column_stack([wheel.slope(t, window_us, gap_us) for wheel in wheels])
    radius = np.array([vehicle.wheel_radius[axle - 1] for axle in axles])
    acceleration = _row_median(spin * radius)
    fast, steady = v >= settings.speed_min, np.abs(acceleration) <= settings.acceleration_max
    idle: dict[int, NDArray[np.bool_]] = {}
    for i, axle in enumerate(axles):
        if axle in drive.effort:
            effort = drive.effort[axle].mean(t, window_us, gap_us)
            contact = effort - wheelset_effort(spin[:, i], vehicle.wheelset_inertia, radius[i])
            idle[axle] = np.abs(contact) <= settings.adhesion_max * vehicle.axle_load[axle - 1]
    # An axle without an effort signal counts as coasting where all the others do.
    others = np.ones(len(t), dtype=np.bool_)
    for coasting in idle.values():
        others = others & coasting
    coasts = np.column_stack([idle.get(axle, others) for axle in axles])
    conditions = [np.isfinite(rolling), fast[:, None], steady[:, None], coasts]
    left = list(accumulate(conditions, np.logical_and))
    used = np.column_stack([_settled(column, t, gap_us, settings) for column in left[-1].T])
    steps = np.diff(t, append=t[-1:]) / 1e6
    span = np.where(steps * 1e6 > gap_us, 0.0, steps)
    read_s, fast_s, steady_s, idle_s, settled_s = (span @ rows for rows in (*left, used))
    return CoastingRows(
        speed=v,
        rolling=rolling,
        acceleration=acceleration,
        used=used,
        span=span,
        block=t // round(settings.block_s * 1e6),
        times=CoastingTimes(
            recorded=float(span.sum()),
            read=read_s,
            fast=fast_s,
            steady=steady_s,
            idle=idle_s,
            settled=settled_s,
        ),
    )


def _row_median(values: Array) -> Array:
    """Median of the finite values in each row, shape (n,); NaN without any."""
    result = np.full(len(values), np.nan)
    some = np.isfinite(values).any(axis=1)
    result[some] = np.nanmedian(values[some], axis=1)
    return result


def _settled(
    good: NDArray[np.bool_],
    t_us: NDArray[np.int64],
    gap_us: float,
    settings: CalibrationSettings,
) -> NDArray[np.bool_]:
    """Whether a stamp and all before it within the settling time are good, shape (n,)."""
    if not len(t_us):
        return good
    breaks = ~good | (np.diff(t_us, prepend=t_us[0]) > gap_us)
    breaks[0] = True
    last_break = t_us[np.maximum.accumulate(np.where(breaks, np.arange(len(t_us)), 0))]
    return np.asarray(good & (t_us - last_break >= settings.settle_s * 1e6))


def join_coasting(parts: Sequence[CoastingRows]) -> CoastingRows:
    """Rows of all drives in which any axle coasts, with consecutive numbers of the blocks."""
    rows = [part.used.any(axis=1) for part in parts]
    blocks, base = [], 0
    for part, coasting in zip(parts, rows, strict=True):
        block = np.unique(part.block[coasting], return_inverse=True)[1] + base
        base += int(np.ptp(block)) + 1 if len(block) else 0
        blocks.append(block)

    def column(name: str) -> NDArray[Any]:
        pairs = zip(parts, rows, strict=True)
        return np.concatenate([getattr(part, name)[coasting] for part, coasting in pairs])

    return CoastingRows(
        **{name: column(name) for name in ("speed", "rolling", "acceleration", "used", "span")},
        block=np.concatenate(blocks),
        times=CoastingTimes.total([part.times for part in parts]),
    )
