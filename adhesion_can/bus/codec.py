"""Signals in and out of payloads by a plan that is made once per message.

The plan comes from cantools' parsed database: for each signal a shift and a mask on the payload
read as one integer. cantools is the oracle of its tests.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from cantools.database.can import Message, Signal

AVAILABLE_FROM_BITS = 8
"""Signals of this length and more say 'not available' by all ones."""


@dataclass(frozen=True)
class SignalPlan:
    """How one signal stands in its payload.

    Attributes:
        name: of the signal.
        length: bits.
        shift: of its lowest bit, in the payload as an integer of `byte_order`.
        big_endian: Motorola order.
        signed: two's complement.
        is_float: IEEE 754.
        scale: value = raw · scale + offset.
        offset: likewise.
        minimum: lowest value allowed, in the signal's unit; None: any.
        maximum: highest.
        not_available: raw value that says so; None: none does.

    """

    name: str
    length: int
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
    def of(cls, signal: Signal, size: int) -> "SignalPlan":
        """Plan of cantools' signal in a payload of `size` bytes."""
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
            shift=shift,
            big_endian=big,
            signed=signal.is_signed,
            is_float=signal.is_float,
            scale=float(signal.scale),
            offset=float(signal.offset),
            minimum=None if signal.minimum is None else float(signal.minimum),
            maximum=None if signal.maximum is None else float(signal.maximum),
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

    def in_range(self, value: float) -> bool:
        """Whether a physical value lies within the database's range.

        Half a raw step is allowed, since databases round the ends of their ranges.
        """
        slack = 0.0 if self.is_float else abs(self.scale) / 2
        if not abs(value) < float("inf"):
            return False
        low, high = self.minimum, self.maximum
        if low == high:
            return True  # [0|0] is a database's way to say 'no range'
        return (low is None or value >= low - slack) and (high is None or value <= high + slack)

    def encode(self, value: float | None) -> int:
        """Raw bits of a value, in place; None says 'not available'; saturates one below that.

        Raises:
            ValueError: None for a signal that has no way to say so.

        """
        if value is None:
            if self.not_available is None:
                raise ValueError(f"{self.name} has no raw value for 'not available'")
            return self.not_available << self.shift
        if self.is_float:
            real, integer = self._float_format
            (bits,) = struct.unpack(integer, struct.pack(real, (value - self.offset) / self.scale))
            return int(bits) << self.shift
        top = self.mask >> 1 if self.signed else self.mask
        if self.not_available is not None:
            top -= 1
        bottom = -(self.mask >> 1) - 1 if self.signed else 0
        ratio = (value - self.offset) / self.scale
        raw = round(min(max(ratio, bottom), top))
        return (raw & self.mask) << self.shift


class MessagePlan:
    """All signals of a message, with its multiplexing.

    Args:
        message: cantools' message.

    """

    def __init__(self, message: Message) -> None:
        self.name = message.name
        self.frame_id = message.frame_id
        self.is_extended = message.is_extended_frame
        self.size = message.length
        self.signals = {s.name: SignalPlan.of(s, message.length) for s in message.signals}
        self.multiplexed = {
            s.name: (s.multiplexer_signal, frozenset(s.multiplexer_ids))
            for s in message.signals
            if s.multiplexer_signal and s.multiplexer_ids
        }

    def present(self, name: str, little: int, big: int) -> bool:
        """Whether a payload carries a signal: false where its multiplexer selects another."""
        selector = self.multiplexed.get(name)
        if selector is None:
            return True
        chooser, ids = selector
        plan = self.signals[chooser]
        chosen = plan.raw(big if plan.big_endian else little)
        return chosen in ids and self.present(chooser, little, big)

    def encode(self, values: Mapping[str, float | None]) -> bytearray:
        """Payload of the message; bits of signals not named are 0.

        Args:
            values: by signal name, in the signals' units; None: not available.

        """
        little = big = 0
        for name, value in values.items():
            plan = self.signals[name]
            if plan.big_endian:
                big |= plan.encode(value)
            else:
                little |= plan.encode(value)
        word = little | int.from_bytes(big.to_bytes(self.size, "big"), "little")
        return bytearray(word.to_bytes(self.size, "little"))
