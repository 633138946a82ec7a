"""Times from due to sent, counted in classes."""

from bisect import bisect_left

BOUNDS_US = (500, 1_000, 2_000, 3_000, 5_000, 10_000, 20_000, 50_000, 100_000)
"""Upper bounds of the classes (inclusive), µs; the last class has none."""


class Lateness:
    """Histogram of times from due to sent.

    Attributes:
        counts: Number of frames in each class; one class more than bounds.
        sum_us: Sum of all times, µs.

    """

    def __init__(self) -> None:
        self.counts = [0] * (len(BOUNDS_US) + 1)
        self.sum_us = 0

    def add(self, late_us: int) -> None:
        """Count a frame that was sent so long after its due time, µs."""
        self.counts[bisect_left(BOUNDS_US, late_us)] += 1
        self.sum_us += late_us

    def count_beyond(self, bound_us: int) -> int:
        """Number of frames later than a bound, which is one of `BOUNDS_US`, µs."""
        return sum(self.counts[BOUNDS_US.index(bound_us) + 1 :])
