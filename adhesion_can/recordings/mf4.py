"""Bus loggings in MDF 4 to blocks: groups of records as arrays, merged by their stamps.

Gives the frames that python-can's MF4Reader gives, in its order. A layout that is not known here
is left to that reader, and so is every file that cannot be read to its end: its error has the
reason.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.bus.frame import MAX_PAYLOAD
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.candump import LAST_US, ReadReport
from adhesion_can.recordings.frame_rows import FrameCounter, NumberedBuses, payload_words
from adhesion_can.recordings.mf4_links import require_sound_links

_KINDS = {
    "CAN_DataFrame": Kind.DATA,
    "CAN_ErrorFrame": Kind.ERROR,
    "CAN_RemoteFrame": Kind.REMOTE,
}
_REQUIRED = {
    Kind.DATA: {"ID", "DataLength", "DataBytes"},
    Kind.ERROR: set[str](),
    Kind.REMOTE: {"ID", "DLC"},
}
_NUMBERS = ("BusChannel", "ID", "IDE", "DLC", "DataLength", "EDL", "BRS", "ESI", "RTR")
_NO_BUS = 0xFFFF
_ID_BITS = 0x1FFFFFFF
_LARGEST_STANDARD = 0x7FF
_SHOWN = 4
"""Number of signals that an error names."""
_LEAST = 1000  # records read at a time from one of many groups


class NotInColumnsError(Exception):
    """The rest of a file can only be read frame by frame."""


def open_mf4(path: Path) -> Any:
    """A file as asammdf opens it, to be closed.

    Args:
        path: Path of the file, which is not packed.

    Raises:
        ImportError: The package asammdf is not installed.
        LinkError: Its links cannot be followed to an end.
        Exception: The file cannot be opened; asammdf raises whatever its parsers meet.

    """
    from asammdf import MDF  # noqa: PLC0415  an extra is imported where it is needed

    require_sound_links(path)
    opened: Any = MDF  # which accepts more than its signature has
    # Else it goes through the whole file for its ids, and decodes all by a database that is inside.
    return opened(path, process_bus_logging=False)


def mf4_blocks(mdf: Any, report: ReadReport, size: int) -> Iterator[tuple[Block, float]]:
    """Frames of a bus logging, each block with the share of all records that was given by then.

    Args:
        mdf: File as `open_mf4` opens it.
        report: Statistics, filled with the blocks given so far.
        size: Number of rows of a block, from half to twice as many but for the last.

    Raises:
        NotInColumnsError: The frames behind those given so far need python-can's reader.

    """
    groups = _groups(mdf)
    if not groups and (signals := _signals(mdf)):
        shown = ", ".join(signals[:_SHOWN]) + (", .." if len(signals) > _SHOWN else "")
        raise RecordingError(
            str(mdf.original_name or mdf.name),
            f"it holds decoded signals ({shown}), not frames of a bus",
            "give the recording of the bus; 'identify' reads a table with a slip column",
        )
    total = sum(group.left for group in groups)
    given = 0
    buses = NumberedBuses(lambda number: "" if number == _NO_BUS else f"can{number}")
    counter = FrameCounter(report)
    for rows in _gathered(_merged(groups, size), size // 2):
        block = buses.named(rows)
        counter.add(block)
        given += len(block)
        yield block, given / total


class _Part(NamedTuple):
    """Rows of a group, or of several when they are merged.

    Attributes:
        order: Latest stamp of the group up to each row, s; rows of groups are merged by it.
        rows: Frames whose channel is the number of a bus, or `_NO_BUS`.

    """

    order: NDArray[np.float64]
    rows: Block

    def select(self, rows: slice | NDArray[np.int64]) -> "_Part":
        return _Part(self.order[rows], self.rows.select(rows))

    @classmethod
    def joined(cls, parts: "list[_Part]") -> "_Part":
        rows = Block.concatenate([part.rows for part in parts])
        return cls(np.concatenate([part.order for part in parts]), rows)


class _Group:
    """Records of one kind of frame, read in turn.

    Args:
        mdf: File as `open_mf4` opens it.
        index: Index of the channel group.
        name: Name of the structure that holds a frame.

    """

    def __init__(self, mdf: Any, index: int, name: str) -> None:
        self._mdf, self._index, self._name = mdf, index, name
        self._start = mdf.header.start_time.timestamp()
        self._done = 0
        self.left: int = mdf.groups[index].channel_group.cycles_nr

    def read(self, count: int) -> _Part:
        """Next `count` records, or the rest."""
        count = min(count, self.left)
        try:
            # As python-can's reader does; `select` leaves out some conversions.
            signal = self._mdf.get(
                self._name,
                self._index,
                record_offset=self._done,
                record_count=count,
                raw=False,
            )
        except Exception as error:  # its parsers raise whatever they meet
            raise NotInColumnsError(str(error)) from error
        if len(signal.samples) != count or len(signal.timestamps) != count:
            raise NotInColumnsError("some records are missing, or marked as invalid")
        self._done += count
        self.left -= count
        return self._part(signal.samples, signal.timestamps)

    def _part(self, samples: NDArray[Any], stamps: NDArray[np.float64]) -> _Part:
        kind = _KINDS[self._name]
        fields = _fields(samples, self._name)
        if missing := _REQUIRED[kind] - fields.keys():
            raise NotInColumnsError(f"{self._name} lacks {', '.join(sorted(missing))}")
        seconds = stamps + self._start
        if not (np.abs(seconds) <= LAST_US / 1e6).all():
            raise NotInColumnsError("stamps that are not times")
        # The group's earlier records do not count: they are given by now, and so is every row of
        # another group that stands in front of them.
        order = np.maximum.accumulate(seconds)
        return _Part(order, _rows(fields, kind, np.rint(seconds * 1e6).astype(np.int64)))


def _groups(mdf: Any) -> list[_Group]:
    """The groups that python-can's reader reads, in its order."""
    from asammdf.blocks import v4_constants as v4  # noqa: PLC0415

    if mdf.version < "4":
        raise NotInColumnsError(f"it is of version {mdf.version}")
    groups = []
    for index, group in enumerate(mdf.groups):
        head = group.channel_group
        source = head.acq_source
        if not (head.flags & v4.FLAG_CG_BUS_EVENT and head.cycles_nr and source):
            continue
        if not source.source_type & v4.SOURCE_BUS or source.bus_type != v4.BUS_TYPE_CAN:
            continue
        names = {channel.name for channel in group.channels}
        if name := next((name for name in _KINDS if name in names), None):
            groups.append(_Group(mdf, index, name))
    return groups


def _signals(mdf: Any) -> list[str]:
    """Names of the channels that are no times, in a file without a group of frames; else []."""
    from asammdf.blocks import v4_constants as v4  # noqa: PLC0415

    if any(group.channel_group.flags & v4.FLAG_CG_BUS_EVENT for group in mdf.groups):
        return []
    return [
        channel.name
        for index, group in enumerate(mdf.groups)
        for place, channel in enumerate(group.channels)
        if place != mdf.masters_db.get(index)
    ]


def _fields(samples: NDArray[Any], name: str) -> dict[str, NDArray[Any]]:
    """Columns of a structure that python-can's reader looks at, of the types that are usual."""
    names = samples.dtype.names or ()
    fields = {
        short: samples[f"{name}.{short}"]
        for short in (*_NUMBERS, "DataBytes", "Dir")
        if f"{name}.{short}" in names
    }
    for short, column in fields.items():
        if short == "DataBytes":
            is_known = column.dtype == np.uint8 and column.ndim == 2
        else:
            is_text = short == "Dir" and column.dtype.kind == "S"
            widest = 1 if short == "BusChannel" else 4
            is_number = column.dtype.kind in "ub" and column.dtype.itemsize <= widest
            is_known = (is_number or is_text) and column.ndim == 1
        if not is_known:
            raise NotInColumnsError(f"{name}.{short} is of type {column.dtype}")
    return fields


def _rows(fields: dict[str, NDArray[Any]], kind: Kind, t_us: NDArray[np.int64]) -> Block:
    count = len(t_us)
    kinds = np.full(count, kind, np.uint8)
    number = fields.get("ID", np.zeros(count)).astype(np.uint32)
    key = number & np.uint32(_ID_BITS)
    if kind != Kind.ERROR:
        # Where no channel says it, the highest bit of the id does; some loggers have neither.
        said = fields.get("IDE", (number & np.uint32(EXTENDED)) | (key > _LARGEST_STANDARD))
        key |= (said != 0) * np.uint32(EXTENDED)
    length, words = np.zeros(count, np.uint8), np.zeros((count, 1), np.uint64)
    if kind == Kind.DATA:
        length, words = _payload(fields["DataLength"], fields["DataBytes"])
        kinds[fields.get("EDL", np.zeros(count)) != 0] = Kind.FD
    bus = fields.get("BusChannel", np.full(count, _NO_BUS)).astype(np.uint16)
    return Block(t_us * 1000, key, kinds, length, bus, words, ())


def _payload(
    stated: NDArray[Any], data: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], NDArray[np.uint64]]:
    """Lengths and words of payloads, from their stated lengths and their bytes, shape (n, m)."""
    length = np.minimum(stated, data.shape[1])
    longest = int(length.max())
    if longest > MAX_PAYLOAD:
        raise NotInColumnsError(f"a payload of {longest} bytes")
    room = 8 if longest <= 8 else MAX_PAYLOAD
    padded = np.zeros((len(data), room), np.uint8)
    padded[:, : data.shape[1]] = data[:, :room]
    return length.astype(np.uint8), payload_words(padded, length.astype(np.int64))


def _merged(groups: list[_Group], size: int) -> Iterator[_Part]:
    """K-way merge of all groups by their stamps; of equal stamps the group in front comes first.

    A stamp that runs back in its group stands behind the later one in front of it, as in a merge
    that looks at one row of each group at a time.
    """
    share = max(size // max(len(groups), 1), min(size, _LEAST))
    heads: dict[_Group, _Part] = {}
    while groups := [group for group in groups if group in heads or group.left]:
        for group in groups:
            if group not in heads:
                heads[group] = group.read(share)
        # No row that is not read yet stands before the last row of the group that ends first.
        end, last = min((heads[group].order[-1], place) for place, group in enumerate(groups))
        parts = []
        for place, group in enumerate(groups):
            head = heads.pop(group)
            cut = int(np.searchsorted(head.order, end, "right" if place <= last else "left"))
            parts.append(head.select(slice(cut)))
            if cut < len(head.order):
                heads[group] = head.select(slice(cut, None))
        merged = _Part.joined(parts)
        in_order = len(groups) == 1
        yield merged if in_order else merged.select(np.argsort(merged.order, kind="stable"))


def _gathered(parts: Iterable[_Part], least: int) -> Iterator[Block]:
    """Blocks of at least `least` rows but for the last, from parts joined in their order."""
    waiting: list[Block] = []
    for part in parts:
        waiting.append(part.rows)
        if sum(map(len, waiting)) >= least:
            yield Block.concatenate(waiting)
            waiting = []
    if waiting:
        yield Block.concatenate(waiting)
