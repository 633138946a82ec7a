"""Lines of candump text: those of `candump -L` by layouts, all others by `candump.parse_line`.

Both ways give the same for any bytes whatever.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import accumulate

import numpy as np

from adhesion_can.bus.block import Block, Kind, to_micros
from adhesion_can.bus.frame import MARKS, MOST_ID, Mark
from adhesion_can.recordings.candump import add_difference, read_line, stamp_ns
from adhesion_can.recordings.text_columns.form import Form, SingleLine
from adhesion_can.recordings.text_columns.line_layouts import Layout, learn_layout

_FRAME = re.compile(
    rb"\((?P<whole>\d{1,10})\.(?P<fraction>\d{1,9})\) (?P<bus>\S{1,16}) "
    rb"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#(?P<flag>[0-9A-Fa-f]))?"
    rb"(?P<data>[0-9A-Fa-f]{0,128})(?P<tail>(?: [RT])?\r?)\n?"
)
_MARK = re.compile(
    rb"<(?P<whole>\d{1,10})\.(?P<fraction>\d{6})> (?P<name>[a-z-]{1,16}) "
    rb"(?P<id>000)(?P<length>#)(?P<data>)\r?\n?"
)
_SPACE = re.compile(rb"\s")


class CandumpForm(Form):
    """Form of the lines of one file.

    Args:
        differences: Whether stamps are differences, to be summed.

    """

    least_first_us = 0

    def __init__(self, *, differences: bool = False) -> None:
        self._differences = differences
        self._clock_us = 0

    def find_layout(self, line: bytes) -> Layout | None:
        """Layout of a line; None where only `parse_line` can read it."""
        if match := _FRAME.fullmatch(line):
            is_extended = len(match["id"]) == 8
            return learn_layout(
                match,
                kind=Kind.FD if match["flag"] else Kind.DATA,
                unit_ns=10**9,
                is_extended=is_extended,
                last_id=MOST_ID if is_extended else 0x7FF,  # past it: flags of error frames
            )
        if (match := _MARK.fullmatch(line)) and (name := match["name"].decode()) in MARKS:
            return learn_layout(
                match,
                kind=Kind(Block.from_frames([Mark(0, name)]).kind[0]),
                unit_ns=10**9,
                is_extended=False,
                last_id=0,
                length=0,
                is_last=True,
            )
        return None

    def bus_name(self, text: bytes) -> str | None:
        """Name of a bus; None where it has white space, which separates the parts of a line."""
        return None if _SPACE.search(text) else text.decode("latin-1")

    def read(self, lines: Sequence[bytes]) -> Iterator[SingleLine]:
        """Lines as `parse_line` reads them."""
        for line in lines:
            item = read_line(line)
            t_ns = 0 if isinstance(item, str) else stamp_ns(line, item.t_us)
            yield SingleLine(item, t_ns)

    def stamped(self, block: Block) -> Block:
        """Rows whose frames have the sums of the differences that were read."""
        if not self._differences:
            return block
        frames = block.kind < Kind.ADVANCE
        steps = to_micros(block.t_ns[frames])
        sums = accumulate(steps.tolist(), add_difference, initial=self._clock_us)
        clock = np.fromiter(sums, np.int64, len(steps) + 1)
        self._clock_us = int(clock[-1])
        t_ns = block.t_ns.copy()
        t_ns[frames] = clock[1:] * 1000
        return replace(block, t_ns=t_ns)
