"""A look at slip and adhesion before anything is fitted: signs, units, stuck and repeated rows."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.config.vehicle_ranges import MOST_LOAD_N
from adhesion_can.offline.consistency import (
    inspect_acceleration,
    inspect_delay,
    inspect_derived_force,
)
from adhesion_can.offline.finding import Finding
from adhesion_can.offline.points import LEAST_ROWS, MeasuredPoints
from adhesion_can.offline.rim_speed import inspect_rim_speeds, known_ratio, slips_of_samples
from adhesion_can.offline.signs import inspect_missing_sign, inspect_signs
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import Locomotive

SLIP_LIMIT, ADHESION_LIMIT, LEAST_ADHESION = 1.5, 3.0, 0.003
"""Sizes of slip (95 % of the rows) and adhesion (99 %) beyond which, and size of the adhesion below
which, the numbers are of another unit, or of a racing tyre."""
RACING_ADHESION = 4.5
"""Adhesion that no racing tyre exceeds; 3.4 has been measured on one."""
MOST_LINEAR, LEAST_SLOPE, MOST_BEND = 0.3, 0.5, 1.6
"""Slip up to which a contact may be linear, least slope of one, and slope at small slips over that
at larger ones below which a curve is linear."""
CREEPING, SATURATED = (0.03, 0.2), 0.5
"""Slips, as ratios, at which a contact has most of its adhesion, and the share that shows it."""
LEAST_LOAD_N = 50.0
"""Median load below which no vehicle that is measured rests on a wheel."""
LEAST_USED = 0.02
"""Largest adhesion that a measured wheel uses at least."""
LOAD_UNITS = {"kg": 9.81, "kN": 1e3, "t": 9807.0}
"""Newtons in the units in which loads are written."""
FAST, TOO_FAST = 45.0, 140.0
"""Median speeds, m/s, that are more often km/h, and that no vehicle reaches."""
ROLLING_ADHESION, ROLLING_SPREAD = 0.01, 0.02
"""Adhesion below which a wheel rolls, and range of the slips of half of these rows beyond which
they say nothing."""
ROLLING_SLIP, ROLLING_LIMIT = 0.02, 0.07
"""Slip of a rolling wheel that is reported, and beyond which no radius is that worn."""
STANDING_RATIO = 0.01
"""Rim speed over vehicle speed below which a wheel stands still; a wrong unit makes 0.017."""
MOST_STANDING = 0.5
"""Share of the rows of an axle at rest from which it says nothing about adhesion."""
LEAST_REPEATED, LEAST_STUCK = 0.01, 50
"""Share of repeated stamps, and rows at one value, that are reported."""


def inspect_points(points: MeasuredPoints) -> list[Finding]:
    """What is odd about slip, adhesion, speed, load and stamps."""
    if len(points.slip) < LEAST_ROWS:
        return []
    prefix = f"{points.name}: " if points.name else ""
    standing = list(_standing(points))
    if standing:
        points = points.select(~stands_still(points.slip))
    return [
        finding._replace(what=prefix + finding.what)
        for finding in (*standing, *_inspect_moving(points))
    ]


def _inspect_moving(points: MeasuredPoints) -> list[Finding]:
    """What is odd about rows in which the wheel turns."""
    if len(points.slip) < LEAST_ROWS:
        return []
    findings = [
        *_slip_size(points),
        *_adhesion_size(points),
        *inspect_signs(points),
        *inspect_missing_sign(points),
        *_zero(points),
        *_load(points),
        *_speed(points),
        *_stamps(points),
        *_stuck(points),
    ]
    if not any(finding.fatal for finding in findings):
        findings += _motion(points)
    return findings


def inspect_samples(
    samples: Samples, *, table: bool, timed: bool = True, vehicle: Locomotive | None = None
) -> list[Finding]:
    """What is odd about samples: those of a table together, those of a recording axle by axle.

    Args:
        samples: Samples of one table or recording.
        table: Whether they are of a table; a speed or a load of 1 means a missing column.
        timed: Whether the rows have times.
        vehicle: Configured vehicle, where the samples are of a recording.

    """
    axles = np.unique(samples.axle)
    if not table:
        of_axles = [
            finding
            for k in axles
            for finding in inspect_points(_points_of(samples, int(k), vehicle))
        ]
        return [*inspect_rim_speeds(slips_of_samples(samples)), *of_axles]
    return inspect_points(
        MeasuredPoints(
            samples.slip,
            samples.adhesion,
            samples.t_us if timed and len(axles) == 1 else None,
            samples.speed if np.any(samples.speed != 1.0) else None,
            samples.load if np.any(samples.load != 1.0) else None,
        )
    )


def _points_of(samples: Samples, axle: int, vehicle: Locomotive | None) -> MeasuredPoints:
    """Rows of one axle of a recording."""
    rows = samples.select(samples.axle == axle)
    points = MeasuredPoints(
        rows.slip, rows.adhesion, rows.t_us, rows.speed, rows.load, table=False, name=f"axle {axle}"
    )
    if vehicle is None:
        return points
    inertial = inertial_adhesion(rows, vehicle)
    return replace(points, inertial=inertial, inertia=vehicle.wheelset_inertia)


def stands_still(slip: Array) -> NDArray[np.bool_]:
    """Rows in which the rim does not move though the vehicle does.

    Args:
        slip: Slip ratios, shape (n,).

    """
    return np.asarray(np.abs(1.0 + slip) < STANDING_RATIO)


def _standing(points: MeasuredPoints) -> Iterator[Finding]:
    """A wheel of a recording at rest while the vehicle moves, not only where a brake locks it."""
    at_rest = stands_still(points.slip)
    unbraked = at_rest & (points.adhesion > -ROLLING_ADHESION)
    if points.table or int(unbraked.sum()) < LEAST_ROWS:
        return
    instead = "cut the recording where the sensor fails"
    if at_rest.all():
        instead = "remove the roles of this axle"
    yield Finding(
        f"the wheel does not turn while the vehicle moves, in {int(at_rest.sum())} of "
        f"{len(at_rest)} samples",
        f"repair its speed sensor, or {instead}",
        fatal=float(at_rest.mean()) >= MOST_STANDING,
    )


def _slip_size(points: MeasuredPoints) -> Iterator[Finding]:
    size = float(np.quantile(np.abs(points.slip), 0.95))
    if size <= SLIP_LIMIT:
        if points.table and size > MOST_LINEAR:
            yield from _slip_slope(points, size)
        return
    if not points.table and known_ratio(points.slip) is not None:
        return  # told as a ratio of the speeds
    fix = "check the wheel radius and the units of wheel and vehicle speed"
    if points.table:
        fix = "give the slip as a ratio; for percent pass --column slip=slip,unit=percent"
    spins = points.table and _saturates(points)
    what = f"the slip reaches {size:.4g}"
    if spins:
        what, fix = f"{what}: the wheel spins", "remove these rows if you do not want them"
    yield Finding(what, fix, fatal=not spins)


def _saturates(points: MeasuredPoints) -> bool:
    """Whether the adhesion is large where the slip is that of a contact that creeps: ratios."""
    low, high = CREEPING
    absolute = np.abs(points.slip)
    creeping = (absolute > low) & (absolute < high)
    if int(creeping.sum()) < LEAST_ROWS:
        return False
    used = np.abs(points.adhesion)
    return float(np.median(used[creeping])) > SATURATED * float(np.quantile(used, 0.95))


def _slip_slope(points: MeasuredPoints, size: float) -> Iterator[Finding]:
    """Adhesion that rises in proportion to large slips, as no contact has it."""
    absolute = np.abs(points.slip)
    low, high = (_slope(points, rows) for rows in (absolute <= size / 3, absolute > size / 3))
    if min(low, high) > 0.0 and low <= min(LEAST_SLOPE, MOST_BEND * high):
        what = (
            f"the adhesion rises in proportion to the slip up to {size:.3g}, with a slope of "
            f"{low:.2g}"
        )
        percent = "if the slip is in percent, pass --column slip=slip,unit=percent"
        yield Finding(what, f"{percent}; a drifting car also reaches such slips")


def _slope(points: MeasuredPoints, rows: NDArray[np.bool_]) -> float:
    """Adhesion over slip by least squares through the origin."""
    square = float(points.slip[rows] @ points.slip[rows])
    return float(points.slip[rows] @ points.adhesion[rows]) / square if square > 0 else 0.0


def _adhesion_size(points: MeasuredPoints) -> Iterator[Finding]:
    size = float(np.quantile(np.abs(points.adhesion), 0.99))
    by_force = points.load is not None
    if size > ADHESION_LIMIT:
        fix = "check the axle load and the unit of the tractive effort"
        if points.table and points.load is not None:
            fix = _load_units(size, float(np.median(points.load))) or fix
        elif points.table:
            fix = "if it is in percent, pass --column adhesion=adhesion,unit=percent"
        what = f"the adhesion reaches {size:.4g}"
        if is_inertial(points):
            what += (
                f", most of it wheelset_inertia_kgm2 = {points.inertia:g} times the angular "
                "acceleration"
            )
            fix = "correct the inertia in [vehicle], kg m^2"
        elif size <= RACING_ADHESION:
            what += ", which only a racing tyre reaches"
        yield Finding(what, fix)
    elif by_force and 0.0 < size < LEAST_ADHESION:
        fix = "check the axle load and the unit of the tractive effort"
        if points.table and LEAST_USED < 1e3 * size < ADHESION_LIMIT:
            name = "longitudinal_force_N"
            fix = f"if the force is in kN, pass --column {name}={name},unit=kN"
        yield Finding(f"the adhesion stays below {size:.2g}", fix)


def _load_units(size: float, load: float) -> str:
    """What to say of a table's load, by the units that make its numbers those of a wheel; or ''.

    Args:
        size: Adhesion that is reached with the load in N.
        load: Middle of the load's numbers.

    """
    units = [
        unit
        for unit, newtons in LOAD_UNITS.items()
        if LEAST_USED < size / newtons < ADHESION_LIMIT
        and LEAST_LOAD_N < load * newtons < MOST_LOAD_N
    ]
    if not units:
        return ""
    name = "normal_load_N"
    others = "".join(f"; if it is in {other}, unit={other}" for other in units[1:])
    return f"if the load is in {units[0]}, pass --column {name}={name},unit={units[0]}{others}"


def _zero(points: MeasuredPoints) -> Iterator[Finding]:
    """Slip of a recording where there is no adhesion: there the rim runs as fast as the vehicle."""
    rolling = np.abs(points.adhesion) < ROLLING_ADHESION
    if points.table or int(rolling.sum()) < LEAST_ROWS or known_ratio(points.slip) is not None:
        return
    low, middle, high = np.quantile(points.slip[rolling], (0.25, 0.5, 0.75))
    if abs(middle) < ROLLING_SLIP or high - low > ROLLING_SPREAD:
        return
    ratio = 1.0 + float(middle)
    yield Finding(
        f"while coasting, the rim speed is {ratio:.4g} times the vehicle speed",
        f"check the wheel radius ({1.0 / ratio:.4g} times the configured one would fit) and the "
        "scales of wheel and vehicle speed; `calibrate` finds them from coasting",
        fatal=abs(middle) > ROLLING_LIMIT,
    )


def _load(points: MeasuredPoints) -> Iterator[Finding]:
    if points.load is None:
        return
    middle = float(np.median(points.load))
    if float(np.quantile(np.abs(points.adhesion), 0.99)) > ADHESION_LIMIT:
        return  # told already
    if 0.0 < middle < LEAST_LOAD_N:
        fix = "check the axle load of the vehicle"
        if points.table:
            fix = "if force and load are in kN, say unit=kN for both"
        yield Finding(f"the load is about {middle:.3g} N", fix, fatal=False)


def _speed(points: MeasuredPoints) -> Iterator[Finding]:
    if points.speed is None:
        return
    middle = float(np.median(points.speed))
    if middle > FAST:
        fix = "check the unit of the vehicle speed"
        if points.table:
            fix = "if the column is in km/h, pass --column speed_mps=speed_mps,unit=km/h"
        what = f"the speed is about {middle:.0f} m/s, {3.6 * middle:.0f} km/h"
        yield Finding(what, fix, fatal=middle > TOO_FAST)


def _motion(points: MeasuredPoints) -> Iterator[Finding]:
    if points.t_us is None or not points.table or np.any(np.diff(points.t_us) < 0):
        return
    derived: list[Finding] = []
    if points.speed is not None:
        derived = list(inspect_derived_force(points.t_us, points.speed, points.adhesion))
    # A force that comes from the speed shows no delay that could be put right.
    delays = inspect_delay(points.t_us, points.slip, points.adhesion)
    yield from (finding for finding in delays if finding.fatal or not derived)
    yield from derived
    if points.speed is not None and float(np.median(points.speed)) <= FAST:
        yield from inspect_acceleration(points.t_us, points.speed, points.adhesion)


def _stamps(points: MeasuredPoints) -> Iterator[Finding]:
    if not points.table or points.t_us is None or len(points.t_us) < 2:
        return
    repeated = float(np.mean(np.diff(points.t_us) == 0))
    if repeated > LEAST_REPEATED:
        what = f"{100 * repeated:.1f} % of the rows have the same stamp as the previous row"
        yield Finding(
            what, "take 'time_s' from a finer clock, or give an 'axle' column", fatal=False
        )


def _stuck(points: MeasuredPoints) -> Iterator[Finding]:
    for name, values, other in (
        ("slip", points.slip, points.adhesion),
        ("adhesion", points.adhesion, points.slip),
    ):
        run = longest_run(values, other)
        if run is not None and run[0] >= max(LEAST_STUCK, len(values) // 20):
            what = (
                f"the {name} stays at {run[1]:.4g} for {run[0]} rows while the other signal changes"
            )
            yield Finding(what, "remove those rows, or repair the sensor", fatal=False)


def longest_run(values: Array, other: Array) -> tuple[int, float] | None:
    """Length and value of the longest run of equal values in which another column varies.

    Args:
        values: Column that may be stuck, shape (n,).
        other: Column that must not be, shape (n,).

    """
    if len(values) < 2:
        return None
    starts = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0]))
    lengths = np.diff(np.append(starts, len(values)))
    for place in np.argsort(lengths)[::-1][:3]:
        rows = slice(starts[place], starts[place] + lengths[place])
        if values[rows.start] != 0.0 and float(np.ptp(other[rows])) > 0.0:
            return int(lengths[place]), float(values[rows.start])
    return None


HIGH = 0.99
"""Share of the rows that a size leaves below it."""


def inertial_adhesion(samples: Samples, vehicle: Locomotive) -> Array:
    """Force that accelerates a wheelset over its load, at the rim, shape (n,).

    The acceleration is the central difference of the rim speed, as that of the samples.

    Args:
        samples: Samples of one axle.
        vehicle: Configured vehicle.

    """
    if len(samples) < 3:
        return np.zeros(len(samples))
    radius = vehicle.wheel_radius[int(samples.axle[0]) - 1]
    omega = samples.speed * (1.0 + samples.slip) / radius
    span = np.maximum(samples.t_us[2:] - samples.t_us[:-2], 1) * 1e-6
    acceleration = np.zeros(len(samples))
    acceleration[1:-1] = (omega[2:] - omega[:-2]) / span
    return np.asarray(vehicle.wheelset_inertia * acceleration / radius / samples.load)


def is_inertial(points: MeasuredPoints) -> bool:
    """Whether the inertia and not the tractive effort makes the largest adhesions."""
    if points.inertial is None:
        return False
    by_inertia, by_effort = (
        float(np.quantile(np.abs(part), HIGH))
        for part in (points.inertial, points.adhesion + points.inertial)
    )
    return by_inertia > by_effort
