"""Objections: why the service does not vouch for its estimate, whatever the curve's fit says.

The readings contradict each other, or they do not show the vehicle speed that is observed by them
(`estimation.observed_speed`).
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple


class Objection(IntEnum):
    """What the readings cannot be, or do not show."""

    NONE = 0
    SPEED_JUMP = 1
    WHEELS_JUMP = 2
    EFFORTS_JUMP = 3
    LOADS_JUMP = 4
    SPEED_DEVIATES = 5
    LOADS_OFF = 6
    BEYOND_CEILING = 7
    SLIPS_BEYOND_MODEL = 8
    NO_RELIEF = 9
    RADII_UNCERTAIN = 10
    EFFORTS_ROSE = 11
    RAIL_CHANGED = 12

    @property
    def json_name(self) -> str | None:
        """Name as JSON has it; None where there is no objection."""
        return None if self is Objection.NONE else self.name.lower()


NEEDS_RELIEF = frozenset(
    {
        Objection.NO_RELIEF,
        Objection.RADII_UNCERTAIN,
        Objection.EFFORTS_ROSE,
        Objection.RAIL_CHANGED,
    }
)
"""Objections that end when an axle is relieved of its effort."""


class Wording(NamedTuple):
    """What an objection says.

    Attributes:
        what: What is wrong, as a sentence without a full stop.
        fix: What to do about it.

    """

    what: str
    fix: str


_RELIEVE = "relieve one axle for a second"
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
    Objection.NO_RELIEF: Wording(
        "no driven axle was free of effort of late, so the wheels do not show the vehicle speed",
        _RELIEVE,
    ),
    Objection.RADII_UNCERTAIN: Wording(
        "the observed vehicle speed is not exact enough, as far as the wheel radii are known",
        "relieve another axle for a second",
    ),
    Objection.EFFORTS_ROSE: Wording(
        "the efforts have risen since the last relief, so the slips are uncertain", _RELIEVE
    ),
    Objection.RAIL_CHANGED: Wording(
        "the rail has changed since the last relief, so the slips are uncertain", _RELIEVE
    ),
}
"""Words for each objection."""


def objection_sentence(objection: Objection) -> str:
    """What is objected and what to do about it; '' where there is no objection."""
    wording = WORDINGS.get(objection)
    return "" if wording is None else f"{wording.what}: {wording.fix}"
