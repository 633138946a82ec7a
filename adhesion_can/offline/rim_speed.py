"""Rim speed beside vehicle speed: reversed wheel speeds, wrong units, diameters for radii."""

from collections.abc import Iterable, Mapping
from math import inf, pi

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.offline.finding import Finding
from adhesion_can.physics.kinematics import slip_ratio
from adhesion_can.physics.readings import Role
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.traces import Trace

LEAST_ROWS = 20
"""Rows without which a ratio says nothing."""
TOLERANCE, WIDE_TOLERANCE = 0.1, 0.25
"""Relative distance to a known ratio within which half of the rows must be; the wide one where no
wheel that slips can have it."""
SLIPPING = (0.4, 2.5)
"""Ratios of wheels that slip heavily or spin."""
_VEHICLE_UNIT = "check the unit of vehicle_speed"
_WHEEL_UNIT = "check the unit of wheel_speed"
FIXES: Mapping[float, str] = {
    -1.0: "the wheel speed has the opposite sign: change sign of wheel_speed",
    1 / 3.6: f"{_VEHICLE_UNIT}: it may be in km/h",
    3.6: f"{_VEHICLE_UNIT}: it may be in m/s",
    0.5 / pi: f"{_WHEEL_UNIT}: it may be in 1/s",
    2 * pi: f"{_WHEEL_UNIT}: it may be in rad/s",
    30 / pi: f"{_WHEEL_UNIT}: it may be in rpm",
    pi / 30: f"{_WHEEL_UNIT}: it may be in rad/s, not in rpm",
    180 / pi: f"{_WHEEL_UNIT}: it may be in deg/s",
    pi / 180: f"{_WHEEL_UNIT}: it may be in rad/s, not in deg/s",
    2.0: "check the wheel radius: it may be a diameter",
    1e3: "check the wheel radius: it may be in mm",
}
"""What is wrong where the rim runs at these multiples of the vehicle speed."""


def inspect_rim_speeds(slips: Mapping[int, Array]) -> list[Finding]:
    """Axles whose rims run at a multiple of the vehicle speed that a known mistake makes.

    Args:
        slips: Slip ratios of each axle, shape (n,) each.

    """
    axles: dict[float, list[int]] = {}
    for axle, slip in slips.items():
        known = known_ratio(slip)
        if known is not None:
            axles.setdefault(known, []).append(axle)
    return [
        Finding(
            f"{_name(numbers)}: the rim speed is {ratio:.3g} times the vehicle speed", FIXES[ratio]
        )
        for ratio, numbers in axles.items()
    ]


def known_ratio(slip: Array) -> float | None:
    """Multiple of the vehicle speed at which half of the rows are; None where it is no known one.

    Args:
        slip: Slip ratios of one axle, shape (n,).

    """
    if len(slip) < LEAST_ROWS:
        return None
    low, high = np.quantile(1.0 + slip, (0.25, 0.75))
    for ratio in FIXES:
        slipping = ratio < 0.0 or SLIPPING[0] < ratio < SLIPPING[1]
        within = (TOLERANCE if slipping else WIDE_TOLERANCE) * abs(ratio)
        if max(abs(low - ratio), abs(high - ratio)) <= within:
            return ratio
    return None


def slips_of_samples(samples: Samples) -> dict[int, Array]:
    """Slip ratios by axle."""
    return {int(axle): samples.slip[samples.axle == axle] for axle in np.unique(samples.axle)}


def slips_of_traces(
    traces: Mapping[tuple[Role, int], Trace], vehicle: Locomotive, v_min: float
) -> dict[int, Array]:
    """Slip ratios by axle at the readings of the wheel speeds, of whatever size.

    Args:
        traces: Received readings by role and axle.
        vehicle: Configured vehicle.
        v_min: Speed below which there is no slip ratio, m/s.

    """
    speed = traces.get((Role.VEHICLE_SPEED, 0))
    slips = {}
    for axle in range(1, vehicle.axles + 1):
        wheel = traces.get((Role.WHEEL_SPEED, axle))
        if speed is None or wheel is None:
            continue
        v = speed.at(wheel.t_us, inf)
        known = np.isfinite(wheel.value) & (v >= v_min)
        radius = vehicle.wheel_radius[axle - 1]
        slips[axle] = slip_ratio(wheel.value[known], v[known], radius, v_min)
    return slips


def _name(axles: Iterable[int]) -> str:
    numbers = [str(axle) for axle in axles]
    return f"axle {numbers[0]}" if len(numbers) == 1 else f"axles {', '.join(numbers)}"
