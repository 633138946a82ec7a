"""Coasting as a witness of a named cause: wheels that transmit no force roll without slip.

The calibration compares wheels and vehicle speed while an axle coasts, and uses neither a curve nor
an effort beyond that. So its radii contradict a cause that has another size of the same error.
"""

import scipy

from adhesion_can.api.calibration import build_coasting_drive
from adhesion_can.calibration.coasting import CalibrationSettings
from adhesion_can.calibration.fit import AxleRadius, Calibration, calibrate
from adhesion_can.config import Configuration
from adhesion_can.learning.examination import load_readings
from adhesion_can.physics.effects import ActiveEffect, build_instruments
from adhesion_can.physics.instrument_laws import Quantity
from adhesion_can.sampling.column_former import Readings

LEVEL = 0.001
"""Probability that coasting contradicts a true cause, over all axles."""
_SPEEDS = frozenset({Quantity.SPEED, Quantity.WHEEL_SPEED})


def calibrate_readings(readings: Readings, configuration: Configuration) -> Calibration:
    """Wheel radii from the coasting in readings; no axle has an estimate where none coasts."""
    drive = build_coasting_drive(load_readings(readings), configuration)
    return calibrate([drive], configuration.vehicle, CalibrationSettings())


def find_contradiction(calibration: Calibration, effects: tuple[ActiveEffect, ...]) -> str:
    """Reason why coasting contradicts named effects, a clause; '' where it does not.

    Args:
        calibration: Radii from coasting, relative to the vehicle speed as it reads.
        effects: Named effects with their values.

    """
    instruments = build_instruments(effects)
    is_late = instruments.speed_delay != 0.0 or instruments.wheel_speed_delay != 0.0
    if is_late or any(law.quantity in _SPEEDS for law in instruments.laws):
        return ""  # an error of the speeds that is not one number
    tested = [axle for axle in calibration.axles if axle.estimate is not None]
    for axle in tested:
        wheel = 1.0 + instruments.radius_error.get(axle.axle, 0.0)
        expected = wheel * (1.0 + instruments.speed_error)
        if abs(axle.ratio - expected) > _largest_difference(axle, calibration, len(tested)):
            return (
                f"in coasting the radius of axle {axle.axle} is {100 * (axle.ratio - 1):+.2f} % "
                f"off, and not {100 * (expected - 1):+.2f} %"
            )
    return ""


def _largest_difference(axle: AxleRadius, calibration: Calibration, tested: int) -> float:
    """Largest difference of a radius, relative, that chance and the creep left can make."""
    if axle.estimate is None:
        return float("inf")
    quantile = float(scipy.special.stdtrit(axle.blocks - 1, 1 - LEVEL / (2 * tested)))
    systematic = (calibration.systematic_percent or 0.0) / 100
    return quantile * axle.estimate.std / axle.configured + systematic
