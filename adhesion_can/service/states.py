"""The states of the service as an explicit table.

What holds at a moment is a set of conditions; the first that holds, in the order of `PRECEDENCE`,
is the status. `TRANSITIONS` lists the changes that can follow from it: an estimate, once there, does
not go away, so INIT is never reached from a state that had one.
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


PRECEDENCE: tuple[tuple[Status, str], ...] = (
    (Status.FAULT, "fault"),
    (Status.STALE_INPUT, "stale"),
    (Status.INIT, "no_estimate"),
    (Status.SURFACE_CHANGE, "surface_change"),
    (Status.LOW_EXCITATION, "low_excitation"),
)

VALUES: dict[Status, Values] = {
    Status.INIT: Values.NOT_AVAILABLE,
    Status.TRACKING: Values.CURRENT,
    Status.LOW_EXCITATION: Values.CURRENT,
    Status.SURFACE_CHANGE: Values.CURRENT,
    Status.STALE_INPUT: Values.HELD,
    Status.FAULT: Values.NOT_AVAILABLE,
}

_S = Status
_ESTIMATING = frozenset({_S.TRACKING, _S.LOW_EXCITATION, _S.SURFACE_CHANGE})
TRANSITIONS: dict[Status, frozenset[Status]] = {
    _S.INIT: _ESTIMATING | {_S.INIT, _S.STALE_INPUT, _S.FAULT},
    _S.TRACKING: _ESTIMATING | {_S.STALE_INPUT, _S.FAULT},
    _S.LOW_EXCITATION: _ESTIMATING | {_S.STALE_INPUT, _S.FAULT},
    _S.SURFACE_CHANGE: _ESTIMATING | {_S.STALE_INPUT, _S.FAULT},
    _S.STALE_INPUT: _ESTIMATING | {_S.INIT, _S.STALE_INPUT, _S.FAULT},
    _S.FAULT: _ESTIMATING | {_S.INIT, _S.STALE_INPUT, _S.FAULT},
}


def status_of(conditions: Conditions) -> Status:
    """The status: the first condition that holds, else TRACKING."""
    for status, name in PRECEDENCE:
        if getattr(conditions, name):
            return status
    return Status.TRACKING
