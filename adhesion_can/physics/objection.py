"""Objections: why the service does not vouch for its estimate, whatever the curve's fit says."""

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple


class Objection(IntEnum):
    """What the readings cannot be."""

    NONE = 0
    SPEED_JUMP = 1
    WHEELS_JUMP = 2
    EFFORTS_JUMP = 3
    LOADS_JUMP = 4
    SPEED_DEVIATES = 5
    LOADS_OFF = 6
    BEYOND_CEILING = 7
    SLIPS_BEYOND_MODEL = 8

    @property
    def json_name(self) -> str | None:
        """Name as JSON has it; None where there is no objection."""
        return None if self is Objection.NONE else self.name.lower()


class Wording(NamedTuple):
    """What an objection says.

    Attributes:
        what: What is wrong, as a sentence without a full stop.
        fix: What to do about it.

    """

    what: str
    fix: str


_UNTIL = "no peak until the readings agree again, or coasting confirms them"
WORDINGS: Mapping[Objection, Wording] = {
    Objection.SPEED_JUMP: Wording(
        "the vehicle speed jumped, but forces and wheel speeds did not", _UNTIL
    ),
    Objection.WHEELS_JUMP: Wording(
        "most wheel speeds jumped within one cycle, faster than a wheelset can", _UNTIL
    ),
    Objection.EFFORTS_JUMP: Wording(
        "all efforts jumped at once, and neither slip nor vehicle speed explains it", _UNTIL
    ),
    Objection.LOADS_JUMP: Wording("all axle loads jumped at once", _UNTIL),
    Objection.SPEED_DEVIATES: Wording(
        "the vehicle speed departs from what forces and wheel speeds imply", _UNTIL
    ),
    Objection.LOADS_OFF: Wording(
        "the axle loads differ too much from the static loads",
        "check [vehicle] axle_load, or least_load and most_load in [plausibility]",
    ),
    Objection.BEYOND_CEILING: Wording(
        "the peak exceeds what a rail can provide",
        "check efforts and loads; for tyres on a road raise [plausibility] mu_ceiling",
    ),
    Objection.SLIPS_BEYOND_MODEL: Wording(
        "most slip ratios are outside the model: locked or spinning wheels, or a faulty sensor",
        "check wheel and vehicle speed",
    ),
}
"""Words for each objection."""


def objection_sentence(objection: Objection) -> str:
    """What is objected and what to do about it; '' where there is no objection."""
    wording = WORDINGS.get(objection)
    return "" if wording is None else f"{wording.what}: {wording.fix}"
