"""Whether the calibrated radii agree with the configured ones."""

from typing import Any

import scipy

from adhesion_can.calibration.fit import AxleRadius, Calibration

LEVEL = 0.05
"""Probability that any axle of a right configuration is found to differ."""


def differs(axle: AxleRadius, result: Calibration) -> bool | None:
    """Whether an axle's radius differs from the configured one by more than its uncertainty.

    The uncertainty is the interval by Student's t over the blocks, at a level divided by the number
    of the axles (Bonferroni), widened by the bound of the creep left while coasting.

    Args:
        axle: Axle of the result.
        result: Calibration of all axles.

    Returns:
        None where the axle has too little coasting.

    """
    if axle.estimate is None:
        return None
    tested = sum(radius.estimate is not None for radius in result.axles)
    quantile = float(scipy.special.stdtrit(axle.blocks - 1, 1 - LEVEL / (2 * tested)))
    systematic = (result.systematic_percent or 0.0) / 100 * axle.configured
    return abs(axle.estimate.value - axle.configured) > quantile * axle.estimate.std + systematic


def agreement_dict(result: Calibration) -> dict[str, Any]:
    """Agreement of each axle and of all tested axles, as JSON has it."""
    differs_by_axle = {axle.axle: differs(axle, result) for axle in result.axles}
    return {
        "agrees_with_configuration": not any(differs_by_axle.values()),
        "axles_that_differ": [axle for axle, differing in differs_by_axle.items() if differing],
        "axles_not_tested": [
            axle for axle, differing in differs_by_axle.items() if differing is None
        ],
    }
