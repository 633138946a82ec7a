"""Speed of a wheel's rim in place of a vehicle speed, for vehicles that have none.

Samples need a speed to be formed with. Slips against the rim of one wheel say nothing by
themselves; with sample and reference they give back the speed of every rim, from which
`estimation.observed_speed` finds the vehicle speed.
"""

from collections.abc import Iterable

from adhesion_can.physics.readings import Reading, Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.column_former import Readings

REFERENCE_AXLE = 1
"""Number of the axle whose wheel gives the speed."""


class RimSpeed:
    """Readings of the vehicle speed from those of one wheel, at the same stamps.

    Args:
        vehicle: Vehicle with its wheel radii.

    """

    def __init__(self, vehicle: Locomotive) -> None:
        self._radius = vehicle.wheel_radius[REFERENCE_AXLE - 1]

    def add_to(self, readings: Iterable[Reading]) -> list[Reading]:
        """The readings of a frame, with the speed after them where they have the wheel."""
        with_speed = list(readings)
        for reading in tuple(with_speed):
            if reading.role is Role.WHEEL_SPEED and reading.axle == REFERENCE_AXLE:
                value = None if reading.value is None else self._radius * reading.value
                with_speed.append(Reading(reading.t_us, Role.VEHICLE_SPEED, 0, value))
        return with_speed

    def add_to_columns(self, readings: Readings) -> Readings:
        """The readings of a block, with the speed where they have the wheel."""
        wheel = readings.get((Role.WHEEL_SPEED, REFERENCE_AXLE))
        if wheel is None:
            return readings
        stamps, values = wheel
        return {**readings, (Role.VEHICLE_SPEED, 0): (stamps, self._radius * values)}
