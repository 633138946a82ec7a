"""Effects that nothing separates in a drive at a steady speed."""

from collections.abc import Iterable

import numpy as np

from adhesion_can.diagnosis.drive.drive_data import DriveData, observed_column
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.physics.effects import Effect

SPEED_RANGE = 0.2
"""Range of the speeds (5 to 95 % of the rows), as a share of their median, below which a fall with
creep speed cannot be separated from one with slip, nor a length from a time."""


def is_at_one_speed(drives: Iterable[DriveData]) -> bool:
    """Whether the vehicle speed hardly varies.

    Args:
        drives: Rows of all drives.

    """
    speed = observed_column(drives, "speed")
    low, middle, high = np.quantile(speed, [0.05, 0.5, 0.95])
    return bool(high - low < SPEED_RANGE * middle)


def find_rivals_at_one_speed(
    named: Candidate, size: float, tested: Iterable[Candidate]
) -> set[str]:
    """Ids of tested effects that only another speed separates from a named one.

    What the curve misses may make any of them fit best.

    Args:
        named: Effect that is named.
        size: Its size.
        tested: Effects that were tested.

    """
    rivals_of_named = {
        separation.rival
        for separation in named.effect.observability.separations
        if np.sign(size) in separation.one_speed_signs
    }
    others = {candidate.effect for candidate in tested if candidate.effect.id != named.effect.id}
    return {
        other.id for other in others if other.id in rivals_of_named or _is_like(other, named.effect)
    }


def _is_like(other: Effect, named: Effect) -> bool:
    separations = other.observability.separations
    return any(
        separation.rival == named.id and separation.one_speed_signs for separation in separations
    )
