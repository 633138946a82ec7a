"""Reasons to reject a received frame, and their codes in columns."""

from enum import StrEnum


class Rejection(StrEnum):
    """Reason to reject a frame: the first check that it fails, in the order of the checks."""

    LENGTH = "length"
    CHECKSUM = "checksum"
    RANGE = "range"
    REPEAT = "repeat"
    ORDER = "order"
    MULTIPLEXER = "multiplexer"


REJECTIONS = tuple(Rejection)
"""Reasons in the order of their codes: code 0 is an accepted frame, code i + 1 `REJECTIONS[i]`."""

REJECTION_CODE = {rejection: code for code, rejection in enumerate(REJECTIONS, start=1)}
"""Code of each reason in a column of outcomes."""
