"""Stamps of a bus on the clock of this host.

The host's clock here is monotonic: it goes on evenly while the wall clock is set. Stamps come from
another clock (the wall clock, an adapter's, another host's), which may step, drift, stand still or
jump to and fro. How far the two are apart is reported by frames that came while they were waited
for, which are as old as the way through the driver, by frames from the future, which do not exist,
and by those that are older than the time since nothing waited.
"""

from collections import deque
from collections.abc import Callable

TOLERANCE_US = 1_000
"""Difference of the clocks that is left alone, µs: the way through the driver takes as long."""
STEP_US = 20_000
"""Difference from which a clock has stepped, and has not drifted, µs."""
WAITED_US = 1_000_000
"""Age of the first frame up to which it may have waited for the service to start, µs."""
FRAMES = 8
"""Frames that must agree before the offset is changed: this host may be late for some, and the
stamp of one may be wrong."""
MOST_CHANGES, CHANGES_US = 20, 10_000_000
"""Number of changes of the offset within a time, µs, from which the stamps are no longer used: a
clock that is set slowly needs five."""


class StampClock:
    """Brings stamps of a bus to the host's clock.

    Stamps of the wall clock stay as they are while both clocks agree to a millisecond.

    Args:
        notify: Callback with a line for the operator.

    """

    def __init__(self, notify: Callable[[str], None] = lambda _: None) -> None:
        self.offset_us = 0
        """Offset added to the stamps, µs."""
        self.steps = 0
        """Number of steps of the bus's clock against the host's."""
        self.usable = True
        """Whether the stamps are used; else a frame has the time of its arrival."""
        self._notify = notify
        self._started = False
        self._ages_us: deque[int] = deque(maxlen=FRAMES)
        self._changes_us: deque[int] = deque(maxlen=MOST_CHANGES)

    def to_host(self, stamp_us: int, received_us: int, earliest_us: int, *, awaited: bool) -> int:
        """Time of a frame on the host's clock, µs; not after its arrival.

        Args:
            stamp_us: Stamp of the frame, µs.
            received_us: Time at which it was received, on the host's clock, µs.
            earliest_us: Time at which nothing waited, µs: it came later.
            awaited: Whether it came while it was waited for, and not from a queue.

        """
        if not self._started:
            self._start(received_us - stamp_us, awaited=awaited)
        if not self.usable:
            return received_us
        age_us = received_us - (stamp_us + self.offset_us)
        too_old_us = age_us if awaited else age_us - (received_us - earliest_us)
        if awaited or too_old_us > TOLERANCE_US or age_us < -TOLERANCE_US:
            self._ages_us.append(age_us if age_us < 0 else too_old_us)
            self._compare(received_us)
        # Adapters deliver in bundles: a stamp may be that much before.
        host_us = max(stamp_us + self.offset_us, earliest_us - STEP_US)
        return min(host_us, received_us)

    def _start(self, offset_us: int, *, awaited: bool) -> None:
        self._started = True
        # A frame that was there before the loop began is as old as its stamp says, or from another
        # clock; the next frames that are awaited will tell.
        may_have_waited = not awaited and 0 <= offset_us <= WAITED_US
        if abs(offset_us) > STEP_US and not may_have_waited:
            self.offset_us = offset_us
            self._notify(
                f"the bus stamps frames with another clock; adding {offset_us / 1e6:+.3f} s"
            )

    def _compare(self, received_us: int) -> None:
        """Change the offset where all of the last frames ask for it, by the least of them."""
        if len(self._ages_us) < FRAMES:
            return
        if min(self._ages_us) > TOLERANCE_US:
            self._change(min(self._ages_us), received_us)
        elif max(self._ages_us) < -TOLERANCE_US:
            self._change(max(self._ages_us), received_us)

    def _change(self, by_us: int, received_us: int) -> None:
        self.offset_us += by_us
        self._ages_us.clear()
        self._changes_us.append(received_us)
        if received_us - self._changes_us[0] < CHANGES_US and len(self._changes_us) == MOST_CHANGES:
            self.usable = False
            self._notify(
                "the stamps of the bus jump or stand still; using arrival times from now on"
            )
        elif abs(by_us) > STEP_US:
            self.steps += 1
            where = "behind" if by_us > 0 else "ahead of"
            self._notify(
                f"the bus's timestamps are {abs(by_us) / 1e6:.3f} s {where} this host's clock, and "
                "are corrected: their clock was set, or this host is too busy to read in time"
            )
