"""A .blf file to blocks."""

from collections.abc import Callable, Iterator

from adhesion_can.bus.block import Block
from adhesion_can.recordings.blf_columns.containers import Faults, FileHead, read_contents
from adhesion_can.recordings.blf_columns.objects import FrameColumns
from adhesion_can.recordings.blf_columns.stored_bytes import StoredBytes
from adhesion_can.recordings.candump import ReadReport
from adhesion_can.recordings.frame_rows import FrameCounter, NumberedBuses, bus_from_1


def read_blf(
    read: Callable[[int], bytes], report: ReadReport, length: int | None, size: int
) -> Iterator[Block]:
    """Frames of a .blf file; whatever is damaged is passed over, and reported in the report.

    Args:
        read: Function that gives the next bytes of the file, fewer than asked for at its end.
        report: Statistics, filled with the blocks given so far.
        length: Size of the file, bytes; None where it is packed.
        size: Number of bytes of objects that are parsed at once, to within a container.

    Raises:
        ValueError: It is no .blf file.

    """
    stored = StoredBytes(read)
    head = FileHead.read(stored)
    return _blocks(stored, head, report, length, size)


def _blocks(
    stored: StoredBytes, head: FileHead, report: ReadReport, length: int | None, size: int
) -> Iterator[Block]:
    faults = Faults()
    buses = NumberedBuses(bus_from_1)
    counter = FrameCounter(report)
    columns = FrameColumns(head.start_ns, faults, report)
    for rows in columns.read(read_contents(stored, faults), size):
        block = buses.named(rows)
        counter.add(block)
        yield block
    faults.tell(report, head, length)
