"""Status of the service, as its messages carry it."""

from collections.abc import Mapping
from enum import IntEnum


class Status(IntEnum):
    """Status of the service as `AdhesionSetpoint.Status` carries it."""

    INIT = 0
    TRACKING = 1
    LOW_EXCITATION = 2
    SURFACE_CHANGE = 3
    STALE_INPUT = 4
    FAULT = 5


DESCRIPTIONS: Mapping[Status, str] = {
    Status.INIT: "no estimate yet",
    Status.TRACKING: "the peak is known",
    Status.LOW_EXCITATION: "the data do not show the peak",
    Status.SURFACE_CHANGE: "the rail has changed; its peak is being identified",
    Status.STALE_INPUT: "a required input is silent",
    Status.FAULT: "the estimator failed, or a second service sends",
}
"""Clause for each status, without a full stop."""
