"""Traces of a bus, or the rows of a TABLE, to a course; what could not be used is counted."""

from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from adhesion_can.criticism.course import (
    DELAY_MAX,
    EFFORT_WINDOWS_S,
    SPEED_WINDOWS_S,
    WHEEL_WINDOWS_S,
    Course,
    Signals,
    Smooth,
    Source,
    covers,
    pulled,
    rough,
    smoothed,
)
from adhesion_can.identification.samples import COVARIATES
from adhesion_can.identification.traces import Trace
from adhesion_can.physics.burckhardt import Array
from adhesion_can.physics.data import Direction, Role, Samples
from adhesion_can.physics.vehicle import Locomotive

HELD = frozenset({Role.SANDING, Role.RAIN})
"""Channels that step; the others are straight lines between their readings."""
MOST_MISSING = 0.05
"""A channel that is missing in a larger share of the rows is not used."""
PAUSE_S = 1.0
"""Rows of a TABLE further apart than this do not follow each other."""
BETWEEN_S = 10.0
"""Time put between stretches of a TABLE that do not follow each other."""


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
    signals = Signals(wheels, speed, loads, efforts, vehicle, fast)
    parts = []
    for axle, (t, effort_values) in raw.items():
        keep = _usable(t, signals, axle, v_min, slip_max, lost)
        parts.append((t[keep], np.full(int(keep.sum()), axle), effort_values[keep]))
    t_s = np.concatenate([part[0] for part in parts])
    axles = np.concatenate([part[1] for part in parts])
    covariates = _covariates(traces, t_s, origin, lost)
    place = _places(traces.get((Role.DIRECTION, 0)), t_s, origin, axles, vehicle.axles)
    way = np.concatenate(
        [[0.0], np.cumsum(np.diff(speed.t_s) * (speed.value[1:] + speed.value[:-1]) / 2)]
    )
    return Course(
        name=name,
        t_s=t_s,
        axle=axles,
        place=place,
        effort=np.concatenate([part[2] for part in parts]),
        covariates=covariates,
        radius=signals.radius,
        inertia=vehicle.wheelset_inertia,
        position=np.interp(t_s, speed.t_s, way) - behind(vehicle, place),
        source=Source(axles, t_s, signals),
        first_us=origin,
        lost=dict(lost),
    )


def behind(vehicle: Locomotive, place: Array) -> Array:
    """Distance behind the leading axle, m; zeros where the geometry is not known."""
    if vehicle.geometry is None or not len(place):
        return np.zeros(len(place))
    places = vehicle.geometry.axle_places
    # In reverse the last axle leads, and its distances count.
    return np.asarray(places[np.clip(place.astype(np.int64) - 1, 0, len(places) - 1)])


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
    fast = v >= v_min
    slip = signals.radius[axle - 1] * np.interp(t, wheel.t_s, wheel.value) / np.maximum(v, 1e-3) - 1
    inside = np.abs(slip) <= slip_max
    lost["at a gap or an end of the signals"] += int((~there).sum())
    lost["below v_min"] += int((there & ~fast).sum())
    lost["slip out of range"] += int((there & fast & ~inside).sum())
    return np.asarray(there & fast & inside)


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


def _places(
    direction: Trace | None, t_s: Array, origin: int, axle: NDArray[np.int64], axles: int
) -> Array:
    """Place of each row's axle, counted from the leading one in the direction of travel."""
    forward = axle.astype(np.float64)
    if direction is None or not len(direction.t_us):
        return forward
    at = np.searchsorted((direction.t_us - origin) / 1e6, t_s, side="right") - 1
    reverse = direction.value[np.maximum(at, 0)] == Direction.REVERSE
    return np.where(reverse, axles + 1 - forward, forward)


def _empty(name: str, vehicle: Locomotive, lost: Mapping[str, int]) -> Course:
    none = np.empty(0)
    nothing = Smooth(none, none, none, 0.0, np.empty((0, 2)))
    signals = Signals({}, nothing, {}, {}, vehicle)
    axles = np.empty(0, dtype=np.int64)
    return Course(
        name, none, axles, none, none, {}, signals.radius, vehicle.wheelset_inertia, none,
        Source(axles, none, signals), lost=lost,
    )  # fmt: skip


def course_of_table(
    name: str, samples: Samples, segment: NDArray[np.int64] | None, slip_max: float
) -> Course:
    """Course of a TABLE: slip and adhesion are taken as they stand there.

    A wheel of radius 1 m without inertia that has the slips of the table stands for the real one.

    Args:
        name: of the table.
        samples: its rows.
        segment: number of each row's segment, where the table has one.
        slip_max: no use of larger slips.

    """
    good = np.abs(samples.slip) <= slip_max
    good &= (samples.speed > 0) & (samples.load > 0)
    lost = {"slip, speed or load out of range": int((~good).sum())}
    rows = samples.select(good)
    parts = np.zeros(len(rows), dtype=np.int64) if segment is None else segment[good]
    number = np.unique(rows.axle, return_inverse=True)[1] + 1 if len(rows) else rows.axle
    first_us = int(rows.t_us.min()) if len(rows) else 0
    t_s = _unrolled((rows.t_us - first_us) / 1e6, parts, number)
    order = np.lexsort((t_s, number))
    rows, t_s, number = rows.select(order), t_s[order], number[order]
    axles = int(number.max(initial=1))
    vehicle = Locomotive((1.0,) * axles, (1.0,) * axles, 0.0, 1.0, geometry=None)
    nothing = np.empty((0, 2))
    zero = np.zeros(len(rows))

    def smooth(of: NDArray[np.bool_], values: Array) -> Smooth:
        return Smooth(t_s[of], values[of], zero[of], 0.0, nothing)

    every = {i: number == i for i in range(1, axles + 1)}
    turning = (1.0 + rows.slip) * rows.speed
    by_time = np.argsort(t_s, kind="stable")
    speed = Smooth(t_s[by_time], rows.speed[by_time], zero, 0.0, nothing)
    signals = Signals(
        {i: smooth(of, turning) for i, of in every.items()},
        speed,
        {i: (t_s[of], rows.load[of]) for i, of in every.items()},
        {},
        vehicle,
    )
    return Course(
        name=name,
        t_s=t_s,
        axle=number,
        place=number.astype(np.float64),
        effort=rows.adhesion * rows.load,
        covariates={n: c for n, c in rows.covariates.items() if np.isfinite(c).all()},
        radius=signals.radius,
        inertia=0.0,
        position=_way(t_s, rows.speed, number),
        source=Source(number, t_s, signals),
        lost=lost,
        table=True,
        first_us=first_us,
        clock_s=(rows.t_us - first_us) / 1e6,
        has_speed=bool(np.any(rows.speed != 1.0)),
        has_load=bool(np.any(rows.load != 1.0)),
    )


def _unrolled(t_s: Array, segment: NDArray[np.int64], axle: NDArray[np.int64]) -> Array:
    """Times that only run forwards: rows that do not follow each other are set well apart."""
    unrolled = np.empty(len(t_s))
    for number in np.unique(axle):
        rows = np.flatnonzero(axle == number)
        step = np.diff(t_s[rows], prepend=t_s[rows[:1]])
        new = np.diff(segment[rows], prepend=segment[rows[:1]]) != 0
        cut = new | (step < 0) | (step > PAUSE_S)
        unrolled[rows] = np.cumsum(np.where(cut, BETWEEN_S, step))
    return unrolled


def _way(t_s: Array, speed: Array, axle: NDArray[np.int64]) -> Array:
    step = np.diff(t_s, prepend=t_s[:1])
    follows = (step >= 0) & (step <= PAUSE_S) & (np.diff(axle, prepend=axle[:1]) == 0)
    return np.cumsum(np.where(follows, step * speed, 0.0))
