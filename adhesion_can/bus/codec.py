"""Signals in and out of payloads, by a plan made once per message.

The plan comes from cantools' parsed database: for each signal a shift and a mask on the payload
read as one integer. A method `..._column` does the same for many payloads at once, equal to the
last bit. The tests compare with cantools.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from cantools.database.can import Message, Signal
from numpy.typing import NDArray

from adhesion_can.bus.j1939 import is_j1939

Raw = NDArray[np.int64] | NDArray[np.uint64]
"""Raw values; uint64 for an unsigned signal of 64 bits alone."""

AVAILABLE_FROM_BITS = 8
"""Shortest signal, bits, whose raw value of all ones means 'not available'."""

_FLOAT_TYPES = {
    16: (np.uint16, np.float16),
    32: (np.uint32, np.float32),
    64: (np.uint64, np.float64),
}


@dataclass(frozen=True)
class SignalPlan:
    """Position, type and scaling of one signal in its payload.

    Attributes:
        name: Name of the signal.
        length: Length of the signal, bits.
        size: Length of the payload, bytes.
        shift: Position of the signal's lowest bit, in the payload read as one integer of the
            signal's byte order.
        big_endian: Whether the byte order is big endian (Motorola).
        signed: Whether the raw value is a two's complement number.
        is_float: Whether the raw value is an IEEE 754 float.
        scale: Factor of value = raw · scale + offset, in the signal's unit.
        offset: Offset of value = raw · scale + offset, in the signal's unit.
        minimum: Lowest value allowed, in the signal's unit; None: any.
        maximum: Highest value allowed, in the signal's unit; None: any.
        not_available: Raw value for 'not available'; None: the signal has none.

    """

    name: str
    length: int
    size: int
    shift: int
    big_endian: bool
    signed: bool
    is_float: bool
    scale: float
    offset: float
    minimum: float | None
    maximum: float | None
    not_available: int | None

    @classmethod
    def from_signal(cls, signal: Signal, size: int) -> "SignalPlan":
        """Plan of a signal of cantools in a payload of `size` bytes."""
        big = signal.byte_order == "big_endian"
        shift = signal.start
        if big:
            # DBC numbers the most significant bit, counted from the low end of each byte.
            byte, bit = divmod(signal.start, 8)
            shift = 8 * size - (8 * byte + (7 - bit) + signal.length)
        long_enough = signal.length >= AVAILABLE_FROM_BITS and not signal.is_float
        ones = (1 << (signal.length - (1 if signal.is_signed else 0))) - 1
        return cls(
            name=signal.name,
            length=signal.length,
            size=size,
            shift=shift,
            big_endian=big,
            signed=signal.is_signed,
            is_float=signal.is_float,
            scale=nearest_float(signal.scale),
            offset=nearest_float(signal.offset),
            minimum=None if signal.minimum is None else nearest_float(signal.minimum),
            maximum=None if signal.maximum is None else nearest_float(signal.maximum),
            not_available=ones if long_enough else None,
        )

    @cached_property
    def mask(self) -> int:
        """Ones over the length of the signal."""
        return (1 << self.length) - 1

    @cached_property
    def _sign(self) -> int:
        return 1 << (self.length - 1)

    @cached_property
    def _sent_range(self) -> tuple[int, int]:
        """Smallest and largest raw value of a number that is sent."""
        top = self.mask >> 1 if self.signed else self.mask
        bottom = -(self.mask >> 1) - 1 if self.signed else 0
        return bottom, top if self.not_available is None else top - 1

    @cached_property
    def sendable(self) -> tuple[float, float]:
        """Lowest and highest value that fits into the raw value and the database's range.

        In the signal's unit; infinite for a float without a range.
        """
        ends = (-math.inf, math.inf)
        if not self.is_float:
            bottom, top = sorted(map(self.value, self._sent_range))
            ends = (bottom, top)
        low, high = self.minimum, self.maximum
        if low == high:
            return ends  # databases write [0|0] for 'no range'
        return (
            ends[0] if low is None else max(low, ends[0]),
            ends[1] if high is None else min(high, ends[1]),
        )

    @cached_property
    def _float_format(self) -> tuple[str, str]:
        return {16: ("<e", "<H"), 32: ("<f", "<I"), 64: ("<d", "<Q")}[self.length]

    def raw(self, word: int) -> int:
        """Raw value in a payload, read as one integer of this signal's byte order."""
        raw = (word >> self.shift) & self.mask
        if self.signed and raw & self._sign:
            raw -= self.mask + 1
        return raw

    def value(self, raw: int) -> float:
        """Physical value of a raw one, in the signal's unit."""
        if self.is_float:
            real, integer = self._float_format
            (number,) = struct.unpack(real, struct.pack(integer, raw & self.mask))
            return float(number) * self.scale + self.offset
        return raw * self.scale + self.offset

    def raw_column(self, words: NDArray[np.uint64]) -> Raw:
        """Raw values in many payloads: `raw` in columns.

        Args:
            words: Payloads as 64-bit words, shape (n, w); 8 w bytes reach the payload's end.

        Returns:
            Raw values, shape (n,).

        """
        # The signal is brought to the top of a word and from there down, which spreads its sign.
        top = self._at_top(words)
        down = 64 - self.length
        if self.signed:
            return np.asarray(top.view(np.int64) >> down)
        raw = top >> np.uint64(down)
        return raw if self.length == 64 else raw.view(np.int64)

    def _at_top(self, words: NDArray[np.uint64]) -> NDArray[np.uint64]:
        """Words whose highest bits are the signal's, shape (n,)."""
        if self.big_endian:
            # Counted from the first bit on the wire, whole words of the payload keep their places.
            place, before = divmod(8 * self.size - self.shift - self.length, 64)
            first = words[:, place].byteswap()
            if before + self.length <= 64:
                return np.asarray(first << np.uint64(before))
            low = words[:, place + 1].byteswap() >> np.uint64(64 - before)
            return np.asarray((first << np.uint64(before)) | low)
        place, before = divmod(self.shift, 64)
        behind = 64 - before - self.length
        if behind >= 0:
            return np.asarray(words[:, place] << np.uint64(behind))
        high = words[:, place + 1] << np.uint64(64 + behind)
        return np.asarray((words[:, place] >> np.uint64(-behind)) | high)

    def value_column(self, raw: Raw) -> NDArray[np.float64]:
        """Physical values of raw ones: `value` in columns.

        Args:
            raw: Raw values, shape (n,).

        Returns:
            Values in the signal's unit, shape (n,).

        """
        # Overflow to infinity and signalling NaN are numbers here as they are in `value`.
        with np.errstate(over="ignore", invalid="ignore"):
            number = self.float_column(raw) if self.is_float else raw.astype(np.float64)
            number *= self.scale
            number += self.offset
        return number

    def float_column(self, raw: Raw) -> NDArray[np.float64]:
        """Numbers whose IEEE 754 bits the raw values are, unscaled, shape (n,)."""
        integer, real = _FLOAT_TYPES[self.length]
        with np.errstate(invalid="ignore"):
            return raw.astype(integer).view(real).astype(np.float64)

    def in_range_column(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mask of the values within the database's range, shape (n,): `in_range` in columns."""
        slack = 0.0 if self.is_float else abs(self.scale) / 2
        inside = np.isfinite(values)
        low, high = self.minimum, self.maximum
        if low == high:
            return inside
        if low is not None:
            inside &= values >= low - slack
        if high is not None:
            inside &= values <= high + slack
        return inside

    def in_range(self, value: float) -> bool:
        """Whether a physical value lies within the database's range.

        Half a raw step is allowed, since databases round the ends of their ranges.
        """
        slack = 0.0 if self.is_float else abs(self.scale) / 2
        if not abs(value) < float("inf"):
            return False
        low, high = self.minimum, self.maximum
        if low == high:
            return True  # databases write [0|0] for 'no range'
        return (low is None or value >= low - slack) and (high is None or value <= high + slack)

    def encode(self, value: float | None) -> int:
        """Raw bits of a value at their position in the payload; saturates at the ends.

        None is encoded as 'not available', and numbers saturate one step below its raw value.

        Raises:
            ValueError: None for a signal without a raw value for 'not available'.

        """
        if value is None:
            if self.not_available is None:
                raise ValueError(f"{self.name} has no raw value for 'not available'")
            return self.not_available << self.shift
        if self.is_float:
            real, integer = self._float_format
            (bits,) = struct.unpack(integer, struct.pack(real, (value - self.offset) / self.scale))
            return int(bits) << self.shift
        bottom, top = self._sent_range
        ratio = (value - self.offset) / self.scale
        # Compared, not by min and max: every signal that is sent comes here.
        raw = bottom if ratio < bottom else top if ratio > top else round(ratio)
        return (raw & self.mask) << self.shift


def nearest_float(number: float) -> float:
    """The float nearest to a number of any size, infinity beyond the largest."""
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf


def among(raw: Raw, ids: Iterable[int]) -> NDArray[np.bool_]:
    """Mask of the raw values that are one of `ids`; shape of `raw`."""
    limits = np.iinfo(raw.dtype)
    possible = [number for number in ids if limits.min <= number <= limits.max]
    if len(possible) == 1:
        return np.asarray(raw == raw.dtype.type(possible[0]))
    return np.isin(raw, np.array(possible, dtype=raw.dtype))


class MessagePlan:
    """All signals of a message, with its multiplexing.

    Args:
        message: Message of cantools' database.

    """

    def __init__(self, message: Message) -> None:
        self.name = message.name
        self.frame_id = message.frame_id
        self.is_extended = message.is_extended_frame
        self.is_j1939 = is_j1939(message)
        self.size = message.length
        self.signals = {s.name: SignalPlan.from_signal(s, message.length) for s in message.signals}
        self.multiplexed = {
            s.name: (s.multiplexer_signal, frozenset(s.multiplexer_ids))
            for s in message.signals
            if s.multiplexer_signal and s.multiplexer_ids
        }

    def present(self, name: str, little: int, big: int) -> bool:
        """Whether a payload carries a signal: false where its multiplexer selects another."""
        condition = self.multiplexed.get(name)
        if condition is None:
            return True
        selector, ids = condition
        plan = self.signals[selector]
        selected = plan.raw(big if plan.big_endian else little) in ids
        return selected and self.present(selector, little, big)

    def present_column(self, name: str, words: NDArray[np.uint64]) -> NDArray[np.bool_] | None:
        """Mask of the payloads that carry a signal: `present` for many payloads at once.

        Args:
            name: Name of the signal.
            words: Payloads as 64-bit words, shape (n, w).

        Returns:
            Mask, shape (n,); None where every payload carries the signal.

        """
        condition = self.multiplexed.get(name)
        if condition is None:
            return None
        selector, ids = condition
        selected = among(self.signals[selector].raw_column(words), ids)
        above = self.present_column(selector, words)
        return selected if above is None else selected & above

    def encode(self, values: Mapping[str, float | None]) -> bytearray:
        """Payload of the message; bits of signals not named are 0.

        Args:
            values: Values by signal name, in the signals' units; None: not available.

        """
        little = big = 0
        for name, value in values.items():
            plan = self.signals[name]
            if plan.big_endian:
                big |= plan.encode(value)
            else:
                little |= plan.encode(value)
        if big:
            little |= int.from_bytes(big.to_bytes(self.size, "big"), "little")
        return bytearray(little.to_bytes(self.size, "little"))
