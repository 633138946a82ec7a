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
        mend: What to do about it.

    """

    what: str
    mend: str


_UNTIL = "no peak until they agree again, or coasting shows that they do"
WORDINGS: Mapping[Objection, Wording] = {
    Objection.SPEED_JUMP: Wording(
        "the vehicle speed jumped, and neither efforts nor wheels moved the vehicle", _UNTIL
    ),
    Objection.WHEELS_JUMP: Wording(
        "all wheel speeds jumped within a cycle as no wheelset does", _UNTIL
    ),
    Objection.EFFORTS_JUMP: Wording("all efforts jumped, and no wheel answered with slip", _UNTIL),
    Objection.LOADS_JUMP: Wording(
        "the axle loads jumped together", "no peak until they are what they were"
    ),
    Objection.SPEED_DEVIATES: Wording(
        "the vehicle speed leaves its course, and the wheels do not", _UNTIL
    ),
    Objection.LOADS_OFF: Wording(
        "the axle loads are far from the static ones",
        "check [vehicle] axle_load, or the range under [plausibility]",
    ),
    Objection.BEYOND_CEILING: Wording(
        "the adhesion is more than a rail gives",
        "check efforts and loads; a road has more: [plausibility] mu_ceiling",
    ),
    Objection.SLIPS_BEYOND_MODEL: Wording(
        "the slips are beyond the model at all axles: wheels that are locked or spin, or a sensor",
        "check wheel and vehicle speed",
    ),
}
"""Words for each objection."""


def objection_sentence(objection: Objection) -> str:
    """What is objected and what to do about it; '' where there is no objection."""
    wording = WORDINGS.get(objection)
    return "" if wording is None else f"{wording.what}: {wording.mend}"
