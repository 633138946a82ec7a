"""A message that is sent: its payload, its counter and its protection (AUTOSAR E2E profile 1)."""

from collections.abc import Mapping

from cantools.database.can import Message

from adhesion_can.bus.codec import MessagePlan
from adhesion_can.bus.database import cycle_us, e2e_data_id
from adhesion_can.bus.e2e import COUNTS, protect
from adhesion_can.bus.frame import Frame


class ProtectedMessage:
    """Encoder of one message, whose counter starts at 0.

    Args:
        message: Message with the signals `Crc` and `Alive` at the start of its payload.

    """

    def __init__(self, message: Message) -> None:
        self.plan = MessagePlan(message)
        """Positions and scales of the signals."""
        self.cycle_us = cycle_us(message) or 0
        """Cycle time, µs; 0 where the database states none."""
        data_id = e2e_data_id(message)
        self._data_id = message.frame_id if data_id is None else data_id
        self._count = 0

    def frame(self, t_us: int, values: Mapping[str, float | None]) -> Frame:
        """Next frame of the message; the one after it has the next count.

        Args:
            t_us: Stamp, µs.
            values: Values by signal, in its unit; None: not available.

        """
        frame = self.draft(t_us, values)
        self.count()
        return frame

    def draft(self, t_us: int, values: Mapping[str, float | None]) -> Frame:
        """The same as `frame`, but not counted: `count` does that where it is sent."""
        payload = self.plan.encode(values)
        protect(payload, self._data_id, self._count)
        plan = self.plan
        return Frame(t_us, plan.frame_id, bytes(payload), "", plan.is_extended)

    def count(self) -> None:
        """Take down that a frame with the present count is sent."""
        self._count = (self._count + 1) % COUNTS
