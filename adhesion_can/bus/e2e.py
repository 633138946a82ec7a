"""AUTOSAR E2E profile 1: checksum and counter of a message, protected and supervised.

Reference: AUTOSAR Foundation, E2E Protocol Specification (PRS_E2EProtocol).

Checksum: CRC-8, polynomial 0x1D, effective init 0, no final xor, over both bytes of the data id and
the payload from byte 1 on. Counter: byte 1, low nibble, 0..14; 15 is never sent.
"""

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from e2e.crc import calculate_crc8
from e2e.p01 import e2e_p01_protect
from numpy.typing import NDArray

from adhesion_can.bus.rejection import REJECTION_CODE, Rejection

COUNTS = 15
"""The counter runs 0..14."""

ACCEPTED_STEP = 3
"""Largest step of the counter that is accepted; the frames between count as lost."""

TAKEOVER_FRAMES = 3
"""Number of rejected frames with consecutive counts that establish a new count."""

SILENCE_CYCLES = 10
"""Cycles without a frame after which any count is accepted."""


def protect(payload: bytearray, data_id: int, count: int) -> None:
    """Write counter and checksum into a payload, in place.

    Args:
        payload: Payload of at least two bytes, changed in place.
        data_id: Data id of the message, 0..65535.
        count: Counter, 0..14.

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


def checksums_ok(words: NDArray[np.uint64], size: int, data_id: int) -> NDArray[np.bool_]:
    """Whether the checksum of each payload is right: `checksum_ok` for many payloads of one size.

    Args:
        words: Payloads as 64-bit words, shape (n, w).
        size: Length of each payload, bytes, 2..8 w.
        data_id: Data id of the message, 0..65535.

    Returns:
        Mask of the payloads with a right checksum, shape (n,).

    """
    # A CRC without init and final xor is linear over GF(2): it is the xor of what each pair of
    # bytes gives alone, by a table for each place (slicing-by-n; Kounavis and Berry, ISCC 2005).
    # Pairs by table take half the time of bytes by table.
    pairs = np.ascontiguousarray(words).astype("<u8", copy=False).view("<u2")
    tables = _pair_tables(size)
    left = tables[0].take(pairs[:, 0])
    for place, table in enumerate(tables[1:], start=1):
        left ^= table.take(pairs[:, place])
    ids = calculate_crc8(data_id.to_bytes(2, "little") + bytes(size - 1), 0xFF, False) ^ 0xFF
    return np.asarray(left == ids)


def counter_column(words: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Counters 0..15, shape (n,), of payloads of shape (n, w) in the layout of `Block.words`."""
    return ((words[:, 0] >> np.uint64(8)) & np.uint64(0x0F)).astype(np.uint8)


@cache
def _pair_tables(size: int) -> list[NDArray[np.uint8]]:
    """For each pair of bytes of a payload its part of byte 0 xor checksum, by the pair's value."""
    behind = _after_zeros(max(size - 1, 0))
    # Byte 0 is the checksum itself, byte `place` has size − 1 − place bytes behind it.
    parts = [np.arange(256, dtype=np.uint8), *reversed(behind[: size - 1])]
    parts += [np.zeros(256, dtype=np.uint8)] * (size % 2)
    # The second byte of a pair is its high one.
    return [
        (high[:, None] ^ low[None, :]).ravel()
        for low, high in zip(parts[::2], parts[1::2], strict=True)
    ]


def _after_zeros(count: int) -> list[NDArray[np.uint8]]:
    """Checksum of each byte alone, with 0, 1, .. `count` − 1 zero bytes behind it."""
    alone = [calculate_crc8(bytes([byte]), 0xFF, False) ^ 0xFF for byte in range(256)]
    step = np.array(alone, dtype=np.uint8)
    checksums = [step]
    while len(checksums) < count:
        checksums.append(step[checksums[-1]])
    return checksums


@dataclass(slots=True)
class CounterSupervision:
    """Supervision of the counter of one message.

    With Δ against the last accepted frame modulo 15: 1 is in order, 2 and 3 are accepted with
    Δ − 1 frames lost, 0 is a repetition, all else is out of order. Three consecutive rejected
    frames that follow each other, or ten cycles of silence, establish a new count: the frame that
    completes them is the first one accepted. A rejected frame never moves the baseline.

    Attributes:
        cycle_us: Cycle time of the message, µs; None where unknown, then silence establishes
            no new count.
        lost: Number of frames lost so far.

    """

    cycle_us: int | None
    lost: int = 0
    _baseline: int | None = field(default=None, init=False)
    _received_us: int = field(default=0, init=False)
    _run: int = field(default=0, init=False)
    _run_count: int = field(default=-1, init=False)

    def accept(self, count: int, t_us: int) -> Rejection | None:
        """Check the counter of a frame whose checksum is right.

        Args:
            count: Counter of the frame, 0..15.
            t_us: Time stamp of the frame, µs.

        Returns:
            None where the frame is accepted.

        """
        silence = t_us - self._received_us
        self._received_us = t_us
        if count >= COUNTS:
            self.interrupt()
            return Rejection.ORDER
        new_start = self._baseline is None or (
            self.cycle_us is not None and silence >= SILENCE_CYCLES * self.cycle_us
        )
        step = 1 if new_start or self._baseline is None else (count - self._baseline) % COUNTS
        if 1 <= step <= ACCEPTED_STEP:
            self.lost += step - 1
            self._set_baseline(count)
            return None
        self._run = self._run + 1 if count == (self._run_count + 1) % COUNTS and self._run else 1
        self._run_count = count
        if self._run >= TAKEOVER_FRAMES:
            self._set_baseline(count)
            return None
        return Rejection.REPEAT if step == 0 else Rejection.ORDER

    def accept_all(
        self,
        counts: NDArray[np.uint8],
        t_us: NDArray[np.int64],
        passed_other_checks: NDArray[np.bool_],
    ) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Check the counters of many frames, as `accept` does one after another.

        Args:
            counts: Counters of the frames, 0..15, shape (n,).
            t_us: Time stamps of the frames, µs, shape (n,).
            passed_other_checks: False where a frame was rejected for another reason, shape (n,).

        Returns:
            Outcomes, 0 where accepted or rejected for another reason, else
            `REJECTION_CODE`; and the frames lost before each one; both of shape (n,).

        """
        if passed_other_checks.all():
            return self._accept_passed(counts, t_us, None)
        rows = np.flatnonzero(passed_other_checks)
        outcome = np.zeros(len(counts), dtype=np.uint8)
        lost = np.zeros(len(counts), dtype=np.int64)
        ends = np.append(-1, rows)
        interrupted = np.diff(ends) > 1
        outcome[rows], lost[rows] = self._accept_passed(counts[rows], t_us[rows], interrupted)
        if len(passed_other_checks) - 1 > ends[-1]:
            self.interrupt()
        return outcome, lost

    def _accept_passed(
        self,
        counts: NDArray[np.uint8],
        t_us: NDArray[np.int64],
        interrupted: NDArray[np.bool_] | None,
    ) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """All frames in order at once, as if each one's forerunner was accepted; else one by one.

        Args:
            counts: Counters of the frames that passed the other checks, shape (n,).
            t_us: Time stamps, µs, shape (n,).
            interrupted: Whether a frame rejected for another reason came directly before,
                shape (n,); None: never.

        """
        outcome = np.zeros(len(counts), dtype=np.uint8)
        lost = np.zeros(len(counts), dtype=np.int64)
        steps = self._steps(counts, t_us)
        other = np.flatnonzero(steps != 1)
        step = steps[other]
        accepted_step = (step > 0) & (step <= ACCEPTED_STEP)
        lost[other[accepted_step]] = step[accepted_step] - 1
        begin = 0
        for deviation in other[~accepted_step].tolist():
            if deviation < begin:
                continue  # already checked
            self._in_order(counts, t_us, lost, begin, deviation)
            begin = deviation
            accepted = False
            while begin < len(counts) and not accepted:
                if interrupted is not None and interrupted[begin]:
                    self.interrupt()
                before = self.lost
                rejection = self.accept(counts.item(begin), t_us.item(begin))
                accepted = rejection is None
                outcome[begin] = 0 if rejection is None else REJECTION_CODE[rejection]
                lost[begin] = self.lost - before
                begin += 1
        self._in_order(counts, t_us, lost, begin, len(counts))
        return outcome, lost

    def _steps(self, counts: NDArray[np.uint8], t_us: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Step from the count in front; 1 for a new start, `COUNTS` for the invalid count 15."""
        former = np.empty_like(counts)
        former[:1] = 0 if self._baseline is None else self._baseline
        former[1:] = counts[:-1]
        steps = counts + np.uint8(COUNTS) - former
        steps -= np.uint8(COUNTS) * (steps >= COUNTS)
        if self.cycle_us is not None:
            silence = np.diff(t_us, prepend=self._received_us)
            steps[silence >= SILENCE_CYCLES * self.cycle_us] = 1
        if self._baseline is None:
            steps[:1] = 1
        steps[counts >= COUNTS] = COUNTS
        return steps

    def _in_order(
        self,
        counts: NDArray[np.uint8],
        t_us: NDArray[np.int64],
        lost: NDArray[np.int64],
        begin: int,
        end: int,
    ) -> None:
        """Accept the frames from `begin` to before `end`, each a good step behind the last."""
        if begin < end:
            self.lost += int(lost[begin:end].sum())
            self._received_us = int(t_us[end - 1])
            self._set_baseline(int(counts[end - 1]))

    def interrupt(self) -> None:
        """A frame was rejected for another reason: a run of frames that follow each other ends."""
        self._run = 0

    def _set_baseline(self, count: int) -> None:
        self._baseline = count
        self._run = 0
