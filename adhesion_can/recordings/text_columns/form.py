"""What the parser of a text of frames asks the form of its lines."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.recordings.candump import ReadReport
from adhesion_can.recordings.text_columns.line_layouts import Layout


class SingleLine(NamedTuple):
    """A line that is read by itself.

    Attributes:
        item: Frame or mark of the line; else the kind of line as a `ReadReport` counts it, or None
            where it is not counted.
        t_ns: Stamp of the line to all its digits, ns.

    """

    item: Frame | Mark | str | None
    t_ns: int = 0


class Form(ABC):
    """Form of the lines of one file."""

    ends_at_cr = False
    """Whether a CR that no LF follows ends a line."""
    least_first_us: int | None = None
    """Stamp, µs, before which the first frame counts as backwards; None: none does."""

    @abstractmethod
    def find_layout(self, line: bytes) -> Layout | None:
        """Layout of a line; None where it can only be read by itself."""

    @abstractmethod
    def bus_name(self, text: bytes) -> str | None:
        """Name of a bus from its characters in a line, none where the layout has none.

        None where the characters are no bus.
        """

    @abstractmethod
    def read(self, lines: Sequence[bytes]) -> Iterable[SingleLine]:
        """Lines that no layout fits, one by one, in the order of the file."""

    def stamped(self, block: Block) -> Block:
        """The next rows of the file with their stamps, where each is not that of its line."""
        return block

    def tell(self, report: ReadReport) -> None:
        """Put what the lines say together into the notes of the recording."""
        del report
