"""The states of the service as a table.

The contract orders the conditions: where several hold, the first of them is the status. So a
status follows from the conditions alone, whatever came before it, and every state leaves to every
other one by the same rows. `TRANSITIONS` says which condition leads where, `VALUES` what the
setpoints carry there.
"""

from dataclasses import dataclass
from enum import Enum, IntEnum, auto


class Status(IntEnum):
    """As `AdhesionSetpoint.Status` sends it."""

    INIT = 0
    TRACKING = 1
    LOW_EXCITATION = 2
    SURFACE_CHANGE = 3
    STALE_INPUT = 4
    FAULT = 5


class Values(Enum):
    """What the setpoints carry in a state."""

    CURRENT = auto()
    HELD = auto()
    NOT_AVAILABLE = auto()


@dataclass(frozen=True, slots=True)
class Conditions:
    """What holds at a moment.

    Attributes:
        fault: the estimator failed, or another service sends our messages.
        stale: a required input has been silent for three cycles.
        no_estimate: there is none yet.
        surface_change: the rail has just changed.
        low_excitation: the data do not tell the peak, or are not independent of the wheels.

    """

    fault: bool = False
    stale: bool = False
    no_estimate: bool = False
    surface_change: bool = False
    low_excitation: bool = False


TRANSITIONS: tuple[tuple[str, Status], ...] = (
    ("fault", Status.FAULT),
    ("stale", Status.STALE_INPUT),
    ("no_estimate", Status.INIT),
    ("surface_change", Status.SURFACE_CHANGE),
    ("low_excitation", Status.LOW_EXCITATION),
)
"""From any state: the first condition that holds leads to its status; none: TRACKING."""

VALUES: dict[Status, Values] = {
    Status.INIT: Values.NOT_AVAILABLE,
    Status.TRACKING: Values.CURRENT,
    Status.LOW_EXCITATION: Values.CURRENT,
    Status.SURFACE_CHANGE: Values.CURRENT,
    Status.STALE_INPUT: Values.HELD,
    Status.FAULT: Values.NOT_AVAILABLE,
}


def status_of(conditions: Conditions) -> Status:
    """The status that follows from the conditions, by `TRANSITIONS`."""
    for name, status in TRANSITIONS:
        if getattr(conditions, name):
            return status
    return Status.TRACKING
