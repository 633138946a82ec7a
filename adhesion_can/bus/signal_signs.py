"""Signs that a signal's values can have by its database, and what they say about a force."""

from enum import Enum, auto

from cantools.database.can import Signal

TOLERATED = 0.2
"""Negative part of a range, as a share of the positive one, up to which it is that of an error."""


class Signs(Enum):
    """Signs of a signal's values."""

    BOTH = auto()
    POSITIVE = auto()
    UNKNOWN = auto()  # signed bits without a stated range


def signs_of(signal: Signal) -> Signs:
    """Signs of a signal's values: by its stated range, else by its bits and offset."""
    ends = stated_range(signal)
    if ends is None:
        if signal.is_signed or signal.is_float:
            return Signs.UNKNOWN
        last = signal.scale * ((1 << signal.length) - 1)
        ends = (min(signal.offset, signal.offset + last), max(signal.offset, signal.offset + last))
    low, high = ends
    return Signs.POSITIVE if low >= -TOLERATED * max(high, 0.0) else Signs.BOTH


def stated_range(signal: Signal) -> tuple[float, float] | None:
    """Range that a database states for a signal, in its unit; None: it states none."""
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or not low < high:
        return None
    return float(low), float(high)
