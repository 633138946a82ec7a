"""Statistics of one received message: accepted, rejected and lost frames, gaps, readings."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.bus.acceptance import SERVICE_POLICY, DecodedFrame, MessageAcceptance
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.rejection import Rejection
from adhesion_can.bus.roles import BoundMessage
from adhesion_can.bus.stuck_signal import StuckSignalCheck
from adhesion_can.physics.readings import Reading, Role

LATE_CYCLES = 3
"""A gap between two accepted frames is late where it is longer than this number of cycles."""


@dataclass(slots=True)
class MessageRecord:
    """State and statistics of one received message.

    Attributes:
        message: Message with the signals that have a role.
        acceptance: Protection of the message and state of its counter.
        decode: Decoder of a frame of the message whose length and checksum are valid.
        frames: Number of received frames, rejected ones included.
        accepted: Number of accepted frames.
        rejected: Number of rejected frames by reason.
        first_us: Time stamp of the first accepted frame, µs; None before it.
        last_us: Time stamp of the last accepted frame, µs; None before the first.
        longest_gap_us: Longest time between two accepted frames, µs.
        gap_at_us: Time stamp at which the longest gap starts, µs; None without a gap.
        late: Number of gaps of more than three cycles.
        not_available: Number of readings with the raw value for 'not available'.
        readings: Number of readings of all signals.
        stuck: Number of readings of stuck signals, which count as not available from there on.
        stuck_checks: Supervision of the signals that may be stuck, by role and axle.
        other_channels: Channels other than the message's on which frames of this id came.

    """

    message: BoundMessage
    acceptance: MessageAcceptance
    decode: Callable[[Frame], DecodedFrame[list[Reading]]] = field(compare=False)
    frames: int = 0
    accepted: int = 0
    rejected: Counter[Rejection] = field(default_factory=Counter)
    first_us: int | None = None
    last_us: int | None = None
    longest_gap_us: int = 0
    gap_at_us: int | None = None
    late: int = 0
    not_available: int = 0
    readings: int = 0
    stuck: int = 0
    stuck_checks: dict[tuple[Role, int], StuckSignalCheck] = field(default_factory=dict)
    other_channels: set[str] = field(default_factory=set)

    @classmethod
    def begin(
        cls, message: BoundMessage, decode: Callable[[Frame], DecodedFrame[list[Reading]]]
    ) -> "MessageRecord":
        """Empty record of a message with its decoder, with the checks of the service."""
        size, data_id, cycle_us = message.plan.size, message.data_id, message.cycle_us
        record = cls(message, MessageAcceptance(SERVICE_POLICY, size, data_id, cycle_us), decode)
        for signal in message.signals:
            if signal.stuck_check:
                check = StuckSignalCheck(signal.resolution, rest=-signal.offset)
                record.stuck_checks[signal.role, signal.axle] = check
        return record

    @property
    def wrong_channel(self) -> tuple[str, str] | None:
        """What is wrong with the channel of a message whose frames are all on others, and the fix.

        None where a frame came on its channel, or none on any.
        """
        if self.frames or not self.other_channels:
            return None
        what = (
            f'its role has channel = "{self.message.channel}", but its frames are on '
            f"{', '.join(sorted(self.other_channels))}"
        )
        return what, "write the channel as the recording names it"

    @property
    def lost(self) -> int:
        """Number of lost frames, by the counter."""
        return self.acceptance.lost

    def leave_out_stuck(self, readings: list[Reading]) -> list[Reading]:
        """The readings of an accepted frame; those of stuck signals are not available."""
        for place, reading in enumerate(readings):
            value, check = reading.value, self.stuck_checks.get((reading.role, reading.axle))
            if check is not None and value is not None and check.accept(value):
                self.stuck += 1
                readings[place] = replace(reading, value=None)
        return readings

    def find_stuck(self, key: tuple[Role, int], values: Array) -> NDArray[np.bool_]:
        """Whether a signal is stuck at each of its consecutive accepted readings; shape (n,).

        Args:
            key: Role and axle of the signal.
            values: Its readings, SI, NaN where not available, shape (n,).

        """
        stuck = np.zeros(len(values), dtype=np.bool_)
        if key in self.stuck_checks:
            available = np.isfinite(values)
            stuck[available] = self.stuck_checks[key].accept_all(values[available])
            self.stuck += int(stuck.sum())
        return stuck

    def add(self, t_us: int) -> None:
        """Count an accepted frame with its time stamp, µs."""
        self.accepted += 1
        if self.first_us is None or self.last_us is None:
            self.first_us = t_us
        else:
            gap = t_us - self.last_us
            if gap > self.longest_gap_us:
                self.longest_gap_us, self.gap_at_us = gap, self.last_us
            if self.message.cycle_us and gap > LATE_CYCLES * self.message.cycle_us:
                self.late += 1
        self.last_us = t_us

    def add_all(self, t_us: NDArray[np.int64]) -> None:
        """Count consecutive accepted frames with their time stamps, µs, shape (n,)."""
        if not len(t_us):
            return
        self.accepted += len(t_us)
        start = int(t_us[0])
        gaps = np.diff(t_us, prepend=start if self.last_us is None else self.last_us)
        if self.first_us is None:
            self.first_us = start
        longest = int(np.argmax(gaps))
        if int(gaps[longest]) > self.longest_gap_us:
            self.longest_gap_us = int(gaps[longest])
            self.gap_at_us = int(t_us[longest]) - self.longest_gap_us
        if self.message.cycle_us:
            self.late += int((gaps > LATE_CYCLES * self.message.cycle_us).sum())
        self.last_us = int(t_us[-1])
