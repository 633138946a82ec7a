"""Identifiers of SAE J1939: 3 bits of priority, 18 of the parameter group, 8 of the source address.

A database names a message with one source address; on the bus the same parameter group may come
from another one, with another priority. Groups whose PDU format is below 240 go to a destination,
whose address stands in the identifier as well (SAE J1939-21).
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import EXTENDED

PROTOCOL = "j1939"
"""Protocol of a J1939 message in cantools, from the attribute `VFrameFormat` of its DBC."""
BROADCAST_FORMAT = 240
"""PDU format from which a group has no destination."""
SERVICE_GROUPS = {
    0xE800: "acknowledgement",
    0xEA00: "request",
    0xEB00: "transport protocol, data",
    0xEC00: "transport protocol, connection",
    0xEE00: "address claimed",
}
"""Groups by which J1939 manages itself; no database of signals has them."""


class IdFilter(NamedTuple):
    """Identifiers that are received: those that equal `number` in the bits of `mask`.

    Attributes:
        number: Identifier.
        is_extended: Whether the identifiers have 29 bits.
        mask: Bits that are compared.

    """

    number: int
    is_extended: bool
    mask: int

    @classmethod
    def exact(cls, number: int, is_extended: bool) -> "IdFilter":
        """Filter of one identifier."""
        return cls(number, is_extended, 0x1FFFFFFF if is_extended else 0x7FF)


def group_mask(frame_id: int) -> int:
    """Bits of an identifier that name its parameter group."""
    return 0x3FFFF00 if (frame_id >> 16) & 0xFF >= BROADCAST_FORMAT else 0x3FF0000


def parameter_group(frame_id: int) -> int:
    """Parameter group number (PGN) of an identifier of 29 bits."""
    return (frame_id & group_mask(frame_id)) >> 8


def source_address(frame_id: int) -> int:
    """Address of the sender in an identifier of 29 bits."""
    return frame_id & 0xFF


class Senders:
    """Which sender of each parameter group is listened to.

    The one that the database names; until it is heard, the first that is. Two messages of one group
    in a database differ by their senders: they are matched to the bit.

    Args:
        ids: Identifiers of 29 bits of the database's J1939 messages.

    """

    def __init__(self, ids: Iterable[int]) -> None:
        known = set(ids)
        groups = [parameter_group(number) for number in known]
        self._named = {
            group: number for number in known if groups.count(group := parameter_group(number)) == 1
        }
        self.heard: dict[int, int] = {}
        """Identifier that is listened to, by the one in the database."""
        self.others: dict[int, set[int]] = {}
        """Identifiers of further senders of a group, by the one in the database."""

    def __bool__(self) -> bool:
        return bool(self._named)

    def covers(self, frame_id: int) -> bool:
        """Whether a message is known by its group, whoever sends it."""
        return self._named.get(parameter_group(frame_id)) == frame_id

    def translate(self, frame_id: int) -> int:
        """The database's identifier for one of 29 bits from the bus; itself where there is none."""
        named = self._named.get(parameter_group(frame_id))
        if named is None:
            return frame_id
        if frame_id == named:
            self._switch(named)
        elif self.heard.setdefault(named, frame_id) != frame_id:
            self.others.setdefault(named, set()).add(frame_id)
            return frame_id
        return named

    def translate_keys(
        self, keys: NDArray[np.uint32], is_data: NDArray[np.bool_]
    ) -> NDArray[np.uint32]:
        """Keys of a block with the database's identifiers, as `translate` gives them one by one.

        Args:
            keys: Identifiers with `EXTENDED`, in the order of their frames; shape (n,).
            is_data: Whether a frame carries a payload, shape (n,).

        """
        out = keys.copy()
        for named in self._named.values():
            mask = group_mask(named) | EXTENDED
            same = is_data & ((keys & np.uint32(mask)) == np.uint32((named | EXTENDED) & mask))
            rows = np.flatnonzero(same)
            if not len(rows):
                continue
            own = keys[rows] == np.uint32(named | EXTENDED)
            # Rows before the named sender is heard may be those of another one.
            before = rows[: int(np.argmax(own))] if own.any() else rows
            if self.heard.get(named) == named:
                before = before[:0]
            if len(before):
                first = int(keys[before[0]]) & ~EXTENDED
                listened = self.heard.setdefault(named, first)
                out[before[keys[before] == np.uint32(listened | EXTENDED)]] = named | EXTENDED
            if own.any():
                self._switch(named)
            heard = {int(key) & ~EXTENDED for key in np.unique(keys[rows])}
            if further := heard - {self.heard[named], named}:
                self.others.setdefault(named, set()).update(further)
        return out

    def _switch(self, named: int) -> None:
        """Listen to the sender that the database names, from now on."""
        before = self.heard.get(named, named)
        if before != named:
            self.others.setdefault(named, set()).add(before)
        self.heard[named] = named
