"""Build drive data from the traces of a recording; readings that cannot be used are counted."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DELAY_MAX, DriveData
from adhesion_can.diagnosis.drive.kinematics import SignalKinematics, SmoothedSignals
from adhesion_can.diagnosis.drive.measured_load import LEAST_LOAD_SHARE, MeasuredLoad
from adhesion_can.diagnosis.drive.smoothing import (
    EFFORT_WINDOWS_S,
    SPEED_WINDOWS_S,
    WHEEL_WINDOWS_S,
    SmoothedSignal,
    available_readings,
    high_pass,
    integrate,
    is_covered,
    predict_speed_from_efforts,
    smooth_signal,
)
from adhesion_can.physics.channels import CHANNEL_BY_NAME, COVARIATES, FEW_VALUES, UserChannel
from adhesion_can.physics.kinematics import slip_ratio
from adhesion_can.physics.readings import Direction, Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.noise import estimate_signal, pool
from adhesion_can.sampling.traces import Trace

LEAST_LOADS_AVAILABLE = 0.5
"""Share of an axle's load readings that must be available for the load to count as measured."""
MOST_MISSING = 0.05
"""Largest share of missing readings of a channel that is used."""
Traces = Mapping[tuple[Role, int], Trace]


class _AxleSignals(NamedTuple):
    """Signals by axle: smoothed wheel speeds and efforts, effort readings (stamps, s, and N)."""

    wheels: dict[int, SmoothedSignal]
    efforts: dict[int, SmoothedSignal]
    effort_readings: dict[int, tuple[Array, Array]]


def build_drive_data_from_traces(
    name: str,
    traces: Traces,
    vehicle: Locomotive,
    v_min: float,
    slip_max: float,
    channels: Sequence[UserChannel] = (),
) -> DriveData:
    """Build the drive data of a recording.

    Args:
        name: Name of the recording.
        traces: Received readings by role and axle.
        vehicle: Configured vehicle.
        v_min: Speed below which there is no slip ratio, m/s.
        slip_max: Largest slip ratio that is used.
        channels: Channels of the user, by their numbers from 1.

    """
    starts = [trace.t_us[0] for trace in traces.values() if len(trace.t_us)]
    origin = int(min(starts, default=0))
    lost: Counter[str] = Counter()
    axle_signals = _smooth_axles(traces, vehicle, origin, lost)
    speed = _smooth_speed(traces, axle_signals, origin)
    if speed is None:
        return _build_empty_drive(name, vehicle, {"no vehicle speed": 1})
    if not axle_signals.wheels:
        return _build_empty_drive(name, vehicle, dict(lost))
    signals = _collect_signals(traces, vehicle, axle_signals, speed, origin)
    parts = []
    for axle, (t, effort) in axle_signals.effort_readings.items():
        keep = _find_usable_rows(t, signals, axle, v_min, slip_max, lost)
        parts.append((t[keep], np.full(int(keep.sum()), axle), effort[keep]))
    t_s, axles, efforts = (np.concatenate(column) for column in zip(*parts, strict=True))
    direction = signals.compute_direction(t_s)
    position = np.interp(t_s, speed.t_s, integrate(speed))
    if vehicle.geometry is not None:
        # An axle is as far back as it stands behind the leading one.
        places = vehicle.geometry.axle_places
        axle_places = places[axles - 1]
        position = position - np.where(direction > 0, axle_places, places[-1] - axle_places)
    names = {(role, 0): name for role, name in COVARIATES.items()}
    names |= {(Role.CHANNEL, number): channel.name for number, channel in enumerate(channels, 1)}
    covariates = _interpolate_covariates(traces, names, t_s, origin, lost)
    return DriveData(
        name=name,
        t_s=t_s,
        axle=axles,
        place=np.where(direction > 0, axles, vehicle.axles + 1.0 - axles),
        effort=efforts,
        covariates=covariates,
        radius=signals.radius,
        inertia=vehicle.wheelset_inertia,
        position=position,
        kinematics=SignalKinematics(axles, t_s, signals),
        has_load=len(signals.loads) == len(signals.wheels),
        first_us=origin,
        lost=dict(lost),
        user_channels=tuple(channel for channel in channels if channel.name in covariates),
    )


def _smooth_axles(
    traces: Traces, vehicle: Locomotive, origin: int, lost: Counter[str]
) -> _AxleSignals:
    """Smooth wheel speed and effort of every axle that has both."""
    signals = _AxleSignals({}, {}, {})
    for axle in range(1, vehicle.axles + 1):
        wheel = traces.get((Role.WHEEL_SPEED, axle))
        effort = traces.get((Role.TRACTIVE_EFFORT, axle))
        wheel_speed = None if wheel is None else smooth_signal(wheel, origin, WHEEL_WINDOWS_S)
        smooth_effort = None if effort is None else smooth_signal(effort, origin, EFFORT_WINDOWS_S)
        if wheel_speed is None or effort is None or smooth_effort is None:
            lost[f"axle {axle} without wheel speed or effort"] += 1
            continue
        signals.wheels[axle], signals.efforts[axle] = wheel_speed, smooth_effort
        signals.effort_readings[axle] = available_readings(effort, origin)
    return signals


def _smooth_speed(traces: Traces, axles: _AxleSignals, origin: int) -> SmoothedSignal | None:
    """Smooth the vehicle speed; None where there is none."""
    trace = traces.get((Role.VEHICLE_SPEED, 0))
    if trace is None:
        return None
    predicted = predict_speed_from_efforts(trace, origin, list(axles.efforts.values()))
    return smooth_signal(trace, origin, SPEED_WINDOWS_S, predicted, has_memory=True)


def _collect_signals(
    traces: Traces, vehicle: Locomotive, axles: _AxleSignals, speed: SmoothedSignal, origin: int
) -> SmoothedSignals:
    """All smoothed signals of a recording, with the measured loads where there are enough."""
    loads = {}
    for axle in axles.wheels:
        load = traces.get((Role.AXLE_LOAD, axle))
        if load is not None and np.isfinite(load.value).mean() > LEAST_LOADS_AVAILABLE:
            stamps, values = available_readings(load, origin)
            least = LEAST_LOAD_SHARE * vehicle.axle_load[axle - 1]
            loads[axle] = MeasuredLoad(stamps, values, values >= least)
    fast = {axle: high_pass(traces[Role.WHEEL_SPEED, axle], origin) for axle in axles.wheels}
    direction = _direction_changes(traces.get((Role.DIRECTION, 0)), origin)
    noise = pool([estimate_signal(traces[Role.TRACTIVE_EFFORT, axle]) for axle in axles.wheels])
    return SmoothedSignals(
        axles.wheels, speed, loads, axles.efforts, vehicle, fast, direction, noise
    )


def _find_usable_rows(
    t: Array, signals: SmoothedSignals, axle: int, v_min: float, slip_max: float, lost: Counter[str]
) -> NDArray[np.bool_]:
    """Rows whose kinematics are known for every tested delay, and whose slip is in range."""
    wheel, speed = signals.wheels[axle], signals.speed
    effort, speed_s = DELAY_MAX["effort"], DELAY_MAX["speed"]
    known = is_covered(wheel, t - effort, t + effort)
    known &= is_covered(speed, t - effort, t + speed_s)
    v = np.interp(t, speed.t_s, speed.value)
    # A delay reads the speed at other times, and each of them needs a slip ratio.
    around = np.arange(-effort, speed_s + 0.01, 0.25)
    slowest = np.min([np.interp(t + step, speed.t_s, speed.value) for step in around], axis=0)
    fast = slowest >= v_min
    slip = slip_ratio(np.interp(t, wheel.t_s, wheel.value), v, signals.radius[axle - 1], v_min)
    inside = np.abs(slip) <= slip_max
    loaded = signals.is_load_known(axle, t)
    lost["axle load implausibly low"] += int((known & fast & inside & ~loaded).sum())
    lost["at a gap or an end of the signals"] += int((~known).sum())
    lost["below v_min"] += int((known & ~fast).sum())
    lost["slip out of range"] += int((known & fast & ~inside).sum())
    return np.asarray(known & fast & inside & loaded)


def _interpolate_covariates(
    traces: Traces,
    names: Mapping[tuple[Role, int], str],
    t_s: Array,
    origin: int,
    lost: Counter[str],
) -> dict[str, Array]:
    """Further channels at the rows by name; those with too many missing readings are counted.

    A channel of few values holds until the next reading, and is not interpolated.
    """
    covariates = {}
    for key, name in names.items():
        trace = traces.get(key)
        if trace is None:
            continue
        stamps, values = available_readings(trace, origin)
        available = np.isfinite(trace.value)
        if available.mean() < 1.0 - MOST_MISSING or len(stamps) < 2:
            lost[f"channel {name}"] += int((~available).sum())
        elif _holds(name, values):
            covariates[name] = values[np.maximum(np.searchsorted(stamps, t_s, side="right") - 1, 0)]
        else:
            covariates[name] = np.interp(t_s, stamps, values)
    return covariates


def _holds(name: str, values: Array) -> bool:
    """Whether a channel keeps its value until the next reading."""
    known = CHANNEL_BY_NAME.get(name)
    return len(np.unique(values)) <= FEW_VALUES if known is None else known.steps


def _direction_changes(direction: Trace | None, origin: int) -> tuple[Array, Array] | None:
    """Stamps, s, and direction of travel, 1 or −1; an unknown direction stays as it was."""
    if direction is None:
        return None
    known = np.isin(direction.value, (Direction.FORWARD, Direction.REVERSE))
    sign = np.where(direction.value[known] == Direction.REVERSE, -1.0, 1.0)
    return (direction.t_us[known] - origin) / 1e6, sign


def _build_empty_drive(name: str, vehicle: Locomotive, lost: Mapping[str, int]) -> DriveData:
    none = np.empty(0)
    nothing = SmoothedSignal(none, none, none, 0.0, np.empty((0, 2)))
    signals = SmoothedSignals({}, nothing, {}, {}, vehicle)
    axles = np.empty(0, dtype=np.int64)
    return DriveData(
        name, none, axles, none, none, {}, signals.radius, vehicle.wheelset_inertia, none,
        SignalKinematics(axles, none, signals), lost=lost,
    )  # fmt: skip
