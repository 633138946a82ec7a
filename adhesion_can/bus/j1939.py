"""Identifiers of SAE J1939: 3 bits of priority, 18 of the parameter group, 8 of the source address.

A database names a message with one source address; on the bus the same parameter group may come
from another one, with another priority. Groups whose PDU format is below 240 go to a destination,
whose address is also in the identifier (SAE J1939-21).
"""

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from adhesion_can.bus.block import EXTENDED

NULL_ADDRESS = 0xFE
"""Source address of no sender: a database that has it means any."""
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


def is_j1939(message: Message) -> bool:
    """Whether a database says that a message is one of J1939, as `VFrameFormat` in a DBC."""
    return message.is_extended_frame and message.protocol == "j1939"


def group_mask(frame_id: int) -> int:
    """Bits of an identifier that name its parameter group."""
    return 0x3FFFF00 if (frame_id >> 16) & 0xFF >= BROADCAST_FORMAT else 0x3FF0000


def parameter_group(frame_id: int) -> int:
    """Parameter group number (PGN) of an identifier of 29 bits."""
    return (frame_id & group_mask(frame_id)) >> 8


def source_address(frame_id: int) -> int:
    """Address of the sender in an identifier of 29 bits."""
    return frame_id & 0xFF


def unmarked_sentence(name: str, named: int, heard: int) -> str:
    """Sentence about a message whose group comes from another sender than the database names.

    Args:
        name: Name of the message.
        named: Identifier in the database, which does not say that it is one of J1939.
        heard: Identifier of the same group on the bus.

    """
    return (
        f"{name} ({named:#x}): {heard:#x} carries its parameter group {parameter_group(named)} "
        "from another sender or with another priority; to receive it from any sender, mark the "
        "message as J1939 in the database (VFrameFormat J1939PG)"
    )


class Senders:
    """Which sender of each parameter group is listened to.

    The one that the database names; until it is heard, the first that is. Two messages of one group
    in a database differ by their senders: they are matched to the bit.

    Args:
        ids: Identifiers of 29 bits of the database's J1939 messages.

    """

    def __init__(self, ids: Iterable[int]) -> None:
        known = set(ids)
        members = Counter(map(parameter_group, known))
        self._named = {
            group: number for number in known if members[group := parameter_group(number)] == 1
        }
        self.heard: dict[int, int] = {}
        """Source address that is listened to, by the identifier in the database."""
        self.others: dict[int, set[int]] = {}
        """Source addresses of further senders of a group, by the identifier in the database."""

    def __bool__(self) -> bool:
        return bool(self._named)

    def find(self, frame_id: int) -> int | None:
        """The database's identifier of a group, from any sender; None where there is none."""
        return self._named.get(parameter_group(frame_id))

    def covers(self, frame_id: int) -> bool:
        """Whether a message is known by its group, from any sender."""
        return self.find(frame_id) == frame_id

    def translate(self, frame_id: int) -> int:
        """The database's identifier for one of 29 bits from the bus; itself where there is none."""
        named = self.find(frame_id)
        if named is None:
            return frame_id
        sender = source_address(frame_id)
        if sender == source_address(named):
            self._switch(named)
        elif self.heard.setdefault(named, sender) != sender:
            self.others.setdefault(named, set()).add(sender)
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
            mask, named_sender = group_mask(named) | EXTENDED, source_address(named)
            same = is_data & ((keys & np.uint32(mask)) == np.uint32((named | EXTENDED) & mask))
            rows = np.flatnonzero(same)
            if not len(rows):
                continue
            senders = keys[rows] & np.uint32(0xFF)
            by_named = senders == named_sender
            taken = by_named.copy()
            # Until the named sender is heard, the first that is.
            end = int(np.argmax(by_named)) if by_named.any() else len(rows)
            if end and self.heard.get(named) != named_sender:
                listened = self.heard.setdefault(named, int(senders[0]))
                taken[:end] = senders[:end] == listened
            if by_named.any():
                self._switch(named)
            out[rows[taken]] = named | EXTENDED
            further = {*np.unique(senders).tolist()} - {self.heard[named], named_sender}
            if further:
                self.others.setdefault(named, set()).update(further)
        return out

    def _switch(self, named: int) -> None:
        """Listen to the sender that the database names, from now on."""
        named_sender = source_address(named)
        before = self.heard.get(named, named_sender)
        if before != named_sender:
            self.others.setdefault(named, set()).add(before)
        self.heard[named] = named_sender
