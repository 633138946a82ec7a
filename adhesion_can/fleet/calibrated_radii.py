"""Which calibrated wheel radii the later steps of a unit work with.

A radius is applied where coasting leaves no doubt of it, and where it makes a difference; all
others stay as they are configured. A wheel that is off by more than wear can be is no worn wheel:
configuration or signal is wrong, and nothing of such a calibration is applied.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import scipy

from adhesion_can.calibration.coasting import CalibrationSettings
from adhesion_can.calibration.fit import AxleRadius, Calibration
from adhesion_can.fleet.settings import LEAST_WEAR

SETTINGS = CalibrationSettings(blocks_min=3)
"""Settings of the calibration of a unit. A short drive often coasts in three blocks alone, and
Student's t over so few asks for a hundred standard errors before a radius is applied."""
MOST_WEAR = 0.1
"""Share of the configured radius by which a worn or new wheel can differ from it: of a wheel of
1250 mm some 45 mm of the radius."""
LEAST_COASTING_S = 10.0
"""Least time for which an axle must have coasted, s: twice that for which a radius is estimated."""
ALPHA = 1e-3
"""Probability that any radius of a unit is applied by chance, all axles counted."""


@dataclass(frozen=True, slots=True)
class AppliedRadii:
    """Radii for the steps after the calibration.

    Attributes:
        ratio: Applied over configured radius, by axle; no other axle changes.
        note: Sentence on radii that differ and were not applied; '' where there are none.

    """

    ratio: dict[int, float]
    note: str = ""


def choose_radii(calibration: Calibration) -> AppliedRadii:
    """Calibrated radii that are certain, plausible and differ enough to matter."""
    estimated = [radius for radius in calibration.axles if radius.estimate is not None]
    differ = [radius for radius in estimated if abs(radius.ratio - 1.0) >= LEAST_WEAR]
    if not differ:
        return AppliedRadii({})
    if not calibration.effort_known:
        reason = (
            "without tractive effort, coasting is unknown and the radii contain the slip of "
            "traction"
        )
        return AppliedRadii({}, f"{_listed(differ)}: {reason}")
    implausible = [radius for radius in differ if abs(radius.ratio - 1.0) > MOST_WEAR]
    if implausible:
        reason = f"a change of more than {100 * MOST_WEAR:g} % is not wear"
        fix = "check the configured radius and the unit of the wheel speed"
        return AppliedRadii({}, f"{_listed(implausible)}: {reason}; {fix}")
    certain = {
        radius.axle: radius.ratio for radius in differ if _is_certain(radius, len(estimated))
    }
    doubtful = [radius for radius in differ if radius.axle not in certain]
    if not doubtful:
        return AppliedRadii(certain)
    reason = f"not certain: {LEAST_COASTING_S:g} s of coasting and a significance of {ALPHA:g}"
    return AppliedRadii(certain, f"{_listed(doubtful)}: {reason} are needed")


def _is_certain(radius: AxleRadius, axles: int) -> bool:
    """Whether a radius differs beyond chance, by Student's t over the blocks of coasting."""
    if (
        radius.estimate is None
        or radius.coasting_s < LEAST_COASTING_S
        or not radius.estimate.std > 0.0
    ):
        return False
    t = abs(radius.estimate.value - radius.configured) / radius.estimate.std
    return bool(2.0 * axles * scipy.special.stdtr(radius.blocks - 1, -t) <= ALPHA)


def _listed(axles: Sequence[AxleRadius]) -> str:
    """Deviations of estimated radii with their standard errors."""
    return ", ".join(
        f"axle {radius.axle} {100 * (radius.ratio - 1):+.2f} % ± "
        f"{100 * radius.estimate.std / radius.configured:.2f} %"
        for radius in axles
        if radius.estimate is not None
    )
