"""Traces of a bus to a course; what could not be used is counted."""

from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DELAY_MAX, Course
from adhesion_can.diagnosis.drive.kinematics import Signals, Source
from adhesion_can.diagnosis.drive.smoothing import (
    EFFORT_WINDOWS_S,
    SPEED_WINDOWS_S,
    WHEEL_WINDOWS_S,
    Smooth,
    covers,
    pulled,
    rough,
    smoothed,
)
from adhesion_can.physics.kinematics import slip_ratio
from adhesion_can.physics.readings import Direction, Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.equations import COVARIATES
from adhesion_can.sampling.traces import Trace

HELD = frozenset({Role.SANDING, Role.RAIN})
"""Channels that step; the others are straight lines between their readings."""
LEAST_LOAD = 0.1
"""Share of the static load below which a load is no load."""
MOST_MISSING = 0.05
"""A channel that is missing in a larger share of the rows is not used."""


def course_of(
    name: str,
    traces: Mapping[tuple[Role, int], Trace],
    vehicle: Locomotive,
    v_min: float,
    slip_max: float,
) -> Course:
    """Course of a recording.

    Args:
        name: of the recording.
        traces: what was heard, by role and axle.
        vehicle: configured.
        v_min: no slip below this speed, m/s.
        slip_max: no use of larger slips.

    """
    speed_trace = traces.get((Role.VEHICLE_SPEED, 0))
    starts = [trace.t_us[0] for trace in traces.values() if len(trace.t_us)]
    origin = int(min(starts, default=0))
    lost: Counter[str] = Counter()
    wheels, efforts, raw = {}, {}, {}
    for axle in range(1, vehicle.axles + 1):
        wheel = traces.get((Role.WHEEL_SPEED, axle))
        effort = traces.get((Role.TRACTIVE_EFFORT, axle))
        smooth = None if wheel is None else smoothed(wheel, origin, WHEEL_WINDOWS_S)
        pull = None if effort is None else smoothed(effort, origin, EFFORT_WINDOWS_S)
        if smooth is None or effort is None or pull is None:
            lost[f"axle {axle} without wheel speed or effort"] += 1
            continue
        good = np.isfinite(effort.value)
        wheels[axle], efforts[axle] = smooth, pull
        raw[axle] = ((effort.t_us[good] - origin) / 1e6, effort.value[good])
    speed = None
    if speed_trace is not None:
        part = pulled(speed_trace, origin, list(efforts.values()))
        speed = smoothed(speed_trace, origin, SPEED_WINDOWS_S, part)
    if speed is None:
        return _empty(name, vehicle, {"no vehicle speed": 1})
    loads = {}
    for axle in wheels:
        load = traces.get((Role.AXLE_LOAD, axle))
        if load is not None and np.isfinite(load.value).mean() > 0.5:
            good = np.isfinite(load.value)
            loads[axle] = ((load.t_us[good] - origin) / 1e6, load.value[good])
    if not wheels:
        return _empty(name, vehicle, dict(lost))
    fast = {axle: rough(traces[Role.WHEEL_SPEED, axle], origin) for axle in wheels}
    travel = _travel(traces.get((Role.DIRECTION, 0)), origin)
    signals = Signals(wheels, speed, loads, efforts, vehicle, fast, travel)
    parts = []
    for axle, (t, effort_values) in raw.items():
        keep = _usable(t, signals, axle, v_min, slip_max, lost)
        parts.append((t[keep], np.full(int(keep.sum()), axle), effort_values[keep]))
    t_s = np.concatenate([part[0] for part in parts])
    axles = np.concatenate([part[1] for part in parts])
    covariates = _covariates(traces, t_s, origin, lost)
    direction = signals.direction(t_s)
    place = np.where(direction > 0, axles, vehicle.axles + 1.0 - axles)
    way = _travelled(speed)
    return Course(
        name=name,
        t_s=t_s,
        axle=axles,
        place=place,
        effort=np.concatenate([part[2] for part in parts]),
        covariates=covariates,
        radius=signals.radius,
        inertia=vehicle.wheelset_inertia,
        position=np.interp(t_s, speed.t_s, way) - behind(vehicle, axles, direction),
        source=Source(axles, t_s, signals),
        has_load=len(loads) == len(wheels),
        first_us=origin,
        lost=dict(lost),
    )


def behind(vehicle: Locomotive, axle: NDArray[np.int64], direction: Array) -> Array:
    """Distance behind the axle that leads, m, shape (n,); zeros where the geometry is not known.

    Args:
        vehicle: with its geometry.
        axle: of each row, 1.., shape (n,).
        direction: of travel, 1 or −1, shape (n,).

    """
    if vehicle.geometry is None:
        return np.zeros(len(axle))
    places = vehicle.geometry.axle_places
    own = places[axle - 1]
    return np.where(direction > 0, own, places[-1] - own)


def _travelled(speed: Smooth) -> Array:
    """Way at the stamps of a speed, m."""
    mean = (speed.value[1:] + speed.value[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(np.diff(speed.t_s) * mean)])


def _usable(
    t: Array, signals: Signals, axle: int, v_min: float, slip_max: float, lost: Counter[str]
) -> NDArray[np.bool_]:
    """Rows whose kinematics are known for every delay in question, and whose slip is in range."""
    wheel, speed = signals.wheels[axle], signals.speed
    early = DELAY_MAX["effort"]
    there = covers(wheel, t - early, t) & covers(speed, t - early, t + DELAY_MAX["speed"])
    v = np.interp(t, speed.t_s, speed.value)
    # A delay reads the speed at other moments, at none of which there may be no slip ratio.
    around = np.arange(-early, DELAY_MAX["speed"] + 0.01, 0.25)
    slowest = np.min([np.interp(t + step, speed.t_s, speed.value) for step in around], axis=0)
    fast = slowest >= v_min
    slip = slip_ratio(np.interp(t, wheel.t_s, wheel.value), v, signals.radius[axle - 1], v_min)
    inside = np.abs(slip) <= slip_max
    loaded = signals.load(axle, t) >= LEAST_LOAD * signals.vehicle.axle_load[axle - 1]
    lost["axle load implausibly low"] += int((there & fast & inside & ~loaded).sum())
    lost["at a gap or an end of the signals"] += int((~there).sum())
    lost["below v_min"] += int((there & ~fast).sum())
    lost["slip out of range"] += int((there & fast & ~inside).sum())
    return np.asarray(there & fast & inside & loaded)


def _covariates(
    traces: Mapping[tuple[Role, int], Trace], t_s: Array, origin: int, lost: Counter[str]
) -> dict[str, Array]:
    found = {}
    for role, name in COVARIATES.items():
        trace = traces.get((role, 0))
        if trace is None:
            continue
        good = np.isfinite(trace.value)
        stamps, values = (trace.t_us[good] - origin) / 1e6, trace.value[good]
        if good.mean() < 1.0 - MOST_MISSING or len(stamps) < 2:
            lost[f"channel {name}"] += int((~good).sum())
        elif role in HELD:
            found[name] = values[np.maximum(np.searchsorted(stamps, t_s, side="right") - 1, 0)]
        else:
            found[name] = np.interp(t_s, stamps, values)
    return found


def _travel(direction: Trace | None, origin: int) -> tuple[Array, Array] | None:
    """Direction of travel: stamps, s, and 1 or −1; what is not known stays as it was."""
    if direction is None:
        return None
    told = np.isin(direction.value, (Direction.FORWARD, Direction.REVERSE))
    sign = np.where(direction.value[told] == Direction.REVERSE, -1.0, 1.0)
    return (direction.t_us[told] - origin) / 1e6, sign


def _empty(name: str, vehicle: Locomotive, lost: Mapping[str, int]) -> Course:
    none = np.empty(0)
    nothing = Smooth(none, none, none, 0.0, np.empty((0, 2)))
    signals = Signals({}, nothing, {}, {}, vehicle)
    axles = np.empty(0, dtype=np.int64)
    return Course(
        name, none, axles, none, none, {}, signals.radius, vehicle.wheelset_inertia, none,
        Source(axles, none, signals), lost=lost,
    )  # fmt: skip
