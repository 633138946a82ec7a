"""Recent readings of one signal, and its value at stamps between them."""

from bisect import bisect_left, bisect_right
from math import sqrt


class Waiting:
    """Answer of a history whose reading that closes the bracket has not come yet."""


WAITING = Waiting()


class SignalHistory:
    """Recent readings of one signal, in the order of their stamps."""

    __slots__ = ("max_gap_us", "times", "values")

    def __init__(self, max_gap_us: float) -> None:
        self.max_gap_us = max_gap_us
        self.times: list[int] = []
        self.values: list[float | None] = []

    def __deepcopy__(self, _: dict[int, object]) -> "SignalHistory":
        # A former is copied fifty times a second; numbers need no copies of their own.
        twin = SignalHistory(self.max_gap_us)
        twin.times, twin.values = self.times[:], self.values[:]
        return twin

    def add(self, t_us: int, value: float | None) -> None:
        """Add a reading; stamps must not run backwards."""
        if self.times and t_us <= self.times[-1]:
            # Two readings of one stamp: the later one counts, a difference needs two stamps.
            self.values[-1] = value
            return
        self.times.append(t_us)
        self.values.append(value)

    def forget_before(self, t_us: int) -> int:
        """Drop the readings that no bracket at or after `t_us` needs; returns their number."""
        keep = max(bisect_right(self.times, t_us) - 2, 0)
        if keep:
            del self.times[:keep], self.values[:keep]
        return keep

    def at(self, t_us: int) -> float | Waiting | None:
        """Value at a stamp, interpolated; None across a gap or a missing value."""
        times = self.times
        if not times or times[-1] < t_us:
            return WAITING
        after = bisect_left(times, t_us)
        right = self.values[after]
        if times[after] == t_us or right is None:
            return right
        if after == 0:
            return None
        left = self.values[after - 1]
        span = times[after] - times[after - 1]
        if left is None or span > self.max_gap_us:
            return None
        return left + (right - left) * ((t_us - times[after - 1]) / span)

    def bracket_end_us(self, t_us: int) -> int:
        """Stamp of the reading that closes the bracket around a stamp that has one."""
        return self.times[bisect_left(self.times, t_us)]

    def share_at(self, t_us: int) -> float:
        """Place of a stamp within its bracket: 1 at the reading that closes it."""
        after = bisect_left(self.times, t_us)
        if self.times[after] == t_us:
            return 1.0
        before = self.times[after - 1]
        return (t_us - before) / (self.times[after] - before)

    def step_std(self, t_us: int) -> float:
        """Standard deviation at a stamp that has a bracket, had the value stepped within it."""
        times, values = self.times, self.values
        after = bisect_left(times, t_us)
        left, right = values[after - 1], values[after]
        if times[after] == t_us or left is None or right is None:
            return 0.0
        share = (t_us - times[after - 1]) / (times[after] - times[after - 1])
        return abs(right - left) * sqrt(share * (1.0 - share))

    def held_at(self, t_us: int) -> tuple[int, float] | None:
        """Stamp and value of the last reading at or before a stamp.

        None where it is older than the gap allowed or has no value.
        """
        before = bisect_right(self.times, t_us) - 1
        if before < 0 or t_us - self.times[before] > self.max_gap_us:
            return None
        value = self.values[before]
        return None if value is None else (self.times[before], value)
