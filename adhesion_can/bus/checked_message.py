"""A message that is received: its checks and its values by signal name."""

from cantools.database.can import Message

from adhesion_can.bus.acceptance import (
    SERVICE_POLICY,
    DecodedFrame,
    MessageAcceptance,
    accept_frame,
)
from adhesion_can.bus.codec import MessagePlan
from adhesion_can.bus.database import cycle_us, e2e_data_id
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.rejection import Rejection

SignalValues = dict[str, float | None]
"""Values by signal, in its unit; None: not available."""


class CheckedMessage:
    """Decoder of one message with the checks of the service: length, checksum, range, counter.

    Args:
        message: Message with or without protection.

    """

    def __init__(self, message: Message) -> None:
        self.plan = MessagePlan(message)
        """Positions and scales of the signals."""
        self.cycle_us = cycle_us(message) or 0
        """Cycle time, µs; 0 where the database states none."""
        self._acceptance = MessageAcceptance(
            SERVICE_POLICY, message.length, e2e_data_id(message), cycle_us(message)
        )

    @property
    def lost(self) -> int:
        """Number of frames lost since the start, by the counter."""
        return self._acceptance.lost

    def is_carried_by(self, frame: Frame) -> bool:
        """Whether a frame has the id of the message."""
        plan = self.plan
        same = frame.arbitration_id == plan.frame_id and frame.is_extended == plan.is_extended
        return same and frame.is_data

    def read(self, frame: Frame) -> SignalValues | Rejection:
        """Values of a frame of the message, or the reason to reject it."""
        return accept_frame(self._acceptance, frame, self._decode)

    def _decode(self, frame: Frame) -> DecodedFrame[SignalValues]:
        little = int.from_bytes(frame.data, "little")
        big = int.from_bytes(frame.data, "big")
        values: SignalValues = {}
        in_range = True
        for name, signal in self.plan.signals.items():
            if not self.plan.present(name, little, big):
                continue
            raw = signal.raw(big if signal.big_endian else little)
            if raw == signal.not_available:
                values[name] = None
                continue
            values[name] = value = signal.value(raw)
            in_range = in_range and signal.in_range(value)
        return DecodedFrame(values, in_range)
