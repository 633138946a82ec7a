"""AUTOSAR E2E profile 1: checksum and counter of a message, protected and supervised.

Checksum: CRC-8, polynomial 0x1D, effective init 0, no final xor, over both bytes of the data id and
the payload from byte 1 on. Counter: byte 1, low nibble, 0..14; 15 is never sent.
"""

from dataclasses import dataclass, field
from enum import StrEnum

from e2e.crc import calculate_crc8
from e2e.p01 import e2e_p01_protect

COUNTS = 15
"""The counter runs 0..14."""

ACCEPTED_STEP = 3
"""Largest step of the counter that is accepted; the frames between count as lost."""

TAKEOVER_FRAMES = 3
"""So many rejected frames that follow each other establish a new count."""

SILENCE_CYCLES = 10
"""After so many cycles without a frame any count is taken over."""


def protect(payload: bytearray, data_id: int, count: int) -> None:
    """Write counter and checksum into a payload, in place.

    Args:
        payload: at least two bytes.
        data_id: of the message.
        count: 0..14.

    """
    payload[1] = (payload[1] & 0xF0) | count
    e2e_p01_protect(payload, data_id, increment_counter=False)


def checksum_ok(payload: bytes, data_id: int) -> bool:
    """Whether the checksum in byte 0 is that of the payload.

    AUTOSAR's check of the whole profile also refuses the count 15; here that is the counter's
    business, so that it is reported as such.
    """
    covered = data_id.to_bytes(2, "little") + payload[1:]
    # AUTOSAR's CRC-8 begins with and ends in an xor of 0xFF; the profile undoes both.
    return payload[0] == calculate_crc8(covered, 0xFF, False) ^ 0xFF


class Rejection(StrEnum):
    """Why a frame was not taken."""

    LENGTH = "length"
    CHECKSUM = "checksum"
    RANGE = "range"
    REPEAT = "repeat"
    ORDER = "order"


@dataclass(slots=True)
class CounterSupervision:
    """Supervision of the counter of one message.

    With Δ against the last accepted frame modulo 15: 1 is in order, 2 and 3 are accepted with
    Δ − 1 frames lost, 0 is a repetition, all else is out of order. Three consecutive rejected
    frames that follow each other, or ten cycles of silence, establish a new count: the frame that
    completes them is the first one accepted. A rejected frame never moves the baseline.

    Attributes:
        cycle_us: of the message; None where unknown, then silence establishes nothing.
        lost: frames lost so far.

    """

    cycle_us: int | None
    lost: int = 0
    _baseline: int | None = field(default=None, init=False)
    _heard_us: int = field(default=0, init=False)
    _run: int = field(default=0, init=False)
    _run_count: int = field(default=-1, init=False)

    def accept(self, count: int, t_us: int) -> Rejection | None:
        """Judge the counter of a frame whose checksum is right.

        Args:
            count: 0..15.
            t_us: stamp of the frame.

        Returns:
            None where the frame is accepted.

        """
        silence = t_us - self._heard_us
        self._heard_us = t_us
        if count >= COUNTS:
            self.interrupt()
            return Rejection.ORDER
        new_start = self._baseline is None or (
            self.cycle_us is not None and silence >= SILENCE_CYCLES * self.cycle_us
        )
        step = 1 if new_start or self._baseline is None else (count - self._baseline) % COUNTS
        if 1 <= step <= ACCEPTED_STEP:
            self.lost += step - 1
            self._take(count)
            return None
        self._run = self._run + 1 if count == (self._run_count + 1) % COUNTS and self._run else 1
        self._run_count = count
        if self._run >= TAKEOVER_FRAMES:
            self._take(count)
            return None
        return Rejection.REPEAT if step == 0 else Rejection.ORDER

    def interrupt(self) -> None:
        """A frame was rejected for another reason: a run of frames that follow each other ends."""
        self._run = 0

    def _take(self, count: int) -> None:
        self._baseline = count
        self._run = 0
