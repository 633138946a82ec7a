"""Status of the service, as its messages carry it."""

from enum import IntEnum


class Status(IntEnum):
    """Status of the service as `AdhesionSetpoint.Status` carries it."""

    INIT = 0
    TRACKING = 1
    LOW_EXCITATION = 2
    SURFACE_CHANGE = 3
    STALE_INPUT = 4
    FAULT = 5
