"""Where axles coast: what counts as coasting, and the rolling speeds that belong to it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import RAIL
from adhesion_can.physics.kinematics import wheelset_effort
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.traces import Trace

SOFTEST_CONTACT = min(s.c1 * s.c2 - s.c3 for s in RAIL)
"""Slope dμ/dλ at zero slip of the softest of our rail surfaces: an adhesion μ that is taken for
coasting leaves a creep of μ/slope at most."""


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """What counts as coasting, and when a quantity counts as told.

    Attributes:
        adhesion_max: |F/N| of a coasting axle, the wheelset's inertia taken off, at most.
        settle_s: an axle coasts so long before its speed is used.
        acceleration_max: of the vehicle, m/s²; brakes that no signal tells are left out by it.
        speed_min: no use of slower stretches, m/s.
        window_s: over which effort and acceleration are averaged, which are too noisy singly.
        gap_s: readings further apart bracket nothing.
        block_s: length of the blocks that standard errors come from.
        blocks_min: a radius needs coasting in so many blocks.
        coasting_min_s: and so much of it in all.
        offset_std_max: an offset whose standard error would be larger is not estimated, m/s:
            0.01 m/s are 0.1 % of a radius at 10 m/s.
        delay_std_max: likewise a delay, s.
        delay_s: known delay of the vehicle speed; None: to be estimated.
        huber: k, in standard deviations; 1.345 costs 5 % of efficiency under normal errors.

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
    """One recording's signals; a role without a signal is not among the keys.

    Attributes:
        speed: of the vehicle, m/s.
        wheel_speed: ω by axle, rad/s.
        effort: F at the rim by axle, N.

    """

    speed: Trace
    wheel_speed: Mapping[int, Trace]
    effort: Mapping[int, Trace]


@dataclass(frozen=True, slots=True)
class CoastingRows:
    """Coasting on the stamps of the vehicle speed, n of them, m axles.

    Attributes:
        speed: v, shape (n,), m/s.
        rolling: ω, shape (n, m), rad/s.
        acceleration: a, shape (n,), m/s².
        used: shape (n, m).
        span: time that a row stands for, shape (n,), s.
        block: number of its block, ascending, shape (n,).

    """

    speed: Array
    rolling: Array
    acceleration: Array
    used: NDArray[np.bool_]
    span: Array
    block: NDArray[np.int64]


def coasting_rows(
    drive: CoastingDrive, axles: Sequence[int], vehicle: Locomotive, settings: CalibrationSettings
) -> CoastingRows:
    """Signals of one drive on the stamps of its vehicle speed, and which axle coasts when."""
    t, v = drive.speed.t_us, drive.speed.value
    gap_us, window_us = settings.gap_s * 1e6, settings.window_s * 1e6
    wheels = [drive.wheel_speed[axle] for axle in axles]
    rolling = np.column_stack([wheel.at(t, gap_us) for wheel in wheels])
    spin = np.column_stack([wheel.slope(t, window_us, gap_us) for wheel in wheels])
    radius = np.array([vehicle.wheel_radius[axle - 1] for axle in axles])
    acceleration = _row_median(spin * radius)
    moving = (v >= settings.speed_min) & (np.abs(acceleration) <= settings.acceleration_max)
    idle: dict[int, NDArray[np.bool_]] = {}
    for i, axle in enumerate(axles):
        if axle in drive.effort:
            effort = drive.effort[axle].mean(t, window_us, gap_us)
            contact = effort - wheelset_effort(spin[:, i], vehicle.wheelset_inertia, radius[i])
            idle[axle] = np.abs(contact) <= settings.adhesion_max * vehicle.axle_load[axle - 1]
    # An axle without effort of its own is taken to coast where all the others do.
    others = np.ones(len(t), dtype=np.bool_)
    for coasting in idle.values():
        others = others & coasting
    coasts = np.column_stack([idle.get(axle, others) for axle in axles])
    good = np.isfinite(rolling) & (coasts & moving[:, None])
    steps = np.diff(t, append=t[-1:]) / 1e6
    return CoastingRows(
        v,
        rolling,
        acceleration,
        np.column_stack([_settled(column, t, settings) for column in good.T]),
        np.where(steps > settings.gap_s, 0.0, steps),
        t // round(settings.block_s * 1e6),
    )


def _row_median(values: Array) -> Array:
    """Median of what is finite in each row, NaN where nothing is."""
    result = np.full(len(values), np.nan)
    some = np.isfinite(values).any(axis=1)
    result[some] = np.nanmedian(values[some], axis=1)
    return result


def _settled(
    good: NDArray[np.bool_], t_us: NDArray[np.int64], settings: CalibrationSettings
) -> NDArray[np.bool_]:
    """Those good stamps before which all was good, without a gap, for the settling time."""
    if not len(t_us):
        return good
    breaks = ~good | (np.diff(t_us, prepend=t_us[0]) > settings.gap_s * 1e6)
    breaks[0] = True
    last_break = t_us[np.maximum.accumulate(np.where(breaks, np.arange(len(t_us)), 0))]
    return np.asarray(good & (t_us - last_break >= settings.settle_s * 1e6))


def joined(parts: Sequence[CoastingRows]) -> CoastingRows:
    """Rows of all drives in which any axle coasts; blocks numbered through."""
    kept, base = [], 0
    for part in parts:
        rows = part.used.any(axis=1)
        block = np.unique(part.block[rows], return_inverse=True)[1] + base
        base += int(np.ptp(block)) + 1 if len(block) else 0
        kept.append(
            (
                part.speed[rows],
                part.rolling[rows],
                part.acceleration[rows],
                part.used[rows],
                part.span[rows],
                block,
            )
        )
    return CoastingRows(*(np.concatenate(columns) for columns in zip(*kept, strict=True)))
